"""The deep tissue is compressible, stiffens more than its law, is fibrous along the leg, or the muscle tenses."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.inverse.mechanism import (
    IndentedLeg,
    Mechanism,
    Solution,
    TissueMechanism,
    Values,
    factor,
    null_of,
    strength,
)
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior
from legfem.legs.correction_of_leg import read_fibres
from legfem.legs.mechanisms import moments, shortest_programme, smooth_switch
from legfem.legs.subject import HIGHEST_RATIO

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

    def terms_of(self, law: "Hyperelastic") -> Sequence[Any]:
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


def _error(name: str, statement: str) -> Parameter:
    prior = Prior(0.0, 1.0, "linear", "the table of fibres' own errors")
    return Parameter(name, "sd", (-3.0, 3.0), prior, statement=statement)


@dataclass(frozen=True)
class MuscleFibres(Mechanism):
    r"""Force times :math:`f(d; r)^{1 + \sum_k a_k e_k(d)}`, see `legfem.legs.correction_of_leg`.

    The two :math:`e_k` are the modes that the table's errors are mostly made of, as shares of
    :math:`\ln f` and in standard deviations. Only a cylinder that ends bends fibres, so that it
    shows where the base model has ends.
    """

    name: ClassVar[str] = "muscle-fibres"
    statement: ClassVar[str] = "muscle is fibrous along the leg: its fibres bend at the cylinder's ends, and resist"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        factor(
            "ratio",
            "of the muscle's shear moduli along the leg and across",
            (1.0, HIGHEST_RATIO),
            0.8,
            "shear waves in vivo: about 3 in the vastus lateralis (PMC8754054)",
        ),
        _error("size", "error of the table that is mostly alike at all depths"),
        _error("course", "error of the table that changes along the depth"),
    )
    next_experiment: ClassVar[str] = (
        "press with the cylinder across the leg or with an end-on punch, or measure the muscle by "
        "shear-wave elastography along its fibres and across"
    )
    measured_sd: ClassVar[float | None] = 0.15
    """An estimate: moduli to 10 % each."""

    expected: ClassVar[float] = 5.0
    """All skeletal muscle is fibrous; its part that presses on a cylinder may lie otherwise."""

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return fibres of usual ratios."""
        others = {one.name: null_of(one) for one in self.parameters[1:]}
        return tuple({"ratio": ratio, **others} for ratio in (1.6, 3.0))

    def for_length(self, values: Values, factor: float) -> Values:
        """Return fibres of a ratio nearer to one: a longer cylinder's ends count less."""
        return {**values, "ratio": values["ratio"] ** (1 / factor)}

    def force_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return the factor by fibres under the cylinder's ends."""
        d = observed.displacement
        grid, modes = _modes()
        share = 1.0 + values["size"] * np.interp(d, grid, modes[0])
        share += values["course"] * np.interp(d, grid, modes[1])
        return np.asarray(np.exp(share * read_fibres().log_at(values["ratio"], d)))


@cache
def _modes() -> tuple[FloatArray, FloatArray]:
    """Return the table's displacements (n,), mm, and the two greatest modes of its errors."""
    table = read_fibres()
    _, sizes, modes = np.linalg.svd(np.array(list(table.errors.values())), full_matrices=False)
    return table.displacement, sizes[:2, None] * modes[:2]
