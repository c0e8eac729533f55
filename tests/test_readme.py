"""The Python in README and CONTRIBUTING runs, in its order, and so does the notebook."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOK = ROOT / "examples" / "first_steps.ipynb"
QUICK = ('law="both"', 'law="neo-hookean", mesh="coarse", depth=10.0')


def blocks(document: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", (ROOT / document).read_text(), re.M | re.S)


def run(code: list[str]) -> dict[str, Any]:
    names: dict[str, Any] = {}
    for number, block in enumerate(code):
        exec(compile(block, f"block {number + 1}", "exec"), names)
    return names


def test_the_python_for_contributors_is_a_minimiser() -> None:
    names = run(blocks("CONTRIBUTING.md"))
    starts = np.array([[0.5, 0.5], [0.2, 0.9]])
    found = names["settings"].minimiser(lambda at: ((at - [0.3, 0.7]) ** 2).sum(axis=1), starts, 1)
    np.testing.assert_allclose(found.best, [0.3, 0.7], atol=1e-3)
    assert found.cost < 1e-6


@pytest.mark.parametrize("quick", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_the_python_in_the_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], quick: bool
) -> None:
    """Quickly with one law, less depth and a coarse mesh; as it stands in the slow tests."""
    monkeypatch.chdir(tmp_path)
    code = blocks("README.md")
    assert sum(QUICK[0] in block for block in code) == 1
    names = run([block.replace(*QUICK) for block in code] if quick else code)
    assert "reconstructed data" in capsys.readouterr().out
    frame = names["result"].to_frame()
    assert len(frame) == (1 if quick else 3) and (frame["low"] < frame["high"]).all()
    assert (tmp_path / "results" / "identify-3" / "report.txt").is_file()
    assert (names["force"] > 0).all() and (names["slope"] > 0).all()


@pytest.mark.slow
def test_the_notebook_runs(tmp_path: Path) -> None:
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "outputs are left out of git"
    client = NotebookClient(notebook, timeout=600, resources={"metadata": {"path": tmp_path}})
    client.execute()
    shown = [
        output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs
    ]
    pages = [str(output.get("data", {}).get("text/html", "")) for output in shown]
    assert any("reconstructed data" in page and "data:image/png" in page for page in pages)
    assert any("image/png" in output.get("data", {}) for output in shown)
