"""Broken folders and kept files: one line that names the field, and never a traceback."""

from __future__ import annotations

import json
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from making import SHARED
from making_broken import SILENTLY_WRONG, Change, broken_at_random, copied, replaced, told, trials
from making_fuzzed import KINDS, broken_anywhere
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.jobs.store import Checkpoint, Store
from legfem.legs.loading import load_subject
from legfem.legs.plausibility import doubts_about
from legfem.legs.schema import SUBJECTS

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


def test_readings_that_are_missing_before_a_turn_give_no_traceback(tmp_path):
    broken(tmp_path, range(9343, 9344))


@pytest.mark.slow
def test_four_hundred_folders_broken_at_random_give_no_traceback(tmp_path):
    broken(tmp_path, range(400))


def _first_trial(change: Callable[[bytes], bytes]) -> Change:
    def changed(folder: Path) -> None:
        path = trials(folder)[0]
        path.write_bytes(change(path.read_bytes()))

    return changed


NASTY: dict[str, tuple[Change, str]] = {
    "another unit in brackets": (_first_trial(lambda text: text.replace(b"force_N", b"Force [kN]", 1)), "force_N"),
    "one row": (_first_trial(lambda text: b"\n".join(text.split(b"\n")[:2])), "rows"),
    "nothing": (_first_trial(lambda text: b""), "header"),
    "a cell of ten million characters": (_first_trial(lambda text: text + b"1" * 10_000_000 + b",1,1\n"), "rows"),
    "zeros in the text": (_first_trial(lambda text: text[:200] + b"\0" + text[200:]), "file"),
    "a folder called so": (lambda folder: (folder / "recordings" / "z.csv").mkdir(), "file"),
    "a link to itself": (lambda folder: (folder / "recordings" / "z.csv").symlink_to("z.csv"), "file"),
    "a date": (replaced("length_mm = .*", "length_mm = 1979-05-27"), "indenter.length_mm"),
    "three coordinates": (replaced("aim_mm = .*", "aim_mm = [0, 0, 0]"), "indenter.aim_mm"),
    "a number of ten thousand digits": (replaced("length_mm = .*", f"length_mm = {'9' * 10_000}"), "TOML"),
    "a table in tables": (replaced("^", f"x = {'{a=' * 1000}1{'}' * 1000}\n"), "TOML"),
    "a name too long for a file": (replaced("contours = .*", f'contours = "{"a" * 5000}"'), "section.contours"),
    "a line's end in a name": (
        lambda folder: trials(folder)[0].rename(trials(folder)[0].with_name("a\nb.csv")),
        "name",
    ),
    "a name that is no text": (
        lambda folder: trials(folder)[0].rename(os.fsdecode(os.fsencode(folder / "recordings") + b"/\xff.csv")),
        "name",
    ),
    "a device": (replaced("contours = .*", 'contours = "/dev/zero"'), "file"),
    "a terminal's orders in the title": (replaced("title = .*", r'title = "\\u001b[31mred"'), "title"),
}


@pytest.mark.parametrize("nasty", NASTY)
def test_what_few_would_write_is_refused_with_its_field(tmp_path, nasty):
    change, field = NASTY[nasty]
    folder = copied("3", tmp_path / "leg")
    change(folder)
    assert [one.partition(",")[0] for one in told(folder)] == [field]


def broken_of_a_kind(tmp_path: Path, kind: str, seeds: range) -> None:
    good = tmp_path / "good"
    KINDS[kind].make(good)
    assert KINDS[kind].told(good) == ""
    for seed in seeds:
        folder = tmp_path / f"{seed}"
        shutil.copytree(good, folder)
        done, started = broken_anywhere(folder, seed), time.perf_counter()
        try:
            KINDS[kind].told(folder)
        except Exception as error:
            raise AssertionError(f"{kind}, seed {seed} ({done}): {error!r}") from error
        assert time.perf_counter() - started < LONGEST_S, f"{kind}, seed {seed} ({done})"
        shutil.rmtree(folder)


@pytest.mark.parametrize("kind", KINDS)
def test_folders_of_every_kind_broken_at_random_give_no_traceback(tmp_path, kind):
    broken_of_a_kind(tmp_path, kind, range(6))


def test_specimens_of_which_one_is_beyond_all_numbers_give_no_traceback(tmp_path):
    broken_of_a_kind(tmp_path, "specimens", range(1145, 1146))


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_four_hundred_of_every_kind_give_no_traceback(tmp_path, kind):
    broken_of_a_kind(tmp_path, kind, range(1000, 1400))


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
    head["kept"]["plain"]["sizes"] = "none"
    (tmp_path / "last.json").write_text(json.dumps(head))
    assert kept.load({"u": (3,)}) is None
