"""One explanation weighed: the base model, a mechanism or two, beside what their forms may leave."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from legfem.inverse.evidence import Discrepancy, Evidence, discrepancy_scales, possible_discrepancies, with_discrepancy
from legfem.inverse.explanation import INEXACT, Explanation
from legfem.inverse.form import INEXACT_SHARE
from legfem.inverse.laplace import gain_of_widths, laplace_posterior
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem
from legfem.inverse.map_fit import fit
from legfem.inverse.mechanism import null_of
from legfem.inverse.posterior import Posterior

FORM_SHARE = 0.1
"""Of all that a mechanism changes, what its form may leave at most: a law, a place or a mesh is off by some per cent of
the whole effect, of which a refit of the stiffness hides most."""


@dataclass(frozen=True, eq=False)
class Weighing:
    """What explanations of the same recordings are weighed by.

    Parameters
    ----------
    base
        The base model's fit.
    unknowns
        Errors of no known form that there may be, none among them.
    evidence
        With the errors and these.
    """

    base: LinearisedFit
    unknowns: Sequence[Discrepancy]
    evidence: Evidence

    @classmethod
    def about(cls, problem: LinearisedProblem, base: LinearisedFit) -> "Weighing":
        """Return the weighing of explanations about a base model's fit."""
        unknowns = possible_discrepancies(problem.predictor.observed, base.prediction)
        return cls(base, unknowns, Evidence(problem.errors, unknowns))

    def base_model(self, problem: LinearisedProblem, log_prior: float, unknown: bool) -> Explanation:
        """Return the base model alone, or with something unknown."""
        shares = [
            (-np.inf if unknown else 0.0) if u.covariance is None else (u.log_prior if unknown else -np.inf)
            for u in self.unknowns
        ]
        posterior = laplace_posterior(problem, self.evidence, self.base, shares)
        return Explanation(problem, self.base, posterior, log_prior, unknown, False)

    def of(
        self, problem: LinearisedProblem, fitted: LinearisedFit, log_prior: float, confirmed: bool = False
    ) -> Explanation:
        """Return a fit with mechanisms as an explanation, beside what their forms may leave."""
        shares = self._shares_beside(problem, fitted)
        posterior, plain = laplace_posterior(problem, self.evidence, fitted, shares), fitted
        if posterior.discrepancy_probability > 0.5:
            # Beside something unknown the parameters are elsewhere than a fit without it finds them,
            # and the evidence is linear about where they are.
            aware = _beside(problem, fitted, self.aware(problem, posterior))
            again = laplace_posterior(problem, self.evidence, aware, shares)
            if again.log_evidence > posterior.log_evidence:
                fitted, posterior = aware, again
        of_any_width = posterior.log_evidence + gain_of_widths(fitted, posterior)
        return Explanation(
            problem,
            fitted,
            replace(posterior, log_evidence=of_any_width),
            log_prior,
            False,
            confirmed,
            log_discrepancy_weights=tuple(shares),
            fit_without_discrepancy=None if fitted is plain else plain,
        )

    def with_strength_held(self, one: Explanation, hides: bool, held: LinearisedFit) -> Posterior:
        """Return what the data say of a fit with its strength held, beside what so strong an effect's form may leave.

        Parameters
        ----------
        one
            Explanation that the fit is of.
        hides
            Whether it explains no more than nothing does.
        held
            The fit.
        """
        shares = self._shares_beside(one.problem, held, True) if hides else one.log_discrepancy_weights
        return laplace_posterior(one.problem, self.evidence, held, shares)

    def aware(self, problem: LinearisedProblem, posterior: Posterior) -> LinearisedProblem:
        """Return the problem with the most probable of the unknown errors among its own."""
        most = self.unknowns[int(np.argmax(posterior.discrepancy_weights))]
        return problem.with_errors(with_discrepancy(problem.errors, most))

    def _shares_beside(self, problem: LinearisedProblem, fitted: LinearisedFit, hides: bool = False) -> list[float]:
        """Return the logarithms of the shares of unknown errors beside a model with mechanisms, or one that hides."""
        scales = discrepancy_scales(problem.predictor.observed, self.base.prediction)
        # In a channel that a mechanism doesn't change its form leaves nothing either.
        shown = shown_effects(problem, fitted, self.base)
        whole = _whole_effects(problem, fitted) if hides else [0.0] * len(shown)
        most = [
            max(INEXACT_SHARE * effect / scale, FORM_SHARE * all_of_it / scale, self.unknowns[1].size)
            for effect, all_of_it, scale in zip(shown, whole, scales, strict=True)
        ]
        fits = [
            u.covariance is not None and all(size <= own for size, own in zip(u.by_channel, most, strict=True))
            for u in self.unknowns
        ]
        share = np.log(INEXACT / max(sum(fits), 1))
        return [
            float(np.log(1 - INEXACT)) if u.covariance is None else (float(share) if small else -np.inf)
            for u, small in zip(self.unknowns, fits, strict=True)
        ]


def _beside(problem: LinearisedProblem, fitted: LinearisedFit, aware: LinearisedProblem) -> LinearisedFit:
    """Refit with something unknown among the errors; its misfit is told by the errors alone."""
    refit = fit(aware, fitted.mechanisms, fitted.values)
    return replace(refit, whitened=problem.whitened(refit.residual), jacobian=problem.whitened(refit.sensitivities))


def shown_effects(problem: LinearisedProblem, fitted: LinearisedFit, base: LinearisedFit) -> list[float]:
    """Return the root mean square of what a mechanism changes that the base model can't, by channel in its unit."""
    change = fitted.prediction - base.prediction
    basis = np.linalg.qr(base.jacobian)[0]
    white = problem.whitened(change)
    rest = problem.errors.lower @ (white - basis @ (basis.T @ white)) if problem.kept is None else change
    return [float(np.sqrt(np.mean(rest[span] ** 2))) for span in problem.predictor.observed.data.spans]


def _whole_effects(problem: LinearisedProblem, fitted: LinearisedFit) -> list[float]:
    """Return the root mean square of all that mechanisms change at the fitted stiffness, by channel in its unit."""
    nulls = {f"{m.name}.{m.parameters[0].name}": null_of(m.parameters[0]) for m in fitted.mechanisms}
    change = fitted.prediction - problem.predictor({**fitted.values, **nulls}, fitted.mechanisms)
    return [float(np.sqrt(np.mean(change[span] ** 2))) for span in problem.predictor.observed.data.spans]
