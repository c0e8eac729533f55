r"""A bar or cylinder in homogeneous uniaxial tension or compression: no mesh, a closed form.

With the stretches :math:`\lambda` along the bar and :math:`\lambda_t` across, J =
:math:`\lambda \lambda_t^2` and the energy's derivatives :math:`w = \partial U / \partial \bar I_1`
and :math:`p = \partial U / \partial J`, the nominal stress is

.. math:: P = w \frac{\partial \bar I_1}{\partial \lambda} + p \lambda_t^2, \quad
          0 = w \frac{\partial \bar I_1}{\partial \lambda_t} + 2 p \lambda \lambda_t

(R. W. Ogden, Non-linear Elastic Deformations (1984), section 7.3).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from legfem.common.checks import check_positive
from legfem.common.units import FloatArray
from legfem.experiments.base import Solved
from legfem.experiments.driven import DrivenTest, sampled
from legfem.mechanics.materials import Hyperelastic
from legfem.solve.path import Path
from legfem.solve.protocol import Protocol
from legfem.solve.report import SolveReport

_POINTS = 80
# Of every stretch of a protocol.
# Of the length: a bar can't be pressed to nothing.
_SHORTEST = 0.05
_NEWTON_STEPS = 40
_IMAGINARY = 1e-30


@dataclass(frozen=True)
class Bar:
    """A straight specimen whose ends don't keep it from growing or shrinking sideways.

    Parameters
    ----------
    length : float
        Between the grips or plates, undeformed (mm).
    area : float
        Of its undeformed cross-section (mm2).
    pulled : {"tension", "compression"}
        Displacement and force are positive that way.
    """

    length: float
    area: float
    pulled: Literal["tension", "compression"] = "compression"

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_positive(self, "length", "area")


@dataclass(frozen=True, eq=False)
class UniaxialTest(DrivenTest):
    """The bar's test, an `legfem.experiments.base.Experiment`.

    Parameters
    ----------
    test
        Sizes.
    law
        Of the tissue, whose parameters are named ``deep.C10`` and so on.
    """

    test: Bar
    law: Hyperelastic

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the law by full name."""
        return {f"deep.{name}": value for name, value in self.law.parameters.items()}

    def _driven(
        self, values: Mapping[str, float] | None, protocol: Protocol, sensitivities: Sequence[str]
    ) -> Solved:
        """Move the ends along a protocol.

        Derivatives are exact, by a complex step (J. N. Lyness, C. B. Moler, SIAM J. Numer. Anal. 4
        (1967) 202-210).
        """
        parameters = {**self.parameters, **(values or {})}
        target = protocol.depth
        sign = 1.0 if self.test.pulled == "tension" else -1.0
        farthest = target if sign > 0 else min(target, (1 - _SHORTEST) * self.test.length)
        time, at = sampled(protocol, _POINTS, farthest)
        force = self._force(parameters, at, sign)
        by = {}
        for name in sensitivities:
            moved = {**parameters, name: parameters[name] + 1j * _IMAGINARY}
            by[name] = self._force(moved, at, sign).imag / _IMAGINARY
        path = Path(time, at, force.real, by)
        complete = farthest >= target
        reason = "" if complete else "the bar is pressed to nothing"
        report = SolveReport(float(at.max()), target, complete, reason)
        return Solved(parameters, path.loading, path, report)

    def _force(self, parameters: Mapping[str, Any], at: FloatArray, sign: float) -> Any:
        """Return the force (n,), N, with complex numbers where a parameter is complex."""
        own = {name.removeprefix("deep."): value for name, value in parameters.items()}
        law = replace(self.law, **{name: own[name] for name in self.law.parameters})
        along = 1 + sign * at / self.test.length
        across = along**-0.5 + 0j
        for _ in range(_NEWTON_STEPS):
            value = _across(law, along, across)
            step = 1e-7
            slope = (_across(law, along, across + step) - _across(law, along, across - step)).real
            change = value * (2 * step / slope)
            across = across - change
            if np.abs(change).max() < 1e-15:
                break
        volume = along * across**2
        first = volume ** (-2 / 3) * (along**2 + 2 * across**2)
        by_along = 2 * along * volume ** (-2 / 3) - 2 / 3 * first / along
        stress = law.distortion_slope(first - 3) * by_along
        stress = stress + law.volumetric_slope(volume) * across**2
        return sign * self.test.area * stress


def _across(law: Hyperelastic, along: Any, across: Any) -> Any:
    """Return the energy's derivative by the stretch across (MPa)."""
    volume = along * across**2
    first = volume ** (-2 / 3) * (along**2 + 2 * across**2)
    by_across = 4 * across * volume ** (-2 / 3) - 4 / 3 * first / across
    return law.distortion_slope(first - 3) * by_across + law.volumetric_slope(volume) * (
        2 * along * across
    )
