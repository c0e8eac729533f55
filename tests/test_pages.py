"""What the pages say is there: commands, options, files, links; their Python and notebooks run."""

from __future__ import annotations

import importlib
import json
import re
import runpy
import shutil
import tomllib
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import nbformat
import numpy as np
import pytest
import typer
from nbclient import NotebookClient

from legfem.common.errors import InputError
from legfem.specimens.schema import parse_specimen_file
from legfem.stockings.schema import parse_leg_file

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
SOURCES = ("README.md", "CONTRIBUTING.md", "docs/**/*.md", "studies/*/*.md", "meshes/*.md")
MADE = re.compile(r"docs/(_build|gallery)\b")
PAGES = {
    str(path.relative_to(ROOT)): path.read_text(encoding="utf-8")
    for pattern in SOURCES
    for path in sorted(ROOT.glob(pattern))
    if not MADE.search(str(path.relative_to(ROOT)))
}
QUICK = ('law="both"', 'law="neo-hookean", mesh="coarse", depth=10.0')
of_every_page = pytest.mark.parametrize("page", PAGES)


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGES[page], re.M | re.S)


# --- commands and options ---


@cache
def command(module: str) -> Any:
    """Return what ``python -m module`` starts."""
    spec = find_spec(module)
    assert spec is not None, f"there is no module {module}"
    package = spec.submodule_search_locations is not None
    return typer.main.get_command(importlib.import_module(f"{module}.__main__" if package else module).app)


def options(of: Any) -> set[str]:
    own = {name for one in of.params for name in (*one.opts, *one.secondary_opts)} | {"--help"}
    return own.union(*map(options, getattr(of, "commands", {}).values()))


def chosen(module: str, words: str) -> Iterator[Any]:
    """Yield what a line calls: the subcommands it names, or the command itself."""
    whole = command(module)
    first = re.match(r"\s+([a-z]+(?:\\?\|[a-z]+)*)", words)
    if not hasattr(whole, "commands") or first is None:
        yield whole
        return
    for name in re.split(r"\\?\|", first[1]):
        assert name in whole.commands, f"{module} has no {name}"
        yield whole.commands[name]


def calls(page: str) -> list[tuple[str, str]]:
    text = re.sub(r"\\\n\s*", " ", PAGES[page])
    long = re.findall(r"python -m (studies(?:\.[a-z]\w*)+)([^`\n]*)", text)
    names = "|".join(path.parent.name for path in ROOT.glob("legfem/*/__main__.py"))
    short = re.findall(rf"(?:(?:in-env |mpirun -n \d+ |`)legfem ([a-z]+)|^legfem ({names}))\b([^`\n]*)", text, re.M)
    short = [(inside or alone, words) for inside, alone, words in short]
    return [*long, *((f"legfem.{name}", words) for name, words in short)]


@of_every_page
def test_commands_and_their_options_exist(page: str) -> None:
    for module, words in calls(page):
        called = list(chosen(module, words))
        for option in re.findall(r"(?<![\w-])--[a-z][\w-]*", words):
            assert all(option in options(one) for one in called), f"{module}{words}: {option}"


def test_commands_are_found_in_the_pages() -> None:
    assert sum(len(calls(page)) for page in PAGES) > 60
    with pytest.raises(AssertionError, match="has no nosuch"):
        list(chosen("legfem.study", " nosuch"))


@of_every_page
def test_options_named_by_themselves_are_a_commands(page: str) -> None:
    modules = {module for every in PAGES for module, _ in calls(every)}
    known = {"--strict", "-W"}.union(*(options(command(module)) for module in modules))
    named = {option for option in re.findall(r"`(--[a-z][\w-]*)", PAGES[page])}
    assert named <= known | {"--version"}, named - known


@of_every_page
def test_targets_of_make_exist(page: str) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.M))
    named = re.findall(r"(?:`|^)make ([a-z-]+)", PAGES[page], re.M)
    assert set(named) <= targets


def test_the_readme_has_the_two_commands_and_fits_a_screen() -> None:
    readme = PAGES["README.md"]
    assert re.findall(r"^make ([a-z]+)", readme, re.M) == ["demo", "test"]
    assert len(readme.splitlines()) <= 60


