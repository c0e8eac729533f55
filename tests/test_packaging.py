"""The lists in scripts/ feed in-env and the Dockerfile; the other files have to agree with them."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

# What a Debian package is called on conda-forge, where that isn't its name without "python3-".
CONDA = {
    "python3-dolfinx-real": "fenics-dolfinx",
    "python3-petsc4py-real": "petsc4py",
    "python3-gmsh": "python-gmsh",
    "python3-matplotlib": "matplotlib-base",
    "openmpi-bin": "openmpi",
    "libopenblas0-serial": "libblas",
    "gcc": "c-compiler",
}
# On conda python and c-compiler bring the former; the latter asks for PETSc with real numbers.
NOT_ON_CONDA = {"python3-venv", "libc6-dev"}
ONLY_ON_CONDA = {"python", "petsc"}

# Not what legfem imports: the tools around it, and DOLFINx, which PyPI doesn't have.
NOT_RUNTIME = {"python3-dolfinx-real", "python3-pytest", "python3-venv", "python3-pip"}


def listed(name: str) -> list[str]:
    lines = (ROOT / "scripts" / name).read_text().splitlines()
    return [line for line in (line.split("#")[0].strip() for line in lines) if line]


def bare(requirement: str) -> str:
    return re.split(r"[\[<>=!~ ;]", requirement, maxsplit=1)[0].lower()


def pypi_name(debian: str) -> str:
    return debian.removeprefix("python3-").removesuffix("-real")


DEBIAN = listed("packages-debian.txt")
PYPI = listed("packages-pypi.txt")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def conda_packages() -> list[str]:
    text = (ROOT / "environment.yml").read_text()
    return re.findall(r"^  - (\S+)$", text.split("dependencies:")[1], flags=re.MULTILINE)


def test_lists_name_a_package_once() -> None:
    for packages in (DEBIAN, PYPI, conda_packages()):
        names = [bare(package) for package in packages]
        assert len(names) == len(set(names))


def test_conda_has_the_same_packages() -> None:
    wanted = {CONDA.get(p, p.removeprefix("python3-")) for p in DEBIAN if p not in NOT_ON_CONDA}
    wanted |= {bare(p) for p in PYPI} | ONLY_ON_CONDA
    assert {bare(package) for package in conda_packages()} == wanted


def test_pyproject_depends_on_the_same_packages() -> None:
    extras = {bare(p) for name in ("test", "dev") for p in PROJECT["optional-dependencies"][name]}
    extras -= {"legfem"}
    from_pypi = {bare(p) for p in PYPI}
    runtime = {pypi_name(p) for p in DEBIAN if p.startswith("python3-") and p not in NOT_RUNTIME}
    assert {bare(p) for p in PROJECT["dependencies"]} == runtime | (from_pypi - extras)
    assert extras == (from_pypi & extras) | {"pytest"}


def test_versions_required_agree() -> None:
    bounds: dict[str, set[str]] = {}
    for package in [*PYPI, *PROJECT["dependencies"], *conda_packages()]:
        bound = package[len(bare(package)) :]
        if bound.startswith(">="):
            bounds.setdefault(bare(package), set()).add(bound)
    assert bounds["pygad"] == {">=3.3"}
    assert {name for name, found in bounds.items() if len(found) > 1} == set()
    assert PROJECT["requires-python"] in bounds["python"]


def test_dockerfile_installs_from_the_lists() -> None:
    text = (ROOT / "Dockerfile").read_text()
    assert "FROM debian:trixie" in text
    for name in ("packages-debian.txt", "packages-pypi.txt", "in-env"):
        assert re.search(rf"^COPY .*scripts/{name}", text, flags=re.MULTILINE)
    assert not [package for package in DEBIAN if re.search(rf"\bpython3-\w|\b{package}\b", text)]


def test_versions_of_the_release_agree() -> None:
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {PROJECT['version']}\n" in citation
    assert f"license: {PROJECT['license']['text']}\n" in citation


def in_env(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    path = "/usr/bin:/bin"
    return subprocess.run(
        [ROOT / "scripts" / "in-env", *arguments],
        env={"PATH": path, "HOME": "/nonexistent", **variables},
        capture_output=True,
        text=True,
        check=False,
    )


def test_in_env_without_a_command_prints_its_usage() -> None:
    run = in_env()
    assert run.returncode == 2
    assert run.stdout.startswith("usage: scripts/in-env CMD")


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ({"LEGFEM_ROUTE": "snap"}, "LEGFEM_ROUTE=snap: no such route"),
        ({"LEGFEM_PYTHON": "/nonexistent"}, "/nonexistent does not import dolfinx"),
        ({"LEGFEM_ROUTE": "conda"}, "no micromamba, mamba or conda on PATH"),
        ({"LEGFEM_SUITE": "sid", "LEGFEM_CACHE": "/proc/nowhere"}, "cannot write to /proc/nowhere"),
    ],
)
def test_in_env_says_in_a_line_why_not(variables: dict[str, str], message: str) -> None:
    if any(shutil.which(name, path="/usr/bin:/bin") for name in ("conda", "mamba", "micromamba")):
        pytest.skip("conda is in /usr/bin")
    run = in_env("true", **variables)
    assert run.returncode == 2
    assert message in run.stderr
    assert run.stderr.count("\n") == 1
