"""The page of an identification."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence

from legfem.common.doubts import doubt_lines
from legfem.common.units import FloatArray
from legfem.data import LoadingCurve
from legfem.identify.result import IdentificationResult
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.laws import LawName
from legfem.legs.subject import Subject
from legfem.report.law_comparison import comparison, fits, preferred
from legfem.report.style import DATA_COLOUR, FAINT, LAW_COLOURS, LAW_NAMES
from legfem.report.web import estimates
from legfem.report.web import page as web
from legfem.report.web.curves import Curves, Dash, Line
from legfem.report.web.identification_fit import how_done
from legfem.report.web.identification_numbers import known_of
from legfem.report.web.pressed_leg import pressed_leg
from legfem.report.web.section import PressedSection, still_section
from legfem.report.web.turned import TurnedLeg
from legfem.report.web.usual import high_or_low

_DASHES: dict[str, Dash] = {"neo-hookean": "dashed", "reduced-polynomial": "solid"}
_LIKEWISE = "a length_mm that is 10 % lower acts as such forces do"
_NOT_TESTED = (
    "A constant factor on the force (the load cell's gain, the cylinder's length, its ends in 3D) "
    "looks like a change of C10, and would sit in it unseen.",
    "What the tissues do in time: unloading, holds and other speeds were not used.",
    "Which physics was left out, where a law does not fit.",
)


def identification_page(
    results: Sequence[IdentificationResult],
    subject: Subject,
    pressed: PressedSection | None,
    command: str = "",
    note: str = "",
) -> web.WebPage:
    """Return the page of an identification, with the section pressed where it was solved for.

    Parameters
    ----------
    results
        One a law, of one subject.
    subject
        Whose results they are.
    pressed
        The section; as it is unpressed without it.
    command
        That was given; empty where there was none.
    note
        On the solve that pressed it.
    """
    chosen = preferred(results)
    return web.WebPage(
        title=f"How stiff is the deep tissue (muscle) of subject {subject.id}?",
        subject=subject.title,
        origin=subject.origin,
        headline=_headline(chosen, subject),
        warnings=list(
            dict.fromkeys(
                [
                    *(line for r in (chosen, *results) for line in doubt_lines(r.doubts)),
                    *(w for r in (chosen, *results) for w in r.warnings),
                ]
            )
        ),
        known=known_of(results, subject),
        chapters=[
            web.Chapter("Recordings and model", [_curves(results)]),
            web.Chapter(
                "The leg, pressed",
                [*_in_3d(results, chosen), pressed or still_section(subject), *([web.Prose(note)] if note else [])],
            ),
            web.Chapter(
                "What was tested",
                [
                    web.Bullets(
                        [
                            *comparison(results),
                            *(
                                line
                                for r in reversed(results)
                                for line in estimates.why_identifiable(r.parameters, r.law)
                            ),
                        ]
                    )
                ],
            ),
            web.Chapter(
                "What could not be tested",
                [web.Bullets([*estimates.rests_on(chosen.parameters, _LIKEWISE), *_NOT_TESTED])],
            ),
            web.Chapter("What to do next", [web.Bullets(_next(chosen, subject))]),
            web.Chapter("How it was done", how_done(results, subject)),
        ],
        repeat=web.Repeat(command, chosen.versions, {"seed": f"{chosen.seed}"}),
    )


def _headline(chosen: IdentificationResult, subject: Subject) -> web.Headline:
    law, known = LAW_NAMES[chosen.law], not estimates.unknown_among(chosen.parameters)
    tone: web.Tone = "wrong" if not fits(chosen) else "sound" if known else "caution"
    if tone == "wrong":
        sentence = "The model does not describe this test: the stiffness below is that of a wrong model."
        wrong = f"Something that the {law} law leaves out shows in the recordings."
    else:
        sentence = f"The {law} law describes this test, and the deep tissue's C10 is {_c10(chosen)}"
        wrong = "Nothing that the loading of these recordings could show."
    c10 = _c10_value(chosen)
    return web.Headline(
        tone,
        sentence,
        [
            ("What is wrong", wrong),
            ("How sure", estimates.how_sure(chosen.parameters)),
            (
                "What it does to C10",
                f"{c10} is the best fit, but don't rely on it: its interval doesn't cover what was left out."
                if tone == "wrong"
                else f"Nothing found here changes {c10}. What was assumed of fat and fascia would, "
                "if it is wrong, and what was stated of units and sizes: the table of numbers and "
                "“What could not be tested” say by how much.",
            ),
            ("What to do", _next(chosen, subject)[0]),
            *_high_or_low(chosen, tone),
        ],
    )


def _high_or_low(chosen: IdentificationResult, tone: web.Tone) -> list[tuple[str, str]]:
    found = chosen.parameters.get(DEEP_C10)
    if found is None or tone == "wrong":
        return []
    return high_or_low("deep", found.shown.value)


def _in_3d(results: Sequence[IdentificationResult], chosen: IdentificationResult) -> list[TurnedLeg]:
    """Return the leg's last full solve, of the law that was chosen where it has one."""
    for result in (chosen, *reversed(results)):
        found = result.spatial
        if found is None or found.pressed is None:
            continue
        leg = "the section, extruded" if found.extruded else "the leg's own shape"
        solved = f" with the {LAW_NAMES[result.law]} law"
        if found.confirmations:
            solved += f" at C10 {found.confirmations[-1].c10:.3g} kPa"
        caption = f"The leg in 3D ({leg}){solved}, while the cylinder is pressed in (model)."
        return [pressed_leg(found.pressed, caption)]
    return []


