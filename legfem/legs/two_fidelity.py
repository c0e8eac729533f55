"""Identification on a section, corrected by full solves of the leg itself in 3D.

The search goes on the model in plane strain times a correction. The leg is solved in 3D at the
optimum, the correction is made anew from that (`legfem.legs.correction`), and the search is
repeated, until neither the force that the correction predicted nor the optimum moves. What is left
is the correction's error, which the intervals carry: that of its last prediction, of the mesh, of
how much of the leg is modelled, and of first contact.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import DEEP_C10, LawName
from legfem.inverse.fit import Fit, fit_with
from legfem.inverse.outcome import FullSolver
from legfem.inverse.settings import IdentificationSettings
from legfem.legs.correction import FIRST_RATIO, TabulatedCorrection, confirmed_correction
from legfem.legs.details import CLOSE, Confirmation, LegDetails, SpatialEvidence
from legfem.legs.film_3d import PressedLeg
from legfem.legs.model_3d import LegModels
from legfem.legs.notices import of_two_fidelities
from legfem.legs.problem import LegProblem
from legfem.legs.site_test import deep_stiffness
from legfem.legs.solver_3d import LegSolver

MOST_SOLVES = 8
"""In 3D, of all laws together, those that measure the errors among them."""


@dataclass(eq=False)
class TwoFidelities:
    """Fits laws to one site by two models.

    Parameters
    ----------
    problem : LegProblem
        Of one site in plane strain; its correction, if it has one, is where the search starts and how the correction
        changes with the stiffness.
    solver : FullSolver
        Of the section in plane strain.
    settings : IdentificationSettings
        Of the searches.
    models : LegModels
        Of the leg in 3D.
    progress : Progress
        Shown every solve.
    table : TabulatedCorrection, optional
        Of idealised legs.
    """

    problem: LegProblem
    solver: FullSolver
    settings: IdentificationSettings
    models: LegModels
    progress: Progress
    table: TabulatedCorrection | None
    _last: TabulatedCorrection | None = None
    _seen: PressedLeg | None = None

    def __post_init__(self) -> None:
        """Lay out the solver of the leg."""
        self._leg = LegSolver(self.models, self.progress)

    def fit(self, names: Sequence[LawName]) -> list[Fit[LegDetails]]:
        """Fit laws, in their order.

        Raises
        ------
        SearchError
            If a solve in 3D stops short of the depth, or too few of the others reach it.
        """
        return [self._fit(name) for name in names]

    def _fit(self, name: LawName) -> Fit[LegDetails]:
        started = time.perf_counter()
        correction = self._last or self.table
        result = self._on_section(name, correction)
        confirmations: list[Confirmation] = []
        while True:
            done = self._leg.full_solves + self._leg.rough_solves
            if done + self._leg.next_solves > MOST_SOLVES:
                break
            found, correction = self._confirmed(result, correction)
            before, result = result, self._on_section(name, correction)
            found = replace(found, moved=_moved(before, result))
            confirmations.append(found)
            self.progress.advance(
                f"3D differs by {100 * found.error:.2f} % of the force from what was predicted, "
                f"C10 moves by {100 * found.moved:.2f} %"
            )
            if found.error < CLOSE and found.moved < CLOSE:
                break
        return self._with_evidence(result, confirmations, time.perf_counter() - started)

    def _on_section(self, name: LawName, correction: TabulatedCorrection | None) -> Fit[LegDetails]:
        (result,) = fit_with(self.problem.corrected([correction]), [name], self.solver, self.settings)
        return result

    def _confirmed(
        self, result: Fit[LegDetails], predicted: TabulatedCorrection | None
    ) -> tuple[Confirmation, TabulatedCorrection]:
        """Solve the leg at an optimum; return what that says of the correction, and the correction made anew."""
        values, grid = result.model_values, self._leg.grid
        c10, c20 = stiffness = deep_stiffness(values)
        self.progress.stage(f"the leg in 3D at C10 {c10:.3g}, C20 {c20:.3g} kPa")
        (section,) = self.solver.solve([values])
        solved = self._leg.at(values, section.curve)
        before: FloatArray = np.zeros(len(grid))
        if predicted is not None:
            before = predicted.correction(grid, np.asarray(c10), np.asarray(c20))
        missed, flat = before - solved.P, section.curve(grid)
        share = float(np.max(np.abs(missed * flat)) / np.max(np.abs((1 - solved.P) * flat)))
        # What the table or plane strain missed isn't what a solve nearby will.
        near = self._leg.full_solves > 1 or share < CLOSE
        prediction = missed if near else 0 * missed
        self._last = confirmed_correction(
            f"this leg's own, solved in 3D at C10 {c10:.3g} kPa, C20 {c20:.3g} kPa",
            self.table,
            stiffness,
            grid,
            solved.P,
            {"prediction": prediction, **solved.errors},
        )
        outcome = solved.outcome
        self._seen = self.models.pressed(outcome)
        return Confirmation(c10, c20, outcome.seconds, outcome.factorisations, share), self._last

    def _with_evidence(
        self, result: Fit[LegDetails], confirmations: Sequence[Confirmation], seconds: float
    ) -> Fit[LegDetails]:
        grid, leg = result.tests[0].force.channel.station, self.models.leg
        c10, c20 = deep_stiffness(result.values)
        assert self._last is not None
        table = None
        if self.table is not None:
            table = self.table.correction(grid, np.asarray(c10), np.asarray(c20))
        errors = {
            name: float(np.abs(np.interp(grid, self._leg.grid, mode))[grid >= FIRST_RATIO].max())
            for name, mode in self._last.errors.items()
        }
        evidence = SpatialEvidence(
            leg.source,
            leg.extruded,
            leg.shape.length,
            tuple(confirmations),
            self._leg.full_solves,
            self._leg.rough_solves,
            errors,
            table,
            self._seen,
        )
        return replace(
            result,
            details=replace(result.details, spatial=evidence),
            log=replace(result.log, wall_s=seconds),
            warnings=(*result.warnings, *of_two_fidelities(evidence, MOST_SOLVES)),
        )


def _moved(before: Fit[LegDetails], after: Fit[LegDetails]) -> float:
    """Relative change of C10, or without it of what else was identified."""
    names = [DEEP_C10] if DEEP_C10 in after.estimates else list(after.estimates)
    moves = (
        abs(after.estimates[name].value / before.estimates[name].value - 1)
        for name in names
        if before.estimates[name].value != 0
    )
    return max(moves, default=0.0)
