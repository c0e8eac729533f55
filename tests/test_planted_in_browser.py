"""Markup planted in a hundred fields of folders and files is text in the browser's own tree of the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser import browser, seen
from making import press, write_subject
from openpyxl import Workbook
from typer.testing import CliRunner

from legfem.commands.data import app

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


@pytest.mark.slow
@pytest.mark.skipif(browser() is None, reason="needs a browser")
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
