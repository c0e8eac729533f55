"""Tables of a diagnosis' page."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from legfem.common.numbers import between, number, percent, short_probability
from legfem.common.units import mpa_to_kpa, spaced_unit
from legfem.geometry.section import girth
from legfem.inverse.averaging import sensitivities
from legfem.inverse.catalogue import DEEP_C10, symbol_of
from legfem.inverse.explanation import Explanation, Statement
from legfem.inverse.mechanism import null_of
from legfem.inverse.predictive import checks_by_phase
from legfem.inverse.verdict import Diagnosis, explained_share
from legfem.legs.subject import Subject
from legfem.mechanisms import mechanism_named
from legfem.report.diagnosis_curves import BASE_NAME, UNKNOWN, Place, model_name, plain, relative_change, shown_models
from legfem.report.diagnosis_document import Recorded
from legfem.report.estimates import wave_rows
from legfem.report.page import Bars, Block, Known, LabelledBar, Prose, Provenance, WebTable
from legfem.report.words import TOLD, moduli_text

_WRONG = "DO NOT RELY ON IT: the model does not fit, and the interval does not include what was left out"


def known_of(found: Diagnosis, subject: Recorded) -> Iterator[Known]:
    """Yield the stiffness with each model, the mechanisms' parameters, and what was assumed."""
    trials, base, leg = len(found.observed.trials), found.base_model, isinstance(subject, Subject)
    recordings = f"{trials} recording{'s' * (trials > 1)}"
    data: Provenance = subject.origin

    def fitted(model: Explanation, name: str, words: str, unit: str, *remarks: str) -> Known:
        value, remark = estimate(model, name) + unit, "; ".join(filter(None, remarks))
        return Known(words, value, "estimated", recordings, interval(model, name), remark)

    wrong = _WRONG if found.withheld else ""
    for name in base.fit.stiffness:
        symbol, (low, high) = symbol_of(name), base.shown(name).ci95
        moduli = moduli_text(base.shown(name).value, (high - low) / 4) if name == DEEP_C10 else ""
        yield fitted(base, name, f"{symbol}, {BASE_NAME}", " kPa", wrong, flag(base, name, 0.0), moduli)
        for shown in shown_models(found):
            words = f"{symbol}, {f'with {shown.name}' if shown.suits else shown.name}"
            change = relative_change(base.value(name), shown.model.value(name))
            yield fitted(shown.model, name, words, " kPa", wrong, flag(shown.model, name, 0.0), change)
        if name in found.intervals:
            over_all = " to ".join(between(*found.shown_interval(name)))
            yield Known(f"{symbol}, over all explanations", "", "estimated", recordings, over_all, wrong)
    for model in found.models:
        for mechanism in model.fit.mechanisms:
            for k, p in enumerate(mechanism.parameters):
                full, words = f"{mechanism.name}.{p.name}", f"{plain(mechanism.name)}: {p.statement or plain(p.name)}"
                like_none = flag(model, full, null_of(p) if k == 0 else None)
                yield fitted(model, full, words, spaced_unit(p.unit), like_none, f"model with {model_name(model)}")
    for k, trial in enumerate(found.observed.trials):
        at, ends = found.first_contact(k)
        contact, first, last = (f"{round(value, 2) + 0.0:.2f}" for value in (at, *ends))
        name = f"first contact of {trial}"
        yield Known(name, f"{contact} mm", "estimated", "its recording", f"{first} to {last}")
    noise = found.errors.noise
    yield Known("noise of a force reading", f"{noise.force_sd:.3g} N (sd)", data, noise.source)
    yield Known("error of the displacement", f"{noise.wander_sd:.2g} mm (sd)", data, noise.source)
    # Modes of one outline together.
    moved: dict[str, list[float]] = {}
    for name, z in zip(found.errors.names, found.best.posterior.effects, strict=True):
        moved.setdefault(name.partition(", mode ")[0], []).append(round(float(z), 1) + 0.0)
    accuracy = "usual accuracy, or subject.toml" if leg else "usual accuracy"
    for name, every in moved.items():
        by = f"{every[0]:+.1f}" if len(every) == 1 else f"{min(every):+.1f} to {max(every):+.1f}"
        words = name if len(every) == 1 else f"{name}, {len(every)} modes"
        yield Known(words, f"moved by {by} sd", "prior", accuracy)
    if isinstance(subject, Subject):
        yield from wave_rows(subject)
        for one in subject.measured:
            strength = mechanism_named(one.effect, subject.section).parameters[0]
            name, unit = f"{plain(one.effect)}, measured by itself: {strength.statement}", spaced_unit(strength.unit)
            yield Known(name, f"{one.value:.3g} ± {one.sd:.2g}{unit} (sd)", data, one.source)
        yield Known("girth of the section", f"{girth(subject.section):.0f} mm", data, "contours")


