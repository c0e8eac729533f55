"""Identification on a section, corrected by full solves of the leg itself in 3D.

The search goes on the model in plane strain times a correction. The leg is solved in 3D at the
optimum, the correction is made anew from that (`legfem.correction.confirmed`), and the search is
repeated, until neither the force that the correction predicted nor the optimum moves. What is left
is the correction's error, which the intervals carry: that of its last prediction, of the mesh, of
how much of the leg is modelled, and of first contact.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from legfem.common.progress import Progress
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.correction.confirmed import confirmed_correction
from legfem.correction.tabulated import FIRST_RATIO, TabulatedCorrection
from legfem.identify.applied_correction import CLOSE, Confirmation, SpatialEvidence
from legfem.identify.identification import Identification
from legfem.identify.leg_film import PressedLeg
from legfem.identify.leg_solver import LegSolver
from legfem.identify.result import IdentificationResult
from legfem.identify.spatial import LegModels
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.laws import LawName

MOST_SOLVES = 8
"""In 3D, of all laws together, those that measure the errors among them."""


@dataclass(eq=False)
class TwoFidelities:
    """Identifies laws of a subject by two models.

    Parameters
    ----------
    section : Identification
        By the model in plane strain; its correction, if it has one, is where the search starts and
        how the correction changes with the stiffness.
    models : LegModels
        Of the leg in 3D.
    progress : Progress
        Told of every solve.
    table : TabulatedCorrection, optional
        Of idealised legs.
    """

    section: Identification
    models: LegModels
    progress: Progress
    table: TabulatedCorrection | None
    _last: TabulatedCorrection | None = None
    _seen: PressedLeg | None = None

    def __post_init__(self) -> None:
        """Lay out the solver of the leg."""
        self._leg = LegSolver(self.models, self.progress)

    def identify(self, names: Sequence[LawName]) -> list[IdentificationResult]:
        """Return the results of laws, in their order.

        Raises
        ------
        SearchError
            If a solve in 3D stops short of the depth, or too few of the others reach it.
        """
        return [self._identify(name) for name in names]

    def _identify(self, name: LawName) -> IdentificationResult:
        started = time.perf_counter()
        correction = self._last or self.table
        result = self._fitted(name, correction)
        confirmations: list[Confirmation] = []
        while True:
            done = self._leg.full_solves + self._leg.rough_solves
            if done + self._leg.next_solves > MOST_SOLVES:
                break
            found, correction = self._confirmed(result, correction)
            before, result = result, self._fitted(name, correction)
            found = replace(found, moved=_moved(before, result))
            confirmations.append(found)
            self.progress.advance(
                f"3D differs by {100 * found.error:.2f} % of the force from what was predicted, "
                f"C10 moves by {100 * found.moved:.2f} %"
            )
            if found.error < CLOSE and found.moved < CLOSE:
                break
        return self._told(result, confirmations, time.perf_counter() - started)

    def _fitted(self, name: LawName, correction: TabulatedCorrection | None) -> IdentificationResult:
        (result,) = replace(self.section, correction=correction).identify([name])
        return result

    def _confirmed(
        self, result: IdentificationResult, predicted: TabulatedCorrection | None
    ) -> tuple[Confirmation, TabulatedCorrection]:
        """Solve the leg at an optimum, and return what that says of the correction."""
        values, grid = result.model_values, self._leg.grid
        c10, c20 = stiffness = _stiffness(values)
        self.progress.stage(f"the leg in 3D at C10 {c10:.3g}, C20 {c20:.3g} kPa")
        (section,) = self.section.solver.solve([values])
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
        told = Confirmation(c10, c20, outcome.seconds, outcome.factorisations, share)
        return told, self._last

    def _told(
        self, result: IdentificationResult, confirmations: Sequence[Confirmation], seconds: float
    ) -> IdentificationResult:
        grid, leg = result.measured.displacement, self.models.leg
        c10, c20 = _stiffness(result.values)
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
        warnings = []
        if not evidence.converged:
            warnings.append(
                f"The correction in 3D has not settled within {MOST_SOLVES} solves: its interval "
                "carries what its last prediction missed."
            )
        if leg.extruded:
            warnings.append(
                "The leg in 3D is the measured section, extruded: how the leg's girth changes "
                "along the cylinder is left out. Give a scan, surfaces or contours at several "
                "levels as [section]."
            )
        return replace(result, spatial=evidence, warnings=(*result.warnings, *warnings), wall_s=seconds)


def _stiffness(values: Mapping[str, float]) -> tuple[float, float]:
    """Return C10 and C20 of the deep tissue, kPa."""
    return mpa_to_kpa(values[DEEP_C10]), mpa_to_kpa(values.get(DEEP_C20, 0.0))


def _moved(before: IdentificationResult, after: IdentificationResult) -> float:
    """Return by how much C10, or without it what else was identified, moved; relative."""
    names = [DEEP_C10] if DEEP_C10 in after.parameters else list(after.parameters)
    moves = (
        abs(after.parameters[name].value / before.parameters[name].value - 1)
        for name in names
        if before.parameters[name].value != 0
    )
    return max(moves, default=0.0)
