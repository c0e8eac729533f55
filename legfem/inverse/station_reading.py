"""What readings at stations take of a model's courses on a grid of displacements, for given first contacts."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.linalg import block_diag

from legfem.common.units import FloatArray
from legfem.inverse.observations import Observations
from legfem.inverse.readings import unit_spline
from legfem.inverse.stations import since_touch
from legfem.solve.path import ForceCurve

type Derivatives = dict[str, FloatArray]
type Corrected = Callable[[FloatArray, Derivatives], tuple[FloatArray, Derivatives]]


@dataclass(frozen=True, eq=False)
class StationReading:
    """Readings of all trials, whose first contacts are given, from courses on a grid.

    Parameters
    ----------
    observed : Observations
        K trials at n stations, N readings in all.
    contacts : (K,) array
        First contacts (mm), after those counted from.
    grid : (g,) array
        Displacements (mm), rising from above 0: of forces, which vanish at 0, and of each further course's changes
        since touch, which follow its value there. Together these are a model's m values.
    """

    observed: Observations
    contacts: FloatArray
    grid: FloatArray

    def unseen_in(self, curve: ForceCurve) -> list[str]:
        """Names of the channels whose courses a solve doesn't have."""
        return [one.name for one in self.observed.channels if not curve.channels.keys() >= set(one.courses)]

    @property
    def size(self) -> int:
        """Number m of the model's values."""
        return len(self.grid) + len(self.observed.courses) * (1 + len(self.grid))

    @cached_property
    def pressed(self) -> FloatArray:
        """Displacement after touch (n,), mm; negative before it."""
        return np.asarray(self.observed.displacement - self.contacts[self.observed.trial])

    @cached_property
    def _spline(self) -> CubicSpline:
        return unit_spline(self.grid)

    def _at(self, ways: FloatArray, derivative: int = 0) -> FloatArray:
        """Return what values on the grid make at ways after touch, or their derivatives; (k, g)."""
        return np.asarray(self._spline(np.maximum(ways, 0.0), derivative))

    def matrix(self, derivative: int = 0, offset: float = 0.0) -> FloatArray:
        """Return what all readings take of the model's values, or their derivatives by the displacement; (N, m).

        ``offset`` (mm) is how much later all trials touch.
        """
        ways, share = since_touch(self.pressed - offset, self.observed.half_width)
        force = share[:, None] * self._at(ways, derivative)
        if derivative:
            # Within a station's half-width of touch the share itself changes.
            half = self.observed.half_width
            inside = (share > 0) & (share < 1.0) & (half > 0)
            rise = np.divide(0.5, half, out=np.zeros_like(half), where=inside)
            force = np.where(inside, 0.5, 1.0)[:, None] * force + rise[:, None] * self._at(ways)
        if not self.observed.courses:
            return force
        after = self.pressed - offset
        change = np.where(after > 0, 1.0, 0.0)[:, None] * self._at(after, derivative)
        level = np.full((len(after), 1), 0.0 if derivative else 1.0)
        course, blocks, width = np.hstack([level, change]), [], 1 + len(self.grid)
        for one in self.observed.channels:
            block = np.zeros((len(one.values), len(one.courses) * width))
            for k, rows in enumerate(one.rows):
                block[rows, k * width : (k + 1) * width] = one.weights[rows] @ course
            blocks.append(block)
        return np.asarray(block_diag(force, *blocks))

    @cached_property
    def plain(self) -> FloatArray:
        """What all readings take of the model's values, (N, m)."""
        return self.matrix()

    @cached_property
    def linear_scale(self) -> FloatArray:
        """Sizes (m,) of what isn't a force along the travel, which is 0."""
        channels = self.observed.channels
        sizes = [max(float(np.ptp(one.values)), 3 * one.kind.usual.reading) for one in channels for _ in one.courses]
        return np.concatenate([np.zeros(len(self.grid)), np.repeat(sizes, 1 + len(self.grid))])

    def model_values(
        self, curve: ForceCurve, corrected: Corrected = lambda change, by: (change, by)
    ) -> tuple[FloatArray, Derivatives]:
        """Return what the model gives on the grid (m,), and its derivatives.

        Parameters
        ----------
        curve
            The solve.
        corrected
            What acts on the force, on changes (g,) of channels that follow it, and on their derivatives.
        """
        names, knots = tuple(curve.sensitivities), np.concatenate([[0.0], self.grid])
        force, by_force = corrected(curve(self.grid), {name: curve.sensitivity(name, self.grid) for name in names})
        parts, by = [force], {name: [rates] for name, rates in by_force.items()}
        for one in self.observed.channels:
            for course in one.courses:
                level = curve.channel(course, knots)
                rates = {name: curve.channel_sensitivity(course, name, knots) for name in names}
                change, by_change = level[1:] - level[0], {name: rate[1:] - rate[0] for name, rate in rates.items()}
                if one.kind.follows_force:
                    change, by_change = corrected(change, by_change)
                parts += [level[:1], change]
                for name in names:
                    by[name] += [rates[name][:1], by_change[name]]
        return np.concatenate(parts), {name: np.concatenate(rows) for name, rows in by.items()}

    def images_elsewhere(self, curve: ForceCurve) -> dict[str, dict[str, FloatArray]]:
        """Return what images do that lie elsewhere, by channel and by way: one standard deviation, (k,) readings."""
        pressed, found = np.maximum(self.pressed, 0.0), dict[str, dict[str, FloatArray]]()
        for one in self.observed.channels:
            for way, names in one.laid_courses.items():
                by_name = {own: curve.channel(name, pressed) for own, name in zip(one.courses, names, strict=True)}
                found.setdefault(one.name, {})[way] = one.accuracy.laid[way] * one.read(by_name.__getitem__)
        return found
