"""Finished work that is kept: what comes back, and what mustn't."""

from __future__ import annotations

import json
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from legfem.common.documents import Contents
from legfem.common.units import FloatArray
from legfem.jobs import store as store_module
from legfem.jobs.store import Store, key_of


@dataclass(frozen=True, eq=False)
class Curve:
    force: FloatArray
    slopes: Mapping[str, FloatArray] = field(default_factory=dict)
    limit: float = np.inf


@dataclass(frozen=True)
class Soft:
    C10: float


@dataclass(frozen=True)
class Stiff:
    C10: float


def made() -> Curve:
    numbers = np.random.default_rng(0).random((2, 20))
    numbers[0, 3], numbers[1, 5] = np.nan, -np.inf
    return Curve(numbers[0], {"C10": numbers[1]})


def test_what_is_kept_comes_back_to_the_last_bit(tmp_path: Path) -> None:
    store = Store(tmp_path / "new" / "folder", Curve, {"leg": 3})
    assert store.get(0.1) is None
    store.put(0.1, made())
    found = Store(store.folder, Curve, {"leg": 3}).get(0.1)
    assert found is not None and found.limit == np.inf
    np.testing.assert_array_equal(found.force, made().force)
    np.testing.assert_array_equal(found.slopes["C10"], made().slopes["C10"])
    assert [path.suffix for path in store.folder.iterdir()] == [".json"]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "3",
        "{}",
        '{"kept": {}}',
        '{"key": KEY}',
        '{"key": KEY, "kept": {}}',
        '{"key": KEY, "kept": {"force": ["a"]}}',
        '{"key": "0", "kept": {"force": [1.0]}}',
        "\xff",
    ],
)
def test_a_malformed_or_foreign_file_is_absent(tmp_path: Path, text: str) -> None:
    store = Store(tmp_path, Curve)
    store.put(0.1, made())
    store.path(0.1).write_bytes(text.replace("KEY", f'"{store.key(0.1)}"').encode("latin-1"))
    assert store.get(0.1) is None
    store.put(0.1, made())
    assert store.get(0.1) is not None


@pytest.mark.parametrize("named", [None, lambda asked: "case"])
def test_nothing_stale_comes_back(tmp_path: Path, monkeypatch, named) -> None:
    def store(**options: object) -> Store[Curve]:
        return Store(tmp_path, Curve, options, ("legfem.jobs.pool",), named)

    store(cells=3).put(1.0, made())
    assert store(cells=3).get(1.0) is not None
    assert store(cells=4).get(1.0) is None
    assert store(cells=3).get(np.nextafter(1.0, 2.0)) is None
    monkeypatch.setattr(store_module, "code_fingerprint", lambda *modules: f"changed {modules}")
    assert store(cells=3).get(1.0) is None
    store(cells=3).put(1.0, made())
    assert len(list(tmp_path.iterdir())) == (2 if named is None else 1)


def test_a_piece_is_made_once(tmp_path: Path) -> None:
    calls: list[int] = []

    def make() -> Curve:
        calls.append(1)
        return made()

    for _ in range(3):
        Store(tmp_path, Curve).get_or_make("a", make)
    assert len(calls) == 1


def test_writers_at_the_same_time_leave_one_whole_file(tmp_path: Path) -> None:
    big = Curve(np.arange(20000.0))
    store = Store(tmp_path, Curve)
    with ThreadPoolExecutor(8) as pool:
        for written in [pool.submit(store.put, 1, big) for _ in range(24)]:
            while not written.done():
                found = store.get(1)
                assert found is None or np.array_equal(found.force, big.force)
            written.result()
    assert len(list(tmp_path.iterdir())) == 1
    assert json.loads(store.path(1).read_text())["key"] == store.key(1)


def test_keys_tell_values_apart(tmp_path: Path) -> None:
    file, folder = tmp_path / "a.csv", tmp_path / "sub"
    folder.mkdir()
    (folder / "b").write_text("x")
    file.write_text("1")
    different = [
        None,
        True,
        1,
        1.0,
        np.nextafter(1.0, 2.0),
        "1",
        [1],
        [[1]],
        {"a": 1},
        {"a": 2},
        {"b": 1},
        {1, 2},
        Soft(1.0),
        Stiff(1.0),
        Soft(2.0),
        np.zeros(3),
        np.zeros((3, 1)),
        np.zeros(4),
        Contents(file),
        Contents(folder),
        Contents(tmp_path / "none"),
    ]
    assert len({key_of(value) for value in different}) == len(different)
    assert key_of({"a": 1, "b": 2}) == key_of({"b": 2, "a": 1})
    assert key_of((1, np.float64(2.5))) == key_of([np.int64(1), 2.5])
    before = key_of(Contents(file)), key_of(Contents(folder))
    file.write_text("2")
    (folder / "b").rename(folder / "c")
    assert key_of(Contents(file)) != before[0] and key_of(Contents(folder)) != before[1]
    for unknown in (file, object(), b"1"):
        with pytest.raises(TypeError, match="no key can be made of"):
            key_of(unknown)
