"""A leg's responses about its stiffness: solved once, used by every diagnosis on that leg.

Elastic curves stand at a lattice of stiffnesses about the leg's own, with their exact derivatives;
what a mechanism or another geometry adds, over the elastic force, at two stiffnesses there. A full
solution then confirms what is reported. The lattice's middle is a round number, so that recordings
of one leg share it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator

from legfem.common.units import FloatArray
from legfem.correction.tabulated import TabulatedCorrection
from legfem.diagnose.mechanisms import Stiffness, TissueMechanism, Values
from legfem.diagnose.mechanisms.base import null_of, prior_of
from legfem.diagnose.mechanisms.contact_slip import ContactSlip
from legfem.diagnose.mechanisms.end_effects import EndEffects
from legfem.diagnose.nuisances import Nuisances
from legfem.diagnose.observations import Observations
from legfem.diagnose.solved import end_effect
from legfem.inference.emulator import Emulator

_REACH = 1.6


@dataclass(frozen=True, eq=False)
class Table:
    """Changes at some C10, in proportion to ln C10 between them."""

    logs: FloatArray
    """(k,)."""
    values: FloatArray
    """(k, ...)."""

    def __call__(self, c10: float) -> FloatArray:
        """Return the values (...) at a stiffness in kPa."""
        if len(self.logs) == 1:
            return np.asarray(self.values[0])
        low, high = self.logs[0], self.logs[-1]
        share = float(np.clip((np.log(c10) - low) / (high - low), -0.5, 1.5))
        return np.asarray((1 - share) * self.values[0] + share * self.values[-1])


@dataclass(frozen=True, eq=False)
class Library:
    """Responses from tables; see `Responses` for the methods' meaning."""

    grid: FloatArray
    elastic: Emulator
    changes: Mapping[tuple[str, str], Table]
    """Along a path, or by derivatives: relative changes by mechanism and protocol, (strengths or
    derivatives, stations or grid); else logarithms of the forces' ratio by mechanism, (strengths,
    grid)."""
    nuisances: Nuisances
    middle: float
    """C10, kPa."""
    correction: TabulatedCorrection | None = None
    missing: Mapping[str, str] = field(default_factory=dict)
    """Mechanisms that have no table, and why."""
    reach: float = _REACH
    """Of ln C10 from the middle, where it holds."""

    @property
    def c10_bounds(self) -> tuple[float, float]:
        """Stiffness C10 that it holds for, kPa."""
        return self.middle * float(np.exp(-self.reach)), self.middle * float(np.exp(self.reach))

    @property
    def c20_bounds(self) -> tuple[float, float]:
        """Stiffness C20 that it holds for, kPa."""
        return 0.0, 12.0 * self.middle

    def curve(self, c10: float, c20: float) -> FloatArray:
        """Return the elastic force at the grid, N."""
        return self.elastic(coordinates(c10, c20))

    def relative_change(
        self, mechanism: TissueMechanism, values: Values, at: Stiffness, observed: Observations
    ) -> FloatArray:
        """Return what a mechanism adds to the elastic force, over that force; (n,)."""
        if isinstance(mechanism, EndEffects):
            return end_effect(self.correction, values, at, observed)
        if not mechanism.along_path:
            table = self.changes[mechanism.name, ""](at[0])
            if isinstance(mechanism, ContactSlip):
                change = values["slip"] * np.expm1(table[0])
            elif mechanism.derivatives:
                change = mechanism.shares(values) @ table
            else:
                change = np.expm1(_at_strength(mechanism, values, table))
            pressed = np.maximum(observed.displacement, self.grid[0])
            return np.asarray(CubicSpline(self.grid, change)(pressed))
        rows = [self.changes[mechanism.name, s.key](at[0]) for s in observed.protocols]
        if mechanism.derivatives:
            return observed.spread([mechanism.shares(values) @ row for row in rows])
        return observed.spread([_at_strength(mechanism, values, row) for row in rows])


def _at_strength(mechanism: TissueMechanism, values: Values, table: FloatArray) -> FloatArray:
    """Return a table's row at a strength: smooth between, in proportion beyond."""
    first = mechanism.parameters[0]
    prior = prior_of(first)
    given = [null_of(first), *mechanism.strengths]
    nodes = np.array([prior.departure(v) for v in given])
    order = np.argsort(nodes)
    rows = np.vstack([np.zeros(table.shape[1]), table])[order]
    at = prior.departure(values[first.name])
    inside = float(np.clip(at, nodes.min(), nodes.max()))
    found = PchipInterpolator(nodes[order], rows)(inside)
    return np.asarray(found * (at / inside) if inside not in (at, 0.0) else found)


def coordinates(c10: ArrayLike, c20: ArrayLike) -> FloatArray:
    """Return the emulator's coordinates (..., 2) of stiffnesses in kPa.

    ``ln C10`` and ``ln(1 + C20 / C10)``: the first carries the scale of all stiffnesses, the second
    is 0 for a neo-Hookean tissue and stays smooth where C20 rules.
    """
    first, second = np.broadcast_arrays(np.asarray(c10, float), np.asarray(c20, float))
    return np.stack([np.log(first), np.log1p(second / first)], axis=-1)
