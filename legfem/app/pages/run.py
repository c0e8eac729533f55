"""A run: its progress, its command, and at its end the report."""

import time
from collections.abc import Callable
from pathlib import Path
from urllib.parse import quote

from nicegui import ui

from legfem.app.outcomes import files_of_results, sentence_of
from legfem.app.pages.frame import chip, command, framed, listed, page_after_deletion, page_of, refused, tag
from legfem.app.runs import EVERY, Run, RunState
from legfem.app.study import TABLE
from legfem.app.workspace import Workspace
from legfem.common.errors import InputError
from legfem.common.progress import Reached, duration

_EVERY = 1.0
_SHOWN_LINES = 200


def run_page(workspace: Workspace, name: str) -> None:
    """Put the page of a run, and of the one that follows it."""
    with framed(name):
        try:
            run = Run(workspace.run(name))
            about = run.asked.about
        except InputError as error:
            refused(str(error))
            return
        with ui.element("p"):
            tag("span", f"{run.kind} of ")
            if about == EVERY:
                tag("span", about)
                if (run.folder / TABLE).is_file():
                    ui.link("change the study's table, and go on", f"/study?run={quote(name, safe='')}")
            else:
                ui.link(about, page_of("input", about))
        try:
            following = Run(workspace.run(run.asked.then)) if run.asked.then else None
        except InputError:  # deleted
            following = None
        for one in filter(None, (run, following)):
            if following is not None:
                tag("h2", _QUESTIONS[one.kind])
            _one_run(workspace, one)


_QUESTIONS = {"identify": "How stiff?", "diagnose": "Can I trust it?"}


def _one_run(workspace: Workspace, run: Run) -> None:
    command(run.command)

    def delete() -> None:
        if run.alive:
            ui.notify("This run is not finished: stop it first.")
            return
        ui.navigate.to(page_after_deletion("runs", workspace.delete("runs", run.folder.name)))

    moving, lasting = ui.element("div"), ui.element("div")
    seen: list[tuple[RunState, Callable[[], None]]] = []

    def draw() -> None:
        state = run.state
        if seen and seen[-1][0] is state:
            seen[-1][1]()
            return
        for place in (moving, lasting):
            place.clear()
        with moving:
            seen.append((state, _progress(run, state, delete)))
        with lasting:
            _results(run, state)

    draw()
    ui.timer(_EVERY, draw)


def _progress(run: Run, state: RunState, delete: Callable[[], None]) -> Callable[[], None]:
    """Put how far a run is; return what brings that up to date."""
    with ui.element("div").classes("inrow"):
        chip(state)
        if state is not RunState.RUNNING:
            if state is not RunState.DONE:
                ui.button("Go on", on_click=lambda: _go_on(run)).props("dense")
                kept = "goes on from the finished part"
                kept = "or begin it now" if state is RunState.WAITING else kept
                told = "once the cause below is corrected" if state is RunState.REFUSED else kept
                tag("span", told, "quiet")
            ui.button("Delete", on_click=delete).props("flat dense")
            return lambda: None
        since = tag("span", "", "quiet")
        ui.button("Stop", on_click=lambda: _stop(run)).props("outline dense")
        ui.button("End at once", on_click=lambda: _stop(run, True)).props("flat dense")
    stage, bar = tag("p", "", "stage"), ui.linear_progress(0, show_value=False)
    bar.props('aria-label="progress"')
    last = tag("p", "", "quiet")

    def update() -> None:
        since.text = f"for {duration(time.time() - run.started)}"
        reached = run.reached() or Reached(0.0, "starting", last="this takes some seconds")
        stage.text = reached.stage + (f": {reached.done}" if reached.done else "")
        if reached.total:
            stage.text += f" of {reached.total}"
        if reached.left:
            stage.text += f", about {duration(reached.left)} left"
        bar.value = reached.done / reached.total if reached.total else 0.0
        bar.props("indeterminate" if not reached.total else "", remove="indeterminate")
        last.text = reached.last

    update()
    return update


def _results(run: Run, state: RunState) -> None:
    lines = run.log()
    if state in (RunState.REFUSED, RunState.FAILED) and lines:
        refused(lines[-1])
    sentence = sentence_of(run)
    if sentence and state is RunState.DONE:
        tag("p", sentence, "sentence")
    if run.report is not None and state is RunState.DONE:
        _report(run, run.report)
    if lines and state is not RunState.RUNNING:
        with ui.element("details"):
            tag("summary", "Messages of this run")
            tag("pre", "\n".join(lines[-_SHOWN_LINES:]))


def _report(run: Run, report: Path) -> None:
    with ui.element("div").classes("inrow"):
        ui.link("Open the report by itself", address(run, report.name), new_tab=True)
        for table in ("numbers", "cohort"):
            for kind in ("csv", "xlsx"):
                if (run.results / f"{table}.{kind}").is_file():
                    ui.link(f"Table as {kind.upper()}", address(run, f"{table}.{kind}")).props("download")
    if report.suffix == ".html":
        ui.element("iframe").classes("report").props(
            f'src="{address(run, report.name)}" title="report of {run.kind}" sandbox="allow-scripts"'
        )
    else:
        tag("pre", report.read_text(encoding="utf-8"))
        for path in files_of_results(run.results):
            if path.suffix == ".png":
                ui.element("img").props(f'src="{address(run, path.name)}" alt="{path.stem}"')
    with ui.element("details"):
        tag("summary", "All files")
        tag("p", str(run.results), "quiet")
        for path in listed(files_of_results(run.results), ""):
            ui.link(path.name, address(run, path.name), new_tab=True)


def address(run: Run, file: str) -> str:
    """Return the address of a file of a run's results."""
    return f"/files/runs/{quote(run.folder.name, safe='')}/results/{quote(file)}"


def _stop(run: Run, at_once: bool = False) -> None:
    if run.cancel(at_once):
        ui.notify("The run is being ended." if at_once else "The run stops as soon as its present solve is done.")
    else:
        ui.notify("This run is not running, or is just starting.")


def _go_on(run: Run) -> None:
    if not run.resume():
        ui.notify("This run is already running.")
    ui.navigate.reload()
