r"""A cup that draws a round body up through its opening: the dome's height against the suction.

The suction :math:`p` acts on the skin within the opening, along its deformed normal. The cup's rim
is held where it touches, as on a stand. Of an incompressible half space under a small suction, and
without a rim, the dome's height is that of a uniform pressure on a circle of radius :math:`a`,

.. math:: u = \frac{2 (1 - \nu^2)\, p\, a}{E}

(A. E. H. Love, Phil. Trans. R. Soc. A 228 (1929) 377-420).
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import mpi4py.MPI  # noqa: F401  # first, see legfem.fem
import numpy as np

from legfem.common.units import FloatArray
from legfem.experiments.axisymmetric import AxisymmetricBody
from legfem.experiments.bodies import CupOnLayer
from legfem.experiments.experiment import Meshed, ProtocolTest, Solved, cached_in_process, sample_protocol
from legfem.fem.system import System
from legfem.mechanics.model import LegModel, Term
from legfem.mechanics.terms import Fibres, SkinPressure, Tissue
from legfem.meshing.grid import Support
from legfem.meshing.section import SKIN
from legfem.meshing.structured import RIM, MeridianMeshSettings, mesh_meridian, supports
from legfem.solve.linear import by_skin_load
from legfem.solve.newton import NewtonSolver
from legfem.solve.path import ForceCurve, Path, SolveReport, Step
from legfem.solve.protocol import Protocol

_STEPS = 20
"""Steps to the dome's height."""
_POINTS = 80
"""Points on every straight part of a motion."""
_FIRST = 1e-2
"""First suction over the least C10, from whose rise the body's stiffness follows."""
_CUT = 0.4
"""Factor on the suction's step after a failure."""
_LEAST = 1e-3
"""Least step of the suction over the usual one."""
_GREATEST = 1.5
"""Greatest step of the suction over the last one."""


@dataclass(frozen=True, eq=False)
class SuctionTest(AxisymmetricBody[CupOnLayer], ProtocolTest):
    """The cup's test, an `legfem.experiments.experiment.Experiment`.

    Displacement is the dome's height at the axis, force the suction times the opening's area. The
    suction is what is stepped: a dome that goes on growing at a suction that falls isn't followed.
    """

    @cached_property
    def model(self) -> LegModel:
        """Mechanical model: the sum of its terms."""
        tissues = tuple(Tissue(name, law) for name, law in self.laws.items())
        return LegModel((*tissues, SkinPressure()), self.settings.formulation).with_terms(self.mechanisms)

    def with_terms(self, terms: Sequence[Term]) -> Self:
        """Return the test with other laws and with fibres: it is solved for its first loading alone."""
        return super().with_terms([term for term in terms if isinstance(term, Tissue | Fibres)])

    @property
    def parameters(self) -> dict[str, float]:
        """Every number of the model by full name."""
        return self.model.parameters

    @property
    def held(self) -> tuple[Support, ...]:
        """Supports of the axis, of the base, and of the skin under the rim."""
        under = Support(RIM, (0, 1) if self.test.rim == "bonded" else (1,))
        return (*supports(self.test.base), under)

    @cached_in_process
    def _drawn(self) -> "_Drawn":
        test, settings = self.test, self.settings
        opening, outer = test.opening_radius, test.opening_radius + test.rim_width
        meshed = mesh_meridian(
            test.layer_radius,
            test.thickness,
            (opening, outer),
            settings.mesh or MeridianMeshSettings(opening / 16),
            "free",
            self.comm,
            self.interfaces_within(test.thickness),
            ((SKIN, opening), (RIM, outer)),
        )
        system = System(self.spaces_on(meshed, self.held), self.model)
        return _Drawn(system, NewtonSolver(system, settings.newton, settings.linear))

    @property
    def system(self) -> System:
        """The model on its mesh, in the state last solved for."""
        return self._drawn.system

    def _follow(self, values: Mapping[str, float] | None, protocol: Protocol, sensitivities: Sequence[str]) -> Solved:
        """Draw the dome along a protocol of its height.

        What the tissue remembers doesn't count: returns and holds are those of its first rise.
        """
        parameters = self.model.values(values)
        curve, report = self._drawn.to(protocol.depth, parameters, sensitivities, self.test.opening)
        times, at = sample_protocol(protocol, _POINTS, report.reached + 1e-9)
        by = {name: curve.sensitivity(name, at) for name in sensitivities}
        return Solved(parameters, curve, Path(times, at, curve(at), by), report)


@dataclass(frozen=True, eq=False)
class _Drawn(Meshed):
    """The finite-element model of a suction; suctions are in MPa."""

    @cached_property
    def _apex(self) -> int:
        """The unknown that is the apex's displacement upwards."""
        spaces = self.system.spaces
        nodes = spaces.displacement_space.tabulate_dof_coordinates()
        top = int(np.argmin(np.hypot(nodes[:, 0], nodes[:, 1] - nodes[:, 1].max())))
        return int(spaces.displacement_dofs[2 * top + 1])

    def to(
        self, height: float, values: dict[str, float], names: Sequence[str], opening: float
    ) -> tuple[ForceCurve, SolveReport]:
        """Return the curve of the suction's pull against the dome's height, and the report of the solution."""
        started = time.perf_counter()
        system = self.system
        system.set_parameters(values)
        system.reset()
        # The term's time is the suction in MPa.
        system.applied_pressure.x.array[:] = -1.0
        tracker = self.trackers.fresh(names)
        modulus = min(value for name, value in values.items() if name.endswith(".C10"))
        at, risen = [0.0], [0.0]
        slopes: list[FloatArray] = [np.zeros(len(names))]
        steps: list[Step] = []
        usual = size = _FIRST * modulus
        before, change, stopped = system.unknown.x.array.copy(), 0.0 * system.unknown.x.array, ""
        while risen[-1] < height:
            system.unknown.x.array[:] = before + size * change
            system.set_time(at[-1] + size, size)
            outcome = self.solver.solve()
            rise = float(system.unknown.x.array[self._apex])
            if outcome.converged and rise <= risen[-1]:
                outcome = replace(outcome, converged=False, reason="the dome falls as the suction rises")
            reached = rise if outcome.converged else risen[-1]
            steps.append(Step(**vars(outcome), displacement=reached, time=at[-1] + size, size=size))
            if not outcome.converged:
                system.unknown.x.array[:] = before
                size *= _CUT
                if size < _LEAST * usual:
                    stopped = f"no step of the suction above {1e3 * usual * _LEAST:.2g} kPa: {outcome.reason}"
                    break
                continue
            at.append(at[-1] + size)
            risen.append(rise)
            self.solver.refactor()
            change = by_skin_load(self.solver.linear_solver, system, 1.0 / at[-1])
            if tracker is not None:
                tracker.step(self.solver)
                rates = tracker.state_rates()
                rising = np.array([rates[name][self._apex] for name in names])
                slopes.append(-rising / change[self._apex])
            before = system.unknown.x.array.copy()
            system.advance()
            usual = height / _STEPS / float(change[self._apex])
            size = usual if len(at) == 2 else min(usual, _GREATEST * size)
        by = {name: opening * np.array(slopes)[:, k] for k, name in enumerate(names)}
        curve = ForceCurve(np.array(risen), opening * np.array(at), by)
        return curve, SolveReport(
            min(risen[-1], height),
            height,
            not stopped,
            stopped or "the target is reached",
            tuple(steps),
            time.perf_counter() - started,
            system.spaces.unknowns,
        )
