"""Tables of a diagnosis' page."""

from legfem.common.units import mpa_to_kpa, percent
from legfem.data.recording import Origin
from legfem.geometry.section import girth
from legfem.inverse.accuracy import MeasuredEffect
from legfem.inverse.averaging import sensitivities
from legfem.inverse.catalogue import DEEP_C10, symbol_of
from legfem.inverse.explanation import Explanation
from legfem.inverse.mechanism import null_of
from legfem.inverse.predictive import HeldOut, checks_by_phase
from legfem.inverse.verdict import Diagnosis, explained_share
from legfem.legs.subject import Subject
from legfem.mechanisms import mechanism_named
from legfem.report import diagnosis_curves
from legfem.report.diagnosis_document import Recorded
from legfem.report.estimates import wave_rows
from legfem.report.page import Bars, Known, LabelledBar, Provenance
from legfem.report.words import between, moduli_text, number, short_probability, spaced

_WRONG = "DO NOT RELY ON IT: the model does not fit, and the interval does not include what was left out"


def known_of(found: Diagnosis, subject: Recorded) -> list[Known]:
    """Return the stiffness with each model, the mechanisms' parameters, and what was assumed."""
    trials = len(found.observed.trials)
    recordings = f"{trials} recording{'s' * (trials > 1)}"
    data: Provenance = subject.origin
    rows = []
    wrong = _WRONG if found.withheld else ""
    for name in found.base_model.fit.stiffness:
        shown = [(found.base_model, diagnosis_curves.BASE_NAME)]
        shown += [(s.model, f"with {s.name}" if s.suits else s.name) for s in diagnosis_curves.shown_models(found)]
        for model, which in shown:
            change = diagnosis_curves.relative_change(found.base_model.value(name), model.value(name))
            shown_c10 = model.shown(name)
            error = (shown_c10.ci95[1] - shown_c10.ci95[0]) / 4
            moduli = moduli_text(shown_c10.value, error) if model is found.base_model and name == DEEP_C10 else ""
            remark = [wrong, flag(model, name, 0.0), moduli if model is found.base_model else change]
            rows.append(
                Known(
                    f"{symbol_of(name)}, {which}",
                    f"{estimate(model, name)} kPa",
                    "estimated",
                    recordings,
                    interval(model, name),
                    "; ".join(filter(None, remark)),
                )
            )
        if over := averaged(found, name):
            row = Known(f"{symbol_of(name)}, {OVER_ALL}", "", "estimated", recordings, over, wrong)
            rows.append(row)
    for model in found.models:
        for mechanism in model.fit.mechanisms:
            for k, p in enumerate(mechanism.parameters):
                full = f"{mechanism.name}.{p.name}"
                remark = [
                    flag(model, full, null_of(p) if k == 0 else None),
                    f"model with {diagnosis_curves.model_name(model)}",
                ]
                rows.append(
                    Known(
                        f"{diagnosis_curves.plain(mechanism.name)}: {p.statement or diagnosis_curves.plain(p.name)}",
                        estimate(model, full) + spaced(p.unit),
                        "estimated",
                        recordings,
                        interval(model, full),
                        "; ".join(filter(None, remark)),
                    )
                )
    for k, trial in enumerate(found.observed.trials):
        at, (low, high) = found.first_contact(k)
        rows.append(
            Known(
                f"first contact of {trial}",
                f"{_hundredths(at)} mm",
                "estimated",
                "its recording",
                f"{_hundredths(low)} to {_hundredths(high)}",
            )
        )
    noise = found.errors.noise
    rows += [
        Known("noise of a force reading", f"{noise.force_sd:.3g} N (sd)", data, noise.source),
        Known("error of the displacement", f"{noise.wander_sd:.2g} mm (sd)", data, noise.source),
    ]
    accuracy = "usual accuracy"
    if isinstance(subject, Subject):
        accuracy += ", or subject.toml"
    rows += [Known(name, moved, "prior", accuracy) for name, moved in _assumed(found)]
    if isinstance(subject, Subject):
        rows += wave_rows(subject)
        rows += [_measured(one, subject.origin) for one in subject.measured]
        rows.append(Known("girth of the section", f"{girth(subject.section):.0f} mm", data, "contours"))
    return rows


