"""Limbs without muscle (a heel pad) and without a bone (on a plate): from outlines and a volume to a stiffness."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dolfinx import mesh as dolfinx_mesh
from making import TOML, circle, write_contours
from making_limbs import forearm, pressed, thigh
from making_scans import made_leg
from making_segmented import Limb, write_outlines, write_surfaces, write_volume
from shapely import Polygon
from test_segmented_limbs import off, refused

import legfem as lf
from legfem.common.errors import InputError
from legfem.geometry.section import BONES, MUSCLE, depth_to_bone
from legfem.legs.diagnosis import ruled_out_of
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.loading import load_subject
from legfem.legs.subject import Subject
from legfem.mechanisms import mechanisms_of
from legfem.meshing.section import DEEP, PLATE, SKIN, mesh_section
from studies.making.plane_leg import OtherCase

HEEL = Limb({"skin": (0, 0, 33, 29), "calcaneus": (0, 5, 16, 14)}, {"subcutaneous_fat": (1,), "calcaneus_left": (75,)})
PLATE_MM = "[[-10.0, 70.0], [10.0, 70.0]]"
STATED = "\n[recordings]\nstarts_at_contact = true\nplane_strain = true\n"


def heel(**parts: np.ndarray) -> dict[str, np.ndarray]:
    return {"skin": circle(0, 0, 31, 200) * [1.1, 0.95], "calcaneus": circle(0, 5, 15.5, 60), **parts}


def soft_end() -> dict[str, np.ndarray]:
    return {name: ring for name, ring in thigh().items() if name != "femur"}


def written(folder: Path, parts: dict[str, np.ndarray], toml: str, more: str = STATED) -> Path:
    folder.mkdir(parents=True)
    write_contours(folder / "contours.csv", parts)
    (folder / "subject.toml").write_text(toml + more)
    return folder


def of_pad(toml: str = TOML) -> str:
    """Return a folder's file that says that there is no muscle."""
    without = re.sub(r"\[tissues\.(superficial|fascia)\][^\[]*", "", toml).replace("[tissues.deep]", "[tissues.pad]")
    return re.sub(r"fascia_thickness_mm = .*", "fascia_thickness_mm = 0", without)


def on_plate(toml: str = TOML) -> str:
    return toml.replace("[indenter]", f"support_mm = {PLATE_MM}\n\n[indenter]", 1)


def loaded(folder: Path) -> Subject:
    return load_subject(folder, need_recordings=False)


