"""What is seen in a folder before anything is solved."""

import json
import os
import shutil
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from legfem.app.description import with_channels
from legfem.commands.data import app
from legfem.common.errors import InputError
from legfem.common.resources import RESOURCES
from legfem.geometry.section import girth
from legfem.legs.loading import load_subject
from legfem.report.preview import preview_of

SUBJECT = RESOURCES / "frauziols" / "subjects" / "3"
SPECIMEN = Path(__file__).resolve().parents[1] / "examples" / "specimen"


@pytest.fixture
def leg(tmp_path):
    """Return a leg with one trial."""
    leg = Path(shutil.copytree(SUBJECT, tmp_path / "leg"))
    for trial in ("trial2.csv", "trial3.csv"):
        (leg / "recordings" / trial).unlink()
    return leg


def changed(folder, old, new):
    toml = folder / "subject.toml"
    assert old in toml.read_text()
    toml.write_text(toml.read_text().replace(old, new))


def test_a_leg_is_seen_with_its_section_and_recordings(leg, tmp_path):
    seen = preview_of(leg, tmp_path)
    facts = dict(seen.facts)
    assert seen.trouble == "" and seen.doubts == () and seen.origin == "reconstructed"
    assert facts["girth"] == f"{girth(load_subject(leg).section):.0f} mm"
    assert facts["trials"] == "1" and "usual" in facts["how well the leg is known"]
    assert [one.grade for one in seen.recordings] == ["B"]
    pictures = [file for file, _ in seen.pictures] + [one.picture for one in seen.recordings]
    assert all((tmp_path / name).stat().st_size > 5000 for name in pictures)


def test_what_is_unlikely_is_said_before_anything_is_solved(leg, tmp_path):
    changed(leg, "diameter_mm = 30.0", "diameter_mm = 15.0")
    seen = preview_of(leg, tmp_path)
    assert seen.trouble == ""
    assert "indenter.diameter_mm" in seen.doubts[0] and "radius" in seen.doubts[0]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("diameter_mm = 30.0", "diameter_mm = -1.0"),
        ("aim_mm = [0.0000, 0.0000]", "aim_mm = [900.0, 0.0]"),
        ("contours.csv", "nothing.csv"),
        ("[indenter]", "[indentor]"),
        ("force_range_N = 100.0", ""),
    ],
)
def test_a_bad_folder_gives_the_line_with_which_the_commands_refuse_it(leg, tmp_path, capsys, old, new):
    changed(leg, old, new)
    with pytest.raises(InputError) as refused:
        load_subject(leg)
    out = tmp_path / "seen"
    with pytest.raises(SystemExit) as ended:
        app(["preview", str(leg), "--out", str(out)])
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"{refused.value}\n"
    assert json.loads((out / "preview.json").read_text())["trouble"] == str(refused.value)


def test_files_of_an_instrument_are_read_before_the_folder_says_what_they_are(leg, tmp_path):
    (leg / "subject.toml").unlink()
    trial = leg / "recordings" / "trial1.csv"
    rows = [line.split(",") for line in trial.read_text().splitlines()[1:]]
    lines = [";".join((t, f"{100 - float(d)}", f"{-float(f)}")) for t, d, f in rows]
    trial.write_text("\n".join(["Zeit [s];Weg [mm];Kraft [N]", *lines]).replace(".", ","))
    (leg / "recordings" / "trial2.csv").write_text("no table\n")
    seen = preview_of(leg, tmp_path)
    assert "contains no subject.toml" in seen.trouble
    first, second = seen.recordings
    assert (first.channels.displacement.column, first.channels.displacement.sign) == ("Weg", -1)
    assert (first.columns[0].name, first.columns[0].unit) == ("Zeit", "s")
    assert second.channels is None and "trial2.csv" in second.trouble
    assert "contours.csv" not in [one.file for one in seen.recordings]


