"""Cases that anybody's method can be tried on: their folders, their sealed truth, and the score."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from studies.cases import score
from studies.cases.benchmark import truth_of, write_case
from studies.cases.sealed_draw import channel_cases

TRUTHS = {
    "a": {"true_C10_kPa": 1.0, "effects": []},
    "b": {"true_C10_kPa": 2.0, "effects": ["dermis", "prestress"]},
    "c": {"true_C10_kPa": 0.5, "effects": ["unknown"]},
    "sealed": {"sha256": "0"},
}


def answer(c10: float, low: float, high: float, *causes: str, **more: float) -> dict[str, object]:
    return {"C10_kPa": c10, "low_kPa": low, "high_kPa": high, "causes": list(causes), "seconds": 10.0, **more}


ANSWERS = {
    "a": answer(1.1, 0.9, 1.3, C10_alone_kPa=1.1),
    "b": answer(2.0, 1.9, 2.1, "dermis", "indenter-tilt", C10_alone_kPa=3.0),
    "c": answer(0.6, 0.55, 0.65),
    "sealed": answer(1.0, 0.9, 1.1),
}


def test_a_score_counts_intervals_causes_and_bias_over_the_cases_whose_truth_is_given() -> None:
    found = score.score(ANSWERS, TRUTHS)
    assert found["cases"] == 3
    assert found["intervals that hold C10"] == pytest.approx(2 / 3)
    assert found["half-width of the interval, median"] == pytest.approx(0.1)
    assert found["bias of C10"] == pytest.approx((0.1 + 0.0 + 0.2) / 3)
    assert found["bias without a cause"] == pytest.approx((0.1 + 0.5) / 2)
    # One of two names is right, and three were to be found.
    assert found["F1 of causes"] == pytest.approx(2 / 5)
    assert found["false discoveries"] == pytest.approx(0.5)
    assert found["nothing said where nothing is"] == 1.0


def test_the_score_runs_by_itself_without_legfem(tmp_path: Path) -> None:
    file = tmp_path / "score.py"
    file.write_text(Path(score.__file__).read_text())
    for name, content in (("answers", ANSWERS), ("truth", {"cases": TRUTHS})):
        (tmp_path / f"{name}.json").write_text(json.dumps(content))
    # Isolated from this checkout: an import of legfem would fail.
    words = [sys.executable, "-I", file.name, "answers.json", "truth.json"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "F1 of causes" in done.stdout
    assert "import legfem" not in file.read_text()


def test_a_digest_tells_a_truth_that_was_changed() -> None:
    truth = {**TRUTHS["b"], "salt": "1"}
    assert score.digest(truth) == score.digest(dict(reversed(truth.items())))
    assert score.digest(truth) != score.digest({**truth, "true_C10_kPa": 2.1})


def test_a_case_is_a_folder_as_a_lab_hands_it_over_with_nothing_of_its_truth(tmp_path: Path) -> None:
    case = channel_cases(1, 5)[0]
    leg = replace(load_subject(SUBJECTS.find("2")), title="what is concealed: nothing")
    lab = SimpleNamespace(subject=lambda *_: leg)
    folder = tmp_path / "case-000"
    assert write_case(lab, case, folder)
    read = load_subject(folder)
    assert [len(one) for one in read.recordings] == [len(one) for one in leg.recordings]
    assert read.recordings[0].force == pytest.approx(leg.recordings[0].force, abs=1e-4)
    assert read.origin == "simulated"
    assert "concealed" not in (folder / "subject.toml").read_text()
    assert set(truth_of(case)) >= {"true_C10_kPa", "effects", "kind"}
    assert not write_case(SimpleNamespace(subject=lambda *_: None), case, tmp_path / "stopped")
    assert not (tmp_path / "stopped").exists()
