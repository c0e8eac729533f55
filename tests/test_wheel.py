"""The wheel holds what runs need, and works away from the checkout."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("legfem", "pyproject.toml", "README.md", "LICENSE")

# Everything that comes with legfem and a run reads, from wherever it is installed.
LOADING = """
import sys
from pathlib import Path

import legfem
from legfem.legs.correction_of_leg import LEGS as SIZES, REFERENCE
from legfem.inverse.correction import read_fibres
from legfem.legs.correction_of_leg import read_leg_corrections
from legfem.inverse.correction import read_correction
from legfem.imaging.volume_file import read_volumes
from legfem.stockings.loading import LEGS
from legfem.stockings.loading import parse_leg_file
from legfem.study.doe.design import IDENTIFIED, PAPER, read_definition
from legfem.legs.loading import SUBJECTS, load_subject

installed = Path(legfem.__file__).resolve()
assert installed.is_relative_to(Path(sys.prefix).resolve()), installed
assert not any(Path(path).resolve() == Path(sys.argv[1]) for path in sys.path)
assert SUBJECTS.names == ("1", "2", "3", "4"), SUBJECTS.names
assert all(load_subject(SUBJECTS.find(name)).recordings for name in SUBJECTS.names)
assert read_correction(REFERENCE) and read_leg_corrections(SIZES) and read_fibres()
assert all(read_definition(path).factors for path in (PAPER, IDENTIFIED))
assert LEGS.names == ("1", "2", "3", "4", "5", "6"), LEGS.names
for name in LEGS.names:
    folder = LEGS.find(name)
    scan = parse_leg_file(LEGS.opened(folder)).bare.scan
    assert read_volumes(folder / scan)[0].labels.any()
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built in a copy, since building writes beside the sources."""
    pytest.importorskip("setuptools", "77")
    folder = tmp_path_factory.mktemp("wheel")
    (folder / "tree").mkdir()
    for name in SOURCES:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        copy(ROOT / name, folder / "tree" / name)
    pip("wheel", "--no-build-isolation", "-w", folder, folder / "tree")
    (made,) = folder.glob("*.whl")
    return made


def pip(command: str, *arguments: str | Path, python: Path | None = None) -> None:
    which = ["--python", python] if python else []
    subprocess.run(
        [
            sys.executable,
            "-m",
            "pip",
            *which,
            command,
            "--quiet",
            "--no-deps",
            "--no-index",
            "--disable-pip-version-check",
            *arguments,
        ],
        check=True,
    )


def test_the_wheel_holds_every_module_and_resource(wheel):
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    wanted = {
        str(path.relative_to(ROOT))
        for path in (ROOT / "legfem").rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert any(name.endswith("subject.toml") for name in wanted)
    assert held == wanted


@pytest.mark.slow
def test_the_wheel_works_from_an_empty_folder(wheel, tmp_path):
    """In a bare venv over this interpreter's packages, without the checkout on any path."""
    environment, empty = tmp_path / "venv", tmp_path / "empty"
    empty.mkdir()
    subprocess.run([sys.executable, "-m", "venv", "--system-site-packages", "--without-pip", environment], check=True)
    python = environment / "bin" / "python"
    # A venv made in a venv passes over its packages.
    (site,) = environment.glob("lib/python*/site-packages")
    below = {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}
    lines = [f"import site; site.addsitedir({path!r})\n" for path in sorted(below)]
    (site / "below.pth").write_text("".join(lines))
    pip("install", wheel, python=python)

    def run(*words: str | Path) -> str:
        done = subprocess.run(
            words,
            cwd=empty,
            capture_output=True,
            text=True,
            check=False,
            env={key: value for key, value in os.environ.items() if key != "PYTHONPATH"},
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    run(python, "-c", LOADING, ROOT)
    for command in ("identify", "diagnose", "stocking", "geometry", "meshing", "study"):
        words = ["--subject", "3"] if command in ("identify", "diagnose", "stocking") else []
        assert f"Usage: legfem {command}" in run(python, "-m", f"legfem.{command}", *words, "--help")
    assert "identify" in run(environment / "bin" / "legfem", "--help")
    run(python, "-m", "legfem.meshing", "--subject", "3", "--finer", "0.5", "--out", "leg.msh")
    assert [path.name for path in empty.iterdir()] == ["leg.msh"]
