"""The page of a diagnosis."""

import math
from collections.abc import Iterator, Sequence

import numpy as np

from legfem.common.numbers import number, percent, share
from legfem.geometry.section import MUSCLE
from legfem.inverse.averaging import TIMES, left_open
from legfem.inverse.catalogue import DEEP_C10, symbol_of
from legfem.inverse.fit import Fit, KindDetails, r_squared
from legfem.inverse.mechanism import null_of
from legfem.inverse.plan import DesignValue
from legfem.inverse.verdict import DIFFER, TRUSTED, Diagnosis, explained_share
from legfem.legs.diagnosis import notices_of
from legfem.legs.subject import Subject
from legfem.report import diagnosis_headline, diagnosis_sentences, estimates
from legfem.report import diagnosis_numbers as tables
from legfem.report import page as web
from legfem.report.answers import sentence_of
from legfem.report.diagnosis_curves import curves_of, model_name, places_of, plain, signatures_of
from legfem.report.diagnosis_document import Recorded, versions
from legfem.report.further_channels import channel_chapter, misfit_in_section
from legfem.report.plan import chance_text
from legfem.report.pressed_section import still_section
from legfem.report.words import LAW_NAMES, TOLD, DataKind, capital


def next_blocks(found: Diagnosis, plan: Sequence[DesignValue]) -> list[web.Block]:
    """Return what to measure next.

    Parameters
    ----------
    found
        The diagnosis.
    plan
        Tests whose chance was calculated, the best first.
    """
    wanted = [capital(line) for line in diagnosis_sentences.next_experiments(found)]
    if not plan:
        if not wanted:
            return [web.Prose(diagnosis_headline.to_do(found, plan))]
        why = {"ambiguous": "To distinguish the candidates:", "named": "To confirm the cause that was found:"}
        before = [web.Prose(why[found.verdict])] if found.verdict in why else []
        return [*before, web.Bullets(wanted)]
    planned = [f"{capital(one.design.name)}: {chance_text(one)}" for one in plan]
    blocks: list[web.Block] = [web.Prose(TOLD["planned"]), web.Bullets(planned)]
    names = {capital(one.design.name) for one in plan}
    if left := [line for line in wanted if line not in names]:
        blocks += [web.Prose("Tests whose chance was not calculated:"), web.Bullets(left)]
    stated = [
        {
            "effect =": f'"{m.name}"',
            "value =": f"{first.name.replace('_', ' ')}, {first.statement}",
            "unit": first.unit,
            "value without it": f"{null_of(first):g}",
        }
        for m in dict.fromkeys(m for model in found.models for m in model.fit.mechanisms)
        for first in m.parameters[:1]
        if m.measured_sd is not None
    ]
    return [*blocks, web.WebTable.of(TOLD["measured"], stated)] if stated else blocks


def diagnosis_web_page(
    found: Diagnosis,
    subject: Recorded,
    plan: Sequence[DesignValue] = (),
    command: str = "",
    pressed: web.PressedSection | None = None,
) -> web.WebPage:
    """Return the page of a diagnosis.

    Parameters
    ----------
    found
        The diagnosis.
    subject
        Whose recordings they are.
    plan
        Tests that could be made next, the best first.
    command
        That was given; empty where there was none.
    pressed
        The section for the reader to press; as it is unpressed without it.
    """
    leg = subject if isinstance(subject, Subject) else None
    located = misfit_in_section(found, leg) if leg else []
    each = _each_recording(found.base)
    curves = [block for k in range(len(found.observed.protocols)) for block in curves_of(found, k)]
    notices = notices_of(found, subject)
    return web.WebPage(
        f"Can the stiffness of {'subject' if leg else 'specimen'} ‘{subject.id}’ be trusted?",
        subject.title,
        subject.origin,
        diagnosis_headline.headline(found, plan, "deep" if leg and MUSCLE not in leg.section.lacks else "", notices),
        list(map(sentence_of, notices)),
        list(tables.known_of(found, subject)),
        [
            web.Chapter("Recordings and model", curves),
            *([web.Chapter("The leg", [pressed or still_section(leg)])] if leg else []),
            *channel_chapter(found),
            web.Chapter("Where the model is wrong", [*_where(found), *signatures_of(found), *located, *each]),
            web.Chapter("Which physics, and how sure", _physics(found)),
            web.Chapter("What was tested", tables.score_blocks(found)),
            web.Chapter("What could not be tested", [web.Bullets([*_untested(found)])]),
            web.Chapter("What to do next", next_blocks(found, plan)),
            web.Chapter("Noise and accuracy", [web.Prose(_noise(found))]),
        ],
        web.Repeat(command, versions(), {"seed": f"{found.seed}"}, subject.directory),
        None if leg else DataKind(f"{subject.origin} data"),
        " for the person who recorded and described the test",
    )


def _where(found: Diagnosis) -> list[web.Block]:
    if not found.located.any():
        none = "The difference is spread over the recordings; no single interval stands out."
        if any(window.channel != "force" for window in found.assessment.windows):
            none = "No interval of the force stands out, but channels beside the force do."
        elif found.verdict == "consistent":
            none = "No interval stands out from the noise."
        return [web.Prose(none)]
    how = "The table lists intervals that stand out from the noise (chosen among all intervals)"
    if found.models:
        how = "The table lists intervals in which the repaired model differs from the base model by more than a "
        how += "trial's noise"
    places = places_of(found)
    more = len(places) - tables.PLACES_SHOWN
    return [
        web.Prose(TOLD["places"].format(how=how)),
        tables.places_table(places, found),
        *([web.Prose(f"{more} smaller ones are in diagnosis.json.")] if more > 0 else []),
    ]