# --- files and links ---


@of_every_page
def test_files_that_are_named_exist(page: str) -> None:
    rooms = "legfem|studies|scripts|tests|examples|meshes"
    named = re.findall(rf"`(?:pytest [^`]*?)?((?:{rooms})/[\w./-]*\w)[/:` ]", PAGES[page])
    missing = [name for name in named if not (ROOT / name.rstrip("/")).exists()]
    assert not missing


@of_every_page
def test_links_lead_somewhere(page: str) -> None:
    folder = (ROOT / page).parent
    targets = re.findall(r"\]\((?!https?:|#)([^)#\s]+)", PAGES[page])
    assert not [target for target in targets if not (folder / target).exists()]


# --- what can be run ---


def run(page: str, code: list[str]) -> dict[str, Any]:
    names: dict[str, Any] = {}
    for number, block in enumerate(code):
        exec(compile(block, f"{page}, block {number + 1}", "exec"), names)
    return names


def test_all_python_in_pages_is_run_here() -> None:
    with_python = {page for page in PAGES if blocks(page, "python")}
    assert with_python == {"docs/python.md", "docs/extending.md", DIAGNOSED}


def test_the_python_for_contributors_is_a_minimiser() -> None:
    names = run("docs/extending.md", blocks("docs/extending.md", "python"))
    starts = np.array([[0.5, 0.5], [0.2, 0.9]])
    found = names["settings"].minimiser(lambda at: ((at - [0.3, 0.7]) ** 2).sum(axis=1), starts, 1)
    np.testing.assert_allclose(found.best, [0.3, 0.7], atol=1e-3)
    assert found.cost < 1e-6


@pytest.mark.parametrize("quick", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_the_python_of_the_front_door_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], quick: bool
) -> None:
    """Quickly with one law, less depth and a coarse mesh; as it stands in the slow tests."""
    monkeypatch.chdir(tmp_path)
    code = blocks("docs/python.md", "python")
    assert sum(QUICK[0] in block for block in code) == 1
    names = run("docs/python.md", [block.replace(*QUICK) for block in code] if quick else code)
    assert "RECONSTRUCTED DATA" in capsys.readouterr().out
    frame = names["result"].to_frame()
    assert len(frame) == (1 if quick else 3) and (frame["low"] < frame["high"]).all()
    assert (tmp_path / "results" / "identify-3" / "report.txt").is_file()
    assert (names["force"] > 0).all() and (names["slope"] > 0).all()


DIAGNOSED = "docs/tutorials/reading-a-diagnosis.md"


def test_the_leg_of_the_diagnosis_that_is_read_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import legfem as lf

    monkeypatch.chdir(tmp_path)
    run(DIAGNOSED, blocks(DIAGNOSED, "python"))
    made, given = lf.load_subject(tmp_path / "results" / "warming-up"), lf.load_subject("3")
    for one, other in zip(made.recordings, given.recordings, strict=True):
        np.testing.assert_allclose(one.force - other.force, 0.008 * other.time, atol=1e-9)
    assert made.origin == "simulated"


@pytest.mark.parametrize(
    ("page", "parse"),
    [("docs/tutorials/own-specimen.md", parse_specimen_file), ("docs/tutorials/stocking.md", parse_leg_file)],
)
def test_files_that_are_shown_are_read(page: str, parse: Any, tmp_path: Path) -> None:
    shown, *_ = blocks(page, "toml")
    path = tmp_path / "shown.toml"
    path.write_text(shown, encoding="utf-8")
    assert parse(path).id == tomllib.loads(shown)["id"]
    path.write_text(shown.replace("origin", "orgin"), encoding="utf-8")
    with pytest.raises(InputError, match="orgin"):
        parse(path)


