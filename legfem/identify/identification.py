"""Identification of a subject's deep tissue: a search for each law, and what it says."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from legfem.common.errors import InputError
from legfem.correction.choice import Correction
from legfem.identify.assess import Assessment, assess
from legfem.identify.catalogue import DEEP_C20, Values
from legfem.identify.laws import IdentifiedLaw, LawName, model_values
from legfem.identify.misfit import Misfit
from legfem.identify.plain import run_plain
from legfem.identify.reading import OFFSET
from legfem.identify.result import IdentificationResult
from legfem.identify.search import Search
from legfem.identify.settings import IdentificationSettings, Weighting
from legfem.identify.solver import FullSolver
from legfem.identify.trial import Trial
from legfem.inference.domain import Domain
from legfem.inference.parameter import Parameter
from legfem.recording import LoadingCurve, mean_loading_curve
from legfem.recording.reader import MINIMAL_DEPTH_MM
from legfem.subjects.subject import Subject

# C20 over its standard error below which the neo-Hookean limit is looked at by itself.
_NEAR_LIMIT = 3.0


def measured_curve(subject: Subject, depth: float | None = None) -> LoadingCurve:
    """Return the mean loading curve of a subject's trials, down to a depth (mm) at most.

    Raises
    ------
    InputError
        If the depth leaves too little to identify from.
    """
    curve = mean_loading_curve(
        subject.recordings, subject.instrument, starts_at_contact=subject.starts_at_contact
    )
    if depth is None:
        return curve
    if not depth >= MINIMAL_DEPTH_MM:
        raise InputError("--depth", f"{depth:g} mm", "is too little to identify from",
                         f"give at least {MINIMAL_DEPTH_MM:g} mm")  # fmt: skip
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

    def __post_init__(self) -> None:
        """Begin with no law searched for."""
        self._searches: dict[LawName, Search] = {}
        self._seconds: dict[LawName, float] = {}

    def identify(self, names: Sequence[LawName]) -> list[IdentificationResult]:
        """Return the results of laws, in their order."""
        if self.settings.emulator:
            self._solve_designs(names)
        return [self._identify(name) for name in names]

    def _identify(self, name: LawName) -> IdentificationResult:
        search = self._search(name)
        best, limit, law = search.best, False, search.law
        k = law.index(DEEP_C20)
        if k is not None and "neo-hookean" in self.laws:
            near = bool(best.point[k] <= _NEAR_LIMIT * search.standard_error()[k])
            if near or "neo-hookean" in self._searches:
                neo_hookean = self._search("neo-hookean").best
                if neo_hookean.objective <= best.objective:
                    best = neo_hookean
        if k is not None and best.values[DEEP_C20] == 0.0:
            limit = True
            search, best = _at_limit(search, best)
        return assess(
            Assessment(
                self.subject, search, best, limit, self.measured, self.correction,
                self._seconds[name],
            )
        )  # fmt: skip

    def _misfit(self, law: IdentifiedLaw) -> Misfit:
        return Misfit(
            self.measured, weighting_of(law, self.settings.weighting), self.correction,
            beyond_of(law.parameters, law.fixed), law.reads,
        )  # fmt: skip

    def _new_search(self, name: LawName) -> Search:
        law = self.laws[name]
        return Search(law, self._misfit(law), self.settings, self.solver)

    def _solve_designs(self, names: Sequence[LawName]) -> None:
        """Solve the designs of all laws together, which keeps all processes busy."""
        designs = {name: self._new_search(name).design() for name in names}
        points = [
            model_values(self.laws[name].values(point))
            for name, design in designs.items()
            for point in design
        ]
        self.solver.progress.stage("solving the designs of the search", len(points))
        started = time.perf_counter()
        self.solver.solve(points)
        each = (time.perf_counter() - started) / len(points)
        self._seconds = {name: each * len(design) for name, design in designs.items()}

    def _search(self, name: LawName) -> Search:
        if name not in self._searches:
            self.solver.progress.stage(f"identifying the {name} law")
            started = time.perf_counter()
            search = self._new_search(name)
            if self.settings.emulator:
                search.run()
            else:
                run_plain(search)
            self._searches[name] = search
            spent = time.perf_counter() - started
            self._seconds[name] = self._seconds.get(name, 0.0) + spent
        return self._searches[name]


def _at_limit(search: Search, best: Trial) -> tuple[Search, Trial]:
    """Return a search and its neo-Hookean limit, as points of the search's own law."""
    law = search.law
    parameters = tuple(
        replace(one, bounds=(0.0, one.bounds[1])) if one.name == DEEP_C20 else one
        for one in law.parameters
    )
    law = replace(law, parameters=parameters)
    point = Domain(parameters).inside(law.point({**law.fixed, **best.values}))
    if best in search.trials:
        return replace(search, law=law), best
    return replace(search, law=law), replace(best, point=point)


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
            "--weighting", "paper", "has no errors that a prior could be weighed against",
            "leave it out, or give covariance",
        )  # fmt: skip
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
