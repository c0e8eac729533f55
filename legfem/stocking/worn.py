r"""A leg in equilibrium with its stocking: pressure and shape make each other.

The pressure is that of the compressed shape. It answers to the shape so strongly that it can't be
taken from a scan: a bump of 0.3 mm over a few millimetres changes the curvature by as much as the
stocking does, and the leg would give way to it by :math:`K > 1` times its height. In equilibrium
with the simulated shape it gives way by :math:`K/(1 + K)` only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from legfem.common.units import FloatArray
from legfem.experiments.compression import Compressed
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.solve.fixed_point import AndersonMixing
from legfem.stocking.kept_equilibria import AskedEquilibrium, KeptEquilibria, KeptEquilibrium
from legfem.stocking.laplace import Stocking, StockingLoad, stocking_load
from legfem.stocking.leg_model import LegModel3D

SLOPE_STEP = 1e-2
"""Greatest displacement (mm) of a difference of pressures or distances."""
RATE_TOLERANCE, FEEDBACK_TOLERANCE = 1e-3, 3e-2
"""Of the linear solutions of a pressure's changes, and of the stocking's answer to them."""
MAX_DIRECTIONS = 40


@dataclass(frozen=True)
class FixedPointSettings:
    """Of the pressure that depends on the shape that it makes.

    Parameters
    ----------
    tolerance : float
        Change of the pressure from one state to the next, over its greatest value.
    max_states : int
        Compressed states to solve for.
    """

    tolerance: float = 2e-3
    max_states: int = 12


@dataclass(frozen=True, eq=False)
class Worn:
    """A leg in a stocking, in equilibrium with it."""

    state: Compressed
    pressure: FloatArray
    """On the skin's points (MPa), with which the state was found."""
    shape: LegShape
    """Compressed."""
    load: StockingLoad
    """Of that shape, at the reference shape's levels and points."""
    changes: tuple[float, ...]
    """Of the pressure between states, relative."""
    converged: bool


class WornLeg:
    """Puts a stocking on a leg.

    Parameters
    ----------
    model
        The leg.
    stocking
        What it wears.
    settings
        Of the equilibrium.
    folder
        Where equilibria are kept for a later run; they aren't without it.

    Attributes
    ----------
    states : int
        Compressed states solved for, now or, where they were kept, before.
    """

    def __init__(
        self,
        model: LegModel3D,
        stocking: Stocking,
        settings: FixedPointSettings | None = None,
        folder: Path | None = None,
    ) -> None:
        self.model, self.stocking = model, stocking
        self._settings = settings or FixedPointSettings()
        self.states = 0
        depends_on = (stocking, self._settings)
        self._kept = None if folder is None else KeptEquilibria(folder, model, depends_on)

    def find(
        self,
        parameters: Mapping[str, float] | None = None,
        sensitivities: Sequence[str] = (),
        start: Worn | None = None,
        error: FloatArray | float = 0.0,
    ) -> Worn:
        """Find the state in which the pressure is that of the shape it makes.

        Parameters
        ----------
        parameters
            Of the model, by full name, other than those of the tissues given (MPa, 1/MPa).
        sensitivities
            Full names of parameters by which to differentiate the state at its pressure; see
            `Feedback` for the derivatives in equilibrium.
        start
            A state near the one sought.
        error
            By which the pressure exceeds Laplace's law, relative, at the skin's points.
        """
        asked = AskedEquilibrium(dict(parameters or {}), tuple(sensitivities), error)
        kept = None if self._kept is None else self._kept.get(asked)
        if kept is not None:
            self.states += len(kept.changes)
            return self.back_in(self._restored(kept), parameters)
        worn = self._found(asked, start)
        if self._kept is not None and worn.state.report.complete:
            found = KeptEquilibrium(worn.state, worn.pressure, worn.changes, worn.converged)
            self._kept.put(asked, found)
        return worn

    def back_in(self, worn: Worn, parameters: Mapping[str, float] | None) -> Worn:
        """Bring the model back into an equilibrium found before, and return it."""
        self.model.put_in(worn.state, worn.pressure, parameters)
        return worn

    def _restored(self, kept: KeptEquilibrium) -> Worn:
        shape = self.model.deformed_shape(kept.state.unknown)
        return Worn(
            kept.state, kept.pressure, shape, self.load(shape), kept.changes, kept.converged
        )

    def _found(self, asked: AskedEquilibrium, start: Worn | None) -> Worn:
        parameters, sensitivities, error = asked.parameters, asked.sensitivities, asked.error
        load = self.load(self.model.shape) if start is None else start.load
        pressure, state = load.pressure * (1 + error), None if start is None else start.state
        shape, mixing = self.model.shape, AndersonMixing()
        changes: list[float] = []
        converged = False
        last = self._settings.max_states
        while True:
            names = sensitivities if converged or len(changes) + 1 == last else ()
            state = self.model.solve(parameters, pressure, names, state)
            self.states += 1
            if not state.report.complete:
                return Worn(state, pressure, shape, load, tuple(changes), False)
            shape = self.model.deformed_shape(state.unknown)
            load = self.load(shape)
            aimed = load.pressure * (1 + error)
            changes.append(float(np.abs(aimed - pressure).max() / aimed.max()))
            ended = converged or len(changes) == last
            converged = converged or changes[-1] < self._settings.tolerance
            # One state more, nearer still, bears the derivatives.
            if ended or (converged and not sensitivities):
                return Worn(state, pressure, shape, load, tuple(changes), converged)
            pressure = np.maximum(mixing.next(pressure, aimed), 0.0)

    def load(self, shape: LegShape) -> StockingLoad:
        """Return the load of the stocking on a shape of the leg."""
        return stocking_load(shape, self.stocking)


