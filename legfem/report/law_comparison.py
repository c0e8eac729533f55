"""Which of two laws the recordings ask for, in sentences."""

from __future__ import annotations

import math
from collections.abc import Sequence

from scipy.special import chdtrc

from legfem.identify.result import IdentificationResult
from legfem.report.style import LAW_NAMES
from legfem.report.words import fit_probability

# Below this, chance doesn't explain what was left unexplained.
_SIGNIFICANT = 0.01


def comparison(results: Sequence[IdentificationResult]) -> list[str]:
    """Return sentences on how well each law fits, and which is better by how much."""
    lines = [_goodness(result) for result in results]
    if len(results) < 2:
        return lines
    better, worse = sorted(results, key=lambda result: result.cost.value)[:2]
    if better.neo_hookean_limit or worse.cost.value <= better.cost.value * (1 + 1e-9):
        return [*lines, "Both laws fit alike: the best reduced polynomial is neo-Hookean (C20 = 0)."]
    ratio = _number(worse.cost.value / max(better.cost.value, 1e-300))
    costs = (
        f"cost is {ratio} times smaller ({better.cost.value:.3g} against "
        f"{worse.cost.value:.3g} N2, rms {better.cost.rms:.3g} against {worse.cost.rms:.3g} N)"
    )
    name = LAW_NAMES[better.law]
    if len(better.parameters) <= len(worse.parameters):
        return [*lines, f"The {name} law fits better: its {costs}."]
    gain, chance = _gain(better, worse)
    if chance < _SIGNIFICANT:
        return [
            *lines,
            f"The {name} law fits better: its {costs}.",
            f"The data ask for its further parameter: chi-square falls by {_number(gain)} ({fit_probability(chance)}).",
        ]
    return [
        *lines,
        f"The {name} law's {costs}, but the data do not ask for its further parameter: chi-square "
        f"changes by {-gain:+.2g} ({fit_probability(chance)}), no more than noise would give.",
    ]


def preferred(results: Sequence[IdentificationResult]) -> IdentificationResult:
    """Return the law that the data ask for: the better fit, unless chance explains that it is."""
    better, *others = sorted(results, key=lambda result: result.cost.value)
    if not others:
        return better
    fewer = len(better.parameters) > len(others[0].parameters)
    by_chance = fewer and _gain(better, others[0])[1] >= _SIGNIFICANT
    return others[0] if by_chance or better.neo_hookean_limit else better


def _gain(better: IdentificationResult, worse: IdentificationResult) -> tuple[float, float]:
    """Return by how much chi-square falls with further parameters, and the chance of that."""
    gain = worse.cost.chi_square - better.cost.chi_square
    extra = len(better.parameters) - len(worse.parameters)
    return gain, float(chdtrc(extra, gain)) if gain > 0 else 1.0


def fits(result: IdentificationResult) -> bool:
    """Return whether a law describes the recordings within the noise."""
    return not result.cost.p_value < _SIGNIFICANT


def _goodness(result: IdentificationResult) -> str:
    name, chance = LAW_NAMES[result.law], result.cost.p_value
    if math.isnan(chance):
        return f"The {name} law fits with rms {result.cost.rms:.3g} N."
    if not fits(result):
        return (
            f"The {name} law does not fit within the noise ({fit_probability(chance)}): "
            "physics that it leaves out shows."
        )
    return f"The {name} law fits within the noise ({fit_probability(chance)})."


def _number(value: float) -> str:
    """Return three digits without an exponent, where it stays readable."""
    rounded = float(f"{value:.3g}")
    return f"{rounded:,.0f}" if 1000 <= rounded < 1e7 else f"{rounded:g}"
