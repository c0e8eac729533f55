"""The page of instruments' files that were looked at, before anything is done with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from legfem.common.versions import versions_of
from legfem.data import Recording, SourceColumns
from legfem.data.quality import GRADES, Quality
from legfem.data.reader import QUANTITIES, Proposal
from legfem.data.segmentation import HOLD
from legfem.report.look import contact_text, recording_name
from legfem.report.page import Bullets, Chapter, Curves, Headline, Line, Repeat, Tone, Verbatim, WebPage, WebTable

_MOST_POINTS = 4_000
"""Drawn in all: the page opens in a second or two, and is under 2 MB."""
_LEAST_POINTS = 100
_DONE: dict[str, tuple[Tone, str]] = {
    "A": ("sound", "Use them."),
    "B": ("sound", "Use them; the reasons below say what limits them."),
    "C": (
        "caution",
        "Look at the curves of those graded C, and decide whether they are what was meant to be measured.",
    ),
    "D": ("wrong", "Don't use those graded D: record them again, or correct the files."),
}


class Looked(NamedTuple):
    """A file, how it was read, and how good it is."""

    recording: Recording
    proposal: Proposal
    quality: Quality


def look_web_page(seen: Sequence[Looked], toml: str, text: str, command: str = "") -> WebPage:
    """Return the page.

    Parameters
    ----------
    seen
        One a file; all are laid out alike.
    toml
        The ``[recordings]`` block that reads them.
    text
        Of ``report.txt``.
    command
        That was given; empty where there was none.
    """
    names = [recording_name(one.recording) for one in seen]
    worst = max(one.quality.grade for one in seen)
    tone, do = _DONE[worst]
    grades = {
        grade: [name for name, one in zip(names, seen, strict=True) if one.quality.grade == grade] for grade in GRADES
    }
    told = ", ".join(
        f"{len(files)} {'is' if len(files) == 1 else 'are'} of grade {grade} ({GRADES[grade]})"
        for grade, files in grades.items()
        if files
    )
    reasons = [
        f"{name}: {reason.removeprefix(f'{grade}: ')}"
        for grade in ("D", "C")
        for name, one in zip(names, seen, strict=True)
        for reason in one.quality.reasons
        if reason.startswith(grade)
    ]
    return WebPage(
        title="What is in these recordings?",
        subject=", ".join(names),
        origin="",
        headline=Headline(
            tone,
            f"Of {len(seen)} recording{'' if len(seen) == 1 else 's'}, {told}.",
            [
                ("What was read", _read(seen[0].proposal.channels)),
                (
                    "How sure",
                    "Columns, units and directions are inferred from names and from the "
                    "motion: compare the curves with what you did. A grade judges the instrument, "
                    "not what it pressed.",
                ),
                (
                    "What to do",
                    do + " If columns or directions are wrong, name them (--time, --displacement, --force).",
                ),
            ],
            heading="What the instrument wrote",
        ),
        warnings=reasons,
        known=[],
        chapters=[
            Chapter("Recordings", [block for k, one in enumerate(seen) for block in _recording(k, one, len(seen))]),
            Chapter("What was seen", [_table(names, seen)]),
            Chapter(
                "To read them this way",
                [
                    Bullets(
                        ["Put this block into the folder's subject.toml or specimen.toml; it is in recordings.toml."]
                    ),
                    _reasons(names, seen),
                    Verbatim("recordings.toml", toml),
                    Verbatim("report.txt", text),
                ],
            ),
        ],
        repeat=Repeat(command, versions_of("legfem", "python")),
        data="files of an instrument; they do not say whether they were measured or simulated",
    )


def _read(channels: SourceColumns) -> str:
    """Return which columns were taken for what."""
    every = ((quantity, getattr(channels, quantity)) for quantity in QUANTITIES)
    told = (
        f"{quantity} from '{one.column}' ({one.unit}{', reversed' if one.sign < 0 else ''})" for quantity, one in every
    )
    text = ", ".join(told)
    return f"{text[0].upper()}{text[1:]}."


def _recording(number: int, one: Looked, count: int) -> list[Curves]:
    """Return displacement and force over time, and force over displacement."""
    recording, quality = one.recording, one.quality
    most = max(_LEAST_POINTS, _MOST_POINTS // (2 * count))
    picked = np.unique(np.linspace(0, len(recording) - 1, most).round().astype(int))
    name = recording_name(recording)
    few = "" if len(picked) == len(recording) else f" {len(picked)} of its {len(recording)} samples are drawn."
    time, moved, force = (values[picked] for values in (recording.time, recording.displacement, recording.force))
    return [
        Curves(
            f"time-{number}",
            f"{name}, grade {quality.grade}: displacement and, beneath, force over time.{few}",
            time,
            "time (s)",
            "displacement (mm)",
            "force (N)",
            [Line("as recorded", moved, force)],
            located=[(part.start, part.end) for part in quality.trial.parts if part.phase == HOLD],
            located_name="taken for a hold",
        ),
        Curves(
            f"curve-{number}",
            f"{name}: force over displacement; first contact {contact_text(quality)}.",
            moved,
            "displacement (mm)",
            "force (N)",
            "",
            [Line("as recorded", force, None)],
        ),
    ]


def _reasons(names: Sequence[str], seen: Sequence[Looked]) -> WebTable:
    """Return why files are read as they are, what is alike for several once."""
    files: dict[str, list[str]] = {}
    for name, one in zip(names, seen, strict=True):
        for reason in one.proposal.reasons:
            files.setdefault(reason, []).append(name)
    rows = [(reason, "all" if len(those) == len(seen) else ", ".join(those)) for reason, those in files.items()]
    return WebTable("Why they are read so.", ("why", "files"), rows)


def _table(names: Sequence[str], seen: Sequence[Looked]) -> WebTable:
    rows = [
        (
            name,
            one.quality.grade,
            f"{len(one.recording)}",
            f"{one.quality.sampling:.4g}",
            contact_text(one.quality),
            f"{one.quality.trial.force_noise:.2g}",
            f"{one.quality.trial.displacement_noise:.2g}",
            ", ".join(part.phase for part in one.quality.trial.parts[:8]),
        )
        for name, one in zip(names, seen, strict=True)
    ]
    return WebTable(
        "Noise is from sample to sample. Grades: "
        + ", ".join(f"{grade} {words}" for grade, words in GRADES.items())
        + ".",
        ("file", "grade", "samples", "Hz", "first contact", "force noise (N)", "displacement noise (mm)", "phases"),
        rows,
    )
