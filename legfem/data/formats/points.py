"""Points that a camera's software followed, as it exports them: places and displacements by frames.

Texts of any dialect with a table a frame (GOM and ARAMIS, their stages one below the other or a file each; DICe), or
with the frame in a column (muDIC); Ncorr's ``.mat``, with a matrix a frame, and MultiDIC's, with a list of points.
Ncorr puts a point every ``spacing`` + 1 pixels, counted from 1, and 0 where it followed none. GOM's x, y and z are
those of the moved points unless they are called undeformed: frames are compared to find that out.

Sources: Blaber, Adair & Antoniou, *Ncorr* (2015), its ``ncorr_gui_formatdisp.m``; Turner, *DICe Reference Manual*
(SAND2015-10606 O); DLR's *aramis-data-exporter*.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data.formats import read_sheets
from legfem.data.formats.arrays import content_of_matlab
from legfem.data.formats.frames import (
    FRAME,
    LaidFrames,
    Stated,
    clock_of,
    number_in_name,
    of_numbers,
    split_frames,
    stated_in,
)
from legfem.data.formats.labels import unit_named
from legfem.data.formats.lines import decoded
from legfem.data.formats.sheet import Column, check_size
from legfem.data.formats.text import read_text

_PIXELS = re.compile(r"(?:[\s_]|^)(?:px|pix|pxl|pixels?)\.?$", re.IGNORECASE)
_AT = r"(?:model_)?(?:coo?rd\w*|koord\w*|pos\w*|point|punkt|座標|坐标)"
_PLACE = rf"(?:{_AT}[ _.]*)?([xyz])(?:[ _.]*{_AT})?"
_WAY = r"displ?\.?(?:acement)?|verschiebung|d[ée]pl\w*|desplazamiento|spostamento|deslocamento|przem\w*|変位|位移|[udΔ]"
_KINDS = {
    "before": re.compile(_PLACE + r"[ _.]*(?:und\w*|ref\w*|unv\w*|0)", re.IGNORECASE),
    "place": re.compile(_PLACE, re.IGNORECASE),
    "moved": re.compile(rf"(?:{_WAY})[ _.-]*([xyz])|([xyz])[ _.-]*(?:{_WAY})|([uvw])", re.IGNORECASE),
    "frame": re.compile(FRAME, re.IGNORECASE),
    "time": re.compile(r"(?:time|zeit|temps|tiempo|tempo|t)\b.*", re.IGNORECASE),
    "sigma": re.compile("sigma", re.IGNORECASE),
}
"""Columns' names, and the axis in them; what is certainly before the test says so."""
_MULTIDIC = ("x_undeformed", "y_undeformed", "z_undeformed", "u", "v", "w")
_AXES = {"u": "x", "v": "y", "w": "z"}
_LOST = re.compile(
    r"(?<![^;,\t ])(?:-?nan(?:\(ind\))?|n/?a|null|--)(?![^;,\t ])|(?<=[;,\t]) *(?=[;,\t]|$)", re.IGNORECASE
)
"""What stands, or doesn't, for a point that was lost."""
_MOSTLY = 0.9
_NEAR = 0.02
"""Over the distance of neighbouring points, that up to which two are one, and up to which one hasn't moved far."""
_OF_NEIGHBOURS = 0.5
"""Share of a frame's middle displacement: where neighbours move farther, a point that rests was lost."""


type _Columns = dict[str, Column]
"""Columns of points by kind and axis, as ``place x``."""


def read_points(paths: Sequence[Path], laid: LaidFrames) -> FloatArray:
    """Read what a camera's software exported.

    Parameters
    ----------
    paths
        One file, or one a frame.
    laid
        What it doesn't say.

    Returns
    -------
    (n, 5) array
        Time on the recording's clock, s; where a point was before the test and how far it has moved since, mm.

    Raises
    ------
    InputError
        If it has no such points, can be read in two ways, or something that it doesn't say isn't given.
    """
    path = paths[0]
    frames: list[tuple[Stated, _Columns]] = []
    for path in paths:
        every = ((said or number_in_name(path, paths), columns) for said, columns in _frames_of(path))
        own = [(said, of) for said, of in every if all(np.isfinite(one.values).any() for one in of.values())]
        if not own:
            problem = "no table names x and y of points and how far they moved in both (ux, uy), with a number of these"
            raise InputError(path, "columns", problem, "export them so, or Ncorr's .mat with formatted displacements")
        frames += own
    times, needed = clock_of(path, [said for said, _ in frames], laid)
    first = frames[0][1]
    at = {key[-1]: np.nanmedian(one.values) + 0.0 for key, one in first.items() if key.startswith(("place", "before"))}
    middle = ", ".join(f"{axis} {one:.2f}" for axis, one in at.items())
    needed |= {
        "axes": 'those of the file that lie across and along, or on our x and y, as ["x", "-y"]',
        "origin": f"where our origin is along them, in the file's numbers (the points' middle: {middle})",
        **({"mm_each": "mm a pixel"} if None in [_unit(path, one) for key, one in first.items() if " " in key] else {}),
    }
    laid.ask(path, needed)
    axes = [axis[-1] for axis in laid.axes or []]
    if not len(axes) == len(laid.origin or []) == 2 or any(f"moved {axis}" not in first for axis in axes):
        raise InputError(path, "axes", f"{axes} and origin {laid.origin} aren't two each of the file's", "correct them")
    both = [_of_axes(path, one, laid) for _, one in frames]
    _check_told_apart(path, both)
    if not all(f"before {axis}" in one for _, one in frames for axis in axes):
        both = _before(path, both)
        _check_told_apart(path, both)
    return np.vstack([np.column_stack([np.full(len(one[0]), t), *one]) for t, one in zip(times, both, strict=True)])


