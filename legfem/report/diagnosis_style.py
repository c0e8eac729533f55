"""What the figures and the page of a diagnosis share: colours, names, how models are shown."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.diagnose.diagnosis import Diagnosis
from legfem.diagnose.fit import Fit

BASE_COLOUR = "#D55E00"
REPAIRED_COLOUR = "#0072B2"
SUITING_COLOUR = "#56B4E9"
CONTRADICTED_COLOUR = "#BDBDBD"
LOCATED_COLOUR = "#F0E442"
BASE_NAME = "base model"


@dataclass(frozen=True, eq=False)
class Shown:
    """A model beside the base model, as it is shown."""

    fit: Fit
    name: str
    suits: bool
    """Whether its residual is noise: a finding, not just the best that was tried."""


def plain(name: str) -> str:
    """Return a mechanism's name for people."""
    return name.replace("-", " ")


def model_name(fitted: Fit) -> str:
    """Return a model's name for people."""
    return " + ".join(plain(name) for name in fitted.names) or BASE_NAME


def shown_models(found: Diagnosis) -> list[Shown]:
    """Return the models that are shown beside the base: those that suit, else the closest."""
    if found.verdict == "consistent":
        return []
    if found.models:
        return [Shown(model.fit, model_name(model.fit), True) for model in found.models]
    if not found.closest.names:
        return []
    return [Shown(found.closest, f"closest tried ({model_name(found.closest)})", False)]


def determined(fitted: Fit, name: str) -> bool:
    """Return whether the data say anything about a free parameter."""
    sd = fitted.sd(name)
    return bool(np.isfinite(sd) and 0 < sd < 1e3 * max(abs(fitted.values[name]), 1e-9))
