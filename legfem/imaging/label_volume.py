"""Label volumes: every voxel of a scan is background, superficial or deep tissue, or bone.

Coordinates are those of DICOM, in mm: x to the patient's left, y to the back, z towards the head.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.ndimage import affine_transform, binary_dilation

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, freeze, runs_of
from legfem.geometry.contours import MUSCLE_HULL
from legfem.geometry.part_names import bones_of, muscle_named, part_named

_SHEAR = 1e-3
_HALF = 0.5


def _resampled(array: NDArray[np.integer], affine: FloatArray, source: str) -> tuple[NDArray[np.integer], FloatArray]:
    """Return labels resampled on a grid along the coordinates' axes, and its affine (4, 4).

    Every label's share is interpolated linearly, and the largest wins, so that outlines move by a
    small part of a voxel. Only levels remain at which no tissue lies at the old grid's ends: beyond
    them nothing is known of the leg.

    Parameters
    ----------
    array
        Labels, (n_1, n_2, n_3), 0 in the background.
    affine
        The array's indices to mm; its axes are nearest to x, y and z in this order, and point
        their way.
    source
        What errors name as the file.

    Raises
    ------
    InputError
        If the grid is sheared, or nowhere holds the leg's whole section.
    """
    refused = partial(InputError, source, "affine")
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    cosines = affine[:3, :3] / spacing
    if np.abs(cosines.T @ cosines - np.eye(3)).max() > _SHEAR:
        remedy = "resample the volume along the scanner's axes"
        raise refused("the grid is sheared: its axes aren't square to each other", remedy)
    ends = np.array(np.meshgrid(*([0, n - 1] for n in array.shape), indexing="ij")).reshape(3, -1)
    corners = affine[:3, :3] @ ends + affine[:3, 3:]
    origin = corners.min(axis=1)
    shape = tuple(np.ceil((corners.max(axis=1) - origin) / spacing).astype(int) + 1)
    back = np.linalg.inv(affine[:3, :3])
    matrix, offset = back * spacing, back @ (origin - affine[:3, 3])

    def moved(values: NDArray[np.generic], outside: float) -> NDArray[np.float32]:
        return np.asarray(
            affine_transform(
                values.astype(np.float32), matrix, offset, shape, np.float32, 1, "constant", outside, prefilter=False
            )
        )

    best = np.zeros(shape, dtype=np.float32)
    found = np.zeros(shape, dtype=array.dtype)
    for label in np.unique(array):
        share = moved(array == label, float(label == 0))
        larger = share > best
        best[larger], found[larger] = share[larger], label
    outside = moved(np.ones(array.shape), 0.0) < _HALF
    cut = (binary_dilation(outside, iterations=2) & (found > 0)).any(axis=(0, 1))
    whole = ~cut & (found > 0).any(axis=(0, 1))
    runs = [run for run in runs_of(whole) if whole[run[0]]]
    first, last = max(runs, key=lambda run: run[1] - run[0], default=(0, 0))
    if last - first < 2:
        problem = "the grid is oblique, and no level contains the leg's whole section"
        raise refused(problem, "scan or label more of the leg")
    straight = _affine(spacing, origin + np.array([0.0, 0.0, first * spacing[2]]))
    return np.ascontiguousarray(found[:, :, first:last]), straight


def _affine(spacing: FloatArray, origin: FloatArray) -> FloatArray:
    """Return the affine (4, 4) of a grid along the coordinates' axes."""
    affine = np.diag([*spacing, 1.0])
    affine[:3, 3] = origin
    return affine


BACKGROUND, SUPERFICIAL, DEEP, BONE = 0, 1, 2, 3
TISSUES = {"superficial": SUPERFICIAL, "deep": DEEP, "bone": BONE}
_UNSAID = 255
_SEGMENT = "segment it, or say which label it has"
_SQUARE = 1e-3  # of a direction's cosine


