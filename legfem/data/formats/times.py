"""Times that stand in a table otherwise than as seconds: as a clock's, or as a sampling rate in the heading."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data.formats.headings import Cell, cell_at, line_of, text_of
from legfem.data.formats.labels import unit_named

CLOCK = re.compile(
    r"(?:[^:]*[T\s])?(?P<h>\d{1,3}):(?P<m>\d{1,2})(?::(?P<s>\d{1,2}))?(?:(?P<mark>[.,:])(?P<part>\d+))?"
    r"\s*(?:(?P<half>[ap])\.?\s?m\.?)?(?:Z|\s?[+-]\d\d:?\d\d)?",
    re.IGNORECASE,
)
"""A time of day with perhaps a date before it."""
_DAY_S = 86400.0
_MOST_FRAMES = 60
BY_RATE = "the time is counted from the heading's"
"""Begins the remark on a table whose time is the samples' number over their rate."""


def with_clock(
    path: Path, rows: Sequence[Sequence[Cell]], samples: range, width: int
) -> tuple[Sequence[Sequence[Cell]], int] | None:
    """Return rows whose one column of a clock's times is in seconds since the first, and its place; None without.

    Raises
    ------
    InputError
        If a clock's last two figures may count a film's frames.
    """
    for c in range(width):
        cells = [(k, cell_at(rows[k], c)) for k in samples]
        times = [(k, _seconds_of(cell)) for k, cell in cells if cell not in (None, "")]
        if not times or any(time is None for _, time in times):
            continue
        read = np.array([time for _, time in times], dtype=np.float64)
        if np.ptp(read) == 0:
            continue  # of a date
        _check_frames(path, [text_of(cell) for _, cell in cells])
        # After midnight a clock begins anew.
        days = np.cumsum(np.diff(read, prepend=read[0]) < -_DAY_S / 2)
        seconds = dict(zip((k for k, _ in times), (read + days * _DAY_S - read[0]).tolist(), strict=True))
        return [[*row[:c], seconds[k], *row[c + 1 :]] if k in seconds else row for k, row in enumerate(rows)], c
    return None


def _seconds_of(cell: Cell) -> float | None:
    """Return the seconds since midnight that a clock shows; None where it is no clock, or ``12:30`` may be minutes."""
    found = CLOCK.fullmatch(cell.strip()) if isinstance(cell, str) else None
    if found is None or (found["s"] is None and found["part"] is None):
        return None
    hours, minutes = int(found["h"]), int(found["m"])
    part = float(f"0.{found['part'] or 0}")
    if found["s"] is None:
        return 60.0 * hours + minutes + part
    if found["half"]:
        hours = hours % 12 + 12 * (found["half"].lower() == "p")
    return 3600.0 * hours + 60.0 * minutes + int(found["s"]) + part


def _check_frames(path: Path, cells: Sequence[str]) -> None:
    """Refuse clocks of four numbers whose last never reaches 60: hundredths of a second would."""
    found = [clock for cell in cells if (clock := CLOCK.fullmatch(cell))]
    last = [clock["part"] or "" if clock["mark"] == ":" and clock["s"] else "" for clock in found]
    if last and all(len(part) == 2 for part in last) and max(map(int, last)) < _MOST_FRAMES:
        problem = f"the last two figures of '{cells[0]}' may count frames, since none is {_MOST_FRAMES} or more"
        raise InputError(path, "time", problem, "export time in seconds since the start")


_OF_SAMPLING = re.compile(
    r"sampl|abtast|mess(?:rate|freq|interv)|échantillon|muestre|campionament|amostra|próbkow|дискретиз|采样|取样|サンプ"
    r"|(?:acquisition|data|log(?:ging)?|scan|record(?:ing)?)[ _-]*(?:rate|freq|interval)|^interval|channels?\s+at",
    re.IGNORECASE,
)
_NUMBER = r"(?P<number>\d+(?:[.,]\d+)?)"
_A_SECOND = re.compile(rf"{_NUMBER}\s*(?P<kilo>k?)(?:hz|s/s|samples?\s*(?:/|per)\s*s(?:ec(?:ond)?)?)\b", re.IGNORECASE)
_IN_LABEL = re.compile(rf"[(\[]\s*(?P<unit>\w+)\s*[)\]]\W*{_NUMBER}\s*$")
_EACH = re.compile(rf"{_NUMBER}\s*(?P<unit>[^\W\d_]+)\.?(?:\s*(?:/|per)\s*samples?)?\s*$", re.IGNORECASE)
_OF_STEPS = re.compile(
    r"interval|period|\bstep|/\s*sample|per sample|période|periodo|período|intervalo|間隔|周期", re.IGNORECASE
)
_COUNTED = re.compile(
    r"(?:samples?|index|points?|record|row|reading|scan|frame|count|no|nr|num|number|n|#|序号|番号|№)"
    r"[ .#]*(?:no|nr)?\.?",
    re.IGNORECASE,
)
_LEAST_S, _LONGEST_S = 0.5, 20_000.0
"""Bounds of a test's duration by a rate that is believed."""


