"""The first screen of a diagnosis, for someone who knows no statistics.

Its words were changed after readers without statistics had stumbled over them (`docs/checklist.md`, "Tried").
"""

from collections.abc import Sequence

from legfem.common.numbers import number, percent, share
from legfem.common.units import mpa_to_kpa
from legfem.inverse.answer import Finding, Notice
from legfem.inverse.averaging import widened_by
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.claims import checked_answer
from legfem.inverse.explanation import Explanation
from legfem.inverse.mechanism import Mechanism
from legfem.inverse.plan import DesignValue
from legfem.inverse.verdict import DIFFER, TRUSTED, Diagnosis, ends_of_c10, reported, same_value, wide, widest_error
from legfem.report import diagnosis_sentences as sentences
from legfem.report import page as web
from legfem.report.answers import headline_of
from legfem.report.diagnosis_curves import places_of, relative_change
from legfem.report.estimates import high_or_low
from legfem.report.plan import chance_text
from legfem.report.words import TOLD, WORDS, capital

_MOST_CAUSES = 2
"""That find room on the first screen of a phone."""


def headline(
    found: Diagnosis, plan: Sequence[DesignValue], tissue: str = "", notices: Sequence[Notice] = ()
) -> web.Headline:
    """Return the verdict for someone who knows no statistics.

    Parameters
    ----------
    found
        The diagnosis.
    plan
        Tests that could be made next, the best first.
    tissue
        Of a leg, whose C10 it is.
    notices
        What a reader must know, doubts among it.
    """
    aside = "" if found.aside is None else f"{sentences.aside_sentence(found.aside)} "
    answer = checked_answer(found, notices)
    if answer.finding is Finding.PROVISIONAL:
        return headline_of(answer, [("Problems found so far", aside + _wrong(found)), ("What to do", TOLD["go_on"])])
    effect = _stiffness(found)
    if not found.withheld:
        unseen = _unseen(found)
        if DEEP_C10 in found.base_model.fit.free and sentences.one_rate(found):
            allowed = ", which the range allows for" if any(one.name in found.untested for one in unseen) else ""
            effect += " It is the stiffness at the rate of this test: tissue that is held relaxes, and is then "
            effect += f"softer{allowed}."
        # What every leg has hides in the stiffness whatever is recorded.
        hidden = [one.unseen_statement for one in unseen if one.name not in found.untested]
        effect += "".join(f" {capital(said)}. The range allows for that." for said in hidden)
    return headline_of(
        answer,
        [
            ("Problems found", aside + _wrong(found)),
            ("How sure", _sure(found)),
            ("Effect on C10", effect),
            ("What to do", to_do(found, plan)),
            *_high_or_low(found, tissue, notices),
        ],
    )


def _wrong(found: Diagnosis) -> str:
    if found.verdict == "consistent":
        hides = f" But not every problem would show: {said}" if wide(found) and (said := _hides(found)) else ""
        none = "None." if found.aside is None else "No other problem."
        if found.base.agreement.p_value < DIFFER:
            none = f"{none[:-1]} that the model shows, but the recordings by themselves disagree on C10 (see below)."
        return f"{none}{hides} What this test cannot show is listed further down."
    if found.verdict == "unexplained":
        largest = ""
        if places := places_of(found):
            most = max(places, key=lambda place: place.weight)
            low, high = (f"{end:.2g}" for end in most.displacement)
            at = f"between {low} and {high}" if low != high else f"at {high}"
            largest = f" The difference is largest {at} mm of {most.phase}: {abs(most.size):.1g} N."
        return f"{TOLD['no_cause'] if found.withheld else sentences.misfit_sentence(found)}{largest}"
    if found.verdict == "named":
        first = found.models[0]
        part = " That explains only a part of the difference." if first.in_part else ""
        part = f" {sentences.missing_sentence(first)}" if first.missing else part
        return f"Most likely {sentences.statements(first)}. The computer model left that out.{part}"
    causes = [f"{sentences.statements(m)} ({percent(m.probability)} likely)" for m in found.models[:_MOST_CAUSES]]
    more = len(found.models) - len(causes)
    one = f"; or, less likely, {sentences.statements(found.models[-1])}" if more else ""
    others = f"; or one of {more} less likely causes, listed further down" if more > 1 else one
    return f"{sentences.shared_by(found.models)}The computer model left out one of these: {'; '.join(causes)}{others}."


def _hides(found: Diagnosis) -> str:
    """Return what the effect that widens C10's range most would do unseen; of others where that isn't far."""
    widest = widened_by(found.explained, DEEP_C10)
    names = () if widest is None else widest.names
    first = [one for one in found.hidden if one[0].name in names] or found.hidden
    said = [sentences.hidden_sentence(found, *one) for one in first[:_MOST_CAUSES]]
    unseen = [f"{capital(one.unseen_statement)}." for one in _unseen(found)]
    return " ".join([*unseen, *said[:1]] if _by_what_is_unseen(found) else said)


def _unseen(found: Diagnosis) -> list[Mechanism]:
    """Return what every leg has and the recordings don't show, but what is named."""
    every = (one.mechanism for one in found.weighted_base.problem.unseen)
    return [one for one in every if one.name not in found.best.names]


def _by_what_is_unseen(found: Diagnosis) -> bool:
    """Return whether C10 is known as a range alone for what every leg has and the recordings don't show."""
    ends, value = found.interval_as_seen, found.best.value(DEEP_C10)
    return wide(found) and ends is not None and max(abs(end / value - 1.0) for end in ends) <= TRUSTED


