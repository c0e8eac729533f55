"""Figure of mechanisms' signatures against what the base model misses."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from legfem.common.units import FloatArray
from legfem.data.segmentation import HOLD
from legfem.inverse.location import Signature
from legfem.inverse.stations import Stations
from legfem.inverse.verdict import Diagnosis
from legfem.report.diagnosis_style import CONTRADICTED_COLOUR, REPAIRED_COLOUR, plain
from legfem.report.style import DATA_COLOUR, FAINT, new_figure, panel, styled, title
from legfem.report.words import probability

SHOWN = 4
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
    title(figure, "Does the misfit look like what a mechanism would leave after a refit?", subject, origin)
    grid = figure.subplots(len(names), len(protocols), sharex="col", sharey=True, squeeze=False)
    for row, name in enumerate(names):
        signature = strongest(found, name)
        scaled, share = matched(found, signature)
        score = found.assessment.score(name)
        reported = any(name in model.names for model in found.models)
        for column, stations in enumerate(protocols):
            _draw(grid[row, column], found, column, scaled, reported)
            _mark_phases(grid[row, column], stations)
            if column == 0:
                chance = probability(score.p_value) if score else "p unknown"
                panel(
                    grid[row, column],
                    "ABCDEFGH"[row],
                    f"{plain(name)}{' (reported)' if reported else ''}: {chance}"
                    + ("" if share is None else f", matches {100 * share:.0f} % of the misfit"),
                )
        grid[row, 0].set_ylabel("recorded −\nbase model (N)")
    for column, stations in enumerate(protocols):
        held = "; in the hold: seconds held" if HOLD in stations.phase else ""
        grid[-1, column].set_xlabel(f"along the test, {stations.label}\ndisplacement (mm){held}")
    handles = [
        Line2D([], [], color=FAINT, marker=".", linestyle="none", label="missed in each trial"),
        Line2D([], [], color=DATA_COLOUR, linewidth=0.9, label="its mean over the trials"),
    ]
    stiffness = found.base.fit.stiffness
    hides = f"{' and '.join(stiffness)} take{'s' if len(stiffness) == 1 else ''}"
    looks = f"less what {hides} up, scaled to the misfit"
    kinds = [
        (REPAIRED_COLOUR, f"signature of a reported mechanism, {looks}"),
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
    return [name for name in names if name in known][:SHOWN]


def strongest(found: Diagnosis, name: str) -> Signature:
    """Return the one of a mechanism's signatures that matches the misfit best."""
    mine = [s for s in found.assessment.signatures if s.mechanism.name == name]
    return max(mine, key=lambda signature: _statistic(found, signature))


def matched(found: Diagnosis, signature: Signature) -> tuple[FloatArray, float | None]:
    """Return a signature (n,) scaled to the misfit, N, and the share of the misfit it matches.

    The share is of the squares (in units of the noise) above those that noise makes; None where
    there are hardly more. With the wrong sign it is zero.
    """
    fitted, direction = found.alone.fit, signature.direction
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
    along = float(signature.direction @ found.alone.fit.left)
    return max(along, 0.0) if signature.one_sided else along


def _statistic(found: Diagnosis, signature: Signature) -> float:
    return _along(found, signature) ** 2 / float(signature.direction @ signature.direction)


def _draw(axes: Axes, found: Diagnosis, number: int, scaled: FloatArray, reported: bool) -> None:
    observed = found.observed
    trials = observed.trials_of(number)
    missed = np.array([found.alone.fit.residual[observed.trial == k] for k in trials])
    shape = np.array([scaled[observed.trial == k] for k in trials])
    x = np.arange(missed.shape[1])
    axes.axhline(0.0, color=DATA_COLOUR, linewidth=0.5)
    axes.plot(x, missed.T, ".", color=FAINT, markersize=2.5)
    axes.plot(x, missed.mean(axis=0), color=DATA_COLOUR, linewidth=0.9)
    colour = REPAIRED_COLOUR if reported else OTHER_COLOUR
    axes.plot(x, shape.T, color=colour, linewidth=1.0, alpha=0.7)
    axes.plot(x, shape.mean(axis=0), color=colour, linewidth=2.2, alpha=0.85)


def _mark_phases(axes: Axes, stations: Stations) -> None:
    """Label stations along the test by displacement, or in a hold by the time held."""
    at: list[int] = []
    labels: list[str] = []
    for segment in np.unique(stations.segment):
        here = np.flatnonzero(stations.segment == segment)
        if segment > 0:
            axes.axvline(here[0] - 0.5, color=CONTRADICTED_COLOUR, linewidth=0.8)
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
