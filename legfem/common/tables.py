"""Reading comma-separated tables strictly, with errors a person can act on."""

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from legfem.common.errors import InputError
from legfem.common.text_file import text_of

if TYPE_CHECKING:
    import pandas as pd

_DECIMAL_COMMA = re.compile(r"^\s*[+-]?\d+,\d+\s*$")


def read_table(
    path: Path, columns: Sequence[str], text: Sequence[str] = (), optional: Sequence[str] = ()
) -> pd.DataFrame:
    """Read a CSV file whose first line is exactly ``columns``.

    Parameters
    ----------
    path : Path
        The file; UTF-8, with or without a byte-order mark.
    columns : sequence of str
        The header, in order; units stand in the names (``force_N``).
    text : sequence of str
        Columns that hold text; the others hold finite numbers.
    optional : sequence of str
        Columns that may be absent.

    Returns
    -------
    DataFrame
        The rows, numbers as float64; the index is the line number in the file.

    Raises
    ------
    InputError
        For a missing or empty file, a wrong header, semicolons, decimal commas, cells that are
        missing, not numbers or not finite.
    """
    import pandas as pd

    lines = _lines(path)
    header = lines[0]
    columns = [c for c in columns if c not in optional or c in re.split(r"[,;\t\s]+", header)]
    wanted = ",".join(columns)
    if ";" in header or "\t" in header:
        raise InputError(
            path,
            "header",
            f"columns are separated by {'tabs' if chr(9) in header else ';'}",
            f"separate columns by commas and write decimals with points: {wanted}",
        )
    try:
        found = [name.strip() for name in next(csv.reader([header]))]
        rows = list(csv.reader(lines[1:]))
    except csv.Error as error:
        raise InputError(path, "rows", f"can't be split: {error}", f"give rows of {wanted}") from None
    if found != list(columns):
        raise InputError(path, "header", *_header_problem(found, columns))
    numbers = [i + 2 for i, row in enumerate(rows) if any(cell.strip() for cell in row)]
    if not numbers:
        raise InputError(path, "rows", "there are none", f"give rows of {wanted}")
    for n in numbers:
        _check_width(path, n, rows[n - 2], len(columns), wanted)
    table = pd.DataFrame(
        [[cell.strip() for cell in rows[n - 2]] for n in numbers], columns=pd.Index(columns), index=pd.Index(numbers)
    )
    for name in columns:
        if name not in text:
            table[name] = _numbers(path, table[name])
    return table


def _lines(path: Path) -> list[str]:
    lines = text_of(path, "check the path", "save it as CSV text").splitlines()
    if not lines or not lines[0].strip():
        raise InputError(path, "header", "missing (the first line is empty)", "put the column names in the first line")
    return lines


def _header_problem(found: Sequence[str], columns: Sequence[str]) -> tuple[str, str]:
    got, want = ",".join(found)[:120], ",".join(columns)
    if sorted(found) == sorted(columns):
        return f"columns are in another order ({got})", f"order them as {want}"
    for name in columns:
        if name in found:
            continue
        quantity = name.partition("_")[0]
        for other in found:
            if other not in columns and other.partition("_")[0].lower() == quantity:
                return (
                    f"found column '{other}' where '{name}' is needed",
                    f"convert the values to the unit in '{name}' and name the column so",
                )
        near = difflib.get_close_matches(name, [f for f in found if f not in columns], n=1)
        hint = f" (found '{near[0]}')" if near else ""
        return f"column '{name}' is missing{hint}", f"the first line must be {want}"
    extra = next(f for f in found if f not in columns or found.count(f) > 1)
    return f"column '{extra}' is not expected", f"the first line must be {want}"


def _check_width(path: Path, line: int, row: list[str], width: int, wanted: str) -> None:
    if len(row) == width:
        return
    if len(row) > width:
        raise InputError(
            path,
            f"line {line}",
            f"{len(row)} cells where {width} are needed (decimal commas?)",
            f"write decimals with points; the columns are {wanted}",
        )
    raise InputError(
        path,
        f"line {line}",
        f"{len(row)} cells where {width} are needed",
        f"complete or remove the row; the columns are {wanted}",
    )


def _numbers(path: Path, column: pd.Series[str]) -> pd.Series[float]:
    import pandas as pd

    values = pd.to_numeric(column, errors="coerce").astype(np.float64)
    bad = ~np.isfinite(values.to_numpy())
    if not bad.any():
        return values
    line = column.index[int(np.argmax(bad))]
    cell = column.loc[line]
    field = f"{column.name}, line {line}"
    others = f" (and {int(bad.sum()) - 1} more)" if bad.sum() > 1 else ""
    if _DECIMAL_COMMA.match(cell):
        raise InputError(path, field, f"'{cell}' has a decimal comma{others}", "write decimals with points")
    if cell.lower() in ("", "nan", "na", "n/a", "null", "none", "inf", "-inf", "+inf"):
        raise InputError(path, field, f"'{cell}' is not a finite number{others}", "remove the row or record it again")
    raise InputError(path, field, f"'{cell[:40]}' is not a number{others}", "write a number")
