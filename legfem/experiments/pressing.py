"""A rigid indenter pressed into a body: what the tests in plane strain and in 3D share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path as FilePath

import numpy as np

from legfem.checkpoint import Checkpoint, key_of
from legfem.contact import RigidIndenter
from legfem.contact_settings import ContactSettings
from legfem.curve import ForceCurve
from legfem.materials import Hyperelastic
from legfem.model import LegModel
from legfem.newton import NewtonSolver
from legfem.path import Path
from legfem.protocol import Protocol
from legfem.sensitivity import Trackers
from legfem.spaces import Formulation
from legfem.stepping import SolveReport, StepSettings, follow
from legfem.symbols import named
from legfem.system import System
from legfem.terms import NormalContact, TangentialContact, Tissue
from legfem.units import FloatArray

SOFTER = 0.2
"""Factor on the contact's stiffness where a solution stops short."""
OnStep = Callable[[float], None]


@dataclass(frozen=True, eq=False)
class Indentation:
    """The outcome of one simulated test; ``report.complete`` tells whether it got there."""

    parameters: Mapping[str, float]
    """Of the model, by full name (MPa, 1/MPa)."""
    curve: ForceCurve
    """Force (N) of the whole cylinder against displacement, in the first loading."""
    path: Path
    """All steps: holds, unloading and reloading too."""
    report: SolveReport


def leg_model(
    tissues: Mapping[str, Hyperelastic],
    indenter: RigidIndenter,
    contact: ContactSettings,
    formulation: Formulation,
) -> LegModel:
    """Return the sum of tissues (law by region) and contact, the latter of unit stiffness."""
    normal = NormalContact(indenter, contact.pressure_law(1.0))
    along = TangentialContact(normal, contact.tangential_law(1.0))
    regions = tuple(Tissue(region, law) for region, law in tissues.items())
    return LegModel((*regions, normal, along), formulation)


@dataclass(frozen=True, eq=False)
class Pressing:
    """A model on its mesh with its solver, ready to be pressed with any parameters.

    Parameters
    ----------
    system, solver
        The model and its Newton solver.
    contact
        How contact is enforced.
    radius
        Of the indenter (mm), which the contact's stiffness is measured by.
    whole
        Force of the whole indenter over that of the model: the cylinder's length (mm) in plane
        strain, the number of mirror images in 3D.
    steps
        Sizes.
    """

    system: System
    solver: NewtonSolver
    contact: ContactSettings
    radius: float
    whole: float
    steps: StepSettings

    @cached_property
    def _trackers(self) -> Trackers:
        return Trackers(self.system)

    def run(
        self,
        parameters: Mapping[str, float] | None,
        protocol: Protocol,
        sensitivities: Sequence[str] = (),
        on_step: OnStep | None = None,
        softness: float = 1.0,
        keep_in: tuple[FilePath, str] | None = None,
    ) -> Indentation:
        """Follow a protocol, with a contact softened by a factor.

        States are kept in a folder, with the hash of what else they depend on, if one is given;
        derivatives aren't, so that a solution with sensitivities keeps none.
        """
        model = self.system.model
        values = model.values(parameters)
        penalty = softness * self.contact.penalty(values, self.radius)
        normal = _normal_contact(model)
        values |= named(normal.name, self.contact.pressure_law(penalty))
        values |= {name: penalty for name in ("friction.stiffness",) if name in values}
        self.system.set_parameters(values)
        tracker = self._trackers.fresh(sensitivities)
        time, displacement = [float(protocol.time[0])], [float(protocol.displacement[0])]
        force = [0.0]
        derivatives: list[FloatArray] = [np.zeros(len(sensitivities))]

        def record(now: float, at: float) -> None:
            time.append(now)
            displacement.append(at)
            force.append(self.system.force() * self.whole)
            if tracker is not None:
                derivatives.append(tracker.step(self.solver) * self.whole)
            if on_step is not None:
                on_step(at)

        checkpoint = None
        if keep_in is not None and not sensitivities:
            folder, key = keep_in
            given = key, values, protocol.time, protocol.displacement, asdict(self.steps)
            checkpoint = Checkpoint(folder, key_of(given), self.system.comm)
        report = follow(
            self.system, self.solver, protocol, self.steps, record, checkpoint,
            {"time": time, "displacement": displacement, "force": force},
        )  # fmt: skip
        if checkpoint is not None:
            checkpoint.clear()
        report = replace(report, contact_stiffness_factor=softness)
        columns = np.array(derivatives)
        path = Path(
            np.array(time),
            np.array(displacement),
            np.array(force),
            {name: columns[:, k] for k, name in enumerate(sensitivities)},
        )
        return Indentation(values, path.loading, path, report)


def farthest(attempts: Sequence[Indentation]) -> Indentation:
    """Return the attempt that came farthest, with the reports of the others."""
    best = max(attempts, key=lambda solved: (solved.report.complete, solved.report.reached))
    others = tuple(solved.report for solved in attempts if solved is not best)
    return replace(best, report=replace(best.report, earlier_attempts=others))


def _normal_contact(model: LegModel) -> NormalContact:
    return next(term for term in model.at("skin") if isinstance(term, NormalContact))
