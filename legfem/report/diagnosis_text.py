"""The page of a diagnosis that a person reads first."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from legfem.common.doubts import doubt_lines
from legfem.diagnose.diagnosis import Diagnosis
from legfem.diagnose.document import Recorded, doubts_of, kind_of, r_squared
from legfem.diagnose.sentences import next_experiments, percent, verdict_sentence
from legfem.report import diagnosis_tables as tables
from legfem.report.diagnosis_style import model_name, plain, shown_models
from legfem.report.lines import bullets, fill
from legfem.report.page import ReportFile
from legfem.report.style import LAW_NAMES
from legfem.report.text import ORIGINS, WIDTH
from legfem.subjects.subject import Subject


def diagnosis_page(
    found: Diagnosis,
    subject: Recorded,
    files: Sequence[ReportFile],
    plan: Sequence[str] = (),
) -> str:
    """Return the text of ``report.txt``: what was found, other files, what could be done next."""
    whose = f"{kind_of(subject)} {subject.id} ({subject.title})"
    heading = f"{whose}: does the model describe the recordings?"
    what, _, explanation = ORIGINS[subject.origin].partition(" (")
    if not isinstance(subject, Subject):
        explanation = ""
    sections = {
        "Where the base model is wrong": _where(found),
        "Which physics, and how sure": _physics(found),
        "What these recordings can't tell apart": bullets(alike(found)),
        "Stiffness before and after" if shown_models(found) else "Stiffness": _stiffness(found),
        "What was tested": _tested(found),
        "What could not be tested": bullets(untested(found)),
        "Remarks on the recordings": bullets(found.observed.remarks) or "None.",
        "What to measure next": _next(found, plan),
        "Noise and accuracy": _noise(found),
        "Files": _listing(files),
    }
    blocks = [
        f"{heading}\n{'=' * min(len(heading), WIDTH)}",
        f"*** {what.upper()} ***" + (f" ({explanation}" if explanation else ""),
        *map(fill, doubt_lines(doubts_of(found, subject))),
        _headline(f"Verdict: {found.verdict.upper()}") + _verdict(found),
        *(_headline(name) + body for name, body in sections.items() if body),
    ]
    return "\n\n".join(blocks) + "\n"


def _headline(name: str) -> str:
    return f"{name}\n{'-' * len(name)}\n"


def _verdict(found: Diagnosis) -> str:
    ends = ", the cylinder's ends included" if found.with_ends else ""
    looks = (
        f"The base model ({LAW_NAMES[found.law]} deep tissue{ends}, nothing added) fits with "
        f"R2 = {r_squared(found.base.fit, found):.5f}. Probabilities weigh all explanations "
        "against each other: none, one mechanism, two, or something unknown; half of all tests "
        "are taken to be sound beforehand."
    )
    if found.verdict == "consistent":
        looks += (
            " That is no proof that nothing was left out: what C10 and C20 take up, and what "
            "could not be tested, stays unseen. How strong each mechanism may be unseen stands "
            "below."
        )
    if found.verdict in ("named", "ambiguous"):
        looks += (
            " The recordings tell which known mechanisms can explain them; a mechanism that legfem "
            "does not know and that looks alike is not ruled out."
        )
    return (
        f"{fill(verdict_sentence(found))}\n\n{fill(looks)}\n\n"
        f"{_indented(tables.table(*tables.explanation_cells(found)))}"
    )


def _where(found: Diagnosis) -> str:
    if found.verdict == "consistent":
        return ""
    if not found.located.any():
        return fill("The misfit is spread over the recordings; no interval stands out by itself.")
    how = (
        "Intervals in which the repaired model differs from the base model by more than a trial's "
        "noise"
        if found.models
        else "Intervals that stand out of the noise (chosen among all intervals)"
    )
    note = (
        f"{how}. Size: recorded less model, mean; above zero the tissue pushed back harder than "
        "the model says. Noise: standard deviation of one trial's value. p: family-wise over all "
        "intervals looked at; '-' where the interval is not significant by itself."
    )
    return f"{fill(note)}\n\n{tables.places_table(found)}"


def _physics(found: Diagnosis) -> str:
    if found.verdict == "consistent":
        note = (
            "None is asked for. What these recordings would have shown: with 95 % each mechanism, "
            "if it is there at all, lies between these."
        )
        return f"{fill(note)}\n\n{tables.table(*tables.limit_cells(found))}"
    if not found.models:
        return _closest(found)
    blocks = []
    for k, model in enumerate(found.models, 1):
        label = f"({k}) " if len(found.models) > 1 else ""
        statements = "; and ".join(f"{plain(m.name)}: {m.statement}" for m in model.fit.mechanisms)
        blocks.append(
            fill(f"{label}{statements}.") + f"\n{_indented(tables.mechanism_table(model))}"
        )
    blocks.append(tables.table(*tables.evidence_cells(found)))
    blocks.append(
        fill(
            f"{tables.held_out_note(found.base_held_out)} ln Bayes factor: how much more probable "
            "the recordings are with the mechanism than without; 5 is strong. In part: beside it "
            "something remains that has no name, since no real effect has exactly a model's form."
        )
    )
    return "\n\n".join(blocks)


def _closest(found: Diagnosis) -> str:
    text = (
        "None that legfem knows. Every mechanism that these recordings can show was put into the "
        "model, alone and the best in pairs; something unknown is more probable than any of them."
    )
    named = [e for e in found.explained.every if e.names]
    if named:
        text += (
            f" The most probable of them is {model_name(named[0])} "
            f"({percent(named[0].probability)}): that is not a finding."
        )
    held = found.base_held_out
    return (
        f"{fill(text)}\n\n"
        + fill(
            f"The base model predicts {held.how}, from a refit to the others, with an error of "
            f"{held.rmse:.3f} N; what differs from trial to trial makes {held.noise:.3f} N."
        )
    )  # fmt: skip


def alike(found: Diagnosis) -> list[str]:
    """Return sentences on what the recordings can't tell apart."""
    lines = []
    if len(found.models) > 1:
        names = [model_name(model) for model in found.models]
        lines.append(
            f"{'; '.join(names)}: together they hold 90 % of the probability, and none of them "
            "does alone. Which of them it is can't be said."
        )
    both = "C10 and C20 together" if "C20" in found.base.fit.free else "C10"
    lines.append(
        "A constant factor on the force (the load cell's gain, the cylinder's length) looks like "
        f"a change of {both}. It is not tested, and would sit in the stiffness unseen."
    )
    hidden = [s for s in found.assessment.scores if s.concealed > 0.95]
    if hidden:
        names = [f"{plain(s.name)} ({100 * s.concealed:.1f} %)" for s in hidden]
        lines.append(
            "A refit of the stiffness hides nearly all of a small effect of: "
            f"{', '.join(names)}. Such an effect could bias the stiffness without a sign."
        )
    return lines


