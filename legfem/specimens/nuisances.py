r"""Nuisance parameters of specimens, found with the law: first contact of every recording, and factors of stiffness.

A recording's own onset is blurred by noise and by the shape that detection takes tissue to have.
Where contact was looked for, its place is one more unknown of the fit, with what detection says as
its prior. With :math:`F'` the slope of the force, :math:`a` how far contact was moved already, and
:math:`\sigma` detection's error,

.. math:: m = F(d) + F' (a - \eta) + z + e, \qquad \eta \sim N(0, \sigma^2)

with a zero z of its own; a force that stands before anything is pressed may be all of it one, or the specimen was
pressed by some way before. All are marginalised in the weights: they have those of the covariance
:math:`s^2 I + \sigma^2 F' F'^T + \sigma_z^2 1 1^T`, with s what stations count as erring by. What the fit then says of
:math:`\eta` moves the contact, and all is linearised again about it.

Pieces of one tissue differ in stiffness far more than in how they stiffen and relax. The force is
in proportion to the stiffness, so that each specimen's factor needs no search: with the weights W
of its stations,

.. math:: s_g = \frac{\sum (W m) (W f)}{\sum (W f)^2}

is the least squares' for its recordings m and the model's forces f. Factors count relative to their
geometric mean, which the law's own stiffness carries: that of a typical specimen; where specimens
are cut along fibres and across, to that of each kind, which the fibres' ratio carries (variable
projection: G. H. Golub, V. Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data.contact import Contact
from legfem.specimens.course import SLOW_SHARE, Course
from legfem.specimens.folder import FILE, SpecimenFolder
from legfem.specimens.kind import WORDS
from legfem.specimens.sizes import SpecimenRecording

SETTLED = 0.05
"""Shortest move of contact that counts, over detection's error."""
FARTHEST = 3.0
"""Errors of detection that contact is moved by at most."""
_EARLIER = 0.2
"""Farthest that contact may be before where it was detected, over the depth."""


def deepest_of(course: Course) -> float:
    """Return the displacement (mm) that a course goes to, wherever its contact is."""
    return course.depth + min(FARTHEST * course.contact.displacement_error, _EARLIER * course.depth)


def power_of(course: Course) -> float:
    """Return the power of the displacement that the loading's force is nearest to."""
    rising = (course.time <= course.arrival) & (course.displacement > 0) & (course.force > 0)
    d, force = course.displacement[rising], course.force[rising]
    if len(d) < 3 or np.ptp(d) == 0:
        return 1.0
    return float(np.polyfit(np.log(d), np.log(force), 1, w=force)[0])


