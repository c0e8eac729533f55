"""A cylinder of finite length pressed into the idealised leg, in 3D or in plane strain."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from mpi4py import MPI

from legfem.common.errors import InputError, check_positive
from legfem.experiments.experiment import cached_in_process
from legfem.experiments.indentation import IndentationModel, IndentationTest, leg_model
from legfem.fem.spaces import build_spaces
from legfem.fem.system import System
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.indenters import FiniteCylinder, RigidCylinder, RigidIndenter
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import LegModel, Term
from legfem.meshing.idealised_leg import IdealisedLeg, LegMesh, LegMeshSettings, mesh_leg, mesh_leg_section
from legfem.solve.linear import LinearSettings
from legfem.solve.newton import NewtonSolver
from legfem.solve.settings import NewtonSettings, StepSettings


@dataclass(frozen=True)
class Cylinder:
    """The rigid cylinder of the tests.

    Parameters
    ----------
    radius, length : float
        mm; the length includes the rounding of the ends.
    edge_radius : float
        Radius of the rounding of the end edges (mm).
    """

    radius: float = 15.0
    length: float = 50.0
    edge_radius: float = 2.0

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_positive(self, "radius", "length", "edge_radius")

    def shape(self, dimension: int) -> RigidIndenter:
        """Return the signed distance in plane strain (2) or in 3D (3)."""
        if dimension == 2:
            return RigidCylinder(self.radius)
        return FiniteCylinder(self.radius, self.length / 2, self.edge_radius)


@dataclass(frozen=True)
class IdealisedLegSettings:
    """Numerical settings of both models of the idealised leg.

    The pressure under the cylinder's end edges is several times that of plane strain, and so is the
    contact's stiffness. The steps don't adapt to the work, which differs between linear solvers and
    numbers of ranks: all go through the same states.
    """

    mesh: LegMeshSettings = field(default_factory=LegMeshSettings)
    contact: ContactSettings = field(default_factory=lambda: ContactSettings(stiffness=4000.0))
    newton: NewtonSettings = field(default_factory=NewtonSettings)
    linear: LinearSettings = field(default_factory=LinearSettings)
    steps: StepSettings = field(default_factory=StepSettings.regular)
    formulation: Literal["displacement", "mixed"] = "mixed"
    quadrature_degree: int = 4


@dataclass(frozen=True, eq=False)
class IdealisedLegIndentation(IndentationTest):
    """The test on the idealised leg; solves for any parameters without meshing again.

    Parameters
    ----------
    leg, cylinder
        Sizes.
    tissues
        Law of every region the leg has.
    dimension
        3, or 2 for plane strain on the same grid; the force is that of the whole cylinder in both.
    settings
        Numerical.
    comm
        Ranks that one solution is spread over.
    mechanisms
        Terms that are added to the model, for example `legfem.mechanics.terms.Fibres`.

    Raises
    ------
    InputError
        For a cylinder that leaves the leg, or an edge radius that the mesh doesn't resolve.
    """

    leg: IdealisedLeg
    cylinder: Cylinder
    tissues: Mapping[str, Hyperelastic]
    dimension: Literal[2, 3] = 3
    settings: IdealisedLegSettings = field(default_factory=IdealisedLegSettings)
    comm: MPI.Intracomm = field(default_factory=lambda: MPI.COMM_SELF, repr=False)
    mechanisms: tuple[Term, ...] = ()

    def __post_init__(self) -> None:
        """Check what is given."""
        mesh = self.settings.mesh
        if mesh.cells == "tetrahedra" and self.settings.formulation == "mixed":
            raise InputError(
                "mesh", "cells", "tetrahedra have no mixed form here", "choose the displacement form with them"
            )
        if self.dimension == 3:
            _check_ends(self.leg, self.cylinder, mesh)

    @cached_property
    def model(self) -> LegModel:
        """Mechanical model: the sum of its terms."""
        laws = {region: self.tissues[region] for region in self.leg.regions}
        shape, settings = self.cylinder.shape(self.dimension), self.settings
        base = leg_model(laws, shape, settings.contact, settings.formulation)
        return base.with_terms(self.mechanisms)

    @cached_in_process
    def leg_mesh(self) -> LegMesh:
        """The mesh: a quarter of the leg, or half of its section."""
        leg, radius, mesh = self.leg, self.cylinder.radius, self.settings.mesh
        if self.dimension == 3:
            return mesh_leg(leg, radius, self.cylinder.length, mesh, self.comm)
        return mesh_leg_section(leg, radius, mesh, self.comm)

    def _made(self) -> IndentationModel:
        meshed, settings, cylinder = self.leg_mesh, self.settings, self.cylinder
        degree = settings.mesh.degree
        spaces = build_spaces(*meshed.tagged, settings.formulation, degree, meshed.regions, meshed.supports)
        start, direction = np.zeros(self.dimension), np.zeros(self.dimension)
        start[1], direction[1] = self.leg.radius + cylinder.radius, -1.0
        system = System(spaces, self.model, start, direction, settings.quadrature_degree)
        solver = NewtonSolver(system, settings.newton, settings.linear)
        whole = float(meshed.copies) * (1.0 if self.dimension == 3 else cylinder.length)
        return IndentationModel(system, solver, settings.contact, cylinder.radius, whole, settings.steps)


def _check_ends(leg: IdealisedLeg, cylinder: Cylinder, mesh: LegMeshSettings) -> None:
    if cylinder.length >= leg.length and leg.ends == "free":
        raise InputError(
            "cylinder",
            "length",
            f"{cylinder.length:g} mm is no shorter than the leg of {leg.length:g} mm, whose ends are free",
            "make the leg longer, or hold its ends",
        )
    if cylinder.length < leg.length and mesh.edge_size > 2 * cylinder.edge_radius * mesh.degree:
        raise InputError(
            "cylinder",
            "edge_radius",
            f"{cylinder.edge_radius:g} mm is not resolved by elements of {mesh.edge_size:g} mm "
            f"and degree {mesh.degree}",
            f"give a mesh size at the cylinder's end of {2 * cylinder.edge_radius * mesh.degree:g}"
            " mm or less, or a larger radius",
        )
