"""Muscles of an image with a stiffness of their own, and a segmenter's folder of masks."""

from __future__ import annotations

import tomllib
from pathlib import Path

import nibabel
import numpy as np
import pytest
import trimesh
from making_scans import made_leg
from making_segmented import DIRECTION, LEVEL, LIMBS, write_surfaces, write_volume
from shapely import Polygon
from shapely.affinity import scale
from typer.testing import CliRunner

from legfem.common.errors import InputError
from legfem.geometry.__main__ import app
from legfem.geometry.section import LegSection
from legfem.legs.loading import load_subject

FOREARM, AT = LIMBS["forearm"], str(LEVEL["forearm"])
NAMES = {"flexor_compartment": 1, "extensor_compartment": 4, "brachioradialis": 5}
LABELS = {"skin": 9, **NAMES, "radius": 2, "ulna": 3}
OWN = ("flexor_compartment", "brachioradialis")
ASKED = [f"--muscle={name}" for name in OWN]


def sector(number: int) -> Polygon:
    """Return the third of the drawn muscle that has a label, without the bones."""
    x, y, *_ = FOREARM.ellipse("muscle", LEVEL["forearm"])
    turn = 2 * np.pi / 3 * (list(NAMES.values()).index(number) + np.linspace(0, 1, 200))
    wedge = Polygon([(x, y), *zip(x + 200 * np.cos(turn), y + 200 * np.sin(turn), strict=True)])
    bones = [Polygon(FOREARM.outline(bone, LEVEL["forearm"])) for bone in ("radius", "ulna")]
    whole = Polygon(FOREARM.outline("muscle", LEVEL["forearm"])).buffer(-0.6)
    return (wedge & whole) - bones[0] - bones[1]


def masks(folder: Path, *, but: str = "") -> Path:
    """Write each of the volume's labels into a file of its own, as TotalSegmentator does; the skin's is the arm's."""
    whole = nibabel.load(write_volume(folder, FOREARM, eroded=0.5))
    found, out = np.asarray(whole.dataobj), folder / "segmentations"
    out.mkdir()
    for name, number in LABELS.items():
        mask = found > 0 if name == "skin" else found == number
        mask = mask[:-2] if name == but else mask
        nibabel.save(nibabel.Nifti1Image(mask.astype(np.uint8), whole.affine), out / f"{name}_left.nii.gz")
    for name in ("spleen", "iliac_artery_left"):
        nibabel.save(nibabel.Nifti1Image(np.zeros_like(found, dtype=np.uint8), whole.affine), out / f"{name}.nii.gz")
    return out


def given(folder: Path, way: str) -> list[str]:
    if way == "masks":
        return ["--scan", str(masks(folder))]
    if way == "labels":
        return ["--scan", str(write_volume(folder, FOREARM, 0.5)), *(f"--label={n}={k}" for n, k in LABELS.items())]
    files = write_surfaces(folder, FOREARM)
    del files["muscle"]
    for name, number in NAMES.items():
        ring = np.array(scale(sector(number), 0.98, 0.98).simplify(0.05).exterior.coords)[:-1]
        n, k = len(ring), np.arange(len(ring))
        points = np.vstack([np.column_stack([ring, np.full(n, z)]) for z in range(-10, 80, 10)])
        one, two = np.column_stack([k, (k + 1) % n, (k + 1) % n + n]), np.column_stack([k, (k + 1) % n + n, k + n])
        faces = np.vstack([face + n * level for level in range(8) for face in (one, two)])
        files[name] = folder / f"{name}.stl"
        trimesh.Trimesh(points, faces).export(files[name])
    return [f"--surface={name}={file}" for name, file in files.items()]


def made(folder: Path, way: str) -> LegSection:
    return made_leg(
        folder / way, *given(folder, way), *ASKED, "--level", AT, "--direction", DIRECTION["forearm"]
    ).section


@pytest.mark.parametrize("way", ["masks", "labels", "surfaces"])
def test_a_muscle_that_is_asked_for_is_a_region_of_the_folder_and_lies_where_it_was_drawn(tmp_path: Path, way: str):
    section = made(tmp_path, way)
    assert tuple(section.muscles) == OWN
    for name in OWN:
        found, drawn = section.polygon(name), sector(NAMES[name])
        assert found.symmetric_difference(drawn).area < 0.16 * drawn.area, name
    text = (tmp_path / way / "subject.toml").read_text()
    assert tomllib.loads(text)["regions"] == {name: {"kind": "muscle"} for name in OWN}


def test_what_a_folder_of_masks_has_besides_is_said(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    made(tmp_path, "masks")
    assert "passed over, since no part of a limb is called so: iliac_artery_left, spleen" in caplog.text


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--muscle=soleus",), "soleus: is no muscle here; give one of"),
        (("--muscle=radius",), "radius: is no muscle here; give one of flexor_compartment"),
    ],
)
def test_another_name_is_refused(tmp_path: Path, options: tuple[str, ...], said: str):
    result = CliRunner().invoke(
        app, [*given(tmp_path, "labels"), *options, "--level", AT, "--out", str(tmp_path / "o")]
    )
    assert result.exit_code == 2 and said in " ".join(result.output.split())


def test_masks_of_two_scans_are_refused(tmp_path: Path):
    folder = masks(tmp_path, but="ulna")
    result = CliRunner().invoke(app, ["--scan", str(folder), "--level", AT, "--out", str(tmp_path / "o")])
    assert result.exit_code == 2 and "isn't that of skin_left; make all masks of one scan" in " ".join(
        result.output.split()
    )


def test_a_muscle_may_surround_a_bone(tmp_path: Path):
    own = (*ASKED, "--muscle=extensor_compartment")
    folder = given(tmp_path, "labels")
    section = made_leg(tmp_path / "arm", *folder, *own, "--level", AT, "--direction", DIRECTION["forearm"]).section
    assert section.polygon("extensor_compartment").contains(section.polygon("radius"))


def test_regions_of_a_folder_with_a_scan_are_its_muscles(tmp_path: Path):
    labels = "\n".join(f"{name} = {number}" for name, number in LABELS.items())
    made(tmp_path, "labels")
    toml = tmp_path / "labels" / "subject.toml"
    text = toml.read_text().replace('contours = "contours.csv"', f'scan = "{tmp_path}/limb.nii.gz"\nlevel_mm = {AT}')
    toml.write_text(text + f"\n[labels]\n{labels}\n")
    assert tuple(load_subject(tmp_path / "labels", need_recordings=False).section.muscles) == OWN
    toml.write_text(toml.read_text().replace('kind = "muscle"', 'kind = "bone"', 1))
    with pytest.raises(InputError, match="muscles with a scan or surfaces too"):
        load_subject(tmp_path / "labels", need_recordings=False)


@pytest.mark.parametrize("source", ["--cross-sections", "--subject-dir"])
def test_outlines_have_no_muscles_to_take(tmp_path: Path, source: str):
    result = CliRunner().invoke(app, [source, str(tmp_path), "--muscle=soleus", "--level", AT, "--out", str(tmp_path)])
    assert result.exit_code == 2 and "soleus: is taken from a scan or surfaces; leave it out" in result.output