def test_layers_fibres_and_a_cup_that_are_shown_are_read(tmp_path: Path) -> None:
    """As parts of the file that is shown whole."""
    whole, several = blocks("docs/tutorials/own-specimen.md", "toml")
    layers, fibres, cup, face, twisted, tables = blocks("docs/tutorials/kinds-of-specimens.md", "toml")
    named, ball = whole[: whole.index("[ball]")], whole[: whole.index("[[specimen]]")]
    path = tmp_path / "shown.toml"
    path.write_text(ball + layers, encoding="utf-8")
    assert [one.name for one in parse_specimen_file(path).layers] == ["fat", "muscle"]
    path.write_text(ball + layers + fibres.replace("ratio", 'layer = "muscle"\nratio'))
    read = parse_specimen_file(path)
    assert read.fibres is not None and read.fibres.direction == "load"
    assert read.specimen[0].fibres == "across"
    path.write_text(named + cup, encoding="utf-8")
    given = parse_specimen_file(path).suction
    assert given is not None and given.opening_mm == 10.0
    path.write_text(ball + face, encoding="utf-8")
    assert parse_specimen_file(path).channels.face_strain.file == "face-{trial}.csv"
    path.write_text(named + twisted, encoding="utf-8")
    assert parse_specimen_file(path).torsion.height_mm == 6.0
    path.write_text(named + tables, encoding="utf-8")
    assert parse_specimen_file(path).equibiaxial is not None
    path.write_text(several)
    assert parse_specimen_file(path).tests == ["tension", "compression", "shear"]


SOLVE_NOTHING = ("ends_of_the_cylinder.py", "laws_of_soft_tissue.py", "recording_in_parts.py", "section_of_a_leg.py")


@pytest.mark.parametrize(
    "script",
    [
        pytest.param(name, marks=() if name in SOLVE_NOTHING else pytest.mark.slow)
        for name in sorted(path.name for path in EXAMPLES.glob("*.py"))
    ],
)
def test_an_example_of_the_gallery_runs_and_draws(script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """`make docs` runs them too, and keeps the pictures."""
    shutil.copytree(EXAMPLES / "specimen", tmp_path / "specimen")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", lambda: None)
    plt.close("all")
    runpy.run_path(str(EXAMPLES / script))
    assert plt.get_fignums()
    plt.close("all")


def test_the_gallery_has_thirteen_examples() -> None:
    assert len(list(EXAMPLES.glob("*.py"))) == 13


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "data"), [("first_steps", "reconstructed data"), ("specimen_step_by_step", "simulated data")]
)
def test_the_notebook_runs(name: str, data: str, tmp_path: Path) -> None:
    notebook = nbformat.read(EXAMPLES / f"{name}.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "outputs are left out of git"
    shutil.copytree(EXAMPLES / "specimen", tmp_path / "specimen")
    client = NotebookClient(notebook, timeout=600, resources={"metadata": {"path": tmp_path}})
    client.execute()
    shown = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    pages = [str(output.get("data", {}).get("text/html", "")) for output in shown]
    assert any(data in page and "data-plot=&quot;" in page for page in pages)


@pytest.mark.slow
def test_the_lesson_shows_what_it_says_and_is_slides_too(tmp_path: Path) -> None:
    """Hertz finds the thin gel some half stiffer than it is; with its base in the model all three are the same gel."""
    lesson = nbformat.read(EXAMPLES / "lesson_gel_thickness.ipynb", as_version=4)
    assert not any(cell.get("outputs") for cell in lesson.cells), "outputs are left out of git"
    kinds = [cell.metadata.get("slideshow", {}).get("slide_type") for cell in lesson.cells]
    assert kinds.count("slide") >= 6 and kinds[0] == "slide"
    said = "import json; print(json.dumps([truth, {f'{h:g}': [moduli[h], found[h]] for h in found}]))"
    lesson.cells.append(nbformat.v4.new_code_cell(said))
    NotebookClient(lesson, timeout=600, resources={"metadata": {"path": tmp_path}}).execute()
    truth, moduli = json.loads(lesson.cells[-1].outputs[0].text)
    assert moduli["40"][0] == pytest.approx(truth, rel=0.06)
    assert moduli["4"][0] > 1.4 * truth and moduli["4"][0] > moduli["8"][0] > moduli["40"][0]
    for _, with_its_base in moduli.values():
        assert with_its_base == pytest.approx(truth, rel=0.04)
