r"""What stiffness by thickness says of the test, and a rig that yields, which would bring specimens to one constant.

A constant of a material knows no thickness. Plates that don't touch all over, and a rig that yields, make thin ones
seem soft; friction that the model lacks makes them seem stiff.

A rig that yields by c mm/N, or plates that touch all over only as they are pressed, take a way :math:`c F` of the
displacement that was read: what is left is the specimen's. With the forces f of a law, each recording asks for the
factor

.. math:: s(c) = \frac{\sum F f(d - c F)}{\sum f(d - c F)^2}

on its constants. Pieces of one material have one, within a few per cent: that c is found at which the factors differ
least. Of one thickness nothing tells c, and a piece may be stiffer than it seems, a thin, wide one by much. Nor does
anything tell of a way p by which it was strained before the start, with the load cell tared there: with the
relaxation of the law the readings are those of :math:`f(d + p) - f(p)`.
"""

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import linregress, norm

from legfem.common.numbers import fit_probability
from legfem.common.units import FloatArray
from legfem.inverse.estimates import Estimate
from legfem.inverse.intervals import with_further
from legfem.specimens.comparison import SpecimenComparison
from legfem.specimens.course import Course
from legfem.specimens.folder import SpecimenFolder
from legfem.specimens.sizes import SpecimenRecording

_RARE = 0.01
"""Chance of so strong a dependence among specimens that differ for other reasons."""
_LEAST = 3
"""Specimens of which a trend is told from how they differ; of two how pieces usually differ has to serve."""
APART = 0.05
"""Assumed standard deviation of the logarithm of the stiffness of pieces of one material."""
_SPREAD = 1.2
"""Least ratio of the greatest size to the smallest that shows a dependence."""


KNOW_THE_RIG = "Press a rigid block to see what the rig yields, and grease or glue the faces."
"""What to do about it."""


@dataclass(frozen=True)
class SizeDependence:
    """How stiffness goes with a size of the specimens along the load."""

    power: float
    """Power of the size that stiffness is in proportion to."""
    power_sd: float
    p_value: float
    smallest: float
    """mm."""
    greatest: float
    """mm."""
    least: float
    """Stiffness of the softest of them, over that of a typical specimen, ..."""
    most: float
    """... and of the stiffest."""

    def over(self, found: Estimate) -> Estimate:
        """Return a stiffness' estimate over specimens of all thicknesses: none is the material's."""
        low, high = found.ci95
        least, most = found.parameter.bounds
        ends = max(self.least * low, least), min(self.most * high, most)
        return replace(found, ci95=ends, identifiability="not identifiable")

    @property
    def text(self) -> str:
        """The finding as sentences."""
        ratio = (self.greatest / self.smallest) ** self.power
        more, causes = "softer", "friction at the faces that the model lacks, or a size that is wrong"
        if ratio > 1:
            more, causes = "stiffer", "plates that don't touch all over, or a rig that yields"
        return (
            f"The constant depends on the thickness: specimens of {self.greatest:.3g} mm are "
            f"{max(ratio, 1 / ratio):.2f} times {more} than those of {self.smallest:.3g} mm (power {self.power:.2g} ± "
            f"{self.power_sd:.2g} of the thickness, {fit_probability(self.p_value)}). One material has one constant: "
            f"so the test differs with thickness (or the pieces are not of one material): {causes}. {KNOW_THE_RIG}"
        )


def size_dependence(stiffness: Mapping[str, float], extent: Mapping[str, float]) -> SizeDependence | None:
    """Return how specimens' stiffness goes with their size along the load; None where it doesn't.

    Parameters
    ----------
    stiffness
        Of every specimen, relative to any.
    extent
        Size along the load (mm), by the same names.
    """
    names = [name for name in stiffness if stiffness[name] > 0]
    sizes = np.array([extent[name] for name in names])
    if len(names) < 2 or sizes.max() < _SPREAD * sizes.min():
        return None
    factors = np.array([stiffness[name] for name in names])
    factors = factors / np.exp(np.mean(np.log(factors)))
    slope, sd, p_value = _trend(np.log(sizes), np.log(factors))
    if not p_value < _RARE:
        return None
    return SizeDependence(
        slope, sd, p_value, float(sizes.min()), float(sizes.max()), float(factors.min()), float(factors.max())
    )


