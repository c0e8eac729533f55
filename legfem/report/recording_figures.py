"""Figures of recordings: against base and repaired model with the residual beneath, and specimens' beside theirs."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from legfem.common.units import FloatArray
from legfem.data.segmentation import HOLD, LOADING
from legfem.inverse.fit import Fit
from legfem.inverse.linearised import LinearisedFit
from legfem.inverse.stations import Stations
from legfem.inverse.verdict import Diagnosis
from legfem.report.diagnosis_curves import (
    BASE_COLOUR,
    BASE_NAME,
    LOCATED_COLOUR,
    REPAIRED_COLOUR,
    Place,
    ShownModel,
    places_of,
    shown_models,
)
from legfem.report.style import DATA_COLOUR, FAINT, LAW_NAMES, new_figure, panel, styled, title
from legfem.specimens.details import SpecimenDetails, compared

_NAMED = 6
_COLOURS = "viridis"


@styled
def specimen_figure(results: Sequence[Fit[SpecimenDetails]]) -> Figure:
    """Return force over displacement, over time where a recording holds, and the differences.

    Parameters
    ----------
    results
        One a law, of one folder; a column each.
    """
    first = results[0]
    rows = 3 if any(one.course.holds for one in compared(first)) else 2
    figure = new_figure(5.4 * len(results) + 0.6, 3.2 * rows)
    title(
        figure,
        f"Measured and simulated {compared(first)[0].axes.load}",
        first.details.folder.title,
        first.details.folder.origin,
    )
    grid = figure.subplots(rows, len(results), squeeze=False, sharey="row")
    for column, result in enumerate(results):
        axes = grid[:, column]
        panel(axes[0], "ABCDEFGH"[column], LAW_NAMES[result.law])
        _over_displacement(axes[0], result, names=column == 0)
        if rows == 3:
            _over_time(axes[1], result)
        _differences(axes[-1], result)
    shown = compared(first)[0].axes
    for row in grid[:-1]:
        row[0].set_ylabel(f"{shown.load} ({shown.load_unit})")
    grid[-1, 0].set_ylabel(f"simulated − measured\n(% of the greatest {shown.load})")
    return figure


def _colours(result: Fit[SpecimenDetails]) -> np.ndarray:
    shades = matplotlib.colormaps[_COLOURS](np.linspace(0.0, 0.85, len(compared(result))))
    return np.asarray(shades)


def _over_displacement(axes: Axes, result: Fit[SpecimenDetails], names: bool) -> None:
    for one, colour in zip(compared(result), _colours(result), strict=True):
        loading = one.course.time <= one.course.arrival
        d, loads = one.axes.ways * one.course.displacement[loading], one.axes.loads
        dots = "o" if one.fitted else "x"
        label = f"{one.name}{'' if one.fitted else ' (left out)'}: $R^2$ {one.r_squared:.3f}"
        axes.plot(d, loads * one.course.force[loading], dots, color=colour, markersize=3, fillstyle="none", label=label)
        line = "-" if one.fitted else "--"
        axes.plot(np.append(0.0, d), np.append(0.0, loads * one.predicted[loading]), line, color=colour)
    shown = compared(result)[0].axes
    plain = "displacement after first contact, loading (mm)"
    axes.set_xlabel(plain if shown.way == "displacement" else f"{shown.way}, loading ({shown.way_unit})")
    if len(compared(result)) <= _NAMED:
        axes.legend(loc="upper left", fontsize=8)
    elif names:
        axes.text(
            0.02, 0.95, f"{len(compared(result))} recordings; x, dashed: left out", transform=axes.transAxes, va="top"
        )


def _over_time(axes: Axes, result: Fit[SpecimenDetails]) -> None:
    for one, colour in zip(compared(result), _colours(result), strict=True):
        dots, line = ("o", "-") if one.fitted else ("x", "--")
        time = one.course.time
        axes.plot(time, one.axes.loads * one.course.force, dots, color=colour, markersize=3, fillstyle="none")
        axes.plot(time, one.axes.loads * one.predicted, line, color=colour)
    axes.set_xscale("log")
    axes.set_xlabel("time after first contact (s)")


def _differences(axes: Axes, result: Fit[SpecimenDetails]) -> None:
    axes.axhline(0.0, color=FAINT, linewidth=0.6)
    for one, colour in zip(compared(result), _colours(result), strict=True):
        share = 100 * (one.predicted - one.course.force) / one.course.peak
        line = "-" if one.fitted else "--"
        axes.plot(one.course.time / one.course.arrival, share, line, color=colour)
    if any(one.course.holds for one in compared(result)):
        axes.set_xscale("log")
    timed = all(one.course.samples.timed for one in compared(result))
    axes.set_xlabel(f"{'time' if timed else 'way'} over the loading's")


_MARKERS = {LOADING: "o", HOLD: "s", "unloading": "v"}
_RESIDUAL_WIDTHS = {LOADING: 1.6, HOLD: 1.0, "unloading": 1.2}


@styled
def recording_figure(found: Diagnosis, number: int, subject: str, origin: str) -> Figure:
    """Return force of all trials of one protocol with the models, and what they miss.

    Parameters
    ----------
    found
        The diagnosis.
    number
        Of the protocol.
    subject
        Its title.
    origin
        Of the data.
    """
    stations = found.observed.protocols[number]
    models = shown_models(found)[:1]
    places = [place for place in places_of(found) if place.protocol == number]
    segments = [int(s) for s in np.unique(stations.segment)]
    several = len(segments) > 1
    apart = _on_own_scale(found, number, models)
    figure = new_figure(11.0 if several else 7.6, 10.4 if apart else 8.2)
    title(figure, f"Recording and model: {stations.label}", subject, origin)
    above, below = figure.subfigures(2, 1, height_ratios=(1.25, 1.8 if apart else 1.0))
    force = above.subplots(1, 2 if several else 1, squeeze=False, sharey=True)[0]
    _draw_force(force[0], found, number, models, stations.displacement)
    panel(force[0], "A", "force over displacement")
    force[0].set_xlabel("displacement after first contact (mm)")
    force[0].set_ylabel("force (N)")
    if several:
        _draw_force(force[1], found, number, models, stations.time)
        panel(force[1], "B", "force over time")
        force[1].set_xlabel("time after first contact (s)")
    above.legend(
        handles=_handles(found, number, models, bool(places)), loc="outside lower center", ncols=4 if several else 2
    )
    widths = [_RESIDUAL_WIDTHS[str(stations.phase[stations.segment == s][0])] for s in segments]
    fits = [(found.base.fit, BASE_COLOUR, "-")]
    fits += [(shown.model.fit, REPAIRED_COLOUR, "--") for shown in models]
    rows = [fits, fits[1:]] if apart else [fits]
    grid = below.subplots(len(rows), len(segments), squeeze=False, sharey="row", sharex="col", width_ratios=widths)
    letters = iter("CDEFGHIJKLMNOP" if several else "BC")
    for line, drawn in zip(grid, rows, strict=True):
        for axes, segment in zip(line, segments, strict=True):
            _draw_residual(axes, found, number, segment, drawn, places)
            phase = str(stations.phase[stations.segment == segment][0])
            whose = "of the repaired model " if drawn is not fits else ""
            panel(axes, next(letters), f"difference {whose if axes is line[0] else ''}in {phase}")
        line[0].set_ylabel("model − recorded (N)")
    for axes, segment in zip(grid[-1], segments, strict=True):
        held = stations.phase[stations.segment == segment][0] == HOLD
        axes.set_xlabel("time held (s), logarithmic" if held else "displacement (mm)")
    return figure


def _on_own_scale(found: Diagnosis, number: int, models: Sequence[ShownModel]) -> bool:
    """Return whether the base model misses so much that what another misses can't be seen."""
    if not models:
        return False
    missed = [np.abs(_rows(found, number, f.residual)).max() for f in (found.base.fit, models[0].model.fit)]
    return bool(missed[0] > 5 * missed[1])


