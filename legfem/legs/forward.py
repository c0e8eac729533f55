"""The forward model as identification sees it: values in, a force curve or a failure out."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from legfem.channels.site import Sight
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import PARTS, LegSection
from legfem.inverse.catalogue import Values
from legfem.inverse.outcome import Outcome
from legfem.jobs.key import code_fingerprint
from legfem.legs.subject import Subject

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings, Tissues
    from legfem.mechanics.model import Term

_TISSUES = ("deep", "superficial", "fascia")


@dataclass(eq=False)
class PlaneStrainForward:
    """The plane-strain test of a subject; meshes on the first solve, in whichever process."""

    section: LegSection
    indenter: Indenter
    tissues: "Tissues"
    settings: "PlaneStrainSettings"
    depth: float
    """mm."""
    mechanisms: "tuple[Term, ...]" = ()
    """Terms added to those of tissues and contact."""
    sights: tuple[Sight, ...] = ()
    """Places at which channels are read."""
    _experiment: "PlaneStrainIndentation | None" = field(default=None, init=False, repr=False)

    @classmethod
    def of_subject(
        cls, subject: Subject, depth: float, settings: "PlaneStrainSettings | None" = None
    ) -> "PlaneStrainForward":
        """Return the test of a subject pressed to a depth (mm).

        Raises
        ------
        InputError
            For a ball, a punch or a cylinder that doesn't lie along the leg.
        """
        subject.indenter.check_lies_along(str(subject.directory / "subject.toml"))
        from legfem.experiments.plane_strain import PlaneStrainSettings
        from legfem.legs.experiments import tissues_of

        tissues, settings = tissues_of(subject), settings or PlaneStrainSettings()
        return cls(subject.section, subject.indenter, tissues, settings, depth, sights=subject.sights)

    def __getstate__(self) -> dict[str, Any]:
        """Leave the finite-element model out: it can't leave its process."""
        return {**self.__dict__, "_experiment": None}

    @property
    def experiment(self) -> "PlaneStrainIndentation":
        """The finite-element model; compiled and meshed when first asked for."""
        if self._experiment is None:
            from legfem.experiments.plane_strain import PlaneStrainIndentation

            self._experiment = PlaneStrainIndentation(
                self.section, self.indenter, self.tissues, self.settings, mechanisms=self.mechanisms, sights=self.sights
            )
        return self._experiment

    def prepare(self) -> None:
        """Compile and mesh now."""
        _ = self.experiment.pressing

    @property
    def nominal(self) -> Values:
        """The tissues' values, and those of further mechanisms (MPa, 1/MPa)."""
        further = {k: v for term in self.mechanisms for k, v in term.parameters.items()}
        return {**values_of(self.tissues), **further}

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Solve in full."""
        from legfem.experiments.indentation import SolutionStates

        replay = SolutionStates(self.experiment, dict(values), self.depth)
        solved = self.experiment.solve(values, self.depth, sensitivities, on_step=replay.take)
        replay.solved = solved
        self.experiment.replays.add(replay)
        report = solved.report
        return Outcome(
            values,
            (solved.curve,),
            bool(report.complete),
            report.reason,
            report.factorisations,
            float(report.seconds) + sum(before.seconds for before in report.earlier_attempts),
            report.compromise,
        )

    def fingerprint(self) -> Mapping[str, Any]:
        """Return section, indenter, tissues, settings, depth and code."""
        contours = hashlib.sha256()
        for part in PARTS:
            contours.update(np.ascontiguousarray(self.section.contour(part)).tobytes())
        return {
            "model": "plane strain",
            "contours": contours.hexdigest(),
            "fascia_thickness_mm": self.section.fascia_thickness,
            "indenter": repr(
                (self.indenter.radius, self.indenter.length, self.indenter.aim.tolist(), self.indenter.direction_deg)
            ),
            "superficial": repr(self.tissues.superficial),
            "fascia": repr(self.tissues.fascia),
            "deep_D1_per_MPa": self.tissues.deep.D1,
            "settings": repr(self.settings),
            "mechanisms": repr(self.mechanisms),
            "depth_mm": self.depth,
            "code": code_fingerprint("legfem.experiments.plane_strain"),
        }


def values_of(tissues: "Tissues") -> dict[str, float]:
    """Return the tissues' values by full name (MPa, 1/MPa)."""
    return {
        f"{tissue}.{key}": value for tissue in _TISSUES for key, value in getattr(tissues, tissue).parameters.items()
    }
