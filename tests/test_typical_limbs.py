"""A leg without outlines: a typical limb of the measured girth and fat thickness."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tomlkit
from making_identification import AnalyticLeg, curve_of
from making_results import measured_curve, result
from shapely import Polygon

from legfem.common.errors import InputError
from legfem.geometry.section import fat_thickness, first_crossing, girth
from legfem.inverse.library import NuisanceChanges
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


def pad(folder: Path, sizes: str) -> Path:
    """The same of a limb that is one tissue, whose thickness reaches to the bone."""
    path = described(folder, sizes) / "subject.toml"
    text = path.read_text("utf-8").replace("fascia_thickness_mm = 0.6", "fascia_thickness_mm = 0")
    document = tomlkit.parse(text)
    document["tissues"] = {"pad": {"law": "neo-hookean", "D1_per_MPa": 28.0}}
    path.write_text(tomlkit.dumps(document), "utf-8")
    return folder


def test_a_heel_pad_reaches_to_the_bone(tmp_path: Path):
    sizes = 'limb = "heel pad"\ngirth_mm = 220\nfat_mm = 15'
    subject = load_subject(pad(tmp_path / "heel", sizes), need_recordings=False)
    section, line = subject.section, (subject.indenter.aim, subject.indenter.direction)
    assert section.lacks == ("muscle",)
    assert girth(section) == pytest.approx(220.0, rel=1e-3)
    assert fat_thickness(section, *line) == pytest.approx(15.0, rel=0.01)
    assert subject.indenter.direction == pytest.approx([0.0, 1.0], abs=1e-12)  # from below
    with pytest.raises(InputError, match=r"fascia_thickness_mm: is 0.6 of a heel pad; give 0"):
        load_subject(described(tmp_path / "leg", sizes))
    with pytest.raises(InputError, match=r"fascia_thickness_mm: is 0 of a thigh; give a thickness"):
        load_subject(pad(tmp_path / "thigh", sizes.replace("heel pad", "thigh")))


def test_a_residual_limb_has_the_proportions_of_its_source(tmp_path: Path):
    sizes = 'limb = "residual limb"\ngirth_mm = 300\nfat_mm = 8'
    section = load_subject(described(tmp_path / "leg", sizes), need_recordings=False).section
    width, depth = np.ptp(section.skin, axis=0)
    # OpenLimb's mean shape, halfway down: a skin of 271 by 231 in its units and 126 in the mean, the fibula 11.2.
    mean = 300 / (2 * np.pi)
    assert width / depth == pytest.approx(271 / 231, rel=0.04)
    tibia, fibula = (Polygon(section.bones[name]) for name in ("tibia", "fibula"))
    assert np.sqrt(fibula.area / np.pi) / mean == pytest.approx(11.2 / 126, rel=0.1)
    assert tibia.centroid.y / mean == pytest.approx(0.44, abs=0.04)


@pytest.mark.parametrize("limb", ["calf", "residual limb"])
def test_a_slim_leg_by_tape_has_slim_bones(tmp_path: Path, limb: str):
    sizes = f'limb = "{limb}"\ngirth_mm = 240\nfat_mm = 8'
    section = load_subject(described(tmp_path / "leg", sizes), need_recordings=False).section
    assert np.sqrt(Polygon(section.bones["tibia"]).area / np.pi) < 10.0


def test_the_interval_carries_the_error_of_the_shape(tmp_path: Path):
    subject = load_subject(described(tmp_path / "leg", "girth_mm = 365\nfat_mm = 8"))
    curve, values = curve_of(3.0, 0.0), {"deep.C10": 0.003}
    test, law = site_test(subject, None), law_of("neo-hookean", subject, AnalyticLeg().nominal)
    predicted = test.every_reading(curve, values)
    # Of a leg in 3D no outline is displaced; of a section it counts beside what displaced outlines do.
    for changes in (None, NuisanceChanges(np.arange(1.0, 5.0), {}, {})):
        found = unknowns_at(test, subject, curve, values, changes, law, {})
        (shape,) = (one for one in found if one.source == "shape")
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
