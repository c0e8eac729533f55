"""The page of a diagnosis."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from legfem.common.doubts import doubt_lines
from legfem.common.units import kpa_to_mpa
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.explanation import Explanation
from legfem.inverse.verdict import Diagnosis, explained_share
from legfem.legs.diagnosis import doubts_of
from legfem.legs.elastography import elastography_priors
from legfem.legs.notices import disagreement
from legfem.legs.subject import Subject
from legfem.report import diagnosis_tables as tables
from legfem.report.diagnosis_document import Recorded, kind_of, r_squared, versions
from legfem.report.diagnosis_sentences import percent, verdict_sentence
from legfem.report.diagnosis_style import BASE_NAME, model_name, plain
from legfem.report.style import LAW_NAMES
from legfem.report.web import page as web
from legfem.report.web.diagnosis_curves import curves_of
from legfem.report.web.diagnosis_headline import TITLE, capital, headline
from legfem.report.web.diagnosis_next import next_blocks
from legfem.report.web.diagnosis_numbers import known_of
from legfem.report.web.section import PressedSection, still_section
from legfem.report.words import ORIGINS


def diagnosis_web_page(
    found: Diagnosis,
    subject: Recorded,
    plan: Sequence[str] = (),
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
    plan
        What could be done next, each with its chance, the best first.
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
        web.Chapter("What could not be tested", [web.Bullets([*_untested(found), *_alike(found)])]),
        web.Chapter("What to do next", next_blocks(found, plan)),
        web.Chapter("Noise and accuracy", [web.Prose(_noise(found))]),
    ]
    if isinstance(subject, Subject):
        chapters.insert(1, web.Chapter("The leg", [pressed or still_section(subject)]))
    return web.WebPage(
        title=TITLE.format(kind=kind_of(subject).lower(), id=subject.id),
        subject=subject.title,
        origin=subject.origin,
        headline=headline(found, plan, "deep" if isinstance(subject, Subject) else ""),
        warnings=[*doubt_lines(doubts_of(found, subject)), *waves_say(found, subject), *_warnings(found)],
        warned=" for whoever made and described the recordings",
        known=known_of(found, subject),
        chapters=chapters,
        repeat=web.Repeat(command, versions()),
        data="" if isinstance(subject, Subject) else ORIGINS[subject.origin].partition(" (")[0],
    )


def waves_say(found: Diagnosis, subject: Recorded) -> Iterator[str]:
    """Yield where the base model and shear waves ask for another stiffness."""
    if not isinstance(subject, Subject):
        return
    known = elastography_priors(subject.elastography).get(DEEP_C10)
    if known is not None:
        alone = found.alone
        yield from disagreement(DEEP_C10, known, kpa_to_mpa(alone.value("C10")), kpa_to_mpa(alone.fit.sd("C10")))


def _warnings(found: Diagnosis) -> list[str]:
    warnings = list(found.observed.remarks)
    for model in (found.base, *found.models):
        for name in model.fit.at_bound:
            warnings.append(
                f"{plain(name).replace('.', ', ')} is found at the end of the range that it was "
                f"looked for in: {tables.estimate(model, name)} ({_name(model)})."
            )
    if not found.solutions and not found.emulator_error > 0:
        warnings.append("Forces were interpolated between simulations; none was made anew to confirm them.")
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
    how = (
        "Intervals in which the repaired model differs from the base model by more than a trial's noise"
        if found.models
        else "Intervals that stand out of the noise (chosen among all intervals)"
    )
    more = tables.places_left_out(found)
    return [
        web.Prose(
            f"{how}. Size: recorded less model, mean; above zero the tissue pushed back harder "
            "than it should. Noise: standard deviation of one trial's value. p: family-wise over "
            "all intervals looked at; '-' where the interval is not significant by itself."
        ),
        web.WebTable("Intervals in which the model is wrong", *tables.places_cells(found)),
        *([web.Prose(f"{more} smaller ones are in diagnosis.json.")] if more > 0 else []),
    ]


def _physics(found: Diagnosis) -> list[web.Block]:
    blocks: list[web.Block] = [
        web.Prose(f"Verdict: {found.verdict.upper()}. {verdict_sentence(found)}"),
        web.Prose(_looks(found)),
        web.WebTable("What was left out, and how probably", *tables.explanation_cells(found)),
    ]
    if found.verdict == "consistent":
        return [
            *blocks,
            web.WebTable(
                "How strong each mechanism may be without having been seen", *tables.limit_cells(found), folded=True
            ),
        ]
    if not found.models:
        return [*blocks, web.Prose(_closest(found))]
    return [
        *blocks,
        web.WebTable("What the reported explanations explain", *tables.evidence_cells(found)),
        web.Prose(
            f"{tables.held_out_note(found.base_held_out)} ln Bayes factor: how much more probable "
            "the recordings are with the mechanism than without; 5 is strong. In part: beside it "
            "something remains that has no name, since no real effect has exactly a model's form."
        ),
    ]


def _looks(found: Diagnosis) -> str:
    stiffness = " and ".join(found.base.fit.stiffness)
    ends = ", the cylinder's ends included" if found.with_ends else ""
    looks = (
        f"The base model ({LAW_NAMES[found.law]} deep tissue{ends}, nothing added) fits with "
        f"R2 = {r_squared(found.base.fit, found):.5f}. Probabilities weigh all explanations "
        "against each other: none, one mechanism, two, or something unknown; beforehand as many "
        "tests are taken to be sound as to lack one mechanism, and half as many two. Nothing that "
        "shows: nothing at all, or what is too small for these recordings to tell from it."
    )
    if found.verdict == "consistent":
        looks += (
            f" That is no proof that nothing was left out: what a change of {stiffness} takes up, "
            "and what could not be tested, stays unseen. How strong each mechanism may be unseen "
            "stands below."
        )
    if found.verdict in ("named", "ambiguous"):
        looks += (
            " The recordings tell which known mechanisms can explain them; a mechanism that legfem "
            "does not know and that looks alike is not ruled out."
        )
    return looks


def _closest(found: Diagnosis) -> str:
    text = (
        "None that legfem knows. Every mechanism that these recordings can show was put into the "
        "model, alone and the best in pairs; something unknown is more probable than any of them "
        "that describes the recordings."
    )
    named = [e for e in found.explained.every if e.names]
    if named and found.explained.describes(named[0]):
        text += (
            f" The most probable of them is {model_name(named[0])} "
            f"({percent(named[0].probability)}): that is not a finding."
        )
    elif named:
        text += (
            f" {capital(model_name(named[0]))} comes closest of them, and explains "
            f"{percent(explained_share(found, named[0]))} of the misfit: that is not a finding."
        )
    held = found.base_held_out
    return (
        f"{text} The base model predicts {held.how}, from a refit to the others, with an error of "
        f"{held.rmse:.3f} N; what differs from trial to trial makes {held.noise:.3f} N."
    )


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


def _untested(found: Diagnosis) -> list[str]:
    """Return which mechanisms could not be tested, and why."""
    if not found.untested:
        return ["Nothing: all mechanisms that legfem knows were tested."]
    reasons: dict[str, list[str]] = {}
    for name, why in found.untested.items():
        reasons.setdefault(why, []).append(plain(name))
    return [f"{', '.join(names)}: {why}" for why, names in reasons.items()]


def _alike(found: Diagnosis) -> list[str]:
    """Return sentences on what the recordings can't tell apart."""
    lines = []
    if len(found.models) > 1:
        names = [model_name(model) for model in found.models]
        lines.append(
            f"{'; '.join(names)}: together they hold 90 % of the probability, and none of them "
            "does alone. Which of them it is can't be said."
        )
    both = " and ".join(found.base.fit.stiffness)
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


