"""What a diagnosis' base model misses, beside what each leading mechanism would leave of itself."""

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import symbol_of
from legfem.inverse.location import Signature
from legfem.inverse.verdict import Diagnosis
from legfem.report.curves import Curves, Dash, Line
from legfem.report.diagnosis_curves import plain
from legfem.report.style import DATA_COLOUR
from legfem.report.words import probability

_MOST_SIGNATURES = 4
_STROKES: tuple[tuple[str, Dash], ...] = (
    ("#0072B2", "solid"),
    ("#CC79A7", "dashed"),
    ("#009E73", "dotdash"),
    ("#E69F00", "dotted"),
)


def signatures_of(found: Diagnosis) -> list[Curves]:
    """Return the misfit with the signatures of the leading mechanisms scaled to it, a block a way of pressing."""
    names = leading(found) if found.verdict != "consistent" else []
    return [_signatures(found, number, names) for number in range(len(found.observed.protocols) if names else 0)]


def _signatures(found: Diagnosis, number: int, names: list[str]) -> Curves:
    observed, stations = found.observed, found.observed.protocols[number]
    timed = len(np.unique(stations.segment)) > 1

    def mean(values: FloatArray) -> FloatArray:
        return np.mean([observed.forces_of(k, values) for k in observed.trials_of(number)], axis=0)

    lines = [Line("difference", -mean(found.weighted_base.fit.residual), None, DATA_COLOUR, points=True)]
    for name, (colour, dash) in zip(names, _STROKES, strict=False):
        scaled, share = matched(found, strongest(found, name))
        score = found.assessment.score(name)
        said = "reported" if any(name in model.names for model in found.models) else "not reported"
        said += f", {probability(score.p_value)}" if score else ""
        said += "" if share is None else f", matches {100 * share:.0f} % of the misfit"
        lines.append(Line(f"{plain(name)} ({said})", -mean(scaled), None, colour, dash))
    hides = " and ".join(map(symbol_of, found.base_model.fit.stiffness))
    return Curves(
        f"signature{number}",
        "Does the difference look like what a mechanism would leave",
        f"; {stations.label}: base model less recorded, on average over trials, and mechanisms' signatures, less what "
        f"a fit of {hides} hides, scaled to the misfit.",
        stations.time if timed else stations.displacement,
        "time (s)" if timed else "displacement (mm)",
        "base model − recorded (N)",
        "",
        lines,
    )


def leading(found: Diagnosis) -> list[str]:
    """Return the mechanisms that are shown: those reported, then those with the strongest sign."""
    reported = [name for model in found.models for name in model.names]
    strongest_first = [score.name for score in sorted(found.assessment.scores, key=lambda s: -s.statistic)]
    known = {signature.mechanism.name for signature in found.assessment.signatures}
    names = dict.fromkeys([*reported, *strongest_first])
    return [name for name in names if name in known][:_MOST_SIGNATURES]


def strongest(found: Diagnosis, name: str) -> Signature:
    """Return the one of a mechanism's signatures that matches the misfit best."""
    mine = [s for s in found.assessment.signatures if s.mechanism.name == name]
    return max(mine, key=lambda signature: _statistic(found, signature))


def matched(found: Diagnosis, signature: Signature) -> tuple[FloatArray, float | None]:
    """Return a signature (n,) scaled to the misfit, N, and the share of the misfit it matches.

    The share is of the squares (in units of the noise) above those that noise makes; None where
    there are hardly more. With the wrong sign it is zero.
    """
    fitted, direction = found.weighted_base.fit, signature.direction
    along = _along(found, signature)
    square = float(direction @ direction)
    shown = direction[: len(fitted.whitened)]
    scaled = np.asarray(found.errors.lower @ shown) * along / square
    dof = len(fitted.whitened)
    beyond = fitted.cost - dof
    if beyond < 2 * np.sqrt(2 * dof):
        return scaled, None
    return scaled, min(1.0, _statistic(found, signature) / beyond)


def _along(found: Diagnosis, signature: Signature) -> float:
    along = float(signature.direction @ found.weighted_base.fit.augmented_residual)
    return max(along, 0.0) if signature.one_sided else along


def _statistic(found: Diagnosis, signature: Signature) -> float:
    return _along(found, signature) ** 2 / float(signature.direction @ signature.direction)
