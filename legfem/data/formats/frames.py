"""What files of frames by cameras' and films' software don't say, and when each frame was taken."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from legfem.common.errors import InputError, Lack
from legfem.common.input_files import FileTable, Finite, Positive, Text
from legfem.common.units import FloatArray
from legfem.data.formats.labels import unit_named

_NUMBERED = re.compile(r"(\d+)\D*$")
_OF_NUMBERS = re.compile(
    r"(?=.*\d)(?:[\s\d.,;|+\-\"']|[eE](?=[+-]?\d)|\b-?(?:nan(?:\(ind\))?|b|n/?a|null)\b)*", re.IGNORECASE
)
FRAME = (
    r"(?:current[_ ]?)?(?:frame|image|stage|stufe|bild|étape|step|schritt|imagen|immagine|帧|画像)"
    r"(?:[_ ]?(?:no|nr|number|nummer|index|id))?"
)
"""How a frame's number is called."""
_NUMBER_OF_FRAME = re.compile(rf"\W*{FRAME}\W+(\d+)(?:\s*(?:/|@|of\b|von\b|sur\b).*)?\W*", re.IGNORECASE)
_TIME_OF_FRAME = re.compile(
    r"\W*(?:time|zeit|temps|tiempo|tempo)\W*(?P<before>[^\W\d]*)\W+(?P<value>\d+(?:[.,]\d+)?)\W*(?P<behind>[^\W\d]*)\W*",
    re.IGNORECASE,
)
"""With the unit in brackets before the value, or behind it."""


type _Two = Annotated[list[int], Field(min_length=2, max_length=2)]


class LaidFrames(FileTable):
    """How frames lie on the leg or the specimen, and in time, where their file doesn't say."""

    axes: list[Literal["x", "y", "z", "-x", "-y", "-z", "rows", "-rows", "columns", "-columns"]] | None = None
    """Which of the coordinates in a camera's file are ours, x first, as ``["x", "-y"]`` where its y points down; which
    number of a film's sensels grows around the cylinder, to the left of the travel: ``["columns"]``."""
    origin: list[Finite] | None = None
    """Where our origin is along these axes, in the file's own numbers and unit; a film's sensel at the face's deepest
    point, counted from 1."""
    mm_each: Positive | None = None
    """mm a pixel, where a camera's file is in pixels or states no unit; from a film's sensel to the next around the
    cylinder."""
    frame_s: Positive | None = None
    """Time from one frame to the next, where the file has no times."""
    clock_s: Finite | None = None
    """The recording's time where the file's is 0, or where a frame of number 0 would be."""
    unit: Text | None = None
    """Unit of a film's pressures, where its file states none."""
    grid: _Two | None = None
    """Rows and columns of a film whose file has a frame a row, its sensels numbered along rows."""
    lines: _Two | None = None
    """First and last of a film's lines along the cylinder that lie on it, counted from 1."""

    @property
    def laid(self) -> dict[str, Any]:
        """What is given of it, by its key."""
        given = ((key, getattr(self, key)) for key in LaidFrames.model_fields)
        return {key: value for key, value in given if value is not None}

    def ask(self, path: Path, needed: dict[str, str], others: Sequence[str] = ()) -> None:
        """Check that what a file doesn't say is given, and nothing else.

        Parameters
        ----------
        path
            The file.
        needed
            What it doesn't say, and of what form that is, by keys.
        others
            Further keys that may be given.

        Raises
        ------
        InputError
            If any lacks, with all that do; if one is given that the file says or has no place for.
        """
        lacking = "; ".join(f"{key} = {what}" for key, what in needed.items() if key not in self.laid)
        if lacking:
            raise InputError(path, "frames", Lack("it doesn't say all that is needed"), f"give with it: {lacking}")
        extra = next((key for key in self.laid if key not in needed and key not in others), None)
        if extra is not None:
            raise InputError(path, extra, "the file says that itself, or has no place for it", "leave it out")


type Stated = dict[str, float]
"""What a file states of a frame: its ``number``, its ``time`` in s, or nothing."""


def of_numbers(line: str) -> bool:
    """Tell whether a line has numbers, and perhaps what stands for lost ones, alone."""
    return _OF_NUMBERS.fullmatch(line) is not None


def split_frames(text: str) -> list[tuple[Stated, list[str]]]:
    """Return a text's frames: what a line above each states of it, and its lines, of which some are of numbers."""
    frames: list[tuple[Stated, list[str]]] = [({}, [])]
    for line in text.splitlines():
        said = stated_in(line)
        if said and any(map(of_numbers, frames[-1][1])):
            frames.append((said, []))
        elif said:
            frames[-1][0].update(said)
        else:
            frames[-1][1].append(line)
    # Numbers above the first frame's are a heading's.
    several = any(said for said, _ in frames)
    return [one for one in frames if any(map(of_numbers, one[1])) and (one[0] or not several)]


def stated_in(line: str) -> Stated:
    """Return what a line between frames states: the number, or the time in s, of the one below."""
    numbered, timed = _NUMBER_OF_FRAME.fullmatch(line), _TIME_OF_FRAME.fullmatch(line)
    unit = unit_named(timed["before"] or timed["behind"]) if timed else None
    if timed and unit and unit.quantity == "time":
        return {"time": float(timed["value"].replace(",", ".")) * unit.factor}
    return {"number": float(numbered[1])} if numbered else {}


def number_in_name(path: Path, paths: Sequence[Path]) -> Stated:
    """Return the number of a frame that stands alone in one of several files: the last in the file's name."""
    named = _NUMBERED.search(path.stem) if len(paths) > 1 else None
    return {"number": float(named[1])} if named else {}


def clock_of(
    path: Path, frames: Sequence[Stated], laid: LaidFrames, every: float | None = None
) -> tuple[FloatArray, dict[str, str]]:
    """Return every frame's time (n,) on the recording's clock, and what of that has to be given.

    ``every`` is the time from one to the next, s, where the file states it.

    Raises
    ------
    InputError
        If some have times or numbers and others don't, or two have the same.
    """
    name = "time" if any("time" in said for said in frames) else "number"
    stated = [said[name] for said in frames if name in said]
    if stated and len(stated) < len(frames):
        raise InputError(path, name, f"{len(stated)} of {len(frames)} frames state it", "export all frames alike")
    if len(set(stated)) < len(stated):
        twice = next(one for one in stated if stated.count(one) > 1)
        raise InputError(path, name, f"two frames have {twice:g}", "give each frame once, of one trial alone")
    begin = laid.clock_s or 0.0
    if name == "time":
        return begin + np.array(stated), {"clock_s": "the recording's time where the file's is 0"}
    numbers = np.array(stated or [0])
    needed = {"frame_s": "seconds from one frame to the next"} if numbers.any() and every is None else {}
    first = f"the recording's time of frame 0 (the first in it has number {numbers[0]:g})"
    return begin + numbers * (every or laid.frame_s or 0.0), needed | {"clock_s": first}
