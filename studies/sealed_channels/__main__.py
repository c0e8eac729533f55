"""``python -m studies.sealed_channels``."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
import typer

from legfem.common.command_line import study_context
from legfem.common.progress import Progress, Silent, progress_on
from legfem.data import Recording, segment_all
from legfem.inverse.library import Library as LegLibrary
from legfem.inverse.observations import observe
from legfem.inverse.verdict import Diagnosis
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store
from legfem.legs.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE, choose_correction
from legfem.legs.diagnosis import Diagnoser, accuracy_of, diagnose_body, ruled_out_of, with_correction
from legfem.legs.mechanisms import mechanisms
from legfem.legs.subject import Subject
from legfem.legs.variants import library_folder
from studies.command_line import DONE_IS_KEPT, Jobs, Library, Out, new_app, write_results
from studies.concealed.cases import SealedCase, sealed_leg
from studies.lab.outcomes import Rate
from studies.lab.recording import INSTRUMENT
from studies.sealed_channels.cases import SUBSETS, channel_cases, made, truths_of


@dataclass(frozen=True)
class Said:
    """What one diagnosis said of a case."""

    case: int
    kind: str
    subset: str
    truth: list[str]
    verdict: str
    first: list[str]
    """Mechanisms of the first explanation."""
    listed: list[list[str]]
    probability: float
    """Of the first statement."""
    c10: tuple[float, float]
    """Interval, kPa."""
    true_c10: float
    seconds: float

    @property
    def right(self) -> bool:
        """Whether the first thing said is the truth: nothing, the effects, or something unknown."""
        if self.kind == "none":
            return self.verdict == "consistent"
        if not self.truth:
            return self.verdict == "unexplained"
        return self.verdict in ("named", "ambiguous") and set(self.first) == set(self.truth)

    @property
    def in_list(self) -> bool:
        """Whether the truth is among what is listed."""
        return self.right or any(set(names) == set(self.truth) for names in self.listed)

    @property
    def holds(self) -> bool:
        """Whether C10's interval holds the truth."""
        return self.c10[0] <= self.true_c10 <= self.c10[1]

    @property
    def half_width(self) -> float:
        """Of C10's interval, over the truth."""
        return 0.5 * (self.c10[1] - self.c10[0]) / self.true_c10


def say(found: Diagnosis, case: SealedCase, subset: str, seconds: float) -> Said:
    """Return what a diagnosis says, beside the truth."""
    first = found.explained.statements()[0]
    names = [list(model.names) for model in found.models]
    low, high = found.intervals["C10"]
    return Said(
        case.number,
        case.kind,
        subset,
        list(truths_of(case)),
        found.verdict,
        names[0] if names else [],
        names,
        first.probability,
        (low, high),
        case.true_c10_kpa,
        seconds,
    )


@dataclass(eq=False)
class Lab:
    """Diagnoses cases of one leg, by a library of its responses."""

    diagnoser: Diagnoser
    stated: Subject
    library: LegLibrary

    def diagnose(self, recordings: Sequence[Recording], names: Sequence[str], progress: Progress) -> Diagnosis:
        """Diagnose recordings with some of their channels, by the library alone."""
        kept = [replace(r, channels=tuple(c for c in r.channels if c.name in names)) for r in recordings]
        observed, library = observe(segment_all(kept, INSTRUMENT, False)), self.library
        ends = choose_correction("auto", self.stated)
        return diagnose_body(
            observed.with_channels(library.beside.names),
            INSTRUMENT,
            self.stated.tissues["deep"].law,
            library,
            None,
            progress,
            accuracy_of(self.stated),
            ends,
            0,
            ruled_out_of(self.stated, ends),
            with_correction(mechanisms(), self.diagnoser.correction),
        )