def _measured(one: MeasuredEffect, origin: Origin) -> Known:
    """Return an effect's strength that was measured by itself."""
    strength = mechanism_named(one.effect).parameters[0]
    return Known(
        f"{diagnosis_curves.plain(one.effect)}, measured by itself: {strength.statement}",
        f"{one.value:.3g} ± {one.sd:.2g}{spaced(strength.unit)} (sd)",
        origin,
        one.source,
    )


def _assumed(found: Diagnosis) -> list[tuple[str, str]]:
    """Return how far the fit moved what was assumed; modes of one outline together."""
    moved: dict[str, list[float]] = {}
    for name, z in zip(found.errors.names, found.best.posterior.effects, strict=True):
        moved.setdefault(name.partition(", mode ")[0], []).append(round(float(z), 1) + 0.0)
    return [
        (
            name if len(every) == 1 else f"{name}, {len(every)} modes",
            f"moved by {every[0]:+.1f} sd"
            if len(every) == 1
            else f"moved by {min(every):+.1f} to {max(every):+.1f} sd",
        )
        for name, every in moved.items()
    ]


def _hundredths(value: float) -> str:
    return f"{round(value, 2) + 0.0:.2f}"


PLACES_SHOWN = 12

type Cells = tuple[list[str], list[list[str]]]
"""A table's header and rows."""

OVER_ALL = "over all explanations"


def phase_cells(found: Diagnosis) -> Cells:
    """Return what the base model and the first explanation leave in each phase."""
    shown = [
        (diagnosis_curves.BASE_NAME, found.weighted_base),
        *((f"with {diagnosis_curves.model_name(m)}", m) for m in found.models[:1]),
    ]
    rows = [
        [which, check.phase, f"{check.left:.3f}", f"{check.errors:.3f}", short_probability(check.p_value)]
        for which, model in shown
        for check in checks_by_phase(model)
    ]
    return ["model", "phase", "misfit (N)", "by errors (N)", "share of tests"], rows


def occurrence_cells(found: Diagnosis) -> Cells:
    """Return how common the effects are taken to be that weigh most in C10's interval."""
    possible = found.weighted_base.problem.possible
    mechanisms = {m.name: m for e in found.explained.every for m in e.fit.mechanisms}
    rows = []
    for one in sensitivities(found.explained, DEEP_C10) if DEEP_C10 in found.base_model.fit.free else ():
        mechanism, own = mechanisms[one.mechanism], possible.get(one.mechanism)
        low, high = mechanism.parameters[0].bounds if own is None else (own.low, own.high)
        first = mechanism.parameters[0]
        rows.append(
            [
                diagnosis_curves.plain(one.mechanism),
                f"{first.name.replace('_', ' ')} {low:.3g} to {high:.3g}{spaced(first.unit)}",
                f"{mechanism.expected:g}",
                (own.source if own is not None else "") or "judgement",
                *(f"{mpa_to_kpa(a):.3g} to {mpa_to_kpa(b):.3g} kPa" for a, b in (one.rarer, one.commoner)),
            ]
        )
    how = "times as common as any other (judgement)"
    return [
        "effect",
        "strengths that are possible",
        how,
        "source of the strengths",
        "C10 if rarer",
        "C10 if commoner",
    ], rows


def places_left_out(found: Diagnosis) -> int:
    """Return how many smaller places `places_cells` leaves out."""
    return max(len(diagnosis_curves.places_of(found)) - PLACES_SHOWN, 0)


def places_cells(found: Diagnosis) -> Cells:
    """Return where the base model is wrong, by how much, against the noise; the gravest ones."""
    places = diagnosis_curves.places_of(found)
    kept = sorted(places, key=lambda place: -place.weight)[:PLACES_SHOWN]
    rows = [
        [
            place.phase,
            f"{place.displacement[0]:.1f}" + (f" to {place.displacement[1]:.1f}" if len(place.stations) > 1 else ""),
            f"{place.time[0]:.1f}" + (f" to {place.time[1]:.1f}" if len(place.stations) > 1 else ""),
            f"{-place.size:+.3f}",
            f"{place.noise:.3f}",
            "-" if place.p_value is None else short_probability(place.p_value),
            trials_of(found, place),
        ]
        for place in places
        if place in kept
    ]
    header = ["phase", "displacement (mm)", "time (s)", "size (N)", "noise (N)", "p", "trials"]
    return header, rows


