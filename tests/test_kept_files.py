"""What is kept and changed on the disk since is never used: it is done anew, and that is said once."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator
from pathlib import Path

import dolfinx.mesh
import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from legfem.common.errors import Command, InputError
from legfem.common.units import FloatArray
from legfem.fem import compiled as compiling
from legfem.inverse.correction import read_correction, read_table, write_table
from legfem.jobs import store as store_module
from legfem.jobs.store import Checkpoint, Store, read_arrays, write_arrays
from legfem.legs.correction_of_leg import REFERENCE

COURSE = {"force": np.linspace(0.0, 12.3, 40), "slope": np.geomspace(1e-9, 3.0, 40)}


def faults(path: Path, number: int, seed: int = 1) -> Iterator[None]:
    """Leave a file with one bit turned, with a piece cut out, cut short or prolonged; put it back each time."""
    whole, rng = path.read_bytes(), np.random.default_rng(seed)
    for k in range(number):
        spoilt, at = bytearray(whole), int(rng.integers(len(whole)))
        if k % 10 < 7:
            spoilt[at] ^= 1 << int(rng.integers(8))
        elif k % 10 == 7:
            del spoilt[at : at + 1 + int(rng.integers(20))]
        elif k % 10 == 8:
            del spoilt[at:]
        else:
            spoilt += b"0"
        path.write_bytes(bytes(spoilt))
        yield
    path.write_bytes(whole)


@pytest.fixture(autouse=True)
def nothing_said() -> None:
    store_module._say_changed.cache_clear()


def test_no_kept_solve_is_used_once_a_bit_of_it_has_changed(tmp_path: Path, caplog) -> None:
    store = Store(tmp_path, dict[str, FloatArray], {"leg": 3})
    store.put(0.7, COURSE)
    with caplog.at_level(logging.WARNING, "legfem"):
        taken = sum(store.get(0.7) is not None for _ in faults(store.path(0.7), 1000))
    assert taken == 0
    assert len([one for one in caplog.messages if str(tmp_path) in one]) == 1
    assert store.get(0.7) is not None
    assert json.loads(store.path(0.7).read_text())["key"] == store.key(0.7)


def test_what_changed_is_solved_anew_and_kept_again(tmp_path: Path) -> None:
    store, solved = Store(tmp_path, dict[str, FloatArray]), []

    def solve() -> dict[str, FloatArray]:
        solved.append(1)
        return COURSE

    store.get_or_make("a", solve)
    whole = store.path("a").read_bytes()
    for _ in faults(store.path("a"), 3):
        np.testing.assert_array_equal(store.get_or_make("a", solve)["force"], COURSE["force"])
        assert store.path("a").read_bytes() == whole
    assert len(solved) == 4


def test_what_an_earlier_legfem_kept_without_a_digest_is_solved_anew(tmp_path: Path) -> None:
    store = Store(tmp_path, list[float])
    store.put("a", [1.0, 2.0])
    store.path("a").write_text(json.dumps({"key": store.key("a"), "kept": [1.0, 2.0]}))
    assert store.get("a") is None


def test_no_arrays_are_read_that_have_changed(tmp_path: Path) -> None:
    for compressed in (False, True):
        path = tmp_path / "film.npz"
        write_arrays(path, COURSE, compressed)
        assert sum(bool(read_arrays(path)) for _ in faults(path, 500)) == 0
        np.testing.assert_array_equal(read_arrays(path)["slope"], COURSE["slope"])


@pytest.mark.parametrize("file", ["last.json", "00001-0.npz"])
def test_no_state_goes_on_that_has_changed(tmp_path: Path, file: str) -> None:
    states = Checkpoint(tmp_path, "a key", MPI.COMM_SELF)
    states.save(COURSE, {"position": 1.5, "courses": [1, 2, 3]})
    shapes = {name: values.shape for name, values in COURSE.items()}
    assert sum(states.load(shapes) is not None for _ in faults(tmp_path / file, 500)) == 0
    found = states.load(shapes)
    assert found is not None and found[1] == {"position": 1.5, "courses": [1, 2, 3]}


def refused(read: Callable[[], object]) -> bool:
    try:
        read()
    except InputError:
        return True
    return False


def test_no_table_is_taken_for_a_correction_that_has_changed(tmp_path: Path) -> None:
    path = tmp_path / "correction.json"
    path.write_bytes(REFERENCE.read_bytes())
    before = read_correction(path)
    taken = [path.read_bytes() for _ in faults(path, 300) if not refused(lambda: read_correction(path))]
    # White space says nothing.
    assert [one for one in taken if json.loads(one) != json.loads(REFERENCE.read_bytes())] == []
    np.testing.assert_array_equal(read_correction(path).values, before.values)


def test_a_table_from_before_there_were_digests_is_still_read(tmp_path: Path) -> None:
    path = write_table(tmp_path / "table.json", "a kind", {"cylinder": 3}, COURSE, {"mesh": np.ones(2)})
    content = json.loads(path.read_text())
    del content["digest"]
    path.write_text(json.dumps({**content, "schema": 1}))
    (force, _), _, told = read_table(path, "a kind", ("force", "slope"), Command("study correction"))
    np.testing.assert_array_equal(force, COURSE["force"])
    assert told == {"cylinder": 3}
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match="digest: isn't that of its content"):
        read_table(path, "a kind", ("force", "slope"), Command("study correction"))


def test_code_that_changed_since_it_was_compiled_never_runs(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(compiling, "cache_folder", lambda: tmp_path)

    def area() -> float:
        square = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
        return fem.assemble_scalar(compiling.compiled(fem.Constant(square, 3.0) * ufl.dx(square)))

    assert area() == pytest.approx(3.0)
    (library,) = tmp_path.rglob("*.so")
    (folder,) = tmp_path.iterdir()
    compiled_at = library.stat().st_mtime_ns
    assert area() == pytest.approx(3.0)
    assert library.stat().st_mtime_ns == compiled_at
    spoilt = bytearray(library.read_bytes())
    spoilt[len(spoilt) // 2] ^= 4
    # Under another name first: this process runs what is at the old one's place.
    changed = folder / "changed"
    changed.write_bytes(bytes(spoilt))
    changed.replace(library)
    assert area() == pytest.approx(3.0)
    assert library.read_bytes() != bytes(spoilt)
