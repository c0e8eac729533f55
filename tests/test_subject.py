"""The subject folder: what loads, and what a person is told when it doesn't."""

from __future__ import annotations

import numpy as np
import pytest
from making import CROSSCHECK, TOML, write_subject

from legfem.common.errors import InputError
from legfem.data.folder import Catalogue
from legfem.legs.loading import load_subject


def test_a_folder_loads_in_internal_units(tmp_path):
    subject = load_subject(write_subject(tmp_path / "leg", trials=2))
    assert subject.id == "made"
    assert subject.origin == "simulated"
    assert subject.indenter.radius == 15.0
    assert subject.indenter.direction == pytest.approx([0.0, 1.0])
    given = [subject.tissues[name].C10 for name in ("superficial", "fascia")]
    assert given == pytest.approx([0.002, 0.1])
    assert subject.tissues["deep"].C10 is None
    assert subject.tissues["deep"].D2 == 28.0
    assert subject.tissues["fascia"].D2 is None
    assert subject.section.fascia_thickness == 0.6
    assert [r.trial for r in subject.recordings] == ["trial1", "trial2"]


def test_what_is_given_cannot_be_changed(tmp_path):
    subject = load_subject(write_subject(tmp_path / "leg"))
    with pytest.raises(ValueError, match="read-only"):
        subject.recordings[0].force[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        subject.section.skin[0] = 1.0
    with pytest.raises(TypeError):
        subject.tissues["deep"] = subject.tissues["fascia"]


def test_accuracy_becomes_a_standard_deviation(tmp_path):
    toml = TOML.replace("force_sd_N = 0.04", "force_accuracy_percent = 0.25\nforce_range_N = 100")
    toml = toml.replace("displacement_sd_mm = 0.02", "displacement_accuracy_mm = 0.25")
    instrument = load_subject(write_subject(tmp_path / "leg", toml)).instrument
    assert instrument.force_sd == pytest.approx(0.25 / np.sqrt(3))
    assert instrument.displacement_sd == pytest.approx(0.25 / np.sqrt(3))


def test_recordings_are_needed_unless_waived(tmp_path):
    folder = write_subject(tmp_path / "leg", trials=0)
    assert load_subject(folder, need_recordings=False).recordings == ()
    with pytest.raises(InputError, match="there are no recordings"):
        load_subject(folder)


@pytest.mark.parametrize(
    ("old", "new", "field", "words"),
    [
        ("C10_kPa = 2.0", "C10_kpa = 2.0", "tissues.superficial.C10_kpa", "mean 'C10_kPa'"),
        ("diameter_mm", "diameter_cm", "indenter.diameter_cm", "mean 'diameter_mm'"),
        ("[section]", "[sections]", "sections", "mean 'section'"),
        ("C10_kPa = 2.0", "C10_kPa = -2.0", "tissues.superficial.C10_kPa", "above 0"),
        ("D1_per_MPa = 28.0", "D1_per_MPa = 0.0", "tissues.deep.D1_per_MPa", "above 0"),
        ("diameter_mm = 30.0", "diameter_mm = 0.0", "indenter.diameter_mm", "at least 1"),
        ("diameter_mm = 30.0", "diameter_mm = nan", "indenter.diameter_mm", "write a number"),
        ("diameter_mm = 30.0", 'diameter_mm = "30"', "indenter.diameter_mm", "without quotes"),
        ("direction_deg = 90.0", "", "indenter.direction_deg", "missing"),
        ("aim_mm = [0.0, 0.0]", "aim_mm = [0.0]", "indenter.aim_mm", "give 2 or more"),
        ("aim_mm = [0.0, 0.0]", "aim_mm = [90.0, 0.0]", "indenter.aim_mm", "misses the leg"),
        ("C10_kPa = 100.0", "", "tissues.fascia.C10_kPa", "missing"),
        ('"reduced-polynomial"', '"yeoh"', "tissues.deep.law", "reduced-polynomial"),
        ('"reduced-polynomial"', '"neo-hookean"', "tissues.deep.D2_per_MPa", "remove"),
        ('"simulated"', '"invented"', "origin", "measured"),
        ('id = "made"', 'id = "../../x"', "id", "begin with a letter or digit"),
        ('id = "made"', 'id = "a/b"', "id", "is not a plain name"),
        ('id = "made"', 'id = ""', "id", "is not a plain name"),
        ("force_sd_N = 0.04", "force_sd_N = 0.0", "instrument.force_sd_N", "above 0"),
        ("force_sd_N = 0.04", "", "instrument.force_sd_N", "force_accuracy_percent"),
        ("force_sd_N = 0.04", "force_range_N = 100.0", "instrument.force_accuracy_percent", "missing"),
        ("force_sd_N = 0.04", "force_sd_N = 0.04\nforce_range_N = 100.0", "instrument.force_sd_N", "either"),
        ("fascia_thickness_mm = 0.6", "fascia_thickness_mm = -0.6", "section.fascia_thickness_mm", "at least 0"),
        ("fascia_thickness_mm = 0.6", "fascia_thickness_mm = 0,6", "TOML", "points"),
        ('"contours.csv"', '"contour.csv"', "section.contours", "no file 'contour.csv'"),
    ],
)
def test_bad_subject_files_are_explained(tmp_path, old, new, field, words):
    assert old in TOML
    folder = write_subject(tmp_path / "leg", TOML.replace(old, new, 1))
    with pytest.raises(InputError) as caught:
        load_subject(folder)
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(f"{folder / 'subject.toml'}: {field}: ")
    assert words in line
    assert caught.value.remedy
    assert caught.value.unsaid == ("missing;" in line)


def test_missing_folder_and_file_are_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere.*not found"):
        load_subject(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"subject\.toml: file: not found"):
        load_subject(tmp_path)


def test_an_unknown_subject_is_told_of_the_known(tmp_path):
    write_subject(tmp_path / "1")
    write_subject(tmp_path / "2")
    catalogue = Catalogue(tmp_path, "subject.toml")
    assert catalogue.find("2") == tmp_path / "2"
    with pytest.raises(InputError, match="known subjects are 1, 2"):
        catalogue.find("5")


@pytest.mark.parametrize("law", ["neo-hookean", "reduced-polynomial"])
def test_the_crosscheck_folders_load(law):
    subject = load_subject(CROSSCHECK / law)
    assert subject.tissues["deep"].law == law
    assert [len(r) for r in subject.recordings] == [501, 501, 501]
