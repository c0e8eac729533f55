"""Whether the labels of a volume are a leg's: bone inside muscle inside fat."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from legfem.common.errors import InputError
from legfem.imaging.volume import BACKGROUND, BONE, DEEP, TISSUES, LabelVolume

_IN_PLANE: NDArray[np.bool_] = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool)[:, :, None]


def check_anatomy(volume: LabelVolume) -> None:
    """Check that the fat is outermost and the bones are less than the muscle.

    Raises
    ------
    InputError
        If another label than the fat's touches the air most, or there is more bone than muscle.
    """
    air = volume.labels == BACKGROUND
    at_air = volume.labels[ndimage.binary_dilation(air, _IN_PLANE) & ~air]
    names = {label: name for name, label in TISSUES.items()}
    outermost = names[int(np.argmax(np.bincount(at_air, minlength=4)[1:])) + 1]
    if outermost != "superficial":
        raise InputError(
            volume.source,
            "labels",
            f"what is labelled {outermost} lies outermost, where fat is",
            f"exchange superficial and {outermost} under [labels]",
        )
    bone, deep = (int((volume.labels == label).sum()) for label in (BONE, DEEP))
    if bone > deep:
        raise InputError(
            volume.source,
            "labels",
            f"there is more bone ({bone} voxels) than muscle ({deep})",
            "exchange deep and bone under [labels]",
        )


def cropped(volume: LabelVolume, low: float, high: float) -> LabelVolume:
    """Return the slices between two levels (mm); the whole volume if there are none."""
    kept = np.flatnonzero((volume.levels >= low) & (volume.levels <= high))
    if len(kept) < 2:
        return volume
    first, last = int(kept[0]), int(kept[-1])
    origin = volume.origin + np.array([0.0, 0.0, first * volume.spacing[2]])
    return LabelVolume(volume.labels[:, :, first : last + 1], volume.spacing, origin, volume.source, volume.transform)
