"""A short cylinder on a leg in 3D, diagnosed with the same leg in plane strain."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from legfem.common.errors import UnsolvedError
from legfem.common.progress import Progress
from legfem.data import Recording, segment_all
from legfem.data.recording import Origin, write_recording
from legfem.experiments.indentation_3d import IdealisedLegIndentation, IdealisedLegSettings
from legfem.inverse.observations import observe
from legfem.jobs.store import Store
from legfem.legs.correction import TabulatedCorrection
from legfem.legs.diagnosis import diagnose_body, with_correction
from legfem.meshing.idealised_leg import LegMeshSettings
from legfem.solve.path import ForceCurve
from legfem.solve.settings import StepSettings
from legfem.study.correction.cases import CorrectionCase, Material
from studies.lab.recording import INSTRUMENT, Course, LabErrors, record
from studies.worked.example import ExampleRow, WorkedTruth, diagnosed
from studies.worked.plane_leg import MECHANISMS, plane_library, plane_responses

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
