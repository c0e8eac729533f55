r"""What a specimen's side says of its test: ends that stick, by a video of it; how much of the travel reaches its face.

A model's law is found from the forces alone. Its lateral stretches then have a density,

.. math:: \log p = -\tfrac12 \left(r^T C^{-1} r + \log|2 \pi C|\right), \qquad
          C = C_i + h^2 (\lambda - 1)(\lambda - 1)^T,

with the instrument's errors (`legfem.inverse.errors`) and a share h of the strain that the model's shape and
law are off by. Where it isn't known whether ends stick, that density weighs each possibility, beside the forces'
evidence.

Strains of the face don't depend on how stiff the specimen is. Beside a model's, those along are :math:`s` times as
large, those across :math:`s q` times: :math:`s` is the share of the travel that reaches the specimen, and :math:`q` is
one where ends and compressibility are as assumed. Both are those of generalised least squares with the errors of the
channel, whose gain is shared.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import multivariate_normal

from legfem.channels.kinds.face_strain import ACROSS, ALONG, FACE_STRAIN
from legfem.channels.kinds.lateral_stretch import LATERAL_STRETCH
from legfem.common.units import FloatArray
from legfem.experiments.bodies import HomogeneousBody
from legfem.inverse.catalogue import Values
from legfem.inverse.channel_readings import StationChannel
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
    sizes_sd = [0.0] * len(comparison.tests)
    seen = comparison.with_channels(sizes_sd, lambda one: one.sizes.kind.beside & {LATERAL_STRETCH.name})
    if not seen.beside:
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
    predicted = seen.predict(outcome, np.array([number.null for number in READINGS.values()])).values
    every, strain = seen.measured - predicted, _SHAPE * (predicted - LATERAL_STRETCH.at_rest)
    of_shape = np.outer(strain, strain) * (seen.part_of[:, None] == seen.part_of)
    here = np.ix_(~seen.is_force, ~seen.is_force)
    left, errors = every[~seen.is_force], (seen.instrument_errors + of_shape)[here]
    farthest = float(np.mean([every[span][np.argmax(one.displacement)] for _, one, span in seen.beside]))
    density = float(multivariate_normal(cov=errors).logpdf(left))
    sizes = seen.recordings[seen.beside[0][0]].sizes
    rms, error = (float(np.sqrt(np.mean(squares))) for squares in (left**2, np.diag(errors)))
    return LateralFit(len(left), rms, farthest, error, density, pressed=sizes.kind.presses(sizes.body))


_MOST_RATIO = 0.5
_DEEPEST = 0.95
"""Share of the deepest reading's depth beyond which readings count as deepest."""


@dataclass(frozen=True)
class FaceFit:
    """Strains of the face beside a model's; a pair is a value and its standard deviation.

    Parameters
    ----------
    readings
        How many.
    along
        Share of the travel that reaches the specimen.
    across
        Strain across beside that along, over the model's.
    log_density
        Of the readings.
    pressed
        Whether the specimen is; else it is pulled.
    profile
        Heights over half the specimen's, strains across there at the deepest readings, and the model's; (3, h).
    poisson_ratio
        That goes with the strain across; None where ends or shape have a part in it.
    """

    readings: int
    along: tuple[float, float]
    across: tuple[float, float]
    log_density: float
    pressed: bool
    profile: FloatArray
    poisson_ratio: float | None = None

    @property
    def text(self) -> str:
        """What is to be said of it, as sentences."""
        (along, along_sd), (across, across_sd) = self.along, self.across
        found = (
            f"Face, {self.readings} strains: along the load {along:.2f} ± {along_sd:.2f} of what the travel says, and "
            f"across {across:.2f} ± {across_sd:.2f} of what the model has beside that"
        )
        causes = []
        if abs(along - 1) > 2 * along_sd:
            size = "the size along the load is misstated"
            lost = f"the {'plates move' if self.pressed else 'grips slip'} or the rig yields, or {size}"
            causes.append(f"{lost if along < 1 else size}; with that strain C10 would be {1 / along:.2f} times as high")
        if abs(across - 1) > 2 * across_sd:
            held = "its ends hold otherwise than stated"
            if not self.pressed:
                held = "it is not alike in all directions across" if across > 1 else "its grips hold its sides"
            ratio = "" if self.poisson_ratio is None else f" (a Poisson's ratio near {self.poisson_ratio:.2g})"
            causes.append(f"{held}, or it is {'less' if across > 1 else 'more'} compressible than assumed{ratio}")
        return f"{': '.join([found, '; and '.join(causes)]) if causes else found}."


def face_fit(comparison: SpecimenComparison, predicted: FloatArray) -> FaceFit | None:
    """Return how the face is strained beside predicted readings (n,); None where it wasn't seen."""
    here = comparison.channels.get(FACE_STRAIN.name)
    if here is None:
        return None
    readings = [one for _, one, _ in comparison.beside if one.name == FACE_STRAIN.name]
    ways = np.concatenate([one.place[:, 1] for one in readings])
    seen, model, errors = comparison.measured[here], predicted[here], comparison.beside_errors[np.ix_(here, here)]
    density = float(multivariate_normal(cov=errors).logpdf(seen - model))
    design = np.column_stack([model * (ways == way) for way in (ALONG, ACROSS)])
    weighed = design / np.concatenate([one.white_variance + one.accuracy.slow**2 for one in readings])[:, None]
    shares = np.linalg.solve(weighed.T @ design, weighed.T)
    (along, across), covariance = shares @ seen, shares @ errors @ shares.T
    of_ratio = np.array([-across / along, 1.0]) / along
    sizes = comparison.recordings[comparison.part_of[here[0]]].sizes
    logs = [np.log1p(share * model[ways == way].mean()) for share, way in ((across, ACROSS), (along, ALONG))]
    alike = isinstance(sizes.body, HomogeneousBody) and -logs[0] / logs[1] < _MOST_RATIO
    return FaceFit(
        len(seen),
        (float(along), float(np.sqrt(covariance[0, 0]))),
        (float(across / along), float(np.sqrt(of_ratio @ covariance @ of_ratio))),
        density,
        sizes.kind.presses(sizes.body),
        _profile(readings, seen, model),
        float(-logs[0] / logs[1]) if alike else None,
    )


def _profile(readings: Sequence[StationChannel], seen: FloatArray, model: FloatArray) -> FloatArray:
    """Return heights, and the mean over recordings of strains across at the deepest readings there, (3, h)."""
    height, way = np.concatenate([one.place for one in readings]).T
    depth = np.concatenate([one.displacement for one in readings])
    ends = np.concatenate([np.full(len(one.values), one.displacement.max()) for one in readings])
    deepest = (way == ACROSS) & (depth > _DEEPEST * ends)
    heights, number, count = np.unique(height[deepest], return_inverse=True, return_counts=True)
    return np.array([heights, *(np.bincount(number, one[deepest]) / count for one in (seen, model))])
