"""A kind of phantom compressed between plates, neo-Hookean, with ends that slide or stick.

The recordings are of loading alone, at one speed: they tell nothing of time. C10 is in proportion
to the force, so that a fit is one division.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.common.units import FloatArray
from legfem.experiments.axisymmetric import CylinderBetweenPlates
from studies.recordings.curves import cylinder_curve, each_apart
from studies.recordings.data import Phantom

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
