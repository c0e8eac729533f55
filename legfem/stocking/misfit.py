r"""How far the contours of a simulated leg are from those of the leg scanned in its stocking.

The residuals are the distances along the scanned contours' normals, skin and hull, in a few slices
of the calf. Their errors come from the outlines of the scan, alike over some way along the contours
and from slice to slice (`legfem.stocking.accuracy`), and from the model itself, which is taken to
be off alike. The bare outlines' errors are nuisances, since the stocking answers to them
(`legfem.stocking.nuisance_slopes`); so is what is left of a rigid motion between the scans: bones
are nearly prisms, so that they hardly fix the scans along the leg.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import LegShape
from legfem.geometry.shape_motion import rigidly_moved
from legfem.geometry.slices import CONTOURS, SliceSet, slice_distances
from legfem.stocking.accuracy import ContourAccuracy
from legfem.stocking.outline_errors import HELD, OutlineErrors, outline_errors

SHIFT, TURN = 0.05, 0.001
"""Of differences: mm, rad."""


@dataclass(frozen=True, eq=False)
class ContourMisfit:
    """The scanned contours, and how well a simulated shape meets them.

    Parameters
    ----------
    target : SliceSet
        Scanned, in the stocking.
    accuracy : ContourAccuracy
        Of both scans.
    offset : (n,) array or float
        How far the bare leg that is meshed lies outside the bare leg that was scanned, where its
        parts had to be moved apart (mm); what simulated distances are taken less of.
    """

    target: SliceSet
    accuracy: ContourAccuracy
    offset: FloatArray | float = 0.0

    @classmethod
    def between(cls, target: SliceSet, accuracy: ContourAccuracy, scanned: LegShape, meshed: LegShape) -> ContourMisfit:
        """Return the misfit of a leg that was scanned bare, and meshed a little otherwise."""
        plain = cls(target, accuracy)
        return cls(target, accuracy, plain.distances(meshed) - plain.distances(scanned))

    def distances(self, shape: LegShape) -> FloatArray:
        """Return how far a simulated shape lies outside the target (mm), skin first, (n,)."""
        found = slice_distances(self.target, SliceSet.of(shape, self.target.levels))
        return np.concatenate([found[name].ravel() for name in CONTOURS]) - self.offset

    def cost(self, distances: FloatArray) -> float:
        """Return the paper's cost before it is normalised: the sum of squares (mm2)."""
        return float(distances @ distances)

    def rigid_slopes(self, shape: LegShape) -> FloatArray:
        """Return the distances' slopes by rigid motions of a simulated shape, (n, 6).

        Three translations (mm), then turns about x, y and z through the slices' middle (rad).
        """
        here = self.distances(shape)
        middle = np.array([*self.target.outer.mean(axis=(0, 1)), self.target.levels.mean()])
        columns = []
        for number in range(6):
            shift, turn = np.zeros(3), np.zeros(3)
            step = SHIFT if number < 3 else TURN
            (shift if number < 3 else turn)[number % 3] = step
            rotation = Rotation.from_rotvec(turn).as_matrix()
            moved = rigidly_moved(shape, rotation, middle - rotation @ middle + shift)
            columns.append((self.distances(moved) - here) / step)
        return np.stack(columns, axis=1)

    @property
    def rigid_sd(self) -> FloatArray:
        """Standard deviations of the rigid motions, (6,)."""
        return np.array([*self.accuracy.shift_sd, *self.accuracy.turn_sd])

    def whitened(self, values: FloatArray) -> FloatArray:
        """Return distances (n,) or derivatives (n, k) in units of independent errors, (m,), (m, k).

        Only undulations that the outlines have errors of are compared: the model's own are not
        known finer than that.
        """
        columns = values.reshape(len(values), -1)
        parts = np.split(columns, len(CONTOURS))
        shares = [
            errors.shares(part.reshape(*errors.modes.shape[:2], -1))
            for errors, part in zip(self._errors, parts, strict=True)
        ]
        white = np.concatenate(shares) / self._sd
        return white.reshape(-1, *values.shape[1:])

    @property
    def _sd(self) -> float:
        """Of the errors that are no nuisances, over that of one scan's outlines."""
        accuracy = self.accuracy
        model = accuracy.model_sd / accuracy.smoothed_sd
        return float(np.sqrt(1.0 + (1.0 - HELD) + model**2))

    @cached_property
    def _errors(self) -> tuple[OutlineErrors, ...]:
        """Of the target, outer and inner contours."""
        target = self.target
        return tuple(outline_errors(self.accuracy, target.contours(name), target.levels) for name in CONTOURS)
