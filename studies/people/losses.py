"""What thickness each layer loses under a force, for any stiffness of both, row by row."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from legfem.common.units import FloatArray
from studies.people.data import Indentations
from studies.people.probe import HIGHEST, LOWEST, STRAINS
from studies.people.response import ProbeResponse

_FORCES = np.linspace(-4.0, 9.0, 131)
"""Logarithms of the force over the deep C10 and a^2 at which strains are tabulated."""
_RATIOS = np.linspace(LOWEST[2], HIGHEST[2], 31)


@dataclass(frozen=True, eq=False)
class Losses:
    """Tables of strains by the ratio of stiffnesses and the force, for the rows of a table.

    Parameters
    ----------
    rows
        Whose thicknesses and probes count.
    response
        Of the probe.
    """

    rows: Indentations
    response: ProbeResponse

    @property
    def inside(self) -> FloatArray:
        """Whether a row's thicknesses lie where the response was solved (n,)."""
        at = self._thicknesses
        return np.asarray(((at >= LOWEST[:2]) & (at <= HIGHEST[:2])).all(axis=1))

    @property
    def _thicknesses(self) -> FloatArray:
        rows = self.rows
        return np.log(np.stack([rows.superficial, rows.deep], axis=1) / rows.radius[:, None])

    @cached_property
    def _tables(self) -> FloatArray:
        """Logarithm of the strain and the superficial share (2, n, ratios, forces)."""
        n, m = len(self.rows), len(_RATIOS)
        at = np.empty((n, m, 3))
        at[..., :2] = self._thicknesses[:, None, :]
        at[..., 2] = _RATIOS
        force, share = self.response(at)
        tables = np.empty((2, n, m, len(_FORCES)))
        log_strain = np.log(STRAINS)
        for k in range(n):
            for j in range(m):
                rising = np.maximum.accumulate(force[k, j] + 1e-9 * np.arange(len(STRAINS)))
                ends = np.clip(_FORCES, rising[0], rising[-1])
                beyond = _FORCES - ends
                # Below the least strain the force is linear; beyond the greatest it goes on as it
                # did between the last two.
                last = (log_strain[-1] - log_strain[-2]) / (rising[-1] - rising[-2])
                slope = np.where(beyond < 0, 1.0, last)
                strain = PchipInterpolator(rising, log_strain)(ends) + slope * beyond
                tables[0, k, j] = strain
                tables[1, k, j] = np.interp(strain, log_strain, share[k, j])
        return tables

    def __call__(
        self, log_C10: FloatArray, force: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the thickness lost (..., n), mm, by the superficial layer and by both.

        Parameters
        ----------
        log_C10
            Logarithms of C10 (MPa) of the superficial and the deep tissue, (..., n, 2).
        force
            N, (n,); the rows' own without it.
        """
        rows = self.rows
        pressed = rows.force if force is None else force
        x = np.log(pressed / rows.area * np.pi) - log_C10[..., 1]
        ratio = log_C10[..., 0] - log_C10[..., 1]
        i, u = _place(ratio, _RATIOS)
        j, v = _place(x, _FORCES)
        k = np.broadcast_to(np.arange(len(rows)), x.shape)
        t = self._tables
        log_strain, share = (
            (1 - u) * ((1 - v) * t[:, k, i, j] + v * t[:, k, i, j + 1])
            + u * ((1 - v) * t[:, k, i + 1, j] + v * t[:, k, i + 1, j + 1])
        )  # fmt: skip
        strain = np.exp(log_strain)
        return share * strain * rows.superficial, strain * (rows.superficial + rows.deep)


def allowed(log_C10: FloatArray) -> FloatArray:
    """Return whether the ratio of stiffnesses (..., 2) is one that was solved for."""
    ratio = log_C10[..., 0] - log_C10[..., 1]
    return np.asarray((ratio >= LOWEST[2]) & (ratio <= HIGHEST[2]))


def _place(value: FloatArray, grid: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the interval of an even grid that a value is in, or next to, and where in it."""
    at = np.clip((value - grid[0]) / (grid[1] - grid[0]), 0.0, len(grid) - 1.0)
    lower = np.minimum(at.astype(int), len(grid) - 2)
    return lower, at - lower
