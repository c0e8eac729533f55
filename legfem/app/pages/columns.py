"""Which columns of the instrument's files are time, displacement and force."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from nicegui import ui

from legfem.app.look import seen
from legfem.app.pages.frame import refused, tag
from legfem.app.runs import Run
from legfem.app.settings import with_channels
from legfem.app.workspace import description_of
from legfem.common.documents import write_atomically
from legfem.common.errors import InputError
from legfem.data.reader import QUANTITIES, Channel, Channels

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

    def channel(quantity: str) -> Channel:
        column, unit, sign = chosen[quantity]
        if not column.value or not unit.value:
            raise InputError("columns", quantity, "has no column or no unit", "choose a column, give its unit")
        return Channel(column.value, unit.value.strip(), 1 if sign is None else int(sign.value))

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
                channels = Channels(time, displacement, force, sheet.value if several else None)
            text = with_channels(path.read_text(encoding="utf-8-sig"), channels)
        except InputError as error:
            ui.notify(str(error), type="negative", multi_line=True)
            return
        write_atomically(path, text)
        ui.navigate.reload()

    with ui.element("div").classes("inrow"):
        ui.button("Read them so", on_click=lambda: save(True))
        ui.button("They are in legfem's own form", on_click=lambda: save(False)).props("outline")
