"""Label volumes: files of every kind, orientation, meaning, bad input."""

from __future__ import annotations

from dataclasses import replace

import highdicom
import nibabel
import numpy as np
import pytest
import SimpleITK
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.sr.codedict import codes
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, generate_uid

from legfem.common.errors import InputError
from legfem.imaging.label_volume import LabelVolume, check_same_spacing, volume_of_array
from legfem.imaging.volume_file import read_volumes
from studies.making.scans import write_volume


def volume() -> LabelVolume:
    """Labels at places that tell every axis and direction apart."""
    labels = np.zeros((6, 7, 5), dtype=np.uint8)
    labels[1:5, 1:6, 1:4] = 1
    labels[2:5, 2:5, 1:4] = 2
    labels[2, 3, 2] = labels[4, 4, 3] = 3
    return LabelVolume(labels, [0.93, 0.95, 1.0], [10.0, -20.0, 300.0])


def same(first: LabelVolume, second: LabelVolume) -> bool:
    return (
        np.array_equal(first.labels, second.labels)
        and np.allclose(first.spacing, second.spacing, atol=1e-5)
        and np.allclose(first.origin, second.origin, atol=1e-4)
    )


@pytest.mark.parametrize("name", ["leg.nii", "leg.nii.gz"])
def test_nifti_gives_the_volume_back(tmp_path, name):
    write_volume(volume(), tmp_path / name)
    assert same(read_volumes(tmp_path / name)[0], volume())
    # NIfTI's own axes: x to the right, y to the front.
    affine = nibabel.load(tmp_path / name).affine
    assert np.diag(affine)[:3] == pytest.approx([-0.93, -0.95, 1.0])


def test_nifti_in_metres_is_read_in_mm(tmp_path):
    image = nibabel.Nifti1Image(volume().labels, np.diag([-1e-3, -1e-3, 1e-3, 1]) @ volume().affine)
    image.header.set_xyzt_units("meter")
    nibabel.save(image, tmp_path / "m.nii")
    assert same(read_volumes(tmp_path / "m.nii")[0], volume())


@pytest.mark.parametrize("name", ["leg.nrrd", "leg.mha"])
def test_nrrd_and_metaimage_are_read(tmp_path, name):
    made = volume()
    image = SimpleITK.GetImageFromArray(made.labels.transpose(2, 1, 0))
    image.SetSpacing(made.spacing.tolist())
    image.SetOrigin(made.origin.tolist())
    SimpleITK.WriteImage(image, str(tmp_path / name))
    assert same(read_volumes(tmp_path / name)[0], made)


def _dicom_segmentation(made: LabelVolume) -> highdicom.seg.Segmentation:
    frames = []
    uids = [generate_uid() for _ in range(3)]
    for k, level in enumerate(made.levels):
        slice_ = Dataset()
        slice_.file_meta = FileMetaDataset()
        slice_.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        slice_.SOPClassUID, slice_.SOPInstanceUID = CTImageStorage, generate_uid()
        slice_.StudyInstanceUID, slice_.SeriesInstanceUID, slice_.FrameOfReferenceUID = uids
        slice_.PatientID, slice_.PatientName, slice_.Modality = "made", "Made^", "CT"
        for empty in (
            "PatientBirthDate",
            "PatientSex",
            "StudyDate",
            "StudyTime",
            "StudyID",
            "AccessionNumber",
            "ReferringPhysicianName",
        ):
            setattr(slice_, empty, "")
        slice_.InstanceNumber = k + 1
        slice_.Rows, slice_.Columns = made.labels.shape[1], made.labels.shape[0]
        slice_.PixelSpacing = [made.spacing[1], made.spacing[0]]
        slice_.SliceThickness = slice_.SpacingBetweenSlices = made.spacing[2]
        slice_.ImageOrientationPatient = [1, 0, 0, 0, 1, 0]
        slice_.ImagePositionPatient = [*made.origin[:2], level]
        frames.append(slice_)
    segments = [
        highdicom.seg.SegmentDescription(
            number, name, codes.SCT.Tissue, codes.SCT.Tissue, highdicom.seg.SegmentAlgorithmTypeValues.MANUAL
        )
        for number, name in ((1, "Bone"), (2, "Superficial"), (3, "Deep"))
    ]
    # Segments in another order than our labels.
    numbers = np.array([0, 2, 3, 1], dtype=np.uint8)[made.labels]
    return highdicom.seg.Segmentation(
        frames,
        numbers.transpose(2, 1, 0),
        highdicom.seg.SegmentationTypeValues.BINARY,
        segments,
        generate_uid(),
        1,
        generate_uid(),
        1,
        "made",
        "made",
        "1",
        "1",
    )


