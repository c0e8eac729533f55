"""The schema of ``subject.toml`` and its errors in words."""

from __future__ import annotations

import difflib
import math
import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from legfem.errors import InputError

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Text = Annotated[str, Field(min_length=1)]

# Half-width of a uniform distribution to its standard deviation.
_UNIFORM = 1.0 / math.sqrt(3.0)


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class SectionEntry(_Entry):
    """``[section]``."""

    contours: Text
    fascia_thickness_mm: Positive


class IndenterEntry(_Entry):
    """``[indenter]``."""

    # Below 1 mm it is most likely metres or centimetres.
    diameter_mm: Annotated[float, Field(ge=1.0, le=300.0, allow_inf_nan=False)]
    length_mm: Annotated[float, Field(ge=1.0, le=1000.0, allow_inf_nan=False)]
    aim_mm: Annotated[list[Finite], Field(min_length=2, max_length=2)]
    direction_deg: Finite


class TissueEntry(_Entry):
    """``[tissues.deep]``, ``[tissues.superficial]`` or ``[tissues.fascia]``."""

    law: Literal["neo-hookean", "reduced-polynomial"]
    C10_kPa: Positive | None = None
    C20_kPa: NotNegative | None = None
    D1_per_MPa: Positive
    D2_per_MPa: Positive | None = None

    @model_validator(mode="after")
    def _law_has_parameters(self) -> TissueEntry:
        if self.law == "neo-hookean":
            for key in ("C20_kPa", "D2_per_MPa"):
                if getattr(self, key) is not None:
                    raise _trouble(
                        key,
                        "the neo-Hookean law has no such parameter",
                        f'remove {key} or set law = "reduced-polynomial"',
                    )
        return self


class GivenTissueEntry(TissueEntry):
    """A tissue whose stiffness isn't identified and must be given."""

    @model_validator(mode="after")
    def _stiffness_is_given(self) -> GivenTissueEntry:
        if self.C10_kPa is None:
            raise _trouble("C10_kPa", "missing", "give it; only the deep tissue is identified")
        if self.law == "reduced-polynomial" and self.C20_kPa is None:
            raise _trouble("C20_kPa", "missing", "give it; only the deep tissue is identified")
        return self


class TissuesEntry(_Entry):
    """``[tissues]``."""

    deep: TissueEntry
    superficial: GivenTissueEntry
    fascia: GivenTissueEntry


class InstrumentEntry(_Entry):
    """``[instrument]``: standard deviations, or accuracies and range.

    An accuracy of plus or minus a is read as a uniform distribution of half-width a, whose
    standard deviation is a / sqrt(3).
    """

    force_sd_N: Positive | None = None
    force_accuracy_percent: Positive | None = None
    force_range_N: Positive | None = None
    displacement_sd_mm: Positive | None = None
    displacement_accuracy_mm: Positive | None = None

    @model_validator(mode="after")
    def _each_once(self) -> InstrumentEntry:
        stated = self.force_accuracy_percent is not None or self.force_range_N is not None
        if self.force_sd_N is not None and stated:
            raise _trouble(
                "force_sd_N",
                "given beside accuracy and range",
                "give either force_sd_N or force_accuracy_percent with force_range_N",
            )
        if self.force_sd_N is None:
            for key in ("force_accuracy_percent", "force_range_N"):
                if getattr(self, key) is None:
                    raise _trouble(
                        key if stated else "force_sd_N",
                        "missing",
                        "give force_sd_N, or force_accuracy_percent and force_range_N",
                    )
        if (self.displacement_sd_mm is None) == (self.displacement_accuracy_mm is None):
            missing = self.displacement_sd_mm is None
            raise _trouble(
                "displacement_sd_mm",
                "missing" if missing else "given beside displacement_accuracy_mm",
                "give either displacement_sd_mm or displacement_accuracy_mm",
            )
        return self

    def force_sd(self) -> float:
        """Return the standard deviation of a force reading, N."""
        if self.force_sd_N is not None:
            return self.force_sd_N
        assert self.force_accuracy_percent is not None and self.force_range_N is not None
        return self.force_accuracy_percent / 100.0 * self.force_range_N * _UNIFORM

    def displacement_sd(self) -> float:
        """Return the standard deviation of a displacement reading, mm."""
        if self.displacement_sd_mm is not None:
            return self.displacement_sd_mm
        assert self.displacement_accuracy_mm is not None
        return self.displacement_accuracy_mm * _UNIFORM


