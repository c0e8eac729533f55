"""What is seen in an instrument's file: a picture, a table, and the TOML that reads it."""

import json
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from legfem.channels.kinds import OF_LEGS
from legfem.common.documents import markdown_table, versions_of
from legfem.data import Recording, SourceColumns
from legfem.data.channel_reader import TRIAL, frames_in
from legfem.data.columns import Proposal
from legfem.data.formats import file_of
from legfem.data.phases import AIR, HOLD
from legfem.data.quality import GRADES, Quality
from legfem.data.recording import QUANTITIES, RecordedChannel
from legfem.inverse.answer import Tone
from legfem.legs.folder import plain_id
from legfem.report.curves import Curves, Line, curves_figure
from legfem.report.page import Bullets, Chapter, Headline, Repeat, Verbatim, WebPage, WebTable
from legfem.report.style import FAINT, save
from legfem.report.words import TOLD, WORDS, DataKind, capital
from legfem.specimens.sizes import sizes_of_heading

_MOST_PARTS = 12
_PHASES = {AIR: "unloaded"}
LOOK = "look.json"
SCHEMA = 1


def recordings_toml(channels: SourceColumns) -> str:
    """Return the ``[recordings]`` block that reads a file."""
    tables = [_toml("recordings", {} if channels.sheet is None else {"sheet": channels.sheet})]
    for quantity in QUANTITIES:
        one = getattr(channels, quantity)
        sign = {} if quantity == "time" else {"sign": one.sign}
        tables.append(_toml(f"recordings.{quantity}", {"column": one.column, "unit": one.unit, **sign}))
    return "".join(tables)


def _toml(name: str, values: Mapping[str, str | float]) -> str:
    """Return a table of TOML."""
    texts = ((k, json.dumps(v, ensure_ascii=False) if isinstance(v, str) else f"{v:g}") for k, v in values.items())
    return "".join([f"[{name}]\n", *(f"{key} = {text}\n" for key, text in texts)])


def channels_toml(channels: Sequence[RecordedChannel]) -> str:
    """Return the blocks that state the accuracy of channels beside the force, which is usual until it is changed."""
    tables = []
    for one in (one for one in channels if one.kind in OF_LEGS):
        unit, known = one.kind.unit, one.accuracy
        errors = {f"sd_{unit}": known.reading, f"bias_{unit}": known.bias, f"slow_{unit}": known.slow}
        tables.append(_toml(f"channels.{one.name}", errors | {"gain_percent": 100 * known.gain, "lag_s": known.lag}))
    return "".join(tables)


def specimens_toml(recordings: Sequence[Recording]) -> str:
    """Return a block for each recording with the sizes that its heading states: a cylinder's, or a bar's."""
    tables = []
    for one in recordings:
        keys = ("diameter_mm", "height_mm") if "diameter" in one.sizes else ("length_mm", "area_mm2")
        sizes = sizes_of_heading(keys, one.sizes)
        path = one.source or Path(one.trial)
        file = json.dumps(f"recordings/{path.relative_to(file_of(path).parent).as_posix()}", ensure_ascii=False)
        stated = _toml("[specimen]", {"name": plain_id(one.trial), **sizes})
        tables += [f"{stated}recordings = [{file}]\n"] if sizes else []
    return "".join(tables)


def frames_toml(tables: Sequence[Path], recordings: Sequence[Recording], specimens: bool) -> str:
    """Return the blocks that read tables of frames, as of points that were tracked, beside recordings."""
    lines = []
    for path in tables:
        entry = next(one.entry for one in frames_in(path) if ("specimen" in one.kinds[0].models) == specimens)
        named = (re.search(rf"(?<![^\W_]){re.escape(one.trial)}(?![^\W_])", path.name) for one in recordings)
        found = max(filter(None, named), key=lambda one: len(one[0]), default=None)
        name = path.name if found is None else f"{path.name[: found.start()]}{TRIAL}{path.name[found.end() :]}"
        lines.append(_toml(f"channels.{entry}", {"file": name}))
    return "".join(dict.fromkeys(lines))


def recording_name(recording: Recording) -> str:
    """Return the name of the file, or of the trial where there is none."""
    return recording.trial if recording.source is None else recording.source.name


def contact_text(quality: Quality) -> str:
    """Return where loading begins, in words that fit a press and a pull."""
    contact, digits = quality.trial.contact, _digits(quality)
    if contact.known:
        return "at the start, as the folder states"
    if contact.in_air:
        known = f"{contact.displacement:.{digits}f} ± {contact.displacement_error:.{digits}f}"
        return f"at {known} mm, after a part without load"
    return f"at the start ({contact.displacement:.{digits}f} mm): no part without load is seen"


def _digits(quality: Quality) -> int:
    """Return the decimals that tell a hundredth of the way that is short in a test."""
    return max(2, 2 - math.floor(math.log10(max(quality.trial.scales.way, 1e-9))))


