"""One page of every kind, from results with known numbers.

``scripts/in-env env PYTHONPATH=.:tests python -m making_pages FOLDER`` writes them, and axe-core's
script, so that ``python3 tests/browser.py FOLDER/*.html`` looks at them where the browser is:
outside of legfem's environment.
"""

from __future__ import annotations

import math
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from browser import AXE
from making import press, write_recording, write_subject
from making_cohort import fabricated
from making_diagnosed import diagnosed
from making_doe import SpringLeg, definition
from making_legs_3d import round_leg
from making_mechanics import subject_3
from making_results import measured_curve, result
from making_specimens import write_bars
from making_stocking import COARSE, laws, short_leg, write_tape

from legfem.common.progress import Silent
from legfem.data import segment
from legfem.data.columns import propose
from legfem.data.formats import read_sheets
from legfem.data.quality import quality_of
from legfem.data.recording import recording_of
from legfem.experiments.indenter_pose import Cylinder, Pose
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.geometry.indenter import Site
from legfem.geometry.leg_shape import HULL, SKIN
from legfem.geometry.slices import calf_levels
from legfem.inverse.answer import Notice
from legfem.inverse.catalogue import parameter_of
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import EXACT, ChannelFit, Cost, Fit, Goodness, Identity
from legfem.inverse.outcome import Outcome
from legfem.inverse.plan import DesignValue
from legfem.inverse.trial import SearchLog
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store
from legfem.legs.details import Confirmation, LegState, PressedLeg, SpatialEvidence, seen
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.loading import load_subject
from legfem.legs.plan import Expected, designs
from legfem.legs.subject import Subject
from legfem.mechanics.materials import ReducedPolynomial
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.meshing.section import SectionMeshSettings
from legfem.report.cohort import cohort_web_page
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.diagnosis_document import versions
from legfem.report.instrument_file import Looked, look_web_page, recordings_toml
from legfem.report.kinds import page_of
from legfem.report.page import PressedSection, WebPage
from legfem.report.plan import plan_web_page
from legfem.report.pressed_section import Film, pressed_section
from legfem.report.render import rendered
from legfem.solve.path import ForceCurve
from legfem.specimens.details import RecordingFit, SpecimenDetails, SpecimenNotice
from legfem.specimens.folder import load_specimen
from legfem.specimens.model_discrepancy import LawMisfit
from legfem.specimens.sizes import LeftOut
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.details import StockingFit
from legfem.stockings.fabric import fitted_stocking
from legfem.stockings.identification import by_tape, identify_in_stocking
from legfem.stockings.leg import StockingLeg, default_veins
from legfem.stockings.loading import load_leg
from legfem.study.correction.calibration import Calibrated, Calibration
from legfem.study.correction.cases import CaseOutcome, CorrectionCase
from legfem.study.correction.command import correction_web_page
from legfem.study.doe.command import study_web_page
from legfem.study.doe.design import read_definition
from legfem.study.doe.runs import Workshop
from legfem.study.doe.study import StudyResult, study

COMMAND = "legfem identify --subject-dir 'my <leg>'"
DEPTH = 4.0
NO_MISFIT = LawMisfit(1e-3, np.zeros((3, 9)), 1, np.zeros((1, 1)))


def subject_in(folder: Path):
    return load_subject(write_subject(folder / "leg"), need_recordings=False)


def pressed(subject: Subject) -> PressedSection | None:
    """Press a subject's section on a coarse mesh."""
    coarse = PlaneStrainSettings(mesh=SectionMeshSettings(contact_size=3.0, far_size=12.0))
    film = Film(plane_strain_test(subject, coarse), DEPTH)
    solved = film.experiment.solve({}, DEPTH, on_step=film.take)
    return pressed_section(film, solved.curve.displacement, solved.curve.force, "A leg")


def identified(folder: Path) -> WebPage:
    subject, measured = subject_in(folder), measured_curve(depth=DEPTH)
    results = [result(law, measured, subject) for law in ("neo-hookean", "reduced-polynomial")]
    return page_of(results, pressed(subject), COMMAND)


