"""The flat probe's force and both layers' loss of thickness, between the points solved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import RBFInterpolator

from legfem.common.units import FloatArray
from studies.people.probe import STRAINS, SolvedPoint


@dataclass(frozen=True, eq=False)
class ProbeResponse:
    """Cubic radial functions about a quadratic trend, through the points solved.

    Parameters
    ----------
    at : (n, 3) array
        Points, see `LOWEST`.
    force, share : (n, strains) array
        As in `SolvedPoint`.
    """

    at: FloatArray
    force: FloatArray
    share: FloatArray

    @classmethod
    def through(cls, at: FloatArray, found: Sequence[SolvedPoint]) -> ProbeResponse:
        """Return the response through those points that were solved."""
        done = [k for k, one in enumerate(found) if not one.problem]
        return cls(at[done], np.array([found[k].force for k in done]), np.array([found[k].share for k in done]))

    @cached_property
    def _smooth(self) -> RBFInterpolator:
        values = np.hstack([self.force, self.share])
        return RBFInterpolator(self.at, values, kernel="cubic", degree=2)

    def __call__(self, at: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the force's logarithm and the share (..., strains) at points (..., 3)."""
        flat = self._smooth(at.reshape(-1, 3)).reshape(*at.shape[:-1], 2, len(STRAINS))
        return flat[..., 0, :], flat[..., 1, :]

    def error(self, at: FloatArray, found: Sequence[SolvedPoint]) -> tuple[FloatArray, FloatArray]:
        """Return the errors (solved, strains) of both at points that were solved too."""
        other = ProbeResponse.through(at, found)
        force, share = self(other.at)
        return force - other.force, share - other.share
