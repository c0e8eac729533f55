r"""Equilibrium of a leg and its stocking: the pressure is that of the compressed shape; the finite-element model.

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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_matrix

from legfem.common.units import FloatArray
from legfem.experiments.compression import Compressed, CompressionSettings, LegCompression
from legfem.experiments.experiment import Picklable, cached_in_process
from legfem.fem.spaces import BodySurface, surface_of
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, TriangleSurface, tube
from legfem.geometry.motion import displaced
from legfem.jobs.store import Store
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.terms import Fascia, StiffnessGradient, VolumeLoss
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.meshing.solid_leg import mesh_solid_leg
from legfem.solve.path import SolveReport
from legfem.stockings.fabric import Stocking, StockingLoad, stocking_load

SURFACES = (SKIN, HULL)
PARAMETERS = ("deep.C10", "superficial.C10")
"""Full names of the stiffnesses of muscle and fat."""


@dataclass(frozen=True, eq=False)
class LegModel3D(Picklable):
    """Finite elements of a leg's segment, addressed by the points of its scanned shape.

    Parameters
    ----------
    shape
        Bare leg.
    tissues
        Laws of the deep and the superficial tissue.
    mesh
        Element sizes.
    settings
        Formulation and solver.
    comm
        Ranks that share one solution.
    """

    shape: LegShape
    tissues: Mapping[str, Hyperelastic]
    mesh: SolidMeshSettings | None = None
    settings: CompressionSettings | None = None
    comm: MPI.Intracomm = field(default_factory=lambda: MPI.COMM_SELF, repr=False)

    @cached_in_process
    def compression(self) -> LegCompression:
        """Meshed and compiled problem, made at first use."""
        gradient = StiffnessGradient("deep", self.tissues["deep"], level=float(self.shape.levels.mean()))
        meshed = mesh_solid_leg(self.shape, self.mesh, self.comm)
        return LegCompression(meshed, self.tissues, self.settings, (VolumeLoss("deep"), gradient, Fascia()))

    def solve(
        self,
        values: Mapping[str, float] | None,
        pressure: FloatArray,
        sensitivities: Sequence[str] = (),
        start: Compressed | None = None,
    ) -> Compressed:
        """Solve for the state under a pressure at the skin's points, (n_levels, n_points), MPa."""
        nodal = self._to_mesh @ pressure.ravel()
        return self.compression.solve(values, nodal, sensitivities, start)

    def pressure_rates(
        self, state: Compressed, changes: Sequence[FloatArray], tolerance: float | None = None
    ) -> list[FloatArray]:
        """Differentiate the unknown by changes of the pressure at the skin's points, in the last state.

        ``tolerance`` is the linear solver's, that of Newton's method by default.
        """
        return self.compression.pressure_rates(state, [self._to_mesh @ change.ravel() for change in changes], tolerance)

    def displacement(self, part: str, unknown: FloatArray) -> FloatArray:
        """Return the displacement (mm) of the points of skin or hull, (n_levels, n_points, 3).

        Parameters
        ----------
        part
            ``"skin"`` or ``"hull"``.
        unknown
            A state's, or a derivative of it, of which the displacement's derivative is returned.
        """
        nodal = unknown[self.compression.spaces.displacement_dofs].reshape(-1, 3)
        moved = self._from_mesh[part] @ self._surfaces[part].values(nodal)
        return moved.reshape(*self.shape.contours[part].shape[:2], 3)

    def deformed_shape(self, unknown: FloatArray) -> LegShape:
        """Return the compressed shape, cut at the levels of the bare leg."""
        moved = {part: self.displacement(part, unknown) for part in SURFACES}
        return displaced(self.shape, moved)

    def set_state(self, state: Compressed, pressure: FloatArray, parameters: Mapping[str, float] | None = None) -> None:
        """Put the finite-element system into a state and its pressure, to evaluate fields or derivatives."""
        system = self.compression.system
        system.set_parameters(system.model.values(parameters))
        system.applied_pressure.x.array[:] = self._to_mesh @ pressure.ravel()
        system.set_time(1.0, 1.0)
        system.unknown.x.array[:] = state.unknown

    @cached_in_process
    def _surfaces(self) -> dict[str, BodySurface]:
        spaces = self.compression.spaces
        return {SKIN: surface_of(spaces, "skin"), HULL: surface_of(spaces, "hull")}

    @cached_in_process
    def _from_mesh(self) -> dict[str, csr_matrix]:
        return {
            part: body.surface.weights(self.shape.points(part).reshape(-1, 3)) for part, body in self._surfaces.items()
        }

    @cached_in_process
    def _to_mesh(self) -> csr_matrix:
        points = self.shape.points(SKIN)
        surface = TriangleSurface(points.reshape(-1, 3), tube(*points.shape[:2]))
        return surface.weights(self.compression.skin_points)