def _trend(size: FloatArray, stiffness: FloatArray) -> tuple[float, float, float]:
    """Return slope, its standard deviation and its p-value, of logarithms."""
    if len(size) >= _LEAST:
        found = linregress(size, stiffness)
        # What takes its own part of the travel, as a rig that yields, goes with one over the size: few show no power.
        p_value = 2 * min(float(found.pvalue), float(linregress(np.exp(-size), stiffness).pvalue))
        return float(found.slope), float(found.stderr), min(p_value, 1.0)
    far = size[1] - size[0]
    slope, sd = float((stiffness[1] - stiffness[0]) / far), float(np.sqrt(2) * APART / abs(far))
    return slope, sd, float(2 * norm.sf(abs(slope) / sd))


def goes_with_thickness(
    comparison: SpecimenComparison, predicted: FloatArray, stiffness: Mapping[str, float]
) -> SizeDependence | None:
    """Return how a test's specimens' stiffness goes with their thickness, by what each asks for if all are alike.

    Parameters
    ----------
    comparison
        Of the fitted recordings.
    predicted : (n,) array
        Their readings by the law.
    stiffness
        Factors by specimen with which it was fitted.
    """
    scales = comparison.scales(predicted)
    for places in comparison.recordings_of.values():
        own, extent = defaultdict[str, list[float]](list), dict[str, float]()
        for one, scale in ((comparison.recordings[k], scales[k]) for k in places):
            own[one.specimen].append(scale * stiffness.get(one.specimen, 1.0))
            size = one.sizes.kind.extent(one.sizes.body)
            if size is not None:
                extent[one.specimen] = size
        if len(extent) == len(own):
            found = size_dependence({name: float(np.mean(each)) for name, each in own.items()}, extent)
            if found is not None:
                return found
    return None


_MOST_TAKEN = 0.9
"""Share of the displacement that a rig takes at most."""
_USUAL, _USUAL_WAY = 0.09, 0.25
"""mm/N and mm up to which 19 of 20 rigs yield: judgements, of load cells of bench tests."""
_BEFORE = 0.04
"""Way by which specimens are strained before a start that says nothing of it, over the travel, one standard deviation:
a judgement, of preloads that are tared."""
_STEP = 0.01
"""Share of the travel by which differences are taken."""


@dataclass(frozen=True)
class YieldingRig:
    """What a rig yields."""

    compliance: float
    """mm/N."""
    sd: float
    moves: float
    """Relative change of the constants by one standard deviation of it."""
    without: SizeDependence
    """How the specimens' constants go with their thickness where the rig counts as rigid."""

    @property
    def text(self) -> str:
        """The finding as sentences."""
        times = self.without.most / self.without.least
        return (
            f"One rig that yields by {self.compliance:.2g} ± {self.sd:.1g} mm/N (or plates that do not touch all over) "
            "brings specimens of all thicknesses to one constant, and the values given are with it. Were it rigid, "
            f"their constants would be {times:.2f} times apart. {KNOW_THE_RIG}"
        )


