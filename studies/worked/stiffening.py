"""A leg that stiffens with strain, diagnosed with a neo-Hookean base model."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from legfem.common.errors import UnsolvedError
from legfem.common.progress import Progress
from legfem.common.units import kpa_to_mpa
from legfem.inverse.body_models import Stopped
from legfem.inverse.correction import TabulatedCorrection
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.finite_element_models import LegVariants, tissues_of
from legfem.legs.folder import write_subject_folder
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.mechanisms import Solution
from legfem.solve.protocol import Protocol
from studies.concealed.cases import DEPTH_MM, FAST, HOLD_S, SLOW, TRIALS, ProtocolName, with_deep_law
from studies.concealed.truth import TRUTH_SETTINGS
from studies.lab.recording import INSTRUMENT, SAMPLING_HZ, Course, LabErrors, record
from studies.worked.example import ExampleRow, WorkedTruth, diagnosed

C10_KPA, C20_KPA = 0.82, 2.61
"""Identified for subject 1 in the first paper's Table 5."""
SUBJECT = "1"
NOISE_SEED = 2026
ERRORS = LabErrors(gain_sd=0.01, air=2.0)
TRUTH = WorkedTruth(
    C10_KPA,
    C20_KPA,
    "strain-stiffening",
    "plane strain, finer mesh, exponential contact, smaller steps, another quadrature",
)
_PROTOCOLS: dict[ProtocolName, str] = {
    "ramps": "three slow loadings",
    "holds": "loading, a hold and unloading, three times",
}


def protocol_named(name: ProtocolName) -> Protocol:
    """Return how a trial is driven from first touch on."""
    if name == "ramps":
        return Protocol.ramp(DEPTH_MM, SLOW)
    return Protocol.cycle(DEPTH_MM, FAST, HOLD_S)


def make_recordings(name: ProtocolName, folder: Path) -> Path:
    """Simulate the leg, record it as a lab does, and write the subject folder anew.

    Raises
    ------
    UnsolvedError
        If the solution stops short.
    """
    leg = load_subject(SUBJECTS.find(SUBJECT), need_recordings=False)
    leg = with_deep_law(leg, "neo-hookean")
    deep = {"deep.C10": kpa_to_mpa(C10_KPA), "deep.C20": kpa_to_mpa(C20_KPA)}
    model = LegVariants(leg.section, leg.indenter, tissues_of(leg), TRUTH_SETTINGS)
    path = model.follow(Protocol.ramp(DEPTH_MM, 1.0), deep, Solution())
    if isinstance(path, Stopped):
        raise UnsolvedError(f"strain stiffening: {path.why}")
    protocol = protocol_named(name)
    time = np.arange(0.0, protocol.duration + 1e-9, 1 / SAMPLING_HZ)
    d = protocol.displacement_at(time)
    trials = [Course(time, d, path.force_at(d))] * TRIALS
    shutil.rmtree(folder, ignore_errors=True)
    return write_subject_folder(
        leg.section,
        folder,
        f"Subject {SUBJECT}'s leg stiffening with strain, {_PROTOCOLS[name]}",
        leg.indenter.aim,
        leg.indenter.direction_deg,
        origin="simulated",
        recordings=record(trials, ERRORS, np.random.default_rng(NOISE_SEED)),
        instrument=INSTRUMENT,
        deep_law="neo-hookean",
    )


def run_stiffening(
    protocol: ProtocolName, out: Path, library: Path, correction: TabulatedCorrection, jobs: int, progress: Progress
) -> ExampleRow:
    """Simulate, record and diagnose; files go to ``out``, the subject folder into it."""
    progress.stage("simulating a leg that stiffens with strain", 1)
    folder = make_recordings(protocol, out / "stiffening-leg")
    progress.advance(str(folder))
    subject = load_subject(folder)
    diagnoser = Diagnoser(library, correction, jobs)
    name = f"strain stiffening, {_PROTOCOLS[protocol]}"
    return diagnosed(name, TRUTH, subject, lambda: diagnoser.diagnose(subject, progress), out)
