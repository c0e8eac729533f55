"""Reading and writing label volumes: NIfTI, NRRD and MetaImage, DICOM segmentations."""

import locale
import logging
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import highdicom
import nibabel
import numpy as np
import SimpleITK
from numpy.typing import NDArray

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.contours import MUSCLE_HULL
from legfem.geometry.part_names import part_named
from legfem.imaging.label_volume import LabelVolume, along_axes, unsaid_tissues, volume_of_array

# NIfTI's axes point to the right and to the front; DICOM's to the left and to the back.
_TO_DICOM = np.diag([-1.0, -1.0, 1.0, 1.0])
_log = logging.getLogger(__name__)
_PER_MM = {"meter": 1000.0, "mm": 1.0, "micron": 1e-3, "unknown": 1.0}
_NIFTI, _ITK, _DICOM = (".nii", ".nii.gz"), (".nrrd", ".nhdr", ".mha", ".mhd"), (".dcm",)

type Meaning = Mapping[str, int | list[int]]


def read_volumes(
    path: Path, meaning: Meaning | None = None, series: Path | None = None, muscles: Iterable[str] = ()
) -> tuple[LabelVolume, dict[str, LabelVolume]]:
    """Read a label volume, and single muscles of it, each as the only bone would be.

    Parameters
    ----------
    path : Path
        NIfTI (``.nii``, ``.nii.gz``), NRRD or MetaImage (``.nrrd``, ``.mha``, ...), or a DICOM
        segmentation (``.dcm``); the folder of a DICOM series whose pixels are labels, or of masks, a NIfTI file for
        each part by its name, as TotalSegmentator writes them.
    meaning : mapping, optional
        Parts (see `legfem.geometry.part_names.part_named`) to the labels they have in the file, one or several. By
        default ``superficial``, ``deep`` and ``bone`` are 1, 2 and 3; in a DICOM segmentation by its segments' names,
        if these are parts'.
    series : Path, optional
        Folder of the DICOM series on which a volume was labelled that doesn't say where it lies.
    muscles : iterable of str
        Plain names of parts.

    Raises
    ------
    InputError
        If the file can't be read, is too large, or is not a label volume with these three tissues.
    """
    path = Path(path)
    if not path.exists():
        raise InputError(path, "file", "not found", "check the path")
    name = path.name.lower()
    readers = {_NIFTI: _read_nifti, _ITK: _read_itk, _DICOM: _read_dicom}
    reader = next((r for endings, r in readers.items() if name.endswith(endings)), None)
    if path.is_dir():
        reader = _read_masks if _masks(path) else _read_series
    if reader is None:
        remedy = f"give one of {', '.join(e for endings in readers for e in endings)}"
        raise InputError(path, "file", "is of an unknown kind", remedy)
    try:
        with _locale_kept():
            array, affine, named, transform = reader(path)
            if series is not None and not transform:
                affine, transform = _affine_of(series, path, array.shape), True
    except InputError:
        raise
    except Exception as error:  # the libraries raise all kinds
        # Without where in its own sources the library says it.
        found = _OF_ITK.search(str(error))
        said = " ".join(((found["said"] or found["nrrd"]) if found else str(error)).split())[:160]
        problem = f"can't be read ({said or type(error).__name__})"
        raise InputError(path, "file", problem, "save it again") from None
    meaning = meaning or named
    # Once for all: an oblique grid is resampled.
    array, affine = along_axes(array, affine, str(path))
    volume = volume_of_array(array, affine, str(path), meaning)
    if volume.spacing.max() > _FARTHEST_MM:
        apart = " x ".join(f"{one:g}" for one in volume.spacing)
        problem = f"voxels are {apart} mm apart; at most {_FARTHEST_MM:g} mm say where a leg's outlines are"
        raise InputError(path, "spacing", problem, "correct the spacing in the header, or scan more slices")
    own = {name: volume_of_array(array, affine, str(path), meaning, name) for name in muscles}
    return replace(volume, transform=transform), own


_FARTHEST_MM = 25.0
"""Distance of voxels beyond which a calf's outlines aren't known between them."""
_MOST_VOXELS = 500_000_000
"""A CT of a whole leg at half a millimetre; more take more memory than machines have."""
_OF_ITK = re.compile(r"ITK ERROR: (?:\w+\(0x[0-9a-f]+\): )?(?P<said>.*)|(?P<nrrd>\[nrrd\] .*)", re.DOTALL)


def _check_count(path: Path, shape: Sequence[int]) -> None:
    count = math.prod(shape)
    if count > _MOST_VOXELS:
        problem = f"has {count:,} voxels; at most {_MOST_VOXELS:,} are read"
        raise InputError(path, "shape", problem, "crop it to the leg, or resample it")


