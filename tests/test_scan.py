"""Simulated scans, and the shape that is found in them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from making import circle, turned_and_moved

from legfem.common.errors import InputError
from legfem.geometry.leg_shape import LegShape, shape_of_contours
from legfem.geometry.motion import RigidTransform, rigidly_moved
from legfem.geometry.section_from_outlines import Clearances
from legfem.geometry.slices import signed_distances
from legfem.imaging.label_volume import LabelVolume
from legfem.imaging.outlines import OutlineSettings, shape_of_volume
from studies.making.scans import ScanSettings, SegmentationNoise, coverage, simulated_scan


def leg(length: float = 40.0) -> LegShape:
    levels = np.linspace(0.0, length, 9)
    parts = {
        "skin": [circle(0.3, 0.2, 45 + 0.06 * z, 400) for z in levels],
        "hull": [circle(1.0, -1.0, 38 + 0.05 * z, 300) for z in levels],
        "tibia": [circle(-8, -18 - 0.05 * z, 11, 100) for z in levels],
        "fibula": [circle(18 - 0.04 * z, -8 - 0.03 * z, 6, 100) for z in levels],
    }
    return shape_of_contours(levels, parts, 120)


def errors(
    found: LegShape, true: LegShape, parts: tuple[str, ...] | None = None, every: int = 4
) -> dict[str, np.ndarray]:
    """Distances of found contours from true ones, at every so many levels."""
    found = found.at_levels(found.levels[::every])
    wanted = true.at_levels(found.levels)
    return {
        part: np.stack(
            [signed_distances(*pair) for pair in zip(wanted.contours[part], found.contours[part], strict=True)]
        )
        for part in parts or true.parts
    }


def test_coverage_is_the_area_of_what_is_covered():
    contour = circle(1.3, -2.1, 20, 400)
    covered = coverage(contour, np.array([-30.0, -28.0]), np.array([0.93, 0.8]), (70, 72))
    assert covered.min() >= -1e-12
    assert covered.max() <= 1 + 1e-12
    assert covered.sum() * 0.93 * 0.8 == pytest.approx(np.pi * 20**2, rel=1e-3)
    x, y = np.meshgrid(-30 + 0.93 * np.arange(70), -28 + 0.8 * np.arange(72), indexing="ij")
    centre = (covered * x).sum() / covered.sum(), (covered * y).sum() / covered.sum()
    assert centre == pytest.approx((1.3, -2.1), abs=5e-3)
    assert coverage(circle(500, 0, 3), np.zeros(2), np.ones(2), (9, 9)).max() == 0


def test_a_perfect_segmentation_gives_the_leg_back_to_a_tenth_of_a_voxel():
    found = shape_of_volume(simulated_scan(leg(), seed=3))
    assert found.bones == ("tibia", "fibula")
    assert len(found.levels) == pytest.approx(40, abs=1)
    for part, error in errors(found, leg()).items():
        assert np.abs(error.mean()) < 0.06, part
        assert error.std() < 0.1, part


def test_segmentation_noise_is_as_large_and_as_long_as_asked_for():
    noise = SegmentationNoise(boundary_sd=0.4, correlation_length=8.0, voxel_sd=0.0)
    raw = OutlineSettings(around=0.0, along=0.0)
    error = errors(shape_of_volume(simulated_scan(leg(), 5, noise), raw), leg(), ("skin",), 1)["skin"]
    error = error - error.mean()
    assert error.std() == pytest.approx(0.42, abs=0.06)
    around = 2 * np.pi * 46 / 120
    shift = round(8.0 / around)
    correlation = (error * np.roll(error, shift, axis=1)).mean() / error.var()
    assert correlation == pytest.approx(np.exp(-0.5 * (shift * around / 8.0) ** 2), abs=0.2)
    along = (error[:-8] * error[8:]).mean() / error.var()
    assert along == pytest.approx(np.exp(-0.5), abs=0.25)
    quarter = SegmentationNoise(boundary_sd=0.1, correlation_length=8.0, voxel_sd=0.0)
    less = errors(shape_of_volume(simulated_scan(leg(), 5, quarter), raw), leg(), ("skin",))["skin"]
    assert less.std() < 0.5 * error.std()


def test_the_same_seed_makes_the_same_scan():
    noise = SegmentationNoise()
    scans = [simulated_scan(leg(20.0), seed, noise) for seed in (1, 1, 2)]
    assert np.array_equal(scans[0].labels, scans[1].labels)
    assert scans[0].labels.shape != scans[2].labels.shape or not np.array_equal(scans[0].labels, scans[2].labels)


def test_a_leg_that_moved_in_the_scanner_is_found_where_it_is():
    motion = turned_and_moved((3.0, -2.0, 10.0), [4.0, 6.0, -15.0])
    found = shape_of_volume(simulated_scan(leg(60.0), 2, motion=motion))
    moved = rigidly_moved(leg(60.0), motion.rotation, motion.translation)
    for part, error in errors(found, moved).items():
        assert np.abs(error.mean()) < 0.06, part
        assert error.std() < 0.1, part


def test_outlines_for_a_mesh_keep_their_clearances():
    close = leg()
    parts = dict(close.contours)
    parts["tibia"] = parts["tibia"] + np.array([0.0, -9.5])  # touches the hull's edge
    volume = simulated_scan(LegShape(close.levels, parts), 4, settings=ScanSettings(subslices=1))
    found = shape_of_volume(volume, clearances=Clearances())
    gap = [
        np.abs(signed_distances(t, h)).min()
        for t, h in zip(found.contours["tibia"], found.contours["hull"], strict=True)
    ]
    assert min(gap) > 0.9


def _changed(change: str) -> LabelVolume:
    volume = simulated_scan(leg(20.0), 1, settings=ScanSettings(subslices=1))
    labels = volume.labels.copy()
    spacing = volume.spacing
    if change == "empty slice":
        labels[:, :, 7] = 0
    elif change == "no bone in a slice":
        labels[:, :, 9][labels[:, :, 9] == 3] = 2
    elif change == "no tibia in a slice":
        labels[:62, :, 9][labels[:62, :, 9] == 3] = 2
    elif change == "cut off":
        labels = labels[20:]
    elif change == "specks":
        for place in ((3, 3, 3), (80, 3, 9), (3, 80, 15)):
            labels[place] = 1  # small pieces of skin are passed over
    elif change == "centimetres":
        spacing = spacing / 10
    return dataclasses.replace(volume, labels=labels, spacing=spacing, source="scan.nii")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("empty slice", r"scan.nii: slice 7: is empty \(z = "),
        ("no bone in a slice", r"slice 9: lacks the bone \(z = "),
        ("no tibia in a slice", "bone: is in 3 pieces; close the gaps"),
        ("cut off", "slice 0: the skin is cut off by the volume's edge"),
        ("centimetres", "look like centimetres"),
    ],
)
def test_bad_volumes_give_one_line(change, message):
    with pytest.raises(InputError, match=message) as caught:
        shape_of_volume(_changed(change))
    assert "\n" not in str(caught.value)


def test_specks_are_passed_over():
    error = errors(shape_of_volume(_changed("specks")), leg(20.0))
    assert max(np.abs(e.mean()) for e in error.values()) < 0.06


def test_settings_are_checked():
    with pytest.raises(InputError, match="correlation_length"):
        SegmentationNoise(correlation_length=0.0)
    with pytest.raises(InputError, match="blur"):
        OutlineSettings(blur=-1.0)
    with pytest.raises(InputError, match="is not a rotation"):
        RigidTransform(2 * np.eye(3))
