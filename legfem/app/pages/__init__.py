"""The pages: what stands in the workspace's files, and buttons that start commands."""

from __future__ import annotations

from nicegui import ui

from legfem.app.pages.compare import compare_page
from legfem.app.pages.home import home_page
from legfem.app.pages.input import input_page
from legfem.app.pages.run import run_page
from legfem.app.workspace import Workspace


def add_pages(workspace: Workspace) -> None:
    """Give NiceGUI the pages of a workspace."""
    for field in (ui.input, ui.number, ui.select):
        field.default_props("outlined dense stack-label hide-bottom-space")
    ui.button.default_props("unelevated no-caps")
    ui.page("/")(lambda: home_page(workspace))
    ui.page("/compare")(lambda: compare_page(workspace))

    @ui.page("/input/{name}")
    def one_input(name: str) -> None:
        input_page(workspace, name)

    @ui.page("/run/{name}")
    def one_run(name: str) -> None:
        run_page(workspace, name)
