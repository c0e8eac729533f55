"""Limbs of any bones from a segmenter's labels, surfaces and outlines, to a section and what a test on it says."""

from __future__ import annotations

from pathlib import Path

import nibabel
import numpy as np
import pytest
from making_scans import made_leg
from making_segmented import LEVEL, LIMBS, write_outlines, write_surfaces, write_volume
from shapely import Polygon
from typer.testing import CliRunner

from legfem.geometry.__main__ import app
from legfem.geometry.part_names import part_named
from legfem.legs.subject import Subject

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
    return made_leg(folder / way, *given, "--level", str(LEVEL[name]), "--direction", "90")


def off(points: np.ndarray, ellipse: np.ndarray) -> float:
    x, y, a, b = ellipse
    return float(np.sqrt(np.mean(((np.hypot((points[:, 0] - x) / a, (points[:, 1] - y) / b) - 1) * min(a, b)) ** 2)))


@pytest.mark.parametrize("way", WITHIN)
@pytest.mark.parametrize("name", LIMBS)
def test_a_limb_has_its_outlines_and_its_bones_by_name_whatever_it_is_made_of(tmp_path: Path, name: str, way: str):
    section = made(tmp_path, name, way).section
    assert (*section.bones,) == BONES[name]
    for part, drawn in {"skin": "skin", "fascia": "muscle", **dict(zip(section.bones, section.bones))}.items():
        assert off(section.contour(part), LIMBS[name].ellipse(drawn, LEVEL[name])) < WITHIN[way], part
