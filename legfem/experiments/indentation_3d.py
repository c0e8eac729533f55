"""A cylinder of finite length pressed into the idealised leg, in 3D or in plane strain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from mpi4py import MPI

from legfem.checkpoint import key_of
from legfem.checks import check_positive
from legfem.contact import FiniteCylinder, RigidCylinder, RigidIndenter
from legfem.contact_settings import ContactSettings
from legfem.errors import InputError
from legfem.experiments.pressing import (
    SOFTER,
    Indentation,
    OnStep,
    Pressing,
    farthest,
    leg_model,
)
from legfem.linear import LinearSettings
from legfem.materials import Hyperelastic
from legfem.meshing.idealised_leg import (
    IdealisedLeg,
    LegMesh,
    LegMeshSettings,
    mesh_leg,
    mesh_leg_section,
)
from legfem.newton import NewtonSettings, NewtonSolver
from legfem.protocol import Protocol
from legfem.spaces import build_spaces
from legfem.stepping import StepSettings
from legfem.system import System


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


class IdealisedLegIndentation:
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
        Over which one solution is spread.

    Raises
    ------
    InputError
        For a cylinder that leaves the leg, or an edge radius that the mesh doesn't resolve.
    """

    def __init__(
        self,
        leg: IdealisedLeg,
        cylinder: Cylinder,
        tissues: Mapping[str, Hyperelastic],
        dimension: Literal[2, 3] = 3,
        settings: IdealisedLegSettings | None = None,
        comm: MPI.Intracomm = MPI.COMM_SELF,
    ) -> None:
        self.leg, self.cylinder, self.dimension = leg, cylinder, dimension
        self.settings = settings or IdealisedLegSettings()
        self.comm = comm
        mesh_settings = self.settings.mesh
        if mesh_settings.cells == "tetrahedra" and self.settings.formulation == "mixed":
            raise InputError(
                "mesh", "cells", "tetrahedra have no mixed form here",
                "choose the displacement form with them",
            )  # fmt: skip
        if dimension == 3:
            _check_ends(leg, cylinder, mesh_settings)
            self.leg_mesh: LegMesh = mesh_leg(
                leg, cylinder.radius, cylinder.length, mesh_settings, comm
            )
            whole = float(self.leg_mesh.copies)
        else:
            self.leg_mesh = mesh_leg_section(leg, cylinder.radius, mesh_settings, comm)
            whole = self.leg_mesh.copies * cylinder.length
        spaces = build_spaces(
            self.leg_mesh.mesh,
            self.leg_mesh.cell_tags,
            self.leg_mesh.facet_tags,
            self.settings.formulation,
            mesh_settings.degree,
            self.leg_mesh.regions,
            self.leg_mesh.supports,
        )
        start, direction = np.zeros(dimension), np.zeros(dimension)
        start[1], direction[1] = leg.radius + cylinder.radius, -1.0
        laws = {region: tissues[region] for region in self.leg_mesh.regions}
        model = leg_model(
            laws, cylinder.shape(dimension), self.settings.contact, self.settings.formulation
        )
        degree = self.settings.quadrature_degree
        self.system = System(spaces, model, start, direction, degree)
        self.solver = NewtonSolver(self.system, self.settings.newton, self.settings.linear)
        self._pressing = Pressing(
            self.system, self.solver, self.settings.contact, cylinder.radius, whole,
            self.settings.steps,
        )  # fmt: skip

    def solve(
        self,
        parameters: Mapping[str, float] | None = None,
        depth: float = 25.0,
        sensitivities: Sequence[str] = (),
        on_step: OnStep | None = None,
        keep_in: Path | None = None,
    ) -> Indentation:
        """Press the cylinder in; arguments as those of `PlaneStrainIndentation.solve`.

        Where that stops short, once more with a softer contact, which the report tells. With a
        folder to keep states in, a solution that was killed goes on from the last one, with the
        same number of ranks; they are removed at its end.
        """
        asked = parameters, Protocol.ramp(depth, rate=1.0), sensitivities, on_step
        kept = None if keep_in is None else (keep_in, self._key())
        attempts = [self._pressing.run(*asked, keep_in=kept)]
        if not attempts[-1].report.complete:
            attempts.append(self._pressing.run(*asked, softness=SOFTER, keep_in=kept))
        return farthest(attempts)

    def _key(self) -> str:
        given = [asdict(self.leg), asdict(self.cylinder), asdict(self.settings)]
        return key_of([self.dimension, *given, str(self.system.model)])


def _check_ends(leg: IdealisedLeg, cylinder: Cylinder, mesh: LegMeshSettings) -> None:
    if cylinder.length >= leg.length and leg.ends == "free":
        raise InputError(
            "cylinder", "length",
            f"{cylinder.length:g} mm is no shorter than the leg of {leg.length:g} mm, whose ends "
            "are free",
            "make the leg longer, or hold its ends",
        )  # fmt: skip
    if cylinder.length < leg.length and mesh.edge_size > 2 * cylinder.edge_radius * mesh.degree:
        raise InputError(
            "cylinder", "edge_radius",
            f"{cylinder.edge_radius:g} mm is not resolved by elements of {mesh.edge_size:g} mm "
            f"and degree {mesh.degree}",
            f"give a mesh size at the cylinder's end of {2 * cylinder.edge_radius * mesh.degree:g}"
            " mm or less, or a larger radius",
        )  # fmt: skip
