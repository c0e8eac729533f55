"""The first page, what is in the workspace, and the page that compares what runs found."""

import math
from functools import partial

from nicegui import ui

from legfem.app.outcomes import RunResult, answers_of, relative_difference, sentence_of
from legfem.app.pages.frame import WORDS, chip, drop_zone, dropdown, framed, listed, page_of, tag, when, wide_table
from legfem.app.pages.run import address
from legfem.app.runs import Run, runs_of
from legfem.app.study import legs_of
from legfem.app.workspace import Workspace, description_of, files_of
from legfem.common.resources import RESOURCES
from legfem.report.render import filled

_COLUMNS = WORDS["compared"]
_EXAMPLES = {
    "a pressed leg": (RESOURCES / "frauziols" / "subjects" / "3", "example-leg"),
    "a leg in a stocking": (RESOURCES / "dubuis" / "subjects" / "1", "example-stocking"),
}
_MOST_RUNS = 12


def home_page(workspace: Workspace, deleted: str = "") -> None:
    """Put the page; ``deleted`` is what was just deleted, as kind and name with a slash between."""
    with framed("Legs and specimens"):
        _undo(workspace, deleted)
        drop_zone("Drop a folder here, or files: recordings, contours or scans of one leg, or of specimens.")
        with ui.element("p"):
            tag("span", "Nothing at hand? Begin with a simulated example: ")
            for text, (folder, name) in _EXAMPLES.items():
                begin = partial(workspace.copied, folder, name)
                ui.button(text, on_click=lambda b=begin: ui.navigate.to(page_of("input", b()))).props("outline dense")
        if workspace.inputs:
            tag("h2", "Legs and specimens in this workspace")
            for name in listed(workspace.inputs):
                folder = workspace.input(name)
                count = len(files_of(folder))
                ui.link(name, page_of("input", name))
                kind = WORDS["folders"][description_of(folder) or ""]
                tag("span", f"{kind}, {count} file{'' if count == 1 else 's'}", "quiet")
            if len(legs_of(workspace)) > 1:
                ui.button("A study of several legs", on_click=lambda: ui.navigate.to("/study")).props("outline dense")
        if workspace.runs:
            tag("h2", "Runs")
            for run in listed(runs_of(workspace)[:_MOST_RUNS]):
                ui.link(run.folder.name, page_of("run", run.folder.name))
                chip(run.state)
                asked = f"{run.kind} of {run.asked.about}, {when(run.asked.began)}"
                tag("span", sentence_of(run) or asked, "quiet")
            if len(workspace.runs) > _MOST_RUNS:
                ui.link(f"all {len(workspace.runs)}", "/compare")
        _deleted(workspace)
        tag("p", f"Everything is kept in {workspace.folder}.", "quiet")


def _undo(workspace: Workspace, deleted: str) -> None:
    kind, _, name = deleted.partition("/")
    if (kind, name) not in workspace.deleted:
        return
    with ui.element("div").classes("inrow").props("role=status"):
        tag("span", f"{name} is deleted.")
        ui.button("Undo", on_click=lambda: _put_back(workspace, kind, name)).props("outline dense")


def _deleted(workspace: Workspace) -> None:
    """Put what can be put back."""
    if not workspace.deleted:
        return
    with ui.element("details"):
        tag("summary", "Deleted")
        for kind, name in listed(workspace.deleted):
            tag("span", f"{kind.removesuffix('s')} {name}")
            ui.button("Put back", on_click=lambda k=kind, n=name: _put_back(workspace, k, n)).props("flat dense")


def _put_back(workspace: Workspace, kind: str, name: str) -> None:
    now = workspace.put_back(kind, name)
    if kind == "runs":
        run = Run(workspace.run(now))
        run.point_to(run.asked.about, workspace.folder / "runs" / name / "results", run.results)
    ui.navigate.to(page_of(kind.removesuffix("s"), now))


def compare_page(workspace: Workspace) -> None:
    """Put the page."""
    with framed("Compare"):
        runs = runs_of(workspace)
        if not runs:
            tag("p", "There are no runs yet.")
            return
        with ui.element("p").classes("inrow"):
            tag("span", "Download all numbers with their intervals:")
            for kind in ("csv", "xlsx"):
                ui.link(f"results as {kind.upper()}", f"/table.{kind}")
        _differences([found for run in runs for found in answers_of(run)])
        reports = {run.folder.name: run for run in runs if run.report is not None}
        if len(reports) < 2:
            return
        tag("h2", "Two reports")
        names = list(reports)
        with ui.element("div").classes("beside"):
            for name in names[:2]:
                _one(reports, name)


def _differences(rows: list[RunResult]) -> None:
    """Put the table of results, with differences of C10 from a chosen one."""
    known = {f"{row.run} {row.law}".strip(): row.c10_ends for row in rows if row.c10_ends is not None}
    said = "differences of C10 are from this result"
    chosen = dropdown(list(known), next(iter(known), None), "compare all results with", said)
    chosen.set_visibility(len(known) > 1)
    place = ui.element("div")

    def draw() -> None:
        place.clear()
        with place:
            if known:
                _plot(known, chosen.value)
            _table(rows, known.get(chosen.value))

    chosen.on_value_change(draw)
    draw()


def _plot(known: dict[str, tuple[float, float, float]], chosen: str) -> None:
    """Put C10 of every result with its interval on one axis."""
    most = max(ends[2] for ends in known.values())
    step = next(step for k in range(-4, 5) for step in (10.0**k, 2 * 10.0**k, 5 * 10.0**k) if most / step <= 6)
    ticks = [k * step for k in range(math.ceil(most / step) + 1)]
    with ui.element("figure"):
        ui.html(filled("compared.svg", known=known, chosen=chosen, ticks=ticks), sanitize=False)
        tag("figcaption", f"C10 of muscle or specimen with its 95 % interval. The interval of {chosen} is shaded.")


def _table(rows: list[RunResult], reference: tuple[float, float, float] | None) -> None:
    def cells(row: RunResult) -> list[str]:
        ends = row.c10_ends
        difference = "–" if ends is None or reference is None else relative_difference(ends, reference)
        own = [getattr(row, name, "") or row.shown(name) or "–" for name in list(_COLUMNS)[1:]]
        return [row.run, *own, difference]

    wide_table("Results", [*_COLUMNS.values(), "difference (95 %)"], map(cells, rows), "run")


def _one(reports: dict[str, Run], first: str) -> None:
    with ui.element("div"):
        chosen = dropdown(list(reports), first, "report of", "the run whose report is shown beneath").classes("full")
        shown = ui.element("div")

        def draw() -> None:
            run = reports[chosen.value]
            assert run.report is not None
            shown.clear()
            with shown:
                ui.element("iframe").classes("report").props(
                    f'src="{address(run, run.report.name)}" title="report of {run.folder.name}" sandbox="allow-scripts"'
                )

        chosen.on_value_change(draw)
        draw()
