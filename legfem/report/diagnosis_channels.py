"""What channels beside the force say in a diagnosis: sentences, a table, and curves as the force's."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.linearised import LinearisedFit
from legfem.inverse.verdict import Diagnosis
from legfem.report import page as web
from legfem.report.diagnosis_curves import BASE_COLOUR, BASE_NAME, REPAIRED_COLOUR, shown_models
from legfem.report.page import Curves, Line
from legfem.report.style import DATA_COLOUR

_LEAST = 1.0
"""A misfit is stated where it is more than this share of a reading's error."""


@dataclass(frozen=True)
class ChannelMisfit:
    """How well a channel is met, all in its unit."""

    name: str
    unit: str
    readings: int
    rms_before: float
    """Of the base model's residual."""
    rms_after: float | None
    """Of that of the first model that is shown beside it."""
    error: float
    """Standard deviation of one reading within its trial, in the mean."""


def channel_misfits(found: Diagnosis) -> list[ChannelMisfit]:
    """Return how well every channel is met, the force first."""
    models = shown_models(found)[:1]
    return [
        ChannelMisfit(
            channel.name,
            channel.unit,
            len(channel),
            _rms(found.base.fit, span),
            _rms(models[0].model.fit, span) if models else None,
            float(np.sqrt(np.mean(found.errors.trial_sd[span] ** 2))),
        )
        for channel, span in zip(found.observed.data.channels, found.observed.data.spans, strict=True)
    ]


def _rms(fitted: LinearisedFit, span: slice) -> float:
    return float(np.sqrt(np.mean(fitted.residual[span] ** 2)))


def channel_sentences(found: Diagnosis) -> Iterator[str]:
    """Yield where a channel departs from the base model, beyond what isn't known of the leg and the instruments."""
    base = found.weighted_base
    left = base.fit.residual - found.errors.known @ base.posterior.effects
    words = {one.name: one.kind for one in found.observed.channels}
    for window in found.assessment.windows:
        if window.channel not in words:
            continue
        size = float(left[list(window.stations)].mean())
        error = float(np.mean(found.errors.trial_sd[list(window.stations)]))
        if abs(size) < _LEAST * error / np.sqrt(len(window.stations)):
            continue
        kind, (low, high) = words[window.channel], window.displacement
        at = f"at {low:.0f} mm" if high - low < 1.0 else f"from {low:.0f} to {high:.0f} mm"
        phase = "" if window.phase == "loading" else f" in {window.phase}"
        yield (
            f"The {kind.words} is {abs(size):.2g} {kind.unit} {'more' if size > 0 else 'less'} than the model's "
            f"{at}{phase} (p = {window.p_value:.2g} over all intervals)."
        )


def channel_chapter(found: Diagnosis) -> list[web.Chapter]:
    """Return the chapter on channels beside the force; none where nothing else was recorded."""
    observed = found.observed
    if not observed.channels:
        return []
    rows = [
        [
            one.name.replace("_", " "),
            f"{one.readings}",
            f"{one.rms_before:.3f} {one.unit}",
            "-" if one.rms_after is None else f"{one.rms_after:.3f} {one.unit}",
            f"{one.error:.3f} {one.unit}",
        ]
        for one in channel_misfits(found)
    ]
    models = shown_models(found)[:1]
    after = f"left by {models[0].name}" if models else "left by a repaired model"
    said = list(channel_sentences(found))
    blocks: list[web.Block] = [
        web.Bullets(said) if said else web.Prose("No interval of these channels stands out from their errors."),
        web.WebTable(
            "How well every channel is met (root mean square)",
            ["channel", "readings", f"left by the {BASE_NAME}", after, "error of a reading"],
            rows,
        ),
    ]
    protocols = range(len(observed.protocols))
    return [web.Chapter("Beside the force", [*blocks, *(c for k in protocols for c in channel_curves(found, k))])]


def channel_curves(found: Diagnosis, protocol: int) -> list[Curves]:
    """Return every channel of a protocol's trials over displacement, in the order of time."""
    observed, models = found.observed, shown_models(found)[:1]
    drawn = []
    for one, span in zip(observed.channels, observed.data.spans[1:], strict=True):
        mine = np.flatnonzero(observed.protocol[one.nearest] == protocol)
        if not len(mine):
            continue
        x = (one.weights @ observed.displacement)[mine]
        order = np.lexsort((x, observed.segment[one.nearest[mine]]))
        at, x = span.start + mine[order], x[order]
        lines = [
            Line("recorded", one.values[mine[order]], None, DATA_COLOUR, points=True),
            _line(BASE_NAME, found.base.fit, at, BASE_COLOUR),
            *(_line(shown.name, shown.model.fit, at, REPAIRED_COLOUR) for shown in models),
        ]
        windows = [w for w in found.assessment.windows if w.channel == one.name and set(w.stations) & set(at.tolist())]
        name, unit = one.name.replace("_", " "), one.kind.unit
        drawn.append(
            Curves(
                f"channel{protocol}-{one.name}",
                f"{one.kind.words.capitalize()}, {observed.protocols[protocol].label}: recorded in all trials, and of "
                "the models; beneath, model less recorded.",
                x,
                "displacement (mm)",
                f"{name} ({unit})",
                f"model − recorded ({unit})",
                lines,
                2 * found.errors.trial_sd[at],
                "± 2 sd of a reading",
                [w.displacement for w in windows],
                "where the base model is wrong" if windows else "",
            )
        )
    return drawn


def _line(name: str, fitted: LinearisedFit, at: FloatArray, colour: str) -> Line:
    return Line(name, fitted.prediction[at], -fitted.residual[at], colour, "dashed" if name == BASE_NAME else "solid")
