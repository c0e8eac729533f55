"""The page of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from legfem.common.doubts import doubt_lines
from legfem.diagnose.diagnosis import Diagnosis
from legfem.diagnose.document import Recorded, doubts_of, kind_of
from legfem.diagnose.explanation import Explanation
from legfem.diagnose.sentences import verdict_sentence
from legfem.report import diagnosis_tables as tables
from legfem.report.diagnosis_style import BASE_NAME, model_name, plain
from legfem.report.diagnosis_text import alike, untested
from legfem.report.web import page as web
from legfem.report.web.diagnosis_curves import curves_of
from legfem.report.web.diagnosis_headline import TITLE, headline, to_do_next
from legfem.report.web.diagnosis_numbers import known_of
from legfem.report.web.section import PressedSection, still_section
from legfem.subjects.subject import Subject


def diagnosis_web_page(
    found: Diagnosis,
    subject: Recorded,
    text: str,
    plan: Sequence[str] = (),
    versions: Mapping[str, str] | None = None,
    command: str = "",
    pressed: PressedSection | None = None,
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
    pressed
        The section for the reader to press; as it is unpressed without it.
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
        web.Chapter("What to do next", [web.Bullets(to_do_next(found, plan))]),
    ]
    if isinstance(subject, Subject):
        chapters.insert(1, web.Chapter("The leg", [pressed or still_section(subject)]))
    chapters.append(web.Chapter("The full report", [web.Verbatim("report.txt", text)]))
    return web.WebPage(
        title=TITLE.format(kind=kind_of(subject).lower(), id=subject.id),
        subject=subject.title,
        origin=subject.origin,
        headline=headline(found, plan, "deep" if isinstance(subject, Subject) else ""),
        warnings=[*doubt_lines(doubts_of(found, subject)), *_warnings(found)],
        warned=" for whoever made and described the recordings",
        known=known_of(found, subject),
        chapters=chapters,
        repeat=web.Repeat(command, versions or {}),
    )


def _warnings(found: Diagnosis) -> list[str]:
    warnings = list(found.observed.remarks)
    for model in (found.base, *found.models):
        for name in model.fit.at_bound:
            warnings.append(
                f"{plain(name).replace('.', ', ')} is found at the end of the range that it was "
                f"looked for in: {tables.estimate(model, name)} ({_name(model)})."
            )
    if not found.solutions and not found.emulator_error > 0:
        warnings.append(
            "Forces were interpolated between simulations; none was made anew to confirm them."
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
