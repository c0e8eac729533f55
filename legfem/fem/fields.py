"""Fields of a deformed leg: displacement, stress and strain measures, pressure on the skin."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.fem.compat import evaluate
from legfem.fem.compiled import expression
from legfem.fem.system import System
from legfem.mechanics.kinematics import Expr, volume_ratio
from legfem.mechanics.model import Stressed
from legfem.mechanics.terms import NormalContact, SkinPressure


@dataclass(frozen=True, eq=False)
class LegFields:
    """A system's state as `dolfinx.fem.Function` values, for output.

    Stresses and strain measures are discontinuous, linear in every cell: the least-squares fit to
    their values at the quadrature points, where equilibrium was solved.
    """

    displacement: Any
    """Displacement, mm, continuous, of the order that was solved for."""
    pressure: Any
    """Hydrostatic Cauchy pressure ``-tr(sigma)/3`` (kPa), positive in compression."""
    von_mises: Any
    """Von Mises' equivalent Cauchy stress (kPa)."""
    stretch: Any
    """Greatest principal stretch, dimensionless."""
    volume_ratio: Any
    """Volume ratio J, dimensionless."""
    region: Any
    """Tag of the tissue, constant in every cell: the values of `legfem.meshing.section.REGIONS`."""
    skin_pressure: Any
    """Pressure on the skin's mesh, per unit of deformed area (kPa): that of the contact, or the given one;
    its name tells which."""
    skin_displacement: Any
    """Displacement on the skin's mesh, mm."""
    indenter_centre: FloatArray
    """Centre of the indenter, (dimension,), mm; without an indenter it means nothing."""


def hydrostatic_pressure(stress: FloatArray) -> FloatArray:
    """Return ``-tr(sigma)/3`` of stresses (..., 3, 3), in their unit."""
    return -np.trace(stress, axis1=-2, axis2=-1) / 3


def von_mises_stress(stress: FloatArray) -> FloatArray:
    """Return von Mises' equivalent of stresses (..., 3, 3), in their unit."""
    deviator = stress + hydrostatic_pressure(stress)[..., None, None] * np.eye(3)
    return np.sqrt(1.5 * np.sum(deviator**2, axis=(-2, -1)))


def greatest_stretch(gradient: FloatArray) -> FloatArray:
    """Return the greatest principal stretch of deformation gradients (..., 3, 3)."""
    return np.asarray(np.linalg.svd(gradient, compute_uv=False)[..., 0])


def fields_of(system: System) -> LegFields:
    """Return the fields of a system in its present state; see `FieldReader`."""
    return FieldReader(system).read()


@dataclass(frozen=True, eq=False)
class FieldReader:
    """Reads a system's fields in one state after another, its expressions made once.

    The stress is the sum of what the terms tell (`legfem.mechanics.model.Stressed`). Where one of
    a region doesn't, the names of pressure and stress say what they are without.
    """

    system: System

    def read(self) -> LegFields:
        """Return the fields in the present state; collective over the system's ranks."""
        system, spaces = self.system, self.system.spaces
        body, skin = system.body.domain, system.skin.domain
        displacement = fem.Function(spaces.displacement_space, name="displacement")
        displacement.x.array[:] = system.unknown.x.array[spaces.displacement_dofs]

        linear = fem.functionspace(spaces.mesh, ("DG", 1))
        terms = system.model.at("body")
        without_stress = [t.name for t in terms if hasattr(t, "region") and not isinstance(t, Stressed)]
        without = f"_without_{'_'.join(without_stress)}" if without_stress else ""
        names = {
            "pressure": f"pressure{without}",
            "von_mises": f"von_mises{without}",
            "stretch": "stretch",
            "volume_ratio": "volume_ratio",
        }
        measures = {key: fem.Function(linear, name=name) for key, name in names.items()}
        degree = body.quadrature_degree
        for cells, both in self._in_tissues:
            values = evaluate(both, spaces.mesh, cells).reshape(-1, 2, 3, 3)
            gradient, stress = values[:, 0], mpa_to_kpa(values[:, 1])
            for key, value in (
                ("pressure", hydrostatic_pressure(stress)),
                ("von_mises", von_mises_stress(stress)),
                ("stretch", greatest_stretch(gradient)),
                ("volume_ratio", np.linalg.det(gradient)),
            ):
                fit_in_cells(measures[key], value, cells, degree)
        _drop_negative(measures["von_mises"])
        for measure in measures.values():
            measure.x.scatter_forward()

        region = fem.Function(fem.functionspace(spaces.mesh, ("DG", 0)), name="region")
        region.x.array[spaces.cell_tags.indices] = spaces.cell_tags.values
        skin_pressure, skin_displacement = self.on_skin()
        return LegFields(
            displacement=displacement,
            region=region,
            skin_pressure=skin_pressure,
            skin_displacement=skin_displacement,
            indenter_centre=np.array(skin.centre.value),
            **measures,
        )

    @cached_property
    def _in_tissues(self) -> list[tuple[NDArray[np.int32], Any]]:
        """Cells, and deformation gradient and Cauchy stress there, of every tissue that tells."""
        spaces, body = self.system.spaces, self.system.body.domain
        found, F = [], body.deformation_gradient
        every = [t for t in self.system.model.at("body") if isinstance(t, Stressed)]
        for tag in np.unique(spaces.cell_tags.values):
            # Of a region within another both act there.
            stressed = [t for t in every if np.isin(tag, spaces.regions[t.region])]
            if not stressed:
                continue
            cells = spaces.cell_tags.find(tag).astype(np.int32)
            nominal = sum(term.nominal_stress(body) for term in stressed)
            sigma = ufl.dot(nominal, ufl.transpose(F)) / volume_ratio(F)
            both = ufl.as_tensor([[[m[i, j] for j in range(3)] for i in range(3)] for m in (F, sigma)])
            found.append((cells, _at_points(both, spaces.mesh, body.quadrature_degree)))
        return found

    @cached_property
    def _on_the_skin(self) -> tuple[str, Any]:
        """Name of the load on the skin, and its pressure per deformed area (MPa) or None without one."""
        domain = self.system.skin.domain
        terms = self.system.model.at("skin")
        contacts = [term for term in terms if isinstance(term, NormalContact)]
        given = [term for term in terms if isinstance(term, SkinPressure)]
        name = "interface_pressure" if given and not contacts else "contact_pressure"
        if not contacts and not given:
            return name, None
        pressure = sum(term.pressure(domain) for term in contacts) / ufl.sqrt(domain.sheet_invariants[1])
        pressure += sum(term.pressure(domain) for term in given)
        return name, _at_points(pressure, self.system.spaces.skin, domain.quadrature_degree)

    def on_skin(self) -> tuple[Any, Any]:
        """Return pressure per deformed area (kPa) and displacement (mm) on the skin's mesh."""
        system, mesh = self.system, self.system.spaces.skin
        domain = system.skin.domain
        domain.unknown.x.array[:] = system.unknown.x.array[system.spaces.trace]
        displacement = fem.Function(system.spaces.skin_space, name="displacement")
        displacement.x.array[:] = domain.unknown.x.array
        name, pressure = self._on_the_skin
        function = fem.Function(fem.functionspace(mesh, ("DG", 1)), name=name)
        if pressure is None:
            return function, displacement
        index_map = mesh.topology.index_map(mesh.topology.dim)
        cells = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
        values = mpa_to_kpa(evaluate(pressure, mesh, cells))
        fit_in_cells(function, values, cells, domain.quadrature_degree)
        _drop_negative(function)
        return function, displacement


