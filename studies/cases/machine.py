"""One machine for all kinds of cases: it draws them, runs each on a process, keeps, counts and tells what came of them.

A case is what is true. What records it, spoils it and hands it to the package stands in its kind, which never gives the
package more than a lab would: the truth stays with the case until outcomes are counted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any

import typer

from legfem.common.command_line import study_context
from legfem.common.documents import json_types
from legfem.common.progress import Progress, progress_on
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from studies.command_line import DONE_IS_KEPT, Jobs, Out, Seed, write_results

_COMMAND = "python -m studies.cases"
Number = Annotated[int, typer.Option("--n", min=1, help="Cases.")]


def nothing_first(context: Any, cases: Sequence[Any], progress: Progress) -> None:
    """Prepare nothing."""


@dataclass(frozen=True)
class Kind[Context, Case, Outcome]:
    """A row of the table of kinds.

    Parameters
    ----------
    title
        What its cases are, in words; the command's help and the progress begin with it.
    number
        Of cases, unless another is asked for.
    draw
        Function from a number and a seed to the cases; the first of many are the few.
    run
        Function of a module, from a context and a case to the outcome: it records, spoils and identifies or diagnoses.
    outcome
        Type of an outcome, by which it is read back.
    line
        A line of progress.
    page
        Tables in Markdown of all outcomes.
    modules
        On whose code outcomes depend; that of ``run`` without any.
    asked
        What an outcome depends on beside the code.
    batch
        Cases of one value are run together, after `prepare`.
    prepare
        Does what a batch's cases share, given those of them that have no outcome yet.
    """

    title: str
    number: int
    draw: Callable[[int, int], Sequence[Case]]
    run: Callable[[Context, Case], Outcome]
    outcome: Any
    line: Callable[[Case, Outcome], str]
    page: Callable[[Sequence[Outcome]], str]
    modules: tuple[str, ...] = ()
    asked: Callable[[Case], object] = lambda case: case
    batch: Callable[[Case], object] = lambda case: 0
    prepare: Callable[[Context, Sequence[Case], Progress], None] = nothing_first

    def count(
        self,
        cases: Sequence[Case],
        context: Context,
        folder: Path,
        processes: int,
        progress: Progress,
        depends_on: object = None,
    ) -> list[Outcome]:
        """Return the cases' outcomes, and write their numbers and page after every batch.

        Parameters
        ----------
        cases
            Those of a batch one after the other.
        context
            What all runs share.
        folder
            For results; finished cases are kept in it.
        processes
            At once.
        progress
            Told of each case.
        depends_on
            What outcomes depend on beside the cases and the code.
        """
        store = Store(folder / "kept", self.outcome, depends_on, self.modules or (self.run.__module__,))
        found: list[Outcome] = []
        for _, batch in groupby(cases, self.batch):
            some = list(batch)
            self.prepare(context, [case for case in some if store.get(self.asked(case)) is None], progress)
            with Workers(self.run, context, processes) as workers:
                found += finish(workers, some, store, progress, self.title, self.line, self.asked)
            write_results(folder, {"cases": [_plain(one) for one in found]}, self.page(found))
        return found


def _plain(outcome: Any) -> Any:
    return [asdict(one) for one in outcome] if isinstance(outcome, list) else json_types(asdict(outcome))


def command_of(name: str, kind: Kind[Path, Any, Any]) -> Callable[..., None]:
    """Return the command that draws and runs cases of a kind, whose context is its folder."""

    def command(n: Number = kind.number, seed: Seed = 1, out: Out = None, jobs: Jobs = None) -> None:
        with study_context(name, out, jobs, DONE_IS_KEPT) as (folder, processes), progress_on() as progress:
            kind.count(kind.draw(n, seed), folder, folder, processes, progress)

    command.__doc__ = f"""Count {kind.title}.

    Every case is kept as it is done: the same command goes on where it was stopped.

    Example: {_COMMAND} {name} --n {kind.number}
    """
    return command
