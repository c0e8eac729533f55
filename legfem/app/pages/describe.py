"""What loose files are: a leg that was pressed, or one in a stocking."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from nicegui import ui

from legfem.app.describe import DressedLeg, PressedLeg, contours_in, scans_in
from legfem.app.pages.frame import tag
from legfem.common.errors import InputError

_NO_CONTOURS = (
    "A leg that was pressed needs its section's contours: a CSV file part,x_mm,y_mm with the parts "
    "skin, fascia, tibia and fibula, or a scan with labels. Add it under Files; until then the "
    "recordings are graded."
)


def describe_tab(folder: Path) -> None:
    """Put a form for what the files can be."""
    contours, scans = contours_in(folder), scans_in(folder)
    if contours or scans:
        _pressed(folder, [*contours, *scans])
    else:
        tag("p", _NO_CONTOURS)
    if scans:
        _dressed(folder, scans)


def _pressed(folder: Path, sources: list[str]) -> None:
    with ui.element("fieldset"):
        tag("legend", "A leg that was pressed with a cylinder")
        with ui.element("div").classes("fields"):
            title = ui.input("title", value=folder.name)
            section = ui.select(sources, value=sources[0], label="contours, or a scan")
            level = ui.number("level to cut a scan at (mm)")
            numbers = [
                ui.number(label)
                for label in (
                    "cylinder's diameter (mm)", "cylinder's length along the leg (mm)",
                    "aim x (mm): a point on its way", "aim y (mm)",
                    "direction of travel (degrees from +x)",
                )
            ]  # fmt: skip

        def describe() -> None:
            values = [math.nan if box.value is None else float(box.value) for box in numbers]
            if not all(map(math.isfinite, values)):
                raise InputError("form", "numbers", "some are missing", "fill in every one")
            diameter, length, x, y, direction = values
            leg = PressedLeg(title.value or folder.name, section.value, diameter, length, (x, y),
                             direction, level.value)  # fmt: skip
            leg.describe(folder)

        _button(describe)
    tag("p", "Tissues are the first paper's until you change them under Assumed.", "quiet")


def _dressed(folder: Path, scans: list[str]) -> None:
    with ui.element("fieldset"):
        tag("legend", "A leg in a compression stocking")
        with ui.element("div").classes("fields"):
            title = ui.input("title", value=folder.name)
            bare = ui.select(scans, value=scans[0], label="scan of the bare leg")
            other = ui.select(
                ["", *scans], value=scans[1] if len(scans) > 1 else "", label="in its stocking"
            )
            strength = ui.select(["1", "2", "3", "4"], value="2", label="class (RAL-GZ 387/1)")

        _button(
            lambda: DressedLeg(
                title.value or folder.name, bare.value, other.value, strength.value
            ).describe(folder)
        )


def _button(describe: Callable[[], None]) -> None:
    def done() -> None:
        try:
            describe()
        except InputError as error:
            ui.notify(str(error), type="negative", multi_line=True)
            return
        ui.navigate.reload()

    ui.button("This is what it is", on_click=done)
