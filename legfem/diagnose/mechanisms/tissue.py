"""Mechanisms of the tissues, seen through the finite-element model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from legfem.diagnose.mechanisms.base import Parameter, Solution, TissueMechanism, Values
from legfem.diagnose.observations import Observations
from legfem.recording.phases import HOLD
from legfem.units import kpa_to_mpa


@dataclass(frozen=True)
class StrainStiffening(TissueMechanism):
    """One more term of the energy's series in (I1 - 3)."""

    name: ClassVar[str] = "strain-stiffening"
    statement: ClassVar[str] = (
        "the deep tissue stiffens with strain more than the law used can describe"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("coefficient", "kPa", "of the energy's next power of strain", 0.0, 20.0,
                  start=0.3),
    )  # fmt: skip
    next_experiment: ClassVar[str] = "press deeper, or with a smaller indenter: larger strains"
    strengths: ClassVar[tuple[float, ...]] = (0.3, 1.2, 4.0)

    def solution(self, values: Values) -> Solution:
        """Return the law with its third coefficient."""
        return Solution(parameters={"deep.C30": kpa_to_mpa(values["coefficient"])})


@dataclass(frozen=True)
class Compressibility(TissueMechanism):
    """The deep tissue's D1, relative to the one given."""

    name: ClassVar[str] = "compressibility"
    statement: ClassVar[str] = (
        "the deep tissue loses or keeps more volume than the compressibility given says"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("excess", "-", "relative change of D1", -0.9, 60.0, start=2.0),
    )
    next_experiment: ClassVar[str] = "image the section under load and measure how its area changes"
    strengths: ClassVar[tuple[float, ...]] = (-0.6, 2.0, 8.0, 25.0)
    proportional: ClassVar[bool] = True

    def solution(self, values: Values) -> Solution:
        """Return the model with that parameter scaled."""
        return Solution(scaled={"deep.D1": 1.0 + values["excess"]})


@dataclass(frozen=True)
class FasciaStiffness(TissueMechanism):
    """The fascia's stiffness times thickness, relative to the one given."""

    name: ClassVar[str] = "fascia-stiffness"
    statement: ClassVar[str] = "the fascia is stiffer, softer, thicker or thinner than assumed"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("excess", "-", "relative change of stiffness times thickness", -0.95, 50.0,
                  start=2.0),
    )  # fmt: skip
    next_experiment: ClassVar[str] = "measure the fascia by shear-wave elastography"
    strengths: ClassVar[tuple[float, ...]] = (-0.8, 2.0, 8.0, 25.0)
    proportional: ClassVar[bool] = True

    def solution(self, values: Values) -> Solution:
        """Return the model with that parameter scaled."""
        return Solution(scaled={"fascia.C10": 1.0 + values["excess"]})


@dataclass(frozen=True)
class SuperficialStiffness(TissueMechanism):
    """The fat's stiffness, relative to the one given."""

    name: ClassVar[str] = "superficial-stiffness"
    statement: ClassVar[str] = "the superficial tissue (fat) is stiffer or softer than assumed"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("excess", "-", "relative change of C10", -0.9, 8.0, start=0.3),
    )
    next_experiment: ClassVar[str] = (
        "press gently with a small tip (2 mm deep), or image the fat's thickness under load"
    )
    strengths: ClassVar[tuple[float, ...]] = (-0.6, 0.7, 2.5, 7.0)
    proportional: ClassVar[bool] = True

    def solution(self, values: Values) -> Solution:
        """Return the model with that parameter scaled."""
        return Solution(scaled={"superficial.C10": 1.0 + values["excess"]})


@dataclass(frozen=True)
class Prestress(TissueMechanism):
    """Tension of the fascia in the imaged state."""

    name: ClassVar[str] = "prestress"
    statement: ClassVar[str] = "the fascia was under tension before the test"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("tension", "kPa", "tension of the fascia at rest", 0.0, 500.0, start=30.0),
    )
    next_experiment: ClassVar[str] = (
        "measure the pressure in the compartment at rest, or shear-wave speeds along the fascia"
    )
    strengths: ClassVar[tuple[float, ...]] = (20.0, 100.0, 300.0)

    def solution(self, values: Values) -> Solution:
        """Return the model with the tension."""
        return Solution(parameters={"fascia.prestress.tension": kpa_to_mpa(values["tension"])})


@dataclass(frozen=True)
class Viscoelasticity(TissueMechanism):
    """One Prony branch of the deep tissue's deviatoric stress."""

    name: ClassVar[str] = "viscoelasticity"
    statement: ClassVar[str] = (
        "the deep tissue relaxes: its force depends on the rate and fades while held"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("ratio", "-", "relaxing stress over the lasting one", 0.0, 4.0, start=0.1),
        Parameter("relaxation_time", "s", "of the branch", 0.5, 200.0),
    )
    next_experiment: ClassVar[str] = (
        "hold the deepest position for a minute, and press at two rates"
    )
    along_path: ClassVar[bool] = True
    TIMES_S: ClassVar[tuple[float, ...]] = (2.0, 8.0, 32.0)
    region: ClassVar[str] = "deep"

    def untestable(self, observed: Observations) -> str | None:
        """Return whether there are a hold, an unloading or two rates."""
        if HOLD in observed.phases or "unloading" in observed.phases or len(observed.rates) > 1:
            return None
        return (
            "an effect of rate can't be told from one loading ramp: it needs a hold, unloading or "
            "a second rate"
        )

    def shape_choices(self, observed: Observations) -> tuple[Values, ...]:
        """Return relaxation times."""
        times = np.geomspace(self.TIMES_S[0], self.TIMES_S[-1], 5)
        return tuple({"relaxation_time": float(time)} for time in times)

    def solution(self, values: Values) -> Solution:
        """Return the model with one branch."""
        return _branch(self.region, values)


