"""The tissues relax, over a spectrum of times."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from scipy.stats import norm

from legfem.common.units import FloatArray
from legfem.data.phases import HOLD, UNLOADING
from legfem.inverse.mechanism import IndentedLeg, Solution, TissueMechanism, Values, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior

if TYPE_CHECKING:
    from legfem.mechanics.materials import Hyperelastic

TIMES_S = (0.1, 0.35, 1.2, 4.2, 14.0, 48.0, 170.0, 600.0)
"""Relaxation times of the model's branches: a continuous spectrum is spread over them."""
_NODES = 160
RELAXES = "the leg relaxes: its force fades while it is held"
"""What is sure of all that does so."""


@lru_cache(maxsize=1024)
def spectrum(time: float, spread: float) -> tuple[float, ...]:
    r"""Return the shares of the branches in a log-normal spectrum of relaxation times.

    .. math:: w_k = \int h_k(\ln \tau)\, N(\ln \tau; \ln \tau_0, s^2)\, d \ln \tau

    with hat functions :math:`h_k` between the branches' times. A wide one relaxes in proportion to
    the logarithm of time, as tissue does (Y. C. Fung, Biomechanics (1993), section 7.6).

    Parameters
    ----------
    time
        Middle of the spectrum, s.
    spread
        Its standard deviation, natural logarithms.
    """
    logs = np.log(TIMES_S)
    at = np.linspace(logs[0], logs[-1], _NODES)
    edges = np.concatenate([[-np.inf], 0.5 * (at[1:] + at[:-1]), [np.inf]])
    mass = np.diff(norm.cdf(edges, np.log(time), max(spread, 1e-3)))
    return tuple(float(mass @ np.interp(at, logs, row)) for row in np.eye(len(logs)))


def needs_time(observed: Observations) -> str | None:
    """Return why an effect of rate can't be told, or None."""
    if HOLD in observed.phases or UNLOADING in observed.phases or len(observed.rates) > 1:
        return None
    return "an effect of rate cannot be determined from one loading ramp: it needs a hold, unloading or a second rate"


SPECTRUM: tuple[Parameter, ...] = (
    strength(
        "ratio",
        "-",
        "relaxing stress over the lasting one",
        2.0,
        (0.0, 40.0),
        "muscle loses a third to three quarters of its force in a hold",
    ),
    Parameter(
        "relaxation_time",
        "s",
        (0.03, 300.0),
        Prior(8.0, 1.5, "log", "reported spectra"),
        scale="log",
        statement="middle of the spectrum",
    ),
    Parameter(
        "spread",
        "-",
        (0.05, 4.0),
        Prior(1.5, 1.0, "linear", "reported spectra"),
        statement="standard deviation of the logarithm of the times",
    ),
)
SLOW = Parameter(
    "slow",
    "-",
    (0.0, 0.9),
    Prior(0.1, 0.1, "linear", "muscle still relaxes after minutes"),
    statement="share of the relaxing stress that fades over ten minutes or more, which a hold of a minute hardly shows",
)


@dataclass(frozen=True)
class TissueRelaxation(TissueMechanism):
    """A spectrum of Prony branches of the deep tissue's deviatoric stress."""

    name: ClassVar[str] = "viscoelasticity"
    statement: ClassVar[str] = "the deep tissue relaxes: its force depends on the rate and fades while held"
    parameters: ClassVar[tuple[Parameter, ...]] = (*SPECTRUM, SLOW)
    kin: ClassVar[str] = RELAXES
    next_experiment: ClassVar[str] = "hold the deepest position for a minute, and press at two rates"
    variant: ClassVar[str] = "viscoelastic"
    along_path: ClassVar[bool] = True
    region: ClassVar[str] = "deep"

    def untestable(self, observed: Observations) -> str | None:
        """Return whether there are a hold, an unloading or two rates."""
        return needs_time(observed)

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return several times, narrow and wide."""
        return tuple(
            {"ratio": 0.2, "relaxation_time": time, "spread": spread, "slow": 0.1}
            for time in (1.5, 6.0, 25.0)
            for spread in (0.4, 2.0)
        )

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the branches."""
        return self._branches_of(getattr(leg.tissues, self.region))

    def terms_of(self, law: "Hyperelastic") -> Sequence[Any]:
        """Return the same of a body of one tissue, which is called deep."""
        return self._branches_of(law) if self.region == "deep" else ()

    def _branches_of(self, law: "Hyperelastic") -> Sequence[Any]:
        from legfem.mechanics.terms import Viscoelasticity

        return [Viscoelasticity(self.region, law, branch=str(k + 1)) for k in range(len(TIMES_S))]

    @property
    def derivatives(self) -> tuple[str, ...]:
        """Ratios of the model's branches: as they are small or great, the response is linear."""
        return tuple(f"{name}.ratio" for name in self._branches())

    def shares(self, values: Values) -> FloatArray:
        """Return every branch's ratio; the last one bears what is slow."""
        each = (1.0 - values["slow"]) * np.array(spectrum(values["relaxation_time"], values["spread"]))
        each[-1] += values["slow"]
        return values["ratio"] * each

    def _branches(self) -> list[str]:
        return [f"{self.region}.viscoelasticity{k + 1}" for k in range(len(TIMES_S))]

    def solution(self, values: Values) -> Solution:
        """Return the model with its branches."""
        given = {}
        for name, time, ratio in zip(self._branches(), TIMES_S, self.shares(values), strict=True):
            given[f"{name}.ratio"] = float(ratio)
            given[f"{name}.relaxation_time"] = time
        return Solution(self.variant, given)


@dataclass(frozen=True)
class SuperficialViscoelasticity(TissueRelaxation):
    """The same of the fat."""

    name: ClassVar[str] = "superficial-viscoelasticity"
    statement: ClassVar[str] = "the superficial tissue (fat) relaxes while it is held"
    region: ClassVar[str] = "superficial"
