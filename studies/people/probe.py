r"""The flat probe on fat over muscle over bone, solved at points that hold every person.

A flat punch of radius a on two layers of neo-Hookean tissue and one Poisson's ratio needs

.. math:: F = C_{10}^{deep} a^2 f(\varepsilon; t_s / a, t_d / a, C_{10}^{sup} / C_{10}^{deep})

for the strain :math:`\varepsilon` of both layers together, and so does the share of the
superficial layer in the thickness lost (Buckingham's theorem). Three numbers hold every person and
probe.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.stats import qmc

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.experiments.axisymmetric import AxisymmetricSettings, Faces, Layer, compress_layers
from legfem.experiments.flat_punch import FlatPunchIndentation, PunchOnLayer
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.meridian import MeridianMeshSettings
from legfem.solve.settings import StepSettings

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
    found = compress_layers(FlatPunchIndentation(given, layers, settings), depth)
    strain = found.total / given.thickness
    if strain[-1] < STRAINS[-1] or not (found.force[1:] > 0).all():
        return SolvedPoint((), (), found.report.reason)
    share = found.lost["superficial"][1:] / layers[1].thickness / strain[1:]
    modulus = np.log(found.force[1:] / strain[1:] / (_C10 * _RADIUS**2))
    at = PchipInterpolator(np.log(strain[1:]), np.stack([modulus, share], 1))(np.log(STRAINS))
    return SolvedPoint(tuple(at[:, 0] + np.log(STRAINS)), tuple(at[:, 1]))


def points(count: int, seed: int) -> FloatArray:
    """Return points (count, 3) that fill the room between `LOWEST` and `HIGHEST`."""
    unit = qmc.Halton(3, rng=seed).random(count)
    # A box a little larger than what is asked for keeps the interpolation off its edges.
    return np.asarray(qmc.scale(unit, LOWEST - 0.1, HIGHEST + 0.1))


def solve_points(
    model: ProbeModel, asked: FloatArray, folder: Path, jobs: int, progress: Progress | None = None
) -> list[SolvedPoint]:
    """Return solutions (in order) at points (n, 3); those that are done are kept in a folder."""
    store = Store(folder, SolvedPoint, model, [__name__])
    found: list[SolvedPoint] = []
    with Workers(_kept, (model, store), jobs) as workers:
        for one in workers.in_order([tuple(float(x) for x in point) for point in asked]):
            found.append(one)
            if progress is not None:
                progress.advance("point")
    return found


def _kept(context: tuple[ProbeModel, Store[SolvedPoint]], point: tuple[float, ...]) -> SolvedPoint:
    model, store = context
    return store.get_or_make(point, lambda: solve_point(model, point))
