"""A parameter's interval over all explanations of the recordings.

"Nothing was left out" isn't among them. It says of every effect that it is exactly nought, which
no leg and no rig is; where effects are too small to show, the explanations by each of them say so,
and how far what is hidden may have moved the parameter.
"""

from __future__ import annotations

from legfem.diagnose.explanation import Explained, Explanation
from legfem.inference.mixture import Mixture


def averaged_interval(
    explained: Explained, name: str, share: float = 0.95
) -> tuple[float, float] | None:
    """Return a parameter's interval over all that may be left out, each with its probability.

    None where no explanation that counts has the parameter.
    """
    every = _averaged(explained, name)
    if not every:
        return None
    mixture = Mixture.joined([e.probability for e in every], [e.distribution(name) for e in every])
    parameter = next(p for p in every[0].fit.parameters if p.name == name)
    assert parameter.prior is not None
    tail = (1 - share) / 2
    ends = [
        parameter.inside(parameter.prior.value_at(mixture.quantile(p))) for p in (tail, 1 - tail)
    ]
    return min(ends), max(ends)


def widened_by(explained: Explained, name: str) -> Explanation | None:
    """Return what takes a parameter's interval furthest beyond the base model's, with mechanisms.

    None where nothing does, or the base model hasn't the parameter.
    """
    if name not in explained.base.fit.free:
        return None
    own = explained.base.distribution(name)
    low, high = own.quantile(0.025), own.quantile(0.975)

    def beyond(one: Explanation) -> float:
        mixture = one.distribution(name)
        return one.probability * (mixture.below(low) + 1.0 - mixture.below(high))

    every = [e for e in _averaged(explained, name) if e.names]
    return max(every, key=beyond, default=None)


def _averaged(explained: Explained, name: str) -> list[Explanation]:
    every = [e for e in explained.every if e.probability > 1e-4 and name in e.fit.free]
    return [e for e in every if not e.nothing] or every
