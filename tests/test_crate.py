"""A folder of results is an RO-Crate: a reader of such crates finds what was given, the run, and every file."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from making import write_subject
from making_diagnosed import diagnosed
from making_identification import identify, pressed_leg
from rocrate.rocrate import ROCrate
from test_diagnosis_report import CASES

from legfem.legs.loading import load_subject
from legfem.report.render import CRATE
from legfem.report.results import write_diagnosis_report, write_report

COMMAND = "legfem identify --subject-dir 'a leg' --seed 1"


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A leg's folder, with its lab's file two folders above and earlier results within."""
    folder = write_subject(tmp_path_factory.mktemp("lab") / "study" / "leg")
    (folder.parents[1] / "lab.toml").write_text("[accuracy]\naim_sd_mm = 1.0\n")
    (folder / "results").mkdir()
    (folder / "results" / CRATE).write_text("{}")
    (folder / "results" / "fit.png").write_bytes(b"earlier")
    (folder / ".git").mkdir()
    (folder / ".git" / "config").write_text("nothing of the leg's")
    return folder


@pytest.fixture(scope="module")
def written(given: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    scratch = tmp_path_factory.mktemp("results")
    fits = identify(pressed_leg(given, 0.7, 0.8))
    write_report(fits, scratch / "out", COMMAND)
    return scratch / "out"


def entities(crate: ROCrate, kind: str) -> dict[str, Any]:
    return {one["name"]: one for one in crate.get_by_type(kind)}


def test_a_reader_of_crates_finds_every_file_and_folder(written: Path) -> None:
    crate = ROCrate(written)
    here = {one.id.rstrip("/") for one in crate.data_entities if not one.id.startswith("urn:")}
    assert here == {path.name for path in written.iterdir() if not path.name.startswith(".")} - {CRATE}
    assert all(one.get("description") for one in crate.data_entities if not one.id.startswith("urn:"))
    assert crate.root_dataset["datePublished"] and crate.license and crate.name and crate.description
    assert all(crate.dereference(one.id) is one for one in crate.root_dataset["hasPart"])


def test_the_run_has_its_command_versions_seed_and_machine(written: Path) -> None:
    crate = ROCrate(written)
    (run,) = crate.get_by_type("CreateAction")
    assert run["name"] == COMMAND
    versions = json.loads((written / "result.json").read_text())["versions"]
    assert {one["name"]: one["version"] for one in run["instrument"]} == versions
    numbers = {one["name"]: one["value"] for one in run["object"] if one.type == "PropertyValue"}
    assert numbers["seed"] == "1" and "processors" in numbers["machine"]
    assert {one.id for one in run["result"]} == {one.id for one in crate.data_entities if not one.id.startswith("urn:")}
    assert crate.root_dataset["mentions"] is run or crate.root_dataset["mentions"] == [run]


def test_what_was_given_is_known_by_its_content_and_tells_nobodys_folders(given: Path, written: Path) -> None:
    crate = ROCrate(written)
    (run,) = crate.get_by_type("CreateAction")
    files = {one["name"]: one["sha256"] for one in run["object"] if one.type == "File"}
    wanted = [path for path in given.rglob("*") if path.is_file() and not {"results", ".git"} & set(path.parts)]
    hashes = {path.relative_to(given).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in wanted}
    lab = given.parents[1] / "lab.toml"
    assert files == {**hashes, "lab.toml": hashlib.sha256(lab.read_bytes()).hexdigest()}
    assert {"subject.toml", "contours.csv"} <= set(files)
    assert str(given.parent) not in (written / CRATE).read_text()


def test_results_in_the_given_folder_are_no_input_of_their_own(given: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(given, tmp_path / "leg"))
    fits = identify(pressed_leg(folder, 0.7, 0.8))
    names = []
    for _ in range(2):
        write_report(fits, folder / "out", COMMAND)
        (run,) = ROCrate(folder / "out").get_by_type("CreateAction")
        names.append([one["name"] for one in run["object"] if one.type == "File"])
    assert names[0] == names[1] and not any(name.startswith("out") for name in names[0])


def test_a_diagnosis_is_one_too(given: Path, tmp_path: Path) -> None:
    effects, bump, asked = CASES["consistent"]
    found = diagnosed(effects, bump=bump, asked=asked)
    write_diagnosis_report(found, load_subject(given, need_recordings=False), tmp_path / "out")
    (tmp_path / "out" / "diagnosis.json").write_text("{}")  # the front door's
    crate = ROCrate(tmp_path / "out")
    (run,) = crate.get_by_type("CreateAction")
    assert run["name"] == "a call from Python"
    assert entities(crate, "PropertyValue")["seed"]["value"] == str(found.seed)
    assert "subject.toml" in entities(crate, "File") and "report.html" in entities(crate, "File")
