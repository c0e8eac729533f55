"""Forms of a model's body and of its skin: numbers as symbols, history variables at quadrature points."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from numbers import Real
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.fem.compat import evaluate
from legfem.fem.compiled import compiled, expression
from legfem.fem.spaces import POROUS, LegSpaces
from legfem.mechanics.kinematics import Expr
from legfem.mechanics.model import Body, IntegrationDomain, LegModel, Skin, Swept
from legfem.meshing.section import HULL


class Symbols:
    """The numbers of a model on one mesh: `dolfinx.fem.Constant` values behind UFL variables.

    A form is differentiated with respect to a parameter through its variable.
    """

    def __init__(self, mesh: Any) -> None:
        self._mesh = mesh
        self._constants: dict[str, Any] = {}
        self._variables: dict[str, Any] = {}

    def of(self, prefix: str, given: Any) -> Any:
        """Return a frozen dataclass with its numbers replaced by symbols ``prefix.field``."""
        replaced = {
            field.name: self.scalar(f"{prefix}.{field.name}", float(value))
            for field in dataclasses.fields(given)
            if isinstance(value := getattr(given, field.name), Real)
        }
        return dataclasses.replace(given, **replaced)

    def scalar(self, name: str, value: float) -> Any:
        """Return the symbol of that name, made on first use."""
        if name not in self._constants:
            self._constants[name] = fem.Constant(self._mesh, float(value))
            self._variables[name] = ufl.variable(self._constants[name])
        return self._variables[name]

    def assign(self, values: Mapping[str, float]) -> None:
        """Set those of the values that this mesh has a symbol for."""
        for name, value in values.items():
            if name in self._constants:
                self._constants[name].value = value

    @property
    def zeros(self) -> frozenset[str]:
        """Names of the numbers that are zero now."""
        return frozenset(name for name, c in self._constants.items() if float(c.value) == 0.0)

    def __contains__(self, name: str) -> bool:
        """Return whether a model on this mesh has that number."""
        return name in self._constants

    def __getitem__(self, name: str) -> Any:
        """Return the UFL variable of that name."""
        return self._variables[name]


class Clock:
    """Time on one mesh (s): at the end of the step, and the step itself."""

    def __init__(self, mesh: Any) -> None:
        self.time, self.step = fem.Constant(mesh, 0.0), fem.Constant(mesh, 1.0)

    def set(self, time: float, step: float) -> None:
        """Set the time at the end of the step and the step's duration, s."""
        self.time.value, self.step.value = time, step


class History:
    """History variables of one domain, with their update at the end of a step.

    Parameters
    ----------
    mesh
        Mesh of the domain.
    degree
        Degree of the quadrature of the domain's forms.
    shapes
        Shape of every variable by its name.
    """

    def __init__(self, mesh: Any, degree: int, shapes: dict[str, tuple[int, ...]]) -> None:
        self._mesh = mesh
        cell = mesh.basix_cell()
        cells = mesh.topology.index_map(mesh.topology.dim)
        self._cells = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
        self._points = basix.ufl.quadrature_element(cell, degree=degree).custom_quadrature()[0]
        self.variables = {
            name: fem.Function(
                fem.functionspace(mesh, basix.ufl.quadrature_element(cell, value_shape=shape, degree=degree))
            )
            for name, shape in shapes.items()
        }
        self._updates: dict[str, Any] = {}

    def compile_update(self, updated: dict[str, Any]) -> None:
        """Prepare the expressions that give the variables at the end of a step."""
        self._updates = {name: self.expression(value) for name, value in updated.items()}

    def expression(self, value: Any) -> Any:
        """Return a compiled expression at the quadrature points."""
        return expression(value, self._points)

    def values(self, expression: Any) -> NDArray[np.float64]:
        """Return an expression at all quadrature points, flat."""
        return evaluate(expression, self._mesh, self._cells)

    def updated(self, name: str) -> NDArray[np.float64]:
        """Return a variable at the end of the step, flat."""
        return self.values(self._updates[name])

    def advance(self) -> None:
        """Move all variables to the end of the step."""
        fresh = {name: self.updated(name) for name in self._updates}
        for name, value in fresh.items():
            self.variables[name].x.array[:] = value

    def reset(self) -> None:
        """Set all variables to zero."""
        for variable in self.variables.values():
            variable.x.array[:] = 0.0


