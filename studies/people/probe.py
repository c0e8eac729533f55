"""The flat probe on fat over muscle over bone: solved, its response between solutions, and what each layer loses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator, RBFInterpolator
from scipy.stats import qmc

from legfem.channels.kinds.layer_thickness import FAT, TISSUE
from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.experiments.axisymmetric import AxisymmetricSettings, Layer
from legfem.experiments.bodies import Faces, PunchOnLayer
from legfem.experiments.flat_punch import FlatPunchIndentation
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.structured import MeridianMeshSettings
from legfem.solve.settings import StepSettings
from studies.people.data import Indentations

STRAINS = np.array([0.02, 0.05, 0.08, 0.12, 0.16, 0.2, 0.25, 0.3, 0.36])
"""Of both layers together, at which solutions are kept."""
LOWEST, HIGHEST = np.log([0.09, 0.38, 0.05]), np.log([2.5, 5.0, 20.0])
"""Logarithms of superficial and deep thickness over the radius, and of the ratio of C10."""
_RADIUS, _EDGE, _AROUND, _C10 = 10.0, 1.5, 5.0, 0.005


@dataclass(frozen=True)
class ProbeModel:
    """What isn't stated of the probe and of the tissues.

    Parameters
    ----------
    poisson_ratio
        Of both tissues, at small strain.
    face
        Whether the probe's face sticks. Gel lets the probe slide on the skin, but the skin, some
        hundred times as stiff as fat, hardly stretches under it: to the fat it is as if it stuck.
    """

    poisson_ratio: float = 0.49
    face: Faces = "rough"


@dataclass(frozen=True)
class SolvedPoint:
    """At `STRAINS`."""

    force: tuple[float, ...]
    """Natural logarithm of the force over the deep C10 and a^2."""
    share: tuple[float, ...]
    """The superficial layer's strain over that of both. At the axis a thin stiff one may swell."""
    problem: str = ""
    """Why there is nothing else, or nothing."""


def neo_hookean(C10: float, poisson_ratio: float) -> NeoHookean:
    """Return the law (MPa) with a Poisson's ratio at small strain."""
    bulk = 4 * C10 * (1 + poisson_ratio) / (3 * (1 - 2 * poisson_ratio))
    return NeoHookean(C10, 2 / bulk)


def solve_point(model: ProbeModel, point: Sequence[float], refined: float = 1.0) -> SolvedPoint:
    """Press the probe into layers of given logarithms (see `LOWEST`), to the greatest strain."""
    superficial, deep, ratio = np.exp(point)
    layers = tuple(
        Layer(name, float(share) * _RADIUS, neo_hookean(float(C10), model.poisson_ratio))
        for name, share, C10 in (("deep", deep, _C10), ("superficial", superficial, ratio * _C10))
    )
    given = PunchOnLayer(sum(layer.thickness for layer in layers), _RADIUS, _EDGE, _AROUND * _RADIUS, model.face)
    depth = float(STRAINS[-1]) * given.thickness * 1.01
    settings = AxisymmetricSettings(
        MeridianMeshSettings(0.25 * _EDGE, 0.35, 6.0).refined(refined),
        steps=StepSettings(first=0.4 * STRAINS[0] * depth / STRAINS[-1], largest=depth / 12),
    )
    solved = FlatPunchIndentation(given, layers, settings).solve(depth=depth)
    path = solved.path
    strain = 1 - path.channels[TISSUE.name] / given.thickness
    if strain[-1] < STRAINS[-1] or not (path.force[1:] > 0).all():
        return SolvedPoint((), (), solved.report.reason)
    share = (1 - path.channels[FAT.name] / layers[1].thickness)[1:] / strain[1:]
    modulus = np.log(path.force[1:] / strain[1:] / (_C10 * _RADIUS**2))
    at = PchipInterpolator(np.log(strain[1:]), np.stack([modulus, share], 1))(np.log(STRAINS))
    return SolvedPoint(tuple(at[:, 0] + np.log(STRAINS)), tuple(at[:, 1]))


def points(count: int, seed: int) -> FloatArray:
    """Return points (count, 3) that fill the room between `LOWEST` and `HIGHEST`."""
    unit = qmc.Halton(3, rng=seed).random(count)
    # A box a little larger than what is asked for keeps the interpolation off its edges.
    return np.asarray(qmc.scale(unit, LOWEST - 0.1, HIGHEST + 0.1))


def solve_points(
    model: ProbeModel, asked: FloatArray, folder: Path, jobs: int, progress: Progress
) -> list[SolvedPoint]:
    """Return solutions (in order) at points (n, 3); those that are done are kept in a folder."""
    store = Store(folder, SolvedPoint, model, [__name__])
    tasks = [tuple(float(x) for x in point) for point in asked]
    with Workers(solve_point, model, jobs) as workers:
        return finish(workers, tasks, store, progress, "the probe on two layers", lambda *_: "point")


@dataclass(frozen=True, eq=False)
class ProbeResponse:
    """Cubic radial functions about a quadratic trend, through the points solved.

    Parameters
    ----------
    at : (n, 3) array
        Points, see `LOWEST`.
    force, share : (n, strains) array
        As in `SolvedPoint`.
    """

    at: FloatArray
    force: FloatArray
    share: FloatArray

    @classmethod
    def through(cls, at: FloatArray, found: Sequence[SolvedPoint]) -> ProbeResponse:
        """Return the response through those points that were solved."""
        done = [k for k, one in enumerate(found) if not one.problem]
        return cls(at[done], np.array([found[k].force for k in done]), np.array([found[k].share for k in done]))

    @cached_property
    def _smooth(self) -> RBFInterpolator:
        values = np.hstack([self.force, self.share])
        return RBFInterpolator(self.at, values, kernel="cubic", degree=2)

    def __call__(self, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the force's logarithm and the share (..., strains) at points (..., 3)."""
        flat = self._smooth(at.reshape(-1, 3)).reshape(*at.shape[:-1], 2, len(STRAINS))
        return flat[..., 0, :], flat[..., 1, :]

    def error(self, at: FloatArray, found: Sequence[SolvedPoint]) -> tuple[FloatArray, FloatArray]:
        """Return the errors (solved, strains) of both at points that were solved too."""
        other = ProbeResponse.through(at, found)
        force, share = self(other.at)
        return force - other.force, share - other.share


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
