"""Results as they come back from their documents: answer, notices and numbers, as values."""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, TypeAdapter

from legfem.common.errors import InputError
from legfem.inverse.answer import Answer, Notice, Number
from legfem.inverse.document import SCHEMA
from legfem.inverse.fit import EXACT, UNTESTED, Goodness

SCHEMAS = {"result.json": SCHEMA, "diagnosis.json": "legfem.diagnose/7"}
"""Of documents that are read, by their files' names."""


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


type Known = Annotated[
    Notice, AfterValidator(lambda one: Notice(one.code, {key: _tuples(value) for key, value in one.parameters.items()}))
]
type Tested = Annotated[
    Goodness, BeforeValidator(lambda given: {key: math.nan if one is None else one for key, one in given.items()})
]


@dataclass(frozen=True)
class StoredEstimate:
    """One number in the unit in which people read it; NaN is what isn't known."""

    value: Number
    unit: str
    standard_error: Number = math.nan
    ci95: tuple[Number, Number] = (math.nan, math.nan)
    name: str = ""
    """In words, of what was computed with a fit."""
    role: str = "identified"
    at_bound: str = ""
    identifiability: str = ""
    share_of_squared_error: Mapping[str, float] = field(default_factory=dict)
    """By what causes the error."""


@dataclass(frozen=True)
class StoredTest:
    """One test beside the fit."""

    name: str
    fitted: bool
    r_squared: Number
    goodness: Tested
    curve: Mapping[str, Any]
    """Readings of the first channel, measured and predicted; names end with the unit."""
    by_itself: Mapping[str, StoredEstimate] = field(default_factory=dict)
    farthest_at: Number = math.nan
    """Station at which model and recording are farthest apart."""


@dataclass(frozen=True)
class StoredModel:
    """One law's fit, or a model of a diagnosis."""

    parameters: Mapping[str, StoredEstimate]
    """By key: ``c10_deep``."""
    law: str = ""
    identifiability: str | None = None
    """The worst of the parameters'."""
    goodness: Tested = UNTESTED
    agreement: Tested = EXACT
    correlations: Mapping[str, Mapping[str, Number]] = field(default_factory=dict)
    assumed: Mapping[str, Any] = field(default_factory=dict)
    notices: tuple[Known, ...] = ()
    computed: Mapping[str, StoredEstimate] = field(default_factory=dict)
    tests: tuple[StoredTest, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    p_value: Number = math.nan
    """Of a diagnosis' base model, by all that was asked of it."""


@dataclass(frozen=True)
class StoredExplanation:
    """What a diagnosis weighs, and the parameters under it."""

    mechanisms: tuple[str, ...]
    unknown: bool
    probability: float
    parameters: Mapping[str, StoredEstimate] = field(default_factory=dict)


@dataclass(frozen=True)
class StoredResult:
    """What was found of a leg, of specimens, or of a leg in its stocking."""

    schema: str
    kind: str
    subject: str
    title: str
    origin: str
    answer: Answer
    laws: Mapping[str, StoredModel]
    """Of a diagnosis one, with what it adds to the base model."""
    versions: Mapping[str, str]
    chosen: str = ""
    """Law that the recordings ask for, of several."""
    notices: tuple[Known, ...] = ()
    """Of a diagnosis."""
    verdict: str = ""
    """Of a diagnosis."""
    base_model: StoredModel | None = None
    explanations: tuple[StoredExplanation, ...] = ()

    @classmethod
    def read(cls, document: Mapping[str, Any]) -> "StoredResult":
        """Return the result of a document.

        Raises
        ------
        ValueError
            If it is none of `SCHEMAS`.
        """
        if (schema := document.get("schema")) not in SCHEMAS.values():
            raise ValueError(f"its schema is {schema}")
        return _ADAPTER.validate_python(document)

    @property
    def every_notice(self) -> tuple[Notice, ...]:
        """Notices of all laws, or of the diagnosis."""
        parts = self.laws.values() if self.base_model is None else (self,)
        return tuple(dict.fromkeys(notice for one in parts for notice in one.notices))


_ADAPTER = TypeAdapter(StoredResult)


def read_result(folder: str | Path) -> StoredResult:
    """Read back what was written into a folder of results; raises InputError where there is none to read."""
    path = next((there for name in SCHEMAS if (there := Path(folder) / name).is_file()), None)
    if path is None:
        raise InputError(Path(folder), "folder", f"contains no {' or '.join(SCHEMAS)}", "give a folder of results")
    try:
        return StoredResult.read(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, AttributeError) as error:
        problem = f"cannot be read ({str(error).splitlines()[0]})"
        raise InputError(path, "document", problem, f"run it again: {' or '.join(SCHEMAS.values())} is read") from None
