"""Pressure films and mats, as their makers' software exports them: grids of sensels by frames.

Tekscan's ``.asf`` and CSV and XSENSOR's CSV have a grid a frame, below a line with the frame's number; novel's
``.asc`` has a frame a row, below a line with the sensels' numbers. Where Tekscan writes ``B`` there is no sensel.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.data.formats.frames import LaidFrames, Stated, clock_of, number_in_name, of_numbers, split_frames
from legfem.data.formats.labels import unit_named
from legfem.data.formats.lines import decoded
from legfem.data.formats.sheet import check_size
from legfem.geometry.indenter import Indenter

_STATED = {
    "unit": r"^\W*units?\W+([^\s,;\"]+)",
    "frame_s": r"^\W*SECONDS_PER_FRAME\W+([\d.,]+)|time per frame\W+secs?\W+([\d.,]+)",
    "count": r"^\W*(?:cols|columns)\W+(\d+)",
    "rows": r"^\W*row_spacing\W+([\d.,]+)[\s,]*mm",
    "columns": r"^\W*col_spacing\W+([\d.,]+)[\s,]*mm",
}
"""What a heading may state: unit, time of a frame, number of columns, mm from a row to the next, and from a column."""
_BRACKETED = re.compile(r"[(\[]([kM]?Pa|N/cm[²2]|mmHg|psi)[)\]]")
_BY_ROW = re.compile(r"\W*time\W*(?P<unit>[a-z]*)\W+1\W+2\b", re.IGNORECASE)
"""Above rows of a frame each."""
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
_QUOTED = re.compile(r'^"(.*)"$')
_NONE = re.compile(r"b|nan(\(ind\))?|n/?a|null|-*", re.IGNORECASE)
_WHOLE = re.compile(r"\s*\d+(?:\s*,\s*\d+)+\s*")
"""Between commas, where they may be decimal ones."""
_COMMAS = re.compile(r",\s*\S+\s*,|^[^\s,]+,\s*[^\s,]+$")
"""Between cells: not behind a space and digits, where they are decimal ones."""
_WIDEST_DEG = 90.0
_FEWEST_AT_LIMIT, _GOES_ON = 3, 0.1
"""Frames with one greatest reading, over which the mean rises by such a share."""
_BESIDE = 0.1
"""Share of the greatest pressure that sensels may read which can't touch the face."""


def read_film(paths: Sequence[Path], laid: LaidFrames, indenter: Indenter) -> FloatArray:
    """Read a film that lies around the cylinder.

    Parameters
    ----------
    paths
        One file, or one a frame.
    laid
        What it doesn't say.
    indenter
        The cylinder.

    Returns
    -------
    (n, 3) array
        Time on the recording's clock, s; a sensel's angle from the face's deepest point, degrees; mean pressure along
        the cylinder, kPa: NaN of lost readings, infinite where a sensel is at its limit.

    Raises
    ------
    InputError
        If it has no such frames, or something that it doesn't say isn't given.
    """
    path, files = paths[0], [_film(one, laid) for one in paths]
    stated, frames = files[0][0], [frame for _, own in files for frame in own]
    said = [of or number_in_name(one, paths) for one, (_, own) in zip(paths, files, strict=True) for of, _ in own]
    shapes = {grid.shape for _, grid in frames}
    if len(shapes) != 1 or not said[0]:
        problem = f"has {len(frames)} frames, of {len(shapes)} shapes, and no numbers of frames or times"
        raise InputError(path, "frames", problem, "export every frame of the film, calibrated, as CSV or .asf")
    times, needed = clock_of(path, said, laid, float(stated["frame_s"]) if "frame_s" in stated else None)
    counts = dict(zip(("rows", "columns"), *shapes, strict=True))
    axis = laid.axes[0] if laid.axes else "columns"
    side = axis.strip("-")
    needed |= {
        "axes": '["columns"], whose number grows around the cylinder to the left of the travel, or ["-rows"]',
        "origin": f"[number of the one at the face's deepest point, from 1; it has {counts}]",
        **({} if side in stated else {"mm_each": "mm from a sensel to the next around the cylinder"}),
        **({} if "unit" in stated else {"unit": "that of the pressures"}),
    }
    if side not in counts or len(laid.origin or [0.0]) != 1:
        raise InputError(path, "axes", "aren't a film's one", f"give axes = {needed['axes']}, and one number as origin")
    laid.ask(path, needed, ("lines", "grid"))
    unit = unit_named(stated.get("unit", laid.unit or ""))
    if unit is None or unit.quantity != "pressure":
        raise InputError(path, "unit", f"'{stated.get('unit')}' is none of pressure", "export it calibrated")
    steps = {key: float(stated.get(key, laid.mm_each or 1.0)) for key in counts}
    grids = mpa_to_kpa(unit.factor) * np.array([one if side == "columns" else one.T for _, one in frames])
    apart = steps["rows" if side == "columns" else "columns"]
    pressure = _along(path, grids, laid, apart, indenter.length, _limit(grids))
    angle = np.rad2deg((np.arange(1, counts[side] + 1) - (laid.origin or [0.0])[0]) * steps[side] / indenter.radius)
    beside = np.abs(angle) > _WIDEST_DEG
    if np.nanmax(pressure[:, beside], initial=0.0) > _BESIDE * np.nanmax(pressure[:, ~beside], initial=0.0):
        problem = f"sensels beyond {_WIDEST_DEG:g} degrees, where nothing touches, read as others do"
        raise InputError(path, "origin", problem, f"give origin = {needed['origin']}")
    frame, sensel = np.nonzero(np.broadcast_to(~beside, pressure.shape))
    signed = -angle if axis.startswith("-") else angle
    return np.column_stack([times[frame], signed[sensel], pressure[frame, sensel]])


