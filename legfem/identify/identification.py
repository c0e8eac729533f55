"""Identification of a subject's deep tissue: a search for each law, and what it says."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.correction.choice import Correction
from legfem.data import LoadingCurve, mean_loading_curve
from legfem.data.contact import LEG
from legfem.identify.assess import Assessment, assess
from legfem.identify.misfit import Misfit
from legfem.identify.result import IdentificationResult
from legfem.inverse.catalogue import Values
from legfem.inverse.instrument import OFFSET
from legfem.inverse.laws import IdentifiedLaw, LawName
from legfem.inverse.outcome import FullSolver
from legfem.inverse.parameter import Parameter
from legfem.inverse.searches import Searches
from legfem.inverse.settings import IdentificationSettings, Weighting
from legfem.legs.subject import Subject


def measured_curve(subject: Subject, depth: float | None = None) -> LoadingCurve:
    """Return the mean loading curve of a subject's trials, down to a depth (mm) at most.

    Raises
    ------
    InputError
        If the depth leaves too little to identify from.
    """
    curve = mean_loading_curve(subject.trials)
    if depth is None:
        return curve
    if not depth >= LEG.depth:
        raise InputError(
            "--depth", f"{depth:g} mm", "is too little to identify from", f"give at least {LEG.depth:g} mm"
        )
    n = int((curve.displacement <= depth + 1e-9).sum())
    return replace(
        curve,
        displacement=curve.displacement[:n],
        force=curve.force[:n],
        force_sd=curve.force_sd[:n],
        covariance=curve.covariance[:n, :n],
        trial_force=curve.trial_force[:, :n],
        n_samples=curve.n_samples[:n],
    )


@dataclass(eq=False)
class Identification:
    """Identifies laws from one measured curve; solves of one law aren't repeated for another.

    Parameters
    ----------
    subject : Subject
        The leg and its tissues.
    measured : LoadingCurve
        See `measured_curve`.
    laws : Mapping[str, IdentifiedLaw]
        By name, with what is free and what is held in each.
    solver : FullSolver
        Of a forward model pressed `beyond_of` further than the curve.
    settings : IdentificationSettings
        Of the search.
    correction : Correction, optional
        For 3D effects.
    """

    subject: Subject
    measured: LoadingCurve
    laws: Mapping[LawName, IdentifiedLaw]
    solver: FullSolver
    settings: IdentificationSettings
    correction: Correction | None = None

    def identify(self, names: Sequence[LawName]) -> list[IdentificationResult]:
        """Return the results of laws, in their order."""
        about = None
        if self._weighs_correction:
            about = self._searches(self._misfit).nearest(names)
        searches = self._searches(partial(self._misfit, about=about))
        return [
            assess(Assessment(self.subject, found, self.measured, self.correction)) for found in searches.find(names)
        ]

    @property
    def _weighs_correction(self) -> bool:
        """Whether the correction's error is to be weighed against what was known beforehand."""
        return self.correction is not None and any(len(law.priors) for law in self.laws.values())

    def _searches(self, misfit_of: Callable[[IdentifiedLaw], Misfit]) -> Searches[Misfit]:
        return Searches(self.laws, self.solver, self.settings, misfit_of)

    def _misfit(self, law: IdentifiedLaw, about: tuple[Values, FloatArray] | None = None) -> Misfit:
        return Misfit(
            self.measured,
            weighting_of(law, self.settings.weighting),
            self.correction,
            beyond_of(law.parameters, law.fixed),
            law.reads,
            about,
        )


def weighting_of(law: IdentifiedLaw, asked: Weighting | None) -> Weighting:
    """Return what is minimised: the plain sum where nothing else is asked for or needed.

    Raises
    ------
    InputError
        If the plain sum is asked for and there are priors.
    """
    if len(law.priors) == 0:
        return asked or "paper"
    if asked == "paper":
        raise InputError(
            "--weighting",
            "paper",
            "has no errors that a prior could be weighed against",
            "leave it out, or give covariance",
        )
    return "covariance"


def beyond_of(parameters: Sequence[Parameter], fixed: Values) -> float:
    """Return how far (mm) the model is pressed beyond the measured curve.

    Contact that began before the recording's zero takes the indenter deeper than it says.
    """
    least = fixed.get(OFFSET, 0.0)
    for one in parameters:
        if one.name == OFFSET:
            least = min(least, one.bounds[0])
    return max(0.0, -least)
