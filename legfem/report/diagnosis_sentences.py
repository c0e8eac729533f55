"""The diagnosis in words that a clinician understands."""

from collections.abc import Sequence

from legfem.common.units import mpa_to_kpa, percent, spaced_unit
from legfem.inverse.catalogue import symbol_of
from legfem.inverse.explanation import Explanation
from legfem.inverse.hidden import HiddenEnd, Limit
from legfem.inverse.location import SetAside
from legfem.inverse.verdict import Diagnosis, explained_share, residual_intervals
from legfem.mechanisms.time_dependence import needs_time
from legfem.report.diagnosis_curves import plain, relative_change
from legfem.report.words import capital, share

_NO_MECHANISM = (
    "repeat the test on another day and rig; record at two rates with a hold, and look at the located intervals on film"
)
_AIR_FROM_MM = 0.2
_CERTAIN = 0.95


def verdict_sentence(found: Diagnosis) -> str:
    """Return the verdict in some sentences."""
    if found.verdict == "consistent":
        return (
            "The model describes the recordings within their errors and what is not known exactly of what was pressed. "
            f"It needs no further physics (probability {percent(found.explained.adequacy)}). {air(found)}"
        ).strip()
    if found.verdict == "unexplained" and not found.withheld:
        return misfit_sentence(found)
    if found.verdict == "unexplained":
        return (
            f"{_contradiction(found)} None of the mechanisms known to legfem, alone or in pairs, "
            "explains how. Don't rely on the stiffness."
        )
    first = found.models[0]
    if found.verdict == "named":
        whole = "What it left out" if not first.in_part else "What it left out, in part"
        return (
            f"{_contradiction(found)} {whole}: {statements(first)} (probability "
            f"{percent(first.probability)}).{_in_part(found, first)} "
            f"{stiffness_sentence(found.base_model, first)} {air(found)}"
        ).strip()
    candidates = "; or ".join(
        f"({k}) {statements(model)}, {percent(model.probability)}" for k, model in enumerate(found.models, 1)
    )
    return (
        f"{_contradiction(found)} {kin_sentence(found.models)}It leaves out one of these, and the recordings do not "
        f"show which: {candidates}. {stiffness_range(found.base_model, found.models)} {air(found)}"
    ).strip()


def _contradiction(found: Diagnosis) -> str:
    missing = 1 - found.explained.adequacy
    if missing > _CERTAIN:
        return "The recordings contradict the model."
    return f"The model probably left something out ({percent(missing)})."


def air(found: Diagnosis) -> str:
    """Return how much air there was before the skin, where there was some."""
    rows = []
    for k, trial in enumerate(found.observed.trials):
        middle, (low, high) = found.first_contact(k)
        half = 0.5 * (high - low)
        if middle > max(_AIR_FROM_MM, half):
            rows.append(f"{middle:.2f} ± {half:.2f} mm in {trial}")
    if not rows:
        return ""
    return f"Air before first touch, which the stiffness allows for: {', '.join(rows)}."


def _in_part(found: Diagnosis, model: Explanation) -> str:
    if not model.in_part:
        return ""
    if model.missing:
        return f" {missing_sentence(model)}"
    left = residual_intervals(found, model)
    explained = f" It explains {percent(explained_share(found, model))} of the misfit"
    if model.trials_differ and not left:
        return f"{explained}; trials differ by more than instruments of the stated accuracy make."
    if not left:
        return f"{explained}; what remains is below a trial's noise."
    most = left[0]
    low, high = (f"{end:.0f}" for end in most.displacement_mm)
    where = f"at {low} mm" if low == high else f"from {low} to {high} mm"
    return f"{explained}; {abs(most.size_N):.2g} N remains in {most.trial}, {most.phase}, {where}."


def _digits(value: float) -> str:
    return f"{value:#.3g}".rstrip(".") if value else "0"


def statements(model: Explanation) -> str:
    """Return what a model's mechanisms say was left out, or that it is like that."""
    every = [m.statement for m in model.fit.mechanisms]
    said = ("; and also " if any(":" in one for one in every) else " and ").join(every)
    return f"something unknown that looks as if {said}" if model.missing else said


