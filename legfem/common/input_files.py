"""Files that users hand over, read strictly: text, comma-separated tables, and TOML against a schema."""

import codecs
import csv
import difflib
import math
import re
import stat
import tomllib
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from datetime import date, time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, Self, get_args

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from legfem.common.errors import MISSING, InputError, Remedy, remedy_for_missing
from legfem.common.toml_mistakes import why_no_toml

if TYPE_CHECKING:
    import pandas as pd


LAB = "lab.toml"
"""What a lab's folders have alike: in a folder itself, or in one of the two above it."""


def lab_of(folder: Path) -> Path | None:
    """Return the nearest ``lab.toml``, in a folder or the two above it."""
    nearest = (folder, *folder.absolute().parents[:2])
    return next((one for above in nearest if (one := above / LAB).is_file()), None)


def read_text(path: Path, missing: str | Remedy, remedy: str | Remedy) -> str:
    """Return a file's text, without a byte order mark.

    Parameters
    ----------
    path : Path
        The file; what never ends (a pipe, a device) isn't opened.
    missing : str or Remedy
        What to do if it isn't there.
    remedy : str or Remedy
        What to do if it can't be read.

    Raises
    ------
    InputError
        If it is missing, no plain file, or neither UTF-8 nor UTF-16 with its mark.
    """
    try:
        if stat.S_IFMT(path.stat().st_mode) in (stat.S_IFREG, stat.S_IFDIR):
            raw = path.read_bytes()
            wide = raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
            text = raw.decode("utf-16" if wide else "utf-8-sig").replace("\r\n", "\n")
            if "\0" not in text:
                return text
            raise InputError(path, "file", "contains bytes that are not text (NUL)", remedy)
    except FileNotFoundError:
        raise InputError(path, "file", "not found", remedy_for_missing(path, missing)) from None
    except UnicodeDecodeError as error:
        where = f"byte {error.start + 1} is no UTF-8"
        raise InputError(path, "file", f"can't be read ({where})", remedy) from None
    except OSError as error:
        raise InputError(path, "file", f"can't be read ({error.strerror})", remedy) from None
    raise InputError(path, "file", "can't be read (it is a pipe or a device)", remedy)


def check_printable(*paths: Path) -> None:
    """Check that files' names can be shown and written.

    Raises
    ------
    InputError
        For a line's end, another control character, or bytes that are no UTF-8.
    """
    for path in paths:
        if not path.name.isprintable():
            raise InputError(path, "name", f"{path.name!a} can't be shown", "rename it: letters and digits")


_DECIMAL_COMMA = re.compile(r"^\s*[+-]?\d+,\d+([eE][+-]?\d+)?\s*$")
_DECIMAL_POINT = re.compile(r"^\s*[+-]?\d+\.\d+([eE][+-]?\d+)?\s*$")


def read_table(
    path: Path,
    columns: Sequence[str],
    text: Sequence[str] = (),
    optional: Sequence[str] = (),
    sparse: Sequence[str] = (),
) -> "pd.DataFrame":
    """Read a CSV file whose first line is exactly ``columns``, parted by commas, or by semicolons or tabs.

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
    sparse : sequence of str
        Columns whose cells may be empty: NaN.

    Returns
    -------
    DataFrame
        The rows, numbers as float64; the index is the line number in the file.

    Raises
    ------
    InputError
        For a missing or empty file, a wrong header, decimal commas between commas, cells that are
        missing, not numbers or not finite.
    """
    import pandas as pd

    lines = read_text(path, "check the path", "save it as CSV text").splitlines()
    header = lines[0] if lines else ""
    if not header.strip():
        raise InputError(path, "header", "missing (the first line is empty)", "put the column names in the first line")
    columns = [c for c in columns if c not in optional or c in re.split(r"[,;\t\s]+", header)]
    wanted = ",".join(columns)
    # As spreadsheets write CSV where decimals have commas.
    mark = next((mark for mark in ";\t" if mark in header), ",")
    if mark != "," and "".join(lines[1:2]).count(mark) != header.count(mark):
        problem = f"columns are separated by {'tabs' if mark != ';' else ';'}, and not those of the rows"
        remedy = f"separate columns by commas and write decimals with points: {wanted}"
        raise InputError(path, "header", problem, remedy)
    try:
        found = [name.strip() for name in next(csv.reader([header], delimiter=mark))]
        rows = list(csv.reader(lines[1:], delimiter=mark))
    except csv.Error as error:
        raise InputError(path, "rows", f"can't be split: {error}", f"give rows of {wanted}") from None
    rows = rows if mark == "," else _with_points(path, rows)
    if found != list(columns):
        raise InputError(path, "header", *_header_problem(found, columns))
    numbers = [i + 2 for i, row in enumerate(rows) if any(cell.strip() for cell in row)]
    if not numbers:
        raise InputError(path, "rows", "there are none", f"give rows of {wanted}")
    for n in numbers:
        if (cells := len(rows[n - 2])) != len(columns):
            commas = cells > len(columns)
            problem = f"{cells} cells where {len(columns)} are needed{' (decimal commas?)' if commas else ''}"
            mend = "write decimals with points" if commas else "complete or remove the row"
            raise InputError(path, f"line {n}", problem, f"{mend}; the columns are {wanted}")
    table = pd.DataFrame(
        [[cell.strip() for cell in rows[n - 2]] for n in numbers], columns=pd.Index(columns), index=pd.Index(numbers)
    )
    for name in columns:
        if name not in text:
            filled = table[name] != "" if name in sparse else slice(None)
            table[name] = _numbers(path, table.loc[filled, name]).reindex(table.index)
    return table


