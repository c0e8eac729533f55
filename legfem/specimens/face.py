r"""What the strains of a specimen's face say of its test: how much of the travel reaches it, and its compressibility.

Strains don't depend on how stiff the specimen is. Beside a model's, those along are :math:`s` times as large, those
across :math:`s q` times: :math:`s` is the share of the travel that reaches the specimen, and :math:`q` is one where
ends and compressibility are as assumed. Both are those of generalised least squares with the errors of the channel,
whose gain is shared.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import multivariate_normal

from legfem.channels.kinds.face_strain import ACROSS, ALONG, FACE_STRAIN
from legfem.common.units import FloatArray
from legfem.experiments.bodies import HomogeneousBody
from legfem.inverse.channel_readings import StationChannel
from legfem.specimens.comparison import SpecimenComparison
from legfem.specimens.kinds import kind_of

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
    readings = [one for one in comparison.every_channel if one.name == FACE_STRAIN.name]
    ways = np.concatenate([one.place[:, 1] for one in readings])
    seen, model, among = comparison.measured[here], predicted[here], here - len(comparison.forces)
    errors = comparison.beside_errors[np.ix_(among, among)]
    density = float(multivariate_normal(cov=errors).logpdf(seen - model))
    design = np.column_stack([model * (ways == way) for way in (ALONG, ACROSS)])
    weighed = design / np.concatenate([one.white_variance + one.accuracy.slow**2 for one in readings])[:, None]
    shares = np.linalg.solve(weighed.T @ design, weighed.T)
    (along, across), covariance = shares @ seen, shares @ errors @ shares.T
    of_ratio = np.array([-across / along, 1.0]) / along
    body = comparison.parts[comparison.part_of[here[0]]].recording.sizes.body
    logs = [np.log1p(share * model[ways == way].mean()) for share, way in ((across, ACROSS), (along, ALONG))]
    alike = isinstance(body, HomogeneousBody) and -logs[0] / logs[1] < _MOST_RATIO
    return FaceFit(
        len(seen),
        (float(along), float(np.sqrt(covariance[0, 0]))),
        (float(across / along), float(np.sqrt(of_ratio @ covariance @ of_ratio))),
        density,
        kind_of(type(body)).presses(body),
        _profile(readings, seen, model),
        float(-logs[0] / logs[1]) if alike else None,
    )


def _profile(readings: Sequence[StationChannel], seen: FloatArray, model: FloatArray) -> FloatArray:
    """Return heights, and the mean over recordings of strains across at the deepest readings there, (3, h)."""
    height, way = np.concatenate([one.place for one in readings]).T
    depth = np.concatenate([one.displacement for one in readings])
    ends = np.concatenate([np.full(len(one.values), one.displacement.max()) for one in readings])
    deepest = (way == ACROSS) & (depth > _DEEPEST * ends)
    return np.array(
        [
            (at, *(float(one[deepest & (height == at)].mean()) for one in (seen, model)))
            for at in np.unique(height[deepest])
        ]
    ).T
