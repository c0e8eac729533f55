"""What the pages share: their frame, and small pieces."""

import time
import tomllib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any
from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.text_element import TextElement

from legfem.app.runs import RunState, begin_all
from legfem.app.workspace import Workspace, description_of, text_of
from legfem.common.errors import InputError
from legfem.common.resources import resource

WORDS = resource("app/words", dict[str, dict[str, str]])
"""By what they are for."""
# NiceGUI's page doesn't say its language, without which it can't be read aloud.
_HEAD = (
    '<script>document.documentElement.lang = "en";</script>'
    '<link rel="stylesheet" href="/assets/app/app.css">'
    '<script defer src="/assets/app/app.js"></script>'
)


def tag(name: str, text: str, classes: str = "") -> TextElement:
    """Put an HTML element that holds a text."""
    return TextElement(tag=name, text=text).classes(classes)


def hinted[Field: ui.element](field: Field, hint: str) -> Field:
    """Return a field with what is said beneath it."""
    field.props["hint"] = hint
    return field


def dropdown(options: list[str] | dict[Any, str], value: object, label: str, hint: str) -> ui.select:
    """Put a choice with what is said beneath it."""
    return hinted(ui.select(options, value=value, label=label), hint)


def attempt(change: Callable[[], str | None]) -> None:
    """Change something, and go to the address that this returns, or load the page anew; say what is wrong."""
    try:
        address = change()
    except (InputError, OSError) as error:
        ui.notify(str(error), type="negative", multi_line=True)
        return
    if address is None:
        ui.navigate.reload()
    else:
        ui.navigate.to(address)


@contextmanager
def framed(title: str) -> Iterator[None]:
    """Put a page's head and heading; what follows within is its content."""
    ui.page_title(f"{title} - legfem")
    ui.add_head_html(_HEAD)
    ui.colors(primary="#0b3d5c", negative="#b03000", warning="#b07a00", positive="#00704f")
    with ui.header().classes("bar"), ui.element("nav").props('aria-label="Pages"'):
        ui.link("legfem", "/").classes("brand")
        ui.link("Legs and specimens", "/")
        ui.link("Compare", "/compare")
        tag("span", "on this machine only", "local")
    with ui.element("main").classes("page"):
        tag("h1", title)
        yield


def refused(line: str) -> None:
    """Put the line with which a command refuses."""
    tag("p", line, "line refused").props("role=alert")


def wanting(line: str) -> TextElement:
    """Put the line with which a command would refuse what isn't wrong, but not said yet."""
    return tag("p", line, "line wanting")


def wide_table(label: str, columns: Sequence[str], rows: Iterable[Sequence[str]], kind: str = "") -> None:
    """Put a table whose rows begin with their names; with a kind these lead to the pages of what is called so."""
    wide = ui.element("div").classes("wide").props(f'tabindex=0 role=region aria-label="{label}"')
    with wide, ui.element("table"):
        with ui.element("thead"), ui.element("tr"):
            for text in columns:
                tag("th", text).props("scope=col")
        with ui.element("tbody"):
            for name, *cells in rows:
                with ui.element("tr"):
                    with tag("th", "" if kind else name).props("scope=row"):
                        if kind:
                            ui.link(name, page_of(kind, name))
                    for column, text in zip(columns[1:], cells, strict=True):
                        tag("td", text).props(f'data-label="{column}"')


def listed[Entry](entries: Iterable[Entry], kind: str = "cards") -> Iterator[Entry]:
    """Put a list; go through what it lists, each within its own item."""
    with ui.element("ul").classes(kind):
        for entry in entries:
            with ui.element("li"):
                yield entry


def warned(lines: Sequence[str]) -> None:
    """Put doubts."""
    for line in lines:
        tag("p", line, "line doubted")


def command(text: str) -> TextElement:
    """Put a command with a button that copies it; return what shows it."""

    def copy() -> None:
        ui.clipboard.write(shown.text)
        ui.notify("copied")

    with ui.element("div").classes("command"):
        shown = tag("code", text)
        ui.button(icon="content_copy", on_click=copy).props('flat dense aria-label="Copy the command"')
    return shown


def chip(state: RunState) -> TextElement:
    """Put a run's state."""
    return tag("span", str(state), f"chip {state.name.lower()}")


def when(moment: float) -> str:
    """Return a moment (s since the epoch) as people write it."""
    return time.strftime("%Y-%m-%d %H:%M", time.localtime(moment))


def page_of(kind: str, name: str) -> str:
    """Return the address of an input's or a run's page."""
    return f"/{kind}/{quote(name, safe='')}"


def page_after_deletion(kind: str, name: str) -> str:
    """Return the address of the first page, which offers to undo what was just deleted."""
    return f"/?deleted={quote(f'{kind}/{name}', safe='')}"


ASK = "How stiff, and can I trust it?"
"""On the button that identifies and diagnoses."""


def ask(workspace: Workspace, name: str) -> None:
    """Begin what says how stiff a described input is, and whether that can be trusted; go to its page."""
    folder = workspace.input(name)
    described = str(description_of(folder))
    options: dict[str, list[str]] = {"identify": [], "diagnose": [], "stocking": []}
    given = tomllib.loads(text_of(folder / described)).get("indenter", {})
    if given.get("shape", "cylinder") != "cylinder" or given.get("axis_deg"):
        options = {"identify": ["--model", "3d"]}
    attempt(lambda: page_of("run", begin_all(workspace, name, described, options)))


def drop_zone(text: str, name: str = "") -> None:
    """Put a place where files are dropped or chosen, for a new input or one that is there."""
    with ui.element("section").classes("drop").props(f'data-drop aria-label="{text}"') as zone:
        if name:
            zone.props["data-input"] = name
        tag("p", text, "drop-text")
        with ui.element("div").classes("inrow"):
            for label, props in (("Choose a folder", "webkitdirectory"), ("Choose files", "")):
                with tag("label", label, "choose"):
                    ui.element("input").props(f'type=file multiple {props} aria-label="{label}"')
        tag("p", "", "said").props("data-said role=status")
