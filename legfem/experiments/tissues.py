"""The laws of a leg's tissues, as a subject's file has them."""

from __future__ import annotations

from dataclasses import dataclass

from legfem.mechanics.materials import Hyperelastic


@dataclass(frozen=True)
class Tissues:
    """The laws of the three tissues (MPa, 1/MPa)."""

    deep: Hyperelastic
    superficial: Hyperelastic
    fascia: Hyperelastic
