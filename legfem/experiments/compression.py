"""A leg's segment in 3D under a pressure on its skin."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import mpi4py.MPI  # noqa: F401  # first, see legfem.fem
import numpy as np
from mpi4py import MPI

from legfem.common.errors import AboveZero, Checked, InputError
from legfem.common.units import FloatArray
from legfem.fem.spaces import build_spaces
from legfem.fem.system import System
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.model import LegModel, Term
from legfem.mechanics.terms import PressureStabilisation, SkinPressure, Tissue
from legfem.meshing.grid import Support
from legfem.meshing.structured import END, LegMesh
from legfem.solve.linear import LinearSettings, by_skin_load, renew_factors
from legfem.solve.newton import NewtonSolver
from legfem.solve.path import SolveReport
from legfem.solve.protocol import Protocol
from legfem.solve.sensitivity import Trackers
from legfem.solve.settings import NewtonSettings, StepSettings
from legfem.solve.stepping import follow


@dataclass(frozen=True)
class CompressionSettings(Checked):
    """Numerical settings of a compressed leg.

    Parameters
    ----------
    formulation : {"continuous", "displacement"}
        Displacements and pressures as unknowns, or displacements alone, which locks.
    degree : int
        Degree of the displacement; at 1 the pressures are stabilised.
    ends : {"held", "free"}
        Whether the end faces of the segment stay in their planes: the leg goes on beyond them.
    stabilisation : float
        Factor on the stabilisation.
    newton, linear
        Settings of the solvers.
    """

    formulation: Literal["continuous", "displacement"] = "continuous"
    degree: int = 1
    ends: Literal["held", "free"] = "held"
    stabilisation: AboveZero[float] = 1.0
    newton: NewtonSettings = field(default_factory=lambda: NewtonSettings(relative_tolerance=1e-8))
    linear: LinearSettings = field(
        default_factory=lambda: LinearSettings(tolerance=1e-6, kept_iterations=15, direct_limit=100_000)
    )


@dataclass(frozen=True, eq=False)
class Compressed:
    """A compressed state; ``report.complete`` tells whether it was found.

    Arrays are the rank's own, as of `LegCompression`; None of them means anything otherwise.
    """

    report: SolveReport
    unknown: FloatArray
    """Unknown of the system, ghosts included."""
    sensitivities: Mapping[str, FloatArray]
    """Derivatives of the unknown by parameters at the given pressure, per unit of each."""


class LegCompression:
    """Solves for any pressure and stiffness without meshing or compiling again.

    Parameters
    ----------
    leg_mesh
        Mesh of the leg's segment.
    tissues
        Law of every region the leg has.
    settings
        Numerical.
    mechanisms
        Terms beyond elasticity, at their nulls until `solve` is given other parameters.
    """

    def __init__(
        self,
        leg_mesh: LegMesh,
        tissues: Mapping[str, Hyperelastic],
        settings: CompressionSettings | None = None,
        mechanisms: Sequence[Term] = (),
    ) -> None:
        self.settings = settings or CompressionSettings()
        self._mechanisms = tuple(mechanisms)
        self.leg_mesh = leg_mesh
        supports = list(leg_mesh.supports)
        if self.settings.ends == "held":
            supports.append(Support(END, (2,)))
        form = self.settings.formulation, self.settings.degree
        self.spaces = build_spaces(*leg_mesh.tagged, *form, leg_mesh.regions, supports)
        self.system = System(self.spaces, self._model(tissues), quadrature_degree=2 * self.settings.degree)
        self.solver = NewtonSolver(self.system, self.settings.newton, self.settings.linear)
        self._trackers = Trackers(self.system)
        self._tangent_of: Compressed | None = None
        self._numbers: dict[str, float] = {}

    @property
    def comm(self) -> MPI.Intracomm:
        """The ranks over which the leg is spread."""
        return self.spaces.mesh.comm

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the model by full name."""
        return self.system.model.parameters

    @property
    def skin_points(self) -> FloatArray:
        """Reference positions (mm) of the rank's points at which pressure is given, (n, 3)."""
        return np.asarray(self.system.applied_pressure.function_space.tabulate_dof_coordinates())

    def solve(
        self,
        values: Mapping[str, float] | None,
        pressure: FloatArray,
        sensitivities: Sequence[str] = (),
        start: Compressed | None = None,
    ) -> Compressed:
        """Find the state under a pressure.

        Parameters
        ----------
        values
            Numbers that differ from `parameters`, by full name (MPa, 1/MPa).
        pressure
            At `skin_points` (MPa), positive inwards.
        sensitivities
            Full names of parameters by which to differentiate the state.
        start
            A state near the one sought, from which a single step is tried first.
        """
        system = self.system
        numbers = system.model.values(values)
        if numbers != self._numbers:
            # Factors of another stiffness serve badly.
            renew_factors(self.solver.linear_solver)
            self._numbers = numbers
        system.set_parameters(numbers)
        system.applied_pressure.x.array[:] = pressure
        steps = StepSettings(hold_first=1.0, hold_first_time=1.0)
        tracker = self._trackers.fresh(sensitivities)
        load = Protocol((0.0, 1.0), (0.0, 0.0))
        guess = None if start is None else start.unknown
        self._tangent_of = None
        report = follow(system, self.solver, load, steps, guess=guess)
        if not report.complete or tracker is None:
            return Compressed(report, system.unknown.x.array.copy(), {})
        tracker.step(self.solver)
        state = Compressed(report, system.unknown.x.array.copy(), tracker.state_rates())
        self._tangent_of = state
        return state

    def pressure_rates(
        self, state: Compressed, changes: Sequence[FloatArray], tolerance: float | None = None
    ) -> list[FloatArray]:
        """Return the unknown's derivatives at a state by shares of changes of the pressure.

        Parameters
        ----------
        state
            The last one solved for.
        changes
            Changes of the pressure at `skin_points`, MPa.
        tolerance
            Tolerance of the linear solutions, where they are iterative; that of the settings by default.
        """
        system, linear = self.system, self.solver.linear_solver
        if self._tangent_of is not state:
            system.unknown.x.array[:] = state.unknown
            self.solver.refactor(renew=len(changes) > 1)
            self._tangent_of = state
        linear.setTolerances(rtol=tolerance or self.settings.linear.tolerance)
        given, rates = system.applied_pressure.x.array.copy(), []
        for change in changes:
            system.applied_pressure.x.array[:] = change
            rates.append(by_skin_load(linear, system))
        system.applied_pressure.x.array[:] = given
        linear.setTolerances(rtol=self.settings.linear.tolerance)
        return rates

    def _model(self, tissues: Mapping[str, Hyperelastic]) -> LegModel:
        regions = tuple(self.leg_mesh.regions)
        missing = [region for region in regions if region not in tissues]
        if missing:
            raise InputError("tissues", missing[0], "its law is missing", "give it")
        terms: list[Any] = [Tissue(region, tissues[region]) for region in regions]
        if self.settings.formulation == "continuous" and self.settings.degree == 1:
            strength = self.settings.stabilisation
            terms += [PressureStabilisation(r, tissues[r], strength) for r in regions]
        terms.append(SkinPressure())
        return LegModel((*terms, *self._mechanisms), self.settings.formulation)
