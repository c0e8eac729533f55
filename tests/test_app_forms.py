"""What the app asks: the file's form, columns, and what loose files are."""

import tomllib

import numpy as np
import pytest
from making import leg, press, write_contours, write_recording
from making_specimens import write_bars

from legfem.app.description import (
    contours_in,
    describe,
    known_tests,
    read_value,
    scans_in,
    settings_of,
    shown_errors,
    with_channels,
    with_settings,
)
from legfem.app.runs import ACTIONS
from legfem.common.errors import InputError
from legfem.common.input_files import checked
from legfem.common.resources import RESOURCES
from legfem.data.recording import SourceColumn, SourceColumns
from legfem.legs.loading import load_subject
from legfem.legs.schema import SubjectFile, subject_entry
from legfem.mechanics.materials import ReducedPolynomial
from legfem.specimens.folder import load_specimen
from legfem.specimens.schema import SpecimenFile, parse_specimen_file
from legfem.stockings.schema import LegFile, parse_leg_file

SUBJECT = RESOURCES / "frauziols" / "subjects" / "3"


INDENTER = {
    ("indenter", "diameter_mm"): 30.0,
    ("indenter", "length_mm"): 50.0,
    ("indenter", "aim_mm"): [0.0, 0.0],
    ("indenter", "direction_deg"): 90.0,
}


def test_a_form_changes_its_keys_and_leaves_the_files_comments(tmp_path):
    path = tmp_path / "subject.toml"
    text = (SUBJECT / "subject.toml").read_text()
    changed = with_settings(
        text, {("accuracy", "aim_sd_mm"): 1.5, ("section", "contours"): "a.csv", ("instrument", "force_range_N"): None}
    )
    given, now = tomllib.loads(text), tomllib.loads(changed)
    assert now.pop("accuracy") == {"aim_sd_mm": 1.5}
    assert now["section"].pop("contours") == "a.csv"
    del given["section"]["contours"], given["instrument"]["force_range_N"]
    assert now == given
    assert changed.count("#") == text.count("#")
    path.write_text(with_settings(text, {("accuracy", "aim_sd_mm"): 1.5}))
    assert subject_entry(path).given.accuracy.aim_sd_mm == 1.5


@pytest.mark.parametrize("schema", [SubjectFile, LegFile])
def test_the_form_has_every_number_of_the_schema(schema):
    names = {one.name for one in settings_of(schema, "")}
    if schema is SubjectFile:
        assert {"indenter.aim_mm", "tissues.fascia.D1_per_MPa", "instrument.force_sd_N"} <= names
    else:
        assert {"stocking.stiffness_N_per_mm", "tissues.deep.C10_kPa", "bare.scan"} <= names
    needed = {one.name for one in settings_of(SubjectFile, "") if one.needed}
    assert "indenter.diameter_mm" in needed and "accuracy.aim_sd_mm" not in needed


def test_what_is_typed_is_read_as_the_key_wants_it():
    known = {one.name: one for one in settings_of(SubjectFile, "")}
    assert read_value(known["indenter.aim_mm"], "1, -2.5") == [1.0, -2.5]
    assert read_value(known["indenter.diameter_mm"], " 30 ") == 30.0
    assert read_value(known["title"], "") is None
    for text in ("3O", "1,5", "nan"):
        with pytest.raises(InputError, match="not a number"):
            read_value(known["indenter.diameter_mm"], text)


def test_chosen_columns_are_what_the_folder_then_reads_by(tmp_path):
    channels = SourceColumns(SourceColumn("Zeit", "s"), SourceColumn("Weg", "mm", -1), SourceColumn("Kraft", "N", -1))
    path = tmp_path / "subject.toml"
    text = (SUBJECT / "subject.toml").read_text()
    path.write_text(with_channels(text, channels))
    assert subject_entry(path).given.recordings.channels() == channels
    assert subject_entry(path).given.recordings.starts_at_contact
    path.write_text(with_channels(path.read_text(), None))
    assert subject_entry(path).given == subject_entry(SUBJECT / "subject.toml").given


def test_loose_files_become_a_leg_that_lacks_nothing_but_the_instrument(tmp_path):
    folder = tmp_path / "my leg"
    folder.mkdir()
    (folder / "outline.csv").write_bytes((SUBJECT / "contours.csv").read_bytes())
    for trial in (SUBJECT / "recordings").iterdir():
        (folder / trial.name).write_bytes(trial.read_bytes())
    assert contours_in(folder) == ["outline.csv"]
    describe(folder, "subject.toml", {("section", "contours"): "outline.csv", **INDENTER})
    given = subject_entry(folder / "subject.toml").given
    assert (given.section.contours, given.indenter.diameter_mm) == ("outline.csv", 30.0)
    assert given.instrument is None and given.origin == "measured"
    assert sorted(p.name for p in folder.iterdir()) == ["outline.csv", "recordings", "subject.toml"]
    assert len(list((folder / "recordings").iterdir())) == 3


