"""A plan in sentences and numbers: which tests would show which effects."""

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from legfem.common.errors import Doubt, doubt_lines
from legfem.common.numbers import percent
from legfem.common.units import mpa_to_kpa
from legfem.data import Instrument
from legfem.geometry.section import girth
from legfem.inverse.plan import DesignValue
from legfem.legs.plan import Expected, MusclesTold
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject
from legfem.report import page as web
from legfem.report.answers import first_lines
from legfem.report.diagnosis_curves import plain
from legfem.report.pressed_section import still_section
from legfem.report.words import LAW_NAMES, NOT_TESTED, TOLD, DataKind

SCHEMA = 1
NOTHING = "nothing"


def chance_text(one: DesignValue) -> str:
    """Return the chance that a test ends an ambiguity, and what it takes."""
    return f"{percent(one.chance)} chance of distinguishing the candidates{_needs(one)}"


def _needs(one: DesignValue) -> str:
    return f"; needed: {one.design.effort}" if one.design.effort else ""


def plan_document(ranked: Sequence[DesignValue], subject: str, muscles: Sequence[MusclesTold] = ()) -> dict[str, Any]:
    """Return the plan as JSON types."""
    return {
        "muscles": [{"test": one.test, "C10_relative_sd": one.sd, "not_told_apart": one.alike} for one in muscles],
        "schema": SCHEMA,
        "subject": subject,
        "origin": "simulated",
        "tests": [
            {
                "test": one.design.name,
                "effort": one.design.effort,
                "chance": one.chance,
                "told_apart": [{"if": a, "from": b, "chance": chance} for (a, b), chance in one.chances.items()],
            }
            for one in ranked
        ],
    }


RANKED, SHOWN = "Tests, the most informative first", "What each test would show"
"""Chapters."""
_LIKELY, _UNLIKELY = 0.8, 0.2
"""Chances from which an effect is called shown, and below which it is called unseen."""


def plan_web_page(
    ranked: Sequence[DesignValue],
    subject: Subject,
    expected: Expected,
    doubts: Sequence[Doubt],
    versions: Mapping[str, str],
    command: str = "",
    muscles: Sequence[MusclesTold] = (),
) -> web.WebPage:
    """Return the page of a plan.

    Parameters
    ----------
    ranked
        Tests, the most telling first.
    subject
        Whose leg.
    expected
        Stiffness and test that the plan is made for.
    doubts
        About what was given.
    versions
        Of the programs that made it.
    command
        That was given; empty where there was none.
    muscles
        How well tests tell muscles by name.
    """
    names = sorted({effect for one in ranked for effect, _ in one.chances if effect != NOTHING})
    never = [plain(name) for name in names if all(one.chances[name, NOTHING] < _UNLIKELY for one in ranked)]
    tests = [
        web.LabelledBar(f"({k}) {one.design.name}", 100 * one.chance, percent(one.chance))
        for k, one in enumerate(ranked, 1)
    ]
    whichever = "Chance that the test identifies the cause, whichever it is"
    steps = [
        *(f"Test {k}: {one.design.name}{_needs(one)}." for k, one in enumerate(ranked[:3], 1)),
        f"Put the recordings into the folder's recordings/, then: legfem diagnose {options_of(subject)}",
    ]
    warned = [f"No test shows {', '.join(never)} with a chance of 20 % or more."] if never else []
    return web.WebPage(
        f"Which test of leg {subject.id} should come first?",
        subject.title,
        "simulated",
        _headline(ranked, names, never),
        [*doubt_lines(doubts), *warned],
        _known(subject, expected),
        [
            web.Chapter(RANKED, [web.Bars(whichever, ("test", "chance"), tests, greatest=100.0)]),
            web.Chapter(SHOWN, [web.Prose(TOLD["chances"]), *_tables(ranked, names, muscles)]),
            web.Chapter("The leg", [still_section(subject)]),
            web.Chapter("What to do next", [web.Bullets(steps)]),
            web.Chapter("What was not weighed", [web.Bullets(NOT_TESTED["plan"])]),
        ],
        web.Repeat(command, versions, inputs=subject.directory),
        DataKind("simulated data", f"no test has been made yet; section of the leg: {subject.origin}"),
    )