@dataclass(frozen=True, eq=False)
class OnARig:
    """A law's forces beside recordings as a rig yields: those on the tests' grids, N, and what they are read with."""

    comparison: SpecimenComparison
    model: FloatArray
    readings: FloatArray

    def factors(self, compliance: float) -> FloatArray:
        """Return logarithms of the recordings' factors (r,) on the law's forces where a rig yields (mm/N)."""
        alike, values = self._where(lambda one: one.displacement - compliance * one.force)
        return np.log(np.maximum(alike.scales(values), 1e-6))

    def _where(self, way: Callable[[Course], FloatArray]) -> tuple[SpecimenComparison, FloatArray]:
        """Return typical specimens with another way (mm) of their recordings, and readings (n,) by the law there."""
        parts = []
        for part in self.comparison.tests:
            course = part.course
            there = replace(course, displacement=np.maximum(way(course), 1e-6 * course.depth))
            parts.append(replace(part, recording=replace(part.recording, course=there)))
        alike = replace(self.comparison, tests=tuple(parts), own=None)
        return alike, alike.read(self.model, self.readings)

    def yielding(self, without: SizeDependence) -> YieldingRig | None:
        """Return the rig on which specimens that differ by their thickness are alike; None where none is."""
        most = _MOST_TAKEN * min(part.course.depth / part.course.peak for part in self.comparison.tests)
        found = minimize_scalar(lambda c: float(np.std(self.factors(c))), bounds=(0.0, most), method="bounded")
        slopes = (self.factors(found.x + 0.01 * most) - self.factors(found.x)) / (0.01 * most)
        sd = APART / float(np.std(slopes) * np.sqrt(len(slopes)))
        if found.fun > 2 * APART or found.x < 2 * sd:
            return None
        return YieldingRig(float(found.x), sd, float(slopes.mean()) * sd, without)

    def softened(self, folder: SpecimenFolder) -> float:
        """Return by what factor specimens may seem softer in all tests than they are, as far as 19 of 20 rigs yield."""
        usual = min(_usual_rig(folder.test_of(one), one) for one in self.comparison.recordings)
        logs = self.factors(usual) - self.factors(0.0)
        return float(np.exp(min(logs[places].mean() for places in self.comparison.recordings_of.values())))

    def begun_strained(self, folder: SpecimenFolder) -> FloatArray:
        """Return the covariance (n, n) of the readings by how far specimens were strained before the start."""
        here = self._where(lambda one: one.displacement)[1]
        farther = self._where(lambda one: one.displacement + _STEP * one.depth)[1]
        begun = self._where(lambda one: np.full_like(one.displacement, _STEP * one.depth))[1]
        shares = np.array([begun_share(folder.test_of(one), one) for one in self.comparison.recordings])
        part_of, names = self.comparison.part_of, np.array([one.test for one in self.comparison.recordings])
        mode = np.where(self.comparison.is_force, shares[part_of] / _STEP * (farther - begun - here), 0.0)
        return np.asarray(np.outer(mode, mode) * (names[part_of][:, None] == names[part_of]))


def _assumed(folder: SpecimenFolder, one: SpecimenRecording) -> bool:
    """Return whether a test's setup is one as labs have it, for all that is stated."""
    return folder.origin == "measured" and one.sizes.kind.load_field == "force_N" and one.recording.timed


def _usual_rig(folder: SpecimenFolder, one: SpecimenRecording) -> float:
    usual = min(_USUAL, min(_USUAL_WAY, 0.5 * one.course.depth) / one.course.peak) * _assumed(folder, one)
    return usual if folder.rig_sd is None else 2 * folder.rig_sd


def begun_share(folder: SpecimenFolder, one: SpecimenRecording) -> float:
    """Return which share of the travel may have been made before the start, one standard deviation."""
    unseen = one.detected.known and not one.course.standing and _assumed(folder, one)
    return _BEFORE * unseen if folder.contact_sd is None else folder.contact_sd / one.course.depth


def widened(found: Estimate, above: float, below: float, fits: bool) -> Estimate:
    """Return an estimate with more errors in its 95 % interval, to either side, relative."""
    more = below * found.value, above * found.value
    wide = replace(found, ci95=with_further(found.value, found.ci95, more, found.parameter.bounds))
    return replace(wide, identifiability=wide.verdict(fits))
