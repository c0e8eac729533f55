r"""A specimen in which the strain is the same everywhere: no mesh, the stress of any law in closed form.

A body says its deformation gradient :math:`F` at a displacement of what moves it, up to stretches along axes that
nothing holds. With the energy's derivatives :math:`w = \partial U / \partial \bar I_1` and
:math:`p = \partial U / \partial J`, the law's own, :math:`b = F F^T` and :math:`J = \det F`, the Kirchhoff stress is

.. math:: \tau = 2 w J^{-2/3} \Bigl(b - \frac{\mathrm{tr}\, b}{3} I\Bigr) + p J I + \tau^f,

the free stretches are those at which :math:`\tau` vanishes along their axes, and the nominal stress is
:math:`P = \tau F^{-T}` (R. W. Ogden, Non-linear Elastic Deformations (1984), section 4.3). Fibres
(`legfem.mechanics.terms.Fibres`) along a principal direction f don't shear, since :math:`I_5 = I_4^2` there, and add

.. math:: \tau^f_f = \tfrac12 (E_L - 3 \mu_T) (\lambda_f^2 - 1) \lambda_f^2.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from legfem.channels.kinds.face_strain import homogeneous
from legfem.channels.kinds.lateral_stretch import LATERAL_STRETCH
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.experiments.bodies import HomogeneousBody
from legfem.experiments.experiment import ProtocolTest, Solved, sample_protocol
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.terms import Fibres, Tissue
from legfem.solve.path import FORCE, Path, SolveReport
from legfem.solve.protocol import Protocol

# Of every stretch of a protocol.
_POINTS = 80
# Of the length: nothing can be pressed to nothing.
_SHORTEST = 0.05
_NEWTON_STEPS = 40
_IMAGINARY = 1e-30
# Of the stretches' logarithms.
_MOVE, _SMALL, _FARTHEST = 1e-7, 1e-15, 0.3


@dataclass(frozen=True, eq=False)
class ClosedFormTest[Body](ProtocolTest):
    """A body's test that no mesh is needed for, an `legfem.experiments.experiment.Experiment`.

    Parameters
    ----------
    test
        Sizes.
    law
        Law of the tissue, whose parameters are named ``deep.C10`` and so on.
    """

    test: Body
    law: Hyperelastic

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the law by full name."""
        return {f"deep.{name}": value for name, value in self.law.parameters.items()}

    def with_terms(self, terms: Sequence[object]) -> Self:
        """Return the test with the law among a model's terms; the others need a mesh."""
        return replace(self, law=next((term.law for term in reversed(terms) if isinstance(term, Tissue)), self.law))

    def farthest(self, target: float) -> float:
        """Return how far (mm) of a displacement the body can go."""
        return target

    def law_at(self, parameters: Mapping[str, Any]) -> Hyperelastic:
        """Return the law with its numbers among some by full name."""
        return replace(self.law, **{name: parameters[f"deep.{name}"] for name in self.law.parameters})

    @abstractmethod
    def read(self, parameters: Mapping[str, Any], at: FloatArray) -> dict[str, Any]:
        """Return `FORCE` (n,), N, at displacements (n,), mm, and channels beside it; complex where a parameter is."""

    def _follow(self, values: Mapping[str, float] | None, protocol: Protocol, sensitivities: Sequence[str]) -> Solved:
        """Move the body along a protocol.

        Derivatives are exact, by a complex step (J. N. Lyness, C. B. Moler, SIAM J. Numer. Anal. 4
        (1967) 202-210).
        """
        parameters = {**self.parameters, **(values or {})}
        target = protocol.depth
        farthest = self.farthest(target)
        time, at = sample_protocol(protocol, _POINTS, farthest)
        values, by = self.read(parameters, at), dict[str, dict[str, FloatArray]]()
        for name in sensitivities:
            moved = self.read({**parameters, name: parameters[name] + 1j * _IMAGINARY}, at)
            for what, rates in moved.items():
                by.setdefault(what, {})[name] = rates.imag / _IMAGINARY
        read = {what: value.real for what, value in values.items()}
        path = Path(time, at, read.pop(FORCE), by.pop(FORCE, {}), read, by)
        complete = farthest >= target
        reason = "" if complete else "the specimen is pressed to nothing"
        report = SolveReport(float(at.max()), target, complete, reason)
        return Solved(parameters, path.loading, path, report)


