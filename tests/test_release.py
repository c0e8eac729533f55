"""What a release is made by: the script's quick parts, the recipe for conda-forge, the images' definitions."""

from __future__ import annotations

import importlib.machinery
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tomllib
from datetime import date
from pathlib import Path
from types import ModuleType

import pytest
from typer.main import get_command

from legfem.__main__ import command
from legfem.common.errors import EXTRAS

ROOT = Path(__file__).resolve().parents[1]
DAY = date(2027, 1, 2)


@pytest.fixture(scope="module")
def release() -> ModuleType:
    loader = importlib.machinery.SourceFileLoader("release", str(ROOT / "scripts" / "release"))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader("release", loader))
    loader.exec_module(module)
    return module


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    (tmp_path / "conda").mkdir()
    for name in ("pyproject.toml", "CHANGELOG.md", "CITATION.cff", "conda/recipe.yaml"):
        shutil.copy(ROOT / name, tmp_path / name)
    text = (tmp_path / "CHANGELOG.md").read_text()
    heading = re.search(r"^## \[.*$", text, re.MULTILINE)
    (tmp_path / "CHANGELOG.md").write_text(text.replace(heading[0], "## [Unreleased]", 1))
    return tmp_path


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_citation_and_codemeta_are_what_the_script_writes(release: ModuleType) -> None:
    cited = (ROOT / "CITATION.cff").read_text()
    day = date.fromisoformat(re.search(r'date-released: "([\d-]+)"', cited)[1])
    assert cited == release.citation(PROJECT, day)
    assert (ROOT / "codemeta.json").read_text(encoding="utf-8") == release.codemeta(PROJECT, day)


def test_a_release_dates_its_heading_and_gives_one_version_everywhere(release: ModuleType, tree: Path) -> None:
    files = release.written(tree, "1.2.3", DAY)
    assert "\n## [1.2.3] - 2027-01-02\n" in files["CHANGELOG.md"]
    assert "Unreleased" not in files["CHANGELOG.md"]
    assert tomllib.loads(files["pyproject.toml"])["project"]["version"] == "1.2.3"
    assert "\nversion: 1.2.3\n" in files["CITATION.cff"] and '"2027-01-02"' in files["CITATION.cff"]
    assert json.loads(files["codemeta.json"])["version"] == "1.2.3"
    assert '\n  version: "1.2.3"\n' in files["conda/recipe.yaml"]
    for name, text in files.items():
        (tree / name).write_text(text, encoding="utf-8")
    assert release.written(tree, "1.2.3", DAY) == files, "a second run changes nothing"
    assert release.told(tree, files) == ""
    with pytest.raises(SystemExit, match="no heading"):
        release.written(tree, "1.2.4", DAY)


def test_placeholders_stand_in_one_file_and_reach_no_document_of_a_release(release: ModuleType) -> None:
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False).stdout.split()
    with_one = [
        name
        for name in tracked or ["pyproject.toml"]
        if (path := ROOT / name).suffix in (".md", ".toml", ".cff", ".json", ".yaml", ".yml", ".def", ".html")
        and "legfem.invalid" in path.read_text(encoding="utf-8", errors="replace")
    ]
    assert with_one == ["pyproject.toml"]
    assert not release.addresses(PROJECT)
    real = PROJECT | {"urls": {"Repository": "https://example.org/legfem"}}
    assert json.loads(release.codemeta(real, DAY))["codeRepository"] == "https://example.org/legfem"
    assert "repository-code: https://example.org/legfem" in release.citation(real, DAY)


@pytest.mark.parametrize("words", [("0.3.0",), ("v0.3",), ("v0.3.0", "--extras", "nosuch")])
def test_what_is_no_tag_or_extra_is_refused_before_anything_is_made(words: tuple[str, ...]) -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "scripts" / "release", *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1 and done.stderr.startswith("release: ") and done.stderr.count("\n") == 1


def test_every_extra_for_users_is_installed_by_a_release(release: ModuleType) -> None:
    assert set(release.EXTRAS) == {"", *PROJECT["optional-dependencies"]} - {"test", "docs", "dev"}
    assert set(EXTRAS) <= set(release.EXTRAS)


# --- conda-forge ---

# What conda-forge calls otherwise than PyPI.
CONDA = {"gmsh": "python-gmsh", "matplotlib": "matplotlib-base", "pydoe3": "pydoe3"}


def recipe_list(text: str, key: str) -> list[str]:
    """Return a list of packages of the recipe, which needs no reader of YAML."""
    block = re.search(rf"^( *){key}:\n((?:\1  .*\n|\n)+)", text, re.MULTILINE)
    return re.findall(r"^ +- (?:if: .*|)([a-z][\w-]*)", block[2], re.MULTILINE)


def test_what_a_release_asks_of_its_solver_is_a_command(release: ModuleType) -> None:
    name, *words = release.SOLVED
    get_command(command(name)).make_context("legfem", words)


def test_the_recipe_has_what_legfem_depends_on_and_its_version() -> None:
    text = (ROOT / "conda" / "recipe.yaml").read_text()
    assert f'version: "{PROJECT["version"]}"' in text
    run = set(recipe_list(text, "run"))
    wanted = {re.split(r"[><=~ ]", one)[0].lower() for one in PROJECT["dependencies"]}
    assert {CONDA.get(one, one) for one in wanted} | {"python", "fenics-dolfinx", "petsc4py", "petsc"} == run
    for name, bound in re.findall(r"^ +- ([\w-]+) (>=[\d.]+)$", text, re.MULTILINE):
        stated = {re.split(r"(?=>=)", one)[0]: one for one in PROJECT["dependencies"] if ">=" in one}
        if name in stated:
            assert stated[name].endswith(bound)
    assert f"license: {PROJECT['license']}" in text


# --- images ---


def test_the_apptainer_image_is_made_from_the_dockers() -> None:
    definition = (ROOT / "scripts" / "legfem.def").read_text()
    docker = (ROOT / "Dockerfile").read_text()
    assert "Bootstrap: docker-daemon" in definition and "From: legfem:latest" in definition
    assert "docker build -t legfem ." in docker and "docker build -t legfem ." in definition
    (entry,) = re.findall(r'ENTRYPOINT \["(.*)"\]', docker)
    assert f'exec {entry} "$@"' in definition
    page = (ROOT / "docs" / "tutorials" / "cluster.md").read_text()
    assert "apptainer build legfem.sif scripts/legfem.def" in page


@pytest.mark.slow
def test_the_image_is_built_and_identifies_a_leg(tmp_path: Path) -> None:
    engine = next((name for name in ("docker", "podman") if running(name)), None)
    if engine is None:
        pytest.skip("neither docker nor podman runs here")
    subprocess.run([engine, "build", "-t", "legfem", ROOT], check=True)
    words = ["python", "-m", "legfem", "identify", "--subject", "3", "--law", "neo-hookean", "--out", "/data/out"]
    subprocess.run([engine, "run", "--rm", "-v", f"{tmp_path}:/data", "legfem", *words], check=True)
    assert "neo-hookean" in json.loads((tmp_path / "out" / "result.json").read_text())["laws"]


def running(engine: str) -> bool:
    return shutil.which(engine) is not None and subprocess.run([engine, "info"], capture_output=True).returncode == 0
