"""The lists in scripts/ feed in-env and the Dockerfile; the other files have to agree with them."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import dolfinx
import petsc4py
import pytest

from legfem.common.documents import package_version
from legfem.common.errors import EXTRAS

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
# On conda python and c-compiler bring the first two, and there is neither Chromium nor Slurm: what needs one is
# skipped. PETSc is asked for with real numbers.
NOT_ON_CONDA = {"python3-venv", "libc6-dev", "chromium-headless-shell", "slurm-wlm", "munge"}
ONLY_ON_CONDA = {"python", "petsc"}

# Not what legfem imports: the tools around it; and DOLFINx with its petsc4py, which PyPI has as another's wheel alone.
NOT_RUNTIME = {"python3-dolfinx-real", "python3-petsc4py-real", "python3-pytest", "python3-venv", "python3-pip"}


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
    return re.findall(r"^ +- ([^\s:]+)$", text.split("dependencies:")[1], flags=re.MULTILINE)


def test_lists_name_a_package_once() -> None:
    for packages in (DEBIAN, PYPI, conda_packages()):
        names = [bare(package) for package in packages]
        assert len(names) == len(set(names))


def test_conda_has_the_same_packages() -> None:
    wanted = {CONDA.get(p, p.removeprefix("python3-")) for p in DEBIAN if p not in NOT_ON_CONDA}
    wanted |= {bare(p) for p in PYPI} | ONLY_ON_CONDA
    assert {bare(package) for package in conda_packages()} == wanted


def test_pyproject_depends_on_the_same_packages() -> None:
    extras = {name: {bare(p) for p in packages} for name, packages in PROJECT["optional-dependencies"].items()}
    tools = (extras["test"] | extras["dev"]) - {"legfem"}
    from_pypi = {bare(p) for p in PYPI}
    runtime = {pypi_name(p) for p in DEBIAN if p.startswith("python3-") and p not in NOT_RUNTIME}
    features = set().union(*(extras[name] for name in EXTRAS))
    assert {bare(p) for p in PROJECT["dependencies"]} | features == runtime | (from_pypi - tools)
    assert tools == (from_pypi & tools) | {"pytest"}


def test_versions_required_agree() -> None:
    bounds: dict[str, set[str]] = {}
    extras = [package for name in EXTRAS for package in PROJECT["optional-dependencies"][name]]
    for package in [*PYPI, *PROJECT["dependencies"], *extras, *conda_packages()]:
        bound = package[len(bare(package)) :]
        if bound.startswith(">="):
            bounds.setdefault(bare(package), set()).add(bound)
    assert bounds["pygad"] == {">=3.3"}
    assert {name for name, found in bounds.items() if len(found) > 1} == set()
    assert PROJECT["requires-python"] in bounds["python"]


def test_dockerfile_installs_from_the_lists() -> None:
    text = (ROOT / "Dockerfile").read_text()
    assert "FROM debian:trixie" in text
    for name in ("packages-debian.txt", "packages-pypi.txt", "packages-pypi.lock", "in-env"):
        assert re.search(rf"^COPY .*scripts/{name}", text, flags=re.MULTILINE)
    assert not [package for package in DEBIAN if re.search(rf"\bpython3-\w|\b{package}\b", text)]


def test_versions_of_the_release_agree() -> None:
    citation = (ROOT / "CITATION.cff").read_text()
    assert f"\nversion: {PROJECT['version']}\n" in citation
    assert f"license: {PROJECT['license']}\n" in citation


def locked(name: str) -> dict[str, str]:
    """Return the version of every package of a lock, each of which has hashes."""
    text = (ROOT / "scripts" / name).read_text()
    versions = {}
    for entry in re.split(r"\n(?=\S)", text.split("\n", maxsplit=1)[1].strip()):
        package, version = re.match(r"([\w.-]+)==([\w.]+)", entry).groups()
        versions[package.lower().replace("_", "-")] = version
        assert len(re.findall(r"--hash=sha256:[0-9a-f]{64}\b", entry)) >= 1, package
    return versions


def test_the_lock_of_the_wheel_route_has_every_package_with_a_version_and_hashes() -> None:
    versions = locked("packages-wheel.lock")
    assert versions["dolfinx-solver-real"].startswith("0.11.")
    wanted = {pypi_name(p) for p in DEBIAN if p.startswith("python3-") and p not in NOT_RUNTIME}
    wanted |= {bare(p) for p in PYPI} | {"pytest", "setuptools"}
    assert wanted <= set(versions)


def test_the_lock_beside_debian_has_every_package_of_the_list_and_leaves_what_is_compiled() -> None:
    versions = locked("packages-pypi.lock")
    assert {bare(p) for p in PYPI} <= set(versions)
    assert not {"dolfinx-solver-real", "numpy", "scipy", "matplotlib", "petsc4py"} & set(versions)


def test_the_lock_of_the_docs_has_them_and_no_dolfinx_of_its_own() -> None:
    versions = locked("packages-docs.lock")
    assert {bare(p) for p in PROJECT["optional-dependencies"]["docs"]} <= set(versions)
    assert not {"dolfinx-solver-real", "numpy", "matplotlib", "petsc4py"} & set(versions)


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
        ({"LEGFEM_ROUTE": "wheel", "LEGFEM_PYTHON": "nope"}, "wheel cannot be used: no python3"),
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


def test_in_env_runs_nothing_from_a_cache_that_anyone_can_write_to(tmp_path: Path) -> None:
    cache = tmp_path / "cache"
    cache.mkdir()
    cache.chmod(0o777)
    run = in_env("true", LEGFEM_CACHE=str(cache), LEGFEM_PYTHON="/nonexistent")
    assert run.returncode == 2
    assert f"anyone can write to {cache}" in run.stderr
    assert run.stderr.count("\n") == 1
    cache.chmod(0o755)
    run = in_env("true", LEGFEM_CACHE=str(cache), LEGFEM_PYTHON="/nonexistent")
    assert "anyone" not in run.stderr


@pytest.mark.skipif("LEGFEM_INSIDE" not in os.environ, reason="not under scripts/in-env")
def test_in_env_does_not_execute_modules_of_the_folder_one_stands_in(tmp_path: Path) -> None:
    (tmp_path / "typer.py").write_text("raise SystemExit('executed')")
    run = subprocess.run(
        [ROOT / "scripts" / "in-env", sys.executable, "-m", "legfem.identify", "--help"],
        cwd=tmp_path,
        check=False,
        capture_output=True,
        text=True,
        env={key: value for key, value in os.environ.items() if key != "PYTHONSAFEPATH"},
    )
    assert "executed" not in run.stderr
    assert run.stdout.startswith("Usage")


def test_versions_are_known_where_another_package_brings_the_module(monkeypatch: pytest.MonkeyPatch) -> None:
    def not_installed(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr("legfem.common.documents.version", not_installed)
    assert package_version("fenics-dolfinx") == dolfinx.__version__
    assert package_version("petsc4py") == petsc4py.__version__
    assert package_version("gmsh") == "unknown"