def test_a_folder_of_other_files_says_that_none_is_a_recording(tmp_path):
    folder = tmp_path / "other"
    folder.mkdir()
    (folder / "photo.jpg").write_bytes(b"\xff\xd8\xff")
    (folder / "notes.txt").write_text("hello\n")
    assert "nor a recording that can be read" in preview_of(folder, tmp_path).trouble
    rows = "".join(f"{0.1 * k:.1f};{0.04 * k:.3f};{0.002 * k * k:.4f}\n" for k in range(200))
    (folder / "essai.csv").write_text(f"foo;bar;baz\n{rows}")
    seen = preview_of(folder, tmp_path)
    assert "nor a recording" not in seen.trouble, "its columns can be mapped"
    (table,) = (one for one in seen.recordings if one.file == "essai.csv")
    assert [column.name for column in table.columns] == ["foo", "bar", "baz"] and table.trouble


def test_specimens_are_seen_with_what_each_was_driven_to(tmp_path):
    seen = preview_of(SPECIMEN, tmp_path)
    assert seen.trouble == "" and len(seen.facts) == len(seen.recordings) == 3
    assert "mm/s" in dict(seen.facts)["fast"]
    # 3 mm are enough for a specimen of 10 mm, and its holds are sampled ever more slowly: the one
    # gap is a step of 0.05 s between some of 0.017 and 0.005 s.
    assert {one.grade for one in seen.recordings} <= {"A", "B"}
    gaps = {one.file for one in seen.recordings if any("dropped" in why for why in one.reasons)}
    assert gaps == {"fast.csv"}


@pytest.mark.slow
def test_a_leg_in_its_stocking_is_seen_at_the_heights_that_are_compared(tmp_path):
    seen = preview_of(RESOURCES / "dubuis" / "subjects" / "1", tmp_path)
    assert seen.trouble == ""
    assert "to be found" in dict(seen.facts)["stiffness"]
    assert (tmp_path / "slices.png").stat().st_size > 20_000


def test_a_name_that_is_no_text_is_said_where_a_folder_or_a_file_is_looked_at(leg, tmp_path):
    """A picture's title can't show it."""
    (one,) = (leg / "recordings").glob("*.csv")
    odd = one.rename(os.fsdecode(os.fsencode(one.parent) + b"/f\xff.csv"))
    seen = preview_of(leg, tmp_path)
    assert "can't be shown" in seen.trouble
    assert [(row.file, "can't be shown" in row.trouble) for row in seen.recordings] == [("f?.csv", True)]
    seen.write(tmp_path)
    run = CliRunner().invoke(app, ["look", str(odd), "--out", str(tmp_path / "out")])
    assert run.exit_code == 2 and "can't be shown" in run.output


@pytest.mark.parametrize("beside", [False, True], ids=["instead of the recordings", "beside them"])
def test_a_described_leg_that_gets_a_workbook_is_told_what_to_click_and_reads_it_then(leg, tmp_path, beside):
    (own,) = (leg / "recordings").glob("*.csv")
    readings = pd.read_csv(own, comment="#").set_axis(["Zeit (s)", "Weg (mm)", "Kraft (N)"], axis="columns")
    readings.to_excel(leg / "recordings" / "left calf.xlsx", index=False)
    if not beside:
        own.unlink()
    seen = preview_of(leg, tmp_path)
    (said,) = seen.doubts if beside else (seen.trouble,)
    assert "choose their columns under Columns in the app" in said
    book = next(one for one in seen.recordings if one.file == "left calf.xlsx")
    assert not book.trouble and book.channels is not None, "what is proposed there needs no more than a click"
    own.unlink(missing_ok=True)
    toml = leg / "subject.toml"
    toml.write_text(with_channels(toml.read_text(), book.channels))
    again = preview_of(leg, tmp_path)
    assert (again.trouble, [one.file for one in again.recordings]) == ("", ["left calf.xlsx"])


def test_a_preview_of_columns_that_are_not_told_apart_says_what_to_click_before_a_command(leg, tmp_path):
    (own,) = (leg / "recordings").glob("*.csv")
    pd.read_csv(own, comment="#").set_axis(["Zeit (s)", "L", "Kraft (N)"], axis="columns").to_csv(own, index=False)
    for said in (one.trouble for one in preview_of(leg, tmp_path).recordings):
        assert "choose it under Columns in the app, or run legfem data look" in said
