"""All runs beside each other, and two reports side by side."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from nicegui import ui

from legfem.app.outcomes import Found, found_by
from legfem.app.pages.frame import framed, page_of, tag
from legfem.app.pages.run import address
from legfem.app.runs import Run
from legfem.app.workspace import Workspace

_COLUMNS = {
    "run": "run",
    "about": "of",
    "law": "law",
    "c10": "C10 (95 %)",
    "c20": "C20 (95 %)",
    "fat": "C10 of fat",
    "verdict": "verdict",
    "origin": "data",
    "state": "state",
}


def compare_page(workspace: Workspace) -> None:
    """Put the page."""
    with framed("Compare"):
        runs = [Run(workspace.run(name)) for name in workspace.runs]
        runs = [run for run in runs if run.there]
        if not runs:
            tag("p", "There are no runs yet.")
            return
        _table([found for run in runs for found in found_by(run)])
        reports = {run.folder.name: run for run in runs if run.report is not None}
        if len(reports) < 2:
            return
        tag("h2", "Two reports")
        names = list(reports)
        with ui.element("div").classes("beside"):
            for name in names[:2]:
                _one(reports, name)


def _table(rows: list[Found]) -> None:
    wide = ui.element("div").classes("wide").props('tabindex=0 role=region aria-label="Results"')
    with wide, ui.element("table"):
        with ui.element("thead"), ui.element("tr"):
            for text in _COLUMNS.values():
                tag("th", text).props("scope=col")
        with ui.element("tbody"):
            for row in rows:
                _row(asdict(row))


def _row(row: dict[str, Any]) -> None:
    with ui.element("tr"):
        with ui.element("th").props("scope=row"):
            ui.link(row["run"], page_of("run", row["run"]))
        for name in list(_COLUMNS)[1:]:
            tag("td", row[name] or "–").props(f'data-label="{_COLUMNS[name]}"')


def _one(reports: dict[str, Run], first: str) -> None:
    with ui.element("div"):
        chosen = ui.select(list(reports), value=first, label="report of").classes("full")
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
