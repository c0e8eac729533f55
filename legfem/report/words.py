"""What several pages say alike: origins, laws' energies, numbers as words and cells."""

from __future__ import annotations

import math
import shlex

from legfem.legs.subject import Subject

ORIGINS = {
    "measured": "measured data",
    "reconstructed": "reconstructed data (made to resemble a published study; no leg was measured)",
    "simulated": "simulated data (forces computed by a model; no leg was measured)",
}
ENERGIES = {
    "neo-hookean": "U = C10 (I1 - 3) + (J - 1)^2 / D1",
    "reduced-polynomial": ("U = C10 (I1 - 3) + C20 (I1 - 3)^2 + (J - 1)^2 / D1 + (J - 1)^4 / D2"),
    "yeoh": "U = C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3 + (J - 1)^2 / D1",
    "exponential": "U = C10 (I1 - 3) + A / b (exp(b (I1 - 3)) - 1 - b (I1 - 3)) + (J - 1)^2 / D1",
}


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


def number(value: float, spread: float = math.nan) -> str:
    """Return a number with the digits that its uncertainty leaves, three without one.

    Parameters
    ----------
    value
        The number.
    spread
        Its standard error.
    """
    if not math.isfinite(value):
        return "-"
    if value == 0 and not (math.isfinite(spread) and spread > 0):
        return "0"
    if math.isfinite(spread) and spread > 0:
        digits = -math.floor(math.log10(0.65 * spread))
        return f"{value:.{min(max(digits, 0), 6)}f}"
    return f"{value:.3g}"


def moduli_text(c10: float, error: float, unit: str = "kPa") -> str:
    """Return the moduli at small strain that belong to C10 of an isotropic tissue that hardly changes its volume.

    The shear modulus is 2 C10, Young's modulus three times that.
    """
    shear, young = (f"{number(k * c10, k * error)} {unit}" for k in (2.0, 6.0))
    return f"shear modulus G = {shear}, Young's modulus E = {young}"


def options_of(subject: Subject) -> str:
    """Options of a command that name a subject."""
    site = f" --site {shlex.quote(subject.site)}" if subject.site else ""
    return f"--subject-dir {subject.directory}{site}"
