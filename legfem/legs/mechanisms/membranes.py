"""The fascia isn't as stiff as assumed, or under tension in the imaged state; the skin bears tension."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from legfem.common.units import kpa_to_mpa
from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, factor, strength
from legfem.inverse.parameter import Parameter


@dataclass(frozen=True)
class FasciaStiffness(TissueMechanism):
    """The fascia's stiffness times thickness, over the one given."""

    name: ClassVar[str] = "fascia-stiffness"
    statement: ClassVar[str] = "the fascia is stiffer, softer, thicker or thinner than assumed"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        factor(
            "factor",
            "stiffness times thickness over the assumed one",
            (0.05, 50.0),
            1.4,
            "crural fascia is reported from 0.1 to 100 MPa",
        ),
    )
    would_be: ClassVar[str] = "a fascia of {} times the assumed stiffness"
    next_experiment: ClassVar[str] = "measure the fascia by shear-wave elastography"
    measured_sd: ClassVar[float | None] = 0.4
    """An estimate: a sheet thinner than a wave is long."""
    strengths: ClassVar[tuple[float, ...]] = (0.2, 3.0, 9.0, 26.0)

    def solution(self, values: Values) -> Solution:
        """Return the model with that parameter scaled."""
        return Solution(scaled={"fascia.C10": values["factor"]})


@dataclass(frozen=True)
class FasciaPrestress(TissueMechanism):
    """Tension of the fascia in the imaged state."""

    name: ClassVar[str] = "prestress"
    statement: ClassVar[str] = "the fascia was under tension before the test"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("tension", "kPa", "tension of the fascia at rest", 100.0, (0.0, 500.0)),
    )
    would_be: ClassVar[str] = "a fascia under a tension of {}"
    next_experiment: ClassVar[str] = (
        "measure the pressure in the compartment at rest, or shear-wave speeds along the fascia"
    )
    measured_sd: ClassVar[float | None] = 40.0
    """An estimate: 1 kPa of pressure times the fascia's radius over its thickness."""
    strengths: ClassVar[tuple[float, ...]] = (20.0, 100.0, 300.0)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the fascia's tension."""
        from legfem.mechanics.terms import Prestress

        return [Prestress(leg.section.fascia)]

    def solution(self, values: Values) -> Solution:
        """Return the model with the tension."""
        return Solution(parameters={"fascia.prestress.tension": kpa_to_mpa(values["tension"])})


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
        from legfem.mechanics.terms.membranes import Dermis

        return [Dermis()]

    def solution(self, values: Values) -> Solution:
        """Return the model with the membrane's stiffness."""
        return Solution(parameters={"dermis.stiffness": values["stiffness"]})
