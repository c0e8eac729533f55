"""Tension of the fascia in the imaged state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import shapely
import ufl
from dolfinx import fem
from dolfinx import mesh as dolfinx_mesh

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, frozen_array
from legfem.mechanics.integration_domain import Body
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.model import Memoryless


@dataclass(frozen=True, eq=False)
class Prestress(Memoryless):
    r"""The fascia is under tension when the leg is imaged, and like a string it resists deflection.

    The tension :math:`\sigma_0` along the fascia's contour, of unit tangent :math:`t`, is in
    equilibrium with the tissues in the imaged state; what both do to first order of the
    displacement cancels, and the tension's work of second order stays:

    .. math:: \frac{\sigma_0}{2} |\nabla u \cdot t|^2.

    It is that of a stress :math:`\sigma_0\, t \otimes t` over the quadratic part of Green's strain
    (the geometric stiffness of K. Washizu, Variational Methods in Elasticity and Plasticity, 1968,
    chapter 5). Nothing happens at ``tension = 0``. For a section; a 3D leg has no contour.

    Parameters
    ----------
    contour : (n, 2) array
        Closed contour of the fascia, for example ``section.fascia`` (mm).
    tension : float
        :math:`\sigma_0` (MPa); below zero the fascia is compressed.
    region : str
        Of the body; the parameter is named ``<region>.prestress.tension``.
    """

    contour: FloatArray
    tension: float = 0.0
    region: str = "fascia"
    domain: Literal["body"] = "body"

    def __post_init__(self) -> None:
        """Copy the contour, and check both."""
        contour = frozen_array(self.contour)
        if contour.ndim != 2 or contour.shape[1] != 2 or len(contour) < 3:
            raise InputError("Prestress", "contour", f"is of shape {contour.shape}", "give three points or more")
        object.__setattr__(self, "contour", contour)
        if not np.isfinite(self.tension):
            raise InputError("Prestress", "tension", "is not finite", "give a finite number")

    @property
    def name(self) -> str:
        """For example ``fascia.prestress``."""
        return f"{self.region}.prestress"

    @property
    def parameters(self) -> dict[str, float]:
        """Tension (MPa)."""
        return {f"{self.name}.tension": self.tension}

    def residual(self, body: Body, history: Mapping[str, Any]) -> Expr:
        """Return the variation of the tension's work of second order."""
        tension = body.symbols.scalar(f"{self.name}.tension", self.tension)
        tangent = self._tangent_field(body.unknown.function_space.mesh)
        turn = ufl.dot(ufl.grad(body.displacement), tangent)
        varied = ufl.dot(ufl.grad(body.variation), tangent)
        return tension * ufl.dot(turn, varied) * body.regions[self.region]

    def tangents(self, points: FloatArray) -> FloatArray:
        """Return the unit tangents (n, 2) of the contour nearest to points (n, 2)."""
        ends = np.roll(self.contour, -1, axis=0)
        along = ends - self.contour
        sides = shapely.STRtree(shapely.linestrings(np.stack([self.contour, ends], axis=1)))
        nearest = sides.nearest(shapely.points(points))
        return np.asarray((along / np.linalg.norm(along, axis=1)[:, None])[nearest])

    def _tangent_field(self, mesh: Any) -> Any:
        if mesh.geometry.dim != 2:
            raise InputError("model", self.name, "a contour's tension needs a section", "leave it out in 3D")
        field = fem.Function(fem.functionspace(mesh, ("DG", 0, (2,))))
        cells = mesh.topology.index_map(2)
        every = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
        middle = dolfinx_mesh.compute_midpoints(mesh, 2, every)[:, :2]
        dofs = field.function_space.dofmap.list[:, 0]
        field.x.array.reshape(-1, 2)[dofs] = self.tangents(middle)
        return field