@dataclass(frozen=True, eq=False)
class LabelVolume:
    """Labels on a regular grid whose axes are those of the coordinates.

    Parameters
    ----------
    labels : (n_x, n_y, n_z) array of uint8
        `BACKGROUND`, `SUPERFICIAL`, `DEEP`; `BONE` and the next ones are ``bones``.
    spacing : (3,) array
        Between voxels' centres, mm.
    origin : (3,) array
        Centre of the voxel [0, 0, 0], mm.
    source : str
        What errors name as the file.
    transform : bool
        Whether the file states where the volume lies; else its spacing may be lost too.
    bones : tuple of str
        Names of the bones; none where a calf's two share a label.
    """

    labels: NDArray[np.uint8]
    spacing: FloatArray
    origin: FloatArray
    source: str = "volume"
    transform: bool = True
    bones: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check the labels."""
        freeze(self, "spacing", "origin")
        if self.labels.ndim != 3:
            raise InputError(self.source, "shape", f"is {self.labels.ndim}-dimensional", "give one volume")
        if not (self.spacing > 0).all():
            raise InputError(self.source, "spacing", "is not positive", "correct the header")
        present = np.bincount(np.minimum(self.labels, BONE).ravel(), minlength=len(TISSUES) + 1)
        skin = "segment fat and skin: without them the leg's surface isn't known"
        for name, remedy in (("superficial", skin), ("bone", _SEGMENT)):
            if not present[TISSUES[name]]:
                raise InputError(self.source, "labels", f"no voxel is labelled {TISSUES[name]} ({name})", remedy)

    @property
    def affine(self) -> FloatArray:
        """Voxel's numbers to mm, (4, 4)."""
        return _affine(self.spacing, self.origin)

    @property
    def levels(self) -> FloatArray:
        """Level z of every slice, mm."""
        return np.asarray(self.origin[2] + self.spacing[2] * np.arange(self.labels.shape[2]))


def volume_of_array(
    array: NDArray[np.integer],
    affine: FloatArray,
    source: str,
    meaning: Mapping[str, int | list[int]] | None = None,
    alone: str = "",
) -> LabelVolume:
    """Make a volume of labels in any order and orientation along the axes.

    Parameters
    ----------
    array : (n_1, n_2, n_3) array of integers
        Labels.
    affine : (4, 4) array
        The array's indices to mm.
    source : str
        What errors name as the file.
    meaning : mapping, optional
        Parts (see `legfem.geometry.part_names.part_named`) to the labels they have in the array, one or several;
        ``superficial``, ``deep`` and ``bone`` are 1, 2 and 3 by default. Bones that aren't there are left out.
    alone : str
        Muscle that is read as the only bone would be, to have its outline: all other parts in the skin are deep then.

    Raises
    ------
    InputError
        If a label is missing or unknown, or the grid is sheared.
    """
    array, affine = along_axes(array, np.asarray(affine, dtype=np.float64), source)
    refused = partial(InputError, source, "labels")
    meaning = TISSUES if meaning is None else meaning
    parts = {name: part_named(name, f"{source}: labels") for name in meaning}
    if alone:
        parts = {name: part if part == "skin" else MUSCLE_HULL for name, part in parts.items()}
        parts[muscle_named(alone, meaning, f"{source}: labels")] = alone
    if unsaid := [name for name in unsaid_tissues(meaning, source) if name != "deep"]:
        raise refused(f"{unsaid[0]} has no label given", "give one")
    of_bones = [name for name, part in parts.items() if _label_of(part) == BONE]
    there = [parts[name] for name in of_bones if np.isin(array, meaning[name]).any()]
    bones = tuple(bones_of(there)) if there != ["bone"] else ()
    labels = np.full(array.shape, _UNSAID, dtype=np.uint8)
    labels[array == 0] = BACKGROUND
    for name, given in meaning.items():
        label = BONE + bones.index(parts[name]) if parts[name] in bones else _label_of(parts[name])
        labels[np.isin(array, given)] = label
    if (unknown := array[labels == _UNSAID]).size:
        known = ", ".join(f"{name} = {number}" for name, number in meaning.items())
        problem = f"{(unknown == unknown[0]).sum()} voxels are labelled {unknown[0]}, which is none of {known}"
        raise refused(problem, "say which tissue that is; give a label volume, not an image")
    return LabelVolume(labels, np.diag(affine)[:3], affine[:3, 3], source, bones=bones)


def _label_of(part: str) -> int:
    return {"skin": SUPERFICIAL, MUSCLE_HULL: DEEP}.get(part, BONE)


def unsaid_tissues(meaning: Collection[str], source: str) -> dict[str, int]:
    """Return the tissues, with their usual labels, that no name of a part stands for."""
    said = {_label_of(part_named(name, f"{source}: labels")) for name in meaning}
    return {name: label for name, label in TISSUES.items() if label not in said}


