r"""What one rig yields under all of a folder's specimens, by what brings their constants together.

A rig that yields by c mm/N, or plates that touch all over only as they are pressed, take a way :math:`c F` of the
displacement that was read: what is left is the specimen's. With the forces f of a law, each recording asks for the
factor

.. math:: s(c) = \frac{\sum F f(d - c F)}{\sum f(d - c F)^2}

on its constants. Pieces of one material have one, within a few per cent: that c is found at which the factors differ
least. Of one thickness nothing tells c, and a thin, wide piece may be stiffer than it seems.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from legfem.common.units import FloatArray
from legfem.inverse.estimates import Estimate
from legfem.specimens.artefacts import APART, KNOW_THE_RIG, SizeDependence
from legfem.specimens.comparison import SpecimenComparison

_MOST_TAKEN = 0.9
"""Share of the displacement that a rig takes at most."""
_USUAL, _USUAL_WAY = 0.09, 0.25
"""mm/N and mm up to which 19 of 20 rigs yield: judgements, of load cells of bench tests."""
_THIN = 0.25
"""Height over width below which what a rig takes is no small share of a usual press."""


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
        parts = []
        for part in self.comparison.parts:
            course = part.course
            left = np.maximum(course.displacement - compliance * course.force, 1e-6 * course.depth)
            parts.append(replace(part, recording=replace(part.recording, course=replace(course, displacement=left))))
        force = np.concatenate([part.felt(self.model, self.readings) for part in parts])
        return np.log(np.maximum(replace(self.comparison, parts=tuple(parts)).scales(force), 1e-6))

    def yielding(self, without: SizeDependence) -> YieldingRig | None:
        """Return the rig on which specimens that differ by their thickness are alike; None where none is."""
        most = _MOST_TAKEN * min(part.course.depth / part.course.peak for part in self.comparison.parts)
        found = minimize_scalar(lambda c: float(np.std(self.factors(c))), bounds=(0.0, most), method="bounded")
        slopes = (self.factors(found.x + 0.01 * most) - self.factors(found.x)) / (0.01 * most)
        sd = APART / float(np.std(slopes) * np.sqrt(len(slopes)))
        if found.fun > 2 * APART or found.x < 2 * sd:
            return None
        return YieldingRig(float(found.x), sd, float(slopes.mean()) * sd, without)

    @property
    def softened(self) -> float:
        """By what factor thin specimens may seem softer than they are, as far as 19 of 20 rigs yield; else one."""
        courses = [part.course for part in self.comparison.parts]
        every = [one.sizes for one in self.comparison.recordings]
        shapes = [one.kind.slenderness(one.body) if one.kind.presses(one.body) else None for one in every]
        if not all(shape and shape[0] < _THIN for shape in shapes):
            return 1.0
        peak, depth = max(one.peak for one in courses), min(one.depth for one in courses)
        usual = min(_USUAL, min(_USUAL_WAY, 0.5 * depth) / peak)
        return float(np.exp(np.mean(self.factors(usual) - self.factors(0.0))))


def widened(found: Estimate, above: float, below: float, fits: bool) -> Estimate:
    """Return an estimate with more errors in its 95 % interval, to either side, relative."""
    low, high = (
        float(np.hypot(end - found.value, more * found.value))
        for end, more in zip(found.ci95, (below, above), strict=True)
    )
    wide = replace(found, ci95=(max(found.value - low, found.parameter.bounds[0]), found.value + high))
    return replace(wide, identifiability=wide.verdict(fits))