def _sure(found: Diagnosis) -> str:
    soundness = found.explained.adequacy
    if found.verdict == "consistent":
        fits = f"{percent(soundness)} sure that the computer model fits this test"
        return f"{capital(fits)}. The range {_NINETEEN_OF_20}"
    wrong = f"{percent(1 - soundness)} sure that the computer model left something out"
    if found.verdict == "unexplained":
        return f"{capital(wrong)}; the recordings do not show what."
    if found.verdict == "named":
        if found.models[0].missing:
            return f"{capital(wrong)}; what it is like is not what it is. The range also allows for other causes."
        chance = percent(found.models[0].probability)
        return TOLD["sure_of_cause"].format(wrong=capital(wrong), chance=chance, meant=_NINETEEN_OF_20)
    return f"{capital(wrong)}; this test cannot determine which of these. The range {_NINETEEN_OF_20}"


# Counted where errors are wider than is assumed: docs/evidence.md.
_NINETEEN_OF_20 = TOLD["nineteen_of_20"]


def _stiffness(found: Diagnosis) -> str:
    if why := reported(found)[1]:
        return str(WORDS["no_c10"][why])
    before = _value(found, found.base_model)
    if found.verdict == "unexplained" and wide(found):
        return f"{_C10}, is {before} kPa as fitted; what is missing could change it by {percent(found.may_be_off)}."
    if found.verdict == "unexplained":
        return f"{_C10}, is {before} kPa; the misfit changes it by {share(found.misfit.moves)} at most."
    if found.verdict == "consistent" and wide(found):
        return TOLD["may_hide"].format(before=before, change=percent(found.may_be_off))
    if found.verdict == "consistent":
        return f"{_C10}, is {before} kPa; no correction is needed."
    low, high = ends_of_c10(found)
    in_range = [model for model in found.models if low <= model.value(DEEP_C10) <= high]
    after = [_value(found, model) for model in in_range or found.models]
    if found.verdict == "named" or same_value(found):
        change = relative_change(found.base_model.value(DEEP_C10), found.models[0].value(DEEP_C10)).lstrip("+")
        way = "lower" if change.startswith("-") else "higher"
        causes = "" if found.verdict == "named" else ", whichever cause it is"
        moved = {"change": change.lstrip("-"), "way": way, "causes": causes}
        return TOLD["corrected"].format(before=before, after=after[0], **moved)
    least, most = min(after, key=float), max(after, key=float)
    return TOLD["corrected_range"].format(before=before, least=least, most=most)


_C10 = "C10, the stiffness of the tissue"


def _high_or_low(found: Diagnosis, tissue: str, notices: Sequence[Notice]) -> list[tuple[str, str]]:
    """Return how the number to write down compares with others', where there is one."""
    if not (known := reported(found)[0].get(DEEP_C10)) or known.ci95 is None:
        return []
    low, high = known.ci95 if known.value is None else (known.value, known.value)
    return high_or_low(tissue, low, high, notices)


def _value(found: Diagnosis, model: Explanation) -> str:
    return number(mpa_to_kpa(model.value(DEEP_C10)), widest_error(found))


_RECORDED = "was recorded already: no other test that this program knows would help"


def to_do(found: Diagnosis, plan: Sequence[DesignValue]) -> str:
    """Return what to do with the number, and what to ask a lab for."""
    lines, by_unseen = sentences.next_experiments(found), _by_what_is_unseen(found)
    use = {"": "Use the range", "given": "Keep the C10 that was given"}.get(reported(found)[1], "Use no number")
    if found.verdict == "consistent":
        widest = widened_by(found.explained, DEEP_C10) if wide(found) else None
        if by_unseen:
            why = ", and because ".join(one.unseen_statement for one in _unseen(found))
            asked = "; and to ".join(lines)
        elif widest is not None:
            why = f"this test cannot determine whether {sentences.statements(widest)}"
            # What settles its widest part, and what wasn't recorded yet.
            first = sentences.settling(found, widest.fit.mechanisms[:1])
            asked = "; or to ".join([*first, *[line for line in lines if line not in first][:1]])
        elif sentences.one_rate(found):
            return f"Use the number above. If the behaviour over time matters, ask the lab to {lines[0]}."
        else:
            return "Use the number together with the law that it belongs to. No other test is needed."
        narrow = f"To narrow it, ask the lab to {asked}" if asked else f"What could narrow it {_RECORDED}"
        return f"{use}. The range is so wide because {why}. {narrow}."
    if reported(found)[0] and not wide(found) and (found.verdict == "named" or same_value(found)):
        use = "Use the corrected number"
    if not plan and not lines:
        return f"{use}. What could settle the cause {_RECORDED}."
    asked = f"ask the lab to {f'{plan[0].design.name} ({chance_text(plan[0])})' if plan else lines[0]}"
    if found.verdict == "unexplained" and not found.withheld:
        use = use if wide(found) else "Use the number above"
        return f"{use}. To find out what the model misses, ask the lab to {lines[0]}."
    if found.verdict == "unexplained":
        return (
            f"Use no number of this test. First ask the lab to check the data for a mistake. Then ask it to {lines[0]}."
        )
    if found.verdict == "named":
        return f"{use}. To confirm the cause, {asked}."
    return f"{use}. To find out which cause it is, {asked}."
