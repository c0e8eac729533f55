"""Layers by felupe: another code, on a mesh of its own, with displacements alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import felupe as fem
import numpy as np
from scipy.sparse.linalg import splu

from studies.making.pressing import OtherMuscle

_STEP = 0.25
"""mm: an element at the punch's edge must not turn over."""


@dataclass(frozen=True)
class OtherLayer:
    """A neo-Hookean layer; mm, MPa."""

    thickness: float
    C10: float
    bulk: float
    """Over the shear modulus."""
    fibre_ratio: float = 1.0
    """Of the shear moduli along the axis and across."""

    @property
    def law(self) -> object:
        """As felupe asks for it."""
        plain = fem.NeoHooke(mu=2 * self.C10, bulk=self.bulk * 2 * self.C10)
        if self.fibre_ratio == 1.0:
            return plain
        muscle = OtherMuscle.of_ratio(self.C10, 0.0, self.fibre_ratio, (1.0, 0.0, 0.0))
        return replace(muscle, second=self.bulk * self.C10)


class OtherLayers:
    """Bonded layers from the base up, whose base is held; biquadratic quadrilaterals.

    The mesh has element edges at given radii, and is finest there and at the top. felupe has the
    axis along the first coordinate.
    """

    def __init__(self, layers: Sequence[OtherLayer], radius: float, edges: Sequence[float], size: float) -> None:
        tops = np.cumsum([0.0, *(layer.thickness for layer in layers)])
        height = float(tops[-1])
        z = _graded(tops, lambda at: size + 0.25 * (height - at))
        r = _graded([0.0, *edges, radius], lambda at: size + 0.25 * min(abs(at - e) for e in edges))
        mesh = fem.mesh.convert(fem.Grid(z, r), order=2, calc_points=True, calc_midfaces=True)
        self.mesh, self.height = mesh, height
        middle = mesh.points[mesh.cells].mean(axis=1)[:, 0]
        self.items, self.fields = [], []
        for layer, (below, above) in zip(layers, pairwise(tops), strict=True):
            part = mesh.cells[(middle > below) & (middle < above)]
            region = fem.RegionBiQuadraticQuad(fem.Mesh(mesh.points, part, "quad9"))
            field = fem.FieldContainer([fem.FieldAxisymmetric(region, dim=2)])
            self.fields.append(field)
            self.items.append(fem.SolidBody(layer.law, field))
        self.moved = np.zeros(mesh.points.shape)

    @property
    def top(self) -> np.ndarray:
        """Which points are on the surface."""
        return self.mesh.points[:, 0] > self.height - 1e-9

    def between(self, inner: float, outer: float) -> np.ndarray:
        """Which points of the surface are between two radii, ends included."""
        r = self.mesh.points[:, 1]
        return self.top & (r > inner - 1e-9) & (r < outer + 1e-9)

    def balance(
        self, held: np.ndarray, to: np.ndarray, extra: Sequence[tuple[fem.FieldContainer, object]] = ()
    ) -> np.ndarray:
        """Find equilibrium with what is held moved to a place; return the residual."""
        items = [*zip(self.fields, self.items, strict=True), *extra]
        free, fixed = np.flatnonzero(~held.ravel()), np.flatnonzero(held.ravel())
        for _ in range(25):
            for field, _ in items:
                field[0].values[:] = self.moved
            residual = sum(item.assemble.vector(field).toarray().ravel() for field, item in items)
            stiffness = sum(item.assemble.matrix(field) for field, item in items).tocsc()
            carried = (to.ravel() - self.moved.ravel())[fixed]
            pushed = residual[free] + stiffness[free][:, fixed] @ carried
            change = splu(stiffness[free][:, free]).solve(-pushed)
            self.moved.ravel()[free] += change
            self.moved.ravel()[fixed] += carried
            if max(np.abs(change).max(), np.abs(carried).max()) < 1e-9 * self.height:
                return np.asarray(residual)
        raise RuntimeError("felupe: no equilibrium")

    def axis_and_walls(self) -> np.ndarray:
        """Return what is held at base and axis, (points, 2)."""
        z, r = self.mesh.points.T
        held = np.zeros(self.mesh.points.shape, dtype=bool)
        held[z < 1e-9] = True
        held[r < 1e-9, 1] = True
        return held

    def punched(self, radius: float, depths: Sequence[float], step: float = _STEP) -> np.ndarray:
        """Return forces (N) of a flat punch that sticks, without a rounding, at depths (mm)."""
        face = self.between(0.0, radius)
        held, forces = self.axis_and_walls(), []
        held[face] = True
        for depth in depths:
            came = -float(self.moved[face, 0].min())
            for at in np.linspace(came, depth, 1 + int(np.ceil((depth - came) / step)))[1:]:
                residual = self.balance(held, np.where(face[:, None], (-at, 0.0), 0.0))
            forces.append(-float(residual.reshape(-1, 2)[face, 0].sum()))
        return np.array(forces)

    def sunk(self, height: float) -> float:
        """Return how far (mm) the point of the axis at a height has moved up."""
        return float(self.moved[np.argmin(np.hypot(self.mesh.points[:, 0] - height, self.mesh.points[:, 1])), 0])

    def sucked(self, aperture: float, rim: float, pressures: Sequence[float], rim_sticks: bool = True) -> np.ndarray:
        """Return the apex's rise (mm) under suctions (MPa) within an aperture, its rim held."""
        region = fem.RegionBiQuadraticQuadBoundary(
            self.mesh, only_surface=True, mask=self.between(0.0, aperture), ensure_3d=True
        )
        field = fem.FieldContainer([fem.FieldAxisymmetric(region, dim=2)])
        held, risen = self.axis_and_walls(), []
        held[self.between(aperture, aperture + rim), : 2 if rim_sticks else 1] = True
        apex = int(np.flatnonzero(self.between(0.0, 0.0))[0])
        for pressure in pressures:
            pull = fem.SolidBodyPressure(field, pressure=pressure)
            self.balance(held, np.zeros_like(self.moved), [(field, pull)])
            risen.append(float(self.moved[apex, 0]))
        return np.array(risen)


def _graded(stops: Sequence[float], size: Callable[[float], float]) -> np.ndarray:
    """Return nodes with all stops among them, about as far apart as the size at each place."""
    nodes = [0.0]
    for start, end in pairwise(stops):
        fine = np.linspace(start, end, 401)
        count = np.concatenate([[0.0], np.cumsum(np.diff(fine) / [size(x) for x in fine[1:]])])
        number = max(2, int(np.ceil(count[-1])))
        nodes += np.interp(np.arange(1, number + 1) / number * count[-1], count, fine).tolist()
    return np.array(nodes)
