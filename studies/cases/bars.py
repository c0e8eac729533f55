"""Bars of planted fibrous tissue, recorded by a lab, and identified from one direction or two."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np

from legfem.common.documents import markdown_table
from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.data import write_recording
from legfem.inverse.fibre_ratio import ratio_of
from legfem.inverse.intervals import VERDICTS, Identifiability
from legfem.specimens.details import SpecimenNotice
from legfem.specimens.folder import load_specimen
from legfem.specimens.kind import Direction
from legfem.specimens.laws import ONE
from legfem.specimens.problem import fit_specimens
from studies.cases.machine import Kind
from studies.cases.outcomes import Interval, Rate
from studies.making.pressing import OtherMuscle, pulled_bar
from studies.making.recording import INSTRUMENT, Course, LabErrors, record
from studies.making.stated import GAINS

RATIOS = (1.0, 2.0, 3.0)
C10_KPA, STIFFENING = (2.0, 8.0), 0.4
"""C10 is drawn between, evenly in its logarithm; C20 is a share of it."""
LENGTH, WIDTH, STRAIN, TRIALS = 60.0, 30.0, 0.25, 3
"""Of the bars (mm), to which they are pulled, and recordings of each."""
APART = 0.15
"""Of pieces of one tissue: standard deviation of the logarithm of their stiffness."""
_RATE, _POINTS = 1.0, 41
_AXES: dict[Direction, tuple[float, float, float]] = {"load": (1.0, 0.0, 0.0), "across": (0.0, 1.0, 0.0)}


@dataclass(frozen=True)
class Setup:
    """What a lab does with a tissue.

    Parameters
    ----------
    title
        In words.
    directions
        Of the fibres in the bars.
    each
        Bars of each direction; more than one are of pieces that differ in stiffness.
    """

    title: str
    directions: tuple[Direction, ...]
    each: int = 1


SETUPS = (
    Setup("one bar along", ("load",)),
    Setup("one bar across", ("across",)),
    Setup("one of each, of one piece", ("load", "across")),
    Setup("three of each, of pieces that differ", ("load", "across"), 3),
)


@dataclass(frozen=True)
class Plant:
    """A tissue."""

    number: int
    ratio: float
    c10_kpa: float
    seed: int


@dataclass(frozen=True)
class Found:
    """What was found of a parameter, and the word for it."""

    interval: Interval
    word: Identifiability


@dataclass(frozen=True)
class Outcome:
    """What was found of a tissue, by the setup's title."""

    plant: Plant
    c10: dict[str, Found]
    """kPa."""
    ratio: dict[str, Found]
    warned: dict[str, bool]
    """Whether the report warns that the ratio can't be told."""
    converged: dict[str, bool]


def plants(number: int, seed: int) -> list[Plant]:
    """Return tissues, the ratios in turn."""
    low, high = np.log(C10_KPA)
    drawn = np.random.default_rng(seed).uniform(low, high, number)
    return [Plant(k, RATIOS[k % len(RATIOS)], float(np.exp(one)), 1000 * seed + k) for k, one in enumerate(drawn)]


def identified(folder: Path, plant: Plant) -> Outcome:
    """Record and identify a tissue in every setup."""
    c10, ratio = dict[str, Found](), dict[str, Found]()
    warned, converged = dict[str, bool](), dict[str, bool]()
    for number, setup in enumerate(SETUPS):
        where = folder / f"tissue{plant.number}" / f"setup{number}"
        write_folder(where, plant, setup, np.random.default_rng([plant.seed, number]))
        (result,) = fit_specimens(load_specimen(where), ["reduced-polynomial"])
        estimates = [result.estimates[name] for name in (f"{ONE}.C10", ratio_of(ONE))]
        for known, one in zip((c10, ratio), estimates, strict=True):
            known[setup.title] = Found(Interval.of(one), one.identifiability)
        warned[setup.title] = any(one.code == SpecimenNotice.RATIO_UNDETERMINED for one in result.notices)
        converged[setup.title] = result.log.converged
    return Outcome(plant, c10, ratio, warned, converged)