def trials_of(found: Diagnosis, place: diagnosis_curves.Place) -> str:
    """Return the trials of a place, briefly."""
    observed = found.observed
    alike = observed.trials_of(place.protocol)
    if len(place.trials) == len(alike):
        if len(alike) == 1:
            return observed.trials[alike[0]]
        rate = observed.protocols[place.protocol].label.split(" to ")[0]
        return f"all {len(alike)} at {rate}"
    return ", ".join(observed.trials[k] for k in place.trials)


def evidence_cells(found: Diagnosis) -> Cells:
    """Return how probable each reported explanation is, and what it leaves."""
    base = found.weighted_base
    rows = [
        [
            diagnosis_curves.BASE_NAME,
            percent(found.explained.adequacy),
            "-",
            "-",
            f"{found.base_held_out.rmse:.3f}",
            "-",
        ],
        *(
            [
                f"with {diagnosis_curves.model_name(model)}",
                percent(model.probability),
                f"{model.posterior.log_evidence - base.posterior.log_evidence:.1f}",
                percent(explained_share(found, model)) + (" (in part)" if model.in_part else ""),
                f"{held.rmse:.3f}",
                "confirm it" if model.confirmed else "NOT confirmed",
            ]
            for model, held in zip(found.models, found.held_out, strict=True)
        ),
    ]
    header = ["explanation", "probability", "ln Bayes factor", "explained", "held-out error (N)", "full solutions"]
    return header, rows


def explanation_bars(found: Diagnosis) -> Bars:
    """Return the eight most probable things that may have been left out; nothing that shows, too."""
    bars = [
        LabelledBar(diagnosis_curves.statement_name(one), 100 * one.probability, percent(one.probability))
        for one in found.explained.statements()[:8]
    ]
    return Bars("How probable each explanation is", ("left out", "probability"), bars, greatest=100.0)


def limit_cells(found: Diagnosis) -> Cells:
    """Return how strong each mechanism may be unseen, and C10 then, what moves that most first."""
    ends = {(True, True): "on both sides", (True, False): "downwards", (False, True): "upwards"}
    rows = []
    for limit in found.limits:
        stiffness = limit.stiffness.get(DEEP_C10)
        rows.append(
            [
                diagnosis_curves.plain(limit.name),
                f"{limit.parameter.replace('_', ' ')} {limit.low:.3g} to {limit.high:.3g}{spaced(limit.unit)}",
                ends.get((limit.open_low, limit.open_high), "no"),
                "-" if stiffness is None else f"{mpa_to_kpa(stiffness[0]):.3g} to {mpa_to_kpa(stiffness[1]):.3g}",
                f"{limit.effect:.2g}",
            ]
        )
    return ["mechanism", "range (95 %)", "open", "C10 (kPa)", "force (N)"], rows


def held_out_note(held: HeldOut) -> str:
    """Return what was held out, and what error noise alone makes."""
    return (
        f"The held-out error is the error of predicting {held.how}, from a fit to the other trials. The noise of a "
        f"trial alone accounts for {held.noise:.3f} N."
    )


def estimate(model: Explanation, name: str) -> str:
    """Return a parameter's value with the digits that its error leaves."""
    shown = model.shown(name)
    return number(shown.value, (shown.ci95[1] - shown.ci95[0]) / 4)


def interval(model: Explanation, name: str) -> str:
    """Return a parameter's 95 % interval."""
    if not model.determined(name):
        return "not narrowed by this test"
    return " to ".join(between(*model.shown(name).ci95))


def averaged(found: Diagnosis, name: str) -> str:
    """Return a stiffness's 95 % interval (kPa) over all explanations; nothing where there is none."""
    if name not in found.intervals:
        return ""
    return " to ".join(between(*found.shown_interval(name)))


def flag(model: Explanation, name: str, null: float | None) -> str:
    """Return a warning on a parameter, or nothing."""
    if name in model.fit.at_bound:
        return "AT THE BOUND of its search"
    if not model.determined(name):
        return "NOT DETERMINED by these recordings"
    low, high = model.interval(name)
    if null is not None and low <= null <= high:
        return f"not distinguishable from {null:g}"
    return ""


def score_cells(found: Diagnosis) -> Cells:
    """Return the score tests of the base model, the strongest first."""
    rows = [
        [
            diagnosis_curves.plain(score.name),
            short_probability(score.p_value),
            f"{100 * score.concealed:.1f} %" + (" (nearly all)" if score.concealed > 0.95 else ""),
        ]
        for score in found.assessment.scores
    ]
    return ["mechanism", "p by itself", "share hidden by fitting the stiffness"], rows
