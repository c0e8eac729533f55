r"""Equilibrium of a leg and its stocking: the pressure is that of the compressed shape.

Laplace's law gives the stocking's pressure from the shape, and the pressure compresses the shape.
An equilibrium is a pressure field :math:`p` on the skin with

.. math:: p = (1 + \varepsilon)\, L(x(p)),

where :math:`x(p)` is the finite-element solution under :math:`p`, :math:`L` Laplace's law on its
skin (`legfem.stockings.fabric`) and :math:`\varepsilon` a given relative error of the fabric. It is
found by Newton's method in :math:`p`.

Taking :math:`L` on the scanned shape instead would not do, since the pressure is as rough as the
shape's curvature: an error of 0.3 mm over a few millimetres of the outline changes the curvature by
as much as the stocking's whole pressure, and the leg would be pushed in there by :math:`K > 1`
times the error. In equilibrium it is pushed in by :math:`K/(1 + K)` of it only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.common.units import FloatArray
from legfem.experiments.compression import Compressed
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.jobs.store import Store
from legfem.solve.report import SolveReport
from legfem.stockings.fabric import Stocking, StockingLoad, stocking_load
from legfem.stockings.leg_model import LegModel3D

_LARGEST = 2_000_000
"""Numbers of a state on a rank, beyond which it isn't kept: a file would have some 40 MB."""


@dataclass(frozen=True)
class AskedEquilibrium:
    """What an equilibrium depends on beside the leg, the stocking and their settings."""

    parameters: Mapping[str, float]
    sensitivities: Sequence[str]
    error: FloatArray | float


@dataclass(frozen=True, eq=False)
class KeptEquilibrium:
    """A state, the pressure it was found with, and the changes on the way there."""

    state: Compressed
    pressure: FloatArray
    changes: tuple[float, ...]
    converged: bool


class KeptEquilibria:
    """Equilibria by what was asked for; every rank keeps its part.

    Parameters
    ----------
    folder
        Where they are kept.
    model
        The leg.
    depends_on
        What they depend on beside the leg.
    """

    def __init__(self, folder: Path, model: LegModel3D, depends_on: object) -> None:
        self._comm = model.comm
        leg = (model.shape, model.tissues, model.mesh, model.settings)
        part = (self._comm.rank, self._comm.size)
        self._store = Store(folder, dict[str, FloatArray], (leg, part, depends_on), ("legfem.stockings.equilibrium",))

    def get(self, asked: AskedEquilibrium) -> KeptEquilibrium | None:
        """Return an equilibrium; None where a rank has no part of it. All ranks call."""
        kept = self._store.get(asked)
        if not self._comm.allreduce(kept is not None, MPI.LAND):
            return None
        assert kept is not None
        report = SolveReport(1.0, 1.0, True, "kept from before", unknowns=len(kept["unknown"]))
        rates = {name: np.array(kept[name]) for name in asked.sensitivities}
        state = Compressed(report, np.array(kept["unknown"]), rates)
        changes = tuple(map(float, kept["changes"]))
        return KeptEquilibrium(state, np.array(kept["pressure"]), changes, bool(kept["converged"][0]))

    def put(self, asked: AskedEquilibrium, found: KeptEquilibrium) -> None:
        """Keep a rank's part of an equilibrium; a very large one isn't."""
        state = found.state
        if len(state.unknown) * (1 + len(state.sensitivities)) > _LARGEST:
            return
        self._store.put(
            asked,
            {
                "unknown": state.unknown,
                "pressure": found.pressure,
                "changes": np.array(found.changes),
                "converged": np.array([float(found.converged)]),
                **state.sensitivities,
            },
        )


SLOPE_STEP = 1e-2
"""Greatest displacement (mm) of a difference of pressures or distances."""
RATE_TOLERANCE, FEEDBACK_TOLERANCE, STEP_TOLERANCE = 1e-3, 3e-2, 0.1
"""Of the linear solutions of a pressure's changes, and of the stocking's answer to them: in
derivatives, and on the way to an equilibrium."""
NEARLY = 40.0
"""Times the tolerance: within it the next state is likely to be the equilibrium."""
MAX_DIRECTIONS = 40


