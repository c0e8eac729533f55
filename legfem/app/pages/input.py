"""What was given: what is seen in it, what is assumed, how its files are read, and what to run."""

from collections.abc import Callable
from typing import Any
from urllib.parse import quote

from nicegui import ui

from legfem.app.description import contours_in, scans_in
from legfem.app.pages import frame
from legfem.app.pages.forms import columns_tab, settings_tab
from legfem.app.runs import ACTIONS, Action, Run, check_idle, looked_at, read_json, rename_input, runs_of, written
from legfem.app.workspace import Workspace, description_of, files_of
from legfem.common.errors import InputError
from legfem.data.quality import GRADES

type Questions = Callable[[Workspace, str, dict[str, Any]], None]


def actions_tab(workspace: Workspace, name: str) -> None:
    """Put the commands, and the runs that there are."""
    described = description_of(workspace.input(name))
    assert described is not None
    for action in ACTIONS[described]:
        _command_form(workspace, name, action)
    if mine := runs_of(workspace, name):
        frame.tag("h2", "Its runs")
        for run in frame.listed(mine):
            ui.link(run.folder.name, frame.page_of("run", run.folder.name))
            frame.chip(run.state)


def _command_form(workspace: Workspace, name: str, action: Action) -> None:
    wish = f"{action.name}-{name}"
    with ui.element("section").classes("action").props(f'aria-label="{action.name}"'):
        frame.tag("h2", action.name)
        frame.tag("p", action.does)
        boxes: dict[str, ui.select | ui.number] = {}
        box: ui.select | ui.number
        with ui.element("div").classes("fields"):
            for choice in action.choices:
                if choice.choices:
                    known = {"": "by default", **{one: one for one in choice.choices}}
                    box = ui.select(known, value="", label=choice.label)
                else:
                    box = ui.number(choice.label, placeholder="by default")
                boxes[choice.option] = frame.hinted(box, choice.help)
            more = ui.input("more options", placeholder="as on the command line")
            frame.hinted(more, f"legfem {action.name} --help lists them")

        def options(run: str) -> list[str]:
            chosen = {option: _typed(box.value) for option, box in boxes.items()}
            out = workspace.folder / "runs" / run / "results"
            return action.options(workspace.input(name), out, chosen, more.value or "")

        shown = frame.command(written(action.module, options(workspace.free_run(wish))))
        trouble = frame.tag("p", "", "line refused").props("role=alert")
        trouble.set_visibility(False)

        def update() -> None:
            try:
                shown.text = written(action.module, options(workspace.free_run(wish)))
                trouble.set_visibility(False)
            except InputError as error:
                trouble.text = str(error)
                trouble.set_visibility(True)

        for typed in (*boxes.values(), more):
            typed.on_value_change(update)

        def start() -> str:
            given = options(run := workspace.free_run(wish))
            Run.begun(workspace.run(workspace.new_run(run)), action.module, given, name)
            return frame.page_of("run", run)

        ui.button(f"Run {action.name}", on_click=lambda: frame.attempt(start))


def _typed(value: str | float | None) -> str:
    """Return what an option is given; empty where nothing was chosen."""
    return f"{value:.10g}" if isinstance(value, int | float) else value or ""


RUN = "Run"
"""The tab of the commands."""


def preview_tab(workspace: Workspace, name: str, looking: Run, found: dict[str, Any], tabs: ui.tabs) -> None:
    """Put what a preview's run wrote, and what to do next."""
    if found["trouble"]:
        (frame.wanting if found.get("unsaid") else frame.refused)(found["trouble"])
    with ui.element("div").classes("inrow"):
        if found["trouble"]:
            frame.tag("span", "Give it under" if found.get("unsaid") else "Correct it under")
            for one in ("Assumed", "Columns", "Files"):
                ui.button(one, on_click=lambda name=one: tabs.set_value(name)).props("outline dense")
        else:
            frame.tag("span", "Is this what you measured?")
            ui.button(frame.ASK, on_click=lambda: frame.ask(workspace, name))
            ui.button(RUN, on_click=lambda: tabs.set_value(RUN)).props("outline dense")
    frame.warned(found["doubts"])
    if found["origin"]:
        frame.tag("p", f"{found['title']}: {found['origin']} data", "sentence")
    with ui.element("div").classes("beside"):
        if found["facts"]:
            with ui.element("dl").classes("facts"):
                for what, value in found["facts"]:
                    frame.tag("dt", what)
                    frame.tag("dd", value)
        for file, shown in found["pictures"]:
            _picture(looking, file, shown)
    _recordings(looking, found)
    frame.command(looking.command)


def _recordings(looking: Run, found: dict[str, Any]) -> None:
    """Put recordings as they are read: the first, and the others behind it."""
    if not found["recordings"]:
        return
    frame.tag("h2", "Recordings")
    first, *others = sorted(found["recordings"], key=lambda one: bool(one["trouble"]) - bool(one["picture"]))
    _recording(looking, first)
    if others:
        with ui.element("details"):
            frame.tag("summary", f"The other {len(others)} recording{'s' * (len(others) > 1)}")
            for one in others:
                _recording(looking, one)


