"""Recordings of several sites beside one leg's model, each weighed by its own errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.linalg import block_diag

from legfem.common.units import FloatArray
from legfem.data import LoadingCurve
from legfem.identify.error_sources import covariances_of_modes
from legfem.identify.misfit import Misfit
from legfem.inverse.comparison import Comparison, Covariances, Prediction, total_of
from legfem.inverse.instrument import GAIN, OFFSET, ZERO
from legfem.inverse.outcome import Outcome


def with_own_errors(curve: LoadingCurve, sds: Mapping[str, float]) -> LoadingCurve:
    """Return a site's curve that errs by a gain, a zero and a first contact of its own, too.

    Parameters
    ----------
    curve : LoadingCurve
        n forces.
    sds : Mapping[str, float]
        Standard deviations by full name: ``instrument.gain`` (-), ``instrument.zero`` (N),
        ``instrument.contact_offset`` (mm). As errors of the curve they are what letting them err
        by a prior comes to, to first order.
    """
    slope = np.gradient(curve.force, curve.displacement)
    effects = {GAIN: curve.force, ZERO: np.ones(len(curve.force)), OFFSET: slope}
    covariance = np.array(curve.covariance)
    for name, sd in sds.items():
        covariance += sd**2 * np.outer(effects[name], effects[name])
    return replace(curve, covariance=covariance, force_sd=np.sqrt(np.diag(covariance)))


@dataclass(frozen=True, eq=False)
class SitesMisfit(Comparison):
    """How far forces are from the measured curves of several sites.

    A site's errors are its own, but for the correction for the cylinder's ends: what is wrong with
    that is taken to be wrong alike at all sites of a leg, mode by mode, so that it doesn't average
    out. It counts in the weights where it does in the parts' (`Misfit.about`).

    Parameters
    ----------
    parts : tuple of Misfit
        One a site, of n forces together.
    """

    parts: tuple[Misfit, ...]

    def near(self, values: Mapping[str, float], force: FloatArray) -> SitesMisfit:
        """Return the same with the correction's error in the weights.

        Parameters
        ----------
        values, force
            Of a solve near the recordings, (n,), N.
        """
        every = zip(self.parts, self.spans, strict=True)
        return SitesMisfit(tuple(replace(part, about=(values, force[span])) for part, span in every))

    @cached_property
    def spans(self) -> list[slice]:
        """Where every site's forces stand."""
        ends = np.cumsum([0, *map(len, self.parts)])
        return [slice(*pair) for pair in pairwise(ends)]

    @cached_property
    def measured_force(self) -> FloatArray:
        """Of all sites (n,), N."""
        return np.concatenate([part.measured_force for part in self.parts])

    @property
    def if_deeper(self) -> FloatArray:
        """Change of the measured forces (n,) per relative change of the displacements, N."""
        return np.concatenate([part.if_deeper for part in self.parts])

    @property
    def reach(self) -> str:
        """The sites' depths."""
        return ", ".join(part.reach for part in self.parts)

    @property
    def in_errors(self) -> bool:
        """Every site is weighed by its errors."""
        return True

    def reached_by(self, outcome: Outcome) -> bool:
        """Return whether every site came to its depth."""
        return all(part.reached_by(_of_site(outcome, k)) for k, part in enumerate(self.parts))

    def predict(self, outcome: Outcome, readings: FloatArray) -> Prediction:
        """Return complete full solves as they are read."""
        every = [part.predict(_of_site(outcome, k), readings) for k, part in enumerate(self.parts)]
        force = np.concatenate([one.force for one in every])
        by = {name: np.concatenate([one.sensitivities[name] for one in every]) for name in every[0].sensitivities}
        return Prediction(force, by, force, by)

    def read(self, force: FloatArray, readings: FloatArray) -> FloatArray:
        """Return the model's forces (..., n) as they are: instruments' errors are the curves'."""
        return force

    @cached_property
    def covariance(self) -> FloatArray:
        """Of measured less predicted forces at the truth; (n, n), N2.

        Without the correction's, unless it counts in the weights.
        """
        near = [part.about for part in self.parts if part.about is not None]
        if not near:
            return np.asarray(block_diag(*(part.covariance for part in self.parts)))
        values, _ = near[0]
        return total_of(self._covariances(values, [force for _, force in near]))

    def covariance_at(self, values: Mapping[str, float]) -> FloatArray:
        """Return `covariance` with the correction's; (n, n), N2."""
        return total_of(self.covariances_at(values))

    def covariances_at(self, values: Mapping[str, float]) -> Covariances:
        """Return covariances (n, n), N2, at values, by source; the correction's is alike at all."""
        return self._covariances(values, [part.measured_force for part in self.parts])

    def _covariances(self, values: Mapping[str, float], forces: Sequence[FloatArray]) -> Covariances:
        modes: dict[str, FloatArray] = {}
        for part, span, force in zip(self.parts, self.spans, forces, strict=True):
            for name, error in part.modes_of_correction(values, force).items():
                modes.setdefault(name, np.zeros(len(self)))[span] = error
        return {
            "recordings": block_diag(*(part.measured.covariance for part in self.parts)),
            "model": block_diag(*(part.numerical_covariance for part in self.parts)),
            **covariances_of_modes(modes),
        }


def _of_site(outcome: Outcome, number: int) -> Outcome:
    return replace(outcome, curves=(outcome.curves[number],))