def _of_axes(path: Path, columns: _Columns, laid: LaidFrames) -> tuple[FloatArray, FloatArray]:
    """Return where points are along our axes, and how far they have moved, (n, 2), mm."""
    found = []
    for axis, zero in zip(laid.axes or [], laid.origin or [], strict=True):
        at, by = columns.get(f"before {axis[-1]}") or columns[f"place {axis[-1]}"], columns[f"moved {axis[-1]}"]
        sign = -1.0 if axis.startswith("-") else 1.0
        found.append(sign * (_unit(path, at) or laid.mm_each or 1.0) * (at.values - zero))
        found.append(sign * (_unit(path, by) or laid.mm_each or 1.0) * by.values)
    both = np.column_stack(found)
    both = both[np.isfinite(both).all(axis=1)]
    place, moved = both[:, ::2], both[:, 1::2]
    rests = (moved == 0).all(axis=1)
    if 0 < rests.sum() < len(both) - 3:
        # What wasn't followed may stand as 0: it does where neighbours have moved, by more than is lost in rounding.
        size = np.linalg.norm(moved[~rests], axis=1)
        away, near = KDTree(place[~rests]).query(place[rests], 3)
        rests[rests] = size[near].mean(axis=1) > np.maximum(_OF_NEIGHBOURS * np.median(size), _NEAR * away[:, 0])
        place, moved = place[~rests], moved[~rests]
    return place, moved


def _check_told_apart(path: Path, frames: Sequence[tuple[FloatArray, FloatArray]]) -> None:
    """Refuse frames of which one holds more than a few points twice."""
    for place in (place for place, _ in frames if len(place) > 1):
        apart = np.linalg.norm(np.ptp(place, axis=0)) / np.sqrt(len(place))
        if np.mean(KDTree(place).query(place, 2)[0][:, 1] < _NEAR * apart) > 1 - _MOSTLY:
            raise InputError(path, "frames", "points stand several times in one", "export the frame's number with them")


def _before(path: Path, frames: Sequence[tuple[FloatArray, FloatArray]]) -> list[tuple[FloatArray, FloatArray]]:
    """Return frames with points where they were before the test: as they stand, or without what they have moved.

    Raises
    ------
    InputError
        If neither way the frames have the same points, or there is one frame alone.
    """
    away = []
    for back in (0.0, 1.0):
        first, *others = [place - back * moved for place, moved in frames if len(place)]
        tree = KDTree(first)
        apart = float(np.median(tree.query(first, 2)[0][:, 1]))
        away.append(max((float(np.median(tree.query(one)[0])) / apart for one in others), default=np.inf))
    if min(away) > _NEAR:
        problem = "they don't show whether x and y are where points were before the test, or where they went"
        remedy = "export several frames of the same points, the first before the test, or x_undeformed and y_undeformed"
        raise InputError(path, "frames", problem, remedy)
    return [(place - moved if away[1] < away[0] else place, moved) for place, moved in frames]


