"""The page of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from legfem.common.doubts import doubt_lines
from legfem.diagnose.diagnosis import Diagnosis, Verdict
from legfem.diagnose.document import Recorded, doubts_of, kind_of
from legfem.diagnose.explanation import Explanation
from legfem.diagnose.sentences import (
    next_experiments,
    percent,
    statements,
    stiffness_range,
    stiffness_sentence,
    verdict_sentence,
)
from legfem.report import diagnosis_tables as tables
from legfem.report.diagnosis_style import BASE_NAME, model_name, plain
from legfem.report.diagnosis_text import alike, untested
from legfem.report.web import page as web
from legfem.report.web.diagnosis_curves import curves_of
from legfem.report.web.diagnosis_numbers import known_of
from legfem.report.web.section import still_section
from legfem.subjects.subject import Subject

_TONES: Mapping[Verdict, web.Tone] = {
    "consistent": "sound",
    "named": "caution",
    "ambiguous": "caution",
    "unexplained": "wrong",
}


def diagnosis_web_page(
    found: Diagnosis,
    subject: Recorded,
    text: str,
    plan: Sequence[str] = (),
    versions: Mapping[str, str] | None = None,
    command: str = "",
) -> web.WebPage:
    """Return the page of a diagnosis.

    Parameters
    ----------
    found
        The diagnosis.
    subject
        Whose recordings they are.
    text
        Of ``report.txt``.
    plan
        What could be done next, each with its chance, the best first.
    versions
        Of the programs that made it.
    command
        That was given; empty where there was none.
    """
    chapters = [
        web.Chapter(
            "Recordings and model",
            [block for k in range(len(found.observed.protocols)) for block in curves_of(found, k)],
        ),
        web.Chapter("Where the model is wrong", _where(found)),
        web.Chapter("Which physics, and how sure", _physics(found)),
        web.Chapter("What was tested", _tested(found)),
        web.Chapter("What could not be tested", [web.Bullets([*untested(found), *alike(found)])]),
        web.Chapter("What to do next", [web.Bullets(_next(found, plan))]),
    ]
    if isinstance(subject, Subject):
        chapters.insert(1, web.Chapter("The leg", [still_section(subject)]))
    chapters.append(web.Chapter("The full report", [web.Verbatim("report.txt", text)]))
    return web.WebPage(
        title=f"Does the model describe the test of {kind_of(subject).lower()} {subject.id}?",
        subject=subject.title,
        origin=subject.origin,
        headline=_headline(found, plan),
        warnings=[*doubt_lines(doubts_of(found, subject)), *_warnings(found)],
        known=known_of(found, subject),
        chapters=chapters,
        repeat=web.Repeat(command, versions or {}),
    )


def _headline(found: Diagnosis, plan: Sequence[str]) -> web.Headline:
    return web.Headline(
        _TONES[found.verdict],
        _sentence(found),
        [
            ("What is wrong", _wrong(found)),
            ("How sure", _sure(found)),
            ("What it does to C10", _stiffness(found)),
            ("What to do", f"{_capital(_next(found, plan)[0])}."),
        ],
    )


def _sentence(found: Diagnosis) -> str:
    if found.verdict == "consistent":
        return "The model describes this test: nothing asks for more physics."
    if found.verdict == "unexplained":
        return "The model is wrong, and nothing that legfem knows explains how."
    names = [model_name(model) for model in found.models]
    if found.verdict == "named":
        part = " (told in part)" if found.models[0].in_part else ""
        return f"The model leaves something out{part}: {names[0]}."
    return (
        f"The model leaves something out: one of {len(names)} effects, and these recordings can't "
        "tell which."
    )


def _wrong(found: Diagnosis) -> str:
    if found.verdict == "consistent":
        return (
            "Nothing that these recordings could show. That is no proof: what could not be tested "
            "stays unseen."
        )
    if found.verdict == "unexplained":
        return (
            "The recordings contradict the model by more than their errors and what is not known "
            "of what was pressed allow."
        )
    return f"{_capital('; or '.join(statements(model) for model in found.models))}."


def _sure(found: Diagnosis) -> str:
    if found.verdict == "consistent":
        return f"{_capital(percent(found.explained.soundness))} probable that none shows."
    if found.verdict == "unexplained":
        return (
            f"{_capital(percent(1 - found.explained.soundness))} probable that something was left "
            "out; none of what was tried is more probable than something unknown."
        )
    shares = "; ".join(
        f"{model_name(model)} {percent(model.probability)}" for model in found.models
    )
    return f"Of the explanations that leave something out: {shares}."


def _stiffness(found: Diagnosis) -> str:
    if found.verdict == "unexplained":
        return (
            "Unknown. Don't rely on the stiffness below: its intervals are those of wrong models."
        )
    if found.verdict == "named":
        return stiffness_sentence(found.base, found.models[0])
    if found.verdict == "ambiguous":
        return stiffness_range(found.base, found.models)
    low_high = "; ".join(
        f"{name} is {tables.estimate(found.base, name)} kPa "
        f"({tables.averaged(found, name) or tables.interval(found.base, name)}, 95 %)"
        for name in ("C10", "C20")
        if name in found.base.fit.free
    )
    return f"Nothing: {low_high}."


def _warnings(found: Diagnosis) -> list[str]:
    warnings = list(found.observed.remarks)
    if found.verdict == "unexplained":
        warnings.insert(0, "Do not rely on the stiffness: no model describes the recordings.")
    if found.verdict == "ambiguous":
        warnings.insert(
            0, "The stiffness depends on which of the candidates it is: use none alone."
        )
    for model in (found.base, *found.models):
        for name in model.fit.at_bound:
            warnings.append(f"{plain(name)} stands at the bound of its search ({_name(model)}).")
    if not found.solutions and not found.emulator_error > 0:
        warnings.append(
            "No full finite-element solution was made to confirm the interpolated forces."
        )
    return warnings


def _name(model: Explanation) -> str:
    return f"with {model_name(model)}" if model.names else BASE_NAME


def _where(found: Diagnosis) -> list[web.Block]:
    if not found.located.any():
        return [
            web.Prose(
                "Nowhere that stands out of the noise."
                if found.verdict == "consistent"
                else "The misfit is spread over the recordings; no interval stands out by itself."
            )
        ]
    return [
        web.Prose(
            "Size: recorded less model; above zero the tissue pushed back harder than it should."
        ),
        web.WebTable("Intervals in which the model is wrong", *tables.places_cells(found)),
    ]


def _physics(found: Diagnosis) -> list[web.Block]:
    every = web.WebTable("How probable each explanation is", *tables.explanation_cells(found))
    if found.verdict == "consistent":
        return [
            every,
            web.WebTable(
                "How strong each mechanism may be without having been seen",
                *tables.limit_cells(found), folded=True,
            ),
        ]  # fmt: skip
    blocks: list[web.Block] = [web.Prose(verdict_sentence(found)), every]
    if found.models:
        blocks += [
            web.WebTable("What the reported explanations explain", *tables.evidence_cells(found)),
            web.Prose(tables.held_out_note(found.base_held_out)),
        ]
    return blocks


def _tested(found: Diagnosis) -> list[web.Block]:
    if not found.assessment.scores:
        return [web.Prose("Nothing: these recordings show none of the mechanisms.")]
    return [
        web.Prose(
            "Each effect's sign was looked for by itself. Of many tests some come out small by "
            "chance, and signs look alike; the verdict allows for both."
        ),
        web.WebTable("Signs of mechanisms in what the model misses", *tables.score_cells(found)),
    ]


def _next(found: Diagnosis, plan: Sequence[str]) -> list[str]:
    lines = [*plan, *next_experiments(found)]
    if lines:
        return [_capital(line) for line in lines]
    return [
        "Nothing is asked for by these recordings: use the stiffness with the law it belongs to"
    ]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