@dataclass(frozen=True)
class FixedPointSettings:
    """Of the pressure that depends on the shape that it makes.

    Parameters
    ----------
    tolerance : float
        Difference of the pressure and that of the shape it makes, over its greatest value.
    max_states : int
        Compressed states to solve for.
    """

    tolerance: float = 5e-4
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
        return Worn(kept.state, kept.pressure, shape, self.load(shape), kept.changes, kept.converged)

    def _found(self, asked: AskedEquilibrium, start: Worn | None) -> Worn:
        parameters, sensitivities, error = asked.parameters, asked.sensitivities, asked.error
        load = self.load(self.model.shape) if start is None else start.load
        pressure, state = load.pressure * (1 + error), None if start is None else start.state
        shape, near = self.model.shape, False
        changes: list[float] = []
        while True:
            last = len(changes) + 1 == self._settings.max_states
            names = sensitivities if near or last else ()
            state = self.model.solve(parameters, pressure, names, state)
            self.states += 1
            if not state.report.complete:
                return Worn(state, pressure, shape, load, tuple(changes), False)
            shape = self.model.deformed_shape(state.unknown)
            load = self.load(shape)
            aimed = load.pressure * (1 + error)
            changes.append(float(np.abs(aimed - pressure).max() / aimed.max()))
            converged = changes[-1] < self._settings.tolerance
            here = Worn(state, pressure, shape, load, tuple(changes), converged)
            if last or (converged and names == sensitivities):
                return here
            near = changes[-1] < NEARLY * self._settings.tolerance
            moved, added = Feedback(self, here).answered(aimed - pressure, STEP_TOLERANCE)
            pressure = np.maximum(pressure + added, 0.0)
            state = replace(state, unknown=state.unknown + moved)

    def load(self, shape: LegShape) -> StockingLoad:
        """Return the load of the stocking on a shape of the leg."""
        return stocking_load(shape, self.stocking)


@dataclass(frozen=True, eq=False)
class _Direction:
    r"""A change of the pressure :math:`\delta p`, with what it does."""

    change: FloatArray
    """At the skin's points."""
    answer: FloatArray
    r"""Of the unknown, :math:`S\,\delta p`."""
    image: FloatArray
    r""":math:`\delta p - L' S\,\delta p`, of norm 1."""


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
        self._directions: list[_Direction] = []

    def to_rate(self, rate: FloatArray) -> FloatArray:
        """Return the unknown's derivative in equilibrium, of that at a fixed pressure."""
        return rate + self.answered(self.pressure_slope(rate), FEEDBACK_TOLERANCE)[0]

    def answered(self, change: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray]:
        r"""Return how the unknown moves by a change of the pressure, and what that change becomes.

        With the stocking's answer: of :math:`c` they are :math:`S\,\delta p` and
        :math:`\delta p = c + L' S\,\delta p`. Newton's step to an equilibrium, where the change is
        the pressure that is missing.

        Parameters
        ----------
        change
            At the skin's points (MPa).
        tolerance
            Of what is left, over the change.
        """
        left, enough = change, tolerance * np.linalg.norm(change)
        moved, added = np.zeros_like(self._worn.state.unknown), np.zeros_like(change)
        number = 0
        while number < len(self._directions) or (np.linalg.norm(left) > enough and number < MAX_DIRECTIONS):
            if number == len(self._directions):
                self._directions.append(self._new(left))
            known = self._directions[number]
            share = np.vdot(known.image, left)
            left = left - share * known.image
            moved, added = moved + share * known.answer, added + share * known.change
            number += 1
        return moved, added

    def _new(self, change: FloatArray) -> _Direction:
        """Return a change of the pressure, less what the known ones have of its image."""
        model, state = self._leg.model, self._worn.state
        (answer,) = model.pressure_rates(state, [change], RATE_TOLERANCE)
        image = change - self.pressure_slope(answer)
        for known in self._directions:
            share = np.vdot(known.image, image)
            change, answer = change - share * known.change, answer - share * known.answer
            image = image - share * known.image
        size = float(np.linalg.norm(image))
        return _Direction(change / size, answer / size, image / size)

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
