"""The page of an identification."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from legfem.common.doubts import doubt_lines
from legfem.common.units import readable_unit
from legfem.experiments.plane_strain import tissues_of
from legfem.geometry.section import girth
from legfem.identify.catalogue import parameter_of, symbol_of, unit_of
from legfem.identify.forward import values_of
from legfem.identify.result import Estimate, IdentificationResult
from legfem.inference.constants import NUMERICAL_ERROR
from legfem.report.page import procedure
from legfem.report.style import DATA_COLOUR, FAINT, LAW_COLOURS, LAW_NAMES, REGION_NAMES
from legfem.report.text import comparison, fit_report, fits, preferred, prior_text
from legfem.report.web.curves import Curves, Dash, Line
from legfem.report.web.page import (
    Bullets,
    Chapter,
    Headline,
    Known,
    Prose,
    Repeat,
    Tone,
    Verbatim,
    WebPage,
)
from legfem.report.web.section import PressedSection, still_section
from legfem.report.words import number
from legfem.subjects.subject import Subject

_DASHES: dict[str, Dash] = {"neo-hookean": "dashed", "reduced-polynomial": "solid"}
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
) -> WebPage:
    """Return the page of an identification.

    Parameters
    ----------
    results
        One a law, of one subject.
    subject
        Whose results they are.
    pressed
        The section while it is pressed, where it was solved for.
    command
        That was given; empty where there was none.
    """
    chosen = preferred(results)
    return WebPage(
        title=f"How stiff is the deep tissue of subject {subject.id}?",
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
        known=_known(results, subject),
        chapters=[
            Chapter("Recordings and model", [_curves(results)]),
            Chapter("The leg, pressed", [pressed or still_section(subject)]),
            Chapter(
                "What was tested",
                [Bullets([*comparison(results), *_identifiable(results)])],
            ),
            Chapter("What could not be tested", [Bullets(_NOT_TESTED)]),
            Chapter("What to do next", [Bullets(_next(chosen, subject))]),
            Chapter(
                "How it was done",
                [
                    Prose(" ".join(procedure(results[0], subject).split())),
                    *(
                        Verbatim(f"All numbers: {LAW_NAMES[r.law]} law", fit_report(r))
                        for r in results
                    ),
                ],
            ),
        ],
        repeat=Repeat(command, chosen.versions, {"seed": f"{chosen.seed}"}),
    )


def _headline(chosen: IdentificationResult, subject: Subject) -> Headline:
    law, every = LAW_NAMES[chosen.law], chosen.parameters.values()
    known = all(found.identifiability == "identifiable" for found in every)
    tone: Tone = "wrong" if not fits(chosen) else "sound" if known else "caution"
    if tone == "wrong":
        sentence = (
            "The model does not describe this test: the stiffness below is that of a wrong model."
        )
        wrong = f"Something that the {law} law leaves out shows in the recordings."
    else:
        sentence = f"The {law} law describes this test, and the deep tissue's C10 is {_c10(chosen)}"
        wrong = "Nothing that the loading of these recordings could show."
    sure = "; ".join(
        f"{symbol_of(name)} is {found.identifiability}"
        + (
            f" (within {100 * found.relative_half_width:.0f} %)"
            if np.isfinite(found.relative_half_width)
            else ""
        )
        for name, found in chosen.parameters.items()
    )
    c10 = _value("deep.C10", chosen)
    return Headline(
        tone,
        sentence,
        [
            ("What is wrong", wrong),
            (
                "How sure",
                f"{sure}. If the model is right, 19 of 20 such intervals hold the true value.",
            ),
            (
                "What it does to C10",
                f"{c10} is the best fit, but don't rely on it: its interval doesn't cover what was "
                "left out."
                if tone == "wrong"
                else f"Nothing is known to move it from {c10}; what was assumed of fat and fascia "
                "does, by the shares in the table.",
            ),
            ("What to do", _next(chosen, subject)[0]),
        ],
    )


def _c10(chosen: IdentificationResult) -> str:
    found = chosen.parameters.get("deep.C10")
    if found is None:
        return f"{_value('deep.C10', chosen)}, as given."
    return f"{_value('deep.C10', chosen)} (95 % interval {_interval(found)})."


def _value(name: str, result: IdentificationResult) -> str:
    found = result.parameters.get(name)
    if found is not None:
        return f"{number(found.shown.value, found.shown.standard_error)} {found.shown.unit}"
    unit, factor = readable_unit(unit_of(name))
    return f"{factor * {**result.assumed, **result.values}[name]:.4g} {unit}"


def _interval(found: Estimate) -> str:
    shown = found.shown
    return " to ".join(number(end, shown.standard_error) for end in shown.ci95)


def _known(results: Sequence[IdentificationResult], subject: Subject) -> list[Known]:
    first = results[0]
    data = subject.origin
    curve, trials = first.measured, first.measured.n_trials
    rows = [
        Known(
            f"{_words(name)}, {LAW_NAMES[result.law]} law",
            _value(name, result),
            "estimated" if found.parameter.role == "identified" else "prior",
            f"{trials} recording{'s' * (trials > 1)}"
            + (f"; {prior_text(found.parameter)}" if found.parameter.prior else ""),
            _interval(found),
            _remark(found),
        )
        for result in reversed(results)
        for name, found in result.parameters.items()
    ]
    given = values_of(tissues_of(subject))
    free = {name for result in results for name in result.parameters}
    held = {n: v for result in results for n, v in result.assumed.items() if n not in free}
    for name, value in held.items():
        unit, factor = readable_unit(unit_of(name))
        stated = np.isclose(given.get(name, np.nan), value)
        source = "subject.toml" if stated else "given with the command, or the law's own"
        rows.append(
            Known(_words(name), f"{factor * value:.4g} {unit}", "assumed", source,
                  remark=_moved(name, results))
        )  # fmt: skip
    rows.append(
        Known("thickness of the fascia", f"{subject.section.fascia_thickness:g} mm", "assumed",
              "subject.toml")
    )  # fmt: skip
    if first.correction is not None:
        applied = first.correction
        rows.append(
            Known(
                f"3D correction P at {curve.displacement[-1]:.3g} mm", f"{applied.P[-1]:+.3f}",
                "prior", applied.name,
                f"{applied.P[-1] - 2 * applied.sd[-1]:+.3f} to "
                f"{applied.P[-1] + 2 * applied.sd[-1]:+.3f}",
            )
        )  # fmt: skip
    rows += [
        Known("error of the numerical model", f"{100 * NUMERICAL_ERROR:g} % of the force (sd)",
              "prior", "study convergence"),
        Known("noise of a force reading", f"{curve.noise.force_sd:.3g} N (sd)", data,
              curve.noise.source),
        Known("greatest displacement used", f"{curve.displacement[-1]:.4g} mm", data,
              "recordings, from first contact"),
        Known("girth of the section", f"{girth(subject.section):.0f} mm", data,
              "contours of the skin"),
        Known("cylinder", f"{2 * subject.indenter.radius:g} mm across, "
              f"{subject.indenter.length:g} mm long", "assumed", "subject.toml"),
    ]  # fmt: skip
    return rows


def _words(name: str) -> str:
    tissue, _, field = name.rpartition(".")
    if tissue not in REGION_NAMES:
        return parameter_of(name, {name: 1.0}).statement
    return f"{field} of the {REGION_NAMES[tissue]}"


def _remark(found: Estimate) -> str:
    bound = f"; at the {found.at_bound} bound of the search" if found.at_bound else ""
    return f"{found.identifiability}{bound}"


def _moved(name: str, results: Sequence[IdentificationResult]) -> str:
    """Return what 10 % more of an assumed number would do to what was found."""
    moved = [
        f"{symbol_of(found)} {100 * estimate.moves[name]:+.1f} % ({LAW_NAMES[result.law]})"
        for result in reversed(results)
        for found, estimate in result.parameters.items()
        if name in estimate.moves
    ]
    return f"10 % higher: {', '.join(moved)}" if moved else ""


def _identifiable(results: Sequence[IdentificationResult]) -> list[str]:
    return [
        f"{symbol_of(name)} of the {LAW_NAMES[result.law]} law is {found.identifiability}: "
        f"{found.why}."
        for result in reversed(results)
        for name, found in result.parameters.items()
    ]


def _next(chosen: IdentificationResult, subject: Subject) -> list[str]:
    folder = f"--subject-dir {subject.directory}"
    diagnose = f"python -m legfem.diagnose {folder}"
    if not fits(chosen):
        return [f"Don't use the stiffness. Find out which physics is missing: {diagnose}"]
    unknown = [
        symbol_of(name)
        for name, found in chosen.parameters.items()
        if found.identifiability != "identifiable"
    ]
    lines = []
    if unknown:
        lines.append(
            f"These recordings don't tell {', '.join(unknown)} well: press deeper, repeat the "
            "test, or state what is known beforehand (--prior)."
        )
    else:
        lines.append(
            f"Use C10 together with the law it belongs to ({LAW_NAMES[chosen.law]}) and with the "
            "depth that was used."
        )
    lines.append(f"Have unloading, holds and speeds looked at, too: {diagnose}")
    return lines


def _curves(results: Sequence[IdentificationResult]) -> Curves:
    measured = results[0].measured
    many = measured.n_trials > 1
    lines = [
        Line(
            f"mean of {measured.n_trials} trials" if many else "the one trial",
            measured.force, None, DATA_COLOUR, points=True,
        )
    ]  # fmt: skip
    best = preferred(results)
    if many:
        lines += [
            Line(f"trial {k + 1}", force, best.predicted.force - force, FAINT, "dotted",
                 faint=True, tabled=False)
            for k, force in enumerate(measured.trial_force)
        ]  # fmt: skip
    lines += [
        Line(f"model, {LAW_NAMES[r.law]}", r.predicted.force, r.residual, LAW_COLOURS[r.law],
             _DASHES[r.law])
        for r in results
    ]  # fmt: skip
    against = f" Trials beneath are taken from the {LAW_NAMES[best.law]} law." if many else ""
    return Curves(
        "fit",
        "Force over the cylinder's displacement after first contact: recorded, and of the model "
        f"with each law; beneath, the model less the recording.{against}",
        measured.displacement,
        "displacement (mm)",
        "force (N)",
        "model − recorded (N)",
        lines,
        2 * measured.force_sd,
        "± 2 standard errors of the mean",
    )
