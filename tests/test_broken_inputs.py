"""Broken folders and kept files: one line that names the field, and never a traceback."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path

import numpy as np
import pytest
from making import SHARED
from making_broken import SILENTLY_WRONG, broken_at_random, copied, told
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.jobs.checkpoint import Checkpoint
from legfem.jobs.store import Store
from legfem.subjects.loading import SUBJECTS, load_subject
from legfem.subjects.plausibility import doubts_about

FOREIGN = sorted((SHARED / "foreign").glob("case-*"))
LONGEST_S = 60.0


@pytest.mark.parametrize("wrong", SILENTLY_WRONG)
def test_what_a_person_would_see_is_told_with_its_field(tmp_path, wrong):
    change, field = SILENTLY_WRONG[wrong]
    folder = copied("3", tmp_path / "leg")
    change(folder)
    assert field in told(folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["1", "2", "4"])
@pytest.mark.parametrize("wrong", SILENTLY_WRONG)
def test_so_is_it_on_the_other_legs(tmp_path, wrong, name):
    change, field = SILENTLY_WRONG[wrong]
    folder = copied(name, tmp_path / "leg")
    change(folder)
    assert field in told(folder)


@pytest.mark.parametrize("name", SUBJECTS.names)
def test_legs_that_come_with_legfem_are_not_doubted(tmp_path, name):
    assert doubts_about(load_subject(SUBJECTS.find(name))) == ()
    assert told(copied(name, tmp_path / "measured")) == []


@pytest.mark.skipif(not FOREIGN, reason="needs ../shared")
@pytest.mark.parametrize("folder", FOREIGN, ids=lambda path: path.name)
def test_recordings_of_another_code_are_not_doubted(folder):
    assert doubts_about(load_subject(folder)) == ()


def test_what_is_confirmed_is_not_doubted(tmp_path):
    folder = copied("3", tmp_path / "leg")
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text().replace("r_mm = 30.0", "r_mm = 15.0"))
    assert told(folder) == ["indenter.diameter_mm"]
    toml.write_text('confirmed = ["indenter.diameter_mm"]\n' + toml.read_text())
    assert told(folder) == []


@pytest.mark.parametrize("file", ["subject.toml", "contours.csv", "recordings/trial1.csv"])
def test_what_never_ends_is_not_read(tmp_path, file):
    folder = copied("3", tmp_path / "leg")
    (folder / file).unlink()
    os.mkfifo(folder / file)
    with pytest.raises(InputError, match=r"is a pipe|there is no file|not found"):
        load_subject(folder)


def broken(tmp_path: Path, seeds: range) -> None:
    for seed in seeds:
        folder = copied(SUBJECTS.names[seed % 4], tmp_path / f"{seed}")
        done, started = broken_at_random(folder, seed), time.perf_counter()
        try:
            told(folder)
        except Exception as error:
            raise AssertionError(f"seed {seed} ({done}): {error!r}") from error
        assert time.perf_counter() - started < LONGEST_S, f"seed {seed} ({done})"


def test_a_dozen_folders_broken_at_random_give_no_traceback(tmp_path):
    broken(tmp_path, range(12))


@pytest.mark.slow
def test_four_hundred_folders_broken_at_random_give_no_traceback(tmp_path):
    broken(tmp_path, range(400))


MALFORMED = ["", "[]", "null", "{", '{"key": 1}', "[" * 100_000, '{"key": {}, "kept": []}', "\x00"]


@pytest.mark.parametrize("text", MALFORMED, ids=lambda text: repr(text[:12]))
def test_a_malformed_kept_file_counts_as_absent(tmp_path, text):
    store = Store(tmp_path, dict[str, float], named=lambda asked: "one")
    store.put("x", {"a": 1.0})
    assert store.get("x") == {"a": 1.0}
    store.path("x").write_text(text)
    assert store.get("x") is None


@pytest.mark.parametrize("text", MALFORMED, ids=lambda text: repr(text[:12]))
@pytest.mark.parametrize("file", ["last.json", "00001-0.npz"])
def test_a_malformed_checkpoint_counts_as_absent(tmp_path, file, text):
    kept = Checkpoint(tmp_path, "key", MPI.COMM_SELF)
    kept.save({"u": np.arange(3.0)}, {"step": 2})
    found = kept.load({"u": (3,)})
    assert found is not None and found[1] == {"step": 2}
    (tmp_path / file).write_text(text)
    assert kept.load({"u": (3,)}) is None


def test_a_checkpoint_whose_numbers_were_changed_counts_as_absent(tmp_path):
    kept = Checkpoint(tmp_path, "key", MPI.COMM_SELF)
    kept.save({"u": np.arange(3.0)}, {"step": 2, "sizes": [0.1, 0.2]})
    head = json.loads((tmp_path / "last.json").read_text())
    head["plain"]["sizes"] = "none"
    (tmp_path / "last.json").write_text(json.dumps(head))
    assert kept.load({"u": (3,)}) is None