@pytest.fixture(scope="module")
def pad(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    """A heel pad of C10 = 4 kPa, with recordings by another code."""
    folder = written(tmp_path_factory.mktemp("heel") / "heel", heel(), of_pad())
    return pressed(folder, OtherCase(4.0), 6.0)


@pytest.fixture(scope="module")
def end(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    return loaded(written(tmp_path_factory.mktemp("end") / "end", soft_end(), on_plate()))


@pytest.mark.parametrize("way", ["outlines", "volume", "surfaces"])
def test_a_heel_pad_is_made_of_outlines_a_volume_and_surfaces(tmp_path: Path, way: str):
    sources = {
        "outlines": lambda: ["--cross-sections", str(write_outlines(tmp_path, HEEL))],
        "volume": lambda: ["--scan", str(write_volume(tmp_path, HEEL)), "--label=fat=1", "--label=calcaneus=75"],
        "surfaces": lambda: [f"--surface={part}={file}" for part, file in write_surfaces(tmp_path, HEEL).items()],
    }
    given = [*sources[way](), "--level", "30", "--direction", "90"]
    section = made_leg(tmp_path / "leg", *given, "--fascia-thickness", "0").section
    assert section.parts == ("skin", "calcaneus") and section.lacks == (MUSCLE,)
    for part in section.parts:
        assert off(section.contour(part), HEEL.ellipse(part, 30.0)) < 0.25
    refused(tmp_path / "not said", given, "says that there is no muscle|no voxel is labelled 2")


def test_outlines_between_levels_have_no_muscle_either(tmp_path: Path):
    given = ["--cross-sections", str(write_outlines(tmp_path, HEEL)), "--level", "32.5", "--fascia-thickness", "0"]
    assert made_leg(tmp_path / "leg", *given).section.parts == ("skin", "calcaneus")


def test_a_pad_is_meshed_as_one_tissue_to_the_bone(pad: Subject):
    section = pad.section
    meshed = mesh_section(section, 15.0, pad.indenter.aim, pad.indenter.direction)
    assert set(meshed.cell_tags.values) == {DEEP}
    own = Polygon(section.skin).area - Polygon(section.bones["calcaneus"]).area
    x = meshed.mesh.geometry.x[meshed.mesh.geometry.dofmap][:, :3, :2]
    a, b = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    assert 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() == pytest.approx(own, rel=2e-3)


def test_what_rests_on_a_plate_is_held_and_the_rest_of_the_skin_is_free(end: Subject):
    section = end.section
    meshed = mesh_section(section, 15.0, end.indenter.aim, end.indenter.direction)
    ends = {tag: _middles(meshed, tag) for tag in (SKIN, PLATE)}
    assert section.lacks == (BONES,)
    assert ends[PLATE][:, 1].min() > 68.5 and ends[SKIN][:, 1].max() < 70.0
    assert depth_to_bone(section, end.indenter.aim, end.indenter.direction) == pytest.approx(
        np.hypot(53.8, 156.5), abs=1.0
    )


def _middles(meshed, tag: int) -> np.ndarray:
    meshed.mesh.topology.create_connectivity(1, 2)
    return dolfinx_mesh.compute_midpoints(meshed.mesh, 1, meshed.facet_tags.find(tag))[:, :2]


def test_another_codes_plate_bears_the_same(end: Subject):
    from studies.making.plane_leg import OtherCode

    other = OtherCode(end, OtherCase(1.5), 0.8).solve(9.0, 0.8)
    test = plane_strain_test(end)
    curve = test.solve({"deep.C10": 1.5e-3, "deep.C20": 0.0, "deep.D2": np.inf}, 9.0).curve
    at = np.linspace(3.0, 9.0, 7)
    np.testing.assert_allclose(curve(at), np.interp(at, other.displacement, other.force), rtol=0.01)
    bone = replace(end, section=replace(end.section, support=np.array([[-10.0, 50.0], [10.0, 50.0]])))
    nearer = plane_strain_test(bone).solve({"deep.C10": 1.5e-3, "deep.C20": 0.0, "deep.D2": np.inf}, 9.0).curve
    assert (nearer(at) > 1.002 * curve(at)).all()


@pytest.fixture(scope="module")
def found(pad: Subject) -> lf.Identification:
    return lf.identify(pad.directory, law="neo-hookean", identify=["pad.C10"], progress=False)


def test_another_codes_pad_is_found_as_stiff_as_it_is(found: lf.Identification):
    one = found["neo-hookean"].estimates["deep.C10"]
    low, high = one.ci95
    assert one.value == pytest.approx(4e-3, rel=0.03)
    assert low < 4e-3 < high


def test_what_is_shown_of_a_pad_speaks_of_no_muscle(found: lf.Identification, tmp_path: Path):
    found.write(tmp_path / "identified")
    page = (tmp_path / "identified" / "report.txt").read_text("utf-8")
    assert "How stiff is the pad of" in page and "C10 of the pad" in page
    assert not re.search(r"muscle|fascia|\bfat\b|deep", page)


def test_a_limb_says_of_each_effect_that_it_cannot_have_what_it_lacks(pad: Subject, end: Subject):
    lost = {name for name, why in ruled_out_of(pad, None).items() if why == "the limb has no muscle"}
    assert {"muscle-contraction", "uneven-muscle", "fascia-stiffness", "prestress", "superficial-stiffness"} <= lost
    assert ruled_out_of(end, None)["support-compliance"] == "the limb has no bones"
    kept = [one for one in mechanisms_of(pad.section) if one.name not in lost]
    assert {"compressibility", "strain-stiffening", "viscoelasticity", "dermis"} <= {one.name for one in kept}
    assert not [one.statement for one in kept if re.search("muscle|deep", one.statement)]


WRONG = {
    "a pad's fascia": (heel(fascia=circle(0, 0, 25, 100)), of_pad(), "unknown part 'fascia'"),
    "no fascia unsaid": (heel(), TOML, "fascia_thickness_mm = 0 under .section. says that there is no muscle"),
    "a pad's fat": (heel(), re.sub("(?<=thickness_mm = ).*", "0", TOML), "tissues.superficial: is given where"),
    "fat unsaid": (forearm(), re.sub(r"\[tissues\.superficial\][^\[]*", "", TOML), "tissues.superficial: missing"),
    "no bone, no plate": (soft_end(), TOML, "nothing says what else holds the limb; .*support_mm under"),
    "a plate beside it": (soft_end(), on_plate().replace("70.0", "99.0"), "nothing says what else holds the limb"),
    "a bone outside": (heel(calcaneus=circle(0, 25, 15.5, 60)), of_pad(), "calcaneus: crosses or touches the skin"),
}


@pytest.mark.parametrize("fault", WRONG)
def test_what_a_limb_lacks_has_to_be_said(tmp_path: Path, fault: str):
    parts, toml, line = WRONG[fault]
    with pytest.raises(InputError) as caught:
        loaded(written(tmp_path / "leg", parts, toml))
    assert re.search(line, str(caught.value)) and "\n" not in str(caught.value)


@pytest.mark.parametrize(("asked", "line"), [({"model": "3d"}, "no muscle"), ({"identify": ["fat.C10"]}, "fat.C10")])
def test_what_a_pad_has_not_cannot_be_asked_for(pad: Subject, asked: dict, line: str):
    with pytest.raises(InputError, match=line):
        lf.identify(pad.directory, progress=False, **asked)
