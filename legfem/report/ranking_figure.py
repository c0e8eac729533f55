"""Figure of how probable it is that something was left out."""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.patches import Patch

from legfem.inverse.explanation import Statement
from legfem.inverse.verdict import SOUND, Diagnosis
from legfem.report.diagnosis_sentences import percent
from legfem.report.diagnosis_style import (
    BASE_COLOUR,
    CONTRADICTED_COLOUR,
    REPAIRED_COLOUR,
    SUITING_COLOUR,
    statement_name,
)
from legfem.report.style import DATA_COLOUR, new_figure, styled, title

SHOWN = 14
_LEAST = 1e-4


@styled
def ranking_figure(found: Diagnosis, subject: str, origin: str) -> Figure:
    """Return the probability of every statement, a bar each, with a title."""
    every = found.explained.statements()[:SHOWN]
    listed = {model.names: model for model in found.models}
    figure = new_figure(8.6, 1.9 + 0.27 * len(every))
    title(figure, "What was left out, and how probably", subject, origin)
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
    axes.set_yticks(range(len(every)), [statement_name(one) for one in every])
    axes.set_ylim(len(every) - 0.4, -0.7)
    axes.set_xlim(0.0, 1.18)
    axes.set_xticks([0, 0.25, 0.5, 0.75, 1.0], ["0", "25 %", "50 %", "75 %", "100 %"])
    axes.axvline(SOUND, color=DATA_COLOUR, linewidth=0.8, linestyle=":")
    axes.set_xlabel("probability (dotted: from there on 'nothing that shows' is called consistent)")
    handles = [Patch(color=colour, label=text) for colour, text in _MEANING.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=2)
    return figure


_MEANING = {
    REPAIRED_COLOUR: "reported",
    CONTRADICTED_COLOUR: "less probable",
    BASE_COLOUR: "nothing that shows",
    SUITING_COLOUR: "something that legfem doesn't know",
}


def _colour(one: Statement, reported: bool) -> str:
    if one.nothing_shows:
        return BASE_COLOUR
    if one.unknown:
        return SUITING_COLOUR
    return REPAIRED_COLOUR if reported else CONTRADICTED_COLOUR
