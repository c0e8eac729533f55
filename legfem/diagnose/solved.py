"""Responses by finite elements: each solution made once and kept on disk.

A solution that doesn't follow its protocol to the end, now or before, has NaN for its values, and
so has all that is computed from them.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.correction import TabulatedCorrection
from legfem.diagnose.mechanisms import (
    EndEffects,
    Solution,
    TissueMechanism,
    Values,
    Viscoelasticity,
)
from legfem.diagnose.observations import Observations
from legfem.diagnose.stations import Stations
from legfem.diagnose.variants import Stopped, Variants
from legfem.documents import write_document
from legfem.protocol import Protocol
from legfem.units import FloatArray, kpa_to_mpa

GRID_STEP_MM = 0.5
ELASTIC_DERIVATIVES = ("deep.C10", "deep.C20")
TIMELESS = ("slipping",)
"""Models with a history that don't know of time: all rates share their solutions."""
_SMALLEST_FORCE_N = 1e-6

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
    _known: dict[str, Columns | None] = field(default_factory=dict, repr=False)

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
        protocol, at = stations.protocol, stations.time
        if solution.variant in TIMELESS:
            protocol, at = _timeless(stations)
        changed = self._solve(protocol, at, c10, c20, solution, ())["force"]
        return changed / np.maximum(before, _SMALLEST_FORCE_N) - 1.0

    def relaxation(self, stations: Stations, c10: float, c20: float) -> Columns:
        """Return the relative change per unit ratio by region; (relaxation times, stations)."""
        times: dict[str, float] = {}
        asked: dict[str, list[str]] = {}
        for region in ("deep", "superficial"):
            for k, time in enumerate(Viscoelasticity.TIMES_S):
                name = f"{region}.viscoelasticity{k + 1}"
                times[f"{name}.relaxation_time"] = time
                asked.setdefault(region, []).append(f"{name}.ratio")
        solution = Solution("viscoelastic", times)
        every = tuple(name for names in asked.values() for name in names)
        columns = self._solve(stations.protocol, stations.time, c10, c20, solution, every)
        force = np.maximum(columns["force"], _SMALLEST_FORCE_N)
        return {
            region: np.array([columns[name] / force for name in names])
            for region, names in asked.items()
        }

    def _solve(
        self,
        protocol: Protocol,
        at: FloatArray,
        c10: float,
        c20: float,
        solution: Solution,
        derivatives: tuple[str, ...],
    ) -> Columns:
        """Return force and derivatives at times of a protocol."""
        asked = {
            "protocol": [list(protocol.time), list(protocol.displacement)],
            "at": np.round(at, 9).tolist(),
            "deep_kPa": [float(c10).hex(), float(c20).hex()],
            "variant": solution.variant,
            "parameters": {k: float(v).hex() for k, v in sorted(solution.parameters.items())},
            "scaled": {k: float(v).hex() for k, v in sorted(solution.scaled.items())},
            "tilt_deg": float(solution.tilt_deg).hex(),
            "derivatives": list(derivatives),
        }
        text = json.dumps({**self.fingerprint, **asked}, sort_keys=True)
        key = hashlib.sha256(text.encode()).hexdigest()[:24]
        if key not in self._known:
            self._known[key] = self._recalled(key) or self._made(
                key, protocol, at, c10, c20, solution, derivatives
            )
        columns = self._known[key]
        if columns is None or "force" not in columns:
            return {name: np.full(len(at), np.nan) for name in ("force", *derivatives)}
        return columns

    def _recalled(self, key: str) -> Columns | None:
        if self.folder is None:
            return None
        try:
            content = json.loads((self.folder / f"{key}.json").read_text())
            return {name: np.array(values) for name, values in content["columns"].items()}
        except (OSError, ValueError, KeyError, AttributeError):
            return None

    def _made(
        self,
        key: str,
        protocol: Protocol,
        at: FloatArray,
        c10: float,
        c20: float,
        solution: Solution,
        derivatives: tuple[str, ...],
    ) -> Columns:
        self.solutions += 1
        deep = {"deep.C10": kpa_to_mpa(c10), "deep.C20": kpa_to_mpa(c20)}
        path = self.variants.follow(protocol, deep, solution, derivatives)
        if isinstance(path, Stopped):
            columns: Columns = {"stopped": np.zeros(0)}
        else:
            columns = {"force": path.force_at(at)}
            columns |= {name: path.sensitivity_at(name, at) for name in derivatives}
        if self.folder is not None:
            content = {name: values.tolist() for name, values in columns.items()}
            write_document(self.folder / f"{key}.json", {"columns": content})
        return columns


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


def _timeless(stations: Stations) -> tuple[Protocol, FloatArray]:
    """Return the protocol at 1 mm/s with holds of 1 s, and the stations' times in it."""
    given = stations.protocol
    lengths = [abs(part.last - part.first) or 1.0 for part in given.segments]
    time = np.concatenate([[0.0], np.cumsum(lengths)])
    return Protocol(tuple(time), given.displacement), np.interp(stations.time, given.time, time)


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