def missing_sentence(model: Explanation) -> str:
    """Return where what a model names isn't seen, though it would be."""
    each = []
    for name, parts in model.missing.items():
        *first, last = (part.part for part in parts)
        each.append(f"{plain(name)} is not seen in {f'{", ".join(first)} and ' if first else ''}{last}")
    return f"It is not that, or not alone: {' and '.join(each)}, where it would be."


def kin_sentence(models: Sequence[Explanation]) -> str:
    """Return what is sure where every model has a mechanism of one kin; nothing where they haven't."""
    each = [{m.kin for m in model.fit.mechanisms if m.kin} for model in models]
    shared = set.intersection(*each) if each else set()
    return f"{shared.pop().capitalize()}, by a mechanism that this test cannot determine. " if len(shared) == 1 else ""


def stiffness_range(before: Explanation, after: Sequence[Explanation]) -> str:
    """Return between which values the stiffness moves by one of several explanations."""
    parts = []
    for name in before.fit.stiffness:
        values = [mpa_to_kpa(model.value(name)) for model in after]
        ends = list(dict.fromkeys(_digits(value) for value in (min(values), max(values))))
        there = f"between {ends[0]} and {ends[1]}" if len(ends) > 1 else ends[0]
        parts.append(f"{symbol_of(name)} from {_digits(mpa_to_kpa(before.value(name)))} kPa to {there} kPa")
    return f"Depending on which it is, putting it into the model moves {' and '.join(parts)}."


def stiffness_sentence(before: Explanation, after: Explanation) -> str:
    """Return how the stiffness changed."""
    parts = []
    for name in before.fit.stiffness:
        if name in after.fit.free:
            was, now = mpa_to_kpa(before.value(name)), mpa_to_kpa(after.value(name))
            change = f" ({relative_change(was, now)})" if was > 1e-6 else ""
            parts.append(f"{symbol_of(name)} from {_digits(was)} to {_digits(now)} kPa{change}")
    return f"Putting it into the model moves {' and '.join(parts)}."


def misfit_sentence(found: Diagnosis) -> str:
    """Return how far a model misses whose misfit is small, and what that does to C10."""
    return (
        f"The model misses the recordings by more than their noise, but only by {share(found.misfit.size)} of the "
        f"largest force (root mean square). Leaving out any one phase, or any third of the depth, changes C10 by at "
        f"most {share(found.misfit.moves)}. That is less than its interval, so the model is good enough for C10."
    )


def aside_sentence(aside: SetAside) -> str:
    """Return what was set aside, and why."""
    return (
        f"Something unknown disturbed a part of the recordings, which was set aside: {aside.described}. It departs "
        f"from the other trials by up to {abs(aside.size_N):.2g} N, more than gain, zero, first contact and noise "
        "explain. Everything here is of the rest."
    )


def hidden_sentence(found: Diagnosis, limit: Limit, end: HiddenEnd) -> str:
    """Return what would not have been seen, and what C10 would then be."""
    mechanism = next(e.fit.mechanisms[0] for e in found.explained.every if e.names == (limit.name,))
    first = mechanism.parameters[0]
    value = end.values[first.name]
    size = f"{value:.2g}{spaced_unit(first.unit)}"
    plain = f"{limit.name.replace('-', ' ')} ({first.name.replace('_', ' ')} of {{}})"
    what = (mechanism.would_be or plain).format(size)
    seen = "would not have been detected" + ("" if end.open else ", but a stronger effect would")
    return f"{capital(what)} {seen}; C10 would then be {_digits(mpa_to_kpa(end.c10))} kPa."


def next_experiments(found: Diagnosis) -> list[str]:
    """Return the measurements that would settle what is open, but those that were made."""
    if found.verdict == "unexplained":
        return [_NO_MECHANISM]
    if found.verdict == "consistent":
        rates = ["hold the deepest position for a minute, and press at two rates"] if one_rate(found) else []
        unseen = [one.mechanism.next_experiment for one in found.weighted_base.problem.unseen]
        return list(dict.fromkeys([*rates, *unseen]))
    known = {reading.mechanism.name for reading in found.weighted_base.problem.measured}
    open_ = [m for model in found.models for m in model.fit.mechanisms if m.name not in known]
    return list(dict.fromkeys(m.experiment_after(found.observed) for m in open_))


def one_rate(found: Diagnosis) -> bool:
    """Return whether the recordings can't show an effect of rate."""
    return needs_time(found.observed) in found.untested.values()
