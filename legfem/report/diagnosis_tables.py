"""Tables of a diagnosis' page."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from legfem.diagnose.choose import HeldOut
from legfem.diagnose.diagnosis import Diagnosis, Repaired
from legfem.diagnose.fit import Fit
from legfem.report.diagnosis_style import BASE_NAME, determined, model_name, plain, shown_models
from legfem.report.located import Place, places_of
from legfem.report.words import number, short_probability

PLACES_SHOWN = 12


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return columns as wide as they need; the last one isn't padded."""
    cells = [list(header), *(list(row) for row in rows)]
    widths = [max(len(row[k]) for row in cells) for k in range(len(header))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    )


def places_table(found: Diagnosis) -> str:
    """Return where the base model is wrong, by how much, against the noise."""
    places = places_of(found)
    kept = sorted(places, key=lambda place: -place.weight)[:PLACES_SHOWN]
    rows = [
        [
            place.phase,
            f"{place.displacement[0]:.1f}"
            + (f" to {place.displacement[1]:.1f}" if len(place.stations) > 1 else ""),
            f"{place.time[0]:.1f}"
            + (f" to {place.time[1]:.1f}" if len(place.stations) > 1 else ""),
            f"{place.size:+.3f}",
            f"{place.noise:.3f}",
            "-" if place.p_value is None else short_probability(place.p_value),
            trials_of(found, place),
        ]
        for place in places
        if place in kept
    ]
    header = ["phase", "mm", "s", "size (N)", "noise (N)", "p", "trials"]
    text = table(header, rows)
    if len(places) > len(kept):
        text += f"\n... and {len(places) - len(kept)} smaller ones (all are in diagnosis.json)"
    return text


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


def evidence_table(found: Diagnosis) -> str:
    """Return how much better each reported model is, and what it leaves."""
    rows = [
        [
            BASE_NAME, "-",
            short_probability(found.base.assessment.p_value),
            f"{found.base_held_out.rmse:.3f}", "-",
        ],
        *(_evidence(found, model) for model in found.models),
    ]  # fmt: skip
    header = ["model", "BIC better by", "p of what is left", "held-out (N)", "full solutions"]
    return table(header, rows)


def _evidence(found: Diagnosis, model: Repaired) -> list[str]:
    return [
        f"with {model_name(model.fit)}",
        f"{found.base.fit.bic - model.fit.bic:.0f}",
        short_probability(model.candidate.assessment.p_value),
        f"{model.held_out.rmse:.3f}",
        "confirm it" if model.confirmed else "NOT confirmed",
    ]


def held_out_note(held: HeldOut) -> str:
    """Return what was held out, and what error noise alone makes."""
    return (
        f"Held-out error: of predicting {held.how}, from a refit to the others. The noise of a "
        f"trial alone makes {held.noise:.3f} N."
    )


def mechanism_table(fitted: Fit) -> str:
    """Return a model's mechanisms' parameters."""
    rows = []
    for mechanism in fitted.mechanisms:
        for k, p in enumerate(mechanism.parameters):
            name = f"{mechanism.name}.{p.name}"
            unit = "" if p.unit == "-" else f" {p.unit}"
            mark = flag(fitted, name, p.null if k == 0 else None)
            rows.append(
                [
                    plain(mechanism.name) if k == 0 else "",
                    f"{p.name.replace('_', ' ')} ({p.meaning})",
                    estimate(fitted, name) + unit,
                    interval(fitted, name),
                ]
            )
            if mark:
                rows.append(["", f"  {mark}", "", ""])
    return table(["mechanism", "parameter", "value", "95 % interval"], rows)


def parameter_table(found: Diagnosis) -> str:
    """Return the deep tissue's parameters in the base model and in those beside it."""
    base, models = found.base.fit, shown_models(found)
    rows = []
    for name in (name for name in ("C10", "C20") if name in base.free):
        rows.append([f"{name} (kPa)", BASE_NAME, *_cells(base, name), ""])
        if mark := flag(base, name, 0.0):
            rows.append(["", f"  {mark}", "", "", ""])
        for model in models:
            title = f"with {model.name}" if model.suits else model.name
            change = relative_change(base.values[name], model.fit.values[name])
            rows.append(["", title, *_cells(model.fit, name), change])
            if mark := flag(model.fit, name, 0.0):
                rows.append(["", f"  {mark}", "", "", ""])
    header = ["", "model", "value", "95 % interval", "change" if models else ""]
    return table(header, rows)


def _cells(fitted: Fit, name: str) -> list[str]:
    return [estimate(fitted, name), interval(fitted, name)]


def relative_change(before: float, after: float) -> str:
    """Return a change in per cent; where there was nothing before, that."""
    return f"{100 * (after / before - 1):+.0f} %" if before > 1e-6 else "from 0"


def estimate(fitted: Fit, name: str) -> str:
    """Return a parameter's value with the digits that its error leaves."""
    return number(fitted.values[name], fitted.sd(name) if name in fitted.free else np.nan)


def interval(fitted: Fit, name: str) -> str:
    """Return a parameter's 95 % interval."""
    if name not in fitted.free:
        return "not fitted"
    if not determined(fitted, name):
        return "unknown"
    low, high = fitted.interval(name)
    sd = fitted.sd(name)
    return f"{number(low, sd)} to {number(high, sd)}"


def flag(fitted: Fit, name: str, null: float | None) -> str:
    """Return a warning on a parameter, or nothing."""
    if name in fitted.at_bound:
        return "AT THE BOUND of its search"
    if name not in fitted.free:
        return ""
    if not determined(fitted, name):
        return "NOT SEEN by these recordings"
    low, high = fitted.interval(name)
    if null is not None and low <= null <= high:
        return f"can't be told from {null:g}"
    return ""


def score_table(found: Diagnosis) -> str:
    """Return the score tests of the base model, the strongest first."""
    rows = [
        [
            plain(score.name),
            short_probability(score.p_value),
            f"{100 * score.concealed:.1f} %" + (" (nearly all)" if score.concealed > 0.95 else ""),
        ]
        for score in found.base.assessment.scores
    ]
    return table(["mechanism", "p by itself", "share that a refit hides"], rows)
