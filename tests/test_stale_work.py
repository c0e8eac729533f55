"""Studies go on where they were stopped, and take nothing that an option or the code outdated."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from legfem.common.progress import Silent
from studies.cases.outcomes import Interval
from studies.cases.sites import KIND, FoundLeg
from studies.cases.sites_draw import Truth, truths
from studies.solvers import __main__ as solvers
from studies.solvers.case import SolverCase, SolverWork
from studies.stockings import command as stockings
from studies.stockings.claims import Pressures, Variant
from studies.stockings.truth import NOISE, TRUTHS, Recovery


@dataclass
class Study:
    """A study in a folder, whose work is counted instead of done."""

    run: Callable[..., None]
    """Of an option."""
    total: int
    """Pieces of work."""
    result: Path
    calls: list[object] = field(default_factory=list)

    def done(self, option: int = 1) -> int:
        """Run it; return how much was done anew."""
        before = len(self.calls)
        self.run(option)
        return len(self.calls) - before


def sites_study(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Study:
    def identified(context: Path, truth: Truth) -> FoundLeg:
        study.calls.append(truth)
        each = Interval(truth.c10 + 1e-3 * len(study.calls), 0.1, 9.0)
        both = dict.fromkeys(("deep.C10", "deep.C20", "superficial.C10"), each)
        return FoundLeg(truth, both, {"heel": both}, 0.5, len(study.calls), True)

    kind = replace(KIND, run=identified)

    def run(seed: int) -> None:
        kind.count(truths(4, seed), folder, folder, 1, Silent())

    study = Study(run, 4, folder / "result.json")
    return study


def solvers_study(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Study:
    def run(option: int) -> None:
        cases = [SolverCase(3000, s, step=option / 2) for s in ("direct", "iterative")]
        solvers.run(cases, folder)

    study = Study(run, 2, folder / "result.json")

    def measured(case: SolverCase) -> SolverWork:
        study.calls.append(case)
        work = SolverWork(3000, 99, 7, True, 8, 8, [15] * 8, 1.0, 2.0, 2.0, 0.3, 0.6, 0.2)
        return replace(work, tangents=len(study.calls))

    monkeypatch.setattr(solvers, "measured_apart", measured)
    return study


def stockings_study(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Study:
    legs = folder / "legs"
    for kind in NOISE:
        for leg in ("1", "2"):
            (legs / kind / leg).mkdir(parents=True)
            (legs / kind / leg / "leg.toml").write_text("id = 1")
    study = Study(lambda cells: stockings.identify(legs, folder, 20_000 + cells, 1), 4, folder / "recovery.json")

    def identified(context: object, task: tuple[str, str]) -> Recovery:
        study.calls.append(task)
        kind, leg = task
        both = Interval(3.0, 2.0, 4.0), Interval(8.0, 7.0, 9.0 + len(study.calls))
        return Recovery(leg, kind, (3.0, 8.0), both, 9, 0.1, 1.0, 7.0)

    monkeypatch.setattr(stockings, "_identify", identified)
    return study


def claims_study(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Study:
    study = Study(lambda cells: stockings.claims(folder, 15_000 + cells, 1), 30, folder / "claims.json")

    def solved(cells: int, variant: Variant) -> Pressures:
        study.calls.append(variant)
        x = float(np.random.default_rng(len(study.calls)).random())
        return Pressures(variant, x, x, (x, 1.0), x**2, x, x, x, True)

    monkeypatch.setattr(stockings, "_claim", solved)
    return study


def scans_study(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Study:
    study = Study(lambda seed: stockings.make(folder, seed, 1), len(TRUTHS), folder / "perfect" / "1" / "made")

    def made(context: object, leg: str) -> str:
        study.calls.append(leg)
        for kind in NOISE:
            (folder / kind / leg).mkdir(parents=True, exist_ok=True)
            (folder / kind / leg / "made").write_text(json.dumps(len(study.calls)))
        return "made"

    monkeypatch.setattr(stockings, "_make", made)
    return study


@pytest.fixture(params=[sites_study, solvers_study, stockings_study, claims_study, scans_study])
def study(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Study]:
    return request.param(tmp_path, monkeypatch)


def test_finished_work_is_not_done_again(study: Study) -> None:
    assert study.done() == study.total
    found = study.result.read_text()
    assert study.done() == 0 and study.result.read_text() == found


def test_another_option_brings_nothing_back(study: Study) -> None:
    study.done()
    found = study.result.read_text()
    assert study.done(option=2) == study.total
    assert study.result.read_text() != found


def test_changed_code_brings_nothing_back(study: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    study.done()
    found = study.result.read_text()
    monkeypatch.setattr("legfem.jobs.store.code_fingerprint", lambda *modules: "changed")
    assert study.done() == study.total
    assert study.result.read_text() != found


def test_an_interrupted_study_goes_on(study: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = study.calls

    class Interrupts(list):
        def append(self, one: object) -> None:
            if len(self) == study.total - 1:
                raise KeyboardInterrupt
            super().append(one)

    study.calls = Interrupts()
    with pytest.raises(KeyboardInterrupt):
        study.done()
    study.calls = whole
    assert study.done() == 1


def test_legs_and_scans_that_changed_are_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    identified = stockings_study(tmp_path / "a", monkeypatch)
    identified.done()
    (tmp_path / "a" / "legs" / "noisy" / "2" / "leg.toml").write_text("id = 2")
    assert identified.done() == 1
    scans = scans_study(tmp_path / "c", monkeypatch)
    scans.done()
    (tmp_path / "c" / "noisy" / "3" / "made").unlink()
    assert scans.done() == 1
