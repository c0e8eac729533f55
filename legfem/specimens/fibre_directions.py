"""How fibres of a specimen's tissue lie in a test."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

Direction = Literal["load", "across", "cylinder"]
AXES: Mapping[Direction, tuple[float, float, float]] = {
    "load": (0.0, 1.0, 0.0),
    "across": (1.0, 0.0, 0.0),
    "cylinder": (0.0, 0.0, 1.0),
}
"""In the half plane that is meshed; of a bar, whose own axis is the second."""
WORDS: Mapping[Direction, str] = {
    "load": "along the load",
    "across": "across the load",
    "cylinder": "along the cylinder",
}
