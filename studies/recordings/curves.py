"""The elastic force of specimens for any stiffness, and a phantom compressed between plates with it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from multiprocessing import get_context
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.experiments.axisymmetric import BallIndentation, CylinderCompression
from legfem.experiments.bodies import BallOnLayer, CylinderBetweenPlates
from legfem.jobs.store import Store
from legfem.mechanics.materials import ReducedPolynomial
from legfem.solve.protocol import Protocol
from studies.recordings.data import Phantom

REFERENCE_KPA = 10.0
BULK_RATIO = 1000.0
"""Bulk over shear modulus: incompressible for any force's accuracy asked here."""
STIFFENING_SHARES = (0.0, 0.1, 0.35, 0.7, 0.9)
"""C20 / (C10 + C20) of the elastic curves that are solved."""
THICKNESSES = (1.8, 2.3, 3.0, 4.0, 5.4, 7.2)
"""Of the layers that are solved, over the ball's radius."""
DEEPEST = 0.6
"""Displacement over the thickness down to which a layer is pressed ..."""
DEEPEST_RADII = 2.4
"""... or over the ball's radius, if that is less."""
POINTS = 60


def tissue() -> ReducedPolynomial:
    """Return the law of the specimens at a reference stiffness."""
    c10 = kpa_to_mpa(REFERENCE_KPA)
    return ReducedPolynomial(c10, 1 / (BULK_RATIO * c10), C20=0.0)


@dataclass(frozen=True, eq=False)
class ElasticCurves:
    """A specimen's elastic force, over C10 + C20.

    Parameters
    ----------
    grid
        (m,), mm.
    forces
        (k, m), N per kPa, at `STIFFENING_SHARES`.
    """

    grid: FloatArray
    forces: FloatArray

    @cached_property
    def _by_share(self) -> CubicSpline:
        return CubicSpline(STIFFENING_SHARES[: len(self.forces)], self.forces)

    def at(self, c10: float, c20: float) -> FloatArray:
        """Return the force (m,), N, of a stiffness in kPa."""
        return np.asarray((c10 + c20) * self._by_share(c20 / (c10 + c20)))


@dataclass(frozen=True, eq=False)
class LayerCurves:
    """Elastic curves of layers of all thicknesses under one ball.

    Parameters
    ----------
    ball_radius
        mm.
    shares
        (m,): displacements over the thickness.
    forces
        (thicknesses, stiffenings, m): of C10 + C20 = 1 kPa, over what Hertz' law tells of a half
        space but for a factor, :math:`R^{1/2} d^{3/2}`; NaN beyond what was reached.
    """

    ball_radius: float
    shares: FloatArray
    forces: FloatArray

    def of(self, thickness: float, depth: float, ball_radius: float | None = None) -> ElasticCurves:
        """Return the curves of a layer (mm) down to a depth, also under another ball.

        Where the stiffest tissues weren't solved so deep they are left out.
        """
        radius = ball_radius or self.ball_radius
        logs = np.log(THICKNESSES)
        at = float(np.clip(np.log(thickness / radius), logs[0] - 0.1, logs[-1] + 0.1))
        grid = depth * np.arange(1, POINTS + 1) / POINTS
        rows = []
        for k in range(self.forces.shape[1]):
            own = [self._course(row[k], grid / thickness) for row in self.forces]
            known = np.array([j for j, course in enumerate(own) if not np.isnan(course).any()])
            if len(known) < 3 or logs[known[-1]] < at - 0.35 or logs[known[0]] > at + 0.35:
                break
            near = np.sort(known[np.argsort(np.abs(logs[known] - at))[:4]])
            courses = np.log([own[j] for j in near])
            rows.append(np.exp(_lagrange(logs[near], courses, at)))
        if not rows:
            raise ValueError(f"no layer was pressed to {depth / thickness:.2f} of its thickness")
        return ElasticCurves(grid, np.array(rows) * radius**0.5 * grid**1.5)

    def _course(self, row: FloatArray, at: FloatArray) -> FloatArray:
        known = ~np.isnan(row)
        if known.sum() < 8 or at[-1] > self.shares[known][-1]:
            return np.full(len(at), np.nan)
        return np.interp(at, self.shares[known], row[known])


def _lagrange(nodes: FloatArray, rows: FloatArray, at: float) -> FloatArray:
    weights = [np.prod([(at - b) / (a - b) for b in nodes if b != a]) for a in nodes]
    return np.asarray(np.array(weights) @ rows)


def layer_curves(
    ball_radius: float, layer_radius: float, folder: Path, jobs: int, advance: Callable[[str], None] = lambda _: None
) -> LayerCurves:
    """Solve what isn't kept yet (lengths in mm); every layer is pressed in a process of its own."""
    shares = np.linspace(0.0, DEEPEST, 73)[1:]
    layers = [BallOnLayer(ball_radius * ratio, ball_radius, layer_radius) for ratio in THICKNESSES]
    missing = [layer for layer in layers if None in _kept(layer, shares, folder)]
    for layer, _ in zip(missing, each_apart(partial(_press, folder=folder, shares=shares), missing, jobs), strict=True):
        advance(f"layer of {layer.thickness:.3g} mm")
    rows = [
        np.array(_kept(layer, shares, folder), dtype=float) / (ball_radius**0.5 * (shares * layer.thickness) ** 1.5)
        for layer in layers
    ]
    return LayerCurves(ball_radius, shares, np.array(rows))


def _depth(layer: BallOnLayer) -> float:
    return min(DEEPEST * layer.thickness, DEEPEST_RADII * layer.ball_radius)


def _store(what: object, folder: Path) -> Store[list[float]]:
    return Store(folder, list[float], repr(what), ["legfem.experiments.axisymmetric"])


