"""All tests of a folder that are fitted together, as one forward model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from legfem.experiments.axisymmetric import (
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
from legfem.mechanics.materials import Hyperelastic
from legfem.solve.force_curve import ForceCurve
from legfem.specimens.schema import Sizes, Test


def experiment_of(sizes: Sizes, law: Hyperelastic) -> Test:
    """Return the experiment with a test's sizes."""
    match sizes:
        case Bar():
            return UniaxialTest(sizes, law)
        case BallOnLayer():
            return BallIndentation(sizes, law)
        case PunchOnLayer():
            return FlatPunchIndentation(sizes, law)
        case CylinderBetweenPlates():
            return CylinderCompression(sizes, law)
        case _:
            return LateralCylinder(sizes, law)


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
        return [experiment_of(sizes, self.law) for sizes in self.tests]

    @property
    def nominal(self) -> Values:
        """The law's numbers by full name (MPa, 1/MPa)."""
        return {f"deep.{name}": value for name, value in self.law.parameters.items()}

    def solve(self, values: Values, sensitivities: Sequence[str]) -> ForwardOutcome:
        """Solve every test in full; one that breaks down is an outcome that stops at once."""
        every = [self.solve_one(k, values, sensitivities) for k in range(len(self.tests))]
        return ForwardOutcome(
            values,
            tuple(one.curves[0] for one in every),
            all(one.complete for one in every),
            "; ".join(one.reason for one in every if not one.complete),
            sum(one.factorisations for one in every),
            sum(one.seconds for one in every),
        )

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
