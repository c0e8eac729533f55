"""Where a parameter's error comes from: what has to be better for the interval to be narrower."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from legfem.common.units import FloatArray
from legfem.correction.fibres import FIBRES
from legfem.inverse.comparison import OF_MODEL, ErrorSource


def source_of_mode(name: str) -> ErrorSource:
    """Return the source that a mode of the correction's error counts to, by the mode's name."""
    if name.startswith(OF_MODEL):
        return "model"
    return "fibres" if name.startswith(FIBRES) else "ends"


def covariances_of_modes(modes: Mapping[str, FloatArray]) -> dict[ErrorSource, FloatArray]:
    """Return covariances (n, n), N2, of the correction's errors, each (n,), N, by its name."""
    parts: dict[ErrorSource, FloatArray] = {}
    for name, mode in modes.items():
        source = source_of_mode(name)
        parts[source] = parts.get(source, 0.0) + np.outer(mode, mode)
    return parts