def test_what_the_recordings_show_can_stand_for_an_instrument_that_is_not_stated(tmp_path):
    described(tmp_path)
    force, displacement = shown_errors(tmp_path)
    path = tmp_path / "subject.toml"
    with pytest.raises(InputError, match="instrument: missing"):
        load_subject(tmp_path)
    stated = {("instrument", "force_sd_N"): force, ("instrument", "displacement_sd_mm"): displacement}
    path.write_text(with_settings(path.read_text(), stated))
    instrument = load_subject(tmp_path).instrument
    assert (instrument.force_sd, instrument.displacement_sd) == (force, displacement)
    assert shown_errors(tmp_path) is None
    assert shown_errors(SUBJECT) is None


def test_a_scan_takes_the_place_of_contours(tmp_path):
    (tmp_path / "leg.nii.gz").touch()
    cut = {("section", "scan"): "leg.nii.gz", ("section", "level_mm"): 300.0}
    describe(tmp_path, "subject.toml", {**cut, **INDENTER})
    section = subject_entry(tmp_path / "subject.toml").given.section
    assert (section.scan, section.contours, section.level_mm) == ("leg.nii.gz", None, 300.0)


def test_girth_and_fat_take_the_place_of_contours(tmp_path):
    write_recording(tmp_path / "trial1.csv", press())
    calf = {("section", "girth_mm"): 365.0, ("section", "fat_mm"): 9.0}
    unsaid = {("indenter", "aim_mm"): None, ("indenter", "direction_deg"): None}
    describe(tmp_path, "subject.toml", {**calf, **INDENTER, **unsaid})
    subject = load_subject(tmp_path, need_instrument=False)
    assert subject.typical_shape and len(subject.recordings) == 1
    assert str(subject.indenter) == "cylinder, 30 mm in diameter and 50 mm long"


def test_a_heel_pad_by_tape_is_described_without_muscle(tmp_path):
    write_recording(tmp_path / "trial1.csv", press())
    heel = {("section", "limb"): "heel pad", ("section", "girth_mm"): 240.0, ("section", "fat_mm"): 25.0}
    unsaid = {("indenter", "aim_mm"): None, ("indenter", "direction_deg"): None}
    describe(tmp_path, "subject.toml", {**heel, **INDENTER, **unsaid})
    section = load_subject(tmp_path, need_instrument=False).section
    assert section.lacks == ("muscle",) and section.limb == "heel"


def described(folder, length=50.0, **pressed):
    write_contours(folder / "outline.csv", leg())
    write_recording(folder / "trial1.csv", press())
    stated = {("indenter", key): value for key, value in {"length_mm": length, **pressed}.items()}
    describe(folder, "subject.toml", {("section", "contours"): "outline.csv", **INDENTER, **stated})
    return (folder / "subject.toml").read_text()


@pytest.mark.parametrize(
    ("length", "pressed", "told"),
    [
        (50.0, {}, "cylinder, 30 mm in diameter and 50 mm long"),
        (50.0, {"axis_deg": 90.0}, "cylinder, 30 mm in diameter and 50 mm long, across the leg"),
        (None, {"shape": "ball"}, "ball, 30 mm in diameter"),
        (None, {"shape": "punch"}, "flat punch, 30 mm in diameter"),
    ],
)
def test_what_pressed_a_leg_is_written_where_it_is_no_cylinder_along_it(tmp_path, length, pressed, told):
    text = described(tmp_path, length, **pressed)
    assert str(load_subject(tmp_path, need_instrument=False).indenter) == told
    stated = tomllib.loads(text)["indenter"]
    assert {key: stated[key] for key in ("shape", "axis_deg") if key in stated} == pressed
    assert ("length_mm" in stated) == (length is not None)


@pytest.mark.parametrize(
    ("length", "pressed", "line"),
    [
        (None, {}, "indenter.length_mm: missing; give the cylinder's length"),
        (None, {"shape": "ball", "axis_deg": 90.0}, "indenter.axis_deg: has no effect for a ball"),
        (-5.0, {}, "indenter.length_mm"),
        (None, {"shape": "cone"}, "indenter.shape"),
    ],
)
def test_what_cant_have_pressed_is_told_as_the_file_tells_it_and_nothing_is_moved(tmp_path, length, pressed, line):
    with pytest.raises(InputError) as told:
        described(tmp_path, length, **pressed)
    assert line in str(told.value)
    assert {path.name for path in tmp_path.iterdir()} == {"outline.csv", "trial1.csv"}
    own = {"diameter_mm": 30.0, "aim_mm": [0.0, 0.0], "direction_deg": 90.0, **pressed}
    own |= {} if length is None else {"length_mm": length}
    text = (SUBJECT / "subject.toml").read_text()
    with pytest.raises(InputError) as by_file:
        checked(tmp_path / "subject.toml", tomllib.loads(text) | {"indenter": own}, SubjectFile)
    assert str(by_file.value) == str(told.value)