def _tables(
    ranked: Sequence[DesignValue], names: Sequence[str], muscles: Sequence[MusclesTold]
) -> Iterator[web.WebTable]:
    yield web.WebTable(
        "Chance that a test detects an effect; tests by their rank",
        ["effect", *(f"({k})" for k in range(1, len(ranked) + 1))],
        [[plain(n), *(percent(one.chances[n, NOTHING]) for one in ranked)] for n in names],
    )
    if muscles:
        caption = "Expected standard deviation of C10, over C10, of muscles and of the rest (deep), all unknown at once"
        yield web.WebTable(
            caption,
            ["test", *muscles[0].names, "not distinguished: one may be twice as stiff as the other"],
            [[one.test, *map(percent, one.sd.values()), "; ".join(map(" and ".join, one.alike))] for one in muscles],
        )


def _headline(ranked: Sequence[DesignValue], names: Sequence[str], never: Sequence[str]) -> web.Headline:
    first = first_lines([one.design.name for one in ranked])
    if not ranked:
        return first
    shown = [plain(name) for name in names if ranked[0].chances[name, NOTHING] >= _LIKELY]
    shows = "It detects no effect with a chance of 80 % or more; the table lists all chances."
    if shown:
        shows = f"If present, these effects are detected with a chance of 80 % or more: {', '.join(shown)}."
    hides = "Every effect that legfem knows would show in at least one of them."
    if never:
        hides = f"No test here would show {', '.join(never)}, which could bias the stiffness unnoticed."
    return replace(
        first,
        tone="caution" if never else "sound",
        answers=[
            ("What it would show", shows),
            ("What no test here shows", hides),
            ("How sure", TOLD["nothing_measured"]),
            ("What to do", "Make the test, then diagnose the recordings."),
        ],
    )


def _known(subject: Subject, expected: Expected) -> list[web.Known]:
    indenter, stated = subject.indenter, "the command, or usual values"
    law = f"{LAW_NAMES[subject.tissues['deep'].law]} law"
    cylinder = f"{2 * indenter.radius:g} mm across, {indenter.length:g} mm long"
    return [
        web.Known("expected C10", f"{mpa_to_kpa(expected.c10):g} kPa", "assumed", stated, remark=law),
        web.Known("expected C20", f"{mpa_to_kpa(expected.c20):g} kPa", "assumed", stated),
        web.Known("depth", f"{expected.depth:g} mm", "assumed", stated),
        web.Known("rate", f"{expected.rate:g} mm/s", "assumed", stated),
        *errors_of_readings(subject.instrument),
        web.Known("girth of the section", f"{girth(subject.section):.0f} mm", subject.origin, "contours of the skin"),
        web.Known("cylinder", cylinder, "assumed", "subject.toml"),
    ]


def errors_of_readings(instrument: Instrument) -> list[web.Known]:
    """What is assumed of an instrument's readings, as rows of the table of numbers."""
    usual = "subject.toml, or usual"
    return [
        web.Known("error of a force reading", f"{instrument.force_sd:.3g} N (sd)", "prior", usual),
        web.Known("error of a displacement reading", f"{instrument.displacement_sd:.3g} mm (sd)", "prior", usual),
    ]


def options_of(subject: Subject) -> str:
    """Return the options by which a command finds a subject again."""
    site = f" --site {shlex.quote(subject.site)}" if subject.site else ""
    if subject.id in SUBJECTS.names and SUBJECTS.find(subject.id).resolve() == Path(subject.directory).resolve():
        return f"--subject {subject.id}{site}"
    return f"--subject-dir {shlex.quote(str(subject.directory))}{site}"
