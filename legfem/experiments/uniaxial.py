r"""A bar or cylinder in homogeneous uniaxial tension or compression: no mesh, a closed form.

With the principal stretches :math:`\lambda_1` along the bar and :math:`\lambda_2, \lambda_3`
across, J = :math:`\lambda_1 \lambda_2 \lambda_3` and the energy's derivatives
:math:`w = \partial U / \partial \bar I_1` and :math:`p = \partial U / \partial J`, the Kirchhoff
stresses are

.. math:: \tau_i = w \frac{\partial \bar I_1}{\partial \ln \lambda_i} + p J + \tau^f_i, \quad
          \frac{\partial \bar I_1}{\partial \ln \lambda_i}
          = 2 J^{-2/3} \Bigl(\lambda_i^2 - \frac13 \sum_k \lambda_k^2\Bigr),

and :math:`\tau_2 = \tau_3 = 0`; the nominal stress is :math:`P = \tau_1 / \lambda_1` (R. W. Ogden,
Non-linear Elastic Deformations (1984), section 7.3). Fibres (`legfem.mechanics.terms.Fibres`) along
the principal direction f don't shear, since :math:`I_5 = I_4^2` there, and add

.. math:: \tau^f_f = \tfrac12 (E_L - 3 \mu_T) (\lambda_f^2 - 1) \lambda_f^2.

An incompressible neo-Hookean bar, pulled along its fibres, has

.. math:: P = \mu_T (\lambda - \lambda^{-2}) + \tfrac12 (E_L - 3 \mu_T) (\lambda^2 - 1) \lambda,

and across them, at small strain, Young's modulus :math:`4 \mu_T E_L / (E_L + \mu_T)`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from legfem.common.errors import InputError, check_positive
from legfem.common.units import FloatArray
from legfem.experiments.experiment import ProtocolTest, Solved, sample_protocol
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.terms import Fibres
from legfem.solve.path import Path
from legfem.solve.protocol import Protocol
from legfem.solve.report import SolveReport

# Of every stretch of a protocol.
_POINTS = 80
# Of the length: a bar can't be pressed to nothing.
_SHORTEST = 0.05
_NEWTON_STEPS = 40
_IMAGINARY = 1e-30
# Of the stretches' logarithms.
_MOVE, _SMALL, _FARTHEST = 1e-7, 1e-15, 0.3


@dataclass(frozen=True)
class UniaxialSpecimen:
    """A straight specimen whose ends don't keep it from growing or shrinking sideways.

    Parameters
    ----------
    length : float
        Between the grips or plates, undeformed (mm).
    area : float
        Area of its undeformed cross-section, mm2.
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
class UniaxialTest(ProtocolTest):
    """The bar's test, an `legfem.experiments.experiment.Experiment`.

    Parameters
    ----------
    test
        Sizes.
    law
        Law of the tissue, whose parameters are named ``deep.C10`` and so on.
    fibres
        Fibres of the tissue along an axis: the second is the bar's, the others are across.
    """

    test: UniaxialSpecimen
    law: Hyperelastic
    fibres: Fibres | None = None

    def __post_init__(self) -> None:
        """Check that the bar isn't sheared."""
        if self.fibres is not None and sorted(map(abs, self.fibres.axis)) != [0.0, 0.0, 1.0]:
            raise InputError("bar", "fibres", "are oblique: the bar would shear", "turn them along or across")

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the law and the fibres by full name."""
        own = {f"deep.{name}": value for name, value in self.law.parameters.items()}
        return own | ({} if self.fibres is None else self.fibres.parameters)

    def _follow(self, values: Mapping[str, float] | None, protocol: Protocol, sensitivities: Sequence[str]) -> Solved:
        """Move the ends along a protocol.

        Derivatives are exact, by a complex step (J. N. Lyness, C. B. Moler, SIAM J. Numer. Anal. 4
        (1967) 202-210).
        """
        parameters = {**self.parameters, **(values or {})}
        target = protocol.depth
        sign = 1.0 if self.test.pulled == "tension" else -1.0
        farthest = target if sign > 0 else min(target, (1 - _SHORTEST) * self.test.length)
        time, at = sample_protocol(protocol, _POINTS, farthest)
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
        first = np.log(along) + 0j

        def stresses(across: Any) -> Any:
            return self._stresses(law, own, np.stack([first, *across]))

        across = np.stack([-0.5 * first, -0.5 * first])
        for _ in range(_NEWTON_STEPS):
            value = stresses(across)[1:]
            columns = []
            for k in range(2):
                move = _MOVE * np.eye(2)[k][:, None]
                rise = stresses(across + move)[1:] - stresses(across - move)[1:]
                columns.append(rise.real / (2 * _MOVE))
            slope = np.moveaxis(np.array(columns), (0, 1, 2), (2, 1, 0))
            change = -np.linalg.solve(slope, value.T[..., None])[..., 0].T
            longest = np.abs(change).max(axis=0)
            across = across + change * np.minimum(1.0, _FARTHEST / np.maximum(longest, _SMALL))
            if longest.max() < _SMALL:
                break
        return sign * self.test.area * stresses(across)[0] / along

    def _stresses(self, law: Hyperelastic, own: Mapping[str, Any], logs: Any) -> Any:
        """Return the Kirchhoff stresses (3, n), MPa, of the stretches' logarithms (3, n)."""
        square, volume = np.exp(2 * logs), np.exp(logs.sum(axis=0))
        total, shrunk = square.sum(axis=0), volume ** (-2 / 3)
        by_logs = 2 * shrunk * (square - total / 3)
        found = law.distortion_slope(shrunk * total - 3) * by_logs
        found = found + law.volumetric_slope(volume) * volume
        if self.fibres is not None:
            # The bar's own axis is the second of a section's.
            index = (1, 0, 2)[int(np.argmax(np.abs(self.fibres.axis)))]
            stretch = square[index]
            found[index] = found[index] + own["fibres.extension"] / 2 * (stretch - 1) * stretch
        return found
