"""Tests with axial symmetry: a ball on a layer, a cylinder between plates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from mpi4py import MPI

from legfem.checks import check_positive
from legfem.contact import RigidBall, RigidIndenter, RigidPlate
from legfem.contact_settings import ContactSettings
from legfem.curve import ForceCurve
from legfem.experiments.pressing import SOFTER, Indentation, OnStep, Pressing, farthest, leg_model
from legfem.linear import LinearSettings
from legfem.materials import Hyperelastic
from legfem.meshing.meridian import (
    REGION,
    MeridianMesh,
    MeridianMeshSettings,
    mesh_meridian,
    supports,
)
from legfem.model import LegModel, Term
from legfem.newton import NewtonSettings, NewtonSolver
from legfem.path import Path
from legfem.protocol import Protocol
from legfem.spaces import Formulation, Support, build_spaces
from legfem.stepping import StepSettings
from legfem.system import System

Faces = Literal["rough", "frictionless"]


@dataclass(frozen=True)
class BallOnLayer:
    """A rigid ball above a layer on a rigid base.

    Parameters
    ----------
    thickness : float
        Of the layer (mm).
    ball_radius : float
        mm.
    layer_radius : float
        Of the layer, whose side is free (mm).
    ball : {"rough", "frictionless"}
        Whether what touches the ball sticks.
    base : {"bonded", "sliding"}
        Whether the layer sticks to its base; it doesn't lift off in either case.
    """

    thickness: float
    ball_radius: float = 5.0
    layer_radius: float = 40.0
    ball: Faces = "rough"
    base: Literal["bonded", "sliding"] = "bonded"

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_positive(self, "thickness", "ball_radius", "layer_radius")


@dataclass(frozen=True)
class CylinderBetweenPlates:
    """A cylinder compressed along its axis between two rigid plates.

    Parameters
    ----------
    radius, height : float
        Of the cylinder (mm).
    ends : {"bonded", "sliding"}
        Whether the end faces stick to the plates. Where the bulging side comes onto the bonded
        plates, it sticks too.
    """

    radius: float = 25.0
    height: float = 30.0
    ends: Literal["bonded", "sliding"] = "sliding"

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_positive(self, "radius", "height")


@dataclass(frozen=True)
class AxisymmetricSettings:
    """Numerical settings; without a mesh or contact a test chooses its own."""

    mesh: MeridianMeshSettings | None = None
    contact: ContactSettings | None = None
    newton: NewtonSettings = field(default_factory=NewtonSettings)
    linear: LinearSettings = field(default_factory=LinearSettings)
    steps: StepSettings = field(default_factory=lambda: StepSettings(first=0.1, largest=0.5))
    formulation: Formulation = "mixed"
    quadrature_degree: int = 4


@dataclass(frozen=True, eq=False)
class _Test:
    """What both tests share: a meshed half plane under an indenter that comes from above."""

    meshed: MeridianMesh
    held: tuple[Support, ...]
    indenter: RigidIndenter
    centre: float
    """Height of the indenter's centre at first touch (mm)."""
    contact: ContactSettings
    length: float
    """Which the contact's stiffness is measured by (mm)."""

    def pressing(
        self, law: Hyperelastic, settings: AxisymmetricSettings, mechanisms: Sequence[Term]
    ) -> Pressing:
        """Put the model on the mesh."""
        spaces = build_spaces(
            self.meshed.mesh,
            self.meshed.cell_tags,
            self.meshed.facet_tags,
            settings.formulation,
            regions=REGION,
            supports=self.held,
            symmetry="axial",
        )
        model: LegModel = leg_model(
            {"deep": law}, self.indenter, self.contact, settings.formulation
        )
        for term in mechanisms:
            model = model.with_term(term)
        start, direction = np.array([0.0, self.centre]), np.array([0.0, -1.0])
        system = System(spaces, model, start, direction, settings.quadrature_degree)
        solver = NewtonSolver(system, settings.newton, settings.linear)
        return Pressing(system, solver, self.contact, self.length, 1.0, settings.steps)


