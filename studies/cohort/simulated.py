"""``python -m studies.cohort.simulated``: people of known stiffness, recorded as a lab does, and what goes wrong.

Eight shapes of calves stand for all legs, four of them pressed by felupe and four by finer elements with another
contact law; a leg's curve lies between those of seven stiffnesses. The lab knows each leg's outlines and fat: what is
tested is recordings, visits, people and rigs.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path
from typing import Annotated

import numpy as np
import pandas as pd
import typer
from scipy.interpolate import CubicSpline

from legfem.common.command_line import study_context
from legfem.common.documents import write_atomically
from legfem.common.progress import Progress, progress_on
from legfem.common.units import FloatArray
from legfem.data import Recording
from legfem.geometry.section import LegSection
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.legs.folder import write_subject_folder
from legfem.legs.loading import load_subject
from legfem.legs.typical import Calf, calf_section
from studies.cases.truth import FINE
from studies.command_line import DONE_IS_KEPT, Jobs, Out, Seed, new_app
from studies.making.plane_leg import Lump, OtherCase
from studies.making.pressed_legs import true_force
from studies.making.recording import INSTRUMENT, LabErrors, loading, record

app = new_app()
SHAPES, DEPTH_MM, RATE_MM_PER_S, TRIALS = 8, 14.0, 0.5, 3
BEYOND_MM = 15.0
"""Depth that solutions are asked for: felupe may stop short of it, but not of what is recorded."""
KEPT_AT = np.linspace(0.0, DEPTH_MM, 141)
"""mm, of curves."""
GRID_KPA = tuple(float(c) for c in np.geomspace(0.25, 2.6, 7).round(4))
LAB = LabErrors(gain_sd=0.01, air=3.0)
DIRECTION_DEG = 90.0
LUMP = Lump(distance=14.0, along=5.0, across=9.0, factor=12.0)
"""Of the leg outside the library: as hard as a knot of scar, at the edge of the muscle."""
RIG, DRIFT_DAY = "B", 90
"""Whose force is too great from a day of the study on."""


@dataclass(frozen=True)
class Spread:
    """How C10 varies: a median in kPa, standard deviations of its logarithm, the factor of patients, a rig's drift."""

    median: float = 0.8
    people: float = 0.25
    legs: float = 0.08
    tests: float = 0.03
    patients: float = 1.25
    drift: float = 1.03
    """Of the force."""


@dataclass(frozen=True)
class Tested:
    """One leg at one session."""

    person: int
    side: str
    session: int
    day: int
    shape: int
    c10: float
    """kPa, on that day."""

    @property
    def group(self) -> str:
        """Every other person is a patient."""
        return ("control", "patient")[self.person % 2]

    @property
    def rig(self) -> str:
        """Two of three people come to the rig that drifts."""
        return "A" if self.person % 3 == 2 else RIG

    @property
    def drifted(self) -> bool:
        """Whether the rig has drifted."""
        return self.rig == RIG and self.day >= DRIFT_DAY

    @property
    def folder(self) -> str:
        """Below the cohort's."""
        return f"P{self.person + 1:02d}/{self.side}-{self.session}"


def drawn_people(people: int, spread: Spread, seed: int) -> list[Tested]:
    """Return two legs of each person at two sessions, 60 days apart, over half a year."""
    generator = np.random.default_rng([seed, 39])
    found = []
    for person in range(people):
        own = np.log(spread.median) + spread.people * generator.normal() + np.log(spread.patients) * (person % 2)
        first = int(generator.integers(0, 120))
        shapes = {side: int(generator.integers(SHAPES)) for side in ("left", "right")}
        for side, shape in shapes.items():
            leg = own + spread.legs * generator.normal()
            for session in (1, 2):
                c10 = float(np.exp(leg + spread.tests * generator.normal()))
                found.append(Tested(person, side, session, first + 60 * (session - 1), shape, c10))
    return found


def shape_section(shape: int, side: str) -> LegSection:
    """Return a shape's outlines; the fibula of a right leg lies at +x."""
    generator = np.random.default_rng([shape, 3])
    girth, fat = float(generator.uniform(320.0, 400.0)), float(generator.uniform(4.0, 9.0))
    section = calf_section(Calf(girth, fat, 0.6, aspect=float(generator.uniform(1.0, 1.08)), asymmetry=0.0))
    if side == "right":
        return section
    mirrored = {part: section.contour(part)[::-1] * np.array([-1.0, 1.0]) for part in section.parts}
    return LegSection.of_parts(mirrored, section.fascia_thickness)


def write_leg(folder: Path, shape: int, side: str, recordings: Sequence[Recording], name: str) -> Path:
    """Write a leg's folder as the lab does."""
    section = shape_section(shape, side)
    return write_subject_folder(
        section,
        folder,
        name,
        section.fascia.mean(axis=0),
        DIRECTION_DEG,
        origin="simulated",
        recordings=recordings,
        plane_strain=True,
        instrument=INSTRUMENT,
        deep_law="neo-hookean",
    )


def by_felupe(shape: int) -> bool:
    """Whether another code presses a shape."""
    return shape % 2 == 1


def pressed(bare: Path, task: tuple[int, float, bool]) -> list[float]:
    """Return the true force (n,), N, at `KEPT_AT`, of a shape, a C10 (kPa), and with or without the lump.

    Raises
    ------
    UnsolvedError
        If a solution stops short.
    """
    shape, c10, lumpy = task
    leg = load_subject(bare / f"shape-{shape}", need_recordings=False)
    case = OtherCase(c10, lumps=[LUMP] if lumpy else ())
    settings = None if by_felupe(shape) or lumpy else FINE
    return [float(f) for f in true_force(leg, case, BEYOND_MM, DEPTH_MM, settings)(KEPT_AT)]


