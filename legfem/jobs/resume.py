"""Going on with work that was stopped: only what isn't kept yet is done."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from legfem.common.progress import Progress
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store


def finish[Context, Task, Outcome](
    workers: Workers[Context, Task, Outcome],
    tasks: Sequence[Task],
    store: Store[Outcome],
    progress: Progress,
    stage: str,
    line: Callable[[Task, Outcome], str],
    asked: Callable[[Task], object] = lambda task: task,
    worth: Callable[[Outcome], bool] = lambda outcome: True,
    on_found: Callable[[dict[int, Outcome]], None] = lambda found: None,
) -> list[Outcome]:
    """Return the outcomes of all tasks, in their order, each kept as soon as it is known.

    Parameters
    ----------
    workers, tasks
        What does the tasks that have no outcome in the store.
    store
        Where outcomes are kept.
    progress
        Told of the stage and of every new outcome.
    stage, line
        What it is told.
    asked
        Of a task: what the store knows it by.
    worth
        Whether to keep an outcome; others are tried again the next time.
    on_found
        Told all outcomes so far, by place in the list, whenever there is a new one.
    """
    kept = ((place, store.get(asked(task))) for place, task in enumerate(tasks))
    found = {place: outcome for place, outcome in kept if outcome is not None}
    waiting = [place for place in range(len(tasks)) if place not in found]
    known = f" ({len(found)} known)" if found else ""
    progress.stage(stage + known, len(waiting))
    todo = [tasks[place] for place in waiting]
    for number, outcome in workers.places(todo) if todo else ():
        if worth(outcome):
            store.put(asked(todo[number]), outcome)
        found[waiting[number]] = outcome
        progress.advance(line(todo[number], outcome))
        on_found(found)
    return [found[place] for place in range(len(tasks))]
