"""A leg that stiffens with strain, diagnosed with a neo-Hookean base model."""

from __future__ import annotations

import shutil
from pathlib import Path

from legfem.correction import TabulatedCorrection
from legfem.diagnose.run import Diagnoser
from legfem.geometry.subject_folder import write_subject_folder
from legfem.progress import Progress
from legfem.study.concealed.cases import DEPTH_MM, INSTRUMENT, Case, ProtocolName
from legfem.study.concealed.making import with_deep_law
from legfem.study.concealed.truth import record, simulate, truth_responses
from legfem.study.worked.example import Row, Truth, diagnosed
from legfem.subject import SUBJECTS, load_subject

C10_KPA, C20_KPA = 0.82, 2.61
"""Identified for subject 1 in the first paper's Table 5."""
SUBJECT = "1"
NOISE_SEED = 2026
TRUTH = Truth(
    C10_KPA,
    C20_KPA,
    "strain-stiffening",
    "plane strain, finer mesh, exponential contact, smaller steps, another quadrature",
)
_PROTOCOLS: dict[ProtocolName, str] = {
    "ramps": "three slow loadings",
    "rates": "two rates with holds and unloading, three times each",
}


def stiffening_case(protocol: ProtocolName) -> Case:
    """Return the case of a protocol: the base model has C10 alone, and C20 is concealed."""
    return Case(
        0,
        "single",
        SUBJECT,
        "neo-hookean",
        protocol,
        C10_KPA,
        0.0,
        ((TRUTH.effect, (("coefficient", C20_KPA),)),),
        (),
        NOISE_SEED,
    )


def make_recordings(
    case: Case, folder: Path, library: Path, correction: TabulatedCorrection
) -> Path:
    """Simulate a case, record it with noise, and write the subject folder anew."""
    leg = load_subject(SUBJECTS.find(case.subject), need_recordings=False)
    leg = with_deep_law(leg, case.law)
    responses = truth_responses(leg, DEPTH_MM, library / "truth", correction)
    recordings = record(simulate(case, responses, case.law), case)
    shutil.rmtree(folder, ignore_errors=True)
    return write_subject_folder(
        leg.section,
        folder,
        f"Subject {case.subject}'s leg stiffening with strain, {_PROTOCOLS[case.protocol]}",
        leg.indenter.aim,
        leg.indenter.direction_deg,
        origin="simulated",
        recordings=recordings,
        starts_at_contact=True,
        instrument=INSTRUMENT,
        deep_law=case.law,
    )


def run_stiffening(
    protocol: ProtocolName,
    out: Path,
    library: Path,
    correction: TabulatedCorrection,
    jobs: int,
    progress: Progress,
) -> Row:
    """Simulate, record and diagnose; files go to ``out``, the subject folder into it."""
    progress.stage("simulating a leg that stiffens with strain", 1)
    folder = make_recordings(stiffening_case(protocol), out / "stiffening-leg", library, correction)
    progress.advance(str(folder))
    subject = load_subject(folder)
    diagnoser = Diagnoser(library, correction, jobs)
    name = f"strain stiffening, {_PROTOCOLS[protocol]}"
    return diagnosed(name, TRUTH, subject, lambda: diagnoser.diagnose(subject, progress), out)