class Feedback:
    r"""Derivatives of an equilibrium, of those at its pressure.

    A change moves the unknown by :math:`x_0` at a given pressure; the shape's change alters the
    pressure, by :math:`\delta p = L'(x_0 + S\,\delta p)`, where :math:`S` is the leg's answer to a
    pressure and :math:`L'` the derivative of Laplace's law. The directions in which
    :math:`\delta p - L' S\,\delta p` was taken serve all further changes (GCR with recycling: M. L.
    Parks et al., SIAM J. Sci. Comput. 28 (2006) 1651-1674).

    Parameters
    ----------
    leg
        The leg.
    worn
        The equilibrium that was found last.
    """

    def __init__(self, leg: WornLeg, worn: Worn) -> None:
        self._leg, self._worn = leg, worn
        self._images: list[FloatArray] = []
        self._answers: list[FloatArray] = []

    def to_rate(self, rate: FloatArray) -> FloatArray:
        """Return the unknown's derivative in equilibrium, of that at a fixed pressure."""
        left = self.pressure_slope(rate)
        enough = FEEDBACK_TOLERANCE * np.linalg.norm(left)
        total = rate.copy()
        for image, answer in zip(self._images, self._answers, strict=True):
            share = np.vdot(image, left)
            left, total = left - share * image, total + share * answer
        while np.linalg.norm(left) > enough and len(self._images) < MAX_DIRECTIONS:
            self._extend(left)
            share = np.vdot(self._images[-1], left)
            left = left - share * self._images[-1]
            total = total + share * self._answers[-1]
        return total

    def _extend(self, direction: FloatArray) -> None:
        """Add a change of pressure, and keep what remains of it without the answer's own."""
        model, state = self._leg.model, self._worn.state
        (answer,) = model.pressure_rates(state, [direction], RATE_TOLERANCE)
        image = direction - self.pressure_slope(answer)
        for known, known_answer in zip(self._images, self._answers, strict=True):
            share = np.vdot(known, image)
            image, answer = image - share * known, answer - share * known_answer
        size = float(np.linalg.norm(image))
        self._images.append(image / size)
        self._answers.append(answer / size)

    def pressure_slope(self, rate: FloatArray) -> FloatArray:
        """Return the change of the stocking's pressure along a derivative of the unknown."""
        model, worn = self._leg.model, self._worn
        step = slope_step(model, rate)
        shape = model.deformed_shape(worn.state.unknown + step * rate)
        ahead = self._leg.load(shape).pressure
        return (ahead - worn.load.pressure) / step


def slope_step(model: LegModel3D, rate: FloatArray) -> float:
    """Return by how much to follow a derivative of the unknown, for a difference."""
    return SLOPE_STEP / max(float(np.abs(model.displacement(SKIN, rate)).max()), 1e-12)
