"""The shape in 3D of a subject's leg: from what its section was cut from, or extruded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from making_legs_3d import CONE, cone_folder

from legfem.common.errors import InputError
from legfem.geometry.leg_shape import HULL, SKIN
from legfem.geometry.section import area_and_centroid
from legfem.legs.loading import load_subject
from legfem.legs.placement import LENGTH, spatial_leg
from legfem.legs.schema import SUBJECTS


def leg_of(folder: Path):
    return spatial_leg(load_subject(folder, need_recordings=False))


def test_contours_of_one_level_are_extruded_and_said_to_be():
    subject = load_subject(SUBJECTS.named("3", None), need_recordings=False)
    leg = spatial_leg(subject)
    assert leg.extruded and leg.source == f"the section, extruded over {LENGTH:g} mm"
    assert leg.shape.levels[0] == -LENGTH / 2 and leg.shape.levels[-1] == LENGTH / 2
    for part, name in ((SKIN, "skin"), (HULL, "fascia"), ("tibia", "tibia")):
        area = area_and_centroid(subject.section.contour(name))[0]
        for contour in leg.shape.contours[part]:
            np.testing.assert_allclose(area_and_centroid(contour)[0], area, rtol=2e-3)


def test_stacked_contours_give_the_leg_itself_about_the_cylinder(tmp_path):
    """A cone's radius at the cylinder's ends is that of the cone there."""
    leg = leg_of(cone_folder(tmp_path, level=100.0))
    assert not leg.extruded
    np.testing.assert_allclose(leg.shape.levels[[0, -1]], [-60.0, 60.0])
    for z in (-25.0, 0.0, 25.0):
        radius = np.linalg.norm(leg.shape.at(SKIN, z), axis=1)
        np.testing.assert_allclose(radius, CONE(100.0 + z), atol=0.2)


def test_a_tilted_cylinder_s_leg_is_tilted(tmp_path):
    """Along the cylinder's axis, square to its travel, points of the axis stay in the middle."""
    tilt = np.radians(5.0)
    travel = [0.0, float(np.cos(tilt)), float(np.sin(tilt))]
    place = f"position_mm = [0.0, -60.0, 100.0]\ndirection = {travel}"
    subject = load_subject(cone_folder(tmp_path, pose=place), need_recordings=False)
    leg = spatial_leg(subject)
    section = leg.shape.at(SKIN, 0.0)
    # The plane passes (0, -60, 100): over the cone's axis at 100 + 60 tan(tilt).
    across = 2 * CONE(100.0 + 60.0 * np.tan(tilt))
    np.testing.assert_allclose(np.ptp(section[:, 0]), across, atol=0.05)
    np.testing.assert_allclose(np.ptp(section[:, 1]), across / np.cos(tilt), atol=0.05)
    own = subject.section.contour("skin")
    np.testing.assert_allclose(section.mean(axis=0), own.mean(axis=0), atol=0.2)
    np.testing.assert_allclose(np.ptp(section, axis=0), np.ptp(own, axis=0), atol=0.6)


def test_a_scan_that_ends_is_used_as_far_as_it_goes_and_that_is_said(tmp_path):
    leg = leg_of(cone_folder(tmp_path, level=60.0))
    np.testing.assert_allclose(leg.shape.levels[[0, -1]], [-40.0, 60.0])
    assert "all there is" in leg.source


def test_a_scan_that_does_not_hold_the_cylinder_is_refused(tmp_path):
    subject = load_subject(cone_folder(tmp_path, level=40.0), need_recordings=False)
    with pytest.raises(InputError, match="cylinder's middle"):
        spatial_leg(subject)


def test_a_length_no_longer_than_the_cylinder_is_refused(tmp_path):
    folder = cone_folder(tmp_path, level=100.0, more="length_mm = 40.0")
    subject = load_subject(folder, need_recordings=False)
    with pytest.raises(InputError, match="length_mm"):
        spatial_leg(subject)