PROBE_STEP = 1e-2
"""Largest displacement (mm) in the finite differences of Laplace's law and of distances to a scan."""
RATE_TOLERANCE, COUPLING_TOLERANCE, NEWTON_TOLERANCE = 1e-3, 3e-2, 0.1
"""Relative tolerances: of the leg's linear response to a pressure, of the coupling in derivatives,
and of the coupling in a Newton step."""
NEARLY = 40.0
"""Multiple of the tolerance within which the next state will probably be the equilibrium, so that
its derivatives are computed with it."""
MAX_DIRECTIONS = 40
_LARGEST = 2_000_000
"""Numbers of a state on one rank above which it isn't stored: a file would have some 40 MB."""


@dataclass(frozen=True)
class EquilibriumSettings:
    """Stopping criteria of the Newton iteration for the pressure.

    Parameters
    ----------
    tolerance : float
        Largest difference between the pressure and that of the shape it makes, over the greatest
        pressure.
    max_states : int
        Finite-element solutions at most.
    """

    tolerance: float = 5e-4
    max_states: int = 12


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A leg and the stocking's pressure, in balance to within a tolerance.

    Parameters
    ----------
    state : Compressed
        Finite-element state under ``pressure``.
    pressure : (n_levels, n_points) array
        Applied at the skin's points, MPa.
    shape : LegShape
        Compressed leg.
    load : StockingLoad
        The stocking's load on ``shape`` by Laplace's law, at the bare shape's levels and points.
    changes : tuple of float
        Relative differences of pressure and Laplace's law after each finite-element solution.
    converged : bool
        Whether the last of ``changes`` is within the tolerance.
    """

    state: Compressed
    pressure: FloatArray
    shape: LegShape
    load: StockingLoad
    changes: tuple[float, ...]
    converged: bool


class EquilibriumSolver:
    """Solves for the equilibrium of one leg and its stocking at any stiffness.

    Parameters
    ----------
    model
        Finite-element model of the leg.
    stocking
        Its fabric.
    settings
        Of the iteration.
    folder
        Where equilibria are stored, so that a run that was stopped goes on; nowhere by default.

    Attributes
    ----------
    states : int
        Finite-element solutions so far, those of equilibria read from the folder included.
    """

    def __init__(
        self,
        model: LegModel3D,
        stocking: Stocking,
        settings: EquilibriumSettings | None = None,
        folder: Path | None = None,
    ) -> None:
        self.model, self.stocking = model, stocking
        self._settings = settings or EquilibriumSettings()
        self.states = 0
        self._store = None
        if folder is not None:
            leg = (model.shape, model.tissues, model.mesh, model.settings)
            depends_on = (leg, (model.comm.rank, model.comm.size), (stocking, self._settings))
            self._store = Store(folder, dict[str, FloatArray], depends_on, ("legfem.stockings.equilibrium",))

    def solve(
        self,
        parameters: Mapping[str, float] | None = None,
        sensitivities: Sequence[str] = (),
        start: Equilibrium | None = None,
        error: FloatArray | float = 0.0,
    ) -> Equilibrium:
        """Find the equilibrium, or read it from the folder; the model is left in it.

        Parameters
        ----------
        parameters
            Full names and values (MPa, 1/MPa) that differ from the tissues given to the model.
        sensitivities
            Full names of parameters by which the state is differentiated *at fixed pressure*;
            `LinearisedCoupling.rate` turns that into the derivative in equilibrium.
        start
            An equilibrium nearby; the bare leg by default.
        error
            Relative excess of the pressure over Laplace's law, at the skin's points.

        Returns
        -------
        Equilibrium
            Whose ``state.report.complete`` is False where a finite-element solution failed.
        """
        asked = (dict(parameters or {}), tuple(sensitivities), error)
        stored = self._stored(asked)
        if stored is not None:
            self.states += len(stored.changes)
            self.model.set_state(stored.state, stored.pressure, parameters)
            return stored
        found = self._iterate(*asked, start)
        state = found.state
        small = len(state.unknown) * (1 + len(state.sensitivities)) <= _LARGEST
        if self._store is not None and state.report.complete and small:
            numbers = {"changes": np.array(found.changes), "converged": np.array([float(found.converged)])}
            values = {"unknown": state.unknown, "pressure": found.pressure, **numbers, **state.sensitivities}
            self._store.put(asked, values)
        return found

    def load(self, shape: LegShape) -> StockingLoad:
        """Return the stocking's load on a shape of the leg, by Laplace's law."""
        return stocking_load(shape, self.stocking)

    def _stored(self, asked: tuple[Mapping[str, float], Sequence[str], FloatArray | float]) -> Equilibrium | None:
        """Return an equilibrium from the folder if every rank has its part of it; all ranks call."""
        if self._store is None:
            return None
        kept = self._store.get(asked)
        if not self.model.comm.allreduce(kept is not None, MPI.LAND):
            return None
        assert kept is not None
        report = SolveReport(1.0, 1.0, True, "kept from before", unknowns=len(kept["unknown"]))
        rates = {name: np.array(kept[name]) for name in asked[1]}
        state = Compressed(report, np.array(kept["unknown"]), rates)
        shape = self.model.deformed_shape(state.unknown)
        changes = tuple(map(float, kept["changes"]))
        pressure, converged = np.array(kept["pressure"]), bool(kept["converged"][0])
        return Equilibrium(state, pressure, shape, self.load(shape), changes, converged)

    def _iterate(
        self,
        parameters: Mapping[str, float],
        sensitivities: Sequence[str],
        error: FloatArray | float,
        start: Equilibrium | None,
    ) -> Equilibrium:
        shape, near = self.model.shape, False
        load = self.load(shape) if start is None else start.load
        pressure, state = load.pressure * (1 + error), None if start is None else start.state
        changes: list[float] = []
        while True:
            last = len(changes) + 1 == self._settings.max_states
            names = sensitivities if near or last else ()
            state = self.model.solve(parameters, pressure, names, state)
            self.states += 1
            if not state.report.complete:
                return Equilibrium(state, pressure, shape, load, tuple(changes), False)
            shape = self.model.deformed_shape(state.unknown)
            load = self.load(shape)
            aimed = load.pressure * (1 + error)
            changes.append(float(np.abs(aimed - pressure).max() / aimed.max()))
            converged = changes[-1] < self._settings.tolerance
            here = Equilibrium(state, pressure, shape, load, tuple(changes), converged)
            if last or (converged and names == sensitivities):
                return here
            near = changes[-1] < NEARLY * self._settings.tolerance
            moved, added = LinearisedCoupling(self, here).respond(aimed - pressure, NEWTON_TOLERANCE)
            pressure = np.maximum(pressure + added, 0.0)
            state = replace(state, unknown=state.unknown + moved)


@dataclass(frozen=True, eq=False)
class _Direction:
    """A change of the pressure, the leg's response, and what Laplace's law leaves of the change."""

    change: FloatArray
    response: FloatArray
    image: FloatArray
    """Image of unit length, orthogonal to other directions' images."""


