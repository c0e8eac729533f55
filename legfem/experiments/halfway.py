"""A test whose faces hold the tissue in part: its force is halfway between that of two tests that bound it.

Plates that rub let a specimen's ends slide by less than free ones, and by more than bonded ones. With Coulomb's
friction the force of a cylinder 1.7 times as wide as high lies between: at 10 % of strain, of the way from free to
bonded ends, 0.17 for a coefficient of 0.1, 0.38 for 0.2, 0.61 for 0.3 and 0.93 for 0.5. Solutions with friction stop at
a third of the height.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

from legfem.experiments.axisymmetric import AxisymmetricTest
from legfem.experiments.experiment import Solved
from legfem.solve.path import ForceCurve
from legfem.solve.protocol import Protocol


@dataclass(frozen=True, eq=False)
class HalfwayTest:
    """Two tests of one body; parameters are those of both.

    Parameters
    ----------
    one, other
        That bound it.
    """

    one: AxisymmetricTest[Any]
    other: AxisymmetricTest[Any]

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the model by full name."""
        return self.one.parameters

    def with_terms(self, terms: Sequence[Any]) -> Self:
        """Return the test with more terms."""
        return replace(self, one=self.one.with_terms(terms), other=self.other.with_terms(terms))

    def solve(
        self,
        values: Mapping[str, float] | None = None,
        protocol: Protocol | float | None = None,
        sensitivities: Sequence[str] = (),
    ) -> Solved:
        """Solve both; the outcome is complete as far as both are, along the steps of the one that came less far."""
        least, most = sorted(
            (test.solve(values, protocol, sensitivities) for test in (self.one, self.other)),
            key=lambda solved: solved.report.reached,
        )
        at = least.curve.displacement
        if len(at) < 2:
            return least
        by = {
            name: 0.5 * (least.curve.sensitivities[name] + most.curve.sensitivity(name, at)) for name in sensitivities
        }
        beside = {name: 0.5 * (values + most.curve.channel(name, at)) for name, values in least.curve.channels.items()}
        return replace(least, curve=ForceCurve(at, 0.5 * (least.curve.force + most.curve(at)), by, beside))
