"""A form of the folder's TOML file: what is assumed, and how well it is known."""

from __future__ import annotations

from collections.abc import Callable
from itertools import groupby
from pathlib import Path

from nicegui import ui

from legfem.app.pages.frame import refused, tag
from legfem.app.settings import Setting, Value, read_value, settings_of, with_settings
from legfem.app.workspace import DESCRIPTIONS, description_of
from legfem.common.documents import write_atomically
from legfem.common.errors import InputError

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
    "ball": "Test: a ball on a layer",
    "punch": "Test: a flat punch on a layer",
    "plates": "Test: between plates",
    "cylinder": "Test: a cylinder across a block",
    "uniaxial": "Test: a bar",
    "suction": "Test: a suction cup",
    "tissue": "Tissue",
}


def settings_tab(folder: Path) -> None:
    """Put the form, and the file's text."""
    described = description_of(folder)
    assert described is not None
    path = folder / described
    text = path.read_text(encoding="utf-8-sig")
    schema = DESCRIPTIONS[described]
    tag("p", f"These are the keys of {path.name}. Empty ones are left to their defaults.", "quiet")
    try:
        _form(path, settings_of(schema, text))
    except InputError as error:
        refused(str(error))
    with ui.element("details"):
        tag("summary", f"{path.name} as text")
        _text(path, text)


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
