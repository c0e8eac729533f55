"""What a solution gives: force, further channels and derivatives along its path, and the report of its work."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator

from legfem.common.units import FloatArray


@dataclass(frozen=True, eq=False)
class ForceCurve:
    """Force against displacement at the solved steps, and a cubic spline through them.

    Parameters
    ----------
    displacement : ndarray
        (n,), mm, increasing from 0.
    force : ndarray
        (n,), N.
    sensitivities : Mapping[str, ndarray]
        Derivative of the force (N per unit of the parameter) by the parameter's full name.
    channels : Mapping[str, ndarray]
        What else is measured, by its name in `legfem.channels.kinds.CHANNELS`, (n,).
    channel_sensitivities : Mapping[str, Mapping[str, ndarray]]
        Derivatives by channel and by the parameter's full name, (n,).
    """

    displacement: FloatArray
    force: FloatArray
    sensitivities: Mapping[str, FloatArray] = field(default_factory=dict)
    channels: Mapping[str, FloatArray] = field(default_factory=dict)
    channel_sensitivities: Mapping[str, Mapping[str, FloatArray]] = field(default_factory=dict)

    @property
    def depth(self) -> float:
        """Greatest displacement (mm)."""
        return float(self.displacement[-1])

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.displacement, self.force)

    def __call__(self, displacement: ArrayLike) -> FloatArray:
        """Return the force (N) at displacements (mm); zero before first touch."""
        at = np.asarray(displacement, dtype=float)
        return np.where(at > 0, self._spline(np.maximum(at, 0.0)), 0.0)

    def stiffness(self, displacement: ArrayLike) -> FloatArray:
        """Return dF/dd (N/mm); zero before first touch."""
        at = np.asarray(displacement, dtype=float)
        return np.where(at > 0, self._spline(np.maximum(at, 0.0), 1), 0.0)

    def sensitivity(self, parameter: str, displacement: ArrayLike) -> FloatArray:
        """Return the derivative of the force by a parameter at displacements (mm)."""
        spline = CubicSpline(self.displacement, self.sensitivities[parameter])
        at = np.asarray(displacement, dtype=float)
        return np.where(at > 0, spline(np.maximum(at, 0.0)), 0.0)

    def channel(self, name: str, displacement: ArrayLike) -> FloatArray:
        """Return a channel at displacements (mm); before first touch, what it is there."""
        return self.interpolated(self.channels[name], displacement)

    def interpolated(self, values: FloatArray, displacement: ArrayLike) -> FloatArray:
        """Return values (n, ...) of the solved steps at displacements (mm); before first touch, what they are there."""
        at = np.maximum(np.asarray(displacement, dtype=float), 0.0)
        return np.asarray(CubicSpline(self.displacement, values)(at))

    def mean_slope(self, start: float, end: float) -> float:
        """Return (F(end) - F(start)) / (end - start) in N/mm."""
        first, last = self(np.array([start, end]))
        return float((last - first) / (end - start))

    def mean_curvature(self, start: float, end: float) -> float:
        r"""Return the mean curvature of F(d) in a window from a to b (N/mm2).

        It is the second derivative of the least-squares parabola. With
        :math:`t = (d - a) / (b - a)`,

        .. math:: \frac{60}{(b - a)^2} \int_0^1 (6 t^2 - 6 t + 1)\, F \, dt
                  = \int_0^1 30\, t^2 (1 - t)^2\, \frac{d^2 F}{d d^2} \, dt,

        where the left side needs no derivative of the curve, and the right side shows a mean of the
        second derivative: its weights integrate to 1 and vanish at the window's ends.
        """
        nodes, weights = np.polynomial.legendre.leggauss(64)
        force = self(start + (end - start) * (nodes + 1) / 2)
        # F projects on the second Legendre polynomial with 5/2 times this integral, and the second
        # derivative of that polynomial over a window of length b - a is 3 (2 / (b - a))^2.
        projection = 2.5 * float(np.sum(weights * force * (1.5 * nodes**2 - 0.5)))
        return 12.0 * projection / (end - start) ** 2


@dataclass(frozen=True, eq=False)
class Path:
    """All solved steps of a test, the start included.

    Parameters
    ----------
    time : ndarray
        (n,), s, increasing.
    displacement : ndarray
        (n,), mm.
    force : ndarray
        (n,), N.
    sensitivities : Mapping[str, ndarray]
        Derivative of the force (N per unit of the parameter) by the parameter's full name, (n,).
    channels, channel_sensitivities
        As those of `ForceCurve`.
    """

    time: FloatArray
    displacement: FloatArray
    force: FloatArray
    sensitivities: Mapping[str, FloatArray] = field(default_factory=dict)
    channels: Mapping[str, FloatArray] = field(default_factory=dict)
    channel_sensitivities: Mapping[str, Mapping[str, FloatArray]] = field(default_factory=dict)

    @property
    def loading(self) -> ForceCurve:
        """The first loading, against displacement."""
        moves_in = np.diff(self.displacement) > 0
        end = len(moves_in) if moves_in.all() else int(np.argmin(moves_in))
        part = slice(0, end + 1)
        curve = ForceCurve(self.displacement[part], self.force[part])
        return with_courses(curve, each_course(courses_of(self), lambda values: values[part]))

    def force_at(self, time: ArrayLike) -> FloatArray:
        """Return the force (N) at times (s)."""
        return self._at(time, self.force)

    def sensitivity_at(self, parameter: str, time: ArrayLike) -> FloatArray:
        """Return the derivative of the force by a parameter at times (s)."""
        return self._at(time, self.sensitivities[parameter])

    def channels_at(self, time: ArrayLike) -> dict[str, FloatArray]:
        """Return every channel at times (s)."""
        return self.each_at(time, self.channels)

    def each_at(self, time: ArrayLike, values: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        """Return values along the path, (n,) each, at times (s)."""
        if not values:
            return {}
        return dict(zip(values, self._at(time, np.column_stack(list(values.values()))).T, strict=True))

    def _at(self, time: ArrayLike, values: FloatArray) -> FloatArray:
        """Interpolate values (n, ...) within the parts between which the speed jumps.

        Splines where the indenter moves; in holds, monotonic pieces, since what relaxes faster than
        the first step would make a spline swing.
        """
        asked = np.clip(np.asarray(time, dtype=float), self.time[0], self.time[-1])
        result = np.empty((*asked.shape, *values.shape[1:]))
        rate = np.diff(self.displacement) / np.diff(self.time)
        scale = np.abs(rate).max()
        jumps = np.flatnonzero(np.abs(np.diff(rate)) > 1e-6 * scale) + 1
        ends = np.concatenate([[0], jumps, [len(rate)]])
        for first, last in pairwise(ends):
            part = slice(first, last + 1)
            inside = (asked >= self.time[first]) & (asked <= self.time[last])
            spline = CubicSpline if abs(rate[first]) > 1e-6 * scale else PchipInterpolator
            result[inside] = spline(self.time[part], values[part])(asked[inside])
        return result


FORCE = "force"
type Course = tuple[FloatArray, dict[str, FloatArray]]
"""What is read along the way, and its derivatives by parameters' full names."""


