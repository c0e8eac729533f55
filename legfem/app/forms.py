"""Forms: what a folder's TOML file states, what loose files are, which columns are which."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from nicegui import ui

from legfem.app.description import (
    CalfSize,
    DescribedLeg,
    DescribedSpecimens,
    DescribedStocking,
    Setting,
    Value,
    contours_in,
    is_contours,
    known_tests,
    read_value,
    scans_in,
    settings_of,
    shown_errors,
    with_channels,
    with_settings,
)
from legfem.app.frame import refused, tag
from legfem.app.runs import Run, seen
from legfem.app.workspace import DESCRIPTIONS, description_of, files_of, may_be_recording
from legfem.common.documents import write_atomically
from legfem.common.errors import InputError
from legfem.data.reader import QUANTITIES, SourceColumn, SourceColumns
from legfem.legs.schema import SUBJECTS
from legfem.specimens.kinds import kinds

_TABLES = {
    "": "What it is",
    "section": "Section",
    "indenter": "Indenter",
    "tissues.deep": "Muscle",
    "tissues.superficial": "Fat",
    "tissues.fascia": "Fascia",
    "instrument": "Instrument: give standard deviations, or accuracies and range",
    "recordings": "Recordings",
    "accuracy": "How well the leg is known; empty: what is usual",
    "bare": "Bare leg",
    "compressed": "Leg in its stocking",
    "stocking": "Stocking",
    "segment": "Part that is modelled",
    "tissue": "Tissue",
    **{name: f"Test: {kind.words}" for name, kind in kinds().items()},
}


def settings_tab(folder: Path) -> None:
    """Put the form, and the file's text."""
    described = description_of(folder)
    assert described is not None
    path = folder / described
    text = path.read_text(encoding="utf-8-sig")
    schema = DESCRIPTIONS[described]
    tag("p", f"These are the keys of {path.name}. Empty ones are left to their defaults.", "quiet")
    if described == SUBJECTS.file and (shown := shown_errors(folder)) is not None:
        _offer(path, shown)
    try:
        _form(path, settings_of(schema, text))
    except InputError as error:
        refused(str(error))
    with ui.element("details"):
        tag("summary", f"{path.name} as text")
        _text(path, text)


def _offer(path: Path, shown: tuple[float, float]) -> None:
    """Offer the errors that recordings show for an instrument whose own aren't stated."""
    force, displacement = shown

    def take() -> None:
        stated: dict[tuple[str, ...], Value] = {
            ("instrument", "force_sd_N"): float(f"{force:.2g}"),
            ("instrument", "displacement_sd_mm"): float(f"{displacement:.2g}"),
        }
        write_atomically(path, with_settings(path.read_text(encoding="utf-8-sig"), stated))
        ui.navigate.reload()

    seen = f"From sample to sample the recordings show errors of {force:.2g} N and {displacement:.2g} mm"
    tag("p", f"The instrument isn't stated. {seen}, at least: give its accuracies where you have them.", "line wanting")
    ui.button("Take what the recordings show", on_click=take).props("outline dense")


def _form(path: Path, settings: list[Setting]) -> None:
    fields: list[tuple[Setting, Callable[[], str], str]] = []
    for table, those in groupby(settings, lambda one: ".".join(one.key[:-1])):
        with ui.element("fieldset"):
            tag("legend", _TABLES.get(table, table))
            with ui.element("div").classes("fields"):
                for setting in those:
                    get = setting_field(setting)
                    fields.append((setting, get, get()))

    def save() -> None:
        try:
            changed: dict[tuple[str, ...], Value] = {
                one.key: typed_value(one, get()) for one, get, shown in fields if get() != shown
            }
            if not changed:
                ui.notify("nothing was changed")
                return
            # Read anew: another tab may have changed other keys.
            now = path.read_text(encoding="utf-8-sig")
            write_atomically(path, with_settings(now, changed))
        except InputError as error:
            ui.notify(str(error), type="negative", multi_line=True)
            return
        ui.navigate.reload()

    ui.button("Save", on_click=save)


def typed_value(setting: Setting, text: str) -> Value:
    """Return what was typed or chosen in a field; raises as `read_value` does."""
    return text == "yes" if setting.kind is bool and text else read_value(setting, text)


def setting_field(setting: Setting) -> Callable[[], str]:
    """Put a field; return what reads it."""
    label = setting.key[-1] + (" *" if setting.needed else "")
    now = _written(setting.value)
    hint = setting.help or (f"{_written(setting.default)} by default" if setting.default else "")
    if setting.choices or setting.kind is bool:
        choices = {one: one or "–" for one in ("", *(setting.choices or ("yes", "no")))}
        chosen = ui.select(choices, value=now if now in choices else "", label=label)
        if hint:
            chosen.props["hint"] = hint
        return lambda: str(chosen.value or "")
    typed = ui.input(label, value=now)
    if hint:
        typed.props["hint"] = hint
    return lambda: str(typed.value or "").strip()


def _written(value: Value) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(f"{one:g}" for one in value)
    return f"{value:g}" if isinstance(value, int | float) else value


def _text(path: Path, text: str) -> None:
    box = ui.textarea(value=text).props('autogrow outlined aria-label="text of the file"')
    box.classes("full mono")

    def save() -> None:
        now = path.read_text(encoding="utf-8-sig") if path.exists() else text
        if now != text:
            ui.notify("the file was changed elsewhere: copy your text, and reload", type="negative")
            return
        try:
            settings_of(DESCRIPTIONS[path.name], box.value)
        except InputError as error:
            ui.notify(str(error), type="negative", multi_line=True)
            return
        write_atomically(path, box.value)
        ui.navigate.reload()

    ui.button("Save the text", on_click=save).props("outline")


