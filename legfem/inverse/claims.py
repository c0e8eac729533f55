"""What pages may claim: one table of what a result's numbers and words owe each other, checked before it is written.

A claim that fails is a fault of legfem's, and no page is made of it.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from legfem.common.errors import ContradictionError
from legfem.inverse.answer import Answer, Finding, Notice, leading
from legfem.inverse.catalogue import key_of
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import Fit
from legfem.inverse.intervals import VERDICTS, identifiability
from legfem.inverse.verdict import Diagnosis, answer_of

_NEARLY, _SUM = 1e-6, 1e-3
"""Relative, of numbers that are equal; by which chances may differ from one."""


@dataclass(frozen=True)
class Claim:
    """Something that is said, or understood, of all results of a kind.

    Parameters
    ----------
    of
        Their type; a tuple is a number and the ends of its interval.
    said
        What, as a sentence without its full stop.
    holds
        Whether it is true of one.
    """

    of: type
    said: str
    holds: Callable[[Any], bool]


def within(value: float | None, ends: tuple[float, float] | None) -> bool:
    """Return whether a number lies between two others; what isn't known contradicts nothing."""
    if value is None or ends is None:
        return True
    slack = _NEARLY * max(abs(value), 1e-300)
    return not (value < ends[0] - slack or value > ends[1] + slack)


def _was_searched(one: Estimate) -> bool:
    return all(within(end, one.parameter.bounds) for end in one.ci95 if 0 < end < math.inf)


def _is_as_narrow(one: Estimate) -> bool:
    grade = identifiability(one.relative_half_width)
    return one.identifiability == "not identifiable" or (one.one_number and grade in (VERDICTS[0], one.identifiability))


def _fits(one: Fit[Any]) -> bool:
    # A scan is met as closely as `legfem.stockings` asks for.
    return (
        one.kind == "stocking" or one.answer.finding is not Finding.FITS or (one.goodness.fits and one.agreement.fits)
    )


def _is_known(one: Fit[Any]) -> bool:
    return one.answer.tone != "sound" or all(each.identifiability == VERDICTS[0] for each in one.asked.values())


def _adds_up(one: Diagnosis) -> bool:
    return abs(sum(each.probability for each in one.explained.statements()) - one.explained.share) < _SUM


def _was_tested(one: Diagnosis) -> bool:
    return all(name not in one.untested for model in one.models for name in model.names)


_SOUND = {Finding.FITS, Finding.FITS_WITHOUT_PART, Finding.CORRECTED}
CLAIMS = (
    Claim(tuple, "a value lies inside its interval", lambda one: within(*one)),
    Claim(Estimate, "a value lies inside its interval", lambda one: within(one.value, one.ci95)),
    Claim(Estimate, "an interval lies inside what was searched", _was_searched),
    Claim(Estimate, "a number that is called identifiable has as narrow an interval", _is_as_narrow),
    Claim(Answer, "a range holds its value", lambda one: all(within(v.value, v.ci95) for v in one.values.values())),
    Claim(Answer, "only what fits is sound", lambda one: one.tone != "sound" or one.finding in _SOUND),
    Claim(Answer, "what does not fit is called so", lambda a: a.finding is not Finding.MISFIT or a.tone == "wrong"),
    Claim(Answer, "causes are as probable as all at most", lambda a: sum(c.probability for c in a.causes) < 1 + _SUM),
    Claim(Fit, "what is said to fit fits", _fits),
    Claim(Fit, "a sound number is identifiable", _is_known),
    Claim(Fit, "tests that differ are not sound together", lambda one: one.answer.tone != "sound" or not one.apart),
    Claim(Diagnosis, "chances of all that may be said add up to that of all that was weighed", _adds_up),
    Claim(Diagnosis, "a cause that is named was tested", _was_tested),
    Claim(Diagnosis, "what is consistent has no cause", lambda one: one.verdict != "consistent" or not one.models),
)


def check(name: str, *results: object) -> None:
    """Check all claims of results of a name.

    Raises
    ------
    ContradictionError
        For the first that fails.
    """
    for one in results:
        for claim in CLAIMS:
            if isinstance(one, claim.of) and not claim.holds(one):
                what = f", {key_of(one.parameter.name)}" if isinstance(one, Estimate) else ""
                raise ContradictionError(f"{name}{what} contradicts that {claim.said}")


def check_fits(fits: Sequence[Fit[Any]]) -> None:
    """Check all that is claimed of fits; raises ContradictionError."""
    for fit in fits:
        check(f"{fit.subject.id}, {fit.law}", *fit.estimates.values(), fit.answer, fit)


def check_diagnosis(found: Diagnosis, answer: Answer) -> None:
    """Check all that is claimed of a diagnosis with its answer; raises ContradictionError."""
    check(found.subject.id, *found.base.estimates.values(), *found.estimates.values(), answer, found)


def checked_answer(found: Diagnosis, notices: Sequence[Notice]) -> Answer:
    """Return a diagnosis' answer, with the doubts that lead; raises ContradictionError where a claim fails."""
    answer = answer_of(found, leading(notices, found.may_be_off))
    check_diagnosis(found, answer)
    return answer
