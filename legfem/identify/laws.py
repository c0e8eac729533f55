"""The two laws of the deep tissue, as identification sees them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from legfem.identify.forward import DeepTissue
from legfem.identify.result import LawName
from legfem.subject import Subject


@dataclass(frozen=True)
class IdentifiedLaw:
    """A law and what of it is fixed."""

    name: LawName
    D2: float
    """1/MPa; infinite leaves the (J - 1)^4 term out."""

    @property
    def dimensions(self) -> int:
        """Number of parameters that are identified."""
        return 1 if self.name == "neo-hookean" else 2

    def deep(self, c10: float, c20: float) -> DeepTissue:
        """Return the deep tissue of stiffnesses in kPa."""
        return DeepTissue(float(c10), 0.0 if self.dimensions == 1 else float(c20), self.D2)


def law_of(name: LawName, subject: Subject) -> IdentifiedLaw:
    """Return a law with the compressibility that the subject's folder gives."""
    second = subject.tissues["deep"].D2
    if name == "neo-hookean" or second is None:
        return IdentifiedLaw(name, math.inf)
    return IdentifiedLaw(name, second)
