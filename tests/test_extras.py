"""What `pip install legfem` brings is enough for a leg; each feature beyond it names its extra in one line."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import pytest

from legfem.__main__ import COMMANDS
from legfem.common.command_line import FAILED
from legfem.common.errors import EXTRAS

HERE = Path(__file__).resolve().parent
SUBJECTS = HERE.parent / "legfem" / "resources" / "subjects"
PROJECT = tomllib.loads((HERE.parent / "pyproject.toml").read_text())["project"]


BROUGHT = {"jax": "numpyro", "uvicorn": "nicegui"}
"""Modules that another package brings."""


def names(requirements: list[str]) -> set[str]:
    return {re.split("[>=]", requirement)[0].lower().replace("-", "_") for requirement in requirements}


def run(*commands: str, packages: tuple[str, ...] = ()) -> list[dict[str, Any]]:
    """Return how commands end where only what legfem itself depends on is installed."""
    missing = packages or tuple({module for _, modules in EXTRAS.values() for module in modules})
    line = [sys.executable, HERE / "without_packages.py", ",".join(missing), *commands]
    done = subprocess.run(line, capture_output=True, text=True, check=True)
    return [json.loads(answer) for answer in done.stdout.splitlines()]


def test_legfem_depends_on_few_packages_and_on_none_of_an_extra() -> None:
    assert len(PROJECT["dependencies"]) <= 16
    for extra in EXTRAS:
        assert not names(PROJECT["dependencies"]) & names(PROJECT["optional-dependencies"][extra])


@pytest.mark.parametrize("extra", EXTRAS)
def test_an_extra_brings_the_modules_that_legfem_asks_for_by_its_name(extra: str) -> None:
    modules = {BROUGHT.get(module, module).lower() for module in EXTRAS[extra][1]}
    assert modules == names(PROJECT["optional-dependencies"][extra])


def test_the_extra_all_brings_every_other() -> None:
    (together,) = PROJECT["optional-dependencies"]["all"]
    assert {*EXTRAS, "parquet"} == set(together.partition("[")[2].rstrip("]").split(","))


def test_without_extras_every_command_tells_its_options_and_a_recording_is_read(tmp_path: Path) -> None:
    trial = tmp_path / "trial.csv"
    rows = [f"{t / 10},{t / 10},{max(0.0, t / 10 - 2) ** 1.5 / 5}" for t in range(150)]
    trial.write_text("\n".join(["time_s,displacement_mm,force_N", *rows]))
    look = f"data look '{trial}' --out '{tmp_path / 'look'}'"
    for answer in run(*(f"{name} --help" for name in COMMANDS), look):
        assert answer["status"] == 0, answer["said"]
    assert (tmp_path / "look" / "look.json").is_file()


def assert_one_line(extra: str, answer: dict[str, Any]) -> None:
    assert answer["status"] == FAILED, answer["said"]
    assert f"pip install 'legfem[{extra}]'" in answer["said"]
    assert EXTRAS[extra][0] in answer["said"]
    assert answer["said"].count("\n") == 1, answer["said"]


def test_a_feature_without_its_extra_is_one_line_that_names_it(tmp_path: Path) -> None:
    waveform = tmp_path / "trial.tdms"
    waveform.write_bytes(b"TDSm" + bytes(100))
    out = f"--out '{tmp_path / 'out'}'"
    asked = {
        "app": f"app --workspace '{tmp_path / 'workspace'}' --port 18765",
        "cohort": f"cohort '{SUBJECTS}' {out}",
        "files": f"data look '{waveform}' {out}",
        "imaging": f"stocking --subject 1 --quiet {out}",
        "study": f"study doe {out}",
    }
    for extra, answer in zip(asked, run(*asked.values()), strict=True):
        assert_one_line(extra, answer)
    # A cohort asks for its own extra first.
    on_workers = f"cohort '{SUBJECTS}' --on dask --scheduler tcp://127.0.0.1:1 {out}"
    assert_one_line("cluster", *run(on_workers, packages=EXTRAS["cluster"][1]))
    assert {*asked, "cluster"} == {*EXTRAS}
    (tmp_path / "s.vtp").write_bytes(b"<VTKFile/>")
    given = " ".join(f"--surface {part}='{tmp_path / 's.vtp'}'" for part in ("skin", "muscle_hull", "femur"))
    assert_one_line("imaging", *run(f"geometry {given} --level 1 {out}", packages=("vtk",)))
