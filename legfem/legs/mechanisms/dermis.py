"""The skin bears tension."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, strength
from legfem.inverse.parameter import Parameter


@dataclass(frozen=True)
class DermisTension(TissueMechanism):
    """The dermis as a membrane on the fat, which both papers leave out.

    At 1 mm of dermis, Young's modulus under suction (129 kPa on the forearm; Diridollou et al.
    2000) gives 0.04 N/mm, C10 of the reticular dermis (0.16 MPa; Hendriks et al. 2006) 0.3 N/mm,
    and C10 from indentation with images (1.11 MPa; Tran et al. 2007) 2 N/mm.
    """

    name: ClassVar[str] = "dermis"
    statement: ClassVar[str] = "the skin bears tension: it is a sheet stiffer than the fat under it"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength(
            "stiffness",
            "N/mm",
            "shear modulus of the dermis times its thickness",
            0.3,
            (0.0, 3.0),
            "Diridollou 2000, Hendriks 2006 and Tran 2007: 0.04 to 2 N/mm",
        ),
    )
    would_be: ClassVar[str] = "a skin of a stiffness of {}"
    next_experiment: ClassVar[str] = (
        "lift the skin with a suction cup, or stretch it between two pads, beside the indenter"
    )
    measured_sd: ClassVar[float | None] = 0.1
    """An estimate: a third of a usual stiffness."""
    strengths: ClassVar[tuple[float, ...]] = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the membrane."""
        from legfem.mechanics.terms.dermis import Dermis

        return [Dermis()]

    def solution(self, values: Values) -> Solution:
        """Return the model with the membrane's stiffness."""
        return Solution(parameters={"dermis.stiffness": values["stiffness"]})
