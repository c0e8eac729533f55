"""A leg without outlines: a typical limb of the measured girth and fat thickness."""

from __future__ import annotations

from pathlib import Path

import pytest
from making_identification import AnalyticLeg, curve_of
from making_results import measured_curve, result

from legfem.common.errors import InputError
from legfem.geometry.section import first_crossing, girth
from legfem.legs.forward import law_of
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.legs.site import site_test
from legfem.legs.typical import TYPICAL_LIMBS, Calf, calf_section
from legfem.legs.unknowns import unknowns_at
from legfem.report.kinds import page_of


def described(folder: Path, section: str, indenter: str = "") -> Path:
    """A bundled subject's recordings beside a section of sizes alone."""
    own = SUBJECTS.find("3")
    folder.mkdir()
    (folder / "recordings").symlink_to(own / "recordings")
    lines = (own / "subject.toml").read_text("utf-8").splitlines()
    kept = [line for line in lines if not line.startswith(("aim_mm", "direction_deg", "contours", "fascia_thickness"))]
    text = "\n".join(kept)
    text = text.replace("[section]", f"[section]\nfascia_thickness_mm = 0.6\n{section}")
    text = text.replace("[indenter]", f"[indenter]\n{indenter}")
    (folder / "subject.toml").write_text(text, "utf-8")
    return folder


@pytest.mark.parametrize(("around", "fat"), [(320.0, 4.0), (365.0, 9.0), (420.0, 22.0)])
def test_a_calf_has_the_girth_and_the_fat_that_were_measured(tmp_path: Path, around: float, fat: float):
    subject = load_subject(described(tmp_path / "leg", f"girth_mm = {around}\nfat_mm = {fat}"), need_recordings=False)
    section, line = subject.section, (subject.indenter.aim, subject.indenter.direction)
    skin, fascia = (first_crossing(section.polygon(name).exterior, *line) for name in ("skin", "fascia"))
    assert girth(section) == pytest.approx(around, rel=1e-3)
    assert fascia - skin == pytest.approx(fat, rel=0.02)
    assert subject.typical_shape == "calf"
    found = result("neo-hookean", measured_curve(depth=4.0), subject)
    (row,) = [one for one in page_of([found]).known if "girth" in one.name]
    assert (row.provenance, row.source, row.value) == ("assumed", "subject.toml", f"{around:.0f} mm")


@pytest.mark.parametrize(
    ("limb", "around", "fat", "bones"),
    [
        ("thigh", 540.0, 14.0, ("femur",)),
        ("forearm", 250.0, 5.0, ("radius", "ulna")),
        ("upper arm", 300.0, 8.0, ("humerus",)),
    ],
)
def test_another_limb_has_its_bones_its_sizes_and_its_side(tmp_path: Path, limb: str, around: float, fat: float, bones):
    sizes = f'limb = "{limb}"\ngirth_mm = {around}\nfat_mm = {fat}'
    subject = load_subject(described(tmp_path / "leg", sizes), need_recordings=False)
    section, line = subject.section, (subject.indenter.aim, subject.indenter.direction)
    skin, fascia = (first_crossing(section.polygon(name).exterior, *line) for name in ("skin", "fascia"))
    assert (section.limb, *section.bones) == (limb, *bones)
    assert girth(section) == pytest.approx(around, rel=1e-3)
    assert fascia - skin == pytest.approx(fat, rel=0.02)
    assert subject.indenter.direction == pytest.approx([0.0, -1.0], abs=1e-12)  # from the front
    known = page_of([result("neo-hookean", measured_curve(depth=4.0), subject)]).known
    (row,) = [one for one in known if "girth" in one.name]
    assert f"a typical {limb} was scaled to it" in str(row)


def test_the_interval_carries_the_error_of_the_shape(tmp_path: Path):
    subject = load_subject(described(tmp_path / "leg", "girth_mm = 365\nfat_mm = 8"))
    curve, values = curve_of(3.0, 0.0), {"deep.C10": 0.003}
    test, law = site_test(subject, None), law_of("neo-hookean", subject, AnalyticLeg().nominal)
    predicted = test.every_reading(curve, values)
    # Of a leg in 3D no outline is displaced, and the shape is a share of the force.
    (shape,) = (one for one in unknowns_at(test, subject, curve, values, None, law, {}) if one.source == "shape")
    assert shape.effect == pytest.approx(TYPICAL_LIMBS["calf"].force_sd * predicted)


@pytest.mark.parametrize(
    ("section", "indenter", "field", "words"),
    [
        ("girth_mm = 365", "", "fat_mm", "both girth_mm and fat_mm"),
        ("fat_mm = 8", "", "scan", "girth_mm with fat_mm"),
        ('contours = "contours.csv"\ngirth_mm = 365\nfat_mm = 8', "", "scan", "2 sources"),
        ("girth_mm = 36.5\nfat_mm = 8", "", "girth_mm", "at least 150, in mm (if it is in cm, multiply it by 10)"),
        ("girth_mm = 365\nfat_mm = 8", "aim_mm = [0.0, 0.0]", "indenter.aim_mm", "from behind"),
        ("girth_mm = 240\nfat_mm = 38", "", "section.fat_mm", "make no calf"),
        ('girth_mm = 240\nfat_mm = 38\nlimb = "forearm"', "", "section.fat_mm", "make no forearm"),
        ('girth_mm = 240\nfat_mm = 8\nlimb = "wing"', "", "section.limb", "forearm"),
        (
            'girth_mm = 240\nfat_mm = 8\nlimb = "thigh"',
            "aim_mm = [0.0, 0.0]",
            "indenter.aim_mm",
            "thigh is pressed from the",
        ),
        ('contours = "contours.csv"\nlimb = "thigh"', "", "limb", "without a girth"),
    ],
)
def test_sizes_that_make_no_leg_are_refused_in_one_line(tmp_path: Path, section: str, indenter: str, field, words):
    with pytest.raises(InputError) as told:
        load_subject(described(tmp_path / "leg", section, indenter))
    assert field in told.value.field
    assert words in str(told.value)


def test_fat_behind_is_given_not_its_mean():
    assert Calf.with_fat_behind(365.0, 8.0, 0.6).fat_mm < 8.0
    assert girth(calf_section(Calf.with_fat_behind(365.0, 8.0, 0.6))) == pytest.approx(365.0, rel=1e-3)
