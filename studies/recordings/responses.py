r"""What a specimen answers, for the machinery of `legfem.diagnose`.

Where all of the tissue relaxes alike, the force of a growing contact is

.. math:: F(t) = F_e(t) + \sum_k \beta_k \int_0^t e^{-(t - s) / \tau_k} \dot F_e(s)\, ds

with the elastic force :math:`F_e` of the same motion: exact for small strains (E. H. Lee, J. R. M.
Radok, J. Appl. Mech. 27 (1960) 438-444); `SolvedRelaxation` has the finite-element solution.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.common.units import FloatArray
from legfem.inverse.observations import Observations
from legfem.legs.mechanisms import Stiffness, TissueMechanism, Values
from legfem.legs.mechanisms.viscoelasticity import TIMES_S, TissueRelaxation
from studies.recordings.curves import ElasticCurves
from studies.recordings.motion import Motion

C10_BOUNDS_KPA = 0.02, 200.0
C20_BOUNDS_KPA = 0.0, 200.0
_LEAST_N = 1e-9
_KEPT = 50


@dataclass(frozen=True, eq=False)
class SpecimenResponses:
    """Responses of one specimen; see `legfem.inverse.predictor.Responses`.

    Parameters
    ----------
    curves
        Elastic.
    motion
        As recorded; without it nothing relaxes.
    """

    curves: ElasticCurves
    motion: Motion | None = None
    _weights: dict[int, FloatArray] = field(default_factory=dict, repr=False)
    _known: dict[tuple[float, int], FloatArray] = field(default_factory=dict, repr=False)
    _observed: list[Observations] = field(default_factory=list, repr=False)
    """Kept alive, so that their identities stay theirs."""

    @property
    def grid(self) -> FloatArray:
        """Displacements of the elastic curves, mm."""
        return self.curves.grid

    @property
    def c10_bounds(self) -> tuple[float, float]:
        """Stiffness C10 that it holds for, kPa."""
        return C10_BOUNDS_KPA

    @property
    def c20_bounds(self) -> tuple[float, float]:
        """Stiffness C20 that it holds for, kPa."""
        return C20_BOUNDS_KPA

    def curve(self, c10: float, c20: float) -> FloatArray:
        """Return the elastic force at the grid, N."""
        return self.curves.at(c10, c20)

    def relative_change(
        self, mechanism: TissueMechanism, values: Values, at: Stiffness, observed: Observations
    ) -> FloatArray:
        """Return what relaxation adds to the elastic force, over that force; (n,)."""
        if not isinstance(mechanism, TissueRelaxation) or self.motion is None:
            raise TypeError(f"no response to {mechanism.name}")
        c10, c20 = at
        share = c20 / (c10 + c20)
        return np.asarray(mechanism.shares(values) @ self._per_ratio(share, observed))

    def _per_ratio(self, share: float, observed: Observations) -> FloatArray:
        """Return what every branch of ratio one adds, over the elastic force; (branches, n)."""
        key = share, id(observed)
        if key not in self._known:
            assert self.motion is not None
            times = self.motion.at_stations(observed)
            elastic = self._elastic(share)
            if id(observed) not in self._weights:
                self._weights[id(observed)] = _remembered(self.motion.time, times)
                self._observed.append(observed)
            weights = self._weights[id(observed)]
            at = np.interp(times, self.motion.time, self.motion.displacement)
            added = weights @ np.diff(elastic(self.motion.displacement))
            if len(self._known) > _KEPT:
                self._known.clear()
            self._known[key] = added / np.maximum(elastic(at), _LEAST_N)
        return self._known[key]

    def _elastic(self, share: float) -> CubicSpline:
        """Return the elastic force (N) with C10 + C20 of 1 kPa, by displacement (mm)."""
        grid = np.concatenate([[0.0], self.grid])
        return CubicSpline(grid, np.concatenate([[0.0], self.curve(1.0 - share, share)]))


def _remembered(waypoints: FloatArray, times: FloatArray) -> FloatArray:
    """Return the share (branches, n, w - 1) of each step's rise that a branch still bears."""
    start, end = waypoints[:-1], waypoints[1:]
    until = np.clip(times[:, None], start, end)
    tau = np.array(TIMES_S)[:, None, None]

    def faded(since: FloatArray) -> FloatArray:
        return np.exp(-np.maximum(times[:, None] - since, 0.0) / tau)

    return np.asarray(tau * (faded(until) - faded(start)) / (end - start))
