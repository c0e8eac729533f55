"""One simulation of a study: parameters in, a curve or the reason why there is none out."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np

from legfem.common.units import FloatArray
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.jobs.key import code_fingerprint
from legfem.legs.experiments import tissues_of
from legfem.legs.subject import Subject
from legfem.solve.path import ForceCurve
from legfem.solve.settings import NewtonSettings, StepSettings

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import Tissues
    from legfem.geometry.indenter import Indenter
    from legfem.geometry.section import LegSection

Fidelity = Literal["default", "refined"]
REFINEMENT = 1.5
_MESHES_KEPT = 4


@dataclass(frozen=True)
class Request:
    """One simulation to do."""

    stage: str
    """What it is for: ``factorial``, ``training``, ``testing``, ``refined``, ``nominal``."""
    number: int
    """Within its stage."""
    values: tuple[tuple[str, float], ...]
    """Parameters in the model's units, by name."""
    depth: float
    """mm."""
    fidelity: Fidelity = "default"
    sensitivities: tuple[str, ...] = ()

    @property
    def asked(self) -> object:
        """What the record depends on."""
        return self.values, self.depth, self.fidelity, sorted(self.sensitivities)


@dataclass(frozen=True, eq=False)
class Record:
    """What came of a simulation; ``complete`` tells whether it reached its depth."""

    displacement: FloatArray
    """(n,), mm; empty where there wasn't even a mesh."""
    force_per_length: FloatArray
    """(n,), N/mm."""
    complete: bool
    reason: str
    """Why it ended."""
    seconds: float = 0.0
    factorisations: int = 0
    contact_stiffness_factor: float = 1.0
    unknowns: int = 0
    sensitivities: Mapping[str, FloatArray] = field(default_factory=dict)
    """Of the force per length by parameters in the model's units."""

    @property
    def reached(self) -> float:
        """Greatest displacement (mm)."""
        return float(self.displacement[-1]) if len(self.displacement) else 0.0

    @property
    def curve(self) -> ForceCurve | None:
        """Force per length (N/mm); None where too few steps were made."""
        if len(self.displacement) < 4:
            return None
        return ForceCurve(self.displacement, self.force_per_length, self.sensitivities)


def failed(reason: str) -> Record:
    """Return the record of a simulation that gave nothing."""
    return Record(np.zeros(0), np.zeros(0), False, reason)


class Simulator(Protocol):
    """What runs simulations; it must be picklable."""

    def simulate(self, request: Request) -> Record:
        """Simulate."""
        ...

    def fingerprint(self) -> Mapping[str, Any]:
        """Return all that a simulation depends on but the request, as JSON types."""
        ...


@dataclass(eq=False)
class PlaneStrainSimulator:
    """A subject's plane-strain test; a mesh is made once for every geometry in a process."""

    section: LegSection
    indenter: Indenter
    tissues: Tissues
    _tests: dict[tuple[float, float, Fidelity], PlaneStrainIndentation] = field(
        default_factory=dict, init=False, repr=False
    )

    @classmethod
    def of_subject(cls, subject: Subject) -> PlaneStrainSimulator:
        """Return the simulator of a subject's leg."""
        return cls(subject.section, subject.indenter, tissues_of(subject))

    def fingerprint(self) -> Mapping[str, Any]:
        """Return section, indenter, tissues, settings and code."""
        geometry = self.section.fascia_thickness, 2 * self.indenter.radius
        return {
            "default": self._test(*geometry, "default").fingerprint(),
            "refined": self._test(*geometry, "refined").fingerprint(),
            "code": code_fingerprint("legfem.study.doe.simulator"),
        }

    def simulate(self, request: Request) -> Record:
        """Simulate; what can't be meshed or solved is a record too."""
        values = dict(request.values)
        thickness = values.pop("fascia.thickness", self.section.fascia_thickness)
        diameter = values.pop("indenter.diameter", 2 * self.indenter.radius)
        try:
            test = self._test(thickness, diameter, request.fidelity)
            solved = test.solve(values, request.depth, request.sensitivities)
        except Exception as error:  # whatever it is, the other simulations go on
            if os.environ.get("LEGFEM_DEBUG"):
                raise
            return failed(" ".join(f"{type(error).__name__}: {error}".split()))
        report, curve, length = solved.report, solved.curve, self.indenter.length
        return Record(
            curve.displacement,
            curve.force / length,
            bool(report.complete),
            report.reason,
            report.seconds + sum(before.seconds for before in report.earlier_attempts),
            report.factorisations,
            report.contact_stiffness_factor,
            report.unknowns,
            {name: values / length for name, values in curve.sensitivities.items()},
        )

    def _test(self, thickness: float, diameter: float, fidelity: Fidelity) -> PlaneStrainIndentation:
        key = thickness, diameter, fidelity
        if key not in self._tests:
            while len(self._tests) >= _MESHES_KEPT:
                del self._tests[next(iter(self._tests))]
            self._tests[key] = PlaneStrainIndentation(
                replace(self.section, fascia_thickness=thickness),
                replace(self.indenter, radius=diameter / 2),
                self.tissues,
                settings_of(fidelity),
            )
        return self._tests[key]


def settings_of(fidelity: Fidelity) -> PlaneStrainSettings:
    """Return the numerical settings: the default, or a finer mesh with small steps."""
    # Round-off in a fascia of 10 MPa leaves a residual of some 3e-12 N/mm, which a tolerance
    # relative to the small contact forces of a 0.5 kPa leg doesn't allow for.
    newton = NewtonSettings(absolute_tolerance=1e-11)
    base = PlaneStrainSettings(newton=newton)
    if fidelity == "default":
        return base
    steps = StepSettings(first=0.1, largest=0.5)
    return replace(base, mesh=base.mesh.refined(REFINEMENT), steps=steps)