def pressed_in_3d() -> PressedLeg:
    """A round leg, invented: the skin goes with the cylinder within its length, in proportion."""
    shape = seen(round_leg(n_points=60))
    touch = np.array([0.0, -66.0, shape.levels.mean()])
    indenter, pose = Cylinder(), Pose((0.0, 0.0), float(touch[2]), 90.0)
    direction = pose.direction
    skin = shape.points(SKIN)
    away = np.linalg.norm((skin - touch) / (12.0, 30.0, 20.0), axis=-1)
    share = np.exp(-(away**2))
    states = tuple(
        LegState(at, at * share[..., None] * direction, np.zeros_like(shape.points(HULL)), 3.0 * at * share**3)
        for at in (2.0, 5.0, 8.0)
    )
    d = np.linspace(0.0, 8.0, 17)
    return PressedLeg(shape, indenter, pose, touch, ForceCurve(d, 0.1 * d**2), states)


def identified_in_3d(folder: Path) -> WebPage:
    """With the leg in 3D, too."""
    confirmed = Confirmation(0.8e-3, 0.0, 60.0, 40, 0.002, 0.001)
    evidence = SpatialEvidence(
        "contours of one section, extruded", True, 120.0, (confirmed,), 1, 2, {"mesh": 0.01}, None, pressed_in_3d()
    )
    found = result("reduced-polynomial", measured_curve(depth=DEPTH), subject_in(folder), evidence)
    return page_of([found], None, COMMAND)


def diagnosis(folder: Path) -> WebPage:
    found, subject = diagnosed({"fascia-stiffness.factor": 4.0}), subject_in(folder)
    return diagnosis_web_page(found, subject, (), COMMAND, pressed=pressed(subject))


def ranked(chances: tuple[tuple[float, float], ...] = ((0.96, 0.1), (0.4, 0.05))) -> list[DesignValue]:
    """Tests that tell a stiff fascia and a gain with these chances."""
    return [
        DesignValue(design, {("fascia-stiffness", "nothing"): a, ("gain", "nothing"): b, ("nothing", "gain"): 0.5}, a)
        for design, (a, b) in zip(designs(20.0, 0.5, 30.0, Site(*subject_3()[:2])), chances, strict=False)
    ]


def planned(folder: Path) -> WebPage:
    expected = Expected(0.8e-3, 0.0, 20.0, 0.5)
    return plan_web_page(ranked(), subject_in(folder), expected, (), versions(), COMMAND)


def studied(folder: Path, **spring: object) -> StudyResult:
    """The paper's design on a leg of springs, without the emulator's stages."""
    text = definition(folder).read_text().replace("training = 30", "training = 0")
    given = read_definition(definition(folder, text))
    with Workers(SpringLeg.solve, SpringLeg(**spring), 1) as workers:
        store = Store(folder / "runs", Outcome, workers.context.fingerprint())
        workshop = Workshop(workers, store, Silent())
        return study(given, subject_in(folder), workshop, 1, True, lambda table: None)


def calibrated() -> Calibrated:
    """P = -0.2 + 0.01 d at 2 kPa, of curves that have it; 0.05 more at 5 kPa."""
    d = np.linspace(0.0, 20.0, 41)
    level = -0.2 + 0.01 * d
    plane = ForceCurve(d, d + 0.02 * d**3)
    spatial = ForceCurve(d, (1 - level) * (d + 0.02 * d**3))
    outcomes = tuple(
        CaseOutcome(spatial, plane, True, 20.0, unknowns, False, 50, 1.0, 1e-12) for unknowns in (4000, 3000, 2000)
    )
    correction = TabulatedCorrection(
        "idealised leg 120 mm long",
        d,
        np.array([2e-3, 5e-3]),
        np.array([0.0]),
        np.array([[level], [level + 0.05]]),
        {"mesh": np.full(41, 0.01)},
    )
    return Calibrated(Calibration(CorrectionCase(depth=20.0), (2.0, 5.0), (0.0,)), correction, outcomes)


def corrected(folder: Path) -> WebPage:
    found = calibrated()
    short = np.where(np.arange(41) < 30, -0.1, np.nan)
    lengths = {"30": short, "50": np.full(41, -0.2)}
    return correction_web_page(found, {"cylinder's length (mm)": lengths}, COMMAND)


