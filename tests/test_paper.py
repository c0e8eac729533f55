"""The draft of a paper takes its numbers from the pages, all of them, and ends its build when a page has changed."""

from __future__ import annotations

import importlib.util
import re
import shutil
import sys
import tomllib
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAPER = ROOT / "docs" / "paper"
TEXT = "\n".join(line for line in (PAPER / "paper.typ").read_text("utf-8").splitlines() if not line.startswith("//"))


def module(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"paper_{name}", PAPER / f"{name}.py")
    assert spec is not None and spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = loaded
    spec.loader.exec_module(loaded)
    return loaded


build = module("build")
WANTED = tomllib.loads((PAPER / "evidence.toml").read_text("utf-8"))


@pytest.fixture(scope="module")
def found() -> dict[str, Any]:
    return build.evidence()


@pytest.fixture
def pages(tmp_path: Path) -> Path:
    """Copies of all files that the paper takes something from."""
    for file in {one["file"] for kind in WANTED.values() for one in kind.values()}:
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, tmp_path / file)
    return tmp_path


def test_every_number_that_the_text_asks_for_is_on_a_page(found: dict[str, Any]) -> None:
    """By the rules of layout.typ: a row by its number or by how it begins, and then it is the only one."""
    cells = re.findall(r'#num\("(\w+)", ("[^"]*"|\d+), "([^"]*)"(?:, ("of"|\d+))?\)', TEXT)
    groups = re.findall(r'#(?:told|low)\("(\w+)", (\d+)\)', TEXT)
    assert (len(cells), len(groups)) == (TEXT.count("#num("), TEXT.count("#told(") + TEXT.count("#low("))
    for table, row, column, part in cells:
        one = found["tables"][table]
        rows = one["rows"][int(row) :][:1] if row.isdigit() else [r for r in one["rows"] if r[0].startswith(row[1:-1])]
        assert len(rows) == 1, (table, row)
        counted = re.fullmatch(r"(?:of (\d+): )?(.*)", rows[0][one["header"].index(column)])
        assert counted is not None
        told = counted[1] if part == '"of"' else counted[2].split(", ")[int(part or 0)]
        assert told and re.search(r"\d", told), (table, row, column, part)
    studies = re.findall(r'^ +\("([^"]+)", "(?:simulated|reconstructed|real)"\),$', TEXT, re.M)
    assert len(studies) > 5
    for study in studies:
        assert sum(r[0].startswith(study) for r in found["tables"]["evidence"]["rows"]) == 1, study
    for phrase, group in groups:
        assert found["phrases"][phrase][int(group)], phrase


def test_nothing_is_taken_that_the_text_does_not_say(found: dict[str, Any]) -> None:
    said = TEXT + (PAPER / "layout.typ").read_text("utf-8") + (PAPER / "figures.py").read_text("utf-8")
    for name in (*found["tables"], *found["phrases"]):
        assert re.search(rf'"{name}"|tables\.{name}\b', said), name


def prose(text: str) -> str:
    """Return the text without code, strings and equations, and of figures their captions."""
    text = re.sub(r'"[^"\n]*"|\$[^$]*\$', "", text)
    text = re.sub(r"^#figure\(.*?^  caption: \[(.*?)\],$.*?^\) <[\w-]+>", r"\1", text, flags=re.M | re.S)
    return re.sub(r"#(?:num|told|low)\([^()]*\)|^#(?:let|import) .*$|[@<][\w-]+>?", "", text, flags=re.M)


def test_no_number_stands_in_the_text_by_hand() -> None:
    assert re.findall(r"\d+", prose('It is 3.5~%.\n#told("x", 0) of $x^2$')) == ["3", "5"]
    left = re.sub(r"\bC10\b|\bC20\b|\b3D\b|\b95~%", "", prose(TEXT))
    assert re.findall(r".{0,30}\d.{0,30}", left) == []


def test_typst_swallows_no_semicolon() -> None:
    """It ends code in a text: after a number it has to be escaped."""
    assert not re.findall(r"#(?:num|told|low)\([^()]*\);", TEXT)


