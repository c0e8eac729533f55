"""Cohorts of fabricated results with a known truth: nothing is solved."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import date, timedelta
from pathlib import Path

import numpy as np

from legfem.cohort.members import Member, Members
from legfem.cohort.rows import Curve, Judged, Measure, ModelResult, Row, Shape
from legfem.inverse.answer import FitNotice, Notice
from legfem.legs.notices import LegNotice

LAW = "reduced-polynomial"


@dataclass(frozen=True)
class Truth:
    """How C10 varies, as standard deviations and differences of its logarithm."""

    people: float = 0.3
    sides: float = 0.08
    sessions: float = 0.05
    error: float = 0.04
    """Standard error of each leg's own result."""
    group: float = 0.0
    """Of patients above controls."""
    drift: float = 0.0
    """Of all that is measured from the middle of the study on."""
    raters: float = 0.0


def fabricated(
    people: int, sides: int = 2, sessions: int = 2, truth: Truth = Truth(), seed: int = 0
) -> tuple[Members, list[Row]]:
    """Everybody is measured in ``sessions`` visits, whose days are spread over half a year."""
    generator = np.random.default_rng(seed)
    members, rows = [], []
    for person in range(people):
        group = ("control", "patient")[person % 2]
        own = math.log(0.8) + truth.people * generator.normal() + truth.group * (person % 2)
        for side in range(sides):
            leg = own + truth.sides * generator.normal()
            for session in range(sessions):
                days = 180 * person / max(people, 2) / 2 + 90 * session
                late = days > 90
                value = leg + truth.sessions * generator.normal() + truth.drift * late + truth.raters * session
                found = math.exp(value + truth.error * generator.normal())
                name = f"P{person:04d}/{('left', 'right')[side]}-{session + 1}"
                given = {
                    "subject": f"P{person:04d}",
                    "group": group,
                    "side": ("left", "right")[side],
                    "session": str(session + 1),
                    "date": (date(2026, 1, 5) + timedelta(days=int(days))).isoformat(),
                    "age": float(20 + 3 * (person % 15)),
                }
                members.append(Member(name, Path("/nowhere") / name, f"P{person:04d}", given))
                rows.append(row(name, found, truth.error, side, generator))
    return Members(Path("/nowhere/study"), tuple(members)), rows


def row(name: str, c10: float, error: float, side: int, generator: np.random.Generator) -> Row:
    c20 = c10 * float(np.exp(0.2 * generator.normal()))
    measures = {
        key: Measure(value, value * (1 - 1.96 * sd), value * (1 + 1.96 * sd), value * sd, "kPa", "identifiable")
        for key, value, sd in (("c10_deep", c10, error), ("c20_deep", c20, 2 * error))
    }
    x = np.linspace(0.0, 20.0, 40)
    force = 0.3 * c10 * x + 0.02 * c20 * x**2
    curve = Curve(*(tuple(float(v) for v in values) for values in (x, force + 0.05 * generator.normal(size=40))))
    notices = [
        Notice.of(LegNotice.NEGATIVE_POISSON_RATIO, tissue="fascia", ratio=-0.14),
        Notice.of(FitNotice.BEGUN_IN_AIR, trial="trial1", air=generator.uniform(1, 2)),
    ]
    tone, sentence = ("sound", "Muscle stiffness.") if generator.random() < 0.7 else ("caution", "Only as a limit.")
    return Row(
        name,
        judged=Judged(tone, sentence, tuple(one for one in notices if generator.random() < 0.4), LAW),
        models={LAW: ModelResult(measures, float(generator.uniform()), curve)},
        origin="simulated",
        recordings={"trial1": f"{name}-digest"},
        shape=Shape(6.0 + float(generator.normal()), 370.0, 20.0 if side else -20.0),
        report=f"members/{name}/report.html",
        seconds=20.0,
        peak_mb=500.0,
        versions={"legfem": "0.1.0", "dolfinx": "0.9.0"},
        settings={"depth_mm": [20.0], "interval": "95 %, profile of the cost"},
    )
