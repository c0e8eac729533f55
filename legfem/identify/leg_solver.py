"""Full solves of a leg in 3D, and what they say of P(d) and its errors."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.correction.tabulated import first_contact_error, mesh_error, smooth_ratio
from legfem.identify.catalogue import Values
from legfem.identify.forward import ForwardModel, ForwardOutcome
from legfem.identify.search import SearchError
from legfem.identify.solver import FullSolver
from legfem.identify.spatial import ROUGHER, LegModels
from legfem.jobs.store import Store
from legfem.solve.force_curve import ForceCurve

ROUGH_SOLVES = 2
"""That measure errors."""
_GRID = 0.5


@dataclass(frozen=True, eq=False)
class SolvedLeg:
    """The leg in 3D at one stiffness."""

    outcome: ForwardOutcome
    P: FloatArray
    """On the solver's grid, (n,)."""
    errors: dict[str, FloatArray]
    """Modes of P's error, (n,) each: of first contact, the mesh and the leg's length."""


@dataclass(eq=False)
class LegSolver:
    """Solves a leg in 3D; solves are kept where its models say.

    The errors of mesh and length are measured once, at the first stiffness: they change little
    with it.
    """

    models: LegModels
    progress: Progress
    full_solves: int = 0
    rough_solves: int = 0
    _lasting: dict[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Lay out the solvers."""
        models = self.models
        self._full, *self._roughs = (
            self._solver(model) for model in (models.full, models.rough, models.shorter)
        )
        self.grid = np.linspace(0.0, models.depth, 1 + max(2, round(models.depth / _GRID)))

    @property
    def next_solves(self) -> int:
        """How many solves the next stiffness takes."""
        return 1 if self._lasting else 1 + ROUGH_SOLVES

    def at(self, values: Values, flat: ForceCurve) -> SolvedLeg:
        """Return the leg at values of the model in plane strain, whose force is ``flat``.

        Raises
        ------
        SearchError
            If a solve stops short of the depth.
        """
        outcome = self._solve(self._full, values)
        self.full_solves += 1
        P = smooth_ratio(outcome.curve, flat, self.grid)
        if not self._lasting:
            self.progress.stage("the same by larger elements, and shorter: P's errors")
            rough, shorter = (
                smooth_ratio(self._solve(solver, values).curve, flat, self.grid)
                for solver in self._roughs
            )
            self.rough_solves = ROUGH_SOLVES
            self._lasting = {
                "mesh": mesh_error(P, rough, 1 / ROUGHER), "leg's length": shorter - rough,
            }  # fmt: skip
        contact = first_contact_error(outcome.curve, flat, self.grid, P)
        return SolvedLeg(outcome, P, {"first contact": contact, **self._lasting})

    def _solve(self, solver: FullSolver, values: Values) -> ForwardOutcome:
        (outcome,) = solver.solve([values])
        if not outcome.complete:
            raise SearchError(
                f"the leg in 3D stops at {outcome.curve.depth:.1f} mm of "
                f"{self.models.depth:g} mm ({outcome.reason}); use less of the recordings with "
                "--depth"
            )
        return outcome

    def _solver(self, model: ForwardModel) -> FullSolver:
        kept, store = self.models.kept, None
        if kept is not None:
            store = Store(kept, ForwardOutcome, model.fingerprint())
        return FullSolver(model, store, 1, self.progress, ())
