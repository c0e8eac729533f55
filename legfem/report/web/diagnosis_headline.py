"""A diagnosis' first screen: what is wrong, how sure, what it does to C10, and what to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from legfem.diagnose.diagnosis import Diagnosis, Verdict
from legfem.diagnose.explanation import Explanation
from legfem.diagnose.sentences import next_experiments, percent, statements
from legfem.report import diagnosis_tables as tables
from legfem.report.diagnosis_style import determined, model_name
from legfem.report.web import page as web

TITLE = "Can the stiffness of {whose} be trusted?"


@dataclass(frozen=True)
class _Look:
    """How a verdict looks."""

    tone: web.Tone
    heading: str
    """The answer to the page's title."""


_LOOKS: Mapping[Verdict, _Look] = {
    "consistent": _Look("sound", "Yes, as far as this test can show"),
    "named": _Look("caution", "The corrected one: a cause of the misfit was found"),
    "ambiguous": _Look("caution", "Only as a range: the cause of the misfit is not settled"),
    "unexplained": _Look("wrong", "No: the cause of the misfit was not found"),
}


def headline(found: Diagnosis, plan: Sequence[str]) -> web.Headline:
    """Return the verdict for someone who knows no statistics.

    Parameters
    ----------
    found
        The diagnosis.
    plan
        What could be done next, each with its chance, the best first.
    """
    look = _LOOKS[found.verdict]
    return web.Headline(
        look.tone,
        _sentence(found),
        [
            ("What is wrong", _wrong(found)),
            ("How sure", _sure(found)),
            ("What it does to C10", _stiffness(found)),
            ("What to do", _to_do(found, plan)),
        ],
        look.heading,
    )


def _sentence(found: Diagnosis) -> str:
    if found.verdict == "consistent":
        return "The computer model of the leg matches what was recorded."
    if found.verdict == "unexplained":
        return (
            "The computer model does not match what was recorded, and nothing that legfem knows "
            "explains why."
        )
    names = [model_name(model) for model in found.models]
    if found.verdict == "named":
        part = ", in part" if found.models[0].in_part else ""
        return f"The computer model left something out. Its name{part}: {names[0]}."
    return f"The computer model left something out: {_either(names)}. The test can't tell which."


def _wrong(found: Diagnosis) -> str:
    if found.verdict == "consistent":
        return "Nothing that this test could show. What it could not test is listed below."
    if found.verdict == "unexplained":
        return (
            "Model and recordings differ by more than the instruments' errors and what is not "
            "known of the leg allow."
        )
    return f"{capital('; or '.join(statements(model) for model in found.models))}."


def _sure(found: Diagnosis) -> str:
    soundness = found.explained.soundness
    if found.verdict == "consistent":
        return f"{capital(percent(soundness))} sure that nothing is missing that would show here."
    if found.verdict == "unexplained":
        return (
            f"{capital(percent(1 - soundness))} sure that something was left out. What it is, "
            "isn't known."
        )
    shares = [(model_name(model), percent(model.probability)) for model in found.models]
    if found.verdict == "named":
        ((name, share),) = shares
        return (
            f"{capital(percent(1 - soundness))} sure that something was left out; of all that "
            f"legfem knows, {share} that it is {name}."
        )
    told = ", ".join(f"{share} {name}" for name, share in shares)
    return (
        f"{capital(percent(1 - soundness))} sure that something was left out. Which it is, in "
        f"chances: {told}."
    )


def _stiffness(found: Diagnosis) -> str:
    if found.verdict == "unexplained":
        return f"Unknown: {_C10} may be off by any amount. Don't rely on the numbers below."
    if "C10" not in found.base.fit.free:
        return "Nothing: it was given."
    before = tables.estimate(found.base, "C10")
    if found.verdict == "consistent":
        return f"Nothing. {_C10} is {before} kPa{_most_likely(found, found.base)}."
    after = [tables.estimate(model, "C10") for model in found.models]
    if found.verdict == "named":
        model = found.models[0]
        change = tables.relative_change(found.base.value("C10"), model.value("C10"))
        return (
            f"{_C10} moves from {before} to {after[0]} kPa ({change}){_most_likely(found, model)}."
        )
    low, high = min(after, key=float), max(after, key=float)
    if low == high:
        return f"{_C10} moves from {before} to {low} kPa, whichever it is."
    return (
        f"{_C10} moves from {before} to between {low} and {high} kPa: which is right depends on "
        "the cause."
    )


_C10 = "C10, the stiffness of the tissue,"


def _most_likely(found: Diagnosis, model: Explanation) -> str:
    if not determined(model, "C10"):
        return ", as it was taken to be: this test tells nothing of it"
    within = tables.averaged(found, "C10") or tables.interval(model, "C10")
    return f"; the true value most likely lies in {within} (19 chances in 20)"


def to_do_next(found: Diagnosis, plan: Sequence[str]) -> list[str]:
    """Return what could be done next, the best first."""
    lines = [*plan, *next_experiments(found)]
    return [capital(line) for line in lines] or [
        "Nothing is asked for by these recordings: use the stiffness with the law it belongs to"
    ]


def _to_do(found: Diagnosis, plan: Sequence[str]) -> str:
    lines = next_experiments(found)
    if found.verdict == "consistent":
        if not lines:
            return "Use C10 as it is: this test asks for no further measurement."
        return (
            "Use C10 as it is. What the tissue does in time was not tested; to see that, "
            f"{lines[0]}."
        )
    what, _, chance = plan[0].partition(": ") if plan else (lines[0], "", "")
    first = f"{what} ({chance})" if chance else what
    if found.verdict == "named":
        return f"Use the corrected C10. To make sure of the cause: {first}."
    if found.verdict == "ambiguous":
        return f"Use no single value of C10. To find out which it is: {first}."
    return f"Don't use C10. {capital(first)}."


def _either(names: Sequence[str]) -> str:
    return " or ".join(names) if len(names) < 3 else f"one of {', '.join(names)}"


def capital(text: str) -> str:
    """Return a text that begins with a capital."""
    return text[:1].upper() + text[1:]
