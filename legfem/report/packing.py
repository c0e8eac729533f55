"""Many numbers in a page, small."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import NDArray


def packed(values: NDArray[Any], kind: str) -> str:
    """Return counts as text; what a whole number can't hold becomes the nearest that it can.

    Parameters
    ----------
    values
        Counts, in C order.
    kind
        NumPy's name of the type: ``<i2`` or ``<u2``.
    """
    limits = np.iinfo(np.dtype(kind))
    whole = np.clip(np.round(values), limits.min, limits.max).astype(kind)
    return base64.b64encode(whole.tobytes()).decode()