def write_folder(folder: Path, plant: Plant, setup: Setup, generator: np.random.Generator) -> None:
    """Write a specimen folder of a setup, with a lab's errors."""
    errors = LabErrors(gain_sd=float(np.exp(generator.uniform(*np.log(GAINS)))), heavy=bool(generator.random() < 0.5))
    text = (
        f'id = "tissue{plant.number}"\ntitle = "Bars of planted fibrous tissue"\n'
        f'origin = "simulated"\n[uniaxial]\ndirection = "tension"\nlength_mm = {LENGTH}\n'
        f"area_mm2 = {WIDTH**2}\n[fibres]\n[instrument]\nforce_sd_N = {INSTRUMENT.force_sd}\n"
        f"displacement_sd_mm = {INSTRUMENT.displacement_sd}\n"
        f"[tissue]\none_stiffness = {str(setup.each == 1).lower()}\n"
        "[recordings]\nstarts_at_contact = true\n"
    )
    for direction in setup.directions:
        for piece in range(setup.each):
            factor = np.exp(APART * generator.normal()) if setup.each > 1 else 1.0
            name = f"{direction}{piece}"
            force = factor * plant.c10_kpa * _unit_force(plant.ratio, direction)
            course = Course(_way() / _RATE, _way(), force)
            (folder / name).mkdir(parents=True, exist_ok=True)
            for one in record([course] * TRIALS, errors, generator):
                write_recording(one, folder / name / f"{one.trial}.csv")
            text += f'[[specimen]]\nname = "{name}"\nfibres = "{direction}"\nrecordings = ["{name}/*.csv"]\n'
    (folder / "specimen.toml").write_text(text)


def _way() -> FloatArray:
    return np.linspace(0.0, STRAIN * LENGTH, _POINTS)


@cache
def _unit_force(ratio: float, direction: Direction) -> FloatArray:
    """Return the force (N) on a bar of C10 1 kPa, to which it is in proportion."""
    c10 = kpa_to_mpa(1.0)
    muscle = OtherMuscle.of_ratio(c10, STIFFENING * c10, ratio, _AXES[direction])
    return WIDTH**2 * pulled_bar(muscle, 1 + _way() / LENGTH)


def page(found: Sequence[Outcome]) -> str:
    """Return the tables of what is covered and what is told, by setup and ratio."""
    return "\n".join([_table(found, "C10"), "", _table(found, "ratio"), "", "Simulated data.", ""])


def _table(found: Sequence[Outcome], name: Literal["C10", "ratio"]) -> str:
    rows = []
    for setup in SETUPS:
        for ratio in (None, *RATIOS):
            chosen = [one for one in found if ratio in (None, one.plant.ratio)]
            if not chosen:
                continue
            pairs = [_beside_truth(one, setup, name) for one in chosen]
            covers = sum(one.interval.covers(true) for one, true in pairs)
            half = [0.5 * one.interval.width / true for one, true in pairs]
            words = [one.word for one, _ in pairs]
            warned = sum(one.warned[setup.title] for one in chosen)
            first = [setup.title, "all"] if ratio is None else ["", f"{ratio:g}"]
            counts = "/".join(str(words.count(word)) for word in VERDICTS), f"{warned}/{len(chosen)}"
            rows.append([*first, str(Rate(covers, len(pairs))), f"{np.median(half):.2f}", *counts])
    held = f"{name}'s interval holds the truth"
    head = ["bars", "planted ratio", held, "half its width", "/".join(VERDICTS), "warned"]
    return markdown_table(head, rows)


def _beside_truth(one: Outcome, setup: Setup, name: Literal["C10", "ratio"]) -> tuple[Found, float]:
    found, true = (one.c10, one.plant.c10_kpa) if name == "C10" else (one.ratio, one.plant.ratio)
    return found[setup.title], true


def _line(plant: Plant, one: Outcome) -> str:
    last = SETUPS[-2].title
    c10, ratio = one.c10[last].interval, one.ratio[last].interval
    return (
        f"tissue {plant.number}: C10 {plant.c10_kpa:.2f} -> {c10.value:.2f} kPa, ratio "
        f"{plant.ratio:g} -> {ratio.value:.2f}"
    )


_TITLE = "planted fibrous tissues, from bars along the fibres, across, and both"
KIND = Kind(_TITLE, 30, plants, identified, Outcome, _line, page)