def _stiffness(found: Diagnosis) -> str:
    text = tables.parameter_table(found)
    if found.verdict == "unexplained":
        return (
            fill(
                "DO NOT RELY ON THIS STIFFNESS: no model describes the recordings, so the "
                "intervals below are those of wrong models. They don't cover what was left out."
            )
            + f"\n\n{text}"
        )
    if found.verdict == "ambiguous":
        text += "\n\n" + fill(
            "Which row holds depends on which mechanism it is; take the stiffness to lie "
            "anywhere in the rows of the models with a mechanism."
        )
    return text


def _tested(found: Diagnosis) -> str:
    if not found.assessment.scores:
        return "Nothing: these recordings show none of the mechanisms."
    note = (
        "Score tests of the base model's residual, each by itself: the chance of so strong a "
        "likeness by noise. Of many tests some are small by chance; the verdict allows for that. "
        "Small in several rows does not mean several causes: signs of mechanisms look alike."
    )
    return f"{fill(note)}\n\n{tables.table(*tables.score_cells(found))}"


def untested(found: Diagnosis) -> list[str]:
    """Return which mechanisms could not be tested, and why."""
    if not found.untested:
        return ["Nothing: all mechanisms that legfem knows were tested."]
    reasons: dict[str, list[str]] = {}
    for name, why in found.untested.items():
        reasons.setdefault(why, []).append(plain(name))
    return [f"{', '.join(names)}: {why}" for why, names in reasons.items()]


def _next(found: Diagnosis, plan: Sequence[str]) -> str:
    wanted = next_experiments(found)
    if plan:
        reckoned = bullets([line[0].upper() + line[1:] for line in plan])
        note = "Simulated under each candidate, the best first:"
        others = bullets([line[0].upper() + line[1:] for line in wanted])
        return f"{fill(note)}\n{reckoned}\n{fill('Not simulated:')}\n{others}"
    if not wanted:
        return "Nothing is asked for by these recordings."
    text = bullets([line[0].upper() + line[1:] for line in wanted])
    if found.verdict == "ambiguous":
        return fill("To tell the candidates apart:") + "\n" + text
    if found.verdict == "named":
        return fill("To confirm what was named:") + "\n" + text
    return text


def _noise(found: Diagnosis) -> str:
    noise, posterior = found.errors.noise, found.best.posterior
    text = (
        f"A force reading errs by {noise.force_sd:.3g} N about its trial's course "
        f"({noise.white_sd:.2g} N from reading to reading; {noise.slow_sd:.2g} N slowly, over "
        f"{noise.correlation_time:.2g} s), a trial's zero by {posterior.zero_sd:.2g} N, its gain "
        f"by {100 * posterior.gain_sd:.2g} %, the displacement by {noise.wander_sd:.2g} mm; known "
        f"from {noise.source}. The {len(found.observed.force)} values compared are worth "
        f"{found.errors.effective_samples:.0f} independent ones. {_solutions(found)}"
    )
    far = sorted(
        zip(found.errors.names, posterior.effects, strict=True), key=lambda pair: -abs(pair[1])
    )
    note = (
        "What is not known exactly (the geometry, and what is assumed of the tissues) may "
        "take up misfit as far as its stated accuracy allows; it was asked most of: "
        + "; ".join(f"{name} {z:+.1f} sd" for name, z in far[:4])
        + "."
    )
    return f"{fill(text)}\n\n{fill(note)}"


def _solutions(found: Diagnosis) -> str:
    if not (found.solutions or found.emulator_error > 0):
        return "No full finite-element solution was made to confirm the interpolated forces."
    made = (
        f"{found.solutions} finite-element solutions were made now, beside those kept from before; "
    )
    if found.emulator_error != found.emulator_error:
        return made + "one of the base model stopped, so interpolation could not be checked."
    return made + (
        f"interpolation differed from the base model's by {found.emulator_error:.2%} of the "
        "largest force at most."
    )


def _listing(files: Sequence[ReportFile]) -> str:
    rows = []
    for entry in files:
        rows.append(", ".join(path.name for path in entry.paths))
        rows.append(fill(entry.shows, "    "))
    return "\n".join([*rows, "diagnosis.json", "    all numbers with their units"])


def _indented(text: str) -> str:
    return textwrap.indent(text, "  ")