def specimens(folder: Path, p_value: float = 0.4) -> list[Fit[SpecimenDetails]]:
    """Bars whose forces are met to a per cent by a law of 5 kPa."""
    given = load_specimen(write_bars(folder / "bars", ReducedPolynomial(5e-3, 1.0, 3e-3, np.inf)))
    found = Estimate(parameter_of("deep.C10", {}), 5e-3, 1e-4, (4.8e-3, 5.2e-3), "identifiable")
    goodness = Goodness(30.0, 28, p_value)
    tests = tuple(
        RecordingFit(
            one.name, (ChannelFit(one.data.channels[0], 1.01 * one.course.force),), goodness, k > 0, recording=one
        )
        for k, one in enumerate(given.recordings)
    )
    return [
        Fit(
            kind="specimens",
            subject=Identity(given.id, given.title, given.origin),
            law="neo-hookean",
            estimates={"deep.C10": found},
            correlations=np.eye(1),
            values={"deep.C10": 5e-3},
            assumed={"deep.D1": 1.0},
            goodness=goodness,
            cost=Cost(1.0, 30, math.nan, 0.99, "errors", 30.0, "1"),
            agreement=EXACT,
            tests=tests,
            log=SearchLog(
                names=("deep.C10",),
                converged=True,
                seed=1,
                wall_s=2.0,
                emulator_error=1e-3,
                forward_solves=9,
                factorisations=90,
            ),
            neo_hookean_limit=False,
            weighting="covariance",
            settings={},
            notices=(
                Notice.of(SpecimenNotice.NOT_USED, name="torn", reason="it <never> touched"),
                Notice.of(SpecimenNotice.NOT_MODELLED, name="other"),
            ),
            versions={"legfem": "1"},
            details=SpecimenDetails(given, (LeftOut("torn", "it <never> touched"),), 0.02, {}, 0.0, NO_MISFIT, ""),
        )
    ]


def stocking(mesh: SolidMeshSettings = COARSE) -> StockingFit:
    """A short leg of given stiffness in its stocking."""
    bare, tissues = short_leg(), laws(2.6, 6.0)
    slices = calf_levels(bare)
    leg = StockingLeg(
        "short",
        "60 mm of a leg",
        "simulated",
        bare,
        bare,
        None,
        None,
        fitted_stocking(bare, "2"),
        ContourAccuracy(),
        tissues,
        True,
        "held",
        slices,
        default_veins(bare, float(np.median(slices))),
    )
    return identify_in_stocking(leg, Silent(), mesh=mesh)


def dressed(folder: Path) -> WebPage:
    return page_of([stocking()], command=COMMAND)


def looked(folder: Path) -> WebPage:
    """A good recording, and one whose force was cut off at a limit."""
    good = press(air=3.0, hold=20.0, unload=True, force_sd=0.01, displacement_sd=0.005)
    cut = replace(good, force=np.minimum(good.force, 0.6 * good.force.max()))
    seen = []
    for name, one in (("good", good), ("saturated", cut)):
        path = write_recording(folder / f"{name}.csv", one)
        sheets = read_sheets(path)
        proposal = propose(path, sheets)
        read = recording_of(path, sheets, proposal.channels)
        seen.append(Looked(read, proposal, quality_of(segment(read))))
    return look_web_page(seen, recordings_toml(seen[0].proposal.channels), "the text", COMMAND)


PAGES = {
    "look": looked,
    "identification": identified,
    "identification-3d": identified_in_3d,
    "diagnosis": diagnosis,
    "plan": planned,
    "doe": lambda folder: study_web_page(studied(folder), 1, COMMAND),
    "correction": corrected,
    "specimen": lambda folder: page_of(specimens(folder), command=COMMAND),
    "stocking": dressed,
    "tape": lambda folder: page_of([by_tape(load_leg(write_tape(folder)))], command=COMMAND),
    "cohort": lambda folder: cohort_web_page(*fabricated(6), "identify", COMMAND),
}


def write_pages(folder: Path) -> dict[str, Path]:
    """Write every page; return where they are."""
    written = {}
    for name, made in PAGES.items():
        (folder / name).mkdir(parents=True, exist_ok=True)
        written[name] = folder / f"{name}.html"
        written[name].write_text(rendered(made(folder / name)), encoding="utf-8")
    return written


if __name__ == "__main__":
    import axe_core_python

    out = Path(sys.argv[1])
    write_pages(out)
    shutil.copy(Path(axe_core_python.__file__).with_name(AXE), out)
