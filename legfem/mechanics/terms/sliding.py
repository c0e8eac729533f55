"""Fat that slides along the fascia: the law of the face between the two, which have nodes of their own on it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from legfem.common.errors import check_positive
from legfem.mechanics.model import Memoryless

CLOSED = 1.0
"""MPa/mm: with 20 kPa on it a face closes by 0.02 mm."""


@dataclass(frozen=True)
class SlidingFace(Memoryless):
    r"""Two tissues slide along each other on a face, and can't part.

    .. math:: W = \frac{k_n}{2} g^2 + \frac{k_t}{2} |x_1 - x_2|^2

    a reference area of the face, with the distance :math:`g` of a point of the one from the deformed face of the
    other, where it is nearest however far the point has slid, and the vector :math:`x_1 - x_2` between two points
    that lay at one place at first. Nothing resists sliding at ``shear = 0``, and with a great one the two are grown
    together. For a section whose mesh is split there (`legfem.meshing.section.mesh_section`).

    Parameters
    ----------
    shear : float
        k_t (MPa/mm): what a face that sticks like a layer of soft tissue bears along it.
    normal : float
        k_n (MPa/mm), so large that the face stays closed.
    """

    shear: float = 0.0
    normal: float = CLOSED
    name: str = "sliding"
    domain: Literal["face"] = "face"

    def __post_init__(self) -> None:
        """Check the numbers."""
        check_positive(self, "normal")
        check_positive(self, "shear", zero_allowed=True)

    @property
    def parameters(self) -> dict[str, float]:
        """Both stiffnesses (MPa/mm)."""
        return {f"{self.name}.shear": self.shear, f"{self.name}.normal": self.normal}

    def residual(self, domain: Any, history: Mapping[str, Any]) -> Any:
        """Return nothing: points far from each other meet, which a form can't say; see `legfem.fem.sliding`."""
        return None
