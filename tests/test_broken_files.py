"""Four hundred broken files of cameras, films, rheometers, instruments, workbooks, channels, studies and the app."""

from __future__ import annotations

import re
import shutil
import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from making import write_subject
from making_broken_files import Found, Kind, damaged, kinds
from scipy.spatial import KDTree

from legfem.common.errors import InputError
from legfem.geometry.indenter import Site
from legfem.legs.loading import load_subject

SEED, EACH, LONGEST_S = 20261130, 34, 6.0
"""Broken files of each kind: more than four hundred of the twelve."""


@pytest.fixture(scope="module")
def every(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Kind]:
    leg = load_subject(write_subject(tmp_path_factory.mktemp("leg")))
    return kinds(Site(leg.section, leg.indenter))


def put(folder: Path, files: Mapping[str, bytes]) -> Path:
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def part(one: Found, of: Found) -> bool:
    """Tell whether all that was read stands in the good file's reading, too; of texts whether they are the same."""
    if any(isinstance(value, str) for value in (*one.values, *of.values)):
        return sorted(one.values) == sorted(of.values)
    few, all_of = (np.column_stack([np.asarray(v, dtype=float) for v in f.values if v is not None]) for f in (one, of))
    if few.shape[1:] != all_of.shape[1:] or not np.isfinite(few).all():
        return False
    return not len(few) or KDTree(all_of).query(few)[0].max() < 1e-3 * (1 + np.abs(all_of).max())


def broken(tmp_path: Path, kind: Kind, number: int, seeds: range) -> Counter[str]:
    """Break files of a kind; return how many were refused, read as they were, and read otherwise with a doubt."""
    found, good = Counter[str](), {}
    for name, files in kind.files.items():
        good[name] = kind.read(put(tmp_path / f"good-{len(good)}", files), name)
    for seed in seeds:
        rng = np.random.default_rng([SEED, number, seed])
        name = list(good)[int(rng.integers(len(good)))]
        folder = put(tmp_path / f"{seed}", kind.files[name])
        done, started = damaged(folder, kind, rng), time.perf_counter()
        what = f"seed {seed}, {name}, {done}"
        try:
            read = kind.read(folder, name)
        except InputError as error:
            assert "\n" not in str(error) and error.remedy, what
            found["refused"] += 1
        except Exception as error:
            raise AssertionError(f"{what}: {error!r}") from error
        else:
            same, said = part(read, good[name]), sorted(read.said) != sorted(good[name].said)
            # A bit may make another digit of one: nobody can see that.
            assert same or said or done.endswith("_bits"), f"{what}: is read otherwise, and nothing said"
            found["same" if same else "said"] += 1
        assert time.perf_counter() - started < LONGEST_S, what
        shutil.rmtree(folder)
    return found


NAMES = (
    *("fields", "films", "rheometers", "instruments", "workbooks", "tables", "channels"),
    *("studies", "studies' books", "readings", "the app's tables", "populations"),
)


def test_every_kind_of_file_is_among_those_that_are_broken(every: dict[str, Kind]) -> None:
    assert tuple(every) == NAMES and EACH * len(NAMES) > 400


@pytest.mark.parametrize("name", NAMES)
def test_broken_files_are_refused_in_a_line_read_as_they_were_or_doubted(
    tmp_path: Path, every: dict[str, Kind], name: str
) -> None:
    found = broken(tmp_path, every[name], NAMES.index(name), range(EACH))
    assert found.total() == EACH
    assert found["refused"] > EACH // 4, "damage as made here is mostly more than a reader can take"


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_so_are_three_thousand(tmp_path: Path, every: dict[str, Kind], name: str) -> None:
    broken(tmp_path, every[name], NAMES.index(name), range(1000, 1250))


FOUND: dict[str, tuple[str, str, bytes, bytes, str]] = {
    "a quote that nothing closes takes no lines below it": ("fields", "stages in German", b"", b'"', ""),
    "a frame's file without points is named, not passed over": (
        *("fields", "DICe", b"DISPLACEMENT_X", b"DISPLACEMENT_Q"),
        "DICe_solution_002.txt: columns: no table names x and y of points",
    ),
    "what is no reading of a film is no lost one": (
        "films",
        "Tekscan",
        b"2.16",
        b"2.1.6",
        "rows: '2.1.6' is no reading",
    ),
    "a quote is no reading of a film": ("films", "Tekscan", b"2.16,", b'",', "rows: '\"' is no reading"),
    "a median of no size is no population's": (*("populations", "one", b"0.8", b"1e999"), "contains no population"),
}


@pytest.mark.parametrize("fault", FOUND)
def test_a_fault_that_broken_files_have_shown_stays_mended(tmp_path: Path, every: dict[str, Kind], fault: str) -> None:
    kind, name, old, new, line = FOUND[fault]
    folder = put(tmp_path / "broken", every[kind].files[name])
    path = sorted(one for one in folder.iterdir() if name != "DICe" or "_002" in one.name)[0]
    content = path.read_bytes()
    if old:
        assert old in content
        path.write_bytes(content.replace(old, new, 1))
    else:
        lines = content.split(b"\n")
        lines[len(lines) // 2] = new + lines[len(lines) // 2]
        path.write_bytes(b"\n".join(lines))
    if line:
        with pytest.raises(InputError, match=re.escape(line)):
            every[kind].read(folder, name)
        return
    good = every[kind].read(put(tmp_path / "good", every[kind].files[name]), name)
    assert len(good.values[0]) - 1 <= len(every[kind].read(folder, name).values[0])