def _with_points(path: Path, rows: list[list[str]]) -> list[list[str]]:
    """Return rows with decimal points in place of commas."""
    cells = [cell for row in rows for cell in row]
    commas = next((cell for cell in cells if _DECIMAL_COMMA.match(cell)), None)
    point = next((cell for cell in cells if _DECIMAL_POINT.match(cell)), None)
    if commas is not None and point is not None:
        problem = f"'{commas}' has a decimal comma, and '{point}' a point"
        raise InputError(path, "rows", problem, "write all decimals alike")
    return [[cell.replace(",", ".") if _DECIMAL_COMMA.match(cell) else cell for cell in row] for row in rows]


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


def _numbers(path: Path, column: "pd.Series[str]") -> "pd.Series[float]":
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


Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
# Standard deviations beyond which a unit is another.
LengthError = Annotated[float, Field(ge=0, le=20, allow_inf_nan=False)]
RigError = Annotated[float, Field(ge=0, le=5, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1, pattern=r"^[^\x00]*$")]
Title = Annotated[str, Field(min_length=1, pattern=r"^[^\x00-\x1f\x7f\u202a-\u202e\u2066-\u2069]*$", max_length=500)]
"""Text of one line: it is shown on terminals and pages."""
PlainName = Annotated[str, Field(pattern=r"^\w[\w. -]*$", max_length=100)]
"""A name that a file or folder may have too: results are written under it, and must not leave their folder."""


type Trouble = tuple[str, str, str]
"""The key at fault, the problem, and the remedy."""


class FileTable(BaseModel):
    """A table of a file: no unknown keys, no conversion of types."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True)
    alternatives: ClassVar[tuple[str, ...]] = ()
    """Tables in it of which one is given, or some."""

    def troubles(self) -> Iterable[Trouble]:
        """Yield what is wrong with values that don't go together; the first is told."""
        return ()

    @model_validator(mode="after")
    def _has_no_trouble(self) -> Self:
        for found in self.troubles():
            raise trouble(*found)
        return self


class NamedFile(FileTable):
    """What the file of a leg, a leg in a stocking, or specimens begins with."""

    id: PlainName
    """Short name by which results are called: letters, digits, dots, dashes."""
    title: Title
    """What reports are headed with."""
    origin: Literal["measured", "reconstructed", "simulated"]
    """Where the data come from; reports of simulated or reconstructed data say so."""


def unless_one_of(table: FileTable, key: str, other: str, remedy: str) -> Iterator[Trouble]:
    """Yield a trouble unless a key is given in a table, or another in its place."""
    given = getattr(table, key) is not None
    if given == (getattr(table, other) is not None):
        yield key, f"given beside {other}" if given else MISSING, remedy


def check_distinct(file: Path, field: str, names: Iterable[str], remedy: str) -> None:
    """Check that no name stands twice in what a file, or a folder, states; raises InputError of the field."""
    for name, times in Counter(names).items():
        if times > 1:
            raise InputError(file, field, f"{name!r} stands {times} times", remedy)


def parse_toml[File: BaseModel](path: Path, schema: type[File], holder: str) -> File:
    """Read and check a TOML file.

    Parameters
    ----------
    path : Path
        The file.
    schema : type
        Pydantic model of its content.
    holder : str
        What should hold the file, for the error where it is missing.

    Raises
    ------
    InputError
        For a missing file, TOML that can't be parsed, and keys that are unknown, missing or
        have impossible values. An unknown key is named with the nearest known one.
    """
    return checked(path, read_toml(path, holder), schema)


def read_toml(path: Path, holder: str) -> dict[str, Any]:
    """Return what a TOML file holds, unchecked.

    Raises
    ------
    InputError
        For a missing file, and TOML that can't be parsed.
    """
    text = read_text(path, f"{holder} holds {path.name}", "save it as UTF-8")
    try:
        return tomllib.loads(text)
    except ValueError as error:  # of the syntax, or a number of thousands of digits
        raise InputError(path, "TOML", *why_no_toml(text, error)) from None
    except RecursionError:
        raise InputError(path, "TOML", "is nested too deeply", "flatten it") from None


