"""Rigid motions."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, frozen_array


@dataclass(frozen=True, eq=False)
class RigidTransform:
    """x -> R x + t.

    Parameters
    ----------
    rotation : (3, 3) array
        R, a rotation.
    translation : (3,) array
        t, mm.

    Raises
    ------
    InputError
        If R is no rotation.
    """

    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    translation: FloatArray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        """Copy and check."""
        for name in ("rotation", "translation"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        R, t = self.rotation, self.translation
        if R.shape != (3, 3) or t.shape != (3,) or not np.isfinite(t).all():
            raise InputError(
                "transform",
                "shape",
                "is not a 3 x 3 rotation and a translation of 3 lengths (mm)",
                "give R and t of x -> R x + t",
            )
        if not np.allclose(R @ R.T, np.eye(3), atol=1e-6) or np.linalg.det(R) < 0:
            raise InputError("transform", "rotation", "is not a rotation", "give an orthogonal matrix, det 1")

    @staticmethod
    def of_angles(degrees: tuple[float, float, float], translation: FloatArray) -> RigidTransform:
        """Return turns about the fixed axes x, y and z, in this order, then a translation (mm)."""
        turn = Rotation.from_euler("xyz", degrees, degrees=True).as_matrix()
        return RigidTransform(turn, np.asarray(translation, dtype=np.float64))

    def __call__(self, points: FloatArray) -> FloatArray:
        """Return moved points, (..., 3), mm."""
        moved: FloatArray = points @ self.rotation.T + self.translation
        return moved

    def inverse(self) -> RigidTransform:
        """Return the motion back."""
        return RigidTransform(self.rotation.T, -self.rotation.T @ self.translation)

    def after(self, first: RigidTransform) -> RigidTransform:
        """Return the motion that does ``first`` and then this one."""
        return RigidTransform(self.rotation @ first.rotation, self.rotation @ first.translation + self.translation)