@dataclass(frozen=True, eq=False)
class HomogeneousTest(ClosedFormTest[HomogeneousBody]):
    """The test of a body that is strained alike everywhere.

    Parameters
    ----------
    fibres
        Fibres of the tissue along an axis: the second is the load's, the others are across.
    """

    fibres: Fibres | None = None

    def __post_init__(self) -> None:
        """Check that fibres aren't sheared."""
        if self.fibres is not None and sorted(map(abs, self.fibres.axis)) != [0.0, 0.0, 1.0]:
            raise InputError("bar", "fibres", "are oblique: the bar would shear", "turn them along or across")

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the law and the fibres by full name."""
        return super().parameters | ({} if self.fibres is None else self.fibres.parameters)

    def with_terms(self, terms: Sequence[object]) -> Self:
        """Return the test with the law and fibres among a model's terms; the others need a mesh."""
        fibres = next((term for term in reversed(terms) if isinstance(term, Fibres)), self.fibres)
        return replace(super().with_terms(terms), fibres=fibres)

    def farthest(self, target: float) -> float:
        """Return how far it goes: nothing is pressed to nothing."""
        return target if self.test.sign > 0 else min(target, (1 - _SHORTEST) * self.test.length)

    def read(self, parameters: Mapping[str, Any], at: FloatArray) -> dict[str, Any]:
        """Return the force, and how a bar's sides are strained."""
        law = self.law_at(parameters)
        body, sign = self.test, self.test.sign
        strain = sign * at / body.length + 0j
        axes = list(body.free)

        def stresses(free: Any) -> tuple[Any, Any]:
            gradient = body.gradient(strain, np.exp(free))
            return gradient, self._kirchhoff(law, parameters, gradient)

        free = np.tile(np.log(body.free_stretch(strain)), (len(axes), 1))
        for _ in range(_NEWTON_STEPS if axes else 0):
            value = stresses(free)[1][:, axes, axes]
            columns = []
            for k in range(len(axes)):
                move = _MOVE * np.eye(len(axes))[k][:, None]
                rise = (stresses(free + move)[1] - stresses(free - move)[1])[:, axes, axes]
                columns.append(rise.real / (2 * _MOVE))
            change = -np.linalg.solve(np.stack(columns, axis=-1), value[..., None])[..., 0].T
            longest = np.abs(change).max(axis=0)
            free = free + change * np.minimum(1.0, _FARTHEST / np.maximum(longest, _SMALL))
            if longest.max() < _SMALL:
                break
        gradient, kirchhoff = stresses(free)
        nominal = np.linalg.solve(gradient, np.swapaxes(kirchhoff, 1, 2))
        row, column = body.component
        found = {FORCE: sign * body.area * nominal[:, column, row]}
        # Fibres across make a bar's sides unlike.
        symmetric = len(axes) == 2 and self.fibres is None
        if not symmetric:
            return found
        across = np.exp(free[0])
        return {**found, LATERAL_STRETCH.name: across, **homogeneous(across - 1, strain)}

    def _kirchhoff(self, law: Hyperelastic, parameters: Mapping[str, Any], gradient: Any) -> Any:
        """Return the Kirchhoff stress (n, 3, 3), MPa, at deformation gradients (n, 3, 3)."""
        unit = np.eye(3)
        square, volume = gradient @ np.swapaxes(gradient, 1, 2), np.linalg.det(gradient)
        total, shrunk = np.trace(square, axis1=1, axis2=2), volume ** (-2 / 3)
        deviator = shrunk[:, None, None] * (square - total[:, None, None] * unit / 3)
        slope = 2 * law.distortion_slope(shrunk * total - 3)
        found = slope[:, None, None] * deviator + (law.volumetric_slope(volume) * volume)[:, None, None] * unit
        if self.fibres is not None:
            # The load's own axis is the second of a section's.
            k = (1, 0, 2)[int(np.argmax(np.abs(self.fibres.axis)))]
            stretch = square[:, k, k]
            found[:, k, k] += parameters["deep.fibres.extension"] / 2 * (stretch - 1) * stretch
        return found
