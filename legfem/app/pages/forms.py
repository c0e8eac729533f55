"""Forms: what a folder's TOML file states, what loose files are, which columns are which."""

from collections.abc import Callable
from itertools import groupby
from pathlib import Path
from typing import Any

from nicegui import ui

from legfem.app.description import Setting, Value, read_value, settings_of, shown_errors, with_channels, with_settings
from legfem.app.pages.frame import WORDS, attempt, dropdown, hinted, refused, tag
from legfem.app.workspace import DESCRIPTIONS, description_of, text_of
from legfem.common.documents import write_atomically
from legfem.common.errors import InputError
from legfem.data.recording import QUANTITIES, SourceColumn, SourceColumns
from legfem.legs.schema import SUBJECTS
from legfem.specimens.kinds import kinds

_TABLES = WORDS["tables"] | {name: f"Test: {kind.words}" for name, kind in kinds().items()}


def settings_tab(folder: Path) -> None:
    """Put the form, and the file's text."""
    described = description_of(folder)
    assert described is not None
    path = folder / described
    text = text_of(path)
    schema = DESCRIPTIONS[described]
    tag("p", f"These are the keys of {path.name}. An empty field keeps its default.", "quiet")
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
        write_atomically(path, with_settings(text_of(path), stated))
        ui.navigate.reload()

    seen = f"The recordings show errors of at least {force:.2g} N and {displacement:.2g} mm from sample to sample"
    tag("p", f"The instrument is not stated. {seen}: give its accuracies if you know them.", "line wanting")
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
        changed = {one.key: typed_value(one, get()) for one, get, shown in fields if get() != shown}
        # Read anew: another tab may have changed other keys.
        write_atomically(path, with_settings(text_of(path), changed))

    ui.button("Save", on_click=lambda: attempt(save))


def typed_value(setting: Setting, text: str) -> Value:
    """Return what was typed or chosen in a field; raises as `read_value` does."""
    return text == "yes" if setting.kind is bool and text else read_value(setting, text)


def setting_field(setting: Setting) -> Callable[[], str]:
    """Put a field; return what reads it."""
    label = setting.key[-1] + (" *" if setting.needed else "")
    now = _written(setting.value)
    usual = "" if setting.default is None else f"{_written(setting.default)} by default"
    if setting.choices or setting.kind is bool:
        choices = {one: one or usual or "–" for one in ("", *(setting.choices or ("yes", "no")))}
        chosen = dropdown(choices, now if now in choices else "", label, setting.help)
        return lambda: str(chosen.value or "")
    typed = hinted(ui.input(label, value=now, placeholder=usual), setting.help)
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
    hinted(box, "the whole file, with keys that no field above has").classes("full mono")

    def save() -> None:
        if path.exists() and text_of(path) != text:
            raise InputError(
                path.name, "text", "the file was changed elsewhere", "copy your text, and load the page again"
            )
        settings_of(DESCRIPTIONS[path.name], box.value)
        write_atomically(path, box.value)

    ui.button("Save the text", on_click=lambda: attempt(save)).props("outline")


_SIGNS = {1: "as it is", -1: "reversed (-1)"}


def first_readable(found: dict[str, Any]) -> dict[str, Any] | None:
    """Return what a preview saw in the first recording whose columns are known or could be chosen; None if in none."""
    recordings = [one for one in found["recordings"] if one["columns"]]
    return next((one for one in recordings if one["channels"]), recordings[0] if recordings else None)


def columns_tab(folder: Path, found: dict[str, Any]) -> None:
    """Put the choice of columns, begun with what is proposed."""
    first = first_readable(found)
    if first is None:
        tag("p", "There is no recording whose columns could be read.")
        return
    tag(
        "p",
        f"These are the columns of {first['file']}; all recordings of a folder are read in the same way. What is "
        "chosen below was saved, or follows from names, units and motion in the file.",
        "quiet",
    )
    if first["trouble"]:
        refused(first["trouble"])
    _choice(folder, first)


_UNIT_HINTS = {"time": "s, ms, min", "displacement": "mm, µm, m", "force": "N, mN, kN"}


def column_fields(first: dict[str, Any]) -> Callable[[], SourceColumns]:
    """Put the choice of a recording's columns, units and directions; return what reads it."""
    sheets = list(dict.fromkeys(one["sheet"] for one in first["columns"]))
    now = first["channels"] or {}
    sheet = dropdown(sheets, now.get("sheet") or sheets[0], "table", "the file's table that has the recording")
    sheet.set_visibility(len(sheets) > 1)
    names = {one["name"]: one["unit"] for one in first["columns"]}
    chosen: dict[str, tuple[ui.select, ui.input, ui.select | None]] = {}
    for quantity in QUANTITIES:
        known = now.get(quantity) or {}
        with ui.element("fieldset"), ui.element("div").classes("fields"):
            said = f"the file's column with the {quantity}"
            column = dropdown(list(names), known.get("column"), f"{quantity}: column", said)
            unit = hinted(ui.input(f"{quantity}: unit", value=known.get("unit") or ""), _UNIT_HINTS[quantity])
            column.on_value_change(lambda event, box=unit: box.set_value(names.get(event.value)))
            sign = None
            if quantity != "time":
                said = "reversed if the numbers fall while the indenter presses"
                sign = dropdown(_SIGNS, known.get("sign", 1), f"{quantity}: direction", said)
            chosen[quantity] = column, unit, sign

    def channel(quantity: str) -> SourceColumn:
        column, unit, sign = chosen[quantity]
        if not column.value or not unit.value:
            raise InputError("columns", quantity, "has no column or no unit", "choose a column, give its unit")
        return SourceColumn(column.value, unit.value.strip(), 1 if sign is None else int(sign.value))

    def read() -> SourceColumns:
        time, displacement, force = map(channel, QUANTITIES)
        return SourceColumns(time, displacement, force, sheet.value if len(sheets) > 1 else None)

    return read


def _choice(folder: Path, first: dict[str, Any]) -> None:
    columns = column_fields(first)

    def save(use: bool) -> None:
        path = folder / str(description_of(folder))
        write_atomically(path, with_channels(text_of(path), columns() if use else None))

    with ui.element("div").classes("inrow"):
        ui.button("Use these columns", on_click=lambda: attempt(lambda: save(True)))
        ui.button("The files have legfem's own columns", on_click=lambda: attempt(lambda: save(False))).props("outline")
