"""Commands that evidence rests on run as processes, with two workers where they take any, and their results are read.

Each at its smallest size, by `make verify`; what is too long for that stands in `LONG` with what runs in its place.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("LEGFEM_DATA", ROOT.parent / "shared" / "data"))

type Read = Callable[[Path, str], object]


def result(*keys: str) -> Read:
    """Return what reads ``result.json`` down to what is asked for, which has to be there and not empty."""

    def read(out: Path, said: str) -> object:
        found: Any = json.loads((out / "result.json").read_text(encoding="utf-8"))
        for key in keys:
            found = found[key]
        return found

    return read


def files(pattern: str) -> Read:
    """Return what finds files that aren't empty."""
    return lambda out, said: [path for path in out.glob(pattern) if path.stat().st_size]


def numbers(out: Path, said: str) -> object:
    """Return the numbers of the table that a command prints."""
    return [line for line in said.splitlines() if re.search(r"\d\.\d", line)]


RUN: dict[str, tuple[str, Read]] = {
    "studies.cases layers": ("--n 2 --jobs 2 --out OUT", result("cases")),
    "studies.cases sites": ("--n 2 --jobs 2 --out OUT", result("cases")),
    "studies.cases bars": ("--n 2 --jobs 2 --out OUT", result("cases")),
    "studies.cases limbs": ("--n 1 --jobs 2 --out OUT", result("cases")),
    "studies.cases reach": ("--n 2 --jobs 2 --out OUT", result("cases")),
    "studies.cases sealed": (
        "--legs 1 --most 2 --channels FORCE --jobs 2 --library OUT/library --out OUT",
        result("cases"),
    ),
    "studies.cases picture": ("--out OUT/coverage.svg", files("coverage.svg")),
    "studies.solvers": ("--size 2000 --out OUT", result("cases")),
    "studies.fibres": ("--coarse --jobs 2 --out OUT", result("ratios")),
    "studies.leg3d": ("--plants 1 --out OUT", numbers),
    "studies.leg3d.codes": ("--finer 0.6", numbers),
    "studies.leg3d.fibres": ("--ratio 1 --tests along --out OUT", numbers),
    "studies.leg3d.meshes": ("--contact 8", numbers),
    "studies.leg3d.fascia": ("--number 7", numbers),
    "studies.stockings make": ("--cells 10000 --jobs 2 --legs OUT --out OUT", files("*/*/bare.nii.gz")),
    "studies.stockings sizes": ("--cells 12000", numbers),
    "studies.cohort": ("--n 1 --people 4 --out OUT", result()),
    "studies.reconstruct": ("--jobs 2 --out OUT/subjects", files("subjects/*/subject.toml")),
    "studies.meshes": ("--out OUT", files("*.msh")),
    "studies.bench": ("--task curve", numbers),
    "studies.recordings": ("--data DATA --folder EF10_75T --folder EF30_0T --jobs 2 --out OUT", result("folders")),
    "studies.people": ("--data DATA/multis_in_vivo --jobs 2 --out OUT", numbers),
    "studies.cohort.two_layers": ("--data DATA/multis_in_vivo --people 2 --out OUT", files("*/specimen.toml")),
    "studies.frauziols claims": ("--jobs 2 --out OUT", files("claims.json")),
    "legfem.identify": ("--subject 3 --law neo-hookean --jobs 2 --out OUT", result()),
    "legfem.study doe": ("--factorial-only --jobs 2 --out OUT", files("**/*.json")),
    "legfem.study reproduce": ("--jobs 2 --out OUT", files("**/result.json")),
}
"""Options, and what is read; FORCE stands for a name with a space."""
WORDS = {"FORCE": "force alone"}
LONG = {
    "studies.frauziols convergence": "`make verify` runs it whole",
    "studies.frauziols correction": "five minutes of both cores: tests/test_correction.py draws a coarse one",
    "legfem.study correction": "likewise",
    "studies.stockings identify": "twenty minutes: tests/test_stocking.py identifies one small leg",
    "studies.stockings claims": "six minutes: tests/test_stale_work.py runs it without its solves",
    "studies.cases benchmark": "solves 21 cases a leg, a minute each: tests/test_benchmark.py tries its parts",
    "studies.cases peers": "wants recordings of known truth, and minutes for each: tests/test_peers.py tries its parts",
    "studies.cohort.simulated": "136 pressings at least: tests/test_cohort_on_engines.py runs a cohort",
    "studies.cohort.scored": "wants what studies.cohort.simulated made",
}
"""What isn't run here, and why."""


@pytest.mark.slow
@pytest.mark.parametrize("name", RUN)
def test_the_command_runs_with_two_workers_and_its_result_can_be_read(name: str, tmp_path: Path) -> None:
    options, read = RUN[name]
    if "DATA" in options and not DATA.is_dir():
        pytest.skip("needs the recordings: LEGFEM_DATA")
    given = options.replace("OUT", str(tmp_path)).replace("DATA", str(DATA)).split()
    module, *words = name.split()
    command = [sys.executable, "-m", module, *words, *(WORDS.get(one, one) for one in given)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}
    ended = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=1800.0)
    assert ended.returncode == 0, f"{ended.stderr[-3000:]}\n{ended.stdout[-1000:]}"
    assert read(tmp_path, ended.stdout + ended.stderr), ended.stdout[-2000:]


def test_every_command_that_evidence_rests_on_is_run_or_said_why_not() -> None:
    text = "".join((ROOT / "docs" / page).read_text(encoding="utf-8") for page in ("evidence.md", "commands.md"))
    asked = set()
    for module, words in re.findall(
        r"`(?:python -m )?(studies(?:\.\w+)+(?:\\\|\w+)*|make bench)((?: [a-z\\|]+)?)", text
    ):
        first, *others = module.split("\\|")
        modules = [first, *(f"{first.rpartition('.')[0]}.{one}" for one in others)]
        for one in modules if module != "make bench" else ["studies.bench"]:
            asked |= {f"{one} {word}".strip() for word in words.strip().split("\\|")}
    assert asked, "the pattern finds none"
    assert not asked - {*RUN, *LONG}
    for why in LONG.values():
        assert all((ROOT / path).is_file() for path in re.findall(r"tests/\w+\.py", why)), why
