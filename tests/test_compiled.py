"""Compilation: found again on disk, and recovered after a run was killed in the midst of it."""

from __future__ import annotations

import fcntl
import logging
import threading
import time
from pathlib import Path

import dolfinx.mesh
import numpy as np
import pytest
import ufl
from cffi import VerificationError
from dolfinx import fem
from mpi4py import MPI

from legfem.fem import compiled as module
from legfem.fem.compiled import compiled, expression


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """An empty cache."""
    monkeypatch.setattr(module, "cache_folder", lambda: tmp_path)
    module._announce.cache_clear()
    return tmp_path


def area() -> float:
    """Of a square, by a form that FFCx compiles quickly."""
    square = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
    return fem.assemble_scalar(compiled(fem.Constant(square, 2.0) * ufl.dx(square)))


def kill_in_the_midst(folder: Path) -> Path:
    """Leave what a compilation leaves when its process is killed; returns the C file."""
    (ready,) = folder.rglob("*.c.cached")
    source = ready.with_suffix("")
    ready.unlink()
    for library in folder.rglob("*.so"):
        library.unlink()
    source.write_text("half of a fi")
    return source


def test_a_second_run_compiles_nothing(folder, caplog):
    with caplog.at_level(logging.INFO, "legfem"):
        assert area() == pytest.approx(2.0)
        assert caplog.messages == ["compiling finite-element forms (once per machine, ~20 s)"]
        written = {file: file.stat().st_mtime_ns for file in folder.rglob("*.so")}
        module._announce.cache_clear()
        assert area() == pytest.approx(2.0)
    assert len(caplog.messages) == 1
    assert {file: file.stat().st_mtime_ns for file in folder.rglob("*.so")} == written


def test_a_compiler_that_fails_is_said_with_its_folder(folder, monkeypatch):
    def fails(*_: object, **__: object) -> None:
        raise VerificationError("CompileError: command gcc failed")

    monkeypatch.setattr(module.jit, "ffcx_jit", fails)
    with pytest.raises(OSError, match="the C compiler failed") as raised:
        area()
    assert raised.value.filename.startswith(str(folder))
    monkeypatch.setattr(module, "_LEAST_FREE", float("inf"))
    with pytest.raises(OSError, match="No space left"):
        area()


def test_forms_are_compiled_in_the_folders_that_are_locked(folder):
    """What is compiled under the lock is what the form then uses: one library a form."""
    square = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 1, 1)
    x = ufl.SpatialCoordinate(square)
    value = expression(x[0] + 2 * x[1], np.array([[0.5, 0.25]]))
    assert value.eval(square, np.array([0], dtype=np.int32)).size == 1
    area()
    assert sorted(len(list(each.glob("*.so"))) for each in folder.iterdir()) == [1, 1]


def test_a_killed_compilation_is_done_again(folder, caplog):
    area()
    source = kill_in_the_midst(folder)
    module._announce.cache_clear()
    caplog.clear()  # the first area's line, heard where an earlier test has set the level
    started = time.perf_counter()
    with caplog.at_level(logging.INFO, "legfem"):
        assert area() == pytest.approx(2.0)
    assert time.perf_counter() - started < 8, "waited for a dead process"
    assert len(caplog.messages) == 1
    assert source.with_suffix(".c.cached").exists()


def test_a_living_compilation_is_waited_for(folder):
    area()
    source = kill_in_the_midst(folder)
    with (source.parent / "lock").open("a") as held:  # as a process that compiles does
        fcntl.flock(held, fcntl.LOCK_EX)
        areas: list[float] = []
        waiting = threading.Thread(target=lambda: areas.append(area()))
        waiting.start()
        waiting.join(0.5)
        assert waiting.is_alive()
        assert source.read_text() == "half of a fi"
    waiting.join()
    assert areas == [pytest.approx(2.0)]


def test_another_processor_has_another_folder(monkeypatch):
    module._processor.cache_clear()
    here = module.cache_folder()
    monkeypatch.setattr(module.platform, "machine", lambda: "another")
    module._processor.cache_clear()
    assert module.cache_folder() != here
    module._processor.cache_clear()
