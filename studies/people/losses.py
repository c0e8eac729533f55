"""What thickness each layer loses under a force, for any stiffness of both, row by row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from legfem.common.units import FloatArray
from studies.people.data import Indentations
from studies.people.probe import HIGHEST, LOWEST, STRAINS
from studies.people.response import ProbeResponse

_FORCES = np.linspace(-4.0, 9.0, 66)
"""Logarithms of the force over the deep C10 and a^2 at which strains are tabulated."""
_RATIOS = np.linspace(LOWEST[2], HIGHEST[2], 31)


@dataclass(frozen=True, eq=False)
class Losses:
    """Strains by the ratio of stiffnesses and the force, for the rows of a table.

    Parameters
    ----------
    rows
        Whose thicknesses and probes count.
    tables
        Logarithm of both layers' strain, and the superficial layer's over it: (n, ratios, forces,
        2).
    """

    rows: Indentations
    tables: FloatArray

    @classmethod
    def of(cls, rows: Indentations, response: ProbeResponse) -> Losses:
        """Return the losses of rows by the probe's response."""
        at = np.empty((len(rows), len(_RATIOS), 3))
        at[..., :2] = _thicknesses(rows)[:, None, :]
        at[..., 2] = _RATIOS
        force, share = response(at)
        tables = np.empty((*force.shape[:2], len(_FORCES), 2))
        for place in np.ndindex(force.shape[:2]):
            tables[place] = _by_force(force[place], share[place])
        return cls(rows, tables)

    def where(self, kept: NDArray[np.bool_]) -> Losses:
        """Return those of some rows."""
        return Losses(self.rows.where(kept), self.tables[kept])

    def __call__(self, log_C10: FloatArray, force: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
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
        i, u = _place(log_C10[..., 0] - log_C10[..., 1], _RATIOS)
        j, v = _place(x, _FORCES)
        flat, width = self.tables.reshape(-1, 2), len(_FORCES)
        at = (np.arange(len(rows)) * len(_RATIOS) + i) * width + j
        u, v = u[..., None], v[..., None]
        between = (1 - u) * ((1 - v) * flat[at] + v * flat[at + 1]) + u * (
            (1 - v) * flat[at + width] + v * flat[at + width + 1]
        )
        log_strain, share = between[..., 0], between[..., 1]
        strain = np.exp(log_strain)
        return share * strain * rows.superficial, strain * (rows.superficial + rows.deep)


def solved_for(rows: Indentations) -> NDArray[np.bool_]:
    """Return whether rows' thicknesses over the probe's radius lie where the probe was solved."""
    at = _thicknesses(rows)
    return np.asarray(((at >= LOWEST[:2]) & (at <= HIGHEST[:2])).all(axis=1))


def allowed(log_C10: FloatArray) -> NDArray[np.bool_]:
    """Return whether the ratio of stiffnesses (..., 2) is one that was solved for."""
    ratio = log_C10[..., 0] - log_C10[..., 1]
    return np.asarray((ratio >= LOWEST[2]) & (ratio <= HIGHEST[2]))


def _thicknesses(rows: Indentations) -> FloatArray:
    return np.log(np.stack([rows.superficial, rows.deep], axis=1) / rows.radius[:, None])


def _by_force(force: FloatArray, share: FloatArray) -> FloatArray:
    """Return the strain's logarithm and the share (forces, 2), of force and share at `STRAINS`.

    Below the least strain the force is linear in it; beyond the greatest it goes on as it did
    between the last two.
    """
    log_strain = np.log(STRAINS)
    inside = np.clip(_FORCES, force[0], force[-1])
    beyond = _FORCES - inside
    last = (log_strain[-1] - log_strain[-2]) / (force[-1] - force[-2])
    strain = PchipInterpolator(force, log_strain)(inside) + np.where(beyond < 0, 1.0, last) * beyond
    return np.stack([strain, np.interp(strain, log_strain, share)], axis=1)


def _place(value: FloatArray, grid: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Return the interval of an even grid that a value is in, or next to, and where in it."""
    at = np.clip((value - grid[0]) / (grid[1] - grid[0]), 0.0, len(grid) - 1.0)
    lower = np.minimum(at.astype(np.int64), len(grid) - 2)
    return lower, at - lower