def courses_of(read: ForceCurve | Path) -> dict[str, Course]:
    """Return the courses of the force and of every channel, one as the other."""
    by = read.channel_sensitivities
    others = {name: (course, dict(by.get(name, {}))) for name, course in read.channels.items()}
    return {FORCE: (read.force, dict(read.sensitivities)), **others}


def with_courses[Read: (ForceCurve, Path)](read: Read, courses: Mapping[str, Course]) -> Read:
    """Return a curve or path with these courses in place of its own."""
    others = {name: one for name, one in courses.items() if name != FORCE}
    (force, by), rates = courses[FORCE], {name: slopes for name, (_, slopes) in others.items() if slopes}
    channels = {name: course for name, (course, _) in others.items()}
    return replace(read, force=force, sensitivities=by, channels=channels, channel_sensitivities=rates)


def each_course(courses: Mapping[str, Course], made: Callable[[FloatArray], FloatArray]) -> dict[str, Course]:
    """Return courses of which, and of their derivatives, something else is made, linear in them."""
    return {name: (made(one), {p: made(slope) for p, slope in by.items()}) for name, (one, by) in courses.items()}


@dataclass(frozen=True)
class NewtonOutcome:
    """Outcome of one step: whether it converged, why it ended, and the work it took."""

    converged: bool
    reason: str
    factorisations: int
    iterations: int
    residual: float
    """Norm of the residual, N/mm in 2D, N in 3D."""


@dataclass(frozen=True)
class Step(NewtonOutcome):
    """One attempted step; one that converged was accepted."""

    displacement: float
    """Displacement at its end, mm."""
    time: float
    """Time at its end, s."""
    size: float
    """Size, mm; in a hold, s."""


@dataclass(frozen=True)
class SolveReport:
    """How far a solution came, why it stopped, and the work it took."""

    reached: float
    """Greatest displacement (mm)."""
    target: float
    """Greatest displacement asked for (mm)."""
    complete: bool
    """Whether the whole path was followed."""
    reason: str
    """Why it stopped."""
    steps: tuple[Step, ...] = ()
    seconds: float = 0.0
    unknowns: int = 0
    contact_stiffness_factor: float = 1.0
    """Factor on the contact's stiffness; below 1 where it had to be softened to go on."""
    more_points: bool = False
    """Whether more points of integration went on where the usual ones had stopped."""
    without_pressures: bool = False
    """Whether a form of displacements alone went on where that with pressures had stopped."""
    earlier_attempts: "tuple[SolveReport, ...]" = ()

    @property
    def factorisations(self) -> int:
        """Factorisations of all steps, accepted or not, and of all attempts."""
        made = sum(step.factorisations for step in self.steps)
        return made + sum(report.factorisations for report in self.earlier_attempts)

    @property
    def iterations(self) -> int:
        """Newton iterations of all steps of this attempt."""
        return sum(step.iterations for step in self.steps)

    @property
    def rejected(self) -> int:
        """Number of rejected steps."""
        return sum(not step.converged for step in self.steps)

    @property
    def compromise(self) -> str:
        """Compromises that were made to go on, in words; empty without any."""
        given_up = []
        if self.contact_stiffness_factor < 1:
            given_up.append(f"a contact {1 / self.contact_stiffness_factor:.2g} times softer")
        if self.more_points:
            given_up.append("more points of integration than elsewhere")
        if self.without_pressures:
            given_up.append("a form without pressures of its own")
        return " and ".join(given_up)

    def __str__(self) -> str:
        """Return one line for a log."""
        end = "complete" if self.complete else f"stopped: {self.reason}"
        return (
            f"{self.reached:.2f} of {self.target:.2f} mm ({end}); {len(self.steps)} steps, "
            f"{self.rejected} rejected, {self.factorisations} factorisations, {self.seconds:.1f} s"
        )