def _frames_of(path: Path) -> Iterator[tuple[Stated, _Columns]]:
    """Yield the frames in a file: those that a column tells apart, or its tables."""
    check_size(path, path.stat().st_size)
    with path.open("rb") as file:
        begin = file.read(6)
    tables: Iterable[tuple[Stated, Sequence[Column]]]
    if begin == b"MATLAB":
        try:
            tables = list(_of_matlab(path))
        except Exception as error:  # a damaged file, or displacements that weren't formatted: whatever isn't there
            problem = f"can't be read as Ncorr's or MultiDIC's ({' '.join(str(error).split())[:80]})"
            raise InputError(path, "file", problem, "format displacements, and save it again") from error
    elif begin[:4] in (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"):
        tables = (
            (stated_in(sheet.name) or {"number": float(k)}, sheet.columns) for k, sheet in enumerate(read_sheets(path))
        )
    else:
        tables = _of_text(path)
    for said, table in tables:
        columns = _named(path, table)
        if columns and "sigma" in columns:
            columns = _kept(columns, columns.pop("sigma").values >= 0)
        by = next((columns.pop(key) for key in ("time", "frame") if key in columns), None)
        if columns and by is None:
            yield said, columns
        elif columns and by is not None and by.is_time and by.quantity != "time":
            raise InputError(path, by.name, "the column has no unit of time", "call it time_s, in s")
        elif columns and by is not None:
            for one in np.unique(by.values):
                stated = {"time": one * by.factor} if by.is_time else {"number": one}
                yield stated, _kept(columns, by.values == one)


def _kept(columns: _Columns, rows: NDArray[np.bool_]) -> _Columns:
    return {key: replace(one, values=one.values[rows]) for key, one in columns.items()}


def _of_text(path: Path) -> Iterator[tuple[Stated, Sequence[Column]]]:
    """Yield a text's tables, without the points that were lost, and what is stated above them."""
    names: list[str] = []
    frames = [
        (said, [(line, len(_LOST.findall(line)) if of_numbers(line) else None) for line in lines])
        for said, lines in split_frames(decoded(path)[0])
    ]
    least = min((lost for _, lines in frames for _, lost in lines if lost is not None), default=0)
    for said, lines in frames:
        first = next(k for k, (_, lost) in enumerate(lines) if lost is not None)
        names = [line for line, _ in lines[:first] if line.strip()] or names
        # Names may stand anew with nothing else to part frames.
        parts: list[list[str]] = [[]]
        for line, lost in lines[first:]:
            if line.strip() and [line] == names[-1:]:
                parts.append([])
            elif lost in (None, least):
                parts[-1].append(line)
        for k, part in enumerate(parts):
            stated = said if len(parts) == 1 else {"number": float(k)}
            try:
                sheets = read_text(path, "\n".join([*names, *part])) if part else []
            except InputError as error:  # its lines are counted within the frame
                frame = "".join(f"{name} {one:g}, " for name, one in stated.items())
                raise error.at(field=f"{frame}{error.field}") from None
            yield from ((stated, sheet.columns) for sheet in sheets)


def _named(path: Path, columns: Sequence[Column]) -> _Columns:
    """Return the columns of points, and of frames, by what they are; none of another table.

    Raises
    ------
    InputError
        If two may be the same.
    """
    found: _Columns = {}
    for column in columns:
        name = _PIXELS.sub("", column.name).strip()
        matches = ((kind, words.fullmatch(name)) for kind, words in _KINDS.items())
        for kind, match in [(kind, match) for kind, match in matches if match][:1]:
            axis = next(filter(None, match.groups()), "").lower()
            key = f"{kind} {_AXES.get(axis, axis)}".strip()
            if key in found:
                problem = f"'{found[key].name}' and '{column.name}' may be the same"
                raise InputError(path, "columns", problem, "export one of them")
            found[key] = column
    axes = [{key[-1] for key in found if key.startswith(kinds)} for kinds in (("place", "before"), "moved")]
    return found if len(axes[0] & axes[1] & set("xyz")) > 1 else {}


def _unit(path: Path, column: Column) -> float | None:
    """Return a column's unit in mm; None for pixels, and where it states none."""
    if column.quantity == "displacement":
        return column.factor
    if column.unit is None or _PIXELS.match(column.unit):
        return None
    raise InputError(path, column.name, f"'{column.unit}' is not a unit of length", "export it in mm or in pixels")


def _of_matlab(path: Path) -> Iterator[tuple[Stated, Sequence[Column]]]:
    """Yield the frames of Ncorr's or MultiDIC's .mat."""
    content = content_of_matlab(path, ["data_dic_save", "DIC3DPPresults"])
    if "data_dic_save" in content:
        info, shown = content["data_dic_save"]["dispinfo"], content["data_dic_save"]["displacements"]
        unit = str(info["units"])
        scale = float(info["pixtounits"]) if unit_named(unit) else 1.0
        both = (_listed(shown[f"plot_{one}_ref_formatted"]) for one in "uv")
        for k, (u, v) in enumerate(zip(*both, strict=True), 1):
            at = np.nonzero((u != 0) | (v != 0))
            row, column = (scale * (1.0 + (float(info["spacing"]) + 1.0) * one) for one in at)
            values = {"x_undeformed": column, "y_undeformed": row, "u": u[at], "v": v[at]}
            yield {"number": float(k)}, [Column(name, unit, one) for name, one in values.items()]
    elif "DIC3DPPresults" in content:
        points = _listed(content["DIC3DPPresults"]["Points3D"])
        for k, one in enumerate(points):
            columns = np.hstack([points[0], one - points[0]]).T
            yield {"number": float(k)}, [Column(name, None, own) for name, own in zip(_MULTIDIC, columns, strict=True)]


def _listed(frames: Any) -> list[FloatArray]:
    """Return arrays of frames; MATLAB keeps one alone without a list."""
    return [np.asarray(one, dtype=np.float64) for one in (frames if isinstance(frames, list) else [frames])]
