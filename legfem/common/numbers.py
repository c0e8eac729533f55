"""Numbers as people read them: with the digits that their errors leave, with two where none is known."""

import math

NOT_DETERMINED = "not determined"


def decimals(standard_error: float) -> int:
    """Return how many decimals a number has whose standard error leaves two digits at most."""
    return min(max(-math.floor(math.log10(0.65 * standard_error)), 0), 6)


def number(value: float, spread: float = math.nan) -> str:
    """Return a number with the digits that its uncertainty leaves, two significant ones without one.

    Parameters
    ----------
    value
        The number.
    spread
        Its standard error.
    """
    if not math.isfinite(value):
        return "-"
    if math.isfinite(spread) and spread > 0 and (value != 0 or spread > 1e-7):
        return f"{value:.{decimals(spread)}f}"
    rounded = float(f"{value:.2g}")
    return f"{rounded:,.0f}" if abs(rounded) >= 10 else f"{rounded:g}"


def between(low: float, high: float) -> tuple[str, str]:
    """Return the ends of a 95 % interval with the digits that its width leaves."""
    return number(low, (high - low) / 4), number(high, (high - low) / 4)


def is_determined(value: float, ends: tuple[float, float]) -> bool:
    """Return whether a 95 % interval spans less than a factor of ten: from its lower end, or its value if that is 0.

    One that is open, or lies on both sides of 0, has no such factor.
    """
    low, high = ends
    return not 0.0 < 10.0 * (low or value) < high < math.inf if low >= 0.0 else True


def span(ends: tuple[float, float], spread: float, at_bound: str = "") -> str:
    """Return a 95 % interval in words: of a value at a bound of its search the other end alone.

    Parameters
    ----------
    ends
        The interval's.
    spread
        Standard error of the value.
    at_bound
        ``lower`` or ``upper``, if the value stands there.
    """
    # An end near nought keeps a digit of its own beside a wide interval's other.
    low, high = (number(end, min(spread, abs(end) / 2) or spread) for end in ends)
    if at_bound == "upper" or not math.isfinite(ends[1]):
        return f"at least {low}"
    return f"at most {high}" if at_bound else f"{low} to {high}"


def percent(probability: float) -> str:
    """Return a probability in whole per cent, never quite none or all."""
    if probability > 0.99:
        return "over 99 %"
    return "below 1 %" if probability < 0.01 else f"{100 * probability:.0f} %"


def share(value: float) -> str:
    """Return a share in per cent, of two digits."""
    return f"{number(100 * value)} %" if abs(value) >= 1e-4 or not value else "below 0.01 %"


def probability(p: float | None, least: float = 1e-3) -> str:
    """Return a p-value as people write it; draws tell none below half of the least."""
    if p is None or math.isnan(p):
        return "p unknown"
    return f"p < {least:g}" if p < least else f"p = {p:.2g}"


def fit_probability(p: float) -> str:
    """Return the p-value of a fit, which comes from a formula and not from draws."""
    return probability(p, 1e-4)


def short_probability(p: float | None) -> str:
    """Return a p-value as a table's cell."""
    return probability(p).removeprefix("p = ").removeprefix("p ")