@dataclass(frozen=True, eq=False)
class OnsetEffect:
    """What a recording's force owes to where its contact is.

    Parameters
    ----------
    slope : (n,) array
        What stations lose (N) for every mm that contact is later.
    sd : float
        Of where contact is expected, mm.
    zero_sd : float
        Of what the load cell reads without load, N.
    ahead : float
        How far (mm) contact is taken to be later than expected.
    pressed : float
        mm that the specimen may have been pressed by already, where a force stands before anything is pressed; one
        standard deviation.
    """

    slope: FloatArray
    sd: float
    zero_sd: float
    ahead: float = 0.0
    pressed: float = 0.0
    factor: FloatArray | None = None
    """Change (n,), N, by one standard deviation of a factor on the force, where tests of other specimens count too."""

    @classmethod
    def of(
        cls, course: Course, detected: Contact, slope: FloatArray | None = None, factor_sd: float = 0.0
    ) -> "OnsetEffect":
        """Return that of a course, by its own force where the slope isn't given."""
        expected, sd = detected.expected
        # A tared cell is known as well as one that was read in air.
        tared = detected.in_air or detected.known
        zero = float(np.sqrt(SLOW_SHARE if tared else 1.0)) * course.instrument.force_sd
        zero = float(np.hypot(zero, course.standing))
        ahead = course.contact.displacement - expected
        if slope is None:
            risen = replace(course, force=course.force - course.standing) if course.standing else course
            slope = np.asarray(power_of(risen) * risen.force / risen.displacement)
        first = slope[course.displacement < course.depth / 3]
        pressed = 0.0
        if course.standing and len(first):
            pressed = min(abs(course.standing) / max(float(np.median(first)), 1e-12), course.depth)
        return cls(slope, sd, zero, ahead, pressed, factor_sd * course.force if factor_sd else None)

    @cached_property
    def modes(self) -> FloatArray:
        """Changes by one standard deviation (n, 2 or 3), N, of contact, zero, and the factor if there is one."""
        beside = () if self.factor is None else (self.factor,)
        return np.column_stack([self.way * self.slope, np.full_like(self.slope, self.zero_sd), *beside])

    @property
    def way(self) -> float:
        """By how much (mm) contact may have begun earlier, one standard deviation."""
        return float(np.hypot(self.sd, self.pressed))

    def weighing(self, sd: float) -> FloatArray:
        """Return the covariance (n, n), N2, that stations are weighed by, their own errors being ``sd`` (N)."""
        own = sd**2 * np.eye(len(self.slope))
        if not self.sd and not self.pressed and self.factor is None:
            return own
        return np.asarray(own + self.modes @ self.modes.T)

    def moved(self, left: FloatArray, covariance: FloatArray) -> float:
        """Return how far (mm) contact is ahead of what is expected.

        Parameters
        ----------
        left
            (n,), N: what is measured above the model.
        covariance
            See `weighing`.
        """
        if not self.sd:
            return 0.0
        departure = self.modes[:, 0] @ np.linalg.solve(covariance, left - self.ahead * self.slope)
        return float(-self.sd * np.clip(departure, -FARTHEST, FARTHEST))


_LEAST = 1e-6


@dataclass(frozen=True, eq=False)
class OwnStiffness:
    """The specimens' factors on a model's forces.

    Parameters
    ----------
    names : tuple of str
        Of g specimens.
    specimen : ndarray
        (n,): number of every station's.
    measured : ndarray
        (n,), N.
    weighted : callable
        Weights values (n, ...), each recording's for itself.
    known : Mapping[str, float], optional
        Factors found elsewhere, by name; a specimen that isn't among them is typical. Without them
        factors are those that fit.
    kinds : tuple of str, optional
        Of specimens (g), each with a typical one of its own; all are of one kind without them.
    """

    names: tuple[str, ...]
    specimen: NDArray[np.intp]
    measured: FloatArray
    weighted: Callable[[FloatArray], FloatArray]
    known: Mapping[str, float] | None = None
    kinds: tuple[str, ...] = ()

    @property
    def degrees(self) -> int:
        """By how many numbers the specimens' factors differ."""
        return len(self.names) - len(set(self.kinds or ("",)))

    @cached_property
    def _of_a_kind(self) -> FloatArray:
        """What takes the mean over specimens of a kind, (g, g)."""
        kinds = np.array(self.kinds or ("",) * len(self.names))
        same = np.asarray(kinds[:, None] == kinds, float)
        return np.asarray(same / same.sum(axis=1))

    @cached_property
    def _members(self) -> FloatArray:
        """Which stations are of which specimen, (g, n)."""
        return np.asarray(self.specimen == np.arange(len(self.names))[:, None], float)

    @cached_property
    def _seen(self) -> FloatArray:
        return self._weighed(self.measured)

    def _weighed(self, values: FloatArray) -> FloatArray:
        return self.weighted(values.reshape(-1, values.shape[-1]).T).T.reshape(values.shape)

    def _relative(self, felt: FloatArray) -> FloatArray:
        """Return the factors (..., g) at forces (..., n) of typical specimens."""
        if self.known is not None:
            return np.array([self.known.get(name, 1.0) for name in self.names])
        seen = self._weighed(felt)
        best = (self._seen * seen) @ self._members.T
        best = best / np.maximum(seen**2 @ self._members.T, 1e-300)
        logs = np.log(np.maximum(best, _LEAST))
        return np.asarray(np.exp(logs - logs @ self._of_a_kind))

    def __call__(self, felt: FloatArray) -> FloatArray:
        """Return the factors (..., n) on forces (..., n) of typical specimens."""
        return np.asarray(self._relative(felt)[..., self.specimen])

    def named(self, felt: FloatArray) -> dict[str, float]:
        """Return the factors by name, at forces (n,)."""
        return dict(zip(self.names, map(float, self._relative(felt)), strict=True))

    def slope(self, felt: FloatArray, by: FloatArray) -> FloatArray:
        """Return the derivative (n,) of the factors times forces (n,) whose own is ``by`` (n,)."""
        factor = self(felt)
        if self.known is not None:
            return factor * by
        seen, change = self._weighed(felt), self._weighed(by)
        logs = ((self._seen * change) @ self._members.T) / ((self._seen * seen) @ self._members.T)
        logs = logs - 2 * ((seen * change) @ self._members.T) / (seen**2 @ self._members.T)
        return np.asarray(factor * (by + felt * (logs - logs @ self._of_a_kind)[self.specimen]))