def options_of(subject: Subject) -> str:
    """Return a command's options that name a subject."""
    site = f" --site {shlex.quote(subject.site)}" if subject.site else ""
    return f"--subject-dir {subject.directory}{site}"


def _c10(chosen: IdentificationResult) -> str:
    found = chosen.parameters.get("deep.C10")
    interval = "as given." if found is None else f"(95 % interval {estimates.interval_text(found)})."
    return f"{_c10_value(chosen)}{', ' if found is None else ' '}{interval}"


def _c10_value(chosen: IdentificationResult) -> str:
    found = chosen.parameters.get("deep.C10")
    if found is not None:
        return estimates.value_text(found)
    return estimates.held_text("deep.C10", {**chosen.assumed, **chosen.values}["deep.C10"])


def _next(chosen: IdentificationResult, subject: Subject) -> list[str]:
    folder = options_of(subject)
    diagnose = f"python -m legfem.diagnose {folder}"
    if not fits(chosen):
        return [f"Don't use the stiffness. Find out which physics is missing: {diagnose}"]
    lines = estimates.how_to_narrow(chosen.parameters, _remedies(chosen))
    if not lines:
        lines.append(
            f"Use C10 together with the law it belongs to ({LAW_NAMES[chosen.law]}) and with the depth that was used."
        )
    lines.append(f"Have unloading, holds and speeds looked at, too: {diagnose}")
    return lines


def _remedies(chosen: IdentificationResult) -> estimates.Remedies:
    ruled = "most of its error is that of the cylinder's ends, which pressing deeper leaves as it is"
    longer = "take a longer cylinder"
    ends = f"{longer}, or solve this leg in 3D (--model 3d)" if chosen.spatial is None else longer
    return estimates.Remedies("press deeper, repeat the test", f"{ruled}: {ends}")


def _curves(results: Sequence[IdentificationResult]) -> Curves:
    predicted = {result.law: result.predicted.force for result in results}
    return fit_curves("fit", "", results[0].measured, predicted, preferred(results).law)


def fit_curves(
    name: str, where: str, measured: LoadingCurve, predicted: Mapping[LawName, FloatArray], best: LawName
) -> Curves:
    """Return recorded forces beside those that laws predict (n,), N.

    Parameters
    ----------
    name
        Of the panels.
    where
        Begins the caption; empty where there is one place.
    measured
        n forces.
    predicted
        By law.
    best
        From which trials are taken beneath.
    """
    many = measured.n_trials > 1
    lines = [
        Line(
            f"mean of {measured.n_trials} trials" if many else "the one trial",
            measured.force,
            None,
            DATA_COLOUR,
            points=True,
        )
    ]
    if many:
        lines += [
            Line(f"trial {k + 1}", force, predicted[best] - force, FAINT, "dotted", faint=True, tabled=False)
            for k, force in enumerate(measured.trial_force)
        ]
    lines += [
        Line(f"model, {LAW_NAMES[law]}", force, force - measured.force, LAW_COLOURS[law], _DASHES[law])
        for law, force in predicted.items()
    ]
    against = f" Trials beneath are taken from the {LAW_NAMES[best]} law." if many else ""
    return Curves(
        name,
        f"{where}Force over the cylinder's displacement after first contact: recorded, and of the "
        f"model with each law; beneath, the model less the recording.{against}",
        measured.displacement,
        "displacement (mm)",
        "force (N)",
        "model − recorded (N)",
        lines,
        2 * measured.force_sd,
        "± 2 standard errors of the mean",
    )
