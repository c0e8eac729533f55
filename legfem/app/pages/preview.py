"""What is seen in a folder before anything is solved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any
from urllib.parse import quote

from nicegui import ui

from legfem.app.look import seen
from legfem.app.pages.frame import command, refused, tag, warned
from legfem.app.runs import Run
from legfem.data.quality import GRADES

RUN = "Run"
"""The tab of the commands."""


def preview_tab(looking: Run, others: Sequence[str], go: Callable[[str], object]) -> None:
    """Put what a preview's run wrote, and ways to the other tabs."""
    found = seen(looking)
    assert found is not None
    if found["trouble"]:
        refused(found["trouble"])
    with ui.element("div").classes("inrow"):
        mends = [one for one in others if one != RUN]
        tag("span", "Mend it under" if found["trouble"] else "Is this what you measured?")
        for one in mends if found["trouble"] else [RUN]:
            ui.button(one, on_click=lambda name=one: go(name)).props("outline dense")
    warned(found["doubts"])
    if found["origin"]:
        tag("p", f"{found['title']}: {found['origin']} data", "sentence")
    with ui.element("div").classes("beside"):
        if found["facts"]:
            with ui.element("dl").classes("facts"):
                for what, value in found["facts"]:
                    tag("dt", what)
                    tag("dd", value)
        for file, shown in found["pictures"]:
            _picture(looking, file, shown)
    if found["recordings"]:
        tag("h2", "Recordings")
        for recording in found["recordings"]:
            _recording(looking, recording)
    command(looking.command)


def _recording(looking: Run, recording: dict[str, Any]) -> None:
    with ui.element("section").classes("recording"):
        with tag("h3", recording["file"]):
            if recording["grade"]:
                grade = recording["grade"]
                tag("span", f"grade {grade}: {GRADES[grade]}", f"chip grade-{grade.lower()}")
        if recording["trouble"]:
            refused(recording["trouble"])
            return
        if recording["reasons"]:
            tag("p", "; ".join(recording["reasons"]), "quiet")
        shown = f"displacement and force of {recording['file']} over time with phases, and force "
        _picture(looking, recording["picture"], f"{shown}over displacement with first contact.")
        with ui.element("details"):
            tag("summary", "How it was read, first contact, phases, noise")
            tag("pre", recording["text"])


def _picture(looking: Run, file: str, shown: str) -> None:
    folder = looking.folder
    address = f"/files/previews/{quote(folder.parent.name, safe='')}/{folder.name}/results/"
    with ui.element("figure"):
        ui.element("img").props.update({"src": address + quote(file), "alt": shown})
        tag("figcaption", f"{shown[0].upper()}{shown[1:]}")
