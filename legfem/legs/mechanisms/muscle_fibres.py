"""The muscle is fibrous along the leg."""

from dataclasses import dataclass
from functools import cache
from typing import ClassVar

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.mechanism import Mechanism, Values, factor, null_of
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior
from legfem.legs.correction_of_leg import read_fibres
from legfem.legs.elastography import HIGHEST_RATIO


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
