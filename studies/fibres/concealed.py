"""Fibres concealed in recordings of a leg in 3D, and what a diagnosis without them calls it.

The truth is solved on another mesh than the table of fibres and the correction, on legs of other
sizes and stiffnesses, without fat and fascia (where fibres count a quarter more than the table
says); a lab's errors are of other shapes than the diagnosis assumes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from legfem.common.progress import Progress, Silent
from legfem.data import segment_all
from legfem.experiments.leg_3d import IdealisedLegIndentation
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.correction import read_correction
from legfem.inverse.diagnose import DiagnosisInput, diagnose
from legfem.inverse.fit import Identity
from legfem.inverse.observations import observe
from legfem.inverse.verdict import Diagnosis
from legfem.jobs.store import Store
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import WITHOUT_ENDS, with_correction
from legfem.legs.nuisances import ShapeAccuracy
from legfem.mechanisms import OCCURRENCES
from legfem.mechanisms.muscle import MuscleFibres
from legfem.mechanisms.rig import EndEffects
from legfem.meshing.structured import IdealisedLeg, LegMeshSettings
from legfem.solve.path import ForceCurve
from legfem.study.correction.cases import CorrectionCase, Material
from studies.fibres.plane_base import DEPTH_MM, MECHANISMS, PLANE, RATE_MM_PER_S, TRIALS, plane_library, plane_responses
from studies.leg3d.planted import whole_curve
from studies.making.recording import INSTRUMENT, LabErrors, loading, record

MESH = LegMeshSettings(contact_size=4.5, depth_size=9, edge_size=5, growth=0.45, far_size=24)
SEED, GAIN_SD, AIR_MM = 2026, 0.01, 2.0
_TRUTHS = ((3.0, 1.4, 59.0), (2.2, 0.9, 55.0), (4.5, 1.0, 60.0), (2.0, 1.6, 57.0), (3.5, 0.7, 56.0))


@dataclass(frozen=True)
class Concealed:
    """One leg with fibres, and how it was recorded."""

    ratio: float
    c10_kPa: float
    radius_mm: float
    in_air: bool
    """Whether recordings begin before first touch, which is then looked for."""

    @property
    def case(self) -> CorrectionCase:
        """What is solved in 3D."""
        return replace(
            PLANE,
            leg=IdealisedLeg(radius=self.radius_mm),
            material=Material(C10_kPa=self.c10_kPa, fibre_ratio=self.ratio),
            settings=replace(PLANE.settings, mesh=MESH),
        )


_RATIOS, _C10 = np.log((1.2, 4.5)), np.log((0.5, 1.8))
CASES = tuple(Concealed(*truth, in_air) for in_air in (False, True) for truth in _TRUTHS)


def drawn_cases(seed: int) -> tuple[Concealed, ...]:
    """Return as many cases of other legs: ratios of 1.2 to 4.5, some as in relaxed calves, C10 of 0.5 to 1.8 kPa."""
    draw = np.random.default_rng([seed, 7]).uniform
    truths = [(float(np.exp(draw(*_RATIOS))), float(np.exp(draw(*_C10))), float(draw(54, 62))) for _ in _TRUTHS]
    return tuple(Concealed(*truth, in_air) for in_air in (False, True) for truth in truths)


def diagnosed(given: Concealed, number: int, folder: Path, jobs: int, progress: Progress) -> dict[bool, Diagnosis]:
    """Return the diagnoses by base models with the cylinder's ends, and without.

    Parameters
    ----------
    given
        What was concealed.
    number
        Of the case, for the noise.
    folder
        Keeps solutions.
    jobs
        Processes.
    progress
        Told of the truth's solution.
    """
    curve = Store(folder / "truths", ForceCurve, modules=(__name__,)).get_or_make(
        given.case.asked, lambda: _solved(given.case)
    )
    progress.advance(f"ratio {given.ratio:.2g}, {curve.force[-1]:.1f} N at {curve.depth:g} mm")
    course = loading(curve, DEPTH_MM, RATE_MM_PER_S)
    errors = LabErrors(gain_sd=GAIN_SD, air=AIR_MM if given.in_air else 0.0)
    recordings = record([course] * TRIALS, errors, np.random.default_rng(SEED + number))
    observed = observe(segment_all(recordings, INSTRUMENT, not given.in_air))
    correction = read_correction(REFERENCE)
    solved = plane_responses(PLANE, folder / "responses")
    tables = plane_library(solved, observed, correction, jobs, Silent())
    with_ends = {EndEffects.name: "the base model has the cylinder's ends"}
    return {
        ends: diagnose(
            DiagnosisInput(
                observed,
                INSTRUMENT,
                "neo-hookean",
                tables,
                with_correction(MECHANISMS, correction),
                Identity("calf", "An idealised calf", "simulated"),
                "leg",
                accuracy=ShapeAccuracy(bones=()),
                ends=correction if ends else None,
                ruled_out=with_ends if ends else WITHOUT_ENDS,
                possible=OCCURRENCES,
            ),
            solved,
            Silent(),
        )
        for ends in (True, False)
    }


def cells(given: Concealed, found: dict[bool, Diagnosis]) -> list[str]:
    """Return a row of the table: the truth, and what both base models' diagnoses list."""
    ends = found[True]
    ratio = next(
        (f"{m.fit.values[f'{MuscleFibres.name}.ratio']:.2g}" for m in ends.models if m.names == (MuscleFibres.name,)),
        "-",
    )
    low, high = ends.shown_interval(DEEP_C10)
    return [
        f"{given.ratio:.2g}",
        f"{given.c10_kPa:.3g}",
        "in air" if given.in_air else "at touch",
        _told(ends),
        ratio,
        f"{low:.2f} to {high:.2f}",
        _told(found[False]),
    ]


HEADER = (
    "ratio",
    "C10 (kPa)",
    "recorded",
    "with the ends: verdict, listed",
    "ratio found",
    "C10's interval (kPa)",
    "without the ends: verdict, listed",
)


def score(every: Sequence[tuple[Concealed, dict[bool, Diagnosis]]]) -> str:
    """Return in how many cases fibres, or the ends, are listed, and C10's interval holds it."""
    with_ends = sum(_lists(found[True], MuscleFibres.name) for _, found in every)
    without = sum(_lists(found[False], EndEffects.name) for _, found in every)
    ends = [found[True].shown_interval(DEEP_C10) for _, found in every]
    held = sum(low < given.c10_kPa < high for (given, _), (low, high) in zip(every, ends, strict=True))
    return (
        f"of {len(every)}: fibres listed by the base model with ends in {with_ends}, end effects "
        f"by that without in {without}; C10's interval with ends holds the truth in {held}"
    )


def _lists(found: Diagnosis, name: str) -> bool:
    return any(name in model.names for model in found.models)


def _told(found: Diagnosis) -> str:
    listed = ", ".join(f"{' + '.join(model.names)} {model.probability:.2f}" for model in found.models)
    return f"{found.verdict}: {listed}" if listed else str(found.verdict)


def _solved(case: CorrectionCase) -> ForceCurve:
    given = case.material
    model = IdealisedLegIndentation(case.leg, case.cylinder, given.laws, 3, case.settings, mechanisms=given.mechanisms)
    return whole_curve(model, case.depth, f"fibres of ratio {given.fibre_ratio:g}")