@dataclass(frozen=True)
class SuperficialViscoelasticity(Viscoelasticity):
    """One Prony branch of the fat's deviatoric stress."""

    name: ClassVar[str] = "superficial-viscoelasticity"
    statement: ClassVar[str] = "the superficial tissue (fat) relaxes while it is held"
    region: ClassVar[str] = "superficial"


def _branch(region: str, values: Values) -> Solution:
    name = f"{region}.viscoelasticity1"
    return Solution(
        "viscoelastic",
        {f"{name}.ratio": values["ratio"], f"{name}.relaxation_time": values["relaxation_time"]},
    )


@dataclass(frozen=True)
class PoroelasticDrainage(TissueMechanism):
    """Darcy flow of fluid through the deep tissue."""

    name: ClassVar[str] = "poroelastic-drainage"
    statement: ClassVar[str] = "fluid is squeezed through the tissue and its volume follows in time"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("permeability", "mm4/(N s)", "Darcy's, of the deep tissue", 0.0, 500.0,
                  start=20.0),
    )  # fmt: skip
    next_experiment: ClassVar[str] = (
        "hold for several minutes with indenters of two sizes: drainage takes time with the size "
        "squared, relaxation does not"
    )
    along_path: ClassVar[bool] = True
    untestable = Viscoelasticity.untestable
    strengths: ClassVar[tuple[float, ...]] = (10.0, 80.0)

    def solution(self, values: Values) -> Solution:
        """Return the porous model."""
        return Solution("porous", {"deep.drainage.permeability": values["permeability"]})


@dataclass(frozen=True)
class ContactSlip(TissueMechanism):
    """Tape that fails at a shear traction, so that the skin slips along the cylinder."""

    name: ClassVar[str] = "contact-slip"
    statement: ClassVar[str] = "the skin slipped along the cylinder: the tape did not hold"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("weakness", "1/kPa", "inverse of the shear traction at which it slips", 0.0, 5.0,
                  start=1.0),
    )  # fmt: skip
    next_experiment: ClassVar[str] = (
        "mark the skin at the cylinder's edge and film it, or repeat with fresh tape"
    )
    along_path: ClassVar[bool] = True
    strengths: ClassVar[tuple[float, ...]] = (1.0, 3.0)
    costly: ClassVar[bool] = True

    def solution(self, values: Values) -> Solution:
        """Return the model with tape that fails."""
        return Solution("slipping", {"friction.weakness": values["weakness"] * 1e3})


@dataclass(frozen=True)
class IndenterTilt(TissueMechanism):
    """The line of travel, turned about the point of first touch."""

    name: ClassVar[str] = "indenter-tilt"
    statement: ClassVar[str] = "the cylinder did not travel in the direction stated"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("angle", "degrees", "of the travel from the one stated", -15.0, 15.0, start=4.0),
    )
    next_experiment: ClassVar[str] = (
        "photograph the cylinder against the leg at both ends of the travel"
    )
    strengths: ClassVar[tuple[float, ...]] = (-6.0, 6.0)

    def solution(self, values: Values) -> Solution:
        """Return the model pressed along the turned line."""
        return Solution(tilt_deg=values["angle"])


@dataclass(frozen=True)
class EndEffects(TissueMechanism):
    r"""The cylinder's ends: force times :math:`1 - s (P(d) + \sum_k a_k p_k(d))`.

    P is the idealised leg's correction, and :math:`p_k` its errors' modes: of the leg's effective
    length, which nobody knows, of the mesh that P was calibrated on, and of where contact begins,
    far above a recording's noise. They are standard deviations, so each :math:`a_k` is known to
    one beforehand.
    """

    name: ClassVar[str] = "end-effects"
    statement: ClassVar[str] = (
        "the cylinder is short: tissue moves along the leg and its ends carry force"
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter("scale", "-", "of the idealised leg's correction P(d)", 0.0, 3.0, start=0.5),
        Parameter(
            "leg_length", "-", "P's error for the leg's unknown length, in its sd", -3.0, 3.0,
            known_to=1.0,
        ),
        Parameter(
            "calibration", "-", "P's error by the mesh it was found on, in its sd", -3.0, 3.0,
            known_to=1.0,
        ),
        Parameter(
            "first_contact", "-", "P's error where contact begins, in its sd", -3.0, 3.0,
            known_to=1.0,
        ),
    )  # fmt: skip
    MODES: ClassVar[Mapping[str, str]] = {
        "leg_length": "leg length", "calibration": "mesh", "first_contact": "first contact",
    }  # fmt: skip
    """Names of the correction's errors by parameter."""
    next_experiment: ClassVar[str] = "repeat with a cylinder of twice the length"

    def shape_choices(self, observed: Observations) -> tuple[Values, ...]:
        """Return the correction as it was calibrated."""
        return (dict.fromkeys(self.MODES, 0.0),)