def _each_recording(base: Fit[KindDetails]) -> list[web.Block]:
    """Return what each recording gives by itself; nothing where there is one."""
    names = list(base.tests[0].by_itself)
    if not names:
        return []
    agreed = base.agreement
    same = not agreed.p_value < DIFFER
    said = f"Fitted one by one with the base model, the recordings {'agree' if same else 'disagree'} on "
    said += f"{symbol_of(names[0])} (chi-square {estimates.chance(agreed)})"
    said += "." if same else ": their values differ by more than usual errors of readings, gain and zero cause."
    if not base.goodness.fits:
        said += " The base model doesn't fit them, so that their values need not lie around that of all together."
    rows = [[one.name, *(estimates.own_value(one, name) for name in names)] for one in base.tests]
    columns = ["recording", *(f"{symbol_of(name)} ± standard error" for name in names)]
    return [web.Prose(said), web.WebTable("What each recording gives by itself", columns, rows, folded=True)]


def _physics(found: Diagnosis) -> list[web.Block]:
    blocks: list[web.Block] = [
        web.Prose(diagnosis_sentences.verdict_sentence(found)),
        web.Prose(_looks(found)),
        tables.explanation_bars(found),
        web.Prose(TOLD["phases"]),
        tables.phase_table(found),
    ]
    if found.verdict == "consistent":
        blocks += _hidden(found) if found.limits else []
    elif not found.models:
        return [*blocks, web.Prose(_closest(found))]
    else:
        held = found.base_held_out
        evidence = TOLD["evidence"].format(how=held.how, noise=number(held.noise))
        blocks += [tables.evidence_table(found), web.Prose(evidence)]
    if (common := tables.occurrence_table(found)) is not None:
        blocks += [web.Prose(TOLD["how_common"].format(times=TIMES)), common]
    return blocks


def _hidden(found: Diagnosis) -> list[web.Block]:
    """Return what could hide, sorted by what it does to C10."""
    change = f"change C10 by more than {100 * TRUSTED:.0f} % without being detected"
    table = tables.limit_table(found)
    if not found.hidden:
        return [web.Prose(f"{TOLD['made_stronger']} None of them can {change}."), table]
    listed = web.Bullets([diagnosis_sentences.hidden_sentence(found, *one) for one in found.hidden])
    return [web.Prose(f"{TOLD['made_stronger']} The following could {change}, the largest first:"), listed, table]


def _looks(found: Diagnosis) -> str:
    stiffness = " and ".join(map(symbol_of, found.base_model.fit.stiffness))
    left = float(np.sum(found.base_model.fit.residual[found.observed.data.spans[0]] ** 2))
    ends = ", the cylinder's ends included" if found.with_ends else ""
    fits = r_squared(left, found.observed.force)
    looks = TOLD["base_model"].format(law=LAW_NAMES[found.law], ends=ends, r_squared=fits) + TOLD["weighed"]
    if found.verdict == "consistent":
        looks += TOLD["no_proof"].format(stiffness=stiffness)
        looks += " The table below says how strong each may be." * bool(found.limits)
    if found.models:
        looks += " A mechanism that legfem does not know and that looks the same is not ruled out."
    return looks


def _closest(found: Diagnosis) -> str:
    text = TOLD["no_mechanism"]
    named = [e for e in found.explained.every if e.names]
    if named and found.explained.describes(named[0]):
        text += TOLD["most_probable"].format(name=model_name(named[0]), chance=percent(named[0].probability))
    elif named:
        part = percent(explained_share(found, named[0]))
        text += TOLD["comes_closest"].format(name=capital(model_name(named[0])), part=part)
    held = found.base_held_out
    return TOLD["closest_fails"].format(text=text, how=held.how, error=held.rmse, noise=held.noise)


def _untested(found: Diagnosis) -> Iterator[str]:
    """Yield which mechanisms could not be tested, and why, and what no test shows."""
    reasons: dict[str, list[str]] = {}
    for name, why in found.untested.items():
        reasons.setdefault(why, []).append(plain(name))
    yield from (f"{', '.join(names)}: {why}" for why, names in reasons.items())
    if not reasons:
        yield "All mechanisms that legfem knows were tested."
    both = " and ".join(map(symbol_of, found.base_model.fit.stiffness))
    yield TOLD["constant_factor"].format(both=both)


def _solved_in_full(found: Diagnosis) -> str:
    """Return which effects were only screened, and what that may move; nothing where all were solved in full."""
    left = left_open(found.explained, DEEP_C10)
    if not left.screened:
        return ""
    whole = f"the answer rests on {' and '.join(map(plain, left.in_full))}, solved in full; " if left.in_full else ""
    bounds = {"probability": share(left.probability), "interval": share(left.interval)}
    return TOLD["screened"].format(whole=whole, count=len(left.screened), **bounds)


def _noise(found: Diagnosis) -> str:
    noise, posterior = found.errors.noise, found.best.posterior
    if not (found.solutions or found.emulator_error > 0):
        solved = "No full finite-element solution confirmed the interpolated forces."
    else:
        were = " was" if found.solutions == 1 else "s were"
        solved = f"{found.solutions or 'No'} finite-element solution{were} computed in this run, beside those from "
        solved += "earlier runs; "
        solved += (
            "a solution of the base model stopped, so the interpolation could not be checked."
            if math.isnan(found.emulator_error)
            else "the interpolation differed from the base model's solution by at most "
            f"{100 * max(found.emulator_error, 1e-4):.2g} % of the largest force."
        )
    solved = f"{solved} {_solved_in_full(found)}".strip()
    return TOLD["noise"].format(noise=noise, zero=posterior.zero_sd, gain=100 * posterior.gain_sd, solved=solved)
