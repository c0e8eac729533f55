"""What depends on time: tissues relax, over a spectrum of times; fluid drains; repeats soften or stiffen a leg."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import norm

from legfem.common.units import FloatArray
from legfem.data.phases import HOLD, UNLOADING
from legfem.geometry.section import MUSCLE, LegSection
from legfem.inverse.advice import HALF_DEPTH, HOLD_A_MINUTE, HOLD_MINUTES, TWO_RATES, left
from legfem.inverse.mechanism import (
    IndentedLeg,
    Mechanism,
    Solution,
    TissueMechanism,
    Values,
    null_of,
    shape,
    strength,
    value_at,
)
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter, Prior

if TYPE_CHECKING:
    from legfem.mechanics.materials import Hyperelastic


TIMES_S = (0.1, 0.35, 1.2, 4.2, 14.0, 48.0, 170.0, 600.0)
"""Relaxation times of the model's branches: a continuous spectrum is spread over them."""
_NODES = 160
_UNSEEN = 16
"""Factors that stand for what a loading alone can't show."""
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


def carried(observed: Observations, time: float) -> float:
    r"""Return how much of a branch is left along loadings, as a share of what it carries before it relaxes.

    .. math:: c = \frac{\sum F h}{\sum F^2}, \quad h(t) = \int_0^t e^{-(t - s) / \tau} \dot F(s)\, ds

    with the recorded force F for the elastic one: times its ratio, what the branch adds to a stiffness that is fitted
    by least squares (Y. C. Fung, Biomechanics (1993), section 7.6).

    Parameters
    ----------
    observed
        Loadings.
    time
        The branch's, s.
    """
    own = whole = 0.0
    for trial in np.unique(observed.trial):
        here = (observed.trial == trial) & (observed.time > 0.0)
        at, force = observed.time[here], observed.force[here]
        steps, rises = np.diff(at, prepend=0.0), np.diff(force, prepend=0.0)
        each = rises * time / steps * -np.expm1(-steps / time)
        past = np.tril(np.exp(-np.maximum(np.subtract.outer(at, at), 0.0) / time))
        own += float(force @ (past @ each))
        whole += float(force @ force)
    return own / whole


SPECTRUM: tuple[Parameter, ...] = (
    strength(
        "ratio",
        "-",
        "relaxing stress over the lasting one",
        2.0,
        (0.0, 40.0),
        "muscle loses a third to three quarters of its force in a hold",
    ),
    shape("relaxation_time", "s", "middle of the spectrum", Prior(8.0, 1.5, "log", "reported spectra"), (0.03, 300.0)),
    shape(
        "spread",
        "-",
        "standard deviation of the logarithm of the times",
        Prior(1.5, 1.0, "linear", "reported spectra"),
        (0.05, 4.0),
    ),
)
SLOW = shape(
    "slow",
    "-",
    "share of the relaxing stress that fades over ten minutes or more, which a hold of a minute hardly shows",
    Prior(0.1, 0.1, "linear", "muscle still relaxes after minutes"),
    (0.0, 0.9),
)


@dataclass(frozen=True)
class TissueRelaxation(TissueMechanism):
    """A spectrum of Prony branches of the deep tissue's deviatoric stress.

    Parameters
    ----------
    beside_another
        Whether its model has the branches of both tissues, as a limb's.
    """

    beside_another: bool = False

    name = "viscoelasticity"
    statement = "the deep tissue relaxes: its force depends on the rate and fades while held"
    of_pad = "the tissue relaxes: its force depends on the rate and fades while held"
    parameters = (*SPECTRUM, SLOW)
    kin = RELAXES
    next_experiment = f"{HOLD_A_MINUTE.words}, and {TWO_RATES.words}"
    unseen_statement = "tissue relaxes while it is held, and one rate does not show by how much"
    variant = "viscoelastic"
    along_path = True
    region = "deep"

    def untestable(self, observed: Observations) -> str | None:
        """Return whether there are a hold, an unloading or two rates."""
        return needs_time(observed)

    def unseen_factors(self, between: tuple[float, float], observed: Observations) -> FloatArray:
        """Return how much stiffer the tissue is as it is loaded than in the end, its times as they usually are."""
        left = np.array([carried(observed, time) for time in TIMES_S])
        usual = {one.name: null_of(one) for one in self.parameters} | {"ratio": 1.0}
        even = (np.arange(_UNSEEN) + 0.5) / _UNSEEN
        times = [value_at(self.parameters[1], z) for z in norm.ppf(even)]
        shares = [self.shares({**usual, "relaxation_time": time}) @ left for time in times]
        return np.asarray(np.quantile(1.0 + np.outer(np.linspace(*between, _UNSEEN), shares), even))

    def experiment_after(self, observed: Observations) -> str:
        """Return what is left of a hold and two rates, then of longer ones and less deep ones."""
        first = left(observed, HOLD_A_MINUTE, TWO_RATES)
        return ", and ".join(first or left(observed, HOLD_MINUTES, HALF_DEPTH))

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

        return [Viscoelasticity(self.region, law, 0.0, time, str(k)) for k, time in enumerate(TIMES_S, 1)]

    @property
    def derivatives(self) -> tuple[str, ...]:
        """Ratios of the model's branches: as they are small or great, the response is linear."""
        return _ratios(self.region)

    @property
    def derived_together(self) -> tuple[str, ...]:
        """Those of both tissues of a limb, which one path gives."""
        return (*_ratios("deep"), *_ratios("superficial")) if self.beside_another else self.derivatives

    def in_limb(self, section: LegSection) -> Sequence[Mechanism]:
        """Return the same of a limb."""
        return (replace(self, beside_another=MUSCLE not in section.lacks),)

    def shares(self, values: Values) -> FloatArray:
        """Return every branch's ratio; the last one bears what is slow."""
        each = (1.0 - values["slow"]) * np.array(spectrum(values["relaxation_time"], values["spread"]))
        each[-1] += values["slow"]
        return values["ratio"] * each

    def solution(self, values: Values) -> Solution:
        """Return the model with its branches; at its null with none, as that of other tissues."""
        shares = zip(self.derivatives, self.shares(values), strict=True)
        return Solution(self.variant, {name: float(ratio) for name, ratio in shares if ratio})


