"""Figures that rank: refits by Schwarz' criterion, or score tests where nothing was refitted."""

from __future__ import annotations

from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import StrMethodFormatter

from legfem.diagnose.choose import ADEQUATE, BIC_MARGIN, MISMATCH
from legfem.diagnose.diagnosis import Diagnosis
from legfem.report.diagnosis_style import (
    BASE_COLOUR,
    BASE_NAME,
    CONTRADICTED_COLOUR,
    REPAIRED_COLOUR,
    SUITING_COLOUR,
    model_name,
    plain,
)
from legfem.report.style import DATA_COLOUR, FAINT, new_figure, styled, title

PAIRS_SHOWN = 8


@dataclass(frozen=True)
class Entry:
    """A refit in the ranking."""

    name: str
    above_best: float
    """Criterion above the best one's."""
    reported: bool
    adequate: bool
    """Whether errors alone explain the sum of squares that it leaves."""

    @property
    def colour(self) -> str:
        """Of its bar."""
        if self.name == BASE_NAME:
            return BASE_COLOUR
        if self.reported:
            return REPAIRED_COLOUR
        return SUITING_COLOUR if self.adequate else CONTRADICTED_COLOUR


def ranking(found: Diagnosis) -> list[Entry]:
    """Return all single refits, the best pairs and the base model, the best first."""
    confirmed = {model.fit.names: model.fit for model in found.models}
    refits = sorted((confirmed.get(f.names, f) for f in found.tried), key=lambda f: f.bic)
    pairs = [f for f in refits if len(f.names) > 1 and f.names not in confirmed][:PAIRS_SHOWN]
    kept = [f for f in refits if len(f.names) == 1 or f.names in confirmed or f in pairs]
    entries = sorted([*kept, found.base.fit], key=lambda f: f.bic)
    best = entries[0].bic
    return [
        Entry(model_name(f), f.bic - best, f.names in confirmed, f.lack_of_fit >= ADEQUATE)
        for f in entries
    ]


@styled
def ranking_figure(found: Diagnosis, subject: str, origin: str) -> Figure:
    """Return the refits' criterion above the best one's, a bar each.

    Parameters
    ----------
    found
        A diagnosis with a mismatch.
    subject
        Its title.
    origin
        Of the data.
    """
    entries = ranking(found)
    figure = new_figure(8.6, 1.9 + 0.27 * len(entries))
    title(figure, "Which additions to the model do the recordings ask for?", subject, origin)
    axes = figure.subplots()
    rows = range(len(entries))
    reported = [row for row in rows if entries[row].reported]
    axes.barh(
        rows, [entry.above_best for entry in entries], height=0.72,
        color=[entry.colour for entry in entries],
    )  # fmt: skip
    axes.plot(0, 0, "D", color=entries[0].colour, markersize=7, clip_on=False, zorder=3)
    axes.set_xscale("symlog", linthresh=10)
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_yticks(rows, [entry.name for entry in entries])
    axes.set_ylim(len(entries) - 0.4, -0.7)
    top = max(entry.above_best for entry in entries)
    axes.set_xlim(0, max(30.0, 6.0 * top))
    for row, entry in enumerate(entries):
        first = "best" if reported else "closest, not a finding"
        digits = ",.0f" if entry.above_best > 100 else ".3g"
        text = f"+{entry.above_best:{digits}}" if row else first
        axes.annotate(
            text, (entry.above_best, row), (4 if row else 9, 0), textcoords="offset points",
            va="center", fontsize=8, bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
        )  # fmt: skip
    axes.axvline(BIC_MARGIN, color=DATA_COLOUR, linewidth=0.8, linestyle=":")
    axes.set_xlabel(
        f"BIC above the best; lower is better\n(dotted: {BIC_MARGIN:g}, the least that tells "
        "models apart)"
    )
    _bracket(axes, reported)
    figure.legend(handles=_handles(entries), loc="outside lower center", ncols=2)
    return figure


def _bracket(axes: Axes, rows: list[int]) -> None:
    """Join the rows that the data can't tell apart."""
    if len(rows) < 2:
        return
    x = 0.62
    where = axes.get_yaxis_transform()
    axes.plot([x, x], [rows[0], rows[-1]], color=DATA_COLOUR, linewidth=1.2, transform=where)
    for row in rows:
        axes.plot([x - 0.02, x], [row, row], color=DATA_COLOUR, linewidth=1.2, transform=where)
    axes.text(
        x + 0.015, (rows[0] + rows[-1]) / 2, "not told apart by these recordings",
        transform=where, va="center", fontsize=9,
    )  # fmt: skip


def _handles(entries: list[Entry]) -> list[Patch]:
    meaning = {
        REPAIRED_COLOUR: "reported: what it leaves is noise, by every test",
        SUITING_COLOUR: "its sum of squares is like noise, but others are better",
        CONTRADICTED_COLOUR: "the recordings contradict it",
        BASE_COLOUR: "base model, nothing added",
    }
    if not any(entry.reported for entry in entries):
        meaning[SUITING_COLOUR] = "sum of squares like noise, but its course is not"
    used = {entry.colour for entry in entries}
    return [Patch(color=c, label=text) for c, text in meaning.items() if c in used]


@styled
def score_figure(found: Diagnosis, subject: str, origin: str) -> Figure:
    """Return the score tests' p-values, a bar each: none calls for a mechanism.

    Parameters
    ----------
    found
        A diagnosis without mismatch.
    subject
        Its title.
    origin
        Of the data.
    """
    scores = found.base.assessment.scores
    figure = new_figure(8.0, 1.9 + 0.27 * len(scores))
    title(figure, "No mechanism's sign stands out of the noise", subject, origin)
    axes = figure.subplots()
    rows = range(len(scores))
    needed = MISMATCH / len(scores)
    axes.barh(
        rows, [1 - s.p_value for s in scores], left=[s.p_value for s in scores], height=0.72,
        color=CONTRADICTED_COLOUR,
    )  # fmt: skip
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_xlim(1.0, min(0.3 * needed, 0.3 * min(s.p_value for s in scores)))
    axes.set_yticks(rows, [plain(s.name) for s in scores])
    axes.set_ylim(len(scores) - 0.4, -0.7)
    for row, score in enumerate(scores):
        axes.annotate(
            f"{score.p_value:.2g}", (score.p_value, row), (4, 0), textcoords="offset points",
            va="center", fontsize=8, color=DATA_COLOUR,
        )  # fmt: skip
    axes.axvline(needed, color=FAINT, linestyle="--", linewidth=1.0)
    axes.annotate(
        f"needed among\n{len(scores)} tests", (needed, len(scores) - 0.6), (4, 0),
        textcoords="offset points", va="bottom", fontsize=8,
    )  # fmt: skip
    axes.set_xlabel("p-value of each score test by itself (stronger signs to the right)")
    return figure
