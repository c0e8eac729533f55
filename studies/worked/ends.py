"""A short cylinder on a leg in 3D, diagnosed with the same leg in plane strain."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from legfem.common.errors import UnsolvedError
from legfem.common.progress import Progress
from legfem.data import Recording, segment_all
from legfem.data.recording import Origin, write_recording
from legfem.experiments.leg_3d import IdealisedLegIndentation, IdealisedLegSettings
from legfem.inverse.body_models import Displaced, Stopped
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.library import Library
from legfem.inverse.library_build import build_library
from legfem.inverse.mechanism import Solution
from legfem.inverse.observations import Observations, observe
from legfem.inverse.responses import SolvedResponses
from legfem.jobs.store import Store, code_fingerprint
from legfem.legs.diagnosis import diagnose_body, shown_mechanisms, with_correction
from legfem.legs.nuisances import MATERIAL_LOG_SD
from legfem.mechanisms import Mechanism, TissueMechanism
from legfem.mechanisms.muscle import Compressibility, StrainStiffening
from legfem.meshing.structured import LegMeshSettings
from legfem.solve.path import ForceCurve
from legfem.solve.protocol import Protocol
from legfem.solve.settings import StepSettings
from legfem.specimens.mechanisms import mechanisms_on_a_rig
from legfem.study.correction.cases import CorrectionCase, Material
from studies.lab.recording import INSTRUMENT, Course, LabErrors, record
from studies.worked.example import ExampleRow, WorkedTruth, diagnosed

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import LateralPlacement
    from legfem.meshing.section import MeshMotion
    from legfem.solve.path import Path as SolvedPath

NOT_OFFERED: Mapping[str, str] = {
    "contact-slip": "the idealised leg's contact is rough: its skin never slips",
    "fascia-stiffness": "the idealised leg has no fascia",
    "superficial-stiffness": "the idealised leg has no fat",
    "fat-sliding": "the idealised leg has no fat",
    "superficial-stiffening": "the idealised leg has no fat",
    "prestress": "the idealised leg has no fascia",
    "dermis": "the idealised leg has no skin apart from its one tissue",
    "uneven-muscle": "the idealised leg is half a leg, mirrored: regions come in pairs",
    "indenter-tilt": "the idealised leg is half a leg, mirrored: it can't be pressed askew",
}
"""Mechanisms that this base model can't be given, and why."""
MECHANISMS = mechanisms_on_a_rig()
"""All that the diagnosis knows; one bone gives way as a rig does."""


@dataclass(eq=False)
class PlaneLegVariants:
    """The idealised leg's model in plane strain, elastic only, as `Variants` is for a section.

    Parameters
    ----------
    case
        Leg, cylinder, tissues and mesh.
    moved
        Where its mesh is moved to: it is known exactly, so that it can't be.
    """

    case: CorrectionCase
    moved: MeshMotion | None = None
    displaced: ClassVar[tuple[Displaced, ...]] = ()
    assumed: ClassVar[tuple[str, ...]] = ()

    def moved_to(self, moved: MeshMotion) -> PlaneLegVariants:
        """Return the leg with its mesh moved, which stops every solution."""
        return replace(self, moved=moved)

    def follow(
        self,
        protocol: Protocol,
        deep: Mapping[str, float],
        solution: Solution,
        sensitivities: Sequence[str] = (),
        placement: LateralPlacement | None = None,
    ) -> SolvedPath | Stopped:
        """Solve one loading at 1 mm/s; arguments are those of `Variants.follow`.

        It says why where it is asked about what this leg doesn't have or is known of it exactly.

        Raises
        ------
        ValueError
            For a mechanism or protocol that this model doesn't have.
        """
        if placement is not None or self.moved is not None:
            return Stopped("the idealised leg's geometry is known exactly")
        if set(sensitivities) & set(MATERIAL_LOG_SD):
            return Stopped("the idealised leg has one tissue, whose compressibility is known")
        depth = protocol.displacement[-1]
        if protocol != Protocol.ramp(depth, 1.0) or solution.variant not in ("elastic", "plain"):
            raise ValueError("the idealised leg in plane strain is elastic and is loaded once")
        if solution.parameters or solution.tilt_deg:
            raise ValueError(f"the idealised leg has no {solution}")
        solved = self.model.solve(solution.values(deep, self.model.parameters), depth, sensitivities)
        return solved.path if solved.report.complete else Stopped(str(solved.report))

    def parameters(self, variant: str) -> dict[str, float]:
        """Return the model's parameters by full name; none of tissues that it lacks."""
        return {**dict.fromkeys(MATERIAL_LOG_SD, 0.0), **self.model.parameters}

    def described(self, variant: str) -> str:
        """Return what tells a model from others."""
        return variant

    @cached_property
    def model(self) -> IdealisedLegIndentation:
        """The experiment; meshed and compiled when first needed."""
        case = self.case
        return IdealisedLegIndentation(case.leg, case.cylinder, case.material.laws, 2, case.settings)


