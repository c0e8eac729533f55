"""Folders of specimens: what is read of them, and what is told of bad ones."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from making_specimens import BAR, PLANTED, compressed, ramp, record, write_bars

import legfem as lf
from legfem.common.errors import InputError


def test_a_bad_recording_costs_itself_alone(tmp_path: Path) -> None:
    write_bars(tmp_path, PLANTED)
    (tmp_path / "recordings" / "letters.csv").write_text("time_s,displacement_mm,force_N\na,b,c\n")
    time, d = ramp(3.0, 6.0)
    record(tmp_path, "slack", time, d, 0 * d)
    record(tmp_path, "pulled", time, d, -compressed(PLANTED, d))
    folder = lf.load_specimen(tmp_path)
    assert [one.name for one in folder.recordings] == ["fast", "middle", "slow"]
    reasons = {one.name: one.reason for one in folder.left_out}
    assert set(reasons) == {"letters", "slack", "pulled"}
    assert "not a number" in reasons["letters"] and "never touches" in reasons["slack"]
    assert "change its sign" in reasons["pulled"]
    found = lf.identify(folder, "neo-hookean")
    assert "Not used: slack" in found.summary()


def test_an_instruments_files_are_the_same_recordings(bars: Path, tmp_path: Path) -> None:
    """In another order, force with the other sign, metres, ms, semicolons, and as xlsx."""
    channels = """
[recordings.time]
column = "Time"
unit = "ms"
[recordings.displacement]
column = "Crosshead"
unit = "m"
[recordings.force]
column = "Load"
unit = "N"
sign = -1
"""
    (tmp_path / "recordings").mkdir()
    (tmp_path / "specimen.toml").write_text(BAR + channels)
    plain = lf.load_specimen(bars)
    for one in plain.recordings:
        table = pd.read_csv(bars / "recordings" / f"{one.name}.csv")
        written = pd.DataFrame(
            {"Load": -table["force_N"], "Time": 1e3 * table["time_s"], "Crosshead": 1e-3 * table["displacement_mm"]}
        )
        path = tmp_path / "recordings" / one.name
        if one.name == "slow":
            written.to_excel(path.with_suffix(".xlsx"), index=False)
        else:
            written.to_csv(path.with_suffix(".csv"), sep=";", index=False)
    (tmp_path / "recordings" / "notes.docx").write_text("not a recording")
    read = lf.load_specimen(tmp_path)
    assert [one.name for one in read.recordings] == ["fast", "middle", "slow"]
    assert not read.left_out
    for one, other in zip(plain.recordings, read.recordings, strict=True):
        for name in ("time", "displacement", "force"):
            wanted = getattr(one.course.samples, name)
            assert getattr(other.course.samples, name) == pytest.approx(wanted), name


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("[uniaxial]", "[unaxial]"), "did you mean 'uniaxial'?"),
        (("[uniaxial]", "[plates]\n[uniaxial]"), "2 tests are given"),
        (("length_mm = 10.0\n", ""), "length_mm: missing"),
        (
            ("[recordings]", '[[specimen]]\nname = "a"\nrecordings = ["none.csv"]\n[recordings]'),
            "there is no file 'none.csv'",
        ),
        (
            ("[recordings]", '[[specimen]]\nname = "a"\nlenth_mm = 3.0\nrecordings = ["*"]\n[recordings]'),
            "did you mean 'length_mm'?",
        ),
        (
            ("[recordings]", '[[specimen]]\nname = "a"\nwidth_mm = 3.0\nrecordings = ["recordings/*"]\n[recordings]'),
            "width_mm: is not a size of this test",
        ),
        (
            ("[recordings]", 2 * '[[specimen]]\nname = "a"\nrecordings = ["recordings/*"]\n' + "[recordings]"),
            "'a' stands 2 times",
        ),
        (
            (
                "[recordings]",
                '[[specimen]]\nname = "a"\nrecordings = ["recordings/*", "recordings/slow.csv"]\n[recordings]',
            ),
            "slow.csv' stands 2 times",
        ),
        (("[recordings]", '[[specimen]]\nname = "a"\nrecordings = ["../*"]\n[recordings]'), "leaves the folder"),
    ],
)
def test_what_is_wrong_in_a_folder_is_one_line(bars: Path, tmp_path: Path, change, words) -> None:
    (tmp_path / "specimen.toml").write_text(BAR.replace(*change))
    (tmp_path / "recordings").symlink_to(bars / "recordings")
    with pytest.raises(InputError) as error:
        lf.load_specimen(tmp_path)
    assert words in str(error.value) and "\n" not in str(error.value)