_NO_CONTOURS = (
    "A typical calf of this size stands for the leg's outlines, and C10's interval includes the error of that. With "
    "the section's contours (a CSV file part,x_mm,y_mm with the parts skin, fascia, tibia and fibula) or a scan with "
    "labels the interval is narrower, and other places than the back of the calf can be pressed: add one under Files."
)
_SHAPES = {"cylinder": "a cylinder", "ball": "a ball", "punch": "a flat punch"}
_TESTS = {name: kind.done for name, kind in kinds().items()}


def describe_tab(folder: Path) -> None:
    """Put a form for what the files can be."""
    contours, scans = contours_in(folder), scans_in(folder)
    if contours or scans:
        _pressed(folder, [*contours, *scans])
    else:
        _pressed_from_behind(folder)
    if scans:
        _dressed(folder, scans)
    if any(may_be_recording(path) and not is_contours(path) for path in files_of(folder)):
        _tested(folder)


def _pressed_from_behind(folder: Path) -> None:
    with ui.element("fieldset"):
        tag("legend", "A calf that a cylinder pressed from behind, without outlines")
        with ui.element("div").classes("fields"):
            title = ui.input("title", value=folder.name)
            sizes = [
                ui.number(label)
                for label in (
                    "girth of the calf (mm)",
                    "skin and fat where it is pressed (mm)",
                    "cylinder's diameter (mm)",
                    "cylinder's length (mm)",
                )
            ]

        def describe() -> None:
            girth, fat, diameter, length = _numbers(sizes)
            DescribedLeg(title.value or folder.name, CalfSize(girth, fat), diameter, length).describe(folder)

        _button("It is a pressed calf", describe)
    tag("p", _NO_CONTOURS, "quiet")


def _numbers(boxes: Sequence[ui.number]) -> list[float]:
    """Numbers of a form's fields, all of which are needed."""
    if missing := [box.props["label"] for box in boxes if box.value is None]:
        raise InputError("form", ", ".join(missing), "missing", "fill in every one")
    return [float(box.value) for box in boxes]


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
            values = _numbers(needed)
            across, x, y, direction = values[:4]
            leg = DescribedLeg(
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
            lambda: DescribedStocking(title.value or folder.name, bare.value, other.value, strength.value).describe(
                folder
            ),
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
            DescribedSpecimens(title.value or folder.name, chosen.value, stated).describe(folder)

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


_SIGNS = {1: "as it is", -1: "turned round (-1)"}


def columns_tab(folder: Path, looking: Run) -> None:
    """Put the choice of columns, begun with what is proposed."""
    found = seen(looking)
    recordings = [] if found is None else [one for one in found["recordings"] if one["columns"]]
    if not recordings:
        tag("p", "There is no recording whose columns could be read.")
        return
    first = next((one for one in recordings if one["channels"]), recordings[0])
    tag(
        "p",
        f"Of {first['file']}; all recordings of a folder are read alike. Chosen is what "
        "names, units and motion in the file suggest, or what was saved.",
        "quiet",
    )
    if first["trouble"]:
        refused(first["trouble"])
    _choice(folder, first)


def _choice(folder: Path, first: dict[str, Any]) -> None:
    sheets = list(dict.fromkeys(one["sheet"] for one in first["columns"]))
    now = first["channels"] or {}
    sheet = ui.select(sheets, value=now.get("sheet") or sheets[0], label="table")
    sheet.set_visibility(len(sheets) > 1)
    names = {one["name"]: one["unit"] for one in first["columns"]}
    chosen: dict[str, tuple[ui.select, ui.input, ui.select | None]] = {}
    for quantity in QUANTITIES:
        known = now.get(quantity) or {}
        with ui.element("fieldset"), ui.element("div").classes("fields"):
            column = ui.select(list(names), value=known.get("column"), label=f"{quantity}: column")
            unit = ui.input(f"{quantity}: unit", value=known.get("unit") or "")
            column.on_value_change(lambda event, box=unit: box.set_value(names.get(event.value)))
            sign = None
            if quantity != "time":
                sign = ui.select(_SIGNS, value=known.get("sign", 1), label=f"{quantity}: direction")
            chosen[quantity] = column, unit, sign

    def channel(quantity: str) -> SourceColumn:
        column, unit, sign = chosen[quantity]
        if not column.value or not unit.value:
            raise InputError("columns", quantity, "has no column or no unit", "choose a column, give its unit")
        return SourceColumn(column.value, unit.value.strip(), 1 if sign is None else int(sign.value))

    def save(use: bool) -> None:
        described = description_of(folder)
        try:
            if described is None:
                raise InputError(
                    "columns", folder.name, "there is no file yet to hold them", "say first what was measured"
                )
            path = folder / described
            channels = None
            if use:
                time, displacement, force = map(channel, QUANTITIES)
                several = len(sheets) > 1
                channels = SourceColumns(time, displacement, force, sheet.value if several else None)
            text = with_channels(path.read_text(encoding="utf-8-sig"), channels)
        except InputError as error:
            ui.notify(str(error), type="negative", multi_line=True)
            return
        write_atomically(path, text)
        ui.navigate.reload()

    with ui.element("div").classes("inrow"):
        ui.button("Read them so", on_click=lambda: save(True))
        ui.button("They are in legfem's own form", on_click=lambda: save(False)).props("outline")