SKIN_DEGREE, RAISED_SKIN_DEGREE = 3, 5
"""Degree of the skin's quadrature, and that where the body's is raised to 6. Two points leave an edge of second order a
motion that they don't feel, and skin on fat that is far softer than what presses it takes it; three feel all.
"""
type Rounding = Callable[[FloatArray], FloatArray]
"""Function from points on flat facets, (n, 3), mm, to those of the surface that they stand for."""


class DomainForms[Domain: IntegrationDomain]:
    """Unknown, history and forms of one domain.

    A term may name its ``strength``, a number at whose zero it adds nothing to the residual: its
    forms are left out while all such numbers are zero.
    """

    def __init__(self, domain: Domain, before: Any, model_terms: Any, degree: int) -> None:
        self.domain, self.before = domain, before
        mesh = domain.unknown.function_space.mesh
        shapes = {f"{term.name}.{name}": shape for term in model_terms for name, shape in term.history(domain).items()}
        self.history = History(mesh, degree, shapes)

        def of(term: Any) -> dict[str, Any]:
            return {name: self.history.variables[f"{term.name}.{name}"] for name in term.history(domain)}

        works = [(getattr(t, "strength", None), t.residual(domain, of(t))) for t in model_terms]
        self.residual_form = sum(work for _, work in works)
        self._strengths = frozenset(name for name, _ in works if name is not None)
        lasting = sum(work for name, work in works if name is None)
        self._works = {False: self.residual_form, True: lasting}
        self._compiled: dict[bool, tuple[Any, Any]] = {}
        self.updated = {
            f"{term.name}.{name}": value
            for term in model_terms
            for name, value in term.updated(domain, of(term)).items()
        }
        self.history.compile_update(self.updated)

    @property
    def residual(self) -> Any:
        """The compiled residual, without the terms that add nothing at the present numbers."""
        return self._at_present()[0]

    @property
    def tangent(self) -> Any:
        """Its compiled derivative by the unknown."""
        return self._at_present()[1]

    def _at_present(self) -> tuple[Any, Any]:
        silent = bool(self._strengths) and self._strengths <= self.domain.symbols.zeros
        if silent not in self._compiled:
            unknown, work = self.domain.unknown, self._works[silent]
            trial = ufl.TrialFunction(unknown.function_space)
            tangent = ufl.derivative(work, unknown, trial)
            self._compiled[silent] = compiled(work), compiled(tangent)
        return self._compiled[silent]

    def advance(self) -> None:
        """Make the present state the one that the next step starts from."""
        self.history.advance()
        self.before.x.array[:] = self.domain.unknown.x.array

    @property
    def remembered(self) -> dict[str, Any]:
        """Functions that hold what the next step starts from, by name."""
        return {"before": self.before, **self.history.variables}

    def reset(self) -> None:
        """Return to the undeformed state."""
        self.history.reset()
        self.before.x.array[:] = 0.0
        self.domain.unknown.x.array[:] = 0.0


def body_forms(
    spaces: LegSpaces, model: LegModel, unknown: Any, symbols: Symbols, clock: Clock, degree: int
) -> DomainForms[Body]:
    """Return the forms of the body, with quadrature of a degree."""
    space = spaces.space
    before, test = fem.Function(space), ufl.TestFunction(space)
    measure = ufl.Measure(
        "dx", domain=spaces.mesh, subdomain_data=spaces.cell_tags, metadata={"quadrature_degree": degree}
    )
    radius = _radius(spaces, spaces.mesh)
    mixed = spaces.formulation != "displacement"
    now = ufl.split(unknown) if mixed else (unknown,)
    varied = ufl.split(test) if mixed else (test,)
    domain = Body(
        symbols,
        unknown,
        test,
        now[0],
        ufl.split(before)[0] if mixed else before,
        varied[0],
        degree,
        clock.time,
        clock.step,
        {name: _swept(measure(tag), radius) for name, tag in spaces.regions.items()},
        _by_region(spaces, now[1:]),
        _by_region(spaces, varied[1:]),
        spaces.formulation == "porous",
        radius,
        _hull(spaces, degree),
    )
    return DomainForms(domain, before, model.at("body"), degree)