def test_a_dicom_segmentation_is_read_by_its_segments_names(tmp_path):
    _dicom_segmentation(volume()).save_as(tmp_path / "leg.dcm")
    read = read_volumes(tmp_path / "leg.dcm")[0]
    # Empty frames at either end are not stored.
    assert read.levels[0] in (300.0, 301.0)
    k = int(read.levels[0] - 300)
    assert np.array_equal(read.labels, volume().labels[:, :, k : k + read.labels.shape[2]])
    assert read.origin[:2] == pytest.approx([10.0, -20.0])


def test_any_order_and_direction_of_the_axes_is_the_same_volume():
    made = volume()
    turned = np.flip(made.labels.transpose(2, 0, 1), axis=1)
    affine = np.eye(4)
    affine[:3, 0] = [0, 0, 1.0]
    affine[:3, 1] = [-0.93, 0, 0]
    affine[:3, 2] = [0, 0.95, 0]
    affine[:3, 3] = made.origin + np.array([5 * 0.93, 0, 0])
    assert same(volume_of_array(turned, affine, "made"), made)


def test_labels_may_have_other_numbers_and_the_bones_one_each():
    other = np.array([0, 10, 20, 30])[volume().labels]
    other[4, 4, 3] = 31
    meaning = {"superficial": 10, "deep": 20, "bone": [30, 31]}
    assert same(volume_of_array(other, volume().affine, "made", meaning), volume())


def _affine_tilted(degrees: float) -> np.ndarray:
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, 0], [0, 0, 0, 1]])


def _affine_sheared(by: float) -> np.ndarray:
    affine = np.eye(4)
    affine[0, 2] = by
    return affine


@pytest.mark.parametrize(
    ("array", "affine", "meaning", "message"),
    [
        (np.where(volume().labels == 3, 2, volume().labels), np.eye(4), None, r"no voxel is labelled 3 \(bone\)"),
        (np.where(volume().labels == 3, 7, volume().labels), np.eye(4), None, "labelled 7, which"),
        (volume().labels.astype(int) - 1000, np.eye(4), None, "give a label volume, not an image"),
        (np.pad(volume().labels, 1, constant_values=9), np.eye(4), None, "labelled 9, which"),
        (volume().labels, _affine_sheared(0.2), None, "the grid is sheared"),
        (volume().labels, _affine_tilted(12), None, "no level contains the leg's whole section"),
        (volume().labels, np.diag([1, 0, 1, 1]), None, "singular"),
        (volume().labels[0], np.eye(4), None, "is not the shape of a volume"),
        (volume().labels, np.eye(4), {"superficial": 1, "deep": 2}, "bone has no label given"),
        (volume().labels, np.eye(4), {"mussle": 1}, "mussle: is no part of a limb.*did you mean 'muscle'"),
        (volume().labels, np.eye(4), {"fat": 1}, "bone has no label given"),
        (
            volume().labels,
            np.eye(4),
            {"superficial": 1, "deep": 2, "bone": 4},
            r"labelled 3, which is none of superficial = 1, deep = 2, bone = 4",
        ),
    ],
)
def test_what_is_no_label_volume_gives_one_line(array, affine, meaning, message):
    with pytest.raises(InputError, match=message) as caught:
        volume_of_array(array, affine, "leg.nii", meaning)
    assert str(caught.value).startswith("leg.nii: ")
    assert "\n" not in str(caught.value)


