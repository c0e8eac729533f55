"""The tissue softens from trial to trial."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from legfem.common.units import FloatArray
from legfem.data.phases import UNLOADING
from legfem.inverse.mechanism import Mechanism, Values, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior


@dataclass(frozen=True)
class Preconditioning(Mechanism):
    r"""The deep tissue is stiffer in the first trials, by a share that fades and varies with depth.

    .. math:: 1 + s\, \rho^{t} \left(1 + k \left(\tfrac{d}{D} - \tfrac12\right)\right)

    in trial t from 0. The reference is the settled tissue: at the null all trials are alike. Tissue that was stretched
    has softened by the way back (R. W. Ogden, D. G. Roxburgh, Proc. R. Soc. A 455 (1999) 2861, for rubber): there
    the excess is

    .. math:: s\, \rho^{t} \left(r + (1 - r) \tfrac{d}{D}\right) \left(1 + k \left(\tfrac{d}{D} - \tfrac12\right)\right)

    with a share r that stays.
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
        Parameter(
            "staying",
            "-",
            (0.0, 1.0),
            Prior(0.5, 0.4, "linear", "between a gain, which stays, and a tissue that has softened by the way back"),
            statement="share of the excess that is still there at the end of the unloading",
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
        share = observed.displacement / observed.depth
        back = values["staying"] + (1.0 - values["staying"]) * share
        excess = np.where(observed.phase == UNLOADING, back, 1.0) * excess
        return np.asarray(np.maximum(1.0 + excess * (1.0 + values["slope"] * (share - 0.5)), 0.05))