def table(said: Sequence[Said]) -> str:
    """Return what is right by channels and by case, in Markdown."""
    lines = [
        "| channels | named first | listed | pairs first | outside unknown | false alarms | C10 held "
        "| half-width, median | said with 0.8 or more and right |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for subset in SUBSETS:
        mine = [one for one in said if one.subset == subset]
        by_kind = {kind: [one for one in mine if one.kind == kind] for kind in ("none", "single", "pair", "outside")}
        named = [*by_kind["single"], *(one for one in by_kind["outside"] if one.truth)]
        unknown = [one for one in by_kind["outside"] if not one.truth]
        sure = [one for one in mine if one.probability >= 0.8]
        cells = [
            subset,
            _rate([one.right for one in named]),
            _rate([one.in_list for one in named]),
            _rate([one.right for one in by_kind["pair"]]),
            _rate([one.right for one in unknown]),
            _rate([not one.right for one in by_kind["none"]]),
            _rate([one.holds for one in mine]),
            f"{100 * float(np.median([one.half_width for one in mine])):.0f} %" if mine else "",
            _rate([one.right for one in sure]),
        ]
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", "| case | truth | " + " | ".join(SUBSETS) + " |", "|---|---|" + "---|" * len(SUBSETS)]
    for number in sorted({one.case for one in said}):
        row = {one.subset: one for one in said if one.case == number}
        some = next(iter(row.values()))
        truth = "+".join(some.truth) or some.kind
        cells = [_cell(row[subset]) if subset in row else "" for subset in SUBSETS]
        lines.append(f"| {number} | {truth}, C10 {some.true_c10:.2f} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _rate(which: Sequence[bool]) -> str:
    return str(Rate(sum(which), len(which)))


def _cell(one: Said) -> str:
    names = " or ".join("+".join(n) for n in one.listed[:2]) or one.verdict
    return f"{'**' if one.right else ''}{names}{'**' if one.right else ''}; {one.c10[0]:.2f} to {one.c10[1]:.2f}"


app = new_app()


@app.command()
def sealed_channels(
    cases: Annotated[int, typer.Option(min=1, help="Sealed recordings.")] = 24,
    leg: Annotated[int, typer.Option(min=0, help="Number of the leg; each costs a library of responses.")] = 0,
    seed: Annotated[int, typer.Option(min=0, help="Of the cases.")] = 36,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Diagnose the same sealed recordings by force alone, and with further channels.

    Example: python -m studies.sealed_channels --cases 24
    """
    with study_context("sealed_channels", out, jobs, DONE_IS_KEPT) as (folder, processes), progress_on() as progress:
        kept, correction = library or library_folder(), read_correction(REFERENCE)
        diagnoser, stated = Diagnoser(kept, correction, processes), sealed_leg(leg, seed).stated
        with Workers(made, (seed, kept, correction), processes) as workers:
            made_cases = channel_cases(cases, seed, leg)
            progress.stage("simulating sealed cases", len(made_cases))
            recorded = {case.number: (case, recordings) for case, recordings in workers.run(made_cases)}
        # Loadings alone: one library serves all cases, whatever their depths.
        first = next(recordings for _, (_, recordings) in sorted(recorded.items()) if recordings is not None)
        observed = observe(segment_all(first, INSTRUMENT, False))
        lab = Lab(diagnoser, stated, diagnoser.library(stated, observed, progress)[0])
        store = Store(folder / "said", Said, (leg, seed), ("legfem.legs.diagnosis", "studies.sealed_channels.cases"))
        said: list[Said] = []
        for _, (case, recordings) in sorted(recorded.items()):
            if recordings is None:
                progress.advance(f"{case.name}: LEFT OUT, a solution stopped")
                continue
            for subset, names in SUBSETS.items():
                asked = {"case": case.number, "subset": subset}
                if (one := store.get(asked)) is None:
                    begun = time.process_time()
                    found = lab.diagnose(recordings, names, Silent())
                    one = say(found, case, subset, time.process_time() - begun)
                    store.put(asked, one)
                said.append(one)
                typer.echo(f"{case.name} {subset}: {_cell(one)} ({one.seconds:.0f} s)", err=True)
        document: Mapping[str, Any] = {"cases": [one.__dict__ for one in said]}
        write_results(folder, document, table(said))


if __name__ == "__main__":
    app(prog_name="python -m studies.sealed_channels")