def changed(pages: Path, file: str, old: str, new: str) -> None:
    text = (pages / file).read_text("utf-8")
    assert old in text
    (pages / file).write_text(text.replace(old, new), "utf-8")


@pytest.mark.parametrize(
    ("file", "old", "new", "says"),
    [
        ("studies/cases/sealed.md", "| kind | n | named first |", "| kind | cases | named first |", "no table"),
        ("studies/cases/sealed.md", "## Forty, not confirmed", "## By today's code", "no heading"),
        ("studies/people/README.md", "| calf | 25.2 |", "| calf |", "cells"),
        ("docs/theory/diagnosis.md", "with a power of 0.5", "with the power 0.5", "power stands there 0 times"),
    ],
)
def test_a_page_that_has_changed_ends_the_build(pages: Path, file: str, old: str, new: str, says: str) -> None:
    changed(pages, file, old, new)
    with pytest.raises(build.MovedError, match=says) as raised:
        build.evidence(pages)
    assert file in str(raised.value)


def test_a_new_count_on_a_page_is_the_papers(pages: Path, found: dict[str, Any]) -> None:
    changed(pages, "studies/cases/sealed.md", "| 40, 39, 38 |", "| 40, 38, 37 |")
    rows = build.evidence(pages)["tables"]["confirmed"]["rows"]
    assert rows[-1][6] == "40, 38, 37" and found["tables"]["confirmed"]["rows"][-1][6] == "40, 39, 38"


def test_the_table_of_mechanisms_has_as_many_as_the_text_says(found: dict[str, Any]) -> None:
    assert found["phrases"]["mechanisms"] == ["twenty-three"] and len(found["mechanisms"]) == 23


def test_the_picture_of_sealed_cases_has_the_tables_counts(found: dict[str, Any]) -> None:
    """Two files of one run."""
    from studies.cases.sealed_picture import COUNTED, read_counted

    counted = {(one.kind, one.channels): one.held.count for one in read_counted(COUNTED)}
    rows = {row[0]: row[6] for row in found["tables"]["confirmed"]["rows"]}
    for kind, title in {"none": "nothing", "single": "one effect", "pair": "two effects"}.items():
        assert rows[title] == ", ".join(str(counted[kind, one]) for one in ("force alone", "all", "all, holds"))


def test_references_are_those_that_are_cited() -> None:
    given = set(re.findall(r"^(\w+):", (PAPER / "references.yml").read_text("utf-8"), re.M))
    labels = set(re.findall(r"<([\w-]+)>", TEXT))
    assert set(re.findall(r"@([\w-]+)", TEXT)) - labels == given


def test_figures_are_drawn_and_say_what_they_are_of(found: dict[str, Any], tmp_path: Path) -> None:
    module("figures").draw_all(tmp_path, found)
    drawn = {path.stem: path.read_text("utf-8") for path in tmp_path.glob("*.svg")}
    assert {f"_build/{name}.svg" for name in drawn} == set(re.findall(r'image\("([^"]*)"', TEXT))
    assert "simulated data" in drawn["sealed"] and "Kennedy" in drawn["peers"] and "thigh, back" in drawn["people"]
    captions = re.findall(r"^  caption: \[(.*?)\],$", TEXT, re.M | re.S)
    data = re.compile(r"simulated|reconstructed|real\b|the software words", re.I)
    tables_of_origins = [one for one in captions if not data.search(one)]
    assert len(tables_of_origins) == 1 and tables_of_origins[0].startswith("Other studies"), tables_of_origins


def test_the_paper_is_a_pdf_of_six_pages(tmp_path: Path) -> None:
    typst = pytest.importorskip("typst", reason="only where make docs' packages are")
    build.main()
    assert (build.BUILT / "paper.pdf").read_bytes().startswith(b"%PDF")
    typst.compile(PAPER / "paper.typ", output=tmp_path / "{p}.png", root=ROOT, format="png", ppi=20)
    assert len(list(tmp_path.glob("*.png"))) == 6