def test_bad_files_give_one_line(tmp_path):
    (tmp_path / "text.nii").write_text("nothing")
    (tmp_path / "text.nrrd").write_text("nothing\nmore")
    (tmp_path / "text.dcm").write_text("nothing")
    for name in ("text.nii", "text.nrrd", "text.dcm"):
        with pytest.raises(InputError, match="file: can't be read") as caught:
            read_volumes(tmp_path / name)[0]
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="not found"):
        read_volumes(tmp_path / "none.nii")[0]
    (tmp_path / "leg.png").write_text("")
    with pytest.raises(InputError, match="unknown kind"):
        read_volumes(tmp_path / "leg.png")[0]
    image = nibabel.Nifti1Image(volume().labels + 0.5, np.eye(4))
    nibabel.save(image, tmp_path / "image.nii")
    with pytest.raises(InputError, match="not whole numbers"):
        read_volumes(tmp_path / "image.nii")[0]


@pytest.mark.parametrize(
    ("array", "spacing", "words"),
    [
        (volume().labels.astype("c8"), 1.0, "labels: are colours or complex numbers"),
        (volume().labels, 40.0, "spacing: voxels are 1 x 1 x 40 mm apart"),
        (np.stack([volume().labels] * 2, axis=-1), 1.0, "is not the shape of a volume"),
    ],
    ids=["complex", "far apart", "two volumes"],
)
def test_what_is_no_one_volume_of_labels_is_refused(tmp_path, array, spacing, words):
    nibabel.save(nibabel.Nifti1Image(array, np.diag([1.0, 1.0, spacing, 1.0])), tmp_path / "leg.nii")
    with pytest.raises(InputError, match=words):
        read_volumes(tmp_path / "leg.nii")[0]


def test_one_volume_may_be_the_only_one_of_a_series(tmp_path):
    image = nibabel.Nifti1Image(volume().labels[..., None], np.diag([-1, -1, 1, 1]) @ volume().affine)
    nibabel.save(image, tmp_path / "leg.nii")
    assert same(read_volumes(tmp_path / "leg.nii")[0], volume())


def test_more_voxels_than_memory_has_are_refused_before_they_are_read(tmp_path):
    path = tmp_path / "leg.nii"
    write_volume(volume(), path)
    content = bytearray(path.read_bytes())
    content[42:48] = np.array([30_000] * 3, "<i2").tobytes()
    path.write_bytes(content)
    with pytest.raises(InputError, match="shape: has 27,000,000,000,000 voxels; at most"):
        read_volumes(path)[0]


def test_what_itk_says_of_a_file_is_told_without_its_sources(tmp_path):
    path = tmp_path / "leg.mhd"
    path.write_text("NDims = 3\nDimSize = 4 4 4\nElementType = MET_UCHAR\nElementDataFile = leg.raw\n")
    with pytest.raises(InputError, match="file: can't be read") as caught:
        read_volumes(path)[0]
    assert "0x" not in str(caught.value) and ".cxx" not in str(caught.value)


def test_volumes_of_different_spacing_need_a_transform():
    made = volume()
    check_same_spacing(made, made)
    other = LabelVolume(made.labels, [0.5, 0.5, 1.0], made.origin, "other.nii")
    check_same_spacing(made, other)
    lost = replace(other, transform=False)
    with pytest.raises(InputError, match=r"other.nii: spacing: 0.5 x 0.5 x 1 mm, but 0.93 x 0.95"):
        check_same_spacing(made, lost)


def test_a_nifti_that_says_nowhere_where_it_lies_is_told_from_others(tmp_path):
    made = volume()
    write_volume(made, tmp_path / "stated.nii")
    assert read_volumes(tmp_path / "stated.nii")[0].transform
    image = nibabel.Nifti1Image(made.labels, None)
    image.header.set_zooms(made.spacing)
    nibabel.save(image, tmp_path / "lost.nii")
    assert not read_volumes(tmp_path / "lost.nii")[0].transform