def skin_forms(
    spaces: LegSpaces,
    model: LegModel,
    symbols: Symbols,
    clock: Clock,
    centres: tuple[Any, Any],
    applied_pressure: Any,
    rounding: Rounding | None = None,
    degree: int = SKIN_DEGREE,
) -> DomainForms[Skin]:
    """Return the forms of the skin.

    ``centres`` are the indenter's, now and before the step; it meets the skin that ``rounding``
    makes of the mesh's facets, to the order of the displacement.
    """
    mesh, space = spaces.skin, spaces.skin_space
    unknown, before, test = fem.Function(space), fem.Function(space), ufl.TestFunction(space)
    metadata = {"quadrature_degree": degree, "quadrature_rule": "default"}
    outward = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    outward.x.array[:] = spaces.skin_outward
    radius = _radius(spaces, mesh)
    domain = Skin(
        symbols,
        unknown,
        test,
        unknown,
        before,
        test,
        degree,
        clock.time,
        clock.step,
        _swept(ufl.Measure("dx", domain=mesh, metadata=metadata), radius),
        ufl.SpatialCoordinate(mesh),
        *centres,
        spaces.dimension,
        outward,
        applied_pressure,
        radius,
        None if rounding is None else _rounded(space, rounding),
    )
    return DomainForms(domain, before, model.at("skin"), degree)


def _rounded(space: Any, rounding: Rounding) -> Any:
    """Return what a rounding adds to the position, interpolated."""
    added, nodes = fem.Function(space), space.tabulate_dof_coordinates()
    if len(nodes) > 0:
        added.x.array[:] = (rounding(nodes) - nodes).ravel()
    return added


def _hull(spaces: LegSpaces, degree: int) -> Any:
    """Return the measure of the deep tissue's face, or None where no facets are tagged so."""
    mesh, dimension = spaces.mesh, spaces.mesh.topology.dim
    facets = spaces.facet_tags.find(HULL)
    if mesh.comm.allreduce(len(facets)) == 0:
        return None
    mesh.topology.create_connectivity(dimension, dimension - 1)
    facets_of = mesh.topology.connectivity(dimension, dimension - 1).array.reshape(-1, dimension + 1)
    inner = np.setdiff1d(np.arange(mesh.topology.index_map(dimension).size_local), spaces.cells("superficial"))
    cell, number = np.nonzero(np.isin(facets_of[inner], facets))
    pairs = np.column_stack([inner[cell], number])
    return ufl.Measure(
        "ds",
        domain=mesh,
        subdomain_data=[(HULL, pairs.astype(np.int32).ravel())],
        metadata={"quadrature_degree": degree},
    )(HULL)


def _radius(spaces: LegSpaces, mesh: Any) -> Expr | None:
    """Return the reference distance from the axis of symmetry, or None without one."""
    return ufl.SpatialCoordinate(mesh)[0] if spaces.symmetry == "axial" else None


def _swept(measure: Any, radius: Expr | None) -> Any:
    return measure if radius is None else Swept(measure, radius)


def _by_region(spaces: LegSpaces, pressures: Sequence[Expr]) -> dict[str, Expr]:
    """Return the pressure of every region that has one."""
    if spaces.formulation == "continuous":
        return dict(zip(spaces.regions, pressures, strict=True))
    porous = spaces.formulation == "porous"
    return {r: p for p in pressures for r in spaces.regions if not porous or r in POROUS}
