"""The tissue softens from trial to trial."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from legfem.common.units import FloatArray
from legfem.inverse.mechanism import Mechanism, Values, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior


@dataclass(frozen=True)
class Preconditioning(Mechanism):
    r"""The deep tissue is stiffer in the first trials, by a share that fades and varies with depth.

    .. math:: 1 + s\, \rho^{t} \left(1 + k \left(\tfrac{d}{D} - \tfrac12\right)\right)

    in trial t from 0. The reference is the settled tissue: at the null all trials are alike.
    """

    name: ClassVar[str] = "preconditioning"
    statement: ClassVar[str] = "the tissue softened from one trial to the next: it was not preconditioned"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("softening", "-", "excess stiffness of the first trial", 0.15, (-0.5, 1.5)),
        Parameter(
            "fading",
            "-",
            (0.0, 0.95),
            Prior(0.35, 0.25, "linear", "most is gone after a cycle"),
            statement="excess of a trial over that of the one before",
        ),
        Parameter(
            "slope",
            "-",
            (-2.0, 2.0),
            Prior(0.0, 0.5, "linear", "nothing is known"),
            statement="change of the excess from first touch to full depth, over its mean",
        ),
    )
    would_be: ClassVar[str] = "a first trial that is stiffer than the later ones by a share of {} (softer, if negative)"
    next_experiment: ClassVar[str] = "cycle five to ten times before recording, and rest between trials"
    measured_sd: ClassVar[float | None] = 0.03
    """An estimate: the gains of trials, over several cycles."""

    def untestable(self, observed: Observations) -> str | None:
        """Return whether there are repeats."""
        if observed.repeats < 2:
            return "it shows in repeats of one protocol, and there are none"
        return None

    def deep_factor(self, values: Values, observed: Observations) -> FloatArray:
        """Return each trial's stiffness over the settled one."""
        excess = values["softening"] * values["fading"] ** observed.trial.astype(float)
        part = observed.displacement / observed.depth - 0.5
        return np.asarray(np.maximum(1.0 + excess * (1.0 + values["slope"] * part), 0.05))
