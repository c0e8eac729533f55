"""A short cylinder on a leg in 3D, diagnosed with the same leg in plane strain."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from legfem.correction import TabulatedCorrection
from legfem.curve import ForceCurve
from legfem.diagnose.diagnosis import diagnose
from legfem.diagnose.observations import observe
from legfem.documents import write_document
from legfem.errors import InputError
from legfem.experiments.indentation_3d import IdealisedLegIndentation, IdealisedLegSettings
from legfem.meshing.idealised_leg import LegMeshSettings
from legfem.progress import Progress
from legfem.recording import Recording
from legfem.recording.writer import write_recording
from legfem.stepping import StepSettings
from legfem.study.concealed.cases import DEPTH_MM, INSTRUMENT, protocols_of
from legfem.study.concealed.cases import Case as Recorded
from legfem.study.concealed.truth import Truth as Forces
from legfem.study.concealed.truth import blank_observations, record
from legfem.study.correction_cases import Case, Material
from legfem.study.worked.example import Row, Truth, diagnosed
from legfem.study.worked.plane_leg import plane_library, plane_responses
from legfem.subject import Origin

C10_KPA = 1.4
NOISE_SEED = 2027
SPATIAL = Case(
    material=Material(C10_kPa=C10_KPA),
    settings=IdealisedLegSettings(
        mesh=LegMeshSettings(contact_size=2.5, edge_size=3.5, growth=0.4, far_size=18.0),
        steps=StepSettings(largest=0.75),
    ),
    depth=DEPTH_MM + 0.5,
)
"""The correction's reference leg on another mesh, of another stiffness."""
PLANE = Case(depth=20.0)
"""The base model: the correction's reference leg on the default mesh."""
TRUTH = Truth(
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
    InputError
        If the solution stops short of the depth.
    """
    path = folder / f"{SPATIAL.key}.json"
    if path.is_file():
        known = json.loads(path.read_text(encoding="utf-8"))
        return ForceCurve(np.array(known["displacement_mm"]), np.array(known["force_N"]))
    given = SPATIAL
    model = IdealisedLegIndentation(given.leg, given.cylinder, given.material.laws, 3,
                                    given.settings)  # fmt: skip
    solved = model.solve(depth=given.depth)
    if not solved.report.complete:
        raise InputError("end effects", "3D", str(solved.report), "give the truth a finer mesh")
    curve = solved.curve
    write_document(
        path,
        {
            "case": asdict(given),
            "origin": "simulated",
            "displacement_mm": curve.displacement.tolist(),
            "force_N": curve.force.tolist(),
            "unknowns": solved.report.unknowns,
            "seconds": solved.report.seconds,
        },
    )
    return curve


def recorded(curve: ForceCurve) -> list[Recording]:
    """Return three slow loadings with errors of the instruments."""
    blank = blank_observations(protocols_of("ramps"))
    case = Recorded(0, "single", "idealised", "neo-hookean", "ramps", C10_KPA, 0.0, (), (),
                    NOISE_SEED)  # fmt: skip
    return record(Forces(blank, curve(blank.displacement)), case)


def run_ends(
    out: Path,
    library: Path,
    correction: TabulatedCorrection,
    jobs: int,
    progress: Progress,
) -> Row:
    """Simulate in 3D, record and diagnose in plane strain; files go to ``out``."""
    progress.stage("solving the idealised leg in 3D", 1)
    curve = spatial_curve(library / "truth")
    progress.advance(f"{curve.force[-1]:.2f} N at {curve.depth:g} mm")
    recordings = recorded(curve)
    (out / "recordings").mkdir(parents=True, exist_ok=True)
    for recording in recordings:
        write_recording(recording, out / "recordings" / f"{recording.trial}.csv")
    observed = observe(recordings, INSTRUMENT, True)
    solved = plane_responses(PLANE, library, correction)
    tables = plane_library(solved, observed, correction, jobs, progress)
    return diagnosed(
        "end effects, three slow loadings",
        TRUTH,
        Leg(),
        lambda: diagnose(observed, INSTRUMENT, "neo-hookean", tables, solved, progress),
        out,
    )