PLACES_SHOWN = 12


def phase_table(found: Diagnosis) -> WebTable:
    """Return what the base model and the first explanation leave in each phase."""
    shown = [(BASE_NAME, found.weighted_base), *((f"with {model_name(m)}", m) for m in found.models[:1])]
    rows = [
        {
            "model": which,
            "phase": check.phase,
            "misfit (N)": f"{check.left:.3f}",
            "by errors (N)": f"{check.errors:.3f}",
            "share of tests": short_probability(check.p_value),
        }
        for which, model in shown
        for check in checks_by_phase(model)
    ]
    return WebTable.of("Misfit of the models in each phase", rows, folded=True)


def occurrence_table(found: Diagnosis) -> WebTable | None:
    """Return how common the effects are taken to be that weigh most in C10's interval; None where none weighs."""
    possible = found.weighted_base.problem.possible
    mechanisms = {m.name: m for e in found.explained.every for m in e.fit.mechanisms}
    rows = []
    for one in sensitivities(found.explained, DEEP_C10) if DEEP_C10 in found.base_model.fit.free else ():
        mechanism, stated = mechanisms[one.mechanism], possible.get(one.mechanism)
        first = mechanism.parameters[0]
        low, high = first.bounds if stated is None else (stated.low, stated.high)
        rarer, commoner = (" to ".join(between(*map(mpa_to_kpa, ends))) for ends in (one.rarer, one.commoner))
        rows.append(
            {
                "effect": plain(one.mechanism),
                "strengths that are possible": f"{first.name.replace('_', ' ')} {low:.3g} to {high:.3g}"
                f"{spaced_unit(first.unit)}",
                "times as common as any other (judgement)": f"{mechanism.expected:g}",
                "source of the strengths": (stated.source if stated is not None else "") or "judgement",
                "C10 if rarer (kPa)": rarer,
                "C10 if commoner (kPa)": commoner,
            }
        )
    caption = "How common effects are assumed to be, and C10's range"
    return WebTable.of(caption, rows, folded=True) if rows else None


def places_table(places: Sequence[Place], found: Diagnosis) -> WebTable:
    """Return where the base model is wrong, by how much, against the noise; the gravest ones."""
    observed, kept = found.observed, sorted(places, key=lambda place: -place.weight)[:PLACES_SHOWN]
    rows = []
    for place in places:
        if place in kept:
            displacement, time = ([f"{end:.1f}" for end in ends] for ends in (place.displacement, place.time))
            ends = None if len(place.stations) > 1 else 1
            trials = ", ".join(observed.trials[k] for k in place.trials)
            alike = observed.trials_of(place.protocol)
            if len(place.trials) == len(alike) > 1:
                rate = observed.protocols[place.protocol].protocol.segments[0].rate
                trials = f"all {len(alike)} at {rate:.2g} mm/s"
            rows.append(
                {
                    "phase": place.phase,
                    "displacement (mm)": " to ".join(displacement[:ends]),
                    "time (s)": " to ".join(time[:ends]),
                    "size (N)": f"{-place.size:+.3f}",
                    "noise (N)": f"{place.noise:.3f}",
                    "p": "-" if place.p_value is None else short_probability(place.p_value),
                    "trials": trials,
                }
            )
    return WebTable.of("Intervals in which the model is wrong", rows)


