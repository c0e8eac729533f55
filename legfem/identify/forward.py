"""The forward model as identification sees it: stiffness in, a force curve or a failure out."""

from __future__ import annotations

import hashlib
import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from legfem.curve import ForceCurve
from legfem.geometry.section import PARTS, LegSection
from legfem.subject import Indenter, Subject
from legfem.units import kpa_to_mpa

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import (
        PlaneStrainIndentation,
        PlaneStrainSettings,
        Tissues,
    )

SENSITIVITIES = ("deep.C10", "deep.C20", "superficial.C10", "fascia.C10")
"""What every solve differentiates the force by: the back-substitutions cost next to nothing."""


@dataclass(frozen=True)
class DeepTissue:
    """Stiffness of the deep tissue; ``C20 = 0`` and ``D2 = inf`` are a neo-Hookean law."""

    C10: float
    """kPa."""
    C20: float
    """kPa."""
    D2: float
    """1/MPa."""


@dataclass(frozen=True, eq=False)
class ForwardOutcome:
    """One full solve, whether it reached its depth or not."""

    deep: DeepTissue
    curve: ForceCurve
    """With derivatives by `SENSITIVITIES` in N/MPa; ends where the solve did."""
    complete: bool
    reason: str
    """Why it ended."""
    factorisations: int
    seconds: float


class ForwardModel(Protocol):
    """What identification needs of a model; it must be picklable for several processes."""

    def solve(self, deep: DeepTissue) -> ForwardOutcome:
        """Solve in full; stopping short of the depth is an outcome, not an exception."""
        ...

    def fingerprint(self) -> Mapping[str, Any]:
        """Return all that a solve depends on but the deep tissue, as JSON types."""
        ...


@dataclass(eq=False)
class PlaneStrainForward:
    """The plane-strain test of a subject; meshes on the first solve, in whichever process."""

    section: LegSection
    indenter: Indenter
    tissues: Tissues
    settings: PlaneStrainSettings
    depth: float
    """mm."""
    _experiment: PlaneStrainIndentation | None = field(default=None, init=False, repr=False)

    @classmethod
    def of_subject(
        cls, subject: Subject, depth: float, settings: PlaneStrainSettings | None = None
    ) -> PlaneStrainForward:
        """Return the test of a subject pressed to a depth (mm)."""
        from legfem.experiments.plane_strain import PlaneStrainSettings, tissues_of

        return cls(
            subject.section,
            subject.indenter,
            tissues_of(subject),
            settings or PlaneStrainSettings(),
            depth,
        )

    def __getstate__(self) -> dict[str, Any]:
        """Leave the finite-element model out: it can't leave its process."""
        return {**self.__dict__, "_experiment": None}

    @property
    def experiment(self) -> PlaneStrainIndentation:
        """The finite-element model; compiled and meshed when first asked for."""
        if self._experiment is None:
            from legfem.experiments.plane_strain import PlaneStrainIndentation

            self._experiment = PlaneStrainIndentation(
                self.section, self.indenter, self.tissues, self.settings
            )
        return self._experiment

    def prepare(self) -> None:
        """Compile and mesh now."""
        _ = self.experiment

    def solve(self, deep: DeepTissue) -> ForwardOutcome:
        """Solve in full."""
        values = {
            "deep.C10": kpa_to_mpa(deep.C10),
            "deep.C20": kpa_to_mpa(deep.C20),
            "deep.D2": deep.D2,
        }
        solved = self.experiment.solve(values, self.depth, SENSITIVITIES)
        report = solved.report
        return ForwardOutcome(
            deep,
            solved.curve,
            bool(report.complete),
            report.reason,
            report.factorisations,
            float(report.seconds) + sum(before.seconds for before in report.earlier_attempts),
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
                (
                    self.indenter.radius,
                    self.indenter.length,
                    self.indenter.aim.tolist(),
                    self.indenter.direction_deg,
                )
            ),
            "superficial": repr(self.tissues.superficial),
            "fascia": repr(self.tissues.fascia),
            "deep_D1_per_MPa": self.tissues.deep.D1,
            "settings": repr(self.settings),
            "depth_mm": self.depth,
            "code": code_fingerprint(),
        }


_MECHANICS = (".", "experiments", "geometry", "materials", "meshing", "terms")


def code_fingerprint(folders: Sequence[str] = _MECHANICS) -> str:
    """Return a hash of sources, those of a forward solve by default, and of DOLFINx's version."""
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256(package_version("fenics-dolfinx").encode())
    # What deals with users and files doesn't touch the mechanics.
    aside = {"__main__.py", "cli.py", "progress.py", "tables.py", "subject_schema.py"}
    for path in sorted(path for name in folders for path in (root / name).glob("*.py")):
        if path.name not in aside:
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()[:16]


def package_version(name: str) -> str:
    """Return an installed package's version, or ``unknown``."""
    try:
        return version(name)
    except PackageNotFoundError:
        return "unknown"


def legfem_version() -> str:
    """Return legfem's version, from its sources where it isn't installed."""
    project = Path(__file__).resolve().parents[2] / "pyproject.toml"
    if project.is_file():
        return str(tomllib.loads(project.read_text())["project"]["version"])
    return package_version("legfem")


def solve_key(fingerprint: Mapping[str, Any], deep: DeepTissue) -> str:
    """Return the name under which a solve is kept: a hash of everything it depends on."""
    everything = {**fingerprint, "deep": [deep.C10.hex(), deep.C20.hex(), deep.D2.hex()]}
    text = json.dumps(everything, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def finite_or_none(value: float) -> float | None:
    """Return a number that JSON knows."""
    return value if math.isfinite(value) else None
