"""Specimens with a mistake that a person would see: an error or a doubt that names the field."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from making_specimens import BAR, write_bars

import legfem as lf
from legfem.common.errors import InputError
from legfem.mechanics.materials import ReducedPolynomial
from legfem.report.answers import sentences_of
from legfem.specimens.schema import parse_specimen_file

type Change = Callable[[Path], None]
LAW = ReducedPolynomial(5e-3, 1.0, C20=5e-3)


def _tables(folder: Path) -> list[Path]:
    return sorted((folder / "recordings").glob("*.csv"))


def _each(change_of: Callable[[pd.DataFrame], pd.DataFrame], last: int | None = None) -> Change:
    def change(folder: Path) -> None:
        for path in _tables(folder)[:last]:
            change_of(pd.read_csv(path)).to_csv(path, index=False)

    return change


def _times(column: str, factor: float, last: int | None = None) -> Change:
    return _each(lambda table: table.assign(**{column: factor * table[column]}), last)


def _in_toml(old: str, new: str) -> Change:
    def change(folder: Path) -> None:
        text = (folder / "specimen.toml").read_text()
        assert old in text
        (folder / "specimen.toml").write_text(text.replace(old, new))

    return change


def _every(*changes: Change) -> Change:
    def change(folder: Path) -> None:
        for one in changes:
            one(folder)

    return change


def _copied(folder: Path) -> None:
    shutil.copy(_tables(folder)[0], folder / "recordings" / "again.csv")


def _three_times(folder: Path) -> None:
    """With a noise of its own: it is no copy."""
    table = pd.read_csv(folder / "recordings" / "middle.csv")
    noise = 0.01 * table["force_N"].max() * np.random.default_rng(3).standard_normal(len(table))
    again = table.assign(force_N=3.0 * table["force_N"] + noise)
    again.to_csv(folder / "recordings" / "again.csv", index=False)


def _thinned(folder: Path) -> None:
    pd.read_csv(_tables(folder)[0])[::2].to_csv(folder / "recordings" / "again.csv", index=False)


def _of_another_kind(folder: Path) -> None:
    shutil.copy(_tables(folder)[0], folder / "recordings" / "more.txt")


def _clipped(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(force_N=table["force_N"].clip(upper=0.4 * table["force_N"].max()))


def _counted(table: pd.DataFrame) -> pd.DataFrame:
    columns = ["displacement_mm", "force_N"]
    finer = np.linspace(0.0, len(table) - 1.0, 4 * len(table))
    more = {name: np.interp(finer, np.arange(len(table)), table[name]) for name in columns}
    return pd.DataFrame({"time_s": np.arange(len(finer)), **more})


MUSCLE = _in_toml("Made for a test", "Muscle of a pig")
WRONG: dict[str, tuple[Change, str]] = {
    "force in mN": (_times("force_N", 1e3), "force_N"),
    "force in kN": (_times("force_N", 1e-3), "force_N"),
    "muscle ten times too stiff": (_every(MUSCLE, _times("force_N", 10.0)), "force_N"),
    "one recording three times another of the same piece": (_three_times, "force_N"),
    "one recording in gf": (_times("force_N", 102.0, 1), "force_N"),
    "force of the other sign": (_times("force_N", -1.0), "force_N"),
    "force cut off": (_each(_clipped), "force_N"),
    "displacement in m": (_times("displacement_mm", 1e-3), "displacement_mm"),
    "displacement in micrometres": (_times("displacement_mm", 1e3), "displacement_mm"),
    "displacement of the other sign": (_times("displacement_mm", -1.0), "displacement_mm"),
    "displacement from another zero": (
        _each(lambda table: table.assign(displacement_mm=table["displacement_mm"] + 90.0)),
        "displacement_mm",
    ),
    "strain in percent": (_times("displacement_mm", 10.0), "displacement_mm"),
    "time in ms": (_times("time_s", 1e3), "time_s"),
    "time in minutes": (_times("time_s", 1 / 60), "time_s"),
    "time is the sample's number": (_each(_counted), "time_s"),
    "length in cm": (_in_toml("length_mm = 10.0", "length_mm = 1.0"), "displacement_mm"),
    "length in m": (_in_toml("length_mm = 10.0", "length_mm = 0.01"), "uniaxial.length_mm"),
    "area in cm2": (_in_toml("area_mm2 = 100.0", "area_mm2 = 1.0"), "uniaxial.area_mm2"),
    "area in m2": (_in_toml("area_mm2 = 100.0", "area_mm2 = 1e-4"), "uniaxial.area_mm2"),
    "a bar that buckles": (_in_toml("length_mm = 10.0", "length_mm = 60.0"), "area_mm2"),
    "a recording copied": (_copied, "force_N"),
    "a recording copied and thinned": (_thinned, "force_N"),
    "a file that isn't read": (_of_another_kind, "recordings"),
    "a name that is a path": (_in_toml('id = "bar"', 'id = "../../x"'), "id"),
}


def _told(folder: Path) -> list[str]:
    """Return what a run on a folder says is wrong or unlikely."""
    try:
        found = lf.identify(lf.load_specimen(folder), "neo-hookean")["neo-hookean"]
    except InputError as error:
        assert "\n" not in str(error)
        return [str(error)]
    doubts = [text for text in sentences_of([found]) if text.startswith("DOUBTFUL INPUT")]
    return [*doubts, *(one.reason for one in found.details.left_out)]


def test_sound_bars_are_not_doubted(tmp_path: Path) -> None:
    assert _told(write_bars(tmp_path, LAW)) == []


@pytest.mark.parametrize("wrong", WRONG)
def test_what_a_person_would_see_is_told_with_its_field(tmp_path: Path, wrong: str) -> None:
    change, field = WRONG[wrong]
    change(write_bars(tmp_path, LAW))
    told = _told(tmp_path)
    print(told)
    assert any(f": {field}" in text for text in told)


def test_what_is_no_repeat_is_told_once_a_file_and_so_it_is_of_few_samples(tmp_path: Path) -> None:
    _three_times(write_bars(tmp_path, LAW))
    told = _told(tmp_path)
    assert [sum(name in text for text in told) for name in ("again.csv", "middle.csv")] == [1, 1]
    for path in (tmp_path / "recordings" / name for name in ("middle.csv", "again.csv")):
        table = pd.read_csv(path)
        table[:: len(table) // 15].to_csv(path, index=False)
    assert any("times the stiffness" in text for text in _told(tmp_path))


def test_what_is_confirmed_is_not_doubted(tmp_path: Path) -> None:
    write_bars(tmp_path, LAW, 'confirmed = ["force_N"]\n' + BAR)
    _every(MUSCLE, _times("force_N", 10.0))(tmp_path)
    assert parse_specimen_file(tmp_path / "specimen.toml").confirmed == ["force_N"]
    assert _told(tmp_path) == []