def evidence_table(found: Diagnosis) -> WebTable:
    """Return how probable each reported explanation is, and what it leaves."""
    base = found.weighted_base
    rows = [(BASE_NAME, found.explained.adequacy, "-", "-", found.base_held_out, "-")]
    missing = 1 - found.explained.adequacy
    for model, held in zip(found.models, found.held_out, strict=True):
        gain = f"{model.posterior.log_evidence - base.posterior.log_evidence:.1f}"
        explained = percent(explained_share(found, model)) + (" (in part)" if model.in_part else "")
        confirmed = "confirm it" if model.confirmed else "NOT confirmed"
        rows.append((f"with {model_name(model)}", missing * model.probability, gain, explained, held, confirmed))
    header = ["explanation", "probability", "ln Bayes factor", "explained", "held-out error (N)", "full solutions"]
    cells = [[name, percent(p), gain, part, f"{held.rmse:.3f}", whole] for name, p, gain, part, held, whole in rows]
    return WebTable("What the reported explanations explain", header, cells)


def statement_name(one: Statement) -> str:
    """Return what a statement says, in short."""
    if one.unnamed:
        like = " + ".join(plain(name) for name in one.like)
        return f"{UNKNOWN}, like {like}" if like else UNKNOWN
    return " + ".join(plain(name) for name in one.names) or "nothing detectable"


def explanation_bars(found: Diagnosis) -> Bars:
    """Return the eight most probable things that may have been left out; nothing that shows, too."""
    bars = [
        LabelledBar(statement_name(one), 100 * one.probability, percent(one.probability))
        for one in found.explained.statements()[:8]
    ]
    return Bars("How probable each explanation is", ("left out", "probability"), bars, greatest=100.0)


def limit_table(found: Diagnosis) -> WebTable:
    """Return how strong each mechanism may be unseen, and C10 then, what moves that most first."""
    ends = {(True, True): "on both sides", (True, False): "downwards", (False, True): "upwards"}
    rows = []
    for limit in (replace(one, parameter=one.parameter.replace("_", " ")) for one in found.limits):
        stiffness = map(mpa_to_kpa, limit.stiffness.get(DEEP_C10, ()))
        rows.append(
            [
                plain(limit.name),
                f"{limit.parameter} {' to '.join(map(number, (limit.low, limit.high)))}{spaced_unit(limit.unit)}",
                ends.get((limit.open_low, limit.open_high), "no"),
                " to ".join(map(number, stiffness)) or "-",
                number(limit.effect),
            ]
        )
    caption = "How strong each mechanism may be without being detected, however rare that is"
    return WebTable(caption, ["mechanism", "range (95 %)", "open", "C10 (kPa)", "force (N)"], rows, folded=True)


def estimate(model: Explanation, name: str) -> str:
    """Return a parameter's value with the digits that its error leaves."""
    shown = model.shown(name)
    return number(shown.value, (shown.ci95[1] - shown.ci95[0]) / 4)


def interval(model: Explanation, name: str) -> str:
    """Return a parameter's 95 % interval."""
    if not model.determined(name):
        return "not narrowed by this test"
    return " to ".join(between(*model.shown(name).ci95))


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


def score_blocks(found: Diagnosis) -> list[Block]:
    """Return the score tests of the base model, the strongest first."""
    if not found.assessment.scores:
        why = "there was no time" if found.provisional else "these recordings cannot show any of the mechanisms"
        return [Prose(f"Nothing was tested: {why}.")]
    rows = [
        {
            "mechanism": plain(score.name),
            "p by itself": short_probability(score.p_value),
            "share hidden by fitting the stiffness": f"{100 * score.concealed:.1f} %"
            + (" (nearly all)" if score.concealed > 0.95 else ""),
        }
        for score in found.assessment.scores
    ]
    caption = "Tests for each mechanism in the difference between model and recordings"
    return [Prose(TOLD["by_itself"]), WebTable.of(caption, rows)]
