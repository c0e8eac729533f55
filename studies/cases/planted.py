"""Planted truths, to see whether the 95 % intervals cover what made the data.

The data come from another discretisation than the one that inverts them (finer mesh, exponential
contact law, smaller steps), with the instruments' noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from legfem.common.contents import Contents
from legfem.common.documents import markdown_table
from legfem.common.errors import UnsolvedError
from legfem.common.units import kpa_to_mpa
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.inverse.fit import Fit
from legfem.inverse.outcome import JointForward
from legfem.inverse.settings import IdentificationSettings, SearchRequest
from legfem.legs.details import LegDetails
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.forward import PlaneStrainForward
from legfem.legs.identification import fit_leg
from legfem.legs.loading import load_subject
from legfem.legs.problem import pressed_depth
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject
from legfem.mechanics.contact import ContactSettings
from legfem.meshing.section import SectionMeshSettings
from legfem.solve.settings import StepSettings
from studies.cases.machine import Kind
from studies.cases.outcomes import Interval, Rate
from studies.making.recording import InstrumentNoise, record_path

C10_KPA = (0.1, 5.0)
C20_KPA = (0.0, 5.0)
DEPTH_MM = 25.0
RATE_MM_PER_S, SAMPLING_HZ, TRIALS = 0.4, 10.0, 3

TRUTH_SETTINGS = PlaneStrainSettings(
    mesh=SectionMeshSettings(0.85, 0.16, 5.0, 2.2),
    contact=ContactSettings(normal="exponential", stiffness=3000.0, onset=0.01),
    steps=StepSettings(first=0.1, largest=0.8),
    quadrature_degree=5,
)


@dataclass(frozen=True)
class PlantedTruth:
    """One planted case."""

    number: int
    subject: str
    """Whose section and instruments."""
    c10_kpa: float
    c20_kpa: float
    seed: int


@dataclass(frozen=True)
class Planted:
    """What identification made of a truth."""

    truth: PlantedTruth
    c10: Interval
    c20: Interval
    forward_solves: int


def planted_truths(number: int, seed: int) -> list[PlantedTruth]:
    """Return a Latin hypercube over C10 and C20, the subjects' sections in turn."""
    sampler = qmc.LatinHypercube(2, rng=np.random.default_rng(seed))
    low, high = zip(C10_KPA, C20_KPA, strict=True)
    subjects = SUBJECTS.names
    points = qmc.scale(sampler.random(number), low, high)
    return [
        PlantedTruth(k, subjects[k % len(subjects)], float(c10), float(c20), seed)
        for k, (c10, c20) in enumerate(points)
    ]


def identify_truth(folder: Path, truth: PlantedTruth) -> Planted:
    """Simulate, record and identify one truth.

    Raises
    ------
    RuntimeError
        If the simulation of the truth stops short.
    """
    subject = _recorded(truth)
    request = SearchRequest(settings=IdentificationSettings(seed=truth.seed))
    model = JointForward((_model(truth.subject, pressed_depth(subject, SearchRequest())),))
    (result,) = fit_leg(subject, ["reduced-polynomial"], request, forward=model)
    return _outcome(truth, result)


def _recorded(truth: PlantedTruth) -> Subject:
    subject = _subject(truth.subject)
    solved = _experiment(truth.subject).solve(
        {"deep.C10": kpa_to_mpa(truth.c10_kpa), "deep.C20": kpa_to_mpa(truth.c20_kpa)}, DEPTH_MM
    )
    if not solved.report.complete:
        raise UnsolvedError(f"{truth}: {solved.report.reason}")
    generator = np.random.default_rng([truth.seed, truth.number])
    noise = InstrumentNoise(subject.instrument)
    true = solved.path.displacement, solved.path.force
    trials = tuple(
        record_path(*true, RATE_MM_PER_S, SAMPLING_HZ, noise, generator, f"trial{trial}")
        for trial in range(1, TRIALS + 1)
    )
    return replace(subject, origin="simulated", recordings=trials)


@cache
def _subject(name: str) -> Subject:
    return load_subject(SUBJECTS.find(name), need_recordings=False)


@cache
def _experiment(name: str) -> PlaneStrainIndentation:
    return plane_strain_test(_subject(name), TRUTH_SETTINGS)


@cache
def _model(name: str, depth: float) -> PlaneStrainForward:
    return PlaneStrainForward.of_subject(_subject(name), depth)


def _outcome(truth: PlantedTruth, result: Fit[LegDetails]) -> Planted:
    c10, c20 = (Interval.of(result.estimates[name]) for name in ("deep.C10", "deep.C20"))
    return Planted(truth, c10, c20, result.log.forward_solves)


def page(found: Sequence[Planted]) -> str:
    """Return a row a truth, a star at an interval that misses, and how many hold."""
    header, rows, held = ["subject", "solves"], [[one.truth.subject, str(one.forward_solves)] for one in found], []
    for name in ("C10", "C20"):
        pairs = [(getattr(one, name.lower()), getattr(one.truth, f"{name.lower()}_kpa")) for one in found]
        header += [f"true {name}", name, "95 %"]
        for row, (one, true) in zip(rows, pairs, strict=True):
            row += [f"{true:.3f}", f"{one.value:.3f}", one.ends(true)]
        rate = Rate(sum(one.covers(true) for one, true in pairs), len(pairs))
        held.append(f"{name}: intervals hold {rate} of the truths.")
    return "\n".join(["Planted truths (kPa), simulated data.", "", markdown_table(header, rows), "", *held, ""])


def _line(truth: PlantedTruth, one: Planted) -> str:
    return f"C10 {truth.c10_kpa:.3f} -> {one.c10.value:.3f}, C20 {truth.c20_kpa:.3f} -> {one.c20.value:.3f} kPa"


def _asked(truth: PlantedTruth) -> object:
    """Return what an outcome depends on: the truth, and the leg it is planted in."""
    return truth, Contents(SUBJECTS.find(truth.subject))


KIND = Kind(
    "truths planted with another discretisation and noise",
    40,
    planted_truths,
    identify_truth,
    Planted,
    _line,
    page,
    asked=_asked,
)
