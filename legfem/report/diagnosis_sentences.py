"""The diagnosis in words that a clinician understands."""

from collections.abc import Sequence

from legfem.common.numbers import number, percent, share
from legfem.common.units import mpa_to_kpa, spaced_unit
from legfem.inverse.advice import HOLD_A_MINUTE, TWO_RATES, LabStep, left
from legfem.inverse.explanation import Explanation
from legfem.inverse.hidden import HiddenEnd, Limit
from legfem.inverse.location import SetAside
from legfem.inverse.mechanism import Mechanism
from legfem.inverse.verdict import Diagnosis, ends_of_c10, explained_share, residual_intervals, wide, widest_error
from legfem.mechanisms.time_dependence import needs_time
from legfem.report.diagnosis_curves import plain
from legfem.report.words import TOLD, capital

_NO_MECHANISM = (
    LabStep("repeat the test on another day and rig"),
    HOLD_A_MINUTE,
    TWO_RATES,
    LabStep("look at the located intervals on film"),
)
_AIR_FROM_MM = 0.2


def verdict_sentence(found: Diagnosis) -> str:
    """Return the verdict with all that is listed, and what that leaves."""
    each = [
        f"{capital(statements(one))}: {percent(one.probability)} of what may be left out.{_in_part(found, one)}"
        for one in found.models
    ]
    verdict = f"Verdict{' so far' * found.provisional}: {found.verdict.upper()}."
    return " ".join(filter(None, [verdict, *each, air(found)]))


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


def shared_by(models: Sequence[Explanation]) -> str:
    """Return what is sure where every model has one mechanism, or one kin of them; nothing where they haven't."""
    named = [set() if one.missing else {m.statement for m in one.fit.mechanisms} for one in models]
    each = [{m.kin for m in model.fit.mechanisms if m.kin} for model in models]
    for said, how in ((named, "whatever else was left out"), (each, "by a mechanism that this test cannot determine")):
        if len(shared := set.intersection(*said) if said else set[str]()) == 1:
            return f"{capital(shared.pop())}, {how}. "
    return ""


def misfit_sentence(found: Diagnosis) -> str:
    """Return how far a model misses that nothing explains, and what that does to C10."""
    enough = "" if wide(found) else ", so the model is good enough for C10"
    return TOLD["misfit"].format(size=share(found.misfit.size), moves=share(found.misfit.moves), enough=enough)


def aside_sentence(aside: SetAside) -> str:
    """Return what was set aside, and why."""
    return TOLD["set_aside"].format(described=aside.described, size=abs(aside.size_N))


def hidden_sentence(found: Diagnosis, limit: Limit, end: HiddenEnd) -> str:
    """Return what would not have been seen, and what C10 would then be."""
    mechanism = next(e.fit.mechanisms[0] for e in found.explained.every if e.names == (limit.name,))
    first = mechanism.parameters[0]
    size = f"{end.values[first.name]:.2g}{spaced_unit(first.unit)}"
    plain = f"{limit.name.replace('-', ' ')} ({first.name.replace('_', ' ')} of {{}})"
    what = (mechanism.would_be or plain).format(size)
    seen = "would not have been detected" + ("" if end.open else ", but a stronger effect would")
    low, high = ends_of_c10(found)
    beyond = "" if low <= end.c10 <= high else ", beyond the range, which leaves out what is rarer than 1 in 20"
    return f"{capital(what)} {seen}; C10 would then be {number(mpa_to_kpa(end.c10), widest_error(found))} kPa{beyond}."


def next_experiments(found: Diagnosis) -> list[str]:
    """Return the measurements that would settle what is open, but those that were made."""
    if found.verdict == "unexplained":
        return ["; ".join(left(found.observed, *_NO_MECHANISM))]
    if found.verdict == "consistent":
        rates = [", and ".join(left(found.observed, HOLD_A_MINUTE, TWO_RATES))] if one_rate(found) else []
        return list(
            dict.fromkeys([*rates, *settling(found, [one.mechanism for one in found.weighted_base.problem.unseen])])
        )
    return settling(found, [m for model in found.models for m in model.fit.mechanisms])


def settling(found: Diagnosis, mechanisms: Sequence[Mechanism]) -> list[str]:
    """Return the measurements that would settle whether mechanisms are there, but those that were made."""
    known = {reading.mechanism.name for reading in found.weighted_base.problem.measured}
    asked = (one.experiment_after(found.observed) for one in mechanisms if one.name not in known)
    return list(dict.fromkeys(filter(None, asked)))


def one_rate(found: Diagnosis) -> bool:
    """Return whether the recordings can't show an effect of rate."""
    return needs_time(found.observed) in found.untested.values()