@contextmanager
def _locale_kept() -> Iterator[None]:
    """Put the process' locale back, which SimpleITK sets to C when it reads DICOM."""
    before = locale.setlocale(locale.LC_ALL)
    try:
        yield
    finally:
        locale.setlocale(locale.LC_ALL, before)


type _Raw = tuple[NDArray[np.integer], FloatArray, Meaning | None, bool]


def _read_nifti(path: Path) -> _Raw:
    image = nibabel.load(path)
    _check_count(path, image.shape)
    image = nibabel.funcs.squeeze_image(image)
    array = np.asanyarray(image.dataobj)
    length, _ = image.header.get_xyzt_units()
    scale = np.diag([_PER_MM[length]] * 3 + [1.0])
    stated = bool(image.header["sform_code"] or image.header["qform_code"])
    return _integers(array, path), scale @ _TO_DICOM @ image.affine, None, stated


def _read_itk(path: Path) -> _Raw:
    reader = SimpleITK.ImageFileReader()
    reader.SetFileName(str(path))
    reader.ReadImageInformation()
    _check_count(path, reader.GetSize())
    return _of_image(reader.Execute(), path)


def _masks(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.nii*"))


def _read_masks(path: Path) -> _Raw:
    """Read a folder's masks, the outermost parts first: a muscle's voxels may be the skin's too, a bone's both."""
    files = {file.name.split(".")[0]: file for file in _masks(path)}
    parts, others = dict[str, str](), list[str]()
    for name in files:
        try:
            parts[name] = part_named(name, path)
        except InputError:
            others.append(name)
    if others:
        _log.warning("%s: passed over, since no part of a limb is called so: %s", path, ", ".join(others))
    labels: NDArray[np.integer] = np.zeros((0, 0, 0), np.int64)
    place: FloatArray = np.eye(4)
    first, stated, named = "", False, dict[str, int]()
    for name in sorted(parts, key=lambda one: {"skin": 0, MUSCLE_HULL: 1}.get(parts[one], 2)):
        mask, affine, _, states = _read_nifti(files[name])
        if not named:
            labels, place, first, stated = np.zeros_like(mask), affine, name, states
        if mask.shape != labels.shape or not np.allclose(affine, place, atol=1e-3):
            raise InputError(files[name], "grid", f"isn't that of {first}", "make all masks of one scan")
        named[name] = len(named) + 1
        labels[mask > 0] = named[name]
    return labels, place, named, stated


def _read_series(path: Path) -> _Raw:
    return _of_image(_series(path), path)


def _series(path: Path) -> SimpleITK.Image:
    reader = SimpleITK.ImageSeriesReader()
    found = reader.GetGDCMSeriesIDs(str(path))
    if len(found) != 1:
        problem = f"the folder contains {len(found)} DICOM series"
        raise InputError(path, "series", problem, "give a folder with the slices of one series")
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(path), found[0]))
    return reader.Execute()


def _affine_of(series: Path, path: Path, shape: tuple[int, ...]) -> FloatArray:
    """Return the place of the series on whose voxels a file's labels lie."""
    image = _series(series)
    if image.GetSize() != shape:
        sizes = [" x ".join(map(str, size)) for size in (shape, image.GetSize())]
        problem = f"{sizes[0]} voxels, but {sizes[1]} in {series}"
        raise InputError(path, "shape", problem, "give the series that was labelled")
    return _affine(image)


def _of_image(image: SimpleITK.Image, path: Path) -> _Raw:
    if image.GetNumberOfComponentsPerPixel() != 1 or image.GetDimension() != 3:
        raise InputError(path, "labels", "overlap or are not one volume", "save a label map")
    # SimpleITK's arrays are (z, y, x).
    array = SimpleITK.GetArrayFromImage(image).transpose(2, 1, 0)
    return _integers(array, path), _affine(image), None, True


def _affine(image: SimpleITK.Image) -> FloatArray:
    axes = np.array(image.GetDirection()).reshape(3, 3) * np.array(image.GetSpacing())
    return np.asarray(nibabel.affines.from_matvec(axes, image.GetOrigin()))


def _read_dicom(path: Path) -> _Raw:
    segmentation = highdicom.seg.segread(path)
    volume = segmentation.get_volume(combine_segments=True, skip_overlap_checks=False)
    numbers = map(int, segmentation.segment_numbers)
    named = {segmentation.get_segment_description(number).segment_label: number for number in numbers}
    try:
        every = None if unsaid_tissues(named, str(path)) else named
    except InputError:  # a segment of another name
        every = None
    return _integers(volume.array, path), volume.affine, every, True


def _integers(array: NDArray[np.generic], path: Path) -> NDArray[np.integer]:
    if array.dtype.kind not in "biuf":
        raise InputError(path, "labels", "are colours or complex numbers", "give a label volume, not an image")
    rounded = np.rint(array).astype(np.int64)
    if not np.array_equal(rounded, array):
        raise InputError(path, "labels", "are not whole numbers", "give a label volume, not an image")
    return rounded
