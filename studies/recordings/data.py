"""Reading the two public sets of recordings, and writing them as folders of specimens."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from legfem.common.errors import InputError
from legfem.data import Recording

MEAT, PHANTOMS = "meat_indentation", "phantom_compression"
_TIDY = ("test", "time_s", "force_N", "indentation_mm", "tool_gap_mm")
_SUMMARY = ("test", "material", "gap0_mm(specimen thickness)")
_PHANTOM = ("Time (s)", "Compression (mm)", "Load (N)")


@dataclass(frozen=True, eq=False)
class MeatTest:
    """An indentation of beef or of silicone."""

    recording: Recording
    material: str
    """``beef_FF``, ``beef_RDG`` or ``silicone_P002``."""
    thickness: float
    """Of the specimen (mm)."""

    @property
    def name(self) -> str:
        """Of the test with its day, ``230331|RDG1 1A``: several days have tests of one name."""
        return self.recording.trial


@dataclass(frozen=True, eq=False)
class Phantom:
    """A silicone cylinder's compression."""

    recording: Recording
    radius: float
    """mm."""
    height: float
    """mm."""


def read_meat(data: Path) -> dict[str, MeatTest]:
    """Read all indentation tests under the folder of the data, by name.

    Raises
    ------
    InputError
        If the folder or a file isn't there, or a column is missing.
    """
    folder = _folder(data, MEAT)
    tidy = _table(folder / "tests_tidy.csv", _TIDY)
    summary = _table(folder / "tests_summary.csv", _SUMMARY).set_index("test")
    tests = {}
    for name, rows in tidy.groupby("test", sort=False):
        if name not in summary.index:
            raise InputError(folder / "tests_summary.csv", "test", f"has no row {name}", "download both again")
        row = summary.loc[name]
        recording = Recording(
            rows["time_s"].to_numpy(float),
            rows["indentation_mm"].to_numpy(float),
            rows["force_N"].to_numpy(float),
            str(name),
            folder / "tests_tidy.csv",
        )
        test = MeatTest(recording, str(row["material"]), float(row[_SUMMARY[2]]))
        tests[test.name] = test
    return tests


def read_phantoms(data: Path, kind: str) -> tuple[Phantom, ...]:
    """Read the compressions of one kind of phantom, for example ``EF10_75T``.

    Raises
    ------
    InputError
        As `read_meat`.
    """
    folder = _folder(data, PHANTOMS)
    files = sorted((folder / kind).glob("*.csv"))
    if not files:
        raise InputError(folder, kind, "there are no recordings", "check the folder's name")
    return tuple(_phantom(path) for path in files)


def phantom_kinds(data: Path) -> tuple[str, ...]:
    """Return the names of the phantoms that there are recordings of."""
    return tuple(sorted(p.name for p in _folder(data, PHANTOMS).iterdir() if p.is_dir()))


def _phantom(path: Path) -> Phantom:
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    header = next((k for k, line in enumerate(lines) if line.startswith(_PHANTOM[0])), None)
    if header is None:
        raise InputError(path, "header", f"has no column {_PHANTOM[0]}", "download the file again")
    table = _table(path, _PHANTOM, skip=header)
    time = table[_PHANTOM[0]].to_numpy(float)
    kept = np.concatenate([[True], np.diff(time) > 0])
    recording = Recording(
        time[kept], table[_PHANTOM[1]].to_numpy(float)[kept], table[_PHANTOM[2]].to_numpy(float)[kept], path.stem, path
    )
    diameter = _size(path, lines[:header], "Cylinder Diameter")
    return Phantom(recording, diameter / 2, _size(path, lines[:header], "Cylinder Height"))


def _size(path: Path, lines: list[str], what: str) -> float:
    """Return a length from a line such as ``Cylinder Height: 30mm;``."""
    for line in lines:
        if line.startswith(what):
            try:
                return float(line.partition(":")[2].strip(" ;").removesuffix("mm"))
            except ValueError:
                break
    raise InputError(path, what, "is not stated in mm", "download the file again")


def _folder(data: Path, name: str) -> Path:
    folder = data / name
    if not folder.is_dir():
        raise InputError(
            "--data", str(folder), "is not there", "see studies/recordings/README.md for where to get the recordings"
        )
    return folder


def _table(path: Path, columns: tuple[str, ...], skip: int = 0) -> pd.DataFrame:
    if not path.is_file():
        raise InputError(path, "file", "not found", "see studies/recordings/README.md")
    table = pd.read_csv(path, skiprows=skip)
    missing = [name for name in columns if name not in table.columns]
    if missing:
        raise InputError(path, "header", f"has no column {missing[0]}", "download the file again")
    return table.dropna(subset=list(columns))
