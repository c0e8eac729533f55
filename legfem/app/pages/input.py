"""What was given: what is seen in it, what is assumed, how its files are read, and what to run."""

from __future__ import annotations

from collections.abc import Callable

from nicegui import ui

from legfem.app.look import looked_at, seen
from legfem.app.pages.actions import actions_tab
from legfem.app.pages.columns import columns_tab
from legfem.app.pages.describe import describe_tab
from legfem.app.pages.frame import drop_zone, framed, refused, tag
from legfem.app.pages.preview import RUN, preview_tab
from legfem.app.pages.settings import settings_tab
from legfem.app.runs import Run
from legfem.app.workspace import Workspace, description_of, files_of
from legfem.common.errors import InputError

_EVERY = 0.5


def input_page(workspace: Workspace, name: str) -> None:
    """Put the page."""
    with framed(name):
        try:
            folder = workspace.input(name)
            looking = looked_at(workspace, name)
        except InputError as error:
            refused(str(error))
            return
        described = description_of(folder)
        names = ["Preview", "Assumed" if described else "Describe", "Columns", "Files", RUN]
        if described == "leg.toml":
            names.remove("Columns")
        with ui.tabs().props("dense no-caps outside-arrows mobile-arrows align=left") as tabs:
            for one in names:
                ui.tab(one)
        with ui.tab_panels(tabs, value=names[0], animated=False).classes("full"):
            for one in names:
                with ui.tab_panel(one):
                    match one:
                        case "Preview":
                            _when_seen(looking, lambda: preview_tab(looking, names[1:], tabs.set_value))
                        case "Assumed":
                            settings_tab(folder)
                        case "Describe":
                            describe_tab(folder)
                        case "Columns":
                            _when_seen(looking, lambda: columns_tab(folder, looking))
                        case "Files":
                            _files_tab(workspace, name)
                        case _:
                            actions_tab(workspace, name)


def _when_seen(looking: Run, put: Callable[[], None]) -> None:
    """Put something once the preview is there."""
    place = ui.element("div")
    with place, ui.element("div").classes("inrow").props("role=status"):
        ui.spinner()
        tag("span", "looking at the files ...")

    def check() -> None:
        if looking.alive:
            return
        timer.cancel()
        place.clear()
        with place:
            if seen(looking) is None:
                refused((looking.log() or ["it can't be looked at"])[-1])
            else:
                put()

    timer = ui.timer(_EVERY, check)


def _files_tab(workspace: Workspace, name: str) -> None:
    folder = workspace.input(name)
    with ui.element("ul").classes("files"):
        for path in files_of(folder):
            with ui.element("li"):
                tag("span", path.relative_to(folder).as_posix())
                tag("span", f"{path.stat().st_size / 1000:,.0f} kB", "quiet")
    drop_zone("Drop more files here; one of the same name takes the place of the old one.", name)
    tag("p", f"They are in {folder}.", "quiet")