def look_text(recording: Recording, proposal: Proposal, quality: Quality) -> str:
    """Return what was found in a file and why, its phases and its grade."""
    name, digits = recording_name(recording), _digits(quality)
    force_noise, jitter = quality.trial.force_noise, quality.trial.displacement_noise
    rows = [
        ("samples", f"{len(recording)} in {recording.time[-1] - recording.time[0]:.4g} s"),
        ("sampling", f"{quality.sampling:.4g} Hz, {quality.dropped} samples dropped"),
        ("loading begins", contact_text(quality)),
        ("force", f"steps of {quality.force_step:.2g} N, noise {force_noise:.2g} N"),
        ("displacement", f"steps of {quality.displacement_step:.2g} mm, noise {jitter:.2g} mm"),
        ("saturation", f"{quality.saturated} samples at the limit" if quality.saturated else "none"),
        ("drops", ", ".join(f"{t:.4g} s" for t in quality.drops[:5]) or "none"),
    ]
    for one in recording.channels:
        kind, accuracy = one.kind, one.accuracy
        errors = f"± {accuracy.reading:g} {kind.unit} a reading, ± {accuracy.bias:g} {kind.unit} of all"
        span = f"{float(one.values.min()):.3g} to {float(one.values.max()):.3g} {kind.unit}"
        rows.append((kind.title, f"{len(one.values)} readings, {span}, {errors}"))
    phases = []
    for p in quality.trial.parts[:_MOST_PARTS]:
        moved = (f"{p.first:.{digits}f}", f"{p.last:.{digits}f}", "" if p.phase == HOLD else f"{p.rate:.3g}")
        phases.append((_PHASES.get(p.phase, p.phase), f"{p.start:.4g}", f"{p.end:.4g}", *moved))
    more = len(quality.trial.parts) - len(phases)
    return "\n".join(
        [
            f"{name}: grade {quality.grade}",
            *(f"  {reason}" for reason in quality.reasons),
            "read as",
            *(f"  {reason}" for reason in proposal.reasons),
            "",
            markdown_table(("what", "seen"), rows, aligned=True),
            markdown_table(("phase", "from s", "to s", "from mm", "to mm", "mm/s"), phases, aligned=True)
            + (f"and {more} more phases\n" if more > 0 else ""),
        ]
    )


def look_document(seen: Sequence[tuple[Recording, Proposal, Quality]]) -> dict[str, Any]:
    """Return what was found in files as JSON types."""
    return {
        "schema": SCHEMA,
        "recordings": [
            {
                "file": recording_name(recording),
                "grade": quality.grade,
                "reasons": list(quality.reasons),
                "read_as": list(proposal.reasons),
                "columns": {quantity: asdict(getattr(proposal.channels, quantity)) for quantity in QUANTITIES},
                "samples": len(recording),
                "sampling_Hz": quality.sampling,
                "dropped_samples": quality.dropped,
                "saturated_samples": quality.saturated,
                "first_contact_mm": quality.trial.contact.displacement,
                "first_contact_in_air": quality.trial.contact.in_air,
                "force_step_N": quality.force_step,
                "force_noise_N": quality.trial.force_noise,
                "displacement_step_mm": quality.displacement_step,
                "displacement_noise_mm": quality.trial.displacement_noise,
                "drops_s": list(quality.drops),
                "channels": [
                    {"name": one.name, "unit": one.kind.unit, "readings": len(one.values), **asdict(one.accuracy)}
                    for one in recording.channels
                ],
                "phases": [
                    {"phase": p.phase, "from_s": p.start, "to_s": p.end, "from_mm": p.first, "to_mm": p.last}
                    for p in quality.trial.parts
                ],
            }
            for recording, proposal, quality in seen
        ],
    }


def draw_look(recording: Recording, quality: Quality, out: Path) -> Path:
    """Draw what a page shows of a recording."""
    what = f"{recording_name(recording)}: grade {quality.grade}"
    figure = curves_figure(_curves(recording, quality), what, recording.trial, "an instrument's")
    return save(figure, out, recording.trial)[0]


_MOST_POINTS = 4_000
"""Drawn in all: the page opens in a second or two, and is under 2 MB."""
_LEAST_POINTS = 100
_TONES: dict[str, Tone] = {"A": "sound", "B": "sound", "C": "caution", "D": "wrong"}


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
    warnings = [
        f"{name}: {why}"
        for grade in ("D", "C")
        for name, one in zip(names, seen, strict=True)
        for judged, why in one.quality.judged
        if judged == grade
    ]
    files: dict[str, list[str]] = {}
    for name, one in zip(names, seen, strict=True):
        for reason in one.proposal.reasons:
            files.setdefault(reason, []).append(name)
    reasons = [(why, "all" if len(those) == len(seen) else ", ".join(those)) for why, those in files.items()]
    curves = [block for k, one in enumerate(seen) for block in _curves(one.recording, one.quality, k, len(seen))]
    put = "Put this block into the folder's subject.toml or specimen.toml; it is in recordings.toml."
    return WebPage(
        title="What is in these recordings?",
        subject=", ".join(names),
        origin="",
        headline=_headline(seen, worst),
        warnings=warnings,
        known=[],
        chapters=[
            Chapter("Recordings", curves),
            Chapter("What was seen", [_table(names, seen)]),
            Chapter(
                "To read them this way",
                [
                    Bullets([put]),
                    WebTable("Why the files are read this way", ("why", "files"), reasons),
                    Verbatim("recordings.toml", toml),
                    Verbatim("report.txt", text),
                ],
            ),
        ],
        repeat=Repeat(command, versions_of("legfem", "python")),
        data=DataKind("files of an instrument; they do not say whether they were measured or simulated"),
    )