def _limit(grids: FloatArray) -> float:
    """Return the reading at which sensels (frames, m, n) are at their limit, while others go on; infinite of none."""
    top = float(np.nanmax(grids))
    means = np.nanmean(grids[np.nanmax(grids, axis=(1, 2)) == top], axis=(1, 2))
    return top if len(means) >= _FEWEST_AT_LIMIT and np.ptp(means) > _GOES_ON * means.max() else np.inf


def _along(path: Path, grids: FloatArray, laid: LaidFrames, apart: float, length: float, limit: float) -> FloatArray:
    """Return the means (frames, n) of what sensels (frames, m, n) read along a cylinder of a length.

    NaN of none; infinite where one of them is at its limit: the mean was more than it would be.

    Raises
    ------
    InputError
        If more of them are taken than lie on it, mm.
    """
    count = grids.shape[1]
    first, last = laid.lines or (1, count)
    if not 1 <= first <= last <= count or (last - first) * apart > length + apart:
        problem = f"{first} to {last} of {count}, {apart:g} mm apart, don't lie on a cylinder of {length:g} mm"
        raise InputError(path, "lines", problem, "give lines = [first, last], those that lie on it, counted from 1")
    taken = grids[:, first - 1 : last]
    there = np.isfinite(taken).sum(axis=1)
    means = np.where(there > 0, np.nansum(taken, axis=1) / np.maximum(there, 1), np.nan)
    return np.where((taken >= limit).any(axis=1), np.inf, means)


def _film(path: Path, laid: LaidFrames) -> tuple[dict[str, str], list[tuple[Stated, FloatArray]]]:
    """Return what a file's heading states, and its frames of (rows, columns).

    Raises
    ------
    InputError
        If its rows differ in length, aren't as many as it states, or may have decimal commas between commas.
    """
    check_size(path, path.stat().st_size)
    text = decoded(path)[0]
    found = {key: re.search(words, text, re.IGNORECASE | re.MULTILINE) for key, words in _STATED.items()}
    stated = {key: next(filter(None, one.groups())).replace(",", ".") for key, one in found.items() if one}
    bracketed = set(_BRACKETED.findall(text))
    stated |= {"unit": bracketed.pop()} if "unit" not in stated and len(bracketed) == 1 else {}
    by_row = _BY_ROW.search(text)
    frames = split_frames(text[text.find("\n", by_row.end()) :] if by_row else text)
    lines = [[line for line in own if of_numbers(line)] for _, own in frames]
    grids = [[_numbers_in(path, line) for line in own] for own in lines]
    widths = {len(row) for rows in grids for row in rows} | ({int(stated["count"])} if "count" in stated else set())
    unsure = "count" not in stated and all(_WHOLE.fullmatch(line) for own in lines for line in own)
    if len(widths) > 1 or (widths and unsure):
        problem = f"have {' or '.join(map(str, sorted(widths)))} numbers: there may be decimal commas between commas"
        raise InputError(path, "rows", problem, "export them with semicolons or tabs between numbers")
    if not by_row:
        return stated, [(said, np.array(rows)) for rows, (said, _) in zip(grids, frames, strict=True)]
    count = sum(widths) - 1
    laid.ask(path, {"grid": f"[rows, columns] of its {count} sensels"}, tuple(laid.laid))
    unit, grid = unit_named(by_row["unit"]), laid.grid or []
    if unit is None or np.prod(grid) != count:
        raise InputError(path, "grid", f"{grid} isn't that of its {count} sensels", "correct it")
    return stated, [({"time": row[0] * unit.factor}, np.reshape(row[1:], grid)) for rows in grids for row in rows]


def _numbers_in(path: Path, line: str) -> list[float]:
    """Return the numbers in a line; NaN where there is no sensel, or it was lost.

    Raises
    ------
    InputError
        If a cell is anything else.
    """
    delimiter = next((one for one in "\t;" if one in line), "," if _COMMAS.search(line) else None)
    cells = [_QUOTED.sub(r"\1", one.strip()) for one in line.strip().removesuffix(delimiter or " ").split(delimiter)]
    plain = cells if delimiter == "," else [one.replace(",", ".") for one in cells]
    if odd := next((one for one in plain if not (_NUMBER.fullmatch(one) or _NONE.fullmatch(one))), None):
        raise InputError(path, "rows", f"'{odd}' is no reading", "correct it, or write B where there is no sensel")
    return [float(one) if _NUMBER.fullmatch(one) else float("nan") for one in plain]
