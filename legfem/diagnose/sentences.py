"""The diagnosis in words that a clinician understands."""

from __future__ import annotations

from collections.abc import Sequence

from legfem.diagnose.diagnosis import Diagnosis
from legfem.diagnose.fit import Fit
from legfem.diagnose.mechanisms import Mechanism, Viscoelasticity

_HOLDS_RECORDED = (
    "hold at half the depth too, and for several minutes: relaxation takes the same time at every "
    "depth"
)
_NO_MECHANISM = (
    "repeat the test on another day and rig; record at two rates with a hold, and look at the "
    "located intervals on film"
)


def verdict_sentence(found: Diagnosis) -> str:
    """Return the verdict in one or two sentences."""
    if found.verdict == "consistent":
        return (
            "The model describes the recordings to within their noise; nothing asks for more "
            f"physics (p = {found.base.assessment.p_value:.2g})."
        )
    if found.verdict == "unexplained":
        return (
            "The recordings contradict the model, and none of the mechanisms known to legfem, "
            "alone or in pairs, explains how. Don't rely on the stiffness below."
        )
    best = found.models[0].fit
    if found.verdict == "named":
        change = stiffness_sentence(found.base.fit, best)
        return (
            f"The recordings contradict the model. What it left out: {_statements(best)}. {change}"
        )
    candidates = "; or ".join(
        f"({k}) {_statements(model.fit)}" for k, model in enumerate(found.models, 1)
    )
    return (
        "The recordings contradict the model. What it left out is one of these, and the "
        f"recordings can't tell which: {candidates}. "
        f"{_stiffness_range(found.base.fit, [model.fit for model in found.models])}"
    )


def _digits(value: float) -> str:
    return f"{value:#.3g}".rstrip(".") if value else "0"


def _statements(fitted: Fit) -> str:
    return " and ".join(m.statement for m in fitted.mechanisms)


def _stiffness_range(before: Fit, after: Sequence[Fit]) -> str:
    parts = []
    for name in ("C10", "C20"):
        if name in before.free and all(name in fitted.free for fitted in after):
            values = [fitted.values[name] for fitted in after]
            parts.append(
                f"{name} from {_digits(before.values[name])} kPa to between "
                f"{_digits(min(values))} and {_digits(max(values))} kPa"
            )
    return f"Depending on which it is, putting it into the model moves {' and '.join(parts)}."


def stiffness_sentence(before: Fit, after: Fit) -> str:
    """Return how the stiffness changed."""
    parts = []
    for name in ("C10", "C20"):
        if name in before.free and name in after.free:
            change = (
                f"{name} from {_digits(before.values[name])} to {_digits(after.values[name])} kPa"
            )
            if before.values[name] > 1e-6:
                relative = after.values[name] / before.values[name] - 1
                change += f" ({100 * relative:+.0f} %)"
            parts.append(change)
    return f"Putting it into the model moves {' and '.join(parts)}."


def _wanted(found: Diagnosis, mechanism: Mechanism) -> str:
    observed = found.observed
    recorded = "hold" in observed.phases and len(observed.rates) > 1
    if recorded and isinstance(mechanism, Viscoelasticity):
        return _HOLDS_RECORDED
    return mechanism.next_experiment


def next_experiments(found: Diagnosis) -> list[str]:
    """Return the measurements that would settle what is open."""
    if found.verdict == "unexplained":
        return [_NO_MECHANISM]
    wanted = dict.fromkeys(
        _wanted(found, m) for model in found.models for m in model.fit.mechanisms
    )
    rate = any("rate" in why for why in found.untested.values())
    if found.verdict == "consistent" and rate:
        return ["hold the deepest position for a minute, and press at two rates"]
    return list(wanted)
