"""Limbs of any bones from a segmenter's labels, surfaces and outlines, to a section and what a test on it says."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from making_limbs import pressed
from making_scans import made_leg, subject_of_scan
from making_segmented import DIRECTION, LEVEL, LIMBS, write_outlines, write_surfaces, write_volume
from shapely import Polygon
from test_limbs import OF_A_CALF
from typer.testing import CliRunner

import legfem as lf
from legfem.commands.data import app as data
from legfem.common.errors import InputError
from legfem.geometry.__main__ import app
from legfem.geometry.part_names import part_named
from legfem.legs.subject import Subject
from studies.making.plane_leg import OtherCase

WITHIN = {"volume": 0.25, "surfaces": 0.12, "outlines": 0.12}
"""mm, root mean square off the ellipses; a voxel is 1.0 by 1.1 mm, and sections are smoothed by 0.1 mm."""
BONES = {"thigh": ("femur",), "forearm": ("radius", "ulna"), "residual": ("tibia", "fibula")}


def options(folder: Path, name: str, way: str, eroded: float = 0.0) -> list[str]:
    limb = LIMBS[name]
    if way == "volume":
        labels = [f"--label={part}={number}" for part, own in limb.labels.items() for number in own]
        return ["--scan", str(write_volume(folder, limb, eroded)), *labels]
    if way == "surfaces":
        return [f"--surface={part}={file}" for part, file in write_surfaces(folder, limb).items()]
    return ["--cross-sections", str(write_outlines(folder, limb))]


def made(folder: Path, name: str, way: str, eroded: float = 0.0) -> Subject:
    given = options(folder, name, way, eroded)
    return made_leg(folder / way, *given, "--level", str(LEVEL[name]), "--direction", DIRECTION[name])


def off(points: np.ndarray, ellipse: np.ndarray) -> float:
    x, y, a, b = ellipse
    return float(np.sqrt(np.mean(((np.hypot((points[:, 0] - x) / a, (points[:, 1] - y) / b) - 1) * min(a, b)) ** 2)))


@pytest.mark.parametrize("way", WITHIN)
@pytest.mark.parametrize("name", LIMBS)
def test_a_limb_has_its_outlines_and_its_bones_by_name_whatever_it_is_made_of(tmp_path: Path, name: str, way: str):
    section = made(tmp_path, name, way).section
    assert (*section.bones,) == BONES[name]
    for part, drawn in {"skin": "skin", "fascia": "muscle", **dict.fromkeys(section.bones)}.items():
        assert off(section.contour(part), LIMBS[name].ellipse(drawn or part, LEVEL[name])) < WITHIN[way], part


def test_muscles_labelled_apart_and_eroded_are_closed_up_to_one_hull(tmp_path: Path):
    apart = made(tmp_path, "forearm", "volume", eroded=1.5).section
    whole = LIMBS["forearm"].outline("muscle", LEVEL["forearm"])
    assert off(apart.fascia, LIMBS["forearm"].ellipse("muscle", LEVEL["forearm"])) < WITHIN["volume"]
    assert Polygon(apart.fascia).area == pytest.approx(Polygon(whole).area, rel=0.01)


NAMES = {
    "muscle_hull": ("Quadriceps_femoris_left", "biceps femoris long head", "skeletal_muscle", "muscle_of_mine"),
    "skin": ("subcutaneous_fat", "body_extremities", "SKIN", "superficial"),
    "femur": ("femur_right", "Femur", "left femur"),
    "nail": ("bone_nail",),
}


@pytest.mark.parametrize("part", NAMES)
def test_segmenters_names_are_known(part: str):
    assert {part_named(name, "scan") for name in NAMES[part]} == {part}


@pytest.mark.parametrize("name", ["bone_skin", "bone_muscle", "bone_fascia", "bone_", "liver", ""])
def test_what_is_no_part_of_a_limb_is_refused_by_its_name(name: str):
    with pytest.raises(InputError, match="is no part of a limb") as caught:
        part_named(name, "scan")
    assert caught.value.field == name and caught.value.remedy and "\n" not in str(caught.value)


def test_a_bone_of_any_name_is_one_in_the_folder_that_is_made(tmp_path: Path):
    files = write_surfaces(tmp_path, LIMBS["thigh"])
    given = [f"--surface={'bone_nail' if part == 'femur' else part}={file}" for part, file in files.items()]
    assert (*made_leg(tmp_path / "leg", *given, "--level", "30").section.bones,) == ("nail",)


def test_a_folder_cuts_its_section_from_labels_by_name_and_the_usual_numbers_of_the_rest(tmp_path: Path):
    volume = write_volume(tmp_path, LIMBS["thigh"])
    labels = "[labels]\nsubcutaneous_fat = 1\nmuscles = [3, 4]\nfemur_left = 75\n"
    leg = subject_of_scan(tmp_path / "leg", f'scan = "{volume}"\nlevel_mm = 30.0', more=labels)
    assert (*leg.section.bones,) == ("femur",)
    labels = "[labels]\ndeep = [3, 4]\nfemur = 75\n"
    again = subject_of_scan(tmp_path / "leg", f'scan = "{volume}"\nlevel_mm = 30.0', more=labels)
    assert Polygon(again.section.skin).equals(Polygon(leg.section.skin))


@pytest.mark.parametrize(("level", "bones"), [(36.0, ("tibia",)), (52.0, ("tibia", "fibula"))])
def test_a_bone_that_ends_before_the_level_is_no_part_of_the_section(tmp_path: Path, level: float, bones: tuple):
    given = options(tmp_path, "residual", "volume")
    section = made_leg(tmp_path / "leg", *given, "--level", f"{level:g}").section
    assert (*section.bones,) == bones
    for part, drawn in {"skin": "skin", "fascia": "muscle", "tibia": "tibia"}.items():
        assert off(section.contour(part), LIMBS["residual"].ellipse(drawn, level)) < 3 * WITHIN["volume"], part


def _moved(files: dict[str, Path], part: str, by: tuple[float, float, float]) -> None:
    surface = trimesh.load(files[part])
    surface.apply_translation(by)
    surface.export(files[part])


def _holed(files: dict[str, Path], part: str) -> None:
    surface = trimesh.load(files[part])
    middle = surface.triangles_center
    surface.update_faces(np.abs(middle[:, 2] - LEVEL["forearm"]).argsort().argsort() > 3)
    surface.export(files[part])


WRONG = {
    "bones that overlap": (lambda f: _moved(f, "radius", (28, 0, 0)), r"overlaps the radius: \d+ mm² lie in both"),
    "a bone beside the limb": (lambda f: _moved(f, "ulna", (60, 0, 0)), "ulna: lies outside the skin"),
    "a hole": (lambda f: _holed(f, "skin"), r"skin: has a hole at level 30 mm, near \("),
    "a bone above the level": (lambda f: _moved(f, "ulna", (0, 0, 200)), "ulna: no closed outline at level 30 mm"),
    "no bone": (lambda f: [f.pop("radius"), f.pop("ulna")], "no bone is named"),
    "no muscle": (lambda f: f.pop("muscle"), "muscle_hull: the part is missing"),
    "a name that is no kind": (lambda f: f.update(ulnar=f.pop("ulna")), "ulnar: is no part of a limb.*'ulna'"),
    "parts exchanged": (lambda f: f.update(ulna=f["skin"], skin=f["ulna"]), "girth"),
}


@pytest.mark.parametrize("fault", WRONG)
def test_a_wrong_or_missing_region_of_a_scan_gets_one_line(tmp_path: Path, fault: str):
    files = write_surfaces(tmp_path, LIMBS["forearm"])
    change, line = WRONG[fault]
    change(files)
    given = [f"--surface={part}={file}" for part, file in files.items()]
    refused(tmp_path, [*given, "--level", "30"], line)


@pytest.mark.parametrize(
    ("labels", "line"),
    [
        ({"skin": 9, "muscle": (1, 4, 5), "bone": (2, 3)}, None),
        ({"skin": 9, "muscle": (1, 4, 5), "bone": 2, "muscle_of": 3}, "bone: is in one piece at level 30 mm"),
        ({"skin": 9, "muscle": (1, 4), "radius": 2, "ulna": 3}, "labelled 5, which is none of"),
        ({"skin": 9, "muscle": (1, 4, 5), "radius": 2, "stone": 3}, "stone: is no part of a limb"),
        ({"skin": 9, "muscle": (1, 4, 5), "radius": (2, 3), "femur": 8}, None),
        ({"muscle": (1, 4, 5), "skin": 2, "radius": 9, "ulna": 3}, "what is labelled bone lies outermost"),
    ],
    ids=["a calf's two", "one bone in one piece", "a label unsaid", "no kind", "a bone elsewhere", "exchanged"],
)
def test_labels_of_a_volume_are_taken_by_name_or_refused_in_one_line(tmp_path: Path, labels: dict, line: str | None):
    volume = write_volume(tmp_path, LIMBS["forearm"])
    pairs = [(name, number) for name, own in labels.items() for number in np.atleast_1d(own)]
    given = ["--scan", str(volume), *(f"--label={name}={number}" for name, number in pairs), "--level", "30"]
    if line is None:
        made_leg(tmp_path / "leg", *given)
    else:
        refused(tmp_path, given, line)


def refused(folder: Path, given: list[str], line: str) -> None:
    done = CliRunner().invoke(app, [*given, "--out", str(folder / "leg")])
    assert done.exit_code == 2, done.output
    assert re.search(line, done.output) and done.output.count("\n") == 1, done.output
    assert not (folder / "leg").exists()


PLANTS_KPA = {"thigh": (1.5,), "forearm": (1.5,), "residual": (0.8, 1.5, 3.0)}
DEPTH = {"thigh": 12.0, "forearm": 5.0, "residual": 8.0}


def pressed_by_another_code(folder: Path, name: str, c10: float) -> dict[str, Path]:
    """Press a limb's drawn section by another code, and let each way's folder have its recordings."""
    ways = {way: made(folder, name, way, eroded=1.0).directory for way in ("outlines", "volume")}
    for one in ways.values():
        text = (one / "subject.toml").read_text()
        text = text.replace('origin = "measured"', 'origin = "simulated"')
        text = text.replace("starts_at_contact = false", "starts_at_contact = true\nplane_strain = true")
        own = "[instrument]\nforce_sd_N = 0.04\ndisplacement_sd_mm = 0.02\n\n[recordings]"
        (one / "subject.toml").write_text(re.sub(r"\[instrument\].*?\[recordings\]", own, text, flags=re.DOTALL))
    pressed(ways["outlines"], OtherCase(c10), DEPTH[name], finer=0.6)
    shutil.copytree(ways["outlines"] / "recordings", ways["volume"] / "recordings", dirs_exist_ok=True)
    return ways


@pytest.mark.slow
@pytest.mark.parametrize(("name", "c10"), [(name, c10) for name, plants in PLANTS_KPA.items() for c10 in plants])
def test_another_codes_limb_is_as_stiff_from_its_outlines_as_from_a_volume(tmp_path: Path, name: str, c10: float):
    ways, found = pressed_by_another_code(tmp_path, name, c10), {}
    trials = sorted(map(str, (ways["volume"] / "recordings").iterdir()))
    assert CliRunner().invoke(data, ["look", *trials, "--out", str(tmp_path / "look")]).exit_code == 0
    for way, folder in ways.items():
        identified = lf.identify(folder, law="neo-hookean", progress=False)
        fit = identified["neo-hookean"]
        low, high = fit.estimates["deep.C10"].ci95
        found[way] = fit.estimates["deep.C10"].value
        assert fit.goodness.fits and low < c10 * 1e-3 < high, (way, found, low, high)
        assert found[way] == pytest.approx(c10 * 1e-3, rel=0.06)
        assert not OF_A_CALF.search(identified.write(tmp_path / way / "found").read_text()) or name == "residual"
    assert found["volume"] == pytest.approx(found["outlines"], rel=0.015)
