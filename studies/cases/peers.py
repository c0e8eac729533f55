"""``python -m studies.cases peers``: what others would do with recordings whose truth is known, beside a diagnosis."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import pandas as pd
import typer

from legfem.common.command_line import study_context
from legfem.common.documents import Contents, markdown_table
from legfem.common.numbers import number
from legfem.common.progress import Silent, progress_on
from legfem.common.units import mpa_to_kpa
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.correction import read_correction
from legfem.jobs.store import Store
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.loading import load_subject
from legfem.legs.subject import Subject
from studies.cases.outcomes import Interval, Rate
from studies.cases.peers_discrepancy import by_discrepancy
from studies.cases.peers_fitted import Answer, by_other_code, by_own_code
from studies.cases.peers_neural import by_network, learning
from studies.cases.peers_selected import by_bic, by_lasso
from studies.command_line import DONE_IS_KEPT, Library, Out, write_results
from studies.counting import counted

OUTSIDE = "unknown"
"""What a diagnosis says of something outside its library, and what then is right."""


def by_diagnosis(leg: Subject, folder: Path) -> Answer:
    """Diagnose as `legfem diagnose` does."""
    diagnoser = Diagnoser(folder, read_correction(REFERENCE))
    found, work = counted(lambda: diagnoser.diagnose(leg, Silent()))
    c10 = Interval(mpa_to_kpa(found.best.value(DEEP_C10)), *found.shown_interval(DEEP_C10))
    first = list(found.models[0].names) if found.models else []
    return Answer(c10, work.counts["solves"], [OUTSIDE] if found.verdict == "unexplained" else first)


PEERS: Mapping[str, tuple[str, Callable[[Subject, Path], Answer]]] = {
    "legfem's diagnosis": ("legfem.legs.diagnosis", by_diagnosis),
    "least squares, felupe": ("studies.cases.peers_fitted", by_other_code),
    "least squares, legfem's curve": ("studies.cases.peers_fitted", by_own_code),
    "Kennedy-O'Hagan": ("studies.cases.peers_discrepancy", by_discrepancy),
    "BIC": ("studies.cases.peers_selected", by_bic),
    "LASSO": ("studies.cases.peers_selected", by_lasso),
    "neural posterior": ("studies.cases.peers_neural", by_network),
}
"""With the module on which answers depend; those that select recall what the diagnosis kept in a folder."""
NAMING = ("legfem's diagnosis", "BIC", "LASSO", "neural posterior")
"""The others name no cause."""
NUMBERS = ("C10 off (%)", "half-width (%)", "processor (s)", "solves")
COLUMNS = ("case", "truth", "C10 (kPa)", "by", "held", "named", "right", *NUMBERS)


def rows_of(case: int, folder: Path, out: Path, library: Path) -> Iterator[dict[str, Any]]:
    """Yield what each says of the recordings in a folder, beside which lies ``truth.json``; by force alone."""
    leg = load_subject(folder)
    leg = replace(leg, recordings=tuple(replace(one, channels=()) for one in leg.recordings))
    true = json.loads((folder.parent / "truth.json").read_text())["cases"][folder.name]
    effects = [OUTSIDE if name.startswith("outside") else name for name in true["effects"] if name != "none"]
    c10, a_solve = true["true_C10_kPa"], 0.0
    for peer, (module, answer) in PEERS.items():

        def timed(answer: Callable[[Subject, Path], Answer] = answer) -> Answer:
            begun = time.process_time()
            found = answer(leg, library / f"{folder.parent.name}-{folder.name}")
            return replace(found, seconds=time.process_time() - begun)

        found = Store(out / "kept", Answer, peer, [module]).get_or_make(Contents(folder), timed)
        a_solve = a_solve or found.seconds / found.solves
        names = peer in NAMING
        # What selects recalls the diagnosis' solves, and alone would have to make them.
        recalled = a_solve * found.solves if names and peer != NAMING[0] else 0.0
        numbers = 100 * (found.c10.value / c10 - 1), 50 * found.c10.width / c10, found.seconds + recalled, found.solves
        named = (", ".join(found.named) or "nothing") if names else "-"
        said = found.c10.covers(c10), named, names and found.named == effects
        row = case, ", ".join(effects) or "nothing", c10, peer, *said, *numbers
        yield dict(zip(COLUMNS, row, strict=True))


def page(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the summary by peer, and all cases."""
    frame, lines = pd.DataFrame(rows), []
    for by, own in frame.groupby("by", sort=False):
        held, right = (str(Rate(int(own[name].sum()), len(own))) for name in ("held", "right"))
        sizes = own[list(NUMBERS)].abs()
        middle = [number(one) for one in sizes.median()]
        lines.append([str(by), held, right if by in NAMING else "-", f"{sizes[NUMBERS[0]].max():.0f}", *middle])
    head = ("", "interval holds C10", "first named is what is there", "most that C10 is off (%)", *NUMBERS)
    told = frame.drop(columns="right").assign(held=frame["held"].map({True: "yes", False: "no"}))
    cells = told.map(lambda one: f"{one:.3g}" if isinstance(one, float) else str(one)).to_numpy().tolist()
    return f"{markdown_table(head, lines)}\nMedians of sizes.\n\n{markdown_table(list(told), cells)}"


def peers(
    folders: Annotated[list[Path], typer.Argument(help="Cases' folders, with truth.json beside them.")],
    library: Library = None,
    out: Out = None,
) -> None:
    """Fit recordings of other codes as others would, beside a diagnosis: by force alone, in one process.

    Example: python -m studies.cases peers ../shared/foreign/case-*
    """
    with study_context("peers", out, 1, DONE_IS_KEPT) as (folder, _), progress_on() as progress:
        learning("sbi")
        progress.stage("cases", len(folders))
        rows: list[dict[str, Any]] = []
        for case, one in enumerate(folders, 1):
            rows += rows_of(case, one.resolve(), folder, library or folder / "library")
            progress.advance(one.name)
            write_results(folder, {"cases": rows}, page(rows))