def test_two_scans_become_a_leg_in_its_stocking(tmp_path):
    for name in ("bare.nii.gz", "in stocking.nii.gz", "notes.txt"):
        (tmp_path / name).touch()
    assert scans_in(tmp_path) == ["bare.nii.gz", "in stocking.nii.gz"]
    scans = {("bare", "scan"): "bare.nii.gz", ("compressed", "scan"): "in stocking.nii.gz"}
    describe(tmp_path, "leg.toml", {**scans, ("stocking", "compression_class"): "2"})
    given = parse_leg_file(tmp_path / "leg.toml")
    assert given.bare.scan == "bare.nii.gz" and given.stocking.compression_class == "2"


def _is_small(size: str, test: str) -> bool:
    """Whether a size is that of what presses or draws, and not the specimen's."""
    return test in size or size in ("opening_mm", "rim_mm")


COLUMNS_OF = {
    "suction": {"force_N": "pressure_kPa"},
    "torsion": {"displacement_mm": "angle_rad", "force_N": "torque_Nmm"},
}
"""What tests call the columns that are forces and displacements of others."""


@pytest.mark.parametrize("test", SpecimenFile.alternatives)
def test_recordings_become_specimens_that_lack_nothing(tmp_path, test):
    write_bars(tmp_path, ReducedPolynomial(5e-3, 1.0, 3e-3, np.inf))
    (tmp_path / "specimen.toml").unlink()
    for path in (tmp_path / "recordings").iterdir():
        for name, own in COLUMNS_OF.get(test, {}).items():
            path.write_text(path.read_text().replace(name, own))
        path.rename(tmp_path / path.name)
    stated = {
        one.key[-1]: one.choices[0] if one.choices else 10.0 if _is_small(one.key[-1], test) else 40.0
        for one in known_tests()[test]
        if one.needed
    }
    named = {(test, key): value for key, value in stated.items()}
    describe(tmp_path, "specimen.toml", {**named, (test, "never stated"): None})
    found = load_specimen(tmp_path)
    assert found.origin == "measured" and not found.left_out
    assert len(found.recordings) == len(list((tmp_path / "recordings").iterdir())) > 1
    given = parse_specimen_file(tmp_path / "specimen.toml").test
    assert {name: getattr(given, name) for name in stated} == stated
    names = {one.key[0] for one in settings_of(SpecimenFile, f"[{test}]\n")}
    assert names & set(SpecimenFile.alternatives) == {test}, "the form has no other test's numbers"


def test_every_field_of_every_form_says_what_it_is():
    text = "[channels.fat_thickness]\n"
    every = [*settings_of(SubjectFile, text), *settings_of(LegFile, ""), *settings_of(SpecimenFile, "")]
    every += [one for settings in known_tests().values() for one in settings]
    assert [one.name for one in every if not one.help] == []
    assert [
        choice.label for actions in ACTIONS.values() for one in actions for choice in one.choices if not choice.help
    ] == []
    assert "channels.fat_thickness.file" in {one.name for one in every}
    assert not any(one.name.startswith("channels") for one in settings_of(SubjectFile, "")), "only stated channels"


def test_levels_and_girths_of_a_leg_in_a_stocking_are_asked_for_one_by_one() -> None:
    text = "[bare]\ngirths_mm = {B = 215.0, C = 362.0}\n[stocking]\nlevels_mm = 5\n"
    known = {one.name: one for one in settings_of(LegFile, text)}
    assert [known[f"bare.girths_mm.{level}"].value for level in ("B", "B1", "C", "D")] == [215.0, None, 362.0, None]
    assert known["stocking.levels_mm.B1"].kind is float and known["stocking.levels_mm.B1"].value is None
    assert known["stocking.limits_percent.D"].kind is list and "stocking.limits_percent.B" not in known
    assert known["stocking.standard"].choices[:2] == ("RAL-GZ 387", "ENV 12718")
    changed = with_settings(text, {("bare", "girths_mm", "B1"): 268.0})
    assert tomllib.loads(changed)["bare"]["girths_mm"] == {"B": 215.0, "C": 362.0, "B1": 268.0}