def _noise(found: Diagnosis) -> str:
    noise, posterior = found.errors.noise, found.best.posterior
    return (
        f"A force reading errs by {noise.force_sd:.3g} N about its trial's course "
        f"({noise.white_sd:.2g} N from reading to reading; {noise.slow_sd:.2g} N slowly, over "
        f"{noise.correlation_time:.2g} s), a trial's zero by {posterior.zero_sd:.2g} N, its gain "
        f"by {100 * posterior.gain_sd:.2g} %, the displacement by {noise.wander_sd:.2g} mm; known "
        f"from {noise.source}. The {len(found.observed.force)} values compared are worth "
        f"{found.errors.effective_samples:.0f} independent ones. {_solutions(found)} What is not "
        "known exactly (the geometry, and what is assumed of the tissues) may take up misfit as "
        "far as its stated accuracy allows: the table of numbers says how far each was moved."
    )


def _solutions(found: Diagnosis) -> str:
    if not (found.solutions or found.emulator_error > 0):
        return "No full finite-element solution was made to confirm the interpolated forces."
    made = f"{found.solutions} finite-element solutions were made now, beside those kept from before; "
    if found.emulator_error != found.emulator_error:
        return made + "one of the base model stopped, so interpolation could not be checked."
    return made + (
        f"interpolation differed from the base model's by {found.emulator_error:.2%} of the largest force at most."
    )
