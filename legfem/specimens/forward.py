"""All tests of a folder that are fitted together, as one forward model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from legfem.experiments.axisymmetric import (
    AxisymmetricSettings,
    BallIndentation,
    BallOnLayer,
    CylinderBetweenPlates,
    CylinderCompression,
)
from legfem.experiments.base import Homebound, Solved, made_when_needed
from legfem.experiments.flat_punch import FlatPunchIndentation, PunchOnLayer
from legfem.experiments.lateral_cylinder import LateralCylinder
from legfem.experiments.uniaxial import Bar, UniaxialTest
from legfem.identify.catalogue import Values
from legfem.identify.forward import ForwardOutcome
from legfem.mechanics.contact_settings import ContactSettings
from legfem.mechanics.materials import Hyperelastic
from legfem.meshing.meridian import MeridianMeshSettings
from legfem.solve.force_curve import ForceCurve
from legfem.solve.step_settings import StepSettings
from legfem.specimens.schema import Faces
from legfem.specimens.sizes import Sizes, Test

_STEPS, _ELEMENTS = 20, 5
"""Of a shallow test: steps to its depth, and elements across half of its contact."""


def experiment_of(sizes: Sizes, law: Hyperelastic, depth: float) -> Test:
    """Return the experiment with a test's sizes, its mesh and steps fit for a depth (mm)."""
    usual = AxisymmetricSettings()
    steps = StepSettings(
        first=min(usual.steps.first, depth / _STEPS), largest=min(usual.steps.largest, depth / 10)
    )
    # A shallow test's forces are of millinewtons, which the volume of large elements rounds.
    newton = replace(usual.newton, absolute_tolerance=1e-10)
    plain = replace(usual, steps=steps, newton=newton)
    match sizes:
        case Bar():
            return UniaxialTest(sizes, law)
        case BallOnLayer():
            radius = sizes.ball_radius
            fine = _shallow(plain, radius, depth, sizes.ball, radius / 8)
            return BallIndentation(sizes, law, fine)
        case PunchOnLayer():
            contact = _onset(sizes.punch, depth)
            return FlatPunchIndentation(sizes, law, replace(plain, contact=contact))
        case CylinderBetweenPlates():
            return CylinderCompression(sizes, law, plain)
        case _:
            radius = sizes.cylinder_radius
            fine = _shallow(plain, radius, depth, sizes.cylinder, radius / 16)
            return LateralCylinder(sizes, law, fine)


def _shallow(
    plain: AxisymmetricSettings, radius: float, depth: float, faces: Faces, usual_size: float
) -> AxisymmetricSettings:
    """Return settings for a round indenter: elements resolve the contact, its onset the depth."""
    size = min(usual_size, (radius * depth) ** 0.5 / _ELEMENTS)
    return replace(plain, mesh=MeridianMeshSettings(size), contact=_onset(faces, depth))


def _onset(faces: Faces, depth: float) -> ContactSettings:
    usual = ContactSettings(tangential=faces, stiffness=4000.0)
    return replace(usual, onset=min(usual.onset, 2e-3 * depth))


@dataclass(frozen=True, eq=False)
class SpecimenForward(Homebound):
    """Tests of one tissue, a `legfem.identify.forward.ForwardModel`.

    Parameters
    ----------
    tests : tuple
        Sizes, all different.
    depths : tuple of float
        How deep each is pressed, mm.
    law : Hyperelastic
        Of the tissue.
    """

    tests: tuple[Sizes, ...]
    depths: tuple[float, ...]
    law: Hyperelastic

    @made_when_needed
    def experiments(self) -> list[Test]:
        """Meshed when first solved, in whichever process."""
        return [
            experiment_of(sizes, self.law, depth)
            for sizes, depth in zip(self.tests, self.depths, strict=True)
        ]

    @property
    def nominal(self) -> Values:
        """The law's numbers by full name (MPa, 1/MPa)."""
        return {f"deep.{name}": value for name, value in self.law.parameters.items()}

    def solve(self, values: Values, sensitivities: Sequence[str]) -> ForwardOutcome:
        """Solve every test in full; one that breaks down is an outcome that stops at once."""
        every = [self.solve_one(k, values, sensitivities) for k in range(len(self.tests))]
        return ForwardOutcome.joined(values, every)

    def solve_one(
        self, number: int, values: Values, sensitivities: Sequence[str] = ()
    ) -> ForwardOutcome:
        """Solve one of the tests."""
        try:
            solved: Solved = self.experiments[number].solve(
                values, self.depths[number], sensitivities
            )
        except (ArithmeticError, ValueError, RuntimeError, np.linalg.LinAlgError) as error:
            nothing = ForceCurve(
                np.zeros(1), np.zeros(1), dict.fromkeys(sensitivities, np.zeros(1))
            )
            reason = " ".join(str(error).split()) or type(error).__name__
            return ForwardOutcome(values, (nothing,), False, reason, 0, 0.0)
        report = solved.report
        seconds = report.seconds + sum(before.seconds for before in report.earlier_attempts)
        return ForwardOutcome(
            values, (solved.curve,), bool(report.complete), report.reason, report.factorisations,
            float(seconds),
        )  # fmt: skip

    def fingerprint(self) -> Mapping[str, Any]:
        """Return tests, depths, law and code."""
        return {"model": "specimens", **super().fingerprint()}