class LinearisedCoupling:
    r"""First-order coupling of pressure and shape about an equilibrium.

    A change of a parameter moves the finite-element unknown by :math:`x_0` at fixed pressure. The
    new shape alters the pressure, which moves the unknown again: together by
    :math:`x_0 + S\,\delta p` with :math:`\delta p = L'(x_0 + S\,\delta p)`, where :math:`S` is the
    unknown's derivative by the pressure and :math:`L'` Laplace's law differentiated by the unknown.
    The linear system :math:`(1 - L' S)\,\delta p = c` is solved by GCR; its search directions are
    kept for further right sides (M. L. Parks et al., SIAM J. Sci. Comput. 28 (2006) 1651-1674).

    Parameters
    ----------
    solver
        Of the leg.
    equilibrium
        The one that the model is in: the last that was solved or restored.
    """

    def __init__(self, solver: EquilibriumSolver, equilibrium: Equilibrium) -> None:
        self._solver, self._equilibrium = solver, equilibrium
        self._directions: list[_Direction] = []

    def rate(self, rate: FloatArray) -> FloatArray:
        """Return the unknown's derivative in equilibrium from that at fixed pressure."""
        return rate + self.respond(self.pressure_rate(rate), COUPLING_TOLERANCE)[0]

    def respond(self, change: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray]:
        r"""Return the unknown's move and the pressure's whole change that follow from a given one.

        These are :math:`S\,\delta p` and :math:`\delta p = c + L' S\,\delta p` for a change
        :math:`c`. If c is the pressure that Laplace's law misses, they are Newton's step.

        Parameters
        ----------
        change
            c at the skin's points (n_levels, n_points), MPa.
        tolerance
            Residual of the linear system over the norm of c.
        """
        left, enough = change, tolerance * np.linalg.norm(change)
        moved, added = np.zeros_like(self._equilibrium.state.unknown), np.zeros_like(change)
        number = 0
        while number < len(self._directions) or (np.linalg.norm(left) > enough and number < MAX_DIRECTIONS):
            if number == len(self._directions):
                self._directions.append(self._next_direction(left))
            known = self._directions[number]
            share = np.vdot(known.image, left)
            left = left - share * known.image
            moved, added = moved + share * known.response, added + share * known.change
            number += 1
        return moved, added

    def _next_direction(self, change: FloatArray) -> _Direction:
        """Return a direction whose image is orthogonal to the earlier ones'."""
        model, state = self._solver.model, self._equilibrium.state
        (response,) = model.pressure_rates(state, [change], RATE_TOLERANCE)
        image = change - self.pressure_rate(response)
        for known in self._directions:
            share = np.vdot(known.image, image)
            change, response = change - share * known.change, response - share * known.response
            image = image - share * known.image
        size = float(np.linalg.norm(image))
        return _Direction(change / size, response / size, image / size)

    def pressure_rate(self, rate: FloatArray) -> FloatArray:
        """Return the derivative of Laplace's pressure along a derivative of the unknown."""
        model, here = self._solver.model, self._equilibrium
        step = PROBE_STEP / max(float(np.abs(model.displacement(SKIN, rate)).max()), 1e-12)
        ahead = self._solver.load(model.deformed_shape(here.state.unknown + step * rate))
        return (ahead.pressure - here.load.pressure) / step