OF_GRID = tuple((shape, c10, False) for shape in range(SHAPES) for c10 in GRID_KPA)
"""Tasks of `pressed`."""


def all_pressed(
    folder: Path, tasks: Sequence[tuple[int, float, bool]], processes: int, progress: Progress
) -> list[FloatArray]:
    """Return the force (n,) of each task of `pressed`, solved or kept in a folder."""
    bare = folder / "bare"
    for shape in range(SHAPES):
        if not (bare / f"shape-{shape}").exists():
            write_leg(bare / f"shape-{shape}", shape, "right", (), f"shape {shape}")
    store = Store(folder / "curves", list[float], modules=("studies.making.pressed_legs", "studies.cases.truth"))
    with Workers(pressed, bare, processes) as workers:
        made = finish(workers, tasks, store, progress, "pressing", lambda task, _: f"shape {task[0]}, {task[1]:g} kPa")
    return [np.array(one) for one in made]


def by_shape(curves: Sequence[FloatArray]) -> FloatArray:
    """Return the forces of `OF_GRID`, (shapes, stiffnesses, n)."""
    return np.array(curves).reshape(SHAPES, len(GRID_KPA), -1)


def between(curves: FloatArray, c10: float) -> FloatArray:
    """Return the force (n,) at a C10 (kPa) from those of the grid (m, n)."""
    return np.asarray(CubicSpline(np.log(GRID_KPA), curves)(np.log(c10)))


def recorded(test: Tested, force: FloatArray, spread: Spread, seed: int) -> list[Recording]:
    """Return what the lab records."""
    generator = np.random.default_rng([seed, test.person, test.side == "left", test.session])
    curve = CubicSpline(KEPT_AT, (spread.drift if test.drifted else 1.0) * force)
    return record([loading(curve, DEPTH_MM, RATE_MM_PER_S)] * TRIALS, LAB, generator)


def table_of(tests: Sequence[Tested]) -> pd.DataFrame:
    """Return the cohort's table."""
    start = date(2026, 1, 5)
    return pd.DataFrame(
        {
            "subject": f"P{one.person + 1:02d}",
            "folder": one.folder,
            "group": one.group,
            "side": one.side,
            "session": one.session,
            "date": (start + timedelta(days=one.day)).isoformat(),
            "rig": one.rig,
        }
        for one in tests
    )


EXCHANGED = ("P10", 1)
"""Person and session whose left and right folders are exchanged."""
LUMPY = "P20/left-1"
BROKEN = ("P05/right-2", "P17/left-1", "P33/right-1")
"""Without outlines, with a text in place of numbers, and with a key that nobody knows."""


def spoil(folder: Path) -> None:
    """Exchange two sides and break three folders."""
    person, session = EXCHANGED
    one, other, aside = (folder / person / f"{name}-{session}" for name in ("left", "right", "aside"))
    one.rename(aside)
    other.rename(one)
    aside.rename(other)
    outlines, words, key = (folder / name for name in BROKEN)
    (outlines / "contours.csv").unlink()
    (words / "recordings" / "trial2.csv").write_text("time_s,displacement_mm,force_N\n0,zero,0\n1,one,2\n")
    text = (key / "subject.toml").read_text()
    (key / "subject.toml").write_text(text.replace("diameter_mm", "diametre_mm"))


@app.command()
def simulated(
    people: Annotated[int, typer.Option(min=34, help="Each with two legs at two sessions.")] = 60,
    seed: Seed = 1,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Write a cohort of simulated legs by another discretisation, with what goes wrong in cohorts.

    Example: python -m studies.cohort.simulated --out results/sixty
    """
    with study_context("cohort-simulated", out, jobs, DONE_IS_KEPT) as (folder, processes), progress_on() as progress:
        spread = Spread()
        tests = drawn_people(people, spread, seed)
        lumpy = next(one for one in tests if one.folder == LUMPY)
        *curves, hard = all_pressed(folder, [*OF_GRID, (lumpy.shape, lumpy.c10, True)], processes, progress)
        grids = by_shape(curves)
        study = folder / "study"
        shutil.rmtree(study, ignore_errors=True)
        for test in tests:
            force = hard if test is lumpy else between(grids[test.shape], test.c10)
            write_leg(study / test.folder, test.shape, test.side, recorded(test, force, spread, seed), test.folder)
        spoil(study)
        write_atomically(study / "cohort.csv", table_of(tests).to_csv(index=False))
        print(
            f"{len(tests)} recordings of {people} people in {study}; a force between the grid's is off by "
            f"{100 * left_out(grids):.2f} % at most where every other one of the grid is left out"
        )


def left_out(grids: FloatArray) -> float:
    """Return the greatest relative error of `between` from 2 mm on by every other stiffness of the grid."""
    from_2_mm = KEPT_AT >= 2.0
    log = np.log(GRID_KPA)
    between_others = CubicSpline(log[::2], grids[:, ::2], axis=1)(log[1::2])
    return float(np.abs(between_others / grids[:, 1::2] - 1)[..., from_2_mm].max())


if __name__ == "__main__":
    app(prog_name="python -m studies.cohort.simulated")
