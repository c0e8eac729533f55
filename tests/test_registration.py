"""Rigid registration on bones: planted motions come back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK
from making import turned_and_moved

from legfem.common.errors import InputError
from legfem.geometry.leg_shape import LegShape, PartSurface
from legfem.geometry.motion import RigidTransform
from legfem.imaging.outlines import shape_of_volume
from legfem.imaging.registration import bone_points, register_points, register_shapes, register_surfaces
from studies.making.scans import ScanSettings, SegmentationNoise, simulated_scan
from studies.making.shapes import parametric_leg, read_legs

LEGS = Path(__file__).resolve().parents[1] / "studies" / "stockings" / "legs.toml"
PLANTED = turned_and_moved((4.0, -3.0, 12.0), np.array([6.0, -8.0, 15.0]))


@pytest.fixture(scope="module")
def leg() -> LegShape:
    return parametric_leg(read_legs(LEGS)["3"], 120)


def scattered(leg: LegShape, generator: np.random.Generator, per_mm2: float = 1.0) -> np.ndarray:
    """Points anywhere on the bones."""
    points = []
    for bone in leg.bones:
        surface = PartSurface(leg, bone)
        number = int(per_mm2 * surface.perimeter * leg.length)
        levels = generator.uniform(leg.levels[0], leg.levels[-1], number)
        points.append(surface(generator.uniform(size=number), levels))
    return np.vstack(points)


def noisy(points: np.ndarray, generator: np.random.Generator, sd: float) -> np.ndarray:
    return points + sd * generator.standard_normal(points.shape)


def test_points_that_do_not_correspond_find_it_too(leg):
    """How well the motion along shafts is seen differs from draw to draw: three of them."""
    greatest = []
    for seed in (1, 2, 3):
        generator = np.random.default_rng(seed)
        true = scattered(leg, generator)
        moving = noisy(true, generator, 0.2)
        fixed = noisy(PLANTED(scattered(leg, generator)), generator, 0.2)
        found = register_surfaces(moving, fixed)
        error = found.transform(true) - PLANTED(true)
        greatest.append(np.linalg.norm(error, axis=1).max())
        assert found.converged
        assert (np.abs(error.mean(axis=0)) < 4 * found.standard_error).all()
        assert found.residual < 0.2
    assert np.median(greatest) < 0.06
    assert max(greatest) < 0.15


def test_another_stretch_of_the_bones_does_no_harm(leg):
    generator = np.random.default_rng(3)
    true = scattered(leg.at_levels(np.linspace(0, 110, 23)), generator)
    other = scattered(leg.at_levels(np.linspace(25, 140, 24)), generator)
    moving, fixed = noisy(true, generator, 0.1), noisy(PLANTED(other), generator, 0.1)
    start = turned_and_moved((0.0, 0.0, 9.0), PLANTED.translation + 2.0)
    found = register_surfaces(moving, fixed, start)
    error = found.transform(true) - PLANTED(true)
    assert np.linalg.norm(error, axis=1).max() < 0.05
    assert found.left_out > 0.1 * found.pairs  # what only one of them shows


@pytest.mark.parametrize(
    ("noise", "across", "along"),
    # Without noise, a twelfth of a voxel across the shafts.
    [(None, 0.93 / 12, 0.25), pytest.param(0.2, 0.2, 0.8, marks=pytest.mark.slow)],
)
def test_two_scans_are_registered(leg, noise, across, along):
    errs = None if noise is None else SegmentationNoise(boundary_sd=noise)
    motion = turned_and_moved((2.0, -3.0, 8.0), np.array([6.0, -8.0, 11.0]))
    grid = ScanSettings(subslices=1)
    if noise is None:
        leg = leg.at_levels(np.linspace(30, 110, 17))
        grid = ScanSettings(spacing=(0.93, 0.93, 2.0), subslices=1)
    before = shape_of_volume(simulated_scan(leg, 1, errs, settings=grid))
    after = shape_of_volume(simulated_scan(leg, 2, errs, motion, grid))
    found = register_shapes(before, after)
    error = found.transform(bone_points(before)) - motion(bone_points(before))
    # What is seen of the bones is shafts: least is known along them.
    assert np.abs(error[:, :2]).max() < across
    assert np.abs(error[:, 2]).max() < along
    assert found.standard_error[2] > 4 * found.standard_error[:2].max()


def test_points_that_correspond_find_it_within_the_error_that_is_told(leg):
    generator = np.random.default_rng(4)
    errors = []
    for _ in range(40):
        points = scattered(leg, generator, 1e-3)
        found = register_points(points, noisy(PLANTED(points), generator, 1.5))
        error = (found.transform(points) - PLANTED(points)).mean(axis=0)
        errors.append(error / found.standard_error)
    # Of 120 numbers with unit variance.
    assert np.square(errors).mean() == pytest.approx(1.0, abs=4 * np.sqrt(2 / 120))
    itk = SimpleITK.VersorRigid3DTransform(
        SimpleITK.LandmarkBasedTransformInitializer(
            SimpleITK.VersorRigid3DTransform(), PLANTED(points).ravel().tolist(), points.ravel().tolist()
        )
    )
    exact = register_points(points, PLANTED(points)).transform
    assert exact.inverse()(PLANTED(points)) == pytest.approx(points, abs=1e-9)
    moved = np.array([itk.TransformPoint(p.tolist()) for p in PLANTED(points)])
    assert exact.inverse()(PLANTED(points)) == pytest.approx(moved, abs=1e-6)


def test_a_motion_and_its_inverse_cancel():
    there_and_back = PLANTED.inverse().after(PLANTED)
    assert there_and_back.rotation == pytest.approx(np.eye(3))
    assert there_and_back.translation == pytest.approx(np.zeros(3), abs=1e-12)


def test_points_that_make_no_registration_give_one_line(leg):
    line = np.column_stack([np.arange(50.0)] * 3)
    cloud = np.random.default_rng(0).normal(size=(300, 3)) * 20
    with pytest.raises(InputError, match="on a line"):
        register_surfaces(line, line)
    with pytest.raises(InputError, match="fewer than three points"):
        register_surfaces(cloud[:2], cloud[:2])
    with pytest.raises(InputError, match="finite coordinates"):
        register_surfaces(cloud * np.nan, cloud)
    with pytest.raises(InputError, match="too few or too far apart"):
        register_surfaces(cloud, cloud)
    near = scattered(leg, np.random.default_rng(1))
    with pytest.raises(InputError, match="find a partner"):
        register_surfaces(near, near, RigidTransform(np.eye(3), np.array([0, 0, 500.0])))
    one = LegShape(leg.levels, {p: leg.contours[p] for p in ("skin", "hull", "tibia")})
    with pytest.raises(InputError, match="are not the same"):
        register_shapes(one, leg)