def checked[File: BaseModel](path: Path, content: object, schema: type[File]) -> File:
    """Return what a TOML file holds as a schema has it.

    Raises
    ------
    InputError
        For keys that are unknown, missing or have impossible values.
    """
    try:
        return schema.model_validate(content)
    except ValidationError as error:
        raise _in_words(path, error, schema) from None


def trouble(key: str, problem: str, remedy: str) -> PydanticCustomError:
    """Return an error for a validator of a table to raise: the key at fault, the problem, and the remedy."""
    return PydanticCustomError("legfem", "{problem}", {"key": key, "problem": problem, "remedy": remedy})


def _in_words(path: Path, error: ValidationError, schema: type[BaseModel]) -> InputError:
    # A misspelt key shows up twice, as unknown and as missing: the first says more.
    first = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")[0]
    # Where a value may be one of several types, the location ends in the type's name.
    keys = [str(part) for part in first["loc"]]
    context: dict[str, Any] = first.get("ctx") or {}
    if first["type"] == "legfem":
        return InputError(path, ".".join([*keys, context["key"]]), context["problem"], context["remedy"])
    problem, remedy = _explain(first, keys, context, schema)
    return InputError(path, ".".join(keys), problem, remedy)


def _explain(error: ErrorDetails, keys: list[str], context: dict[str, Any], schema: type[BaseModel]) -> tuple[str, str]:
    given, numbered = error["input"], keys[-1].isdigit()
    own = "" if numbered else f"{keys[-1]} = "
    match error["type"]:
        case "extra_forbidden":
            known = _known_keys(keys[:-1], schema)
            near = difflib.get_close_matches(keys[-1], known, n=1)
            return "unknown key", (f"did you mean '{near[0]}'?" if near else f"known keys here: {', '.join(known)}")
        case "missing":
            return MISSING, "add it"
        case "greater_than" | "greater_than_equal" | "less_than" | "less_than_equal":
            bounds = {"gt": "above", "ge": "of at least", "lt": "below", "le": "of at most"}
            words = " and ".join(f"{w} {context[k]:g}" for k, w in bounds.items() if k in context)
            unit = re.sub(r"^.*?_((?:[^_]+_per_)?[^_]+)$", r"\1", keys[-1]).replace("_per_", "/")
            least = context.get("ge", context.get("gt", math.inf))
            in_cm = unit == "mm" and 0 < given < least <= 10 * given
            hint = " (if it is in cm, multiply it by 10)" if in_cm else " (0.05 is 5 %)" if unit == "sd" else ""
            of = "" if unit in ("ratio", "sd", keys[-1]) else f", in {unit}"
            return f"{given} is out of range", f"give a value {words}{of}{hint}"
        case "float_type" | "finite_number":
            return f"{given!r} is not a finite number", "write a number without quotes"
        case "literal_error":
            choices = [word.strip("' ") for word in str(context["expected"]).replace(" or ", ",").split(",")]
            near = difflib.get_close_matches(str(given), choices, n=1)
            return f"unknown value {given!r}", (f"did you mean '{near[0]}'?" if near else f"use {context['expected']}")
        case "string_pattern_mismatch" if context["pattern"].startswith("^[^"):
            return f"{given!r} contains a line's end or another control character", "remove it"
        case "string_pattern_mismatch":
            return f"{given!r} is not a plain name", (
                "begin with a letter or digit, and use these, dots, dashes, underscores and spaces"
            )
        case "string_type" | "string_too_short":
            shown = str(given) if isinstance(given, date | time) else repr(given)
            return f"{shown} is not text", f'write it in quotes: {own}"..."'
        case "bool_type":
            return f"{given!r} is neither true nor false", f"write {keys[-1]} = true or {keys[-1]} = false"
        case "list_type":
            return f"{given!r} is not a list", f"write {keys[-1]} = [...], with commas between its parts"
        case "model_type" | "model_attributes_type" | "dict_type":
            table = f"[[{'.'.join(keys[:-1])}]]" if numbered else f"[{'.'.join(keys)}]"
            return f"{given!r} is not a table", f"write {table} on a line of its own, and its keys below"
        case "too_short" | "too_long":
            least = context.get("min_length")
            number = f"{context.get('max_length')} or fewer" if least is None else f"{least} or more"
            return f"{given!r} has the wrong length", f"give {number}"
        case _:
            return f"{error['msg']} (given {given!r})", "correct it"


def _known_keys(keys: list[str], schema: type[BaseModel]) -> list[str]:
    model = schema
    for key in keys:
        # Between them stand the number of a table in an array, or a name that the user gives to one.
        if key not in model.model_fields:
            continue
        annotation = model.model_fields[key].annotation
        candidates = [annotation, *get_args(annotation)]
        model = next(c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel))
    return [field.alias or name for name, field in model.model_fields.items()]
