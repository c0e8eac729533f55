"""TOML files of users against a schema, with errors in words."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Annotated, Any, ClassVar, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from legfem.common.errors import InputError
from legfem.common.text_file import text_of

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1)]
Title = Annotated[str, Field(min_length=1, pattern=r"^[^\x00-\x1f\x7f]*$", max_length=500)]
"""Of one line: it is shown on terminals and pages."""
PlainName = Annotated[str, Field(pattern=r"^\w[\w. -]*$", max_length=100)]
"""Of a file or folder too: results are written under it, and must not leave their folder."""


class FileTable(BaseModel):
    """A table of a file: no unknown keys, no conversion of types."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True)
    alternatives: ClassVar[tuple[str, ...]] = ()
    """Tables in it of which one is given."""


def parse_toml[File: BaseModel](path: Path, schema: type[File], holder: str) -> File:
    """Read and check a TOML file.

    Parameters
    ----------
    path : Path
        The file.
    schema : type
        Of its content.
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
    try:
        return tomllib.loads(text_of(path, f"{holder} holds {path.name}", "save it as UTF-8"))
    except ValueError as error:  # of the syntax, or a number of thousands of digits
        raise InputError(
            path, "TOML", str(error), "correct the syntax (texts in quotes, decimals with points)"
        ) from None
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
    """Return an error that a validator raises for one of its table's keys."""
    return PydanticCustomError("legfem", "{problem}", {"key": key, "problem": problem, "remedy": remedy})


def _in_words(path: Path, error: ValidationError, schema: type[BaseModel]) -> InputError:
    # A misspelt key shows up twice, as unknown and as missing: the first says more.
    details = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    first = details[0]
    # Where a value may be one of several types, the location ends in the type's name.
    keys = [str(part) for part in first["loc"]]
    context: dict[str, Any] = first.get("ctx") or {}
    if first["type"] == "legfem":
        return InputError(path, ".".join([*keys, context["key"]]), context["problem"], context["remedy"])
    problem, remedy = _explain(first, keys, context, schema)
    return InputError(path, ".".join(keys), problem, remedy)


def _explain(error: ErrorDetails, keys: list[str], context: dict[str, Any], schema: type[BaseModel]) -> tuple[str, str]:
    given = error["input"]
    match error["type"]:
        case "extra_forbidden":
            known = _known_keys(keys[:-1], schema)
            near = difflib.get_close_matches(keys[-1], known, n=1, cutoff=0.5)
            return "unknown key", (f"did you mean '{near[0]}'?" if near else f"known keys here: {', '.join(known)}")
        case "missing":
            return "missing", "add it"
        case "greater_than" | "greater_than_equal" | "less_than_equal":
            bounds = {"gt": "above", "ge": "at least", "le": "at most"}
            words = " and ".join(f"{w} {context[k]:g}" for k, w in bounds.items() if k in context)
            unit = keys[-1].rpartition("_")[2]
            return f"{given} is out of range", f"give a value {words}, in {unit}"
        case "float_type" | "finite_number":
            return f"{given!r} is not a finite number", "write a number without quotes"
        case "literal_error":
            near = difflib.get_close_matches(str(given), _choices(context), n=1)
            return f"unknown value {given!r}", (f"did you mean '{near[0]}'?" if near else f"use {context['expected']}")
        case "string_pattern_mismatch" if context["pattern"].startswith("^[^"):
            return f"{given!r} holds a line's end or another control character", "take it out"
        case "string_pattern_mismatch":
            return f"{given!r} is no plain name", (
                "begin with a letter or digit, and use these, dots, dashes, underscores and spaces"
            )
        case "too_short" | "too_long":
            return f"{given!r} has the wrong length", "write [x, y]"
        case _:
            return f"{error['msg']} (given {given!r})", "correct it"


def _choices(context: dict[str, Any]) -> list[str]:
    return [word.strip("' ") for word in str(context["expected"]).replace(" or ", ",").split(",")]


def _known_keys(keys: list[str], schema: type[BaseModel]) -> list[str]:
    model = schema
    for key in keys:
        # In an array of tables the number of the table stands between.
        if key.isdigit():
            continue
        annotation = model.model_fields[key].annotation
        candidates = [annotation, *get_args(annotation)]
        model = next(c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel))
    return list(model.model_fields)
