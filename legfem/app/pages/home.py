"""The first page: drop a folder, or go on with what is there."""

from __future__ import annotations

from pathlib import Path

from nicegui import ui

from legfem.app.outcomes import sentence_of
from legfem.app.pages.frame import chip, drop_zone, framed, page_of, tag, when
from legfem.app.runs import Run
from legfem.app.workspace import Workspace, description_of, files_of
from legfem.data.folder import RESOURCES

_KINDS = {
    "subject.toml": "a leg that was pressed",
    "leg.toml": "a leg in a stocking",
    "specimen.toml": "specimens in a lab's test",
    None: "not described yet",
}
_EXAMPLES = {
    "a pressed leg": (RESOURCES / "frauziols" / "subjects" / "3", "example-leg"),
    "a leg in a stocking": (RESOURCES / "dubuis" / "subjects" / "1", "example-stocking"),
}
_MOST_RUNS = 12


def home_page(workspace: Workspace) -> None:
    """Put the page."""
    with framed("Legs and specimens"):
        drop_zone("Drop a folder here: recordings, contours or scans of one leg, or of specimens.")
        with ui.element("p"):
            tag("span", "Nothing at hand? Begin with an example, simulated: ")
            for text, (folder, name) in _EXAMPLES.items():
                ui.button(text, on_click=lambda f=folder, n=name: _begin(workspace, f, n)).props("outline dense")
        if workspace.inputs:
            tag("h2", "What is there")
            with ui.element("ul").classes("cards"):
                for name in workspace.inputs:
                    _card(workspace, name)
        if workspace.runs:
            tag("h2", "Runs")
            with ui.element("ul").classes("cards"):
                for name in workspace.runs[:_MOST_RUNS]:
                    _run(Run(workspace.run(name)))
            if len(workspace.runs) > _MOST_RUNS:
                ui.link(f"all {len(workspace.runs)}", "/compare")
        tag("p", f"Everything is kept in {workspace.folder}.", "quiet")


def _begin(workspace: Workspace, folder: Path, name: str) -> None:
    ui.navigate.to(page_of("input", workspace.copied(folder, name)))


def _card(workspace: Workspace, name: str) -> None:
    folder = workspace.input(name)
    count = len(files_of(folder))
    with ui.element("li"):
        ui.link(name, page_of("input", name))
        kind = _KINDS[description_of(folder)]
        tag("span", f"{kind}, {count} file{'' if count == 1 else 's'}", "quiet")


def _run(run: Run) -> None:
    if not run.there:
        return
    with ui.element("li"):
        ui.link(run.folder.name, page_of("run", run.folder.name))
        chip(run.state)
        tag("span", sentence_of(run) or f"{run.kind} of {run.about}, {when(run.began)}", "quiet")
