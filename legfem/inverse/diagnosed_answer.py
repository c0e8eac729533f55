"""The answer of a diagnosis: whether the stiffness can be used, as a number or as a range, and what was left out."""

from legfem.common.units import decimals, mpa_to_kpa
from legfem.inverse.answer import Answer, Finding, LikelyCause, Tone, Value
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.verdict import TRUSTED, Diagnosis


def answer_of(found: Diagnosis, doubts: int = 0) -> Answer:
    """Return the answer; see `legfem.inverse.answer`."""
    finding, tone = _finding(found)
    values, why_none = _values(found)
    told = {
        "verdict": found.verdict,
        "why_none": why_none,
        "misfit": found.misfit.size,
        "may_be_off": found.may_be_off,
        "aside": "" if found.aside is None else found.aside.described,
        "fits_in_part": bool(found.models) and found.verdict == "named" and found.models[0].in_part,
        "missing_in_parts": bool(found.models) and bool(found.models[0].missing),
    }
    causes = tuple(LikelyCause(tuple(one.names), one.probability, one.in_part) for one in found.models)
    return Answer("diagnosis", finding, tone, values, causes, doubts, told)


def _finding(found: Diagnosis) -> tuple[Finding, Tone]:
    if found.withheld:
        return Finding.MISFIT, "wrong"
    if found.verdict == "unexplained":
        return Finding.SMALL_MISFIT, "caution"
    if wide(found):
        return Finding.HIDDEN_EFFECTS, "caution"
    if found.verdict == "consistent":
        return (Finding.FITS, "sound") if found.aside is None else (Finding.FITS_WITHOUT_PART, "caution")
    if found.verdict == "named" and found.models[0].in_part:
        return Finding.CORRECTED_IN_PART, "caution"
    if not causes_differ(found):
        return Finding.CORRECTED, "caution"
    return Finding.CAUSES_DIFFER, "open"


def _values(found: Diagnosis) -> tuple[dict[str, Value], str]:
    """Return C10, or why there is none."""
    if found.withheld:
        return {}, "model_wrong"
    if DEEP_C10 not in found.base_model.fit.free:
        return {}, "given"
    model, differ = found.best, causes_differ(found)
    if not differ and not model.determined(DEEP_C10):
        return {}, "undetermined"
    low, high = map(mpa_to_kpa, ends(found))
    value = None if differ else mpa_to_kpa(model.value(DEEP_C10))
    known = Value((low, high), "kPa", value, widest_error(found), range_only=differ or wide(found))
    return {DEEP_C10: known}, ""


def widest_error(found: Diagnosis) -> float:
    """Return the widest of the explanations' standard errors of C10 (kPa), by which its digits are chosen."""
    each = [one.shown(DEEP_C10).ci95 for one in (found.base_model, *found.models)]
    return max(high - low for low, high in each) / 4


def ends(found: Diagnosis) -> tuple[float, float]:
    """Return between which values C10 lies (MPa), over all explanations."""
    return found.intervals.get(DEEP_C10) or found.best.interval(DEEP_C10)


def same_value(found: Diagnosis) -> bool:
    """Return whether C10 is the same for all causes, as far as it is known."""
    if DEEP_C10 not in found.base_model.fit.free:
        return False
    digits = decimals(widest_error(found))
    return len({round(mpa_to_kpa(one.value(DEEP_C10)), digits) for one in found.models}) == 1


def causes_differ(found: Diagnosis) -> bool:
    """Return whether C10 depends on which of several causes it is."""
    return found.verdict == "ambiguous" and not same_value(found)


def wide(found: Diagnosis) -> bool:
    """Return whether C10 is known as a range alone: what is hidden may move it."""
    return not found.withheld and not causes_differ(found) and found.may_be_off > TRUSTED