class BallIndentation:
    """The ball's test; solves for any parameters without meshing again.

    Parameters
    ----------
    test
        Sizes and faces.
    law
        Of the layer, whose parameters are named ``deep.C10`` and so on.
    settings
        Numerical; by default elements of an eighth of the ball's radius under it.
    comm
        Over which one solution is spread.
    mechanisms
        Terms added to those of tissue and contact, each in place of one of its name if there is.
    """

    def __init__(
        self,
        test: BallOnLayer,
        law: Hyperelastic,
        settings: AxisymmetricSettings | None = None,
        comm: MPI.Intracomm = MPI.COMM_SELF,
        mechanisms: Sequence[Term] = (),
    ) -> None:
        self.test, self.law, self.settings = test, law, settings or AxisymmetricSettings()
        size = self.settings.mesh or MeridianMeshSettings(test.ball_radius / 8)
        fine = (0.0, 1.4 * test.ball_radius)
        self._pressing = _Test(
            mesh_meridian(test.layer_radius, test.thickness, fine, size, comm=comm),
            supports(test.base),
            RigidBall(test.ball_radius),
            test.thickness + test.ball_radius,
            self.settings.contact or ContactSettings(tangential=test.ball, stiffness=4000.0),
            test.ball_radius,
        ).pressing(law, self.settings, mechanisms)
        self.system, self.solver = self._pressing.system, self._pressing.solver

    def follow(
        self,
        protocol: Protocol,
        parameters: Mapping[str, float] | None = None,
        sensitivities: Sequence[str] = (),
        on_step: OnStep | None = None,
    ) -> Indentation:
        """Move the ball along a protocol.

        The arguments and the outcome are those of `PlaneStrainIndentation.follow`; where the
        solution stops short, once more with a softer contact.
        """
        asked = parameters, protocol, sensitivities, on_step
        attempts = [self._pressing.run(*asked)]
        if not attempts[-1].report.complete:
            attempts.append(self._pressing.run(*asked, softness=SOFTER))
        return farthest(attempts)


class CylinderCompression:
    """The cylinder's test; solves for any parameters without meshing again.

    The upper half is meshed, so that its plate moves by half of the compression.

    Parameters
    ----------
    test
        Sizes and ends.
    law, settings, comm, mechanisms
        As those of `BallIndentation`; the default mesh is fine at the end face's edge.
    """

    def __init__(
        self,
        test: CylinderBetweenPlates,
        law: Hyperelastic,
        settings: AxisymmetricSettings | None = None,
        comm: MPI.Intracomm = MPI.COMM_SELF,
        mechanisms: Sequence[Term] = (),
    ) -> None:
        self.test, self.law, self.settings = test, law, settings or AxisymmetricSettings()
        half = test.height / 2
        size = self.settings.mesh or MeridianMeshSettings(half / 15, growth=0.2, far_size=half / 6)
        # Flat on flat the pressure has no edge to resolve: the penalty may be as stiff as a wall.
        wall = ContactSettings(
            tangential="rough" if test.ends == "bonded" else "frictionless",
            stiffness=1e6,
            onset=1e-6 * half,
        )
        self._pressing = _Test(
            mesh_meridian(test.radius, half, (test.radius, test.radius), size, "skin", comm),
            supports("sliding"),
            RigidPlate(),
            half,
            self.settings.contact or wall,
            half,
        ).pressing(law, self.settings, mechanisms)
        self.system, self.solver = self._pressing.system, self._pressing.solver

    def follow(
        self,
        protocol: Protocol,
        parameters: Mapping[str, float] | None = None,
        sensitivities: Sequence[str] = (),
        on_step: OnStep | None = None,
    ) -> Indentation:
        """Compress the cylinder along a protocol; displacements are those of the whole."""
        half = Protocol(protocol.time, tuple(d / 2 for d in protocol.displacement))

        def told(at: float) -> None:
            if on_step is not None:
                on_step(2 * at)

        return _doubled(self._pressing.run(parameters, half, sensitivities, told))


def _doubled(solved: Indentation) -> Indentation:
    """Return the outcome with the displacement of both halves."""
    path, curve, report = solved.path, solved.curve, solved.report
    return Indentation(
        solved.parameters,
        ForceCurve(2 * curve.displacement, curve.force, curve.sensitivities),
        Path(path.time, 2 * path.displacement, path.force, path.sensitivities),
        replace(report, reached=2 * report.reached, target=2 * report.target),
    )
