"""The answer of a result: how it is to be taken, value or range, likely causes; and what its reader must know, too.

Both are values, which `legfem.report.answers` words.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, TypeAdapter

from legfem.common.documents import json_types
from legfem.common.errors import Doubt
from legfem.inverse.intervals import Bound

Tone = Literal["sound", "caution", "open", "wrong"]
# JSON has no number for what isn't finite.
Number = Annotated[float, BeforeValidator(lambda given: math.nan if given is None else given)]


class Finding(StrEnum):
    """What was found."""

    FITS = "model_fits"
    MISFIT = "model_does_not_fit"
    TESTS_DISAGREE = "tests_disagree"
    NOT_COMPUTED = "not_computed"
    SMALL_MISFIT = "misfit_is_small"
    UNEXPLAINED = "misfit_is_unexplained"
    HIDDEN_EFFECTS = "effects_may_be_hidden"
    FITS_WITHOUT_PART = "model_fits_without_part"
    CORRECTED = "corrected"
    CORRECTED_IN_PART = "corrected_in_part"
    CAUSES_DIFFER = "value_depends_on_cause"
    PROVISIONAL = "provisional"


@dataclass(frozen=True)
class Value:
    """A number with its 95 % interval, or a range alone, in the unit in which people read it."""

    ci95: tuple[Number, Number] | None
    """None where none was found within what was searched."""
    unit: str
    value: float | None = None
    """Of a range the value if no effect is hidden; None where it depends on the cause."""
    standard_error: Number = 0.0
    range_only: bool = False
    asked: bool = True
    """Whether it was to be identified; else a prior was."""
    at_bound: Bound = ""
    """At which bound of its search it stands, which then is an end of what is known."""


@dataclass(frozen=True)
class LikelyCause:
    """What the model may have left out."""

    mechanisms: tuple[str, ...]
    probability: float
    in_part: bool
    """Whether it explains a part only."""


@dataclass(frozen=True)
class Answer:
    """What a result says, as values."""

    kind: str
    """``diagnosis``, or the fit's: ``leg``, ``specimens``, ``stocking``."""
    finding: Finding
    tone: Tone
    """Of the model, were the input right."""
    values: Mapping[str, Value] = field(default_factory=dict)
    """Asked parameters by full name; none where they cannot be told."""
    causes: tuple[LikelyCause, ...] = ()
    """The most probable first."""
    doubts: int = 0
    """How many inputs are unlikely."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Further numbers and names that the words need, plain values."""

    @property
    def tone_with_doubts(self) -> Tone:
        """Tone of all: nothing rests soundly on doubtful input."""
        return "caution" if self.doubts and self.tone == "sound" else self.tone

    def document(self) -> dict[str, Any]:
        """Return the answer as JSON types."""
        plain: dict[str, Any] = json_types(_ADAPTER.dump_python(self))
        return plain

    @classmethod
    def read(cls, document: Mapping[str, Any]) -> "Answer":
        """Return the answer of a document.

        Raises
        ------
        ValueError
            If it is none.
        """
        return _ADAPTER.validate_python(document)


_ADAPTER = TypeAdapter(Answer)


class FitNotice(StrEnum):
    """Codes that any kind of problem may have."""

    DOUBTFUL = "doubtful_input"
    UNCONVERGED = "search_unconverged"
    SOLVES_STOPPED = "solves_stopped_short"
    COMPROMISE = "model_compromised"
    AT_BOUND = "parameter_at_bound"
    NEO_HOOKEAN_LIMIT = "law_at_neo_hookean_limit"
    FAR_FROM_PRIOR = "far_from_prior"
    ELASTOGRAPHY_DISAGREES = "elastography_disagrees"
    BEGUN_IN_AIR = "trial_begun_in_air"
    SPEED_CHANGES = "speed_changes"
    PRESSED_AGAIN = "pressed_again"
    SEVERAL_LOADINGS = "several_loadings"
    CHANNEL_NOT_SOLVED = "channel_not_solved"
    READINGS_LEFT_OUT = "readings_left_out"
    TRIALS_WITHOUT = "trials_without_channel"
    NO_ACCURACY_STATED = "no_accuracy_stated"
    NOT_REPEATED = "not_repeated"
    MODEL_AT_BOUND = "model_at_bound"
    UNCONFIRMED = "unconfirmed"
    PROVISIONAL = "provisional"


@dataclass(frozen=True)
class Notice:
    """One thing that a reader must know."""

    code: str
    """Code of an enumeration: `FitNotice`, or one of a kind's."""
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Numbers in the model's units, names, and tuples of them."""

    @classmethod
    def of(cls, code: StrEnum, **parameters: Any) -> "Notice":
        """Return the notice of a code with its parameters."""
        return cls(code.value, parameters)

    def __hash__(self) -> int:
        """Return the code's hash, since mappings have none."""
        return hash(self.code)


def doubted(doubts: Iterable[Doubt]) -> tuple[Notice, ...]:
    """Return what is unlikely in the input as notices."""
    return tuple(Notice.of(FitNotice.DOUBTFUL, **asdict(doubt)) for doubt in doubts)


def leading(notices: Iterable[Notice], half_width: float) -> int:
    """Return how many doubts come before all else: those that may move C10 by more than a share, its half-width."""
    effects = [one.parameters["effect_on_C10"] for one in notices if one.code == FitNotice.DOUBTFUL]
    return sum(effect is None or abs(effect) > half_width for effect in effects)
