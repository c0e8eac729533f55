"""Responses by finite elements: each solution made once and kept on disk.

A solution that doesn't follow its protocol to the end, now or before, has NaN for its values, and
so has all that is computed from them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.correction.tabulated import TabulatedCorrection
from legfem.diagnose.mechanisms import Solution, TissueMechanism, Values
from legfem.diagnose.mechanisms.contact_slip import ContactSlip
from legfem.diagnose.mechanisms.end_effects import EndEffects
from legfem.diagnose.mechanisms.viscoelasticity import TIMES_S, Viscoelasticity
from legfem.diagnose.observations import Observations
from legfem.diagnose.stations import Stations
from legfem.diagnose.variants import Stopped, Variants
from legfem.jobs.key import key_of
from legfem.jobs.store import Store
from legfem.solve.protocol import Protocol

GRID_STEP_MM = 0.5
ELASTIC_DERIVATIVES = ("deep.C10", "deep.C20")
_SMALLEST_FORCE_N = 1e-6

if TYPE_CHECKING:
    from legfem.experiments.placement import Placement
    from legfem.meshing.motion import MeshMotion

PLAIN = Solution("plain")
"""The base model with no term of any mechanism."""

type Columns = dict[str, FloatArray]


@dataclass(eq=False)
class SolvedResponses:
    """Responses of one leg, by solutions made when asked for.

    Parameters
    ----------
    variants
        The leg's models.
    depth
        Of the elastic curves, mm.
    folder
        Where solutions are kept; none is without it.
    fingerprint
        Of all that a solution depends on beside its arguments.
    correction
        Of 3D effects.
    """

    variants: Variants
    depth: float
    folder: Path | None
    fingerprint: Mapping[str, Any]
    correction: TabulatedCorrection | None = None
    c10_bounds: tuple[float, float] = (0.01, 100.0)
    c20_bounds: tuple[float, float] = (0.0, 100.0)
    solutions: int = 0
    """Made, not recalled."""
    _known: dict[str, Columns] = field(default_factory=dict, repr=False)

    @property
    def grid(self) -> FloatArray:
        """Displacements of the elastic curves, mm."""
        return GRID_STEP_MM * np.arange(1, round(self.depth / GRID_STEP_MM) + 1)

    def curve(self, c10: float, c20: float) -> FloatArray:
        """Return the elastic force at the grid, N."""
        return self._ramp(c10, c20, Solution())

    def _ramp(self, c10: float, c20: float, solution: Solution) -> FloatArray:
        protocol = Protocol.ramp(self.depth, 1.0)
        return self._solve(protocol, self.grid, c10, c20, solution, ())["force"]

    def elastic(self, c10: float, c20: float) -> Columns:
        """Return the elastic force and its derivatives (N per MPa or 1/MPa) at the grid."""
        protocol = Protocol.ramp(self.depth, 1.0)
        return self._solve(protocol, self.grid, c10, c20, Solution(), ELASTIC_DERIVATIVES)

    def relative_change(
        self,
        mechanism: TissueMechanism,
        values: Values,
        c10: float,
        c20: float,
        observed: Observations,
    ) -> FloatArray:
        """Return what a mechanism adds to the elastic force, over that force; (n,)."""
        if isinstance(mechanism, EndEffects):
            return end_effect(self.correction, values, c10, c20, observed)
        solution = mechanism.solution(values)
        if not mechanism.along_path:
            change = self.elastic_change(solution, c10, c20)
            if isinstance(mechanism, ContactSlip):
                change = values["slip"] * change
            return _at_displacement(self.grid, change, observed.displacement, level=True)
        return observed.spread(
            [self.path_change(solution, s, c10, c20) for s in observed.protocols]
        )

    def elastic_change(self, solution: Solution, c10: float, c20: float) -> FloatArray:
        """Return the relative change of the elastic force at the grid."""
        before = np.maximum(self.curve(c10, c20), _SMALLEST_FORCE_N)
        return self._ramp(c10, c20, solution) / before - 1.0

    def path_change(
        self, solution: Solution, stations: Stations, c10: float, c20: float
    ) -> FloatArray:
        """Return the relative change at a protocol's stations (m,)."""
        # A porous leg has another formulation: compared with itself, its own error cancels.
        porous = solution.variant == "porous"
        null = Solution("porous", dict.fromkeys(solution.parameters, 0.0)) if porous else Solution()
        before = _at_displacement(self.grid, self._ramp(c10, c20, null), stations.displacement)
        changed = self._solve(stations.protocol, stations.time, c10, c20, solution, ())["force"]
        return changed / np.maximum(before, _SMALLEST_FORCE_N) - 1.0

    def relaxation(
        self, mechanism: Viscoelasticity, stations: Stations, c10: float, c20: float
    ) -> FloatArray:
        """Return the relative change per unit ratio of every branch; (branches, stations)."""
        branches = mechanism.branches()
        times = dict(zip((f"{n}.relaxation_time" for n in branches), TIMES_S, strict=True))
        asked = tuple(f"{name}.ratio" for name in branches)
        solution = Solution(mechanism.variant, times)
        columns = self._solve(stations.protocol, stations.time, c10, c20, solution, asked)
        force = np.maximum(columns["force"], _SMALLEST_FORCE_N)
        return np.array([columns[name] / force for name in asked])

    def sensitivities(self, names: Sequence[str], c10: float, c20: float) -> Columns:
        """Return relative changes of the elastic force at the grid by relative ones of parameters.

        Parameters
        ----------
        names
            Full names in the model.
        c10, c20
            kPa.
        """
        protocol = Protocol.ramp(self.depth, 1.0)
        columns = self._solve(protocol, self.grid, c10, c20, PLAIN, tuple(names))
        force = np.maximum(columns["force"], _SMALLEST_FORCE_N)
        own = self.variants.parameters(PLAIN.variant)
        return {name: own[name] * columns[name] / force for name in names}

    def displaced(
        self, moved: MeshMotion | None, placement: Placement | None, c10: float, c20: float
    ) -> FloatArray:
        """Return the relative change of the elastic force at the grid by another geometry."""
        protocol = Protocol.ramp(self.depth, 1.0)
        before = self._solve(protocol, self.grid, c10, c20, PLAIN, ())["force"]
        after = self._solve(protocol, self.grid, c10, c20, PLAIN, (), moved, placement)["force"]
        return after / np.maximum(before, _SMALLEST_FORCE_N) - 1.0

    def _solve(
        self,
        protocol: Protocol,
        at: FloatArray,
        c10: float,
        c20: float,
        solution: Solution,
        derivatives: tuple[str, ...],
        moved: MeshMotion | None = None,
        placement: Placement | None = None,
    ) -> Columns:
        """Return force and derivatives at times of a protocol."""
        asked = {
            "protocol": [list(protocol.time), list(protocol.displacement)],
            "at": np.round(at, 9).tolist(),
            "deep_kPa": [float(c10), float(c20)],
            "variant": solution.variant,
            "terms": self.variants.described(solution.variant),
            "parameters": {k: float(v) for k, v in solution.parameters.items()},
            "scaled": {k: float(v) for k, v in solution.scaled.items()},
            "tilt_deg": float(solution.tilt_deg),
            "derivatives": list(derivatives),
            "geometry": repr((moved, placement)),
        }
        key = key_of(asked)
        if key not in self._known:

            def make() -> Columns:
                return self._made(protocol, at, c10, c20, solution, derivatives, moved, placement)

            store = self._store
            self._known[key] = make() if store is None else store.get_or_make(asked, make)
        columns = self._known[key]
        if "force" not in columns:
            return {name: np.full(len(at), np.nan) for name in ("force", *derivatives)}
        return columns

    @cached_property
    def _store(self) -> Store[Columns] | None:
        if self.folder is None:
            return None
        return Store(self.folder, dict[str, FloatArray], self.fingerprint)

    def _made(
        self,
        protocol: Protocol,
        at: FloatArray,
        c10: float,
        c20: float,
        solution: Solution,
        derivatives: tuple[str, ...],
        moved: MeshMotion | None,
        placement: Placement | None,
    ) -> Columns:
        self.solutions += 1
        deep = {"deep.C10": kpa_to_mpa(c10), "deep.C20": kpa_to_mpa(c20)}
        variants = self.variants if moved is None else replace(self.variants, moved=moved)
        path = variants.follow(protocol, deep, solution, derivatives, placement)
        if isinstance(path, Stopped):
            return {"stopped": np.zeros(0)}
        slopes = {name: path.sensitivity_at(name, at) for name in derivatives}
        return {"force": path.force_at(at), **slopes}


def end_effect(
    correction: TabulatedCorrection | None,
    values: Values,
    c10: float,
    c20: float,
    observed: Observations,
) -> FloatArray:
    """Return the relative change (n,) by a share of the idealised leg's correction."""
    if correction is None:
        raise ValueError("there is no 3D correction")
    d = observed.displacement
    P = correction.correction(d, np.asarray(c10), np.asarray(c20))
    for name, mode in EndEffects.MODES.items():
        if mode in correction.errors:
            P = P + values[name] * np.interp(d, correction.displacement, correction.errors[mode])
    return np.asarray(-values["scale"] * P)


def _at_displacement(
    grid: FloatArray, values: FloatArray, at: FloatArray, level: bool = False
) -> FloatArray:
    """Interpolate from the grid; towards zero to nothing, or level from the first point on."""
    if np.isnan(values).any():
        return np.full(len(at), np.nan)
    if level:
        return np.asarray(CubicSpline(grid, values)(np.maximum(at, grid[0])))
    spline = CubicSpline(np.concatenate([[0.0], grid]), np.concatenate([[0.0], values]))
    return np.asarray(spline(np.maximum(at, 0.0)))
