r"""Strain along the travel inside the section, as strain elastography shows it.

A file has a frame a time: points ``x_mm, y_mm`` where they were before the cylinder pressed, in the outlines'
coordinates, and the strain there since, below zero where the tissue is shortened along the travel. An estimator fits a
line to displacements along the beam over a window of length w, so that a reading at :math:`X` is

.. math:: \frac{e \cdot (u(X + w e / 2) - u(X - w e / 2))}{w}

with the travel's direction :math:`e`. Where an image lies is known as for displacements
(`legfem.channels.kinds.section_displacement`).
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from legfem.channels.image import CELL_MM, cell_means, cells_of, displaced_image, gradient_error, tissue_points
from legfem.channels.kind import (
    ChannelAccuracy,
    ChannelKind,
    Channels,
    Frames,
    FramesFile,
    Impossible,
    Read,
    ReadingsAtSite,
)
from legfem.channels.site import Site
from legfem.common.units import FloatArray

if TYPE_CHECKING:
    from legfem.channels.seen import Seen

STRAIN = ChannelKind(
    "section_strain",
    "-",
    "strain along the travel inside the section, since before the cylinder pressed",
    ChannelAccuracy(reading=0.02, gain=0.05, slow=0.005, lag=0.1, shift=2.0, turn=3.0, apart=4.0),
    0.0005,
)
"""Accuracies of a cell, by what quasi-static elastography reports of phantoms: a few per cent of strain."""
WINDOW_MM = 3.0
"""Over which an estimator fits its line."""
_MOST_CELLS = 30
_LARGEST = 0.9
_AT_REST, _RESTING_MM = 0.1, 0.5
"""What strains may be where the cylinder has moved by less than this."""


class SectionStrains(FramesFile):
    """Strains along the travel, in cells; a place is x, y, mm."""

    kinds: ClassVar = (STRAIN,)
    entry = STRAIN.name
    columns = ("x_mm", "y_mm", "strain")

    def read(self, seen: "Seen") -> Channels:
        """Return the strains at the places where somebody looked."""
        places = seen.places(STRAIN.name)
        if not len(places):
            return {}
        way = seen.model.system.direction
        ahead, ahead_rates = seen.moves(places + 0.5 * WINDOW_MM * way)
        behind, behind_rates = seen.moves(places - 0.5 * WINDOW_MM * way)
        values, rates = ((ahead - behind) @ way) / WINDOW_MM, ((ahead_rates - behind_rates) @ way) / WINDOW_MM
        names = STRAIN.courses(len(places))
        return {name: (float(value), rate) for name, value, rate in zip(names, values, rates.T, strict=True)}

    def check(self, kind: ChannelKind, recorded: ReadingsAtSite) -> Impossible | None:
        """Refuse strains in per cent, of the other sign, or not counted from first touch."""
        pressed = np.isfinite(recorded.depth)
        depth, values = recorded.depth[pressed], recorded.values[pressed]
        largest = float(np.abs(values).max(initial=0.0))
        if largest > _LARGEST:
            return Impossible(f"it is up to {largest:.3g}", "give strain as a share of length, not in per cent")
        at_rest = values[depth < _RESTING_MM]
        stood = float(np.sqrt(np.mean(at_rest**2))) if len(at_rest) else 0.0
        if stood > _AT_REST:
            return Impossible(
                f"the tissue is strained by {stood:.2g} before the cylinder touches",
                "count strains from a frame before it presses, summed from frame to frame",
            )
        deep = depth > 0.5 * depth.max(initial=0.0)
        if deep.any() and float(np.mean(values[deep])) > max(0.02, 2 * recorded.accuracy.reading):
            return Impossible(
                f"the tissue is stretched along the travel, by {np.mean(values[deep]):.2g} in the mean",
                "give a shortening as a strain below zero",
            )
        return None

    def apart(self, places: FloatArray) -> FloatArray:
        """Return how far readings are apart."""
        return np.asarray(np.linalg.norm(places[:, None] - places[None], axis=-1))

    def shared(
        self,
        places: FloatArray,
        time: FloatArray,
        frame: NDArray[np.int_],
        values: FloatArray,
        accuracy: ChannelAccuracy,
    ) -> dict[str, FloatArray]:
        """Return what a shift of the image in either direction does, and a turn about its middle.

        By where strains are read; that the beam is turned too is a share of the turn's square, and of the shear.
        """
        return displaced_image(places, values, frame, accuracy)

    def shared_is_off(self, places: FloatArray) -> float:
        """Return by how much the gradient is off that the image's place is weighed with."""
        return gradient_error(places)

    def of_frames(self, frames: Sequence[Frames], site: Site) -> Sequence[Sequence[Read]]:
        """Return the cells' mean strains, of points whose window lies in tissue."""
        inside = tissue_points(frames, site, -WINDOW_MM)
        points = [one.columns[kept, :2] for one, kept in zip(frames, inside, strict=True)]
        cells = cells_of(points, site.touch, _MOST_CELLS)
        places = tuple((round(float(x), 3), round(float(y), 3)) for x, y in cells.middles)
        found = []
        for one, kept, own in zip(frames, inside, cells.of_trial, strict=True):
            times, course, means = cell_means(one.time[kept], own, one.columns[kept, 2:])
            found.append([Read(STRAIN.name, times, means[:, 0], course, places)])
        return found

    def place(self, kind: ChannelKind, site: Site) -> FloatArray:
        """Return a point under the cylinder, within the tissue."""
        return np.asarray(site.deepest + 2 * CELL_MM * site.direction)
