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
from dataclasses import dataclass, field, replace

import numpy as np

from legfem.common.progress import Progress
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.correction.confirmed import confirmed_correction
from legfem.correction.tabulated import (
    FIRST_RATIO,
    TabulatedCorrection,
    first_contact_error,
    mesh_error,
    smooth_ratio,
)
from legfem.identify.catalogue import DEEP_C10, DEEP_C20, Values
from legfem.identify.forward import ForwardModel, ForwardOutcome
from legfem.identify.identification import Identification
from legfem.identify.laws import LawName
from legfem.identify.result import CLOSE, Confirmation, IdentificationResult, SpatialEvidence
from legfem.identify.search import SearchError
from legfem.identify.solver import FullSolver
from legfem.identify.spatial import ROUGHER, LegModels
from legfem.jobs.store import Store
from legfem.solve.force_curve import ForceCurve

MOST_SOLVES = 8
"""In 3D, of all laws together, those that measure the errors among them."""
_ROUGH_SOLVES = 2
_GRID = 0.5


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
    _solved: int = 0
    _rough: int = 0
    _errors: dict[str, FloatArray] = field(default_factory=dict)
    _last: TabulatedCorrection | None = None

    def __post_init__(self) -> None:
        """Lay out the solvers."""
        models = self.models
        self._full = self._solver(models.full)
        self._roughs = [self._solver(model) for model in (models.rough, models.shorter)]
        end = models.depth
        self._grid = np.linspace(0.0, end, 1 + max(2, round(end / _GRID)))

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
            if self._solved + self._rough >= MOST_SOLVES - (0 if self._errors else _ROUGH_SOLVES):
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

    def _fitted(
        self, name: LawName, correction: TabulatedCorrection | None
    ) -> IdentificationResult:
        (result,) = replace(self.section, correction=correction).identify([name])
        return result

    def _confirmed(
        self, result: IdentificationResult, predicted: TabulatedCorrection | None
    ) -> tuple[Confirmation, TabulatedCorrection]:
        """Solve the leg at an optimum, and return what that says of the correction."""
        values, grid = result.model_values, self._grid
        c10, c20 = stiffness = _stiffness(values)
        self.progress.stage(f"the leg in 3D at C10 {c10:.3g}, C20 {c20:.3g} kPa")
        (flat,) = self.section.solver.solve([values])
        outcome = self._solve(self._full, values)
        self._solved += 1
        P = smooth_ratio(outcome.curve, flat.curve, grid)
        if not self._errors:
            self._errors = self._measured_errors(values, outcome.curve, flat.curve, P)
        before: FloatArray = np.zeros(len(grid))
        if predicted is not None:
            before = predicted.correction(grid, np.asarray(c10), np.asarray(c20))
        error = before - P
        contact = first_contact_error(outcome.curve, flat.curve, grid, P)
        self._last = confirmed_correction(
            f"this leg's own, solved in 3D at C10 {c10:.3g} kPa, C20 {c20:.3g} kPa",
            self.table, stiffness, grid, P,
            {"prediction": error if self._solved > 1 else 0 * error, "first contact": contact,
             **self._errors},
        )  # fmt: skip
        force = flat.curve(grid)
        share = float(np.max(np.abs(error * force)) / np.max(np.abs((1 - P) * force)))
        return Confirmation(c10, c20, outcome.seconds, outcome.factorisations, share), self._last

    def _measured_errors(
        self, values: Values, fine: ForceCurve, flat: ForceCurve, P: FloatArray
    ) -> dict[str, FloatArray]:
        """Return modes of P's error, by rougher solves of the leg and of a shorter one."""
        self.progress.stage("the leg in 3D by larger elements, and shorter: P's errors", 2)
        rough, shorter = (
            smooth_ratio(self._solve(solver, values).curve, flat, self._grid)
            for solver in self._roughs
        )
        self._rough += _ROUGH_SOLVES
        return {"mesh": mesh_error(P, rough, 1 / ROUGHER), "leg's length": shorter - rough}

    def _solve(self, solver: FullSolver, values: Values) -> ForwardOutcome:
        (outcome,) = solver.solve([values])
        if not outcome.complete:
            raise SearchError(
                f"the leg in 3D stops at {outcome.curve.depth:.1f} mm of {self.models.depth:g} mm "
                f"({outcome.reason}); use less of the recordings with --depth"
            )
        return outcome

    def _solver(self, model: ForwardModel) -> FullSolver:
        kept, store = self.models.kept, None
        if kept is not None:
            store = Store(kept, ForwardOutcome, model.fingerprint())
        return FullSolver(model, store, 1, self.progress, ())

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
            name: float(np.abs(np.interp(grid, self._grid, mode))[grid >= FIRST_RATIO].max())
            for name, mode in self._last.errors.items()
        }
        evidence = SpatialEvidence(
            leg.source, leg.extruded, leg.shape.length, tuple(confirmations), self._solved,
            self._rough, errors, table,
        )  # fmt: skip
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
        return replace(
            result, spatial=evidence, warnings=(*result.warnings, *warnings), wall_s=seconds
        )


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