def _kept(layer: BallOnLayer, shares: FloatArray, folder: Path) -> list[list[float] | None]:
    """Return a layer's forces (N at C10 + C20 = 1 kPa), one row a stiffening."""
    store = _store(layer, folder)
    return [store.get([s, _depth(layer), *shares]) for s in STIFFENING_SHARES]


def _press(layer: BallOnLayer, folder: Path, shares: FloatArray) -> None:
    """Solve a layer's missing rows."""
    test, depth, store = BallIndentation(layer, tissue()), _depth(layer), _store(layer, folder)
    for share in STIFFENING_SHARES:
        store.get_or_make([share, depth, *shares], partial(_solved, test, share, depth, shares * layer.thickness))


def _solved(test: BallIndentation | CylinderCompression, share: float, depth: float, at: FloatArray) -> list[float]:
    """Return the force at displacements (mm) with C10 + C20 = 1 kPa; NaN where it stopped."""
    values = {"deep.C10": (1 - share) * kpa_to_mpa(REFERENCE_KPA), "deep.C20": share * kpa_to_mpa(REFERENCE_KPA)}
    solved = test.solve(values, Protocol.ramp(depth, 1.0))
    force = np.asarray(solved.path.loading(at)) / REFERENCE_KPA
    return [float(f) for f in np.where(at <= solved.report.reached + 1e-9, force, np.nan)]


def cylinder_curve(test: CylinderBetweenPlates, depth: float, folder: Path) -> CubicSpline:
    """Return a cylinder's neo-Hookean force (N at C10 = 1 kPa) by displacement down to a depth."""
    grid = depth * np.arange(1, POINTS + 1) / POINTS
    force = _store(test, folder).get_or_make(
        [depth, *grid], lambda: _solved(CylinderCompression(test, tissue()), 0.0, depth, grid)
    )
    return CubicSpline(np.concatenate([[0.0], grid]), np.concatenate([[0.0], force]))


def each_apart[Task, Outcome](work: Callable[[Task], Outcome], tasks: Sequence[Task], jobs: int) -> Iterator[Outcome]:
    """Yield the outcomes in the tasks' order, each from a process of its own.

    What is compiled for a process's first model is found again by the next process; a second
    model's expressions would be compiled anew.
    """
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), max_tasks_per_child=1) as pool:
        yield from pool.map(work, tasks)


def each_in_turn[Task, Outcome](work: Callable[[Task], Outcome], tasks: Sequence[Task], jobs: int) -> Iterator[Outcome]:
    """Yield the outcomes in the tasks' order, from processes that take one after the other."""
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(work, tasks)


Ends = Literal["sliding", "bonded"]
ENDS: tuple[Ends, ...] = ("sliding", "bonded")
GREATEST_STRAIN = 0.4
FITTED_STRAIN = 0.3
"""What is beyond is held out."""


@dataclass(frozen=True, eq=False)
class WithEnds:
    """One sample's fit with one kind of ends."""

    ends: Ends
    c10: float
    """kPa."""
    prediction: FloatArray
    """(n,), N."""
    rmse: float
    """N, up to the strain fitted."""
    beyond_rmse: float
    """N, beyond it."""
    next_rmse: float
    """N, of the next sample of the kind by this one's C10."""


@dataclass(frozen=True, eq=False)
class CompressedPhantom:
    """What was found in one sample; arrays are (n,), mm and N."""

    phantom: Phantom
    displacement: FloatArray
    force: FloatArray
    fits: tuple[WithEnds, ...]

    @property
    def better(self) -> WithEnds:
        """The ends that fit better."""
        return min(self.fits, key=lambda f: f.rmse)

    def with_ends(self, ends: Ends) -> WithEnds:
        """Return the fit with given ends."""
        return next(f for f in self.fits if f.ends == ends)


def elastic_curves(phantom: Phantom, folder: Path, jobs: int) -> dict[Ends, CubicSpline]:
    """Return the force (N at C10 = 1 kPa) by displacement (mm) with both kinds of ends."""
    depth = (GREATEST_STRAIN + 0.02) * phantom.height
    tests = [CylinderBetweenPlates(phantom.radius, phantom.height, ends) for ends in ENDS]
    curves = each_apart(partial(cylinder_curve, depth=depth, folder=folder), tests, jobs)
    return dict(zip(ENDS, curves, strict=True))


def study_kind(phantoms: Sequence[Phantom], curves: dict[Ends, CubicSpline]) -> tuple[CompressedPhantom, ...]:
    """Fit every sample of a kind with both kinds of ends."""
    seen = [_loading(phantom) for phantom in phantoms]
    following = [*seen[1:], seen[0]]
    return tuple(
        CompressedPhantom(
            phantom, *own, tuple(_fitted(ends, curve, phantom.height, own, after) for ends, curve in curves.items())
        )
        for phantom, own, after in zip(phantoms, seen, following, strict=True)
    )


def _loading(phantom: Phantom) -> tuple[FloatArray, FloatArray]:
    d = phantom.recording.displacement
    end = int(np.argmax(d > GREATEST_STRAIN * phantom.height)) or len(d)
    kept = slice(0, end)
    return d[kept], phantom.recording.force[kept]


def _fitted(
    ends: Ends,
    curve: CubicSpline,
    height: float,
    own: tuple[FloatArray, FloatArray],
    after: tuple[FloatArray, FloatArray],
) -> WithEnds:
    d, force = own
    unit = curve(np.maximum(d, 0.0))
    near = d <= FITTED_STRAIN * height
    c10 = float(force[near] @ unit[near] / (unit[near] @ unit[near]))
    left = force - c10 * unit
    other = after[1] - c10 * curve(np.maximum(after[0], 0.0))
    return WithEnds(ends, c10, c10 * unit, _rms(left[near]), _rms(left[~near]), _rms(other))


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
