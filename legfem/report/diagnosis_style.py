"""What the figures and the page of a diagnosis share: colours, names, how models are shown."""

from __future__ import annotations

from dataclasses import dataclass

from legfem.inverse.explanation import Explanation, Statement
from legfem.inverse.verdict import Diagnosis

BASE_COLOUR = "#D55E00"
REPAIRED_COLOUR = "#0072B2"
SUITING_COLOUR = "#56B4E9"
CONTRADICTED_COLOUR = "#BDBDBD"
LOCATED_COLOUR = "#F0E442"
BASE_NAME = "base model"
UNKNOWN_NAME = "something unknown"


@dataclass(frozen=True, eq=False)
class Shown:
    """A model beside the base model, as it is shown."""

    model: Explanation
    name: str
    suits: bool
    """Whether it is a finding, not just the most probable of those that were tried."""


def plain(name: str) -> str:
    """Return a mechanism's name for people."""
    return name.replace("-", " ")


def model_name(model: Explanation) -> str:
    """Return an explanation's name for people."""
    if model.unknown:
        return UNKNOWN_NAME
    return " + ".join(plain(name) for name in model.names) or BASE_NAME


def statement_name(one: Statement) -> str:
    """Return what a statement says, in short."""
    if one.unknown:
        return UNKNOWN_NAME
    return " + ".join(plain(name) for name in one.names) or "nothing that shows"


def shown_models(found: Diagnosis) -> list[Shown]:
    """Return the models that are shown beside the base: those that suit, else the closest."""
    if found.verdict == "consistent":
        return []
    if found.models:
        return [Shown(model, model_name(model), True) for model in found.models]
    named = [e for e in found.explained.every if e.names]
    return [Shown(named[0], f"closest tried ({model_name(named[0])})", False)] if named else []


def determined(model: Explanation, name: str) -> bool:
    """Return whether the data say anything about a parameter beyond what was known of it."""
    k = model.fit.free.index(name)
    return bool(model.posterior.covariance[k, k] < 0.8)
