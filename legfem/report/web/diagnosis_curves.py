"""The curves of a diagnosis: recordings and model over displacement and over time."""

from __future__ import annotations

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.verdict import Diagnosis
from legfem.report.diagnosis_style import BASE_COLOUR, BASE_NAME, REPAIRED_COLOUR, shown_models
from legfem.report.located import places_of
from legfem.report.style import DATA_COLOUR, FAINT, LAW_NAMES
from legfem.report.web.curves import Curves, Line

_MANY_TRIALS = 8
"""Above which trials share a colour's line in the legend no more: only their mean is drawn."""


def curves_of(found: Diagnosis, number: int) -> list[Curves]:
    """Return force over displacement and, where there is more than a loading, over time."""
    stations = found.observed.protocols[number]
    blocks = [_over(found, number, stations.displacement, "displacement (mm)", 0)]
    if len(np.unique(stations.segment)) > 1:
        blocks.append(_over(found, number, stations.time, "time (s)", 1))
    return blocks


def _over(found: Diagnosis, number: int, x: FloatArray, label: str, axis: int) -> Curves:
    observed = found.observed
    trials = observed.trials_of(number)

    def rows(values: FloatArray) -> FloatArray:
        return np.array([values[observed.trial == k] for k in trials])

    recorded, base = rows(observed.force), rows(found.base.fit.residual)
    lines = [
        Line("recorded" + (", mean" if len(trials) > 1 else ""), recorded.mean(axis=0), None, DATA_COLOUR, points=True)
    ]
    if 1 < len(trials) <= _MANY_TRIALS:
        lines += [
            Line(observed.trials[k], force, missed, FAINT, "dotted", faint=True, tabled=False)
            for k, force, missed in zip(trials, recorded, base, strict=True)
        ]
    prediction = rows(found.base.fit.prediction).mean(axis=0)
    lines.append(Line(BASE_NAME, prediction, base.mean(axis=0), BASE_COLOUR, "dashed"))
    for shown in shown_models(found)[:1]:
        fit = shown.model.fit
        name = f"with {shown.name}" if shown.suits else shown.name
        lines.append(Line(name, rows(fit.prediction).mean(axis=0), rows(fit.residual).mean(axis=0), REPAIRED_COLOUR))
    places = [place for place in places_of(found) if place.protocol == number]
    sd = np.sqrt(np.mean(rows(found.errors.trial_sd) ** 2, axis=0))
    stations = observed.protocols[number]
    return Curves(
        f"recording{number}-{axis}",
        f"Force over {label.split(' ')[0]}, {stations.label}: recorded, and of the "
        f"{LAW_NAMES[found.law]} model; beneath, recorded less model: of single trials less the "
        f"{BASE_NAME}.",
        x,
        label,
        "force (N)",
        "recorded − model (N)",
        lines,
        2 * sd,
        "± 2 sd of a trial's noise",
        [place.time if axis else place.displacement for place in places],
        "where the base model is wrong" if places else "",
    )
