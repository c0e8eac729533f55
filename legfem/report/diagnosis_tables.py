"""Tables of a diagnosis' page."""

from __future__ import annotations

from legfem.inverse.cross_validation import HeldOut
from legfem.inverse.explanation import Explanation
from legfem.inverse.verdict import Diagnosis, explained_share
from legfem.report.diagnosis_sentences import percent
from legfem.report.diagnosis_style import BASE_NAME, determined, model_name, plain, statement_name
from legfem.report.located import Place, places_of
from legfem.report.words import number, short_probability

PLACES_SHOWN = 12

type Cells = tuple[list[str], list[list[str]]]
"""A table's header and rows."""

OVER_ALL = "over all explanations"


def places_left_out(found: Diagnosis) -> int:
    """Return how many smaller places `places_cells` leaves out."""
    return max(len(places_of(found)) - PLACES_SHOWN, 0)


def places_cells(found: Diagnosis) -> Cells:
    """Return where the base model is wrong, by how much, against the noise; the gravest ones."""
    places = places_of(found)
    kept = sorted(places, key=lambda place: -place.weight)[:PLACES_SHOWN]
    rows = [
        [
            place.phase,
            f"{place.displacement[0]:.1f}" + (f" to {place.displacement[1]:.1f}" if len(place.stations) > 1 else ""),
            f"{place.time[0]:.1f}" + (f" to {place.time[1]:.1f}" if len(place.stations) > 1 else ""),
            f"{place.size:+.3f}",
            f"{place.noise:.3f}",
            "-" if place.p_value is None else short_probability(place.p_value),
            trials_of(found, place),
        ]
        for place in places
        if place in kept
    ]
    header = ["phase", "mm", "s", "size (N)", "noise (N)", "p", "trials"]
    return header, rows


def trials_of(found: Diagnosis, place: Place) -> str:
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
    base = found.alone
    rows = [
        [BASE_NAME, percent(found.explained.soundness), "-", "-", f"{found.base_held_out.rmse:.3f}", "-"],
        *(
            [
                f"with {model_name(model)}",
                percent(model.probability),
                f"{model.posterior.log_evidence - base.posterior.log_evidence:.1f}",
                percent(explained_share(found, model)) + (" (in part)" if model.in_part else ""),
                f"{held.rmse:.3f}",
                "confirm it" if model.confirmed else "NOT confirmed",
            ]
            for model, held in zip(found.models, found.held_out, strict=True)
        ),
    ]
    header = ["explanation", "probability", "ln Bayes factor", "of the misfit", "held-out (N)", "full solutions"]
    return header, rows


def explanation_cells(found: Diagnosis, most: int = 8) -> Cells:
    """Return what may have been left out, the most probable first; nothing that shows, too."""
    rows = [[statement_name(one), percent(one.probability)] for one in found.explained.statements()[:most]]
    return ["left out", "probability"], rows


def limit_cells(found: Diagnosis) -> Cells:
    """Return how strong each mechanism may be unseen."""
    rows = []
    for limit in found.limits:
        unit = "" if limit.unit == "-" else f" {limit.unit}"
        rows.append(
            [
                plain(limit.name),
                f"{limit.parameter.replace('_', ' ')} {limit.low:.3g} to {limit.high:.3g}{unit}",
                f"{limit.effect:.2g}",
            ]
        )
    return ["mechanism", "between (95 %)", "changes the force by at most (N)"], rows


def held_out_note(held: HeldOut) -> str:
    """Return what was held out, and what error noise alone makes."""
    return (
        f"Held-out error: of predicting {held.how}, from a refit to the others. The noise of a "
        f"trial alone makes {held.noise:.3f} N."
    )


def relative_change(before: float, after: float) -> str:
    """Return a change in per cent; where there was nothing before, that."""
    return f"{100 * (after / before - 1):+.0f} %" if before > 1e-6 else "from 0"


def estimate(model: Explanation, name: str) -> str:
    """Return a parameter's value with the digits that its error leaves."""
    low, high = model.interval(name)
    return number(model.value(name), (high - low) / 4)


def interval(model: Explanation, name: str) -> str:
    """Return a parameter's 95 % interval."""
    if not determined(model, name):
        return "as known beforehand"
    low, high = model.interval(name)
    return f"{number(low, (high - low) / 4)} to {number(high, (high - low) / 4)}"


def averaged(found: Diagnosis, name: str) -> str:
    """Return a parameter's 95 % interval over all explanations; nothing where there is none."""
    if name not in found.intervals:
        return ""
    low, high = found.intervals[name]
    return f"{number(low, (high - low) / 4)} to {number(high, (high - low) / 4)}"


def flag(model: Explanation, name: str, null: float | None) -> str:
    """Return a warning on a parameter, or nothing."""
    if name in model.fit.at_bound:
        return "AT THE BOUND of its search"
    if not determined(model, name):
        return "NOT SEEN by these recordings"
    low, high = model.interval(name)
    if null is not None and low <= null <= high:
        return f"can't be told from {null:g}"
    return ""


def score_cells(found: Diagnosis) -> Cells:
    """Return the score tests of the base model, the strongest first."""
    rows = [
        [
            plain(score.name),
            short_probability(score.p_value),
            f"{100 * score.concealed:.1f} %" + (" (nearly all)" if score.concealed > 0.95 else ""),
        ]
        for score in found.assessment.scores
    ]
    return ["mechanism", "p by itself", "share that a refit hides"], rows
