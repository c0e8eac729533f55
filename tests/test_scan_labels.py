"""Label volumes of a leg: what is joined, placed, refused."""

from __future__ import annotations

import locale
from pathlib import Path

import nibabel
import numpy as np
import pytest
import SimpleITK
from making_scans import SPACING, entry_of, labels, subject_of_scan, write_nifti

from legfem.common.errors import InputError
from legfem.geometry.motion import CuttingPlane
from legfem.imaging.label_volume import LabelVolume
from legfem.imaging.leg_source import LegSource
from legfem.imaging.outlines import OutlineSettings
from legfem.imaging.volume_file import read_volumes

LEVEL = 52.7


def _split(half: float) -> LegSource:
    """Return a scan of 30 mm in which fat of twice a width (mm) splits the muscle behind."""
    found, origin = labels()
    y = origin[1] + SPACING[1] * np.arange(found.shape[1])
    band = found[:, np.abs(y - 12.0) < half]
    found[:, np.abs(y - 12.0) < half] = np.where(band == 2, 1, band)
    origin = origin + np.array([0.0, 0.0, 18 * SPACING[2]])
    return LegSource("scan", volume=LabelVolume(found[:, :, 18:33], SPACING, origin, "scan"))


def test_muscles_apart_are_joined_to_one_hull():
    plane = CuttingPlane.at_level(LEVEL)
    hull, whole = (_split(half).outlines(plane)["muscle_hull"] for half in (2.0, 0.0))
    # The taut sheet is a chord where the gap meets the hull's edge: 4 mm of a radius of 50.
    assert hull.area == pytest.approx(whole.area, rel=5e-3)
    assert hull.hausdorff_distance(whole) < 1.0
    with pytest.raises(InputError, match=r"muscle_hull: is in 2 pieces at slice .* 20 mm apart"):
        _split(14.0).outlines(plane)


def test_a_scan_without_a_skin_is_refused(tmp_path, leg_files):
    found, origin = labels()
    write_nifti(tmp_path / "muscle.nii", np.where(found == 1, 0, found), origin)
    with pytest.raises(InputError, match=r"labelled 1 \(superficial\); segment fat and skin"):
        read_volumes(tmp_path / "muscle.nii")[0]
    entry = entry_of(leg_files, "stl").replace(f'skin = "{leg_files}/skin.stl", ', "")
    with pytest.raises(InputError, match="skin: the part is missing"):
        subject_of_scan(tmp_path / "leg", f"{entry}\nlevel_mm = 50.0")
    entry = entry_of(leg_files, "stl").replace(f"{leg_files}/skin.stl", f"{leg_files}/muscle_hull.stl")
    with pytest.raises(InputError, match="skin: lies on the muscles' hull along 100 %"):
        subject_of_scan(tmp_path / "leg", f"{entry}\nlevel_mm = 50.0")


def _write_series(folder: Path, found: np.ndarray, origin: np.ndarray) -> Path:
    """Write a DICOM series, a file a slice."""
    folder.mkdir()
    image = SimpleITK.GetImageFromArray(found.transpose(2, 1, 0).astype(np.int16))
    writer = SimpleITK.ImageFileWriter()
    writer.KeepOriginalImageUIDOn()
    for k in range(image.GetDepth()):
        cut = image[:, :, k]
        cut.SetSpacing((0.8, 0.9))
        for tag, value in (
            ("0008|0060", "OT"),
            ("0020|000d", "1.2.3"),
            ("0020|000e", "1.2.3.4"),
            ("0008|0018", f"1.2.3.4.{k + 1}"),
            ("0020|0013", str(k)),
            ("0020|0037", r"1\0\0\0\1\0"),
            ("0020|0032", f"{origin[0]}\\{origin[1]}\\{origin[2] + SPACING[2] * k}"),
        ):
            cut.SetMetaData(tag, value)
        writer.SetFileName(str(folder / f"{k:03d}.dcm"))
        writer.Execute(cut)
    return folder


def test_a_dicom_series_of_labels_is_a_volume_and_places_one(tmp_path, leg_files):
    found, origin = labels()
    found, origin = found[:, :, :12], origin + 40.0
    before = locale.setlocale(locale.LC_ALL)
    series = _write_series(tmp_path / "dicom", found, origin)
    locale.setlocale(locale.LC_ALL, before)
    read = read_volumes(series)[0]
    assert locale.setlocale(locale.LC_ALL) == before, "SimpleITK would leave it at C"
    assert np.array_equal(read.labels, found)
    assert read.origin == pytest.approx(origin) and read.spacing == pytest.approx(SPACING)
    lost = nibabel.Nifti1Image(found, None)
    nibabel.save(lost, tmp_path / "lost.nii")
    pose = "position_mm = [0.0, 70.0, 50.0]\ndirection = [0.0, -1.0, 0.0]"
    with pytest.raises(InputError, match="does not state where the volume lies"):
        subject_of_scan(tmp_path / "leg", f'scan = "{tmp_path}/lost.nii"', pose)
    placed = read_volumes(tmp_path / "lost.nii", series=series)[0]
    assert placed.transform and placed.origin == pytest.approx(origin)
    nibabel.save(nibabel.Nifti1Image(found[1:], None), tmp_path / "lost.nii")
    with pytest.raises(InputError, match=r"shape: \d+ x \d+ x 12 voxels, but"):
        read_volumes(tmp_path / "lost.nii", series=series)[0]


def test_a_scan_of_both_legs_is_refused():
    found, origin = labels()
    both = LabelVolume(np.concatenate([found, found]), SPACING, origin, "leg.nii")
    with pytest.raises(InputError, match=r"leg.nii: slice \d+: shows two legs"):
        LegSource("leg.nii", volume=both).outlines(CuttingPlane.at_level(LEVEL))


def test_labels_without_a_scan_are_refused_and_a_cut_is_told(tmp_path, leg_files):
    section = f"{entry_of(leg_files, 'csv')}\nlevel_mm = 50.0"
    assert subject_of_scan(tmp_path / "leg", section).cut_from == "sections.csv, level 50 mm"
    with pytest.raises(InputError, match="labels: are given without a scan"):
        subject_of_scan(tmp_path / "leg", section, more="\n[labels]\ndeep = 2\n")


def test_what_lies_beyond_a_segment_may_be_anything():
    found, origin = labels()
    fat, muscle = (found == label for label in (1, 2))
    fat[:, :, :20] = muscle[:, :, :20] = False
    found[fat], found[muscle] = 2, 1
    scan = LegSource("leg.nii", volume=LabelVolume(found, SPACING, origin, "leg.nii"))
    with pytest.raises(InputError, match="lies outermost, where fat is"):
        scan.shape(OutlineSettings(), None)
    shape = scan.between(0.0, 38.0).shape(OutlineSettings(), None)
    assert shape.bones == ("tibia", "fibula") and shape.levels[-1] <= 38.0
