"""Full solves of a leg in 3D, and what they say of P(d) and its errors."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.experiments.leg_3d import FIBRE_PARAMETERS, fibres_of
from legfem.inverse.catalogue import DEEP_C10, Values
from legfem.inverse.outcome import ForwardModel, FullSolver, Outcome
from legfem.inverse.search import SearchError
from legfem.jobs.store import Store
from legfem.legs.correction import FIRST_RATIO, first_contact_error, mesh_error, smooth_ratio
from legfem.legs.correction_of_leg import FIBRES
from legfem.legs.elastography import FibreRatio
from legfem.legs.model_3d import ROUGHER, LegModels
from legfem.mechanics.terms import Fibres
from legfem.solve.path import ForceCurve

ROUGH_SOLVES = 2
"""That measure errors."""
_GRID = 0.5


@dataclass(frozen=True, eq=False)
class SolvedLeg:
    """The leg in 3D at one stiffness."""

    outcome: Outcome
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
        self._full, self._shorter = self._solver(models.full), self._solver(models.shorter)
        # A solve with derivatives keeps no states to go on from: the quicker one has them.
        fibres = () if models.fibres is None else FIBRE_PARAMETERS
        self._rough = self._solver(models.rough, fibres)
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
        contact = first_contact_error(outcome.curve, flat, self.grid, P)
        return SolvedLeg(outcome, P, {"first contact": contact, **self.lasting(values, flat, P)})

    def lasting(self, values: Values, flat: ForceCurve, P: FloatArray) -> dict[str, FloatArray]:
        """Return modes of the error of P (n,) that are measured once: of mesh, length and fibres.

        Raises
        ------
        SearchError
            If a solve stops short of the depth.
        """
        if self._lasting:
            return self._lasting
        self.progress.stage("the same by larger elements, and shorter: what errors are left")
        curves = [self._solve(one, values).curve for one in (self._rough, self._shorter)]
        rough, shorter = (smooth_ratio(curve, flat, self.grid) for curve in curves)
        self.rough_solves = ROUGH_SOLVES
        self._lasting = {"mesh": mesh_error(P, rough, 1 / ROUGHER), "leg's length": shorter - rough}
        if self.models.fibres is not None:
            errors = fibre_errors(curves[0], self.models.fibres, values[DEEP_C10], self.grid)
            self._lasting |= {name: (P - 1) * share for name, share in errors.items()}
        return self._lasting

    def _solve(self, solver: FullSolver, values: Values) -> Outcome:
        (outcome,) = solver.solve([values])
        if not outcome.complete:
            raise SearchError(
                f"the leg in 3D stops at {outcome.curve.depth:.1f} mm of "
                f"{self.models.depth:g} mm ({outcome.reason}); use less of the recordings with "
                "--depth"
            )
        return outcome

    def _solver(self, model: ForwardModel, sensitivities: tuple[str, ...] = ()) -> FullSolver:
        kept, store = self.models.kept, None
        if kept is not None:
            store = Store(kept, Outcome, model.fingerprint())
        return FullSolver(model, store, 1, self.progress, sensitivities)


def fibre_errors(curve: ForceCurve, fibres: FibreRatio, c10: float, displacement: FloatArray) -> dict[str, FloatArray]:
    """Return errors (n,) as shares of a leg's force: of the ratio, and of fibres in tension.

    How stiff fibres are in tension isn't known: a standard deviation is a factor of 2.

    Parameters
    ----------
    curve
        With the derivatives by `FIBRE_PARAMETERS`.
    fibres
        The ratio and its error.
    c10
        Across the fibres, MPa.
    displacement
        (n,), mm. Before `legfem.legs.correction.FIRST_RATIO` it is level.
    """
    at = np.maximum(displacement, min(FIRST_RATIO, curve.depth))
    by = {name: curve.sensitivity(name, at) for name in FIBRE_PARAMETERS}
    at_two = fibres_of(c10, 2.0)
    by_ratio = Fibres.slope_by_ratio(at_two.region, c10, by)
    by_extension = at_two.extension * by[f"{at_two.name}.extension"]
    in_tension = by_extension * (fibres.value - 1) * np.log(2.0)
    return {f"{FIBRES}ratio": by_ratio * fibres.sd / curve(at), f"{FIBRES}stiffness in tension": in_tension / curve(at)}
