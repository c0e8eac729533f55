"""Points that a camera tracks on a specimen's face: a pinhole before a round or flat side, and another code's disc."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path

import numpy as np
from making_layers import OtherLayer, OtherLayers
from scipy.interpolate import RectBivariateSpline

C10, RADIUS, HEIGHT = 4e-3, 12.0, 12.0
DEPTHS = np.linspace(0.0, 2.4, 13)


class UpperHalf(OtherLayers):
    """Of a disc: its base is a mirror."""

    def axis_and_walls(self) -> np.ndarray:
        """Return what is held at mirror and axis."""
        held = super().axis_and_walls()
        held[(self.mesh.points[:, 0] < 1e-9) & (self.mesh.points[:, 1] > 1e-9), 1] = False
        return held

    def stuck(self, depths: Sequence[float], glued: bool) -> Iterator[float]:
        """Yield the plate's force (N) at depths (mm): what it pulls at comes off it unless it is glued."""
        face = self.between(0.0, np.inf)
        for depth in depths:
            while True:
                held = self.axis_and_walls()
                held[face] = True
                pull = self.balance(held, np.where(face[:, None], (-depth, 0.0), 0.0)).reshape(-1, 2)[:, 0]
                rim = np.flatnonzero(face)[np.argmax(self.mesh.points[face, 1])]
                if glued or pull[rim] <= 0:
                    break
                face[rim] = False
            yield -float(pull[face].sum())


@cache
def sticking_disc(glued: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Forces (N) at `DEPTHS`, nodes' heights above the mirror, and their moves up and out (depths, nodes, 2)."""
    disc = UpperHalf([OtherLayer(HEIGHT / 2, C10, 1000.0)], RADIUS, [RADIUS - 0.5], 0.2)
    side = np.flatnonzero(disc.mesh.points[:, 1] > RADIUS - 1e-9)
    side = side[np.argsort(disc.mesh.points[side, 0])]
    forces, moved = [0.0], [np.zeros((len(side), 2))]
    for force in disc.stuck(0.5 * DEPTHS[1:], glued):
        forces.append(force)
        moved.append(disc.moved[side].copy())
    return np.array(forces), disc.mesh.points[side, 0], np.array(moved)


def of_disc(depth: np.ndarray, heights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moves out and up (depths, heights), mm, of the disc's side, from its middle on; its upper plate comes down."""
    _, nodes, moved = sticking_disc()
    every, back = np.unique(np.abs(heights), return_inverse=True)
    up, out = (RectBivariateSpline(DEPTHS, nodes, one)(depth, every)[:, back] for one in np.moveaxis(moved, -1, 0))
    return out, np.sign(heights) * up - 0.5 * depth[:, None]


def film(
    path: Path, time: np.ndarray, place: np.ndarray, moved: np.ndarray, seed: int = 0, aside: tuple = (0.3, 0.2)
) -> None:
    """Write what a camera sees, 300 mm away, of points (n, 3) that have moved by (frames, n, 3), mm.

    Its scale is 1 % off, it is turned by a degree, moves by some hundredths of a mm, and its errors are alike over
    a few mm.
    """
    drawn = np.random.default_rng(seed)
    near, turn = float(place[:, 2].max()), np.deg2rad(1.0)
    rotate = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])

    def image(points: np.ndarray) -> np.ndarray:
        flat = points[:, :2] * (300.0 - near) / (300.0 - points[:, 2:])
        return 1.01 * flat @ rotate + aside

    first = image(place)
    apart = np.linalg.norm(first[:, None] - first[None], axis=-1)
    root = np.linalg.cholesky(np.exp(-((apart / 2.0) ** 2)) + 1e-6 * np.eye(len(first)))
    shaken = np.cumsum(drawn.normal(0.0, 0.01, (len(time), 2)), axis=0)
    rows = [
        np.column_stack(
            [
                np.full(len(first), t),
                first,
                image(place + step) - first + shake + 0.008 * root @ drawn.normal(size=(len(first), 2)),
            ]
        )
        for t, step, shake in zip(time, moved, shaken, strict=True)
    ]
    np.savetxt(path, np.concatenate(rows), "%.4f", ",", header="time_s,x_mm,y_mm,ux_mm,uy_mm", comments="")


def round_side(half: float) -> tuple[np.ndarray, np.ndarray]:
    """Angles and heights of points on a round side, from aside."""
    angle, height = np.meshgrid(np.deg2rad(np.linspace(-60.0, 60.0, 11)), half * np.linspace(-0.92, 0.92, 17))
    return angle.ravel(), height.ravel()


def on_round(angle: np.ndarray, height: np.ndarray, out: np.ndarray, up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 3) of points on a round side of `RADIUS`, and their moves (frames, n, 3)."""
    way = np.column_stack([np.sin(angle), np.zeros(len(angle)), np.cos(angle)])
    place = RADIUS * way + np.column_stack([0 * angle, height, 0 * angle])
    return place, out[..., None] * way + up[..., None] * [0.0, 1.0, 0.0]