def _rows(found: Diagnosis, number: int, values: FloatArray) -> FloatArray:
    """Return values at a protocol's stations, a row a trial."""
    observed = found.observed
    return np.array([observed.forces_of(k, values) for k in observed.trials_of(number)])


def _draw_force(axes: Axes, found: Diagnosis, number: int, models: Sequence[ShownModel], x: FloatArray) -> None:
    stations = found.observed.protocols[number]
    recorded = _rows(found, number, found.observed.force)
    located = _rows(found, number, found.located.astype(float)).max(axis=0) > 0
    mean = recorded.mean(axis=0)
    base = _rows(found, number, found.base.fit.prediction).mean(axis=0)
    for segment in np.unique(stations.segment):
        here = stations.segment == segment
        marked = np.where(located[here], mean[here], np.nan)
        axes.plot(x[here], marked, color=LOCATED_COLOUR, linewidth=11, alpha=0.75, zorder=1, solid_capstyle="round")
        axes.plot(
            x[here],
            recorded[:, here].T,
            _MARKERS[str(stations.phase[here][0])],
            color=DATA_COLOUR,
            markersize=3.4,
            fillstyle="none",
            markeredgewidth=0.6,
            zorder=2,
        )
    axes.plot(x, base, color=BASE_COLOUR, linewidth=1.4, zorder=3)
    for model in models:
        mine = _rows(found, number, model.model.fit.prediction).mean(axis=0)
        axes.plot(x, mine, color=REPAIRED_COLOUR, linewidth=1.4, linestyle="--", zorder=4)
    axes.set_ylim(bottom=min(0.0, float(recorded.min())))
    axes.set_xlim(left=0)


