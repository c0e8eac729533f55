"""How strong a mechanism may be without being seen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from legfem.diagnose.explanation import Explained
from legfem.diagnose.mechanisms.base import null_of


@dataclass(frozen=True)
class Limit:
    """A mechanism's strength that these recordings leave possible."""

    name: str
    parameter: str
    unit: str
    low: float
    high: float
    """Between which it lies with 95 % (one-sided where only one sign is possible)."""
    effect: float
    """N: greatest change of the force by the stronger end."""


def limits_of(explained: Explained) -> tuple[Limit, ...]:
    """Return every single mechanism's limits, by name."""
    found = []
    for one in explained.every:
        if len(one.names) != 1:
            continue
        mechanism = one.fit.mechanisms[0]
        first = mechanism.parameters[0]
        full = f"{mechanism.name}.{first.name}"
        null = null_of(first)
        sided = null <= first.bounds[0]
        low, high = one.interval(full, 0.05 if sided else 0.025)
        stronger = max((low, high), key=lambda value: abs(value - null))
        values = {**one.fit.moved(one.posterior.mean), full: stronger}
        predict = one.problem.predictor
        change = predict(values, one.fit.mechanisms) - predict({**values, full: null}, one.fit.mechanisms)
        found.append(
            Limit(mechanism.name, first.name, first.unit, null if sided else low, high, float(np.abs(change).max()))
        )
    return tuple(sorted(found, key=lambda limit: limit.name))
