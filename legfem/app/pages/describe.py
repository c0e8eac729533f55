"""What loose files are: a leg that was pressed, one in a stocking, or specimens."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from nicegui import ui

from legfem.app.describe import DressedLeg, LabSpecimens, PressedLeg, contours_in, is_contours, known_tests, scans_in
from legfem.app.pages.frame import tag
from legfem.app.pages.settings import setting_field, typed_value
from legfem.app.settings import Setting, Value
from legfem.app.workspace import files_of, may_be_recording
from legfem.common.errors import InputError

_NO_CONTOURS = (
    "A leg that was pressed needs its section's contours: a CSV file part,x_mm,y_mm with the parts "
    "skin, fascia, tibia and fibula, or a scan with labels. Add it under Files; until then the "
    "recordings are graded."
)
_SHAPES = {"cylinder": "a cylinder", "ball": "a ball", "punch": "a flat punch"}
_TESTS = {
    "ball": "a ball pressed them on a rigid base",
    "punch": "a flat punch pressed them on a rigid base",
    "plates": "pressed between plates, end-on (round specimens)",
    "cylinder": "a cylinder lying across a block pressed it",
    "suction": "a suction cup drew them up",
    "uniaxial": "a bar pulled or pressed along its length",
}


def describe_tab(folder: Path) -> None:
    """Put a form for what the files can be."""
    contours, scans = contours_in(folder), scans_in(folder)
    if contours or scans:
        _pressed(folder, [*contours, *scans])
    else:
        tag("p", _NO_CONTOURS)
    if scans:
        _dressed(folder, scans)
    if any(may_be_recording(path) and not is_contours(path) for path in files_of(folder)):
        _tested(folder)


def _pressed(folder: Path, sources: list[str]) -> None:
    with ui.element("fieldset"):
        tag("legend", "A leg that was pressed")
        with ui.element("div").classes("fields"):
            title = ui.input("title", value=folder.name)
            section = ui.select(sources, value=sources[0], label="contours, or a scan")
            level = ui.number("level to cut a scan at (mm)")
            shape = ui.select(_SHAPES, value="cylinder", label="what pressed it")
            diameter, length = ui.number("diameter (mm)"), ui.number("cylinder's length (mm)")
            axis = ui.number("cylinder turned by (degrees)", value=0.0)
            axis.props["hint"] = "0 along the leg, 90 across"
            for box in (length, axis):
                box.bind_visibility_from(shape, "value", value="cylinder")
            place = [
                ui.number(label)
                for label in ("aim x (mm): a point on its way", "aim y (mm)", "direction of travel (degrees from +x)")
            ]

        def describe() -> None:
            cylinder = shape.value == "cylinder"
            needed = [diameter, *place, *([length] if cylinder else [])]
            values = [math.nan if box.value is None else float(box.value) for box in needed]
            if not all(map(math.isfinite, values)):
                raise InputError("form", "numbers", "some are missing", "fill in every one")
            across, x, y, direction = values[:4]
            leg = PressedLeg(
                title.value or folder.name,
                section.value,
                across,
                values[-1] if cylinder else None,
                (x, y),
                direction,
                level.value,
                shape.value,
                float(axis.value or 0.0) if cylinder else 0.0,
            )
            leg.describe(folder)

        _button("It is a pressed leg", describe)
    tag(
        "p",
        "Tissues are those of Frauziols et al. (2015) until changed under Assumed. A ball, a punch "
        "or a cylinder that doesn't lie along the leg is solved in 3D: model 3d under Run.",
        "quiet",
    )


def _dressed(folder: Path, scans: list[str]) -> None:
    with ui.element("fieldset"):
        tag("legend", "A leg in a compression stocking")
        with ui.element("div").classes("fields"):
            title = ui.input("title", value=folder.name)
            bare = ui.select(scans, value=scans[0], label="scan of the bare leg")
            other = ui.select(["", *scans], value=scans[1] if len(scans) > 1 else "", label="in its stocking")
            strength = ui.select(["1", "2", "3", "4"], value="2", label="class (RAL-GZ 387/1)")

        _button(
            "It is a leg in a stocking",
            lambda: DressedLeg(title.value or folder.name, bare.value, other.value, strength.value).describe(folder),
        )


def _tested(folder: Path) -> None:
    with ui.element("fieldset"):
        tag("legend", "Specimens of one tissue in a lab's test")
        with ui.element("div").classes("fields"):
            title = ui.input("title", value=folder.name)
            chosen = ui.select(_TESTS, value=next(iter(_TESTS)), label="what was done")
        fields: dict[str, list[tuple[Setting, Callable[[], str]]]] = {}
        for test, settings in known_tests().items():
            with ui.element("div").classes("fields") as shown:
                shown.bind_visibility_from(chosen, "value", value=test)
                fields[test] = [(one, setting_field(one)) for one in settings]

        def describe() -> None:
            stated = dict[str, Value]()
            for one, get in fields[chosen.value]:
                value = stated[one.key[-1]] = typed_value(one, get())
                if one.needed and value is None:
                    raise InputError("form", one.key[-1], "is missing", "fill it in")
            LabSpecimens(title.value or folder.name, chosen.value, stated).describe(folder)

        _button("They are specimens", describe)
    tag(
        "p",
        "All recordings are then of specimens of this size; where sizes differ, give each its "
        "[[specimen]] in the file's text under Assumed.",
        "quiet",
    )


def _button(text: str, describe: Callable[[], None]) -> None:
    def done() -> None:
        try:
            describe()
        except InputError as error:
            ui.notify(str(error), type="negative", multi_line=True)
            return
        ui.navigate.reload()

    ui.button(text, on_click=done)
