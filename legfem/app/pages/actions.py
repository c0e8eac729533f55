"""What can be run on a folder."""

from __future__ import annotations

from nicegui import ui

from legfem.app.actions import ACTIONS, Action
from legfem.app.pages.frame import chip, command, page_of, tag
from legfem.app.runs import Run, written
from legfem.app.workspace import Workspace, description_of
from legfem.common.errors import InputError


def actions_tab(workspace: Workspace, name: str) -> None:
    """Put the commands, and the runs that there are."""
    folder = workspace.input(name)
    described = description_of(folder)
    if described is None:
        tag("p", "Say first what the files are, under Describe.")
        return
    for action in ACTIONS[described]:
        _action(workspace, name, action)
    mine = [run for run in map(Run, map(workspace.run, workspace.runs)) if run.there and run.about == name]
    if mine:
        tag("h2", "Its runs")
        with ui.element("ul").classes("cards"):
            for run in mine:
                with ui.element("li"):
                    ui.link(run.folder.name, page_of("run", run.folder.name))
                    chip(run.state)


def _action(workspace: Workspace, name: str, action: Action) -> None:
    wish = f"{action.name}-{name}"
    with ui.element("section").classes("action").props(f'aria-label="{action.name}"'):
        tag("h2", action.name)
        tag("p", action.does)
        boxes: dict[str, ui.select | ui.number] = {}
        with ui.element("div").classes("fields"):
            for choice in action.choices:
                if choice.choices:
                    boxes[choice.option] = ui.select(
                        {"": "by default", **{one: one for one in choice.choices}}, value="", label=choice.label
                    )
                else:
                    boxes[choice.option] = ui.number(choice.label, placeholder="by default")
            more = ui.input("more options", placeholder="as on the command line")

        def options(run: str) -> list[str]:
            chosen = {
                option: ""
                if box.value in (None, "")
                else f"{box.value:.10g}"
                if isinstance(box.value, int | float)
                else str(box.value)
                for option, box in boxes.items()
            }
            out = workspace.folder / "runs" / run / "results"
            return action.options(workspace.input(name), out, chosen, more.value or "")

        shown = command(written(action.module, options(workspace.free_run(wish))))
        trouble = tag("p", "", "line refused").props("role=alert")
        trouble.set_visibility(False)

        def update() -> None:
            try:
                shown.text = written(action.module, options(workspace.free_run(wish)))
                trouble.set_visibility(False)
            except InputError as error:
                trouble.text = str(error)
                trouble.set_visibility(True)

        for box in (*boxes.values(), more):
            box.on_value_change(update)

        def start() -> None:
            update()
            if trouble.visible:
                return
            run = workspace.new_run(wish)
            Run.begun(workspace.run(run), action.module, options(run), name)
            ui.navigate.to(page_of("run", run))

        ui.button(f"Run {action.name}", on_click=start)
