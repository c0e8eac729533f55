"""Figures of a diagnosis: how probable each explanation is, parameters before and after, mechanisms' signatures."""

from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from legfem.common.units import FloatArray, percent
from legfem.data.phases import HOLD
from legfem.inverse.catalogue import symbol_of
from legfem.inverse.explanation import Explanation, Statement
from legfem.inverse.location import Signature
from legfem.inverse.mechanism import null_of
from legfem.inverse.stations import Stations
from legfem.inverse.verdict import ADEQUATE, Diagnosis
from legfem.report import diagnosis_curves
from legfem.report.style import DATA_COLOUR, FAINT, new_figure, panel, styled, title
from legfem.report.words import number, probability

MOST_STATEMENTS = 14
_LEAST = 1e-4


@styled
def ranking_figure(found: Diagnosis, subject: str, origin: str) -> Figure:
    """Return the probability of every statement, a bar each, with a title."""
    every = found.explained.statements()[:MOST_STATEMENTS]
    listed = {model.names: model for model in found.models}
    figure = new_figure(8.6, 1.9 + 0.27 * len(every))
    title(figure, "How probable each explanation is", subject, origin)
    axes = figure.subplots()
    for row, one in enumerate(every):
        model = listed.get(one.names) if one.names else None
        colour = _colour(one, model is not None)
        axes.barh(row, max(one.probability, _LEAST), height=0.72, color=colour)
        text = percent(one.probability) + (", in part" if model and model.in_part else "")
        axes.annotate(
            text,
            (max(one.probability, _LEAST), row),
            (4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
        )
    axes.set_yticks(range(len(every)), [diagnosis_curves.statement_name(one) for one in every])
    axes.set_ylim(len(every) - 0.4, -0.7)
    axes.set_xlim(0.0, 1.18)
    axes.set_xticks([0, 0.25, 0.5, 0.75, 1.0], ["0", "25 %", "50 %", "75 %", "100 %"])
    axes.axvline(ADEQUATE, color=DATA_COLOUR, linewidth=0.8, linestyle=":")
    axes.set_xlabel("probability (dotted: above it, 'nothing detectable' gives the verdict consistent)")
    handles = [Patch(color=colour, label=text) for colour, text in _MEANING.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


_MEANING = {
    diagnosis_curves.REPAIRED_COLOUR: "reported",
    diagnosis_curves.CONTRADICTED_COLOUR: "less probable",
    diagnosis_curves.BASE_COLOUR: "nothing detectable",
    diagnosis_curves.SUITING_COLOUR: "something that legfem doesn't know",
}


def _colour(one: Statement, reported: bool) -> str:
    if one.nothing_shows:
        return diagnosis_curves.BASE_COLOUR
    if one.unnamed:
        return diagnosis_curves.SUITING_COLOUR
    return diagnosis_curves.REPAIRED_COLOUR if reported else diagnosis_curves.CONTRADICTED_COLOUR


ROWS = 4


@dataclass(frozen=True, eq=False)
class EstimateRow:
    """A parameter's estimate in one model."""

    model: str
    explanation: Explanation
    colour: str


@styled
def parameter_figure(found: Diagnosis, subject: str, origin: str) -> Figure:
    """Return the deep tissue's parameters in every model and the mechanisms' own, with a title."""
    models = diagnosis_curves.shown_models(found)[: ROWS - 1]
    rows = [EstimateRow(diagnosis_curves.BASE_NAME, found.base, diagnosis_curves.BASE_COLOUR)]
    rows += [EstimateRow(m.name, m.model, diagnosis_curves.REPAIRED_COLOUR if m.suits else FAINT) for m in models]
    stiffness = found.base.fit.stiffness
    panels: list[tuple[str, str, list[EstimateRow], float | None]]
    panels = [(f"{symbol_of(name)} of the deep tissue (kPa)", name, rows, None) for name in stiffness]
    for mechanism in dict.fromkeys(m for row in rows for m in row.explanation.fit.mechanisms):
        for k, p in enumerate(mechanism.parameters):
            name = f"{mechanism.name}.{p.name}"
            mine = [row for row in rows if name in row.explanation.fit.free]
            unit = "" if p.unit == "-" else f" ({p.unit})"
            what = f"{diagnosis_curves.plain(mechanism.name)}: {p.name.replace('_', ' ')}{unit}"
            if mine:
                panels.append((what, name, mine, null_of(p) if k == 0 else None))
    columns = len(stiffness)
    lines = -(-len(panels) // columns)
    most = [max(len(shown) for _, _, shown, _ in panels[k : k + columns]) for k in range(0, len(panels), columns)]
    heights = [0.5 + 0.42 * count for count in most]
    figure = new_figure(max(5.4 * columns, 7.6), 1.3 + 1.15 * sum(heights))
    before = "Stiffness" if len(rows) == 1 else "Parameters before and after"
    caution = "" if found.verdict != "unexplained" else " (no model suits: don't rely on these)"
    title(figure, f"{before}, with 95 % intervals{caution}", subject, origin)
    grid = figure.subplots(lines, columns, squeeze=False, height_ratios=heights)
    for axes in grid.ravel()[len(panels) :]:
        axes.remove()
    for axes, (what, name, shown, null), letter in zip(
        grid.ravel(), panels, "ABCDEFGHIJKLMNOPQRSTUVWXYZ", strict=False
    ):
        _draw_estimates(axes, name, shown, null)
        panel(axes, letter, what)
    return figure


def _draw_estimates(axes: Axes, name: str, rows: list[EstimateRow], null: float | None) -> None:
    ends = [] if null is None else [null]
    for k, row in enumerate(rows):
        value = row.explanation.shown(name).value
        ends.append(value)
        seen = diagnosis_curves.determined(row.explanation, name)
        if seen:
            low, high = row.explanation.shown(name).ci95
            axes.plot([low, high], [k, k], color=row.colour, linewidth=2.2, solid_capstyle="butt")
            ends += [low, high]
        axes.plot(value, k, "o", color=row.colour, markersize=6, fillstyle="full" if seen else "none")
        ends_of = row.explanation.shown(name).ci95
        text = number(value, (ends_of[1] - ends_of[0]) / 4 if seen else np.nan)
        if name in row.explanation.fit.at_bound:
            text += ", at the bound of the search"
        elif not seen:
            text += ", not determined by the data"
        axes.annotate(
            text,
            (value, k),
            (0, 7),
            textcoords="offset points",
            ha="center",
            fontsize=9,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
        )
    if null is not None:
        axes.axvline(null, color=DATA_COLOUR, linewidth=0.8, linestyle=":")
    if len(rows) > 1 and not rows[0].explanation.fit.mechanisms:
        axes.axvline(rows[0].explanation.value(name), color=diagnosis_curves.BASE_COLOUR, linewidth=0.8, linestyle=":")
    span = max(ends) - min(ends) or abs(max(ends)) or 1.0
    axes.set_xlim(min(ends) - 0.25 * span, max(ends) + 0.25 * span)
    several = len(rows) > 1 or not rows[0].explanation.fit.mechanisms
    names = [row.model.replace(" + ", "\n+ ").replace(" (", "\n(") for row in rows]
    axes.set_yticks(range(len(rows)) if several else [], names if several else [])
    axes.set_ylim(len(rows) - 0.45, -0.8)


MOST_SIGNATURES = 4
OTHER_COLOUR = "#CC79A7"


@styled
def signature_figure(found: Diagnosis, subject: str, origin: str) -> Figure:
    """Return the misfit with the signatures of the leading mechanisms scaled to it.

    Parameters
    ----------
    found
        A diagnosis with a mismatch.
    subject
        Its title.
    origin
        Of the data.
    """
    names = leading(found)
    protocols = found.observed.protocols
    figure = new_figure(max(7.6, 5.6 * len(protocols)), 1.2 + 2.1 * len(names))
    title(
        figure,
        "Does the difference look like what a mechanism would leave after fitting the stiffness?",
        subject,
        origin,
    )
    grid = figure.subplots(len(names), len(protocols), sharex="col", sharey=True, squeeze=False)
    for row, name in enumerate(names):
        signature = strongest(found, name)
        scaled, share = matched(found, signature)
        score = found.assessment.score(name)
        reported = any(name in model.names for model in found.models)
        for column, stations in enumerate(protocols):
            _draw_signature(grid[row, column], found, column, scaled, reported)
            _mark_phases(grid[row, column], stations)
            if column == 0:
                chance = probability(score.p_value) if score else "p unknown"
                panel(
                    grid[row, column],
                    "ABCDEFGH"[row],
                    f"{diagnosis_curves.plain(name)}{' (reported)' if reported else ''}: {chance}"
                    + ("" if share is None else f", matches {100 * share:.0f} % of the misfit"),
                )
        grid[row, 0].set_ylabel("base model −\nrecorded (N)")
    for column, stations in enumerate(protocols):
        held = "; in the hold: seconds held" if HOLD in stations.phase else ""
        grid[-1, column].set_xlabel(f"along the test, {stations.label}\ndisplacement (mm){held}")
    handles = [
        Line2D([], [], color=FAINT, marker=".", linestyle="none", label="difference of each trial"),
        Line2D([], [], color=DATA_COLOUR, linewidth=0.9, label="its mean over the trials"),
    ]
    stiffness = found.base.fit.stiffness
    hides = f"{' and '.join(map(symbol_of, stiffness))} take{'s' if len(stiffness) == 1 else ''}"
    looks = f"less what {hides} up, scaled to the misfit"
    kinds = [
        (diagnosis_curves.REPAIRED_COLOUR, f"signature of a reported mechanism, {looks}"),
        (OTHER_COLOUR, f"signature of a mechanism that is not reported, {looks}"),
    ]
    some = [any(n in m.names for m in found.models) for n in names]
    used = [kind for kind, there in zip(kinds, (any(some), not all(some)), strict=True) if there]
    handles += [Line2D([], [], color=colour, linewidth=2.2, label=text) for colour, text in used]
    figure.legend(handles=handles, loc="outside lower center", ncols=1 if len(protocols) < 2 else 2)
    return figure


def leading(found: Diagnosis) -> list[str]:
    """Return the mechanisms that are shown: those reported, then those with the strongest sign."""
    reported = [name for model in found.models for name in model.names]
    strongest_first = [score.name for score in sorted(found.assessment.scores, key=lambda s: -s.statistic)]
    known = {signature.mechanism.name for signature in found.assessment.signatures}
    names = dict.fromkeys([*reported, *strongest_first])
    return [name for name in names if name in known][:MOST_SIGNATURES]


def strongest(found: Diagnosis, name: str) -> Signature:
    """Return the one of a mechanism's signatures that matches the misfit best."""
    mine = [s for s in found.assessment.signatures if s.mechanism.name == name]
    return max(mine, key=lambda signature: _statistic(found, signature))


def matched(found: Diagnosis, signature: Signature) -> tuple[FloatArray, float | None]:
    """Return a signature (n,) scaled to the misfit, N, and the share of the misfit it matches.

    The share is of the squares (in units of the noise) above those that noise makes; None where
    there are hardly more. With the wrong sign it is zero.
    """
    fitted, direction = found.weighted_base.fit, signature.direction
    along = _along(found, signature)
    square = float(direction @ direction)
    shown = direction[: len(fitted.whitened)]
    scaled = np.asarray(found.errors.lower @ shown) * along / square
    dof = len(fitted.whitened)
    beyond = fitted.cost - dof
    if beyond < 2 * np.sqrt(2 * dof):
        return scaled, None
    return scaled, min(1.0, _statistic(found, signature) / beyond)


def _along(found: Diagnosis, signature: Signature) -> float:
    along = float(signature.direction @ found.weighted_base.fit.augmented_residual)
    return max(along, 0.0) if signature.one_sided else along


def _statistic(found: Diagnosis, signature: Signature) -> float:
    return _along(found, signature) ** 2 / float(signature.direction @ signature.direction)


def _draw_signature(axes: Axes, found: Diagnosis, number: int, scaled: FloatArray, reported: bool) -> None:
    observed = found.observed
    trials = observed.trials_of(number)
    missed = np.array([-observed.forces_of(k, found.weighted_base.fit.residual) for k in trials])
    shape = np.array([-observed.forces_of(k, scaled) for k in trials])
    x = np.arange(missed.shape[1])
    axes.axhline(0.0, color=DATA_COLOUR, linewidth=0.5)
    axes.plot(x, missed.T, ".", color=FAINT, markersize=2.5)
    axes.plot(x, missed.mean(axis=0), color=DATA_COLOUR, linewidth=0.9)
    colour = diagnosis_curves.REPAIRED_COLOUR if reported else OTHER_COLOUR
    axes.plot(x, shape.T, color=colour, linewidth=1.0, alpha=0.7)
    axes.plot(x, shape.mean(axis=0), color=colour, linewidth=2.2, alpha=0.85)


def _mark_phases(axes: Axes, stations: Stations) -> None:
    """Label stations along the test by displacement, or in a hold by the time held."""
    at: list[int] = []
    labels: list[str] = []
    for segment in np.unique(stations.segment):
        here = np.flatnonzero(stations.segment == segment)
        if segment > 0:
            axes.axvline(here[0] - 0.5, color=diagnosis_curves.CONTRADICTED_COLOUR, linewidth=0.8)
        if stations.phase[here[0]] == HOLD:
            middle = int(here[len(here) // 2])
            since = stations.time[middle] - stations.protocol.time[segment]
            at.append(middle)
            labels.append(f"{since:.2g} s")
            continue
        for part in (0.0, 0.25, 0.5, 0.75, 1.0) if segment == 0 else (0.0, 0.25, 0.5, 0.75):
            away = np.abs(stations.displacement[here] - part * stations.depth)
            k = int(here[np.argmin(away)])
            at.append(k)
            labels.append(f"{stations.displacement[k]:.2g}")
    axes.set_xticks(at, labels, fontsize=8)