def _headline(seen: Sequence[Looked], worst: str) -> Headline:
    do, heading = WORDS["grades"][worst]
    grades = Counter(one.quality.grade for one in seen)
    told = ", ".join(
        f"{f'{grades[grade]} ' * (len(seen) > 1)}{'has' if grades[grade] == 1 else 'have'} grade {grade} ({words})"
        for grade, words in GRADES.items()
        if grades[grade]
    )
    channels = seen[0].proposal.channels
    every = ((quantity, getattr(channels, quantity)) for quantity in QUANTITIES)
    read = ", ".join(
        f"{quantity} from '{one.column}' ({one.unit}{', reversed' if one.sign < 0 else ''})" for quantity, one in every
    )
    return Headline(
        _TONES[worst],
        f"Of {len(seen)} recordings, {told}." if len(seen) > 1 else f"This recording {told}.",
        [
            ("What was read", f"{capital(read)}."),
            ("How sure", TOLD["inferred"]),
            ("What to do", f"{do} If columns or directions are wrong, name them (--time, --displacement, --force)."),
        ],
        "The recording cannot be used" if len(seen) == 1 and worst == "D" else heading,
    )


def _table(names: Sequence[str], seen: Sequence[Looked]) -> WebTable:
    rows = [
        {
            "file": name,
            "grade": one.quality.grade,
            "samples": f"{len(one.recording)}",
            "Hz": f"{one.quality.sampling:.4g}",
            "loading begins": contact_text(one.quality),
            "force noise (N)": f"{one.quality.trial.force_noise:.2g}",
            "displacement noise (mm)": f"{one.quality.trial.displacement_noise:.2g}",
            "phases": ", ".join(_PHASES.get(part.phase, part.phase) for part in one.quality.trial.parts[:8]),
        }
        for name, one in zip(names, seen, strict=True)
    ]
    grades = ", ".join(f"{grade} {words}" for grade, words in GRADES.items())
    return WebTable.of(f"Noise is from sample to sample. Grades: {grades}.", rows)


def _curves(recording: Recording, quality: Quality, number: int = 0, count: int = 1) -> list[Curves]:
    """Return displacement and force over time, force over displacement, and further channels over time."""
    most = max(_LEAST_POINTS, _MOST_POINTS // (2 * count))
    picked = np.unique(np.linspace(0, len(recording) - 1, most).round().astype(int))
    name = recording_name(recording)
    few = "" if len(picked) == len(recording) else f" {len(picked)} of its {len(recording)} samples are drawn."
    time, moved, force = (values[picked] for values in (recording.time, recording.displacement, recording.force))
    begins = quality.trial.contact.displacement
    holds = [(part.start, part.end) for part in quality.trial.parts if part.phase == HOLD]
    return [
        Curves(
            f"time-{number}",
            f"{name}, grade {quality.grade}",
            f": displacement and, beneath, force over time.{few}",
            time,
            "time (s)",
            "displacement (mm)",
            [Line("as recorded", moved, force)],
            below_label="force (N)",
            located=holds,
            located_name="taken for a hold" * bool(holds),
        ),
        Curves(
            f"curve-{number}",
            name,
            f": force over displacement; loading begins {contact_text(quality)}.",
            moved,
            "displacement (mm)",
            "force (N)",
            [Line("as recorded", force, None)],
            located=[(float(moved.min()), begins)] if begins > moved.min() else (),
            located_name="before loading begins",
        ),
        *(_beside(one, f"{one.name}-{number}", name) for one in recording.channels),
    ]


def _beside(one: RecordedChannel, key: str, name: str) -> Curves:
    """Return a channel's readings over time, at all its places and in their mean."""
    times, each = np.unique(one.time), [place for _, place in one.at_each_place()]
    values = np.full((len(each), len(times)), np.nan)
    for row, place in zip(values, each, strict=True):
        row[np.searchsorted(times, place.time)] = place.values
    mean = Line(
        "as recorded" if len(each) == 1 else "mean of its places", np.nanmean(values, axis=0), None, points=True
    )
    every = enumerate(values, 1) if len(each) > 1 else ()
    places = [Line(f"place {k}", row, None, FAINT, faint=True, tabled=False) for k, row in every]
    label = f"{one.kind.title} ({one.kind.unit})"
    return Curves(key, f"{name}, {one.kind.title}", " over time.", times, "time (s)", label, [mean, *places])
