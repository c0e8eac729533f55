"""Files of a report come together or not at all; tables in Markdown."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from legfem.common.documents import markdown_table
from legfem.jobs.store import write_arrays
from legfem.report.folder import REPORT, made_in_place


def test_files_and_folders_are_moved_into_place_the_report_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "results"
    (out / "fields.bp").mkdir(parents=True)
    (out / "fields.bp" / "old").touch()
    moved: list[str] = []
    replace = Path.replace

    def noted(self: Path, target: Path) -> Path:
        moved.append(self.name)
        return replace(self, target)

    with made_in_place(out) as folder:
        for name in (REPORT, "a.png", "z.svg"):
            (folder / name).write_text(name)
        (folder / "fields.bp").mkdir()
        (folder / "fields.bp" / "new").touch()
        assert not (out / "a.png").exists()
        monkeypatch.setattr(Path, "replace", noted)
    assert sorted(moved) == sorted({REPORT, "a.png", "z.svg", "fields.bp"}) and moved[-1] == REPORT
    assert {path.name for path in out.iterdir()} == set(moved)
    assert [path.name for path in (out / "fields.bp").iterdir()] == ["new"]


def test_nothing_is_left_of_a_report_that_fails(tmp_path: Path) -> None:
    (tmp_path / REPORT).write_text("the last one")
    with pytest.raises(KeyboardInterrupt), made_in_place(tmp_path) as folder:
        (folder / REPORT).write_text("half")
        raise KeyboardInterrupt
    assert [path.name for path in tmp_path.iterdir()] == [REPORT]
    assert (tmp_path / REPORT).read_text() == "the last one"


def test_tables_in_markdown() -> None:
    rows = [["a", "1"], ["b|c", "22"]]
    assert markdown_table(["name", "n"], rows) == ("| name | n |\n|---|---|\n| a | 1 |\n| borc | 22 |\n")
    assert markdown_table(["name", "n"], rows, aligned=True) == (
        "| name | n  |\n|------|----|\n| a    | 1  |\n| borc | 22 |\n"
    )


def test_a_full_disk_names_the_folder(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="No space") as raised, made_in_place(tmp_path / "out"):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert raised.value.filename == str(tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


def test_arrays_that_find_no_room_leave_nothing(tmp_path: Path, monkeypatch) -> None:
    def full(handle: int) -> None:
        os.ftruncate(handle, 10)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space") as raised:
        write_arrays(tmp_path / "a.npz", {"x": np.zeros(3)})
    assert raised.value.filename == str(tmp_path / "a.npz") and list(tmp_path.iterdir()) == []
