"""The deep tissue's compressibility isn't the one given, it stiffens more than its law, or the muscle tenses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.inverse.mechanism import IndentedLeg, Mechanism, Solution, TissueMechanism, Values, factor, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior
from legfem.legs.mechanisms.timing import moments, shortest_programme, smooth_switch

if TYPE_CHECKING:
    from legfem.mechanics.materials import Hyperelastic


@dataclass(frozen=True)
class Compressibility(TissueMechanism):
    """The deep tissue's D1, over the one given."""

    name: ClassVar[str] = "compressibility"
    statement: ClassVar[str] = "the muscle is more (or less) compressible than assumed"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        factor(
            "factor", "D1 over the assumed one", (0.1, 60.0), 1.3, "reported bulk moduli of muscle differ a hundredfold"
        ),
    )
    would_be: ClassVar[str] = "a muscle of {} times the assumed compressibility"
    next_experiment: ClassVar[str] = "image the section under load and measure how its area changes"
    measured_sd: ClassVar[float | None] = 0.7
    """An estimate: areas to 0.5 % beside changes of 1 %."""
    strengths: ClassVar[tuple[float, ...]] = (0.3, 3.0, 9.0, 26.0)

    def solution(self, values: Values) -> Solution:
        """Return the model with that parameter scaled."""
        return Solution(scaled={"deep.D1": values["factor"]})


@dataclass(frozen=True)
class StrainStiffening(TissueMechanism):
    """One more term of the energy's series in (I1 - 3)."""

    name: ClassVar[str] = "strain-stiffening"
    statement: ClassVar[str] = "the deep tissue stiffens with strain more than the law used can describe"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("coefficient", "kPa", "coefficient of the energy's next power of strain", 1.5, (0.0, 20.0)),
    )
    next_experiment: ClassVar[str] = "press deeper, or with a smaller indenter: larger strains"
    strengths: ClassVar[tuple[float, ...]] = (0.3, 1.2, 4.0)
    stands_for_C20: ClassVar[bool] = True

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the tissue with a third coefficient of its energy."""
        return self.terms_of(leg.tissues.deep)

    def terms_of(self, law: Hyperelastic) -> Sequence[Any]:
        """Return the same of a body of one tissue."""
        from legfem.mechanics.materials import Yeoh
        from legfem.mechanics.terms import Tissue

        return [Tissue("deep", Yeoh.of(law))]

    def solution(self, values: Values) -> Solution:
        """Return the law with its third coefficient."""
        return Solution(parameters={"deep.C30": kpa_to_mpa(values["coefficient"])})


@dataclass(frozen=True)
class MuscleContraction(Mechanism):
    """The muscle tenses from a moment on, in every trial: a smooth switch of its stiffness.

    An elastic leg's force at a displacement follows from the stiffness then, so no history is
    needed; `legfem.mechanics.terms.muscle` is the same thing in the finite-element model.
    """

    name: ClassVar[str] = "muscle-contraction"
    statement: ClassVar[str] = "the muscle tensed during the test and became stiffer"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("stiffening", "-", "rise of the deep stiffness over itself", 0.2, (0.0, 3.0)),
        Parameter(
            "onset",
            "-",
            (0.0, 1.0),
            Prior(0.5, 0.3, "linear", "any time"),
            statement="when it begins, over the time of the shortest programme",
        ),
        Parameter(
            "rise",
            "-",
            (0.005, 0.5),
            Prior(0.06, 0.8, "log", "a second or some"),
            scale="log",
            statement="how long it takes to rise, likewise",
        ),
    )
    would_be: ClassVar[str] = "a muscle that tenses and becomes stiffer by a share of {}"
    next_experiment: ClassVar[str] = "repeat with electromyography of the calf, or ask for a relaxed leg and compare"
    measured_sd: ClassVar[float | None] = 0.03
    """An estimate."""

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return onsets through the programme."""
        rise = self.parameters[2]
        return tuple(
            {"stiffening": 0.1, "onset": onset, "rise": rise.inside(share * apart)}
            for onset, apart in moments(observed)
            for share in (0.4, 1.5)
        )

    def deep_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return the stiffness over that at rest."""
        since = observed.time / shortest_programme(observed) - values["onset"]
        return 1.0 + values["stiffening"] * smooth_switch(since / max(values["rise"], 1e-6))