def plane_responses(case: CorrectionCase, folder: Path | None) -> SolvedResponses:
    """Return the base model's responses; solutions are kept in a folder."""
    fingerprint = {
        "model": "idealised leg in plane strain",
        "case": asdict(case),
        "code": code_fingerprint("legfem.experiments.leg_3d"),
    }
    variants = PlaneLegVariants(case)
    return SolvedResponses(variants, case.depth, folder, fingerprint)


def offered(observed: Observations, correction: TabulatedCorrection) -> tuple[list[Mechanism], dict[str, str]]:
    """Return the mechanisms that are tabulated, and those that this model can't be given.

    A neo-Hookean base model's strain stiffening is its C20, which the elastic table has.
    """
    able, _ = shown_mechanisms(observed, correction, every=MECHANISMS)
    missing = {m.name: NOT_OFFERED[m.name] for m in able if m.name in NOT_OFFERED}
    tabulated = [m for m in able if isinstance(m, Compressibility)]
    unknown = [
        m.name
        for m in able
        if isinstance(m, TissueMechanism)
        and not isinstance(m, Compressibility | StrainStiffening)
        and m.name not in missing
    ]
    return list(tabulated), missing | dict.fromkeys(unknown, "this base model knows no time")


def plane_library(
    solved: SolvedResponses, observed: Observations, correction: TabulatedCorrection, jobs: int, progress: Progress
) -> Library:
    """Return the base model's library for recordings."""
    tabulated, missing = offered(observed, correction)
    library = build_library(solved, solved, observed, tabulated, jobs, progress)
    return replace(library, missing={**library.missing, **missing})


C10_KPA = 1.4
DEPTH_MM, RATE_MM_PER_S, TRIALS, NOISE_SEED = 19.0, 0.4, 3, 2027
ERRORS = LabErrors(gain_sd=0.01, air=2.0)
SPATIAL = CorrectionCase(
    material=Material(C10_kPa=C10_KPA),
    settings=IdealisedLegSettings(
        mesh=LegMeshSettings(contact_size=2.5, edge_size=3.5, growth=0.4, far_size=18.0),
        steps=StepSettings(largest=0.75),
    ),
    depth=DEPTH_MM + 0.5,
)
"""The correction's reference leg on another mesh, of another stiffness."""
PLANE = CorrectionCase(depth=20.0)
"""The base model: the correction's reference leg on the default mesh."""
TRUTH = WorkedTruth(
    C10_KPA,
    0.0,
    "end-effects",
    "3D, quadratic hexahedra of 2.5 mm around the leg and 3.5 mm along it at the cylinder's end "
    "(the correction: 3 and 2.5 mm), steps of half the size",
)


@dataclass(frozen=True)
class Leg:
    """Whose recordings they are."""

    id: str = "idealised-leg"
    title: str = "Idealised round leg in 3D under a cylinder of 50 mm"
    origin: Origin = "simulated"


def spatial_curve(folder: Path) -> ForceCurve:
    """Return the leg's force in 3D; solved once and kept in a folder.

    Raises
    ------
    UnsolvedError
        If the solution stops short of the depth.
    """
    return Store(folder, ForceCurve, modules=(__name__,)).get_or_make(SPATIAL.asked, _solved)


def _solved() -> ForceCurve:
    given = SPATIAL
    model = IdealisedLegIndentation(given.leg, given.cylinder, given.material.laws, 3, given.settings)
    solved = model.solve(depth=given.depth)
    if not solved.report.complete:
        raise UnsolvedError(f"end effects in 3D: {solved.report.reason}")
    return solved.curve


def recorded(curve: ForceCurve) -> list[Recording]:
    """Return three slow loadings with errors of a lab."""
    time = np.linspace(0.0, DEPTH_MM / RATE_MM_PER_S, 476)
    course = Course(time, RATE_MM_PER_S * time, curve(RATE_MM_PER_S * time))
    return record([course] * TRIALS, ERRORS, np.random.default_rng(NOISE_SEED))


def run_ends(out: Path, library: Path, correction: TabulatedCorrection, jobs: int, progress: Progress) -> ExampleRow:
    """Simulate in 3D, record and diagnose in plane strain; files go to ``out``."""
    progress.stage("solving the idealised leg in 3D", 1)
    curve = spatial_curve(library / "truth")
    progress.advance(f"{curve.force[-1]:.2f} N at {curve.depth:g} mm")
    recordings = recorded(curve)
    (out / "recordings").mkdir(parents=True, exist_ok=True)
    for recording in recordings:
        write_recording(recording, out / "recordings" / f"{recording.trial}.csv")
    observed = observe(segment_all(recordings, INSTRUMENT))
    solved = plane_responses(PLANE, library)
    tables = plane_library(solved, observed, correction, jobs, progress)
    return diagnosed(
        "end effects, three slow loadings",
        TRUTH,
        Leg(),
        lambda: diagnose_body(
            observed, INSTRUMENT, "neo-hookean", tables, solved, progress, every=with_correction(MECHANISMS, correction)
        ),
        out,
    )
