"""Identification of a subject's deep tissue: a search for each law, and what it says."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

from legfem.errors import InputError
from legfem.identify.assess import Assessment, assess
from legfem.identify.correction import Correction
from legfem.identify.laws import IdentifiedLaw, law_of
from legfem.identify.misfit import Misfit
from legfem.identify.plain import run_plain
from legfem.identify.result import IdentificationResult, LawName
from legfem.identify.search import Search
from legfem.identify.settings import IdentificationSettings
from legfem.identify.solver import FullSolver
from legfem.recording import LoadingCurve, mean_loading_curve
from legfem.recording.reader import MINIMAL_DEPTH_MM
from legfem.subject import Subject

LAWS: tuple[LawName, ...] = ("neo-hookean", "reduced-polynomial")

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
    if depth < MINIMAL_DEPTH_MM:
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
    solver : FullSolver
        Of a forward model pressed to the curve's greatest displacement.
    settings : IdentificationSettings
        Of the search.
    correction : Correction, optional
        For 3D effects.
    """

    subject: Subject
    measured: LoadingCurve
    solver: FullSolver
    settings: IdentificationSettings
    correction: Correction | None = None

    def __post_init__(self) -> None:
        """Begin with no law searched for."""
        self._searches: dict[LawName, Search] = {}
        self._seconds: dict[LawName, float] = {}

    def identify(self, laws: Sequence[LawName]) -> list[IdentificationResult]:
        """Return the results of laws, in their order."""
        if self.settings.emulator:
            self._solve_designs(laws)
        return [self._identify(law) for law in laws]

    def _identify(self, name: LawName) -> IdentificationResult:
        search = self._search(name)
        best, limit = search.best, False
        if name == "reduced-polynomial":
            near = best.stiffness[1] <= _NEAR_LIMIT * search.standard_error()[1]
            if near or "neo-hookean" in self._searches:
                neo_hookean = self._search("neo-hookean").best
                if neo_hookean.objective <= best.objective:
                    best = neo_hookean
            limit = best.stiffness[1] == 0.0
        return assess(
            Assessment(
                self.subject, search, best, limit, self.measured, self.correction,
                self._seconds[name],
            )
        )  # fmt: skip

    def _misfit(self) -> Misfit:
        return Misfit(
            self.measured,
            self.settings.weighting,
            self.correction,
            self.settings.numerical_error,
            self.settings.numerical_error_length,
        )

    def _law(self, name: LawName) -> IdentifiedLaw:
        return law_of(name, self.subject)

    def _new_search(self, name: LawName) -> Search:
        return Search(self._law(name), self._misfit(), self.settings, self.solver)

    def _solve_designs(self, laws: Sequence[LawName]) -> None:
        """Solve the designs of all laws together, which keeps all processes busy."""
        designs = {law: self._new_search(law).design() for law in laws}
        points = [point for design in designs.values() for point in design]
        self.solver.progress.stage("solving the designs of the search", len(points))
        started = time.perf_counter()
        self.solver.solve(points)
        each = (time.perf_counter() - started) / len(points)
        self._seconds = {law: each * len(design) for law, design in designs.items()}

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
