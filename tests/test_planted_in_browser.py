"""Markup planted in folders, files, every text of every kind of page, and the app is text in the browser's own tree."""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import browser, seen
from driving import Driven
from making import press, write_subject
from making_pages import PAGES
from openpyxl import Workbook
from typer.testing import CliRunner
from walking import Server

from legfem.app.workspace import Workspace
from legfem.commands.data import app
from legfem.report.render import rendered

NUMBER = 100
MADE = press(air=2.0, force_sd=0.02, displacement_sd=0.005, seed=4)
SCRIPT = """
window.seen.planted = document.querySelectorAll("[data-planted], planted").length;
window.seen.ran = String(window.planted || "");
"""


def _mark(k: int) -> str:
    """Markup that leaves an element, or runs, where it isn't text."""
    kinds = ("<img data-planted src=x onerror='planted=1'>", "</script><planted>", "</title><planted>", '"><planted>')
    return f"{k}{kinds[k % len(kinds)]}"


pytestmark = [pytest.mark.slow, pytest.mark.skipif(browser() is None, reason="needs a browser")]


def test_markup_in_a_hundred_fields_makes_no_element(tmp_path: Path) -> None:
    """Columns of a workbook and its sheet's name, a leg's title, and a recording's own file name."""
    book = Workbook()
    page = book.active
    page.title = "<b data-planted>s"
    names = ["Time <img data-planted src=x> (s)", "Depth </script><planted> (mm)", "Force <planted> (N)"]
    extra = [f"{_mark(k)} (°C)" for k in range(NUMBER)]
    page.append([*names, *extra])
    for t, d, f in zip(MADE.time, MADE.displacement, MADE.force, strict=True):
        page.append([float(t), float(d), float(f), *np.full(NUMBER, 20.0).tolist()])
    path = tmp_path / "a<img data-planted src=x onerror=planted=1>.xlsx"
    book.save(path)
    folder = write_subject(tmp_path / "leg")
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text().replace("Made for a test", "<planted>x</planted><script>planted=1</script>"))
    pages = []
    for words in (["look", str(path)], ["preview", str(folder)]):
        out = tmp_path / words[0]
        run = CliRunner().invoke(app, [*words, "--out", str(out)])
        assert run.exit_code == 0, run.output
        pages += sorted(out.glob("*.html"))
    assert pages
    for one in pages:
        found = seen(one, str(browser()), SCRIPT)
        assert found["planted"] == 0 and found["ran"] == "", one
        assert "planted" in one.read_text(), "what was planted is shown"


_OURS = {"tone", "origin", "provenance", "dash", "colour", "view", "outlines", "data", "shape"}
"""Fields that the program fills, with one of a few words, numbers or colours; ``name`` of curves is another."""


def _planted(value: Any, count: list[int], ours: bool = False) -> Any:
    """Return a page's part with markup behind every text that isn't the program's own."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        changed = {}
        for field in dataclasses.fields(value):
            own = field.name in _OURS or (field.name == "name" and type(value).__name__ == "Curves")
            if field.init and not own:
                changed[field.name] = _planted(getattr(value, field.name), count)
        return dataclasses.replace(value, **changed)
    if isinstance(value, str):
        if not re.search("[A-Za-z]", value):
            return value
        count[0] += 1
        return value + _mark(count[0])
    if isinstance(value, Mapping):
        return {key: _planted(one, count) for key, one in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, bytes):
        return type(value)(_planted(one, count) for one in value) if isinstance(value, list | tuple) else value
    return value


@pytest.mark.parametrize("kind", PAGES)
def test_markup_in_every_text_of_a_page_makes_no_element(tmp_path: Path, kind: str) -> None:
    (tmp_path / "made").mkdir()
    count = [0]
    page = _planted(PAGES[kind](tmp_path / "made"), count)
    path = tmp_path / f"{kind}.html"
    html = rendered(page)
    assert "&lt;planted&gt;" in html, "what was planted is shown"
    path.write_text(html)
    found = seen(path, str(browser()), SCRIPT)
    print(f"{kind}: markup in {count[0]} texts")
    assert count[0] > 30
    assert found["planted"] == 0 and found["ran"] == ""


def test_markup_in_a_dropped_folder_is_text_in_the_app(tmp_path: Path) -> None:
    """File names, a workbook's sheet and columns, a title and what is wrong with a file."""
    server = Server((sys.executable,), tmp_path / "workspace")
    address = server.start()
    workspace = Workspace(tmp_path / "workspace")
    with server, Driven(str(browser())) as page:
        leg = workspace.new_input("leg")
        folder = write_subject(tmp_path / "leg", trials=2)
        toml = folder / "subject.toml"
        toml.write_text(
            toml.read_text().replace("Made for a test", "Shown<planted>x</planted><img src=x onerror=planted=1>")
        )
        (folder / "recordings" / "a<img data-planted src=x onerror=planted=1>.csv").write_text(
            "time_s,<planted>,b\n1,2,3\n"
        )
        other = workspace.new_input("files")
        book = Workbook()
        book.active.title = "<b data-planted>s"
        book.active.append(["Time <planted> (s)", "Depth </script><planted> (mm)", "Force <img data-planted> (N)"])
        for t, d, f in zip(MADE.time, MADE.displacement, MADE.force, strict=True):
            book.active.append([float(t), float(d), float(f)])
        book.save(workspace.input(other) / "b<planted>.xlsx")
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                place = workspace.input(leg) / path.relative_to(folder)
                place.parent.mkdir(parents=True, exist_ok=True)
                place.write_bytes(path.read_bytes())
        page.open(address)
        for name, words in ((leg, "<planted>"), (other, "b<planted>.xlsx")):
            page.open(f"{address.split('?')[0]}input/{name}")
            page.sees(words, 180.0)
            count = page.value("document.querySelectorAll('[data-planted], planted').length")
            assert count == 0 and page.value("String(window.planted || '')") == "", name
