"""``scripts/house`` counts what stands in a package, and fails above a limit."""

import subprocess
import sys
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[1] / "scripts" / "house"
FILES = {
    "__init__.py": "",
    "room/__init__.py": '"""Room."""\n\nfrom pkg.room.shown import Shown\n\n__all__ = ["Shown"]\n',
    "room/shown.py": '"""All."""\nfrom pkg.room.hidden import f\n\nclass Shown:\n    """One."""\n\n    x = f()  # c\n',
    "room/hidden.py": "def f():\n    # nothing\n    return (1,\n        2)  # fmt: skip\n",
    "terms/__init__.py": "",
    "terms/all.py": "from pkg.terms.drag import Shown\nfrom pkg.room import Shown as Other\n",
    "terms/drag.py": "class Shown: pass\n",
}


@pytest.fixture
def package(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        path = tmp_path / "pkg" / name
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_text(text)
    return tmp_path / "pkg"


def count(package: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, HOUSE, package, *options], capture_output=True, text=True)


def test_counts_leave_comments_docstrings_and_blanks_aside(package: Path) -> None:
    answer = count(package, "--names")
    assert answer.returncode == 0, answer.stderr
    numbers = [line.split()[-1] for line in answer.stdout.splitlines() if not line.startswith(" ")]
    assert numbers == ["11", "7", "0.3636", "1", "1", "1"]
    # What a folder passes on is imported from elsewhere, and a registry's plug-in needs no second importer.
    assert "    pkg.room.hidden: pkg.room.shown\n" in answer.stdout
    assert "    Shown: pkg.room.shown, pkg.terms.drag\n" in answer.stdout


@pytest.mark.parametrize("option", ["code", "modules", "imports", "doubled", "lone", "unformatted"])
def test_a_passed_limit_is_exit_status_1(package: Path, option: str) -> None:
    assert count(package, f"--max-{option}", "0").returncode == 1
    assert count(package, f"--max-{option}", "11").returncode == 0