def _draw_residual(
    axes: Axes,
    found: Diagnosis,
    number: int,
    segment: int,
    fits: Sequence[tuple[LinearisedFit, str, str]],
    places: Sequence[Place],
) -> None:
    stations = found.observed.protocols[number]
    here = stations.segment == segment
    x = _abscissa(stations, segment)
    sd = np.sqrt(np.mean(_rows(found, number, found.errors.trial_sd)[:, here] ** 2, axis=0))
    axes.fill_between(x, -2 * sd, 2 * sd, color=FAINT, alpha=0.3, linewidth=0)
    axes.axhline(0.0, color=DATA_COLOUR, linewidth=0.6)
    inner = np.concatenate([[x[0]], (x[1:] + x[:-1]) / 2, [x[-1]]])
    for place in places:
        if place.segment != segment:
            continue
        first = int(place.stations[0] - np.flatnonzero(here)[0])
        last = first + len(place.stations)
        axes.axvspan(inner[first], inner[last], color=LOCATED_COLOUR, alpha=0.4, linewidth=0)
    for fitted, colour, line in fits:
        residual = -_rows(found, number, fitted.residual)[:, here]
        axes.plot(x, residual.T, ".", color=colour, markersize=2.6, alpha=0.6)
        axes.plot(x, residual.mean(axis=0), line, color=colour, linewidth=1.6)
    if stations.phase[here][0] == HOLD:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
    elif stations.phase[here][0] == "unloading":
        axes.set_xlim(1.03 * float(x.max()), min(0.0, float(x.min())))


def _abscissa(stations: Stations, segment: int) -> FloatArray:
    """Return displacements, or in a hold the times since its start."""
    here = stations.segment == segment
    if stations.phase[here][0] == HOLD:
        return np.asarray(stations.time[here] - stations.protocol.time[segment])
    return np.asarray(stations.displacement[here])


def _handles(found: Diagnosis, number: int, models: Sequence[ShownModel], located: bool) -> list[Line2D | Patch]:
    stations = found.observed.protocols[number]
    count = len(found.observed.trials_of(number))
    trials = f"{count} trial{'s' * (count > 1)}"
    handles: list[Line2D | Patch] = [
        Line2D(
            [],
            [],
            color=DATA_COLOUR,
            marker=_MARKERS[phase],
            linestyle="none",
            markersize=4,
            fillstyle="none",
            label=f"recorded, {phase} ({trials})",
        )
        for phase in dict.fromkeys(str(p) for p in stations.phase)
    ]
    handles.append(Line2D([], [], color=BASE_COLOUR, label=BASE_NAME))
    handles += [
        Line2D([], [], color=REPAIRED_COLOUR, linestyle="--", label=f"with {model.name}" if model.suits else model.name)
        for model in models
    ]
    handles.append(Patch(color=FAINT, alpha=0.3, label="± 2 sd of a trial's noise"))
    if located:
        handles.append(Patch(color=LOCATED_COLOUR, alpha=0.6, label="where the base model is wrong"))
    return handles
