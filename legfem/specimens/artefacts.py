r"""What specimens' recordings say of the test: ends that stick, by a video of the side; stiffness by thickness.

A model's law is found from the forces alone. Its lateral stretches then have a density,

.. math:: \log p = -\tfrac12 \left(r^T C^{-1} r + \log|2 \pi C|\right), \qquad
          C = C_i + h^2 (\lambda - 1)(\lambda - 1)^T,

with the instrument's errors (`legfem.inverse.errors`) and a share h of the strain that the model's shape and
law are off by. Where it isn't known whether ends stick, that density weighs each possibility, beside the forces'
evidence.

A constant of a material knows no thickness. Plates that don't touch all over, and a rig that yields, make thin ones
seem soft; friction that the model lacks makes them seem stiff.
"""

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import linregress, multivariate_normal, norm

from legfem.channels.kinds.lateral_stretch import LATERAL_STRETCH
from legfem.common.numbers import fit_probability
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import Values
from legfem.inverse.estimates import Estimate
from legfem.inverse.outcome import JointForward
from legfem.inverse.readings import READINGS
from legfem.specimens.comparison import SpecimenComparison
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.laws import bulk_ratio

POISSON_RATIOS = (0.2, 0.3, 0.35, 0.4, 0.43, 0.45, 0.47, 0.49, 0.4999)
"""That are tried where the stretches depart from those of the ratio that was assumed."""
_SHAPE = 0.03
"""Error of the model's lateral strain, relative: a body that isn't quite round or level, another law."""


@dataclass(frozen=True)
class LateralFit:
    """Lateral stretches beside a model that was found from the forces.

    Parameters
    ----------
    readings
        How many.
    rms
        Root mean square of measured less predicted.
    deepest
        Measured less predicted at the deepest reading of each recording, in the mean.
    error
        Standard deviation of one reading, everything counted.
    log_density
        Of the readings.
    poisson_ratio
        That meets the readings best, of `POISSON_RATIOS`, and between which it may be within two units of the density's
        logarithm; None where the fit's does, or of several tissues.
    pressed
        Whether the specimen is; else it is pulled.
    """

    readings: int
    rms: float
    deepest: float
    error: float
    log_density: float
    poisson_ratio: tuple[float, float, float] | None = None
    pressed: bool = True

    @property
    def agrees(self) -> bool:
        """Whether the deepest readings lie within two standard deviations of the model's."""
        return abs(self.deepest) <= 2 * self.error

    @property
    def text(self) -> str:
        """What is to be said of it, as a sentence."""
        more = "wider" if self.deepest > 0 else "narrower"
        known = f"each is known to {self.error:.2g}"
        if self.agrees:
            return f"Lateral stretch, {self.readings} readings: the model's within {self.rms:.2g} (rms), where {known}."
        less = (self.deepest > 0) == self.pressed
        held = "its ends hold otherwise than stated" if self.pressed else "its grips hold its sides"
        return (
            f"Lateral stretch: at the {'deepest' if self.pressed else 'farthest'} readings the specimen is {more} by "
            f"{abs(self.deepest):.2g} of its width than the model, where {known}: {held}, or it is "
            f"{'less' if less else 'more'} compressible than assumed{self._ratio_text}."
        )

    @property
    def _ratio_text(self) -> str:
        if self.poisson_ratio is None:
            return ""
        best, low, high = self.poisson_ratio
        given = "with ends as stated " if self.pressed else ""
        return f" ({given}a Poisson's ratio near {best:.3g}, of {low:.3g} to {high:.3g})"


def lateral_fit(
    comparison: SpecimenComparison, model: JointForward[SpecimenForward], values: Values
) -> LateralFit | None:
    """Return lateral stretches beside a model's; None where none were read, or the model has none.

    Parameters
    ----------
    comparison
        Of the recordings that were fitted.
    model
        Of their tests.
    values
        Of the fit.
    """
    sizes_sd = [0.0] * len(comparison.parts)
    seen = comparison.with_channels(sizes_sd, lambda one: one.sizes.kind.beside & {LATERAL_STRETCH.name})
    if not seen.every_channel:
        return None
    found = _compared(seen, model, values)
    tissues = model.models[0].tissues
    if found is None or found.agrees or len(tissues) > 1:
        return found
    name = tissues[0].name
    stiffness = values.get(f"{name}.C10", model.nominal[f"{name}.C10"])
    densities = {}
    for ratio in POISSON_RATIOS:
        other = _compared(seen, model, {**values, f"{name}.D1": 1 / (bulk_ratio(ratio) * stiffness)})
        if other is not None:
            densities[ratio] = other.log_density
    best = max(densities, key=lambda ratio: densities[ratio])
    likely = [ratio for ratio, density in densities.items() if density > densities[best] - 2.0]
    return replace(found, poisson_ratio=(best, min(likely), max(likely)))


def _compared(seen: SpecimenComparison, model: JointForward[SpecimenForward], values: Values) -> LateralFit | None:
    outcome = model.solve(values, ())
    if not seen.told_by(outcome):
        return None
    beside, first = [part for part in seen.parts if part.channels], len(seen.forces)
    predicted = seen.predict(outcome, np.array([number.null for number in READINGS.values()])).values[first:]
    left, strain = seen.measured[first:] - predicted, _SHAPE * (predicted - LATERAL_STRETCH.at_rest)
    ends = np.cumsum([len(one.values) for one in beside])[:-1]
    of_shape = block_diag(*(np.outer(own, own) for own in np.split(strain, ends)))
    errors = seen.beside_errors - block_diag(*(one.errors[1] for one in beside)) + of_shape
    pairs = zip(seen.every_channel, np.split(left, ends), strict=True)
    farthest = float(np.mean([own[np.argmax(one.displacement)] for one, own in pairs]))
    density = float(multivariate_normal(cov=errors).logpdf(left))
    sizes = beside[0].recording.sizes
    rms, error = (float(np.sqrt(np.mean(squares))) for squares in (left**2, np.diag(errors)))
    return LateralFit(len(left), rms, farthest, error, density, pressed=sizes.kind.presses(sizes.body))


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
    comparison: SpecimenComparison, force: FloatArray, stiffness: Mapping[str, float]
) -> SizeDependence | None:
    """Return how a test's specimens' stiffness goes with their thickness, by what each asks for if all are alike.

    Parameters
    ----------
    comparison
        Of the fitted recordings.
    force : (n,) array
        That the law predicts for them, N.
    stiffness
        Factors by specimen with which it was fitted.
    """
    scales = comparison.scales(force)
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