def _ratios(region: str) -> tuple[str, ...]:
    return tuple(f"{region}.viscoelasticity{k}.ratio" for k in range(1, len(TIMES_S) + 1))


class SuperficialViscoelasticity(TissueRelaxation):
    """The same of the fat."""

    name = "superficial-viscoelasticity"
    needs = MUSCLE
    of_pad = ""
    statement = "the superficial tissue (fat) relaxes while it is held"
    region = "superficial"


_USUAL = 0.03
"""Share of the stiffness in volume: a drained Poisson's ratio of 0.1."""
_BULK_OVER_SHEAR = 30.0
"""Of undrained muscle, about: what shares of a drop are found with."""


class PoroelasticDrainage(TissueMechanism):
    r"""Darcy flow of fluid through the deep tissue, whose skeleton keeps a share of its stiffness in volume.

    What a softer or stiffer skeleton does is tabulated as a share of what the usual one does: of the drop from the
    undrained force of a half-space to the drained one, :math:`(1/2 - \nu) / (1 - \nu)` with the skeleton's Poisson's
    ratio :math:`\nu` (F ~ shear modulus over :math:`1 - \nu`).
    """

    name = "poroelastic-drainage"
    statement = "fluid is squeezed through the tissue and its volume follows in time"
    parameters = (
        strength("permeability", "mm4/(N s)", "Darcy's, of the deep tissue", 400.0, (0.0, 3000.0)),
        shape(
            "skeleton",
            "-",
            "share of the stiffness in volume that stays when all fluid has gone",
            Prior(_USUAL, 1.0, "log", "drained Poisson's ratios of 0 to 0.4 of soft tissue"),
            (0.003, 0.5),
        ),
    )
    kin = RELAXES
    next_experiment = (
        "hold for several minutes with indenters of two sizes: drainage takes time with the size "
        "squared, relaxation does not"
    )
    variant = "porous"
    formulation = "porous"
    along_path = True
    strengths = (10.0, 80.0, 400.0, 1600.0)

    def untestable(self, observed: Observations) -> str | None:
        """Return whether there are a hold, an unloading or two rates, or channels: they show what volume is lost."""
        return None if observed.channels else needs_time(observed)

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the flow."""
        from legfem.mechanics.terms import Drainage

        return [Drainage("deep", leg.tissues.deep)]

    def solution(self, values: Values) -> Solution:
        """Return the porous model."""
        return Solution(self.variant, {f"deep.drainage.{name}": values[name] for name in ("permeability", "skeleton")})

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return slow and fast drainage of the usual skeleton."""
        return tuple({"permeability": size, "skeleton": _USUAL} for size in (20.0, 120.0, 700.0))

    def share(self, values: Values) -> float:
        """Return how much of the usual skeleton's drop there is."""
        return _drop(values["skeleton"]) / _drop(_USUAL)


def _drop(skeleton: float) -> float:
    """Return the share of a half-space's force that drainage takes."""
    bulk = _BULK_OVER_SHEAR * skeleton
    poisson = (3 * bulk - 2) / (6 * bulk + 2)
    return (0.5 - poisson) / (1 - poisson)


class Preconditioning(Mechanism):
    r"""The deep tissue is stiffer in the first trials, by a share that fades and varies with depth.

    .. math:: 1 + s\, \rho^{t} \left(1 + k \left(\tfrac{d}{D} - \tfrac12\right)\right)

    in trial t from 0. The reference is the settled tissue: at the null all trials are alike. Tissue that was stretched
    has softened by the way back (R. W. Ogden, D. G. Roxburgh, Proc. R. Soc. A 455 (1999) 2861, for rubber): there
    the excess is

    .. math:: s\, \rho^{t} \left(r + (1 - r) \tfrac{d}{D}\right) \left(1 + k \left(\tfrac{d}{D} - \tfrac12\right)\right)

    with a share r that stays.
    """

    name = "preconditioning"
    statement = "the tissue softened from one trial to the next: it was not preconditioned"
    parameters = (
        strength("softening", "-", "excess stiffness of the first trial", 0.15, (-0.5, 1.5)),
        shape(
            "fading",
            "-",
            "excess of a trial over that of the one before",
            Prior(0.35, 0.25, "linear", "most is gone after a cycle"),
            (0.0, 0.95),
        ),
        shape(
            "slope",
            "-",
            "change of the excess from first touch to full depth, over its mean",
            Prior(0.0, 0.5, "linear", "nothing is known"),
            (-2.0, 2.0),
        ),
        shape(
            "staying",
            "-",
            "share of the excess that is still there at the end of the unloading",
            Prior(0.5, 0.4, "linear", "between a gain, which stays, and a tissue that has softened by the way back"),
            (0.0, 1.0),
        ),
    )
    would_be = "a first trial that is stiffer than the later ones by a share of {} (softer, if negative)"
    next_experiment = "cycle five to ten times before recording, and rest between trials"
    measured_sd = 0.03
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