def check_same_spacing(first: LabelVolume, second: LabelVolume) -> None:
    """Check that two volumes are of one size, where one of them states no transform.

    Raises
    ------
    InputError
        If their spacing differs.
    """
    if first.transform and second.transform:
        return
    if not np.allclose(first.spacing, second.spacing, rtol=1e-3):
        given = [" x ".join(f"{s:.4g}" for s in v.spacing) for v in (first, second)]
        problem = f"{given[1]} mm, but {given[0]} mm in {first.source}, and a header states no transform"
        remedy = "save the volumes with their transforms, or correct the spacing"
        raise InputError(second.source, "spacing", problem, remedy)


def along_axes(array: NDArray[np.integer], affine: FloatArray, source: str) -> tuple[NDArray[np.integer], FloatArray]:
    """Permute and flip an array so that its affine is diagonal and positive.

    A grid that is oblique to the patient's axes is resampled.

    Raises
    ------
    InputError
        If the array is no volume, or its affine is singular or sheared.
    """
    if array.ndim != 3 or affine.shape != (4, 4):
        raise InputError(source, "shape", f"{array.shape} is not the shape of a volume", "give one volume")
    if not np.isfinite(affine).all() or np.linalg.matrix_rank(affine[:3, :3]) < 3:
        raise InputError(source, "affine", "is singular", "correct the header")
    from nibabel.orientations import apply_orientation, inv_ornt_aff, io_orientation

    nearest = io_orientation(affine)
    affine = affine @ inv_ornt_aff(nearest, array.shape)
    array = apply_orientation(array, nearest)
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    if (np.diag(affine)[:3] < (1 - _SQUARE) * spacing).any():
        return _resampled(array, affine, source)
    return np.ascontiguousarray(array), _affine(spacing, affine[:3, 3])


_IN_PLANE: NDArray[np.bool_] = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool)[:, :, None]


def check_anatomy(volume: LabelVolume, muscle: bool = True) -> None:
    """Check that the fat is outermost and the bones are less than the muscle, if there is to be any.

    Raises
    ------
    InputError
        If another label than the fat's touches the air most, there is no muscle, or more bone than muscle.
    """
    refused = partial(InputError, volume.source, "labels")
    tissues = np.minimum(volume.labels, BONE)
    air = tissues == BACKGROUND
    at_air = tissues[ndimage.binary_dilation(air, _IN_PLANE) & ~air]
    names = {label: name for name, label in TISSUES.items()}
    outermost = names[int(np.argmax(np.bincount(at_air, minlength=4)[1:])) + 1]
    if outermost != "superficial":
        problem = f"what is labelled {outermost} lies outermost, where fat is"
        raise refused(problem, f"exchange superficial and {outermost} under [labels]")
    bone, deep = (int((tissues == label).sum()) for label in (BONE, DEEP))
    if muscle and not deep:
        raise refused(f"no voxel is labelled {DEEP} (deep)", _SEGMENT)
    if muscle and bone > deep:
        problem = f"there is more bone ({bone} voxels) than muscle ({deep})"
        raise refused(problem, "exchange deep and bone under [labels]")


def cropped(volume: LabelVolume, low: float, high: float) -> LabelVolume:
    """Return the slices between two levels (mm); the whole volume if there are none."""
    kept = np.flatnonzero((volume.levels >= low) & (volume.levels <= high))
    if len(kept) < 2:
        return volume
    first, last = int(kept[0]), int(kept[-1])
    origin = volume.origin + np.array([0.0, 0.0, first * volume.spacing[2]])
    return replace(volume, labels=volume.labels[:, :, first : last + 1], origin=origin)


def with_bones_between(volume: LabelVolume, low: float, high: float) -> LabelVolume:
    """Return a volume without the bones that end beyond two levels (mm), which count as deep tissue where they are.

    It stays as it is where no bone is between them.
    """
    within = cropped(volume, low - volume.spacing[2], high + volume.spacing[2]).labels
    kept = [k for k in range(len(volume.bones)) if (within == BONE + k).any()]
    if len(kept) in (0, len(volume.bones)):
        return volume
    new = np.full(BONE + len(volume.bones), DEEP, dtype=np.uint8)
    new[:BONE], new[np.add(BONE, kept)] = range(BONE), BONE + np.arange(len(kept))
    return replace(volume, labels=new[volume.labels], bones=tuple(volume.bones[k] for k in kept))