def _questions(workspace: Workspace, name: str, looking: Run, found: dict[str, Any], put: Questions) -> None:
    """Put the questions about a folder without a description, beside what is seen in it."""
    if not any(one["columns"] or not one["trouble"] for one in found["recordings"]) and not any(
        contents(workspace.input(name)) for contents in (contours_in, scans_in)
    ):
        frame.refused(found["trouble"])
        _recordings(looking, found)
        return
    with ui.element("div").classes("beside"):
        with ui.element("div"):
            put(workspace, name, found)
        with ui.element("div"):
            _recordings(looking, found)


def _recording(looking: Run, recording: dict[str, Any]) -> None:
    with ui.element("section").classes("recording"):
        with frame.tag("h3", recording["file"]):
            if recording["grade"]:
                grade = recording["grade"]
                frame.tag("span", f"grade {grade}: {GRADES[grade]}", f"chip grade-{grade.lower()}")
        if recording["trouble"]:
            frame.refused(recording["trouble"])
            return
        if recording["reasons"]:
            frame.tag("p", "; ".join(recording["reasons"]), "quiet")
        shown = f"displacement and force of {recording['file']} over time with its holds, and force "
        _picture(looking, recording["picture"], f"{shown}over displacement.")
        with ui.element("details"):
            frame.tag("summary", "How it was read, first contact, phases, noise")
            frame.tag("pre", recording["text"])


def _picture(looking: Run, file: str, shown: str) -> None:
    folder = looking.folder
    address = f"/files/previews/{quote(folder.parent.name, safe='')}/{folder.name}/results/"
    with ui.element("figure"):
        ui.element("img").props.update({"src": address + quote(file), "alt": shown})
        frame.tag("figcaption", f"{shown[0].upper()}{shown[1:]}")


_EVERY, _LOOKING = 0.5, "looking at the files ..."


def input_page(workspace: Workspace, name: str, questions: Questions) -> None:
    """Put the page; ``questions`` puts those about an input that isn't described yet."""
    with frame.framed(name):
        try:
            folder = workspace.input(name)
        except InputError as error:
            frame.refused(str(error))
            return
        described = description_of(folder)
        names = ["Preview", "Assumed", "Columns", "Files", RUN] if described else ["What is it", "Files"]
        if described == "leg.toml":
            names.remove("Columns")
        try:
            looking = looked_at(workspace, name)
        except (InputError, OSError) as error:
            frame.refused(str(error))
            names = ["Assumed", "Files"] if described else ["Files"]
        with ui.tabs().props("dense no-caps outside-arrows mobile-arrows align=left") as tabs:
            for one in names:
                ui.tab(one)
        with ui.tab_panels(tabs, value=names[0], animated=False).classes("full"):
            for one in names:
                with ui.tab_panel(one):
                    match one:
                        case "Preview":
                            _when_seen(looking, lambda found: preview_tab(workspace, name, looking, found, tabs))
                        case "What is it":
                            _when_seen(looking, lambda found: _questions(workspace, name, looking, found, questions))
                        case "Assumed":
                            settings_tab(folder)
                        case "Columns":
                            _when_seen(looking, lambda found: columns_tab(folder, found))
                        case "Files":
                            _files_tab(workspace, name)
                        case _:
                            actions_tab(workspace, name)


def _when_seen(looking: Run, put: Callable[[dict[str, Any]], None]) -> None:
    """Put something of what a preview wrote, once it is there."""
    place = ui.element("div")
    with place, ui.element("div").classes("inrow").props("role=status"):
        ui.spinner()
        stage = frame.tag("span", _LOOKING)

    def check() -> None:
        if looking.alive:
            reached = looking.reached()
            stage.text = f"{_LOOKING} {reached.stage}" if reached else _LOOKING
            return
        timer.cancel()
        place.clear()
        with place:
            if found := read_json(looking.results / "preview.json"):
                put(found)
            else:
                frame.refused((looking.log() or ["the files could not be looked at"])[-1])

    timer = ui.timer(_EVERY, check)


def _files_tab(workspace: Workspace, name: str) -> None:
    folder = workspace.input(name)
    for path in frame.listed(files_of(folder), "files"):
        frame.tag("span", path.relative_to(folder).as_posix())
        frame.tag("span", f"{path.stat().st_size / 1000:,.0f} kB", "quiet")
    frame.drop_zone("Drop more files here; a file of the same name replaces the old one.", name)
    frame.tag("p", f"These files are in {folder}.", "quiet")
    called = frame.hinted(ui.input("name", value=name), "for Rename and Duplicate")

    def delete() -> str:
        check_idle(workspace, name)
        return frame.page_after_deletion("inputs", workspace.delete("inputs", name))

    with ui.element("div").classes("inrow"):
        for text, change in (
            ("Rename", lambda: frame.page_of("input", rename_input(workspace, name, called.value))),
            ("Duplicate", lambda: frame.page_of("input", workspace.copied(folder, called.value))),
            ("Delete", delete),
        ):
            ui.button(text, on_click=lambda change=change: frame.attempt(change)).props("outline dense")
        frame.tag("span", "What is deleted can be put back on the first page.", "quiet")