class RecordingsEntry(_Entry):
    """``[recordings]``, optional."""

    starts_at_contact: bool = False
    """Whether displacement counts from first touch; else first contact is looked for."""
    plane_strain: bool | None = None
    """Whether a plane-strain model made them, which has no ends; unless given, whether no leg was
    measured."""


class SubjectFile(_Entry):
    """``subject.toml`` as it is written, in the file's units."""

    id: Text
    title: Text
    origin: Literal["measured", "reconstructed", "simulated"]
    section: SectionEntry
    indenter: IndenterEntry
    tissues: TissuesEntry
    instrument: InstrumentEntry | None = None
    recordings: RecordingsEntry = RecordingsEntry()


def parse_subject_file(path: Path) -> SubjectFile:
    """Read and check ``subject.toml``.

    Raises
    ------
    InputError
        For a missing file, TOML that can't be parsed, and keys that are unknown, missing or
        have impossible values. An unknown key is named with the nearest known one.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except FileNotFoundError:
        raise InputError(path, "file", "not found", "a subject folder holds subject.toml") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, "file", f"can't be read ({error})", "save it as UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            path, "TOML", str(error), "correct the syntax (texts in quotes, decimals with points)"
        ) from None
    try:
        return SubjectFile.model_validate(content)
    except ValidationError as error:
        raise _in_words(path, error) from None


def _trouble(key: str, problem: str, remedy: str) -> PydanticCustomError:
    return PydanticCustomError(
        "legfem", "{problem}", {"key": key, "problem": problem, "remedy": remedy}
    )


def _in_words(path: Path, error: ValidationError) -> InputError:
    # A misspelt key shows up twice, as unknown and as missing: the first says more.
    details = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
    first = details[0]
    # Where a value may be one of several types, the location ends in the type's name.
    keys = [str(part) for part in first["loc"]]
    context: dict[str, Any] = first.get("ctx") or {}
    if first["type"] == "legfem":
        return InputError(
            path, ".".join([*keys, context["key"]]), context["problem"], context["remedy"]
        )
    problem, remedy = _explain(first, keys, context)
    return InputError(path, ".".join(keys), problem, remedy)


def _explain(error: ErrorDetails, keys: list[str], context: dict[str, Any]) -> tuple[str, str]:
    given = error["input"]
    match error["type"]:
        case "extra_forbidden":
            known = _known_keys(keys[:-1])
            near = difflib.get_close_matches(keys[-1], known, n=1, cutoff=0.5)
            return "unknown key", (
                f"did you mean '{near[0]}'?" if near else f"known keys here: {', '.join(known)}"
            )
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
            return f"unknown value {given!r}", (
                f"did you mean '{near[0]}'?" if near else f"use {context['expected']}"
            )
        case "too_short" | "too_long":
            return f"{given!r} has the wrong length", "write [x, y]"
        case _:
            return f"{error['msg']} (given {given!r})", "correct it"


def _choices(context: dict[str, Any]) -> list[str]:
    return [word.strip("' ") for word in str(context["expected"]).replace(" or ", ",").split(",")]


def _known_keys(keys: list[str]) -> list[str]:
    model: type[BaseModel] = SubjectFile
    for key in keys:
        annotation = model.model_fields[key].annotation
        candidates = [annotation, *get_args(annotation)]
        model = next(c for c in candidates if isinstance(c, type) and issubclass(c, BaseModel))
    return list(model.model_fields)