def kinds_of(recordings: Sequence[SpecimenRecording]) -> dict[str, tuple[str, ...]]:
    """Return how the fibres of each specimen lay in its tests, by its name; "" without fibres."""
    names = dict.fromkeys(one.specimen for one in recordings)
    return {name: tuple(sorted({one.sizes.level for one in recordings if one.specimen == name})) for name in names}


def _directions(recordings: Sequence[SpecimenRecording]) -> list[str]:
    return sorted({one.sizes.level for one in recordings})


def were_turned(recordings: Sequence[SpecimenRecording]) -> bool:
    """Return whether one specimen was tested in several directions."""
    return any(len(kinds) > 1 for kinds in kinds_of(recordings).values())


def tells_ratio(folder: SpecimenFolder, recordings: Sequence[SpecimenRecording]) -> bool:
    """Return whether forces along the fibres and across tell their ratio.

    Specimens that have a stiffness of their own do so if one was tested in several directions, or
    if one direction has several: their spread then is that by which typical ones of the directions
    may differ by chance.
    """
    directions = len(_directions(recordings))
    several = len(kinds_of(recordings)) > directions
    return directions > 1 and (folder.equally_stiff or were_turned(recordings) or several)


def check_strained(folder: SpecimenFolder, recordings: Sequence[SpecimenRecording]) -> None:
    """Check that fibres whose ratio is looked for are stretched or sheared by a test.

    Raises
    ------
    InputError
        If none is.
    """
    if _directions(recordings) == [WORDS["cylinder"]]:
        problem = f"no fitted test strains fibres {WORDS['cylinder']}"
        remedy = "state it (it changes nothing here), or test another direction too"
        raise InputError(folder.directory / FILE, "fibres.ratio", problem, remedy)


def why_ratio_undetermined(folder: SpecimenFolder, recordings: Sequence[SpecimenRecording]) -> str:
    """Return why the ratio of the fibres' stiffness can't be told, as a sentence; "" if it can."""
    if tells_ratio(folder, recordings):
        return ""
    directions = _directions(recordings)
    if len(directions) == 1:
        return (
            f"The fibres' ratio cannot be distinguished from C10: all fitted tests have fibres "
            f"{directions[0]}, where more of one looks like more of the other. Test another "
            "direction too, or state [fibres] ratio."
        )
    return (
        "The fibres' ratio cannot be determined from how specimens differ: each direction has one "
        "specimen of a stiffness of its own. Give them one name if they are one piece, turned; say "
        "[tissue] one_stiffness = true if they are equally stiff; test several in a direction; or "
        "state [fibres] ratio."
    )
