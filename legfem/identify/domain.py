"""The region that is searched: bounds, the genes that span them, and what has been solved."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.identify.emulator import coordinates
from legfem.identify.settings import Bounds
from legfem.units import FloatArray

# C20 above which the second gene is nearly logarithmic, kPa.
_C20_SCALE = 0.1
# Distance from what was solved beyond which an emulator isn't trusted, in its coordinates.
_REACH = 1.2
# The designs' greatest extent (kPa): legs lie within, and the extremes take longest to solve.
_USUAL_C10, _USUAL_C20 = (0.15, 4.0), (0.0, 6.0)


@dataclass(frozen=True)
class Domain:
    """Bounds of the search and their genes, each from 0 to 1.

    The genes are linear in ln C10 and in ln(1 + C20 / 0.1 kPa), so that C20 = 0 is within.
    """

    bounds: Bounds
    dimensions: int
    """1 where C20 is 0, else 2."""

    def stiffness(self, genes: FloatArray) -> FloatArray:
        """Return (..., 2) stiffnesses C10, C20 (kPa) of genes (..., dimensions)."""
        g = np.clip(genes, 0.0, 1.0)
        low, high = np.log(self.bounds.c10)
        c10 = np.clip(np.exp(low + g[..., 0] * (high - low)), *self.bounds.c10)
        if self.dimensions == 1:
            return np.stack([c10, np.zeros_like(c10)], axis=-1)
        low, high = np.log1p(np.array(self.bounds.c20) / _C20_SCALE)
        c20 = _C20_SCALE * np.expm1(low + g[..., 1] * (high - low))
        return np.stack([c10, np.clip(c20, *self.bounds.c20)], axis=-1)

    def genes(self, stiffness: FloatArray) -> FloatArray:
        """Return the genes (..., dimensions) of stiffnesses (..., 2) in kPa."""
        low, high = np.log(self.bounds.c10)
        first = (np.log(stiffness[..., 0]) - low) / (high - low)
        if self.dimensions == 1:
            return np.clip(first[..., None], 0.0, 1.0)
        low, high = np.log1p(np.array(self.bounds.c20) / _C20_SCALE)
        second = (np.log1p(stiffness[..., 1] / _C20_SCALE) - low) / (high - low)
        return np.clip(np.stack([first, second], axis=-1), 0.0, 1.0)

    def inside(self, stiffness: FloatArray) -> FloatArray:
        """Return stiffnesses (..., 2) in kPa, clipped to the bounds."""
        second = self.bounds.c20 if self.dimensions == 2 else (0.0, 0.0)
        low, high = np.array([self.bounds.c10, second]).T
        return np.clip(stiffness, low, high)

    def design(self) -> FloatArray:
        """Return the stiffnesses (n, 2) to solve first, kPa."""
        c10 = _within(_USUAL_C10, self.bounds.c10)
        soft, middle, stiff = np.geomspace(*c10, 3)
        if self.dimensions == 1:
            return np.array([[soft, 0.0], [stiff, 0.0], [middle, 0.0]])
        low, high = _within(_USUAL_C20, self.bounds.c20)
        return np.array(
            [
                [middle, low + 0.15 * (high - low)],
                [soft, low + 0.02 * (high - low)],
                [stiff, low],
                [soft, high],
                [stiff, high],
            ]
        )


def _within(usual: tuple[float, float], bounds: tuple[float, float]) -> tuple[float, float]:
    low, high = max(usual[0], bounds[0]), min(usual[1], bounds[1])
    return (low, high) if low < high else bounds


@dataclass(frozen=True, eq=False)
class Known:
    """Where the emulator is to be trusted: near complete solves, away from failed ones."""

    complete: FloatArray
    """(n, 2), kPa; at least one."""
    failed: FloatArray
    """(k, 2), kPa."""

    def nearest_trusted(self, stiffness: FloatArray) -> FloatArray:
        """Return stiffnesses (n, 2) in kPa, moved into the trusted region where outside it.

        A move goes along the straight line, in the emulator's coordinates, to the nearest complete
        solve: until within reach of it, and until no failed solve is nearer.
        """
        solved = coordinates(*self.complete.T)
        at = coordinates(stiffness[:, 0], stiffness[:, 1])
        distance = np.linalg.norm(at[:, None] - solved[None], axis=-1)
        nearest = solved[np.argmin(distance, axis=1)]
        apart = np.min(distance, axis=1)
        share = np.minimum(1.0, _REACH / np.maximum(apart, 1e-300))
        if len(self.failed):
            bad = coordinates(*self.failed.T)
            direction = at - nearest
            for one in bad:
                # Where the line from the complete solve meets the plane half-way to the failed one.
                gap = one - nearest
                along = np.sum(direction * gap, axis=-1)
                half = 0.5 * np.sum(gap**2, axis=-1)
                share = np.where(
                    along > half, np.minimum(share, half / np.maximum(along, 1e-300)), share
                )
        moved = nearest + share[:, None] * (at - nearest)
        c10 = np.exp(moved[:, 0])
        inside = np.stack([c10, c10 * np.expm1(moved[:, 1])], axis=-1)
        return np.where(share[:, None] < 1.0, inside, stiffness)