def fit_in_cells(function: Any, values: FloatArray, cells: NDArray[np.int32], degree: int) -> None:
    """Set a discontinuous function in some cells to the least-squares fit of quadrature values.

    Parameters
    ----------
    function
        Scalar, discontinuous function.
    values
        Values, flat by cell and quadrature point.
    cells
        Local indices of the cells.
    degree
        Degree of the quadrature.
    """
    space = function.function_space
    points, weights = _quadrature(space.mesh, degree)
    shapes = space.element.basix_element.tabulate(0, points)[0, :, :, 0]
    # In cells whose mapping isn't affine, the weights ignore the variation of its determinant.
    weighted = shapes.T * weights
    fit = np.linalg.solve(weighted @ shapes, weighted)
    function.x.array[space.dofmap.list[cells]] = values.reshape(len(cells), -1) @ fit.T


def _drop_negative(function: Any) -> None:
    """Set to zero where a linear fit falls below what the quantity can be."""
    np.maximum(function.x.array, 0.0, out=function.x.array)


def _quadrature(mesh: Any, degree: int) -> tuple[FloatArray, FloatArray]:
    element = basix.ufl.quadrature_element(mesh.basix_cell(), degree=degree)
    points, weights = element.custom_quadrature()
    return points, weights


def _at_points(value: Expr, mesh: Any, degree: int) -> Any:
    """Return a compiled expression at a quadrature's points."""
    points, _ = _quadrature(mesh, degree)
    return expression(value, points)


@dataclass(frozen=True, eq=False)
class StretchedElement:
    """The element of a plane body that is drawn out most, on this rank."""

    region: int
    """Tag of its tissue."""
    stretch: float
    """Greatest stretch, from the displacements of its corners."""
    place: FloatArray
    """Middle of the undeformed element, (2,), mm."""


def most_stretched(system: System) -> StretchedElement:
    """Return the triangle of a section whose corners were drawn apart most, in the last state."""
    spaces = system.spaces
    space = spaces.displacement_space
    moved = np.asarray(system.unknown.x.array[spaces.displacement_dofs]).reshape(-1, 2)
    places = space.tabulate_dof_coordinates()[:, :2]
    corners = space.dofmap.list[spaces.cell_tags.indices][:, :3]
    before = np.swapaxes(places[corners][:, 1:] - places[corners][:, :1], 1, 2)
    now = places[corners] + moved[corners]
    after = np.swapaxes(now[:, 1:] - now[:, :1], 1, 2)
    stretch = np.linalg.svd(after @ np.linalg.inv(before), compute_uv=False)[:, 0]
    worst = int(np.argmax(stretch))
    return StretchedElement(
        int(spaces.cell_tags.values[worst]), float(stretch[worst]), places[corners[worst]].mean(axis=0)
    )
