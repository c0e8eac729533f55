"""Specimens of one material whose stiffness goes with their thickness: a finding about the test, not the material.

A constant of a material knows no thickness. Plates that don't touch all over, and a rig that yields, make thin ones
seem soft; friction that the model lacks makes them seem stiff.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import linregress, norm

from legfem.common.units import FloatArray
from legfem.inverse.estimates import Estimate
from legfem.specimens.comparison import SpecimenComparison
from legfem.specimens.sizes import bare, kind_in

_RARE = 0.01
"""Chance of so strong a dependence among specimens that differ for other reasons."""
_LEAST = 3
"""Specimens of which a trend is told from how they differ; of two how pieces usually differ has to serve."""
_APART = 0.05
"""Of the logarithm of the stiffness of pieces of one material, where nothing else shows it: an assumption."""
_SPREAD = 1.2
"""Of the sizes, greatest over least, that shows one."""


@dataclass(frozen=True)
class SizeDependence:
    """How stiffness goes with a size of the specimens along the load."""

    power: float
    """Of the size that stiffness is in proportion to."""
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
        why = f"specimens need other constants by their thickness; of a typical one, {found.why}"
        return replace(found, ci95=(self.least * low, self.most * high), identifiability="not identifiable", why=why)

    @property
    def text(self) -> str:
        """The finding as sentences."""
        ratio = (self.greatest / self.smallest) ** self.power
        more = "stiffer" if ratio > 1 else "softer"
        causes = (
            "plates that don't touch all over, or a rig that yields"
            if ratio > 1
            else "friction at the faces that the model lacks, or a size that is wrong"
        )
        return (
            f"The constant depends on the thickness: specimens of {self.greatest:.3g} mm are "
            f"{max(ratio, 1 / ratio):.2f} times {more} than those of {self.smallest:.3g} mm (power {self.power:.2g} ± "
            f"{self.power_sd:.2g} of the thickness, p = {self.p_value:.2g}). One material has one constant, so that "
            f"the test differs with thickness (or the pieces are not of one material): {causes}. Press a rigid block "
            "to see what the rig yields, and grease or glue the faces."
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
        return float(found.slope), float(found.stderr), float(found.pvalue)
    far = size[1] - size[0]
    slope, sd = float((stiffness[1] - stiffness[0]) / far), float(np.sqrt(2) * _APART / abs(far))
    return slope, sd, float(2 * norm.sf(abs(slope) / sd))


def goes_with_thickness(
    comparison: SpecimenComparison, force: FloatArray, stiffness: Mapping[str, float]
) -> SizeDependence | None:
    """Return how the specimens' stiffness goes with their thickness, by what each asks for where all count as alike.

    Parameters
    ----------
    comparison
        Of the fitted recordings.
    force : (n,) array
        That the law predicts for them, N.
    stiffness
        Factors by specimen with which it was fitted.
    """
    recordings, own = comparison.recordings, defaultdict[str, list[float]](list)
    for one, scale in zip(recordings, comparison.scales(force), strict=True):
        own[one.specimen].append(scale * stiffness.get(one.specimen, 1.0))
    sizes = {one.specimen: kind_in(one.sizes).extent(bare(one.sizes)) for one in recordings}
    extent = {name: size for name, size in sizes.items() if size is not None}
    if len(extent) < len(own):
        return None
    return size_dependence({name: float(np.mean(scales)) for name, scales in own.items()}, extent)
