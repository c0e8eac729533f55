"""A picture of how often C10's interval holds, and what is there is said first, by what was concealed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from pydantic import TypeAdapter

from legfem.common.documents import write_document
from legfem.report.style import panel, styled
from studies.cases.outcomes import Rate
from studies.cases.sealed import Said
from studies.cases.sealed_draw import SUBSETS

COUNTED = Path(__file__).parent / "sealed-1511.json"
"""What `docs/static/coverage.svg` shows: the sealed cases of seed 1511."""
_KINDS = {"none": "nothing", "single": "one effect", "pair": "two effects", "outside": "outside\nthe library"}
_COLOURS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#999999", "#000000", "#F0E442")


@dataclass(frozen=True)
class Counted:
    """Diagnoses of one kind of cases by one set of channels."""

    kind: str
    channels: str
    held: Rate
    """C10's interval holds the truth."""
    first: Rate
    """What is there is said first, of what has a name; of nothing, that nothing shows."""


def counted(said: Sequence[Said]) -> list[Counted]:
    """Return the counts by kind and channels."""
    found = []
    for kind in _KINDS:
        for channels in SUBSETS:
            mine = [one for one in said if (one.kind, one.subset) == (kind, channels)]
            named = [one.right for one in mine if one.truth or kind == "none"]
            if mine:
                held = Rate(sum(one.holds for one in mine), len(mine))
                found.append(Counted(kind, channels, held, Rate(sum(named), len(named))))
    return found


def write_counted(folder: Path, every: Sequence[Counted]) -> None:
    """Write the counts and their picture."""
    write_document(folder / "counted.json", {"schema": 1, "origin": "simulated", "counted": [asdict(c) for c in every]})
    draw(folder / "coverage.svg", every)


def read_counted(path: Path) -> list[Counted]:
    """Return counts that were written."""
    return TypeAdapter(list[Counted]).validate_python(json.loads(path.read_text(encoding="utf-8"))["counted"])


@styled
def draw(path: Path, every: Sequence[Counted]) -> None:
    """Write the picture: shares with their 95 % intervals (Clopper and Pearson)."""
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    names = [name for name in SUBSETS if any(one.channels == name for one in every)]
    for axes, which in ((left, "held"), (right, "first")):
        for k, (name, colour) in enumerate(zip(names, _COLOURS, strict=False)):
            rates = {one.kind: getattr(one, which) for one in every if one.channels == name}
            for place, rate in ((tuple(_KINDS).index(kind), rate) for kind, rate in rates.items() if rate.total):
                low, high = rate.interval
                at = place + 0.22 * (k - 0.5 * (len(names) - 1))
                off = [[rate.share - low], [high - rate.share]]
                axes.errorbar(at, rate.share, off, fmt="o", color=colour, capsize=2, label=name if not place else None)
                axes.annotate(f"{rate.count}/{rate.total}", (at, -0.19), ha="center", rotation=90, fontsize=7)
        axes.set(xticks=range(len(_KINDS)), xticklabels=_KINDS.values(), ylim=(-0.2, 1.03), yticks=np.linspace(0, 1, 6))
    left.axhline(0.95, color="0.7", lw=1)
    panel(left, "a", "C10's interval holds the truth")
    panel(right, "b", "what is there is said first")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(names), frameon=False)
    figure.suptitle("Sealed cases: simulated data", x=0.01, ha="left", fontsize=11)
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "legfem"}):
        figure.savefig(path, metadata={"Date": None})