def times_by_rate(
    above: Sequence[Sequence[Cell]], names: Sequence[str], values: FloatArray
) -> tuple[FloatArray, str] | None:
    """Return the times (n,) of samples that have none, in s, and what the heading says of their rate.

    None without such a rate, or with several. Where a column counts the samples, those that are missing leave gaps.

    Parameters
    ----------
    above : rows of cells
        The heading.
    names : sequence of str
        Names of the columns.
    values : (n, columns) array
        The samples.
    """
    told = {step: text for row in above if (text := line_of(row).strip()) and (step := _step_of(text))}
    if len(told) != 1:
        return None
    ((step, text),) = told.items()
    counted = [v for name, v in zip(names, values.T, strict=True) if _COUNTED.fullmatch(name.strip())]
    number = next((v - v[0] for v in counted if (np.diff(v) >= 1).all() and (v == np.round(v)).all()), None)
    times = step * (np.arange(len(values)) if number is None else number)
    return (times, text) if _LEAST_S <= times[-1] <= _LONGEST_S else None


def _step_of(text: str) -> float | None:
    """Return the seconds from one sample to the next, as a line of the heading states them; None where it doesn't."""
    if not _OF_SAMPLING.search(text):
        return None
    if rate := _A_SECOND.search(text):
        return _over(_value(rate["number"]) * (1e3 if rate["kilo"] else 1.0))
    labelled = _IN_LABEL.search(text)
    if labelled and labelled["unit"].lower() in ("hz", "khz"):
        return _over(_value(labelled["number"]) * (1e3 if labelled["unit"][0] in "kK" else 1.0))
    each = labelled or _EACH.search(text)
    unit = unit_named(each["unit"]) if each else None
    if each is None or unit is None or unit.quantity != "time" or not _OF_STEPS.search(text):
        return None
    return _value(each["number"]) * unit.factor or None


def _value(number: str) -> float:
    return float(number.replace(",", "."))


def _over(rate: float) -> float | None:
    return 1.0 / rate if rate else None


_STAMPS = ((1.9e11, 2.1e11), (1.9e13, 2.1e13), (1.9e16, 2.1e16))
"""Years, months, days, hours, minutes, seconds and milliseconds as the figures of one number."""
_SIXTIES = {100.0: "hours, minutes and seconds (hhmmss)", 1.0: "minutes and seconds (m.ss)"}
"""What a number counts whose last part begins anew at 60, by the number's unit before that part."""


def check_no_clock(path: Path, name: str, unit: str | None, values: FloatArray) -> None:
    """Check that the times (n,) of a column aren't a date's, or a clock's hours, minutes and seconds, as one number.

    Raises
    ------
    InputError
        If they are.
    """
    field, remedy = f"column '{name}'", "export time in seconds since the start"
    if not unit and any(low <= values[0] and values[-1] <= high for low, high in _STAMPS):
        raise InputError(path, field, f"has dates as numbers ({values[0]:.0f})", remedy)
    steps = np.diff(values)
    step = float(np.median(steps)) if len(steps) else 0.0
    for whole, what in _SIXTIES.items():
        parts = np.mod(values, whole) / whole
        begun = np.flatnonzero(np.diff(np.floor(values / whole)) >= 1)
        small = 3.0 * step / whole
        jumps = (parts[begun] > 0.6 - small) & (parts[begun + 1] < small) & (steps[begun] > 5.0 * step)
        if 0 < small < 0.3 and len(begun) and (parts < 0.6).all() and jumps.all():
            k = int(begun[0])
            problem = f"jumps from {values[k]:.10g} to {values[k + 1]:.10g}: it may count {what}"
            raise InputError(path, field, problem, remedy)
