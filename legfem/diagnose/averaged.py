"""A parameter's interval over all explanations of the recordings.

"Nothing was left out" isn't among them. It says of every effect that it is exactly nought, which
no leg and no rig is; where effects are too small to show, the explanations by each of them say so,
and how far what is hidden may have moved the parameter.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student_t

from legfem.diagnose.explanation import Explained

_FAR = 99.0
"""Standard deviations beyond which no interval ends."""


def averaged_interval(
    explained: Explained, name: str, share: float = 0.95
) -> tuple[float, float] | None:
    """Return a parameter's interval over all that may be left out, each with its probability.

    The distribution is a mixture of Student's t about each one's value; None where no explanation
    that counts has the parameter.
    """
    every = [e for e in explained.every if e.probability > 1e-4 and name in e.fit.free]
    every = [e for e in every if not e.nothing] or every
    if not every:
        return None
    weights = np.array([e.probability for e in every])
    weights /= weights.sum()
    which = [e.fit.free.index(name) for e in every]
    means, sds, degrees = np.array([
        (e.posterior.mean[k], np.sqrt(e.posterior.covariance[k, k]), e.degrees_of_freedom[k])
        for e, k in zip(every, which, strict=True)
    ]).T  # fmt: skip

    def quantile(probability: float) -> float:
        def beyond(z: float) -> float:
            return float(weights @ student_t.cdf((z - means) / sds, degrees)) - probability

        return float(
            brentq(beyond, float((means - 99 * sds).min()), float((means + 99 * sds).max()))
        )

    parameter = every[0].fit.parameters[which[0]]
    assert parameter.prior is not None
    tail = (1 - share) / 2
    ends = [parameter.inside(parameter.prior.value_at(quantile(p))) for p in (tail, 1 - tail)]
    return min(ends), max(ends)
