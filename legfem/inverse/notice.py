"""What a reader of a result must know, as a code with its numbers and names; `legfem.report.notices` has the words."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import Any

from legfem.common.errors import Doubt


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
