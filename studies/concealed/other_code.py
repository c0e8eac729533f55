r"""A second code: felupe's elements, with a mesh, a contact and a Newton iteration of its own.

Quadratic triangles in plane strain, displacements alone (the tissues' bulk moduli are some 25 times
their shear moduli, so nothing locks); energies per reference volume,

.. math:: W = C_{10} (\bar I_1 - 3) + C_{20} (\bar I_1 - 3)^2
          + \tfrac{\alpha}{\beta} (e^{\beta (\bar I_1 - 3)} - 1)
          + (J - 1)^2 / D_1 + (J - 1)^4 / D_2.

The cylinder is a rigid disk; its contact a penalty at Gauss points of the skin's edges, along the
surface a spring to where the point first touched, which slides at Coulomb's limit. Bones are held,
or each is moved by its springs as a rigid body that doesn't turn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.legs.subject import Subject, TissueParameters
from studies.concealed.other_mesh import GAUSS, mesh_leg
from studies.concealed.other_pressing import OtherPressing, spread
from studies.concealed.other_tissue import other_law

_PENALTY, _ALONG = 400.0, 200.0
"""Normal and tangential, times the fat's shear modulus over the cylinder's radius."""


@dataclass(frozen=True)
class OtherCase:
    """What is solved; stiffness in kPa.

    Parameters
    ----------
    c10, c20
        Of the deep tissue.
    exponential
        alpha and beta of the deep tissue's exponential energy.
    factors
        On C10 of ``superficial`` and ``fascia``, and on D1 of ``deep``.
    friction
        Coulomb's coefficient; infinite for a skin that sticks.
    springs
        Of every bone, N/mm over the cylinder's length, across and along the travel; bones are held
        without it.
    lump
        Distance from first touch along the travel (mm), radius (mm) and factor on C10 of a stiffer
        lump in the deep tissue.
    """

    c10: float
    c20: float = 0.0
    exponential: tuple[float, float] = (0.0, 1.0)
    factors: Mapping[str, float] = field(default_factory=dict)
    friction: float = np.inf
    springs: float | None = None
    lump: tuple[float, float, float] | None = None


class OtherCode(OtherPressing):
    """A leg in plane strain, pressed by a disk.

    Parameters
    ----------
    subject
        Leg, indenter and the laws of its tissues.
    case
        What is solved.
    finer
        Than the default mesh, a factor.
    """

    def __init__(self, subject: Subject, case: OtherCase, finer: float = 1.0) -> None:
        from legfem.meshing.section import first_touch

        indenter = subject.indenter
        self.subject, self.case = subject, case
        self.radius, travel = indenter.radius, indenter.direction
        self.start = np.asarray(first_touch(subject.section.skin, indenter.radius, indenter.aim, travel))
        at_skin = self.start + self.radius * travel
        self.mesh = mesh_leg(subject.section, at_skin, finer)
        bodies = list(self._made(at_skin, travel))
        super().__init__(bodies, self._kept(), travel, indenter.length)
        fat = subject.tissues["superficial"].C10
        assert fat is not None
        modulus = 2 * fat
        self.penalty = _PENALTY * modulus / self.radius
        self.along = _ALONG * modulus / self.radius
        xi = GAUSS[0]
        self._shape = np.column_stack([xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2])

    def _made(self, touch: FloatArray, travel: FloatArray) -> Any:
        import felupe as fem

        for name, cells in self.mesh.cells.items():
            own = self.subject.tissues[name]
            parts = {1.0: cells}
            if name == "deep" and self.case.lump is not None:
                distance, radius, factor = self.case.lump
                middle = self.mesh.points[cells[:, :3]].mean(axis=1)
                inside = np.linalg.norm(middle - touch - distance * travel, axis=1) < radius
                parts = {1.0: cells[~inside], factor: cells[inside]}
            for factor, part in parts.items():
                region = fem.RegionQuadraticTriangle(fem.Mesh(self.mesh.points, part, "triangle6"))
                holder = fem.FieldContainer([fem.FieldPlaneStrain(region, dim=2)])
                law = self._law(name, own, factor)
                yield holder, fem.SolidBody(law, holder)

    def _law(self, name: str, own: TissueParameters, factor: float) -> Any:
        case = self.case
        if name != "deep":
            assert own.C10 is not None
            return other_law(own.C10 * case.factors.get(name, 1.0), own.D1)
        c10, c20 = (factor * kpa_to_mpa(c) for c in (case.c10, case.c20))
        alpha, beta = factor * kpa_to_mpa(case.exponential[0]), case.exponential[1]
        d1 = own.D1 * case.factors.get("deep", 1.0)
        return other_law(c10, d1, c20, own.D2, (alpha, beta))

    def _kept(self) -> csr_matrix:
        """Return the matrix from what is free to all displacements."""
        count = len(self.mesh.points)
        held = np.zeros(count, dtype=bool)
        for points in self.mesh.bones.values():
            held[points] = True
        free = np.flatnonzero(~held)
        rows: list[Any] = [np.repeat(2 * free, 2) + np.tile([0, 1], len(free))]
        columns: list[Any] = [np.arange(2 * len(free))]
        width = 2 * len(free)
        if self.case.springs is not None:
            for points in self.mesh.bones.values():
                rows.append(np.asarray(2 * points[:, None] + np.array([0, 1])).ravel())
                columns.append(np.tile([width, width + 1], len(points)))
                width += 2
        r, c = np.concatenate(rows), np.concatenate(columns)
        return csr_matrix((np.ones(len(r)), (r, c)), shape=(2 * count, width))

    def _untouched(self) -> FloatArray:
        return np.full(self.mesh.skin_weights.shape, np.nan)

    def _held(self, free: FloatArray, left: FloatArray, matrix: Any) -> tuple[FloatArray, Any]:
        if self.case.springs is None:
            return left, matrix
        each = self.case.springs / self.subject.indenter.length
        own = np.zeros(len(free))
        own[-2 * len(self.mesh.bones) :] = each
        return left + own * free, (matrix + coo_matrix((own, (np.arange(len(own)),) * 2), shape=matrix.shape)).tocsc()

    def _contact(self, u: FloatArray, to: float, before: FloatArray) -> tuple[FloatArray, Any, FloatArray, FloatArray]:
        """Return the disk's force on the skin, its tangent, the resultant, and where points stick.

        ``before`` (k, 3) is the way along the disk's surface at which each Gauss point holds; NaN
        where it hasn't touched.
        """
        edges, weights, stuck = self.mesh.skin, self.mesh.skin_weights, before
        centre = self.start + to * self.travel
        x = np.einsum("qn,knd->kqd", self._shape, (self.mesh.points + u.reshape(-1, 2))[edges])
        away = x - centre
        rho = np.linalg.norm(away, axis=2)
        n = away / rho[:, :, None]
        tau = np.stack([-n[:, :, 1], n[:, :, 0]], axis=2)
        pressed = np.maximum(self.radius - rho, 0.0)
        touching = pressed > 0
        pressure = self.penalty * pressed
        s = self.radius * np.arctan2(n @ np.array([-self.travel[1], self.travel[0]]), n @ self.travel)
        holding = touching & ~np.isnan(stuck)
        pull = np.where(holding, self.along * (s - np.where(holding, stuck, 0.0)), 0.0)
        limit = self.case.friction * pressure if np.isfinite(self.case.friction) else np.inf
        sliding = holding & (np.abs(pull) > limit)
        drag = np.where(sliding, np.sign(pull) * np.minimum(np.abs(pull), limit), pull)
        f = weights[:, :, None] * (pressure[:, :, None] * n - drag[:, :, None] * tau)
        by_normal = weights * self.penalty * touching
        by_along = weights * self.along * (holding & ~sliding) - weights * pressure / rho
        K = by_normal[:, :, None, None] * n[:, :, :, None] * n[:, :, None, :]
        K = K + by_along[:, :, None, None] * tau[:, :, :, None] * tau[:, :, None, :]
        if np.isfinite(self.case.friction):
            slope = weights * self.case.friction * self.penalty * np.sign(pull) * sliding
            K = K - slope[:, :, None, None] * tau[:, :, :, None] * n[:, :, None, :]
        outer, tangent = spread(self._shape, edges, f, K, len(u))
        held = np.where(touching, np.where(np.isnan(stuck), s, stuck), np.nan)
        held = np.where(sliding, s - drag / self.along, held)
        return outer, tangent, f.sum(axis=(0, 1)), held
