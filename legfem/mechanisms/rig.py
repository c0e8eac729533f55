"""The rig: the skin slips on a cylinder that is tilted and short; the support gives way; zero and contact are wrong."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.section import BONES, LegSection
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.mechanism import (
    IndentedLeg,
    Mechanism,
    Solution,
    Stiffness,
    TissueMechanism,
    Values,
    error_mode,
    shape,
    strength,
)
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Prior
from legfem.mechanisms import AWAY, ONSET, moments, passing


class LegMovement(Mechanism):
    r"""The leg moves from a moment on, and back after a while, in every trial alike.

    .. math:: d_{tissue} = d - s \left(h(t - t_1) - h(t - t_1 - t_2)\right)

    with a smooth switch h. It moves as a whole, so that the tissue's force at what is left of the
    displacement is all that is asked for.
    """

    name = "leg-movement"
    statement = "the leg moved during the test: it gave way to the cylinder or came towards it"
    parameters = (
        strength("shift", "mm", "how far it moved away from the cylinder", 0.7, (-5.0, 5.0)),
        ONSET,
        shape(
            "rise", "-", "how long a movement took, likewise", Prior(0.05, 0.8, "log", "a second or some"), (0.005, 0.3)
        ),
        AWAY,
    )
    would_be = "a leg that moves away by {}"
    next_experiment = "film the leg against the frame during the test, strap the leg, and repeat"
    measured_sd = 0.15
    """An estimate: a mark of 1 mm, seen to a fraction."""

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return moments through the programme, with a return and without."""
        rise = self.parameters[2]
        return tuple(
            {"shift": 0.2, "onset": onset, "rise": rise.inside(0.5 * apart), "away": gone}
            for onset, apart in moments(observed)
            for gone in (AWAY.inside(apart), 2.0)
        )

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return how far the leg is away from where it began."""
        return values["shift"] * passing(values, observed)


_LEAST = 1e-5
"""mm/N: as good as none."""


@dataclass(frozen=True)
class SupportCompliance(TissueMechanism):
    r"""Springs in series with the whole leg, or each bone on springs of its own.

    In series :math:`d_{tissue} = d - c F`: a rig that gives way is the same as a rigid translation
    of leg and skeleton together. On springs of :math:`1 / (n c)` each of n, in two directions, the bones
    would move by :math:`c F` together if both bore the same, and they don't. The force is taken in
    proportion between the two, by a share at the bones.

    Parameters
    ----------
    bones
        Their names; without them it has no solution.
    """

    bones: tuple[str, ...] = ()

    name = "support-compliance"
    needs = BONES
    statement = "the leg's support or the rig gave way: bones and frame moved with the force"
    parameters = (
        strength("compliance", "mm/N", "displacement per force", 0.2, (0.0, 2.0)),
        shape(
            "at_bones",
            "-",
            "part of the displacement that is the bones', the rest being the frame's (0 to 1)",
            Prior(0.5, 0.5, "linear", "nothing is known"),
            (0.0, 1.0),
        ),
    )
    would_be = "a support that gives way by {}"
    next_experiment = "measure the bone's displacement during the test, or press a rigid block on the same rig"
    measured_sd = 0.02
    """An estimate: the skin over the shin yields 0.1 to 0.2 mm at 10 N."""
    variant = "bones on springs"
    null_variant = variant
    strengths = (0.1, 0.4, 1.2)
    does_without = True

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return a usual compliance at the bones and in the frame, and a great one."""
        return (
            {"compliance": 0.1, "at_bones": 1.0},
            {"compliance": 0.1, "at_bones": 0.0},
            {"compliance": 0.6, "at_bones": 0.5},
        )

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return what the springs take up, were they in series."""
        return values["compliance"] * force

    def in_limb(self, section: LegSection) -> Sequence[Mechanism]:
        """Return the same of the limb's bones."""
        return (SupportCompliance(tuple(section.bones)),)

    def share(self, values: Values) -> float:
        """Return how much of what bones do otherwise than a frame there is."""
        return values["at_bones"]

    def terms(self, leg: IndentedLeg) -> Sequence[Any]:
        """Return the bones' springs."""
        from legfem.mechanics.terms import BoneSprings

        section, length = leg.section, leg.indenter.length
        return [BoneSprings(bone, section.polygon(bone).area, length) for bone in section.bones]

    def solution(self, values: Values) -> Solution:
        """Return the model with its bones on springs, beside the leg in series with such springs.

        Without compliance the two are one.
        """
        compliance = values["compliance"]
        if compliance <= _LEAST:
            return Solution(self.variant, null=self.null_variant)
        names = [f"{bone}.springs.{axis}" for bone in self.bones for axis in "xy"]
        springs = dict.fromkeys(names, 1 / len(self.bones) / compliance)
        return Solution(self.variant, springs, null=self.null_variant, null_in_series=compliance)


class ContactSlip(TissueMechanism):
    """Slip between none (the tape holds) and free.

    The force is taken in proportion between that of a skin that sticks and that of one that slides
    without friction, the two ends of Coulomb's law.
    """

    name = "contact-slip"
    statement = "the skin slipped along the cylinder: the tape did not hold"
    parameters = (strength("slip", "-", "share of the way from sticking to free", 0.6, (0.0, 1.0)),)
    would_be = "a skin that slips along the cylinder, {} of the way to no friction"
    next_experiment = "mark the skin at the cylinder's edge and film it, or repeat with fresh tape"
    measured_sd = 0.15
    """An estimate: marks are read to 0.5 mm beside ways of some mm."""
    variant = "frictionless"
    tangential = "frictionless"
    null_variant = "sticking"
    # Fat that slides folds more often under a contact as stiff and as sharp as the tape's. Compared
    # with a skin that sticks to this one, the change is the same within 0.1 % of the greatest
    # force.
    contact_softness = 0.4
    contact_onset = 0.03
    strengths = (1.0,)

    def solution(self, values: Values) -> Solution:
        """Return the model without friction; only a whole slip is solved."""
        return Solution(self.variant, null=self.null_variant)

    def tabulated(self, values: Values) -> float:
        """Return a whole slip."""
        return self.strengths[0]

    def share(self, values: Values) -> float:
        """Return the share of the way to sliding."""
        return values["slip"]


class IndenterTilt(TissueMechanism):
    """The line of travel, turned about the point of first touch."""

    name = "indenter-tilt"
    statement = "the cylinder did not travel in the direction stated"
    parameters = (strength("angle", "degrees", "of the travel from the one stated", 8.0, (-20.0, 20.0)),)
    would_be = "a travel turned by {} from the one stated"
    alters_nuisances = True
    next_experiment = "photograph the cylinder against the leg at both ends of the travel"
    measured_sd = 1.5
    """An estimate."""
    strengths = (-8.0, 8.0)

    def solution(self, values: Values) -> Solution:
        """Return the model pressed along the turned line."""
        return Solution(tilt_deg=values["angle"])


class ForceDrift(Mechanism):
    """The load cell's zero moves with time, from the start of each trial."""

    name = "force-drift"
    statement = "the load cell's zero drifted in time"
    parameters = (shape("rate", "N/s", "drift of the zero", Prior(0.0, 0.005, "tailed", "warm cells"), (-0.1, 0.1)),)
    would_be = "a zero that drifts by {}"
    next_experiment = "record a minute in air before and after each trial, and compare the zeros"
    measured_sd = 0.0005
    """An estimate: 0.05 N over 100 s."""

    def added_force(self, values: Values, observed: Observations) -> FloatArray:
        """Return the drift."""
        return values["rate"] * observed.time


class ForceLag(Mechanism):
    """The force is recorded behind the displacement, by a time at which the tissue was pressed less."""

    name = "force-lag"
    statement = "the force was recorded behind the displacement: a filter, two clocks, or play in the drive"
    parameters = (shape("lag", "s", "time that it is behind", Prior(0.0, 0.3, "tailed", "usual filters"), (-2.0, 8.0)),)
    would_be = "a force that is {} behind"
    next_experiment = "record force and displacement by one clock and without a filter, the latter at the indenter"

    def untestable(self, observed: Observations) -> str | None:
        """Return why it doesn't show where all is recorded at one velocity."""
        rates = {f"{part.rate:.2g}" for stations in observed.protocols for part in stations.protocol.segments}
        alone = "all was recorded on the way in at one rate, where it is the same as a later contact"
        return alone if len(rates) == 1 else None

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return the way made meanwhile."""
        each = ((one.time - values["lag"], one.protocol) for one in observed.protocols)
        return observed.displacement - observed.spread([protocol.displacement_at(at) for at, protocol in each])


class ContactOnset(Mechanism):
    """Displacement doesn't count from first touch, though it is stated to."""

    name = "contact-onset"
    statement = "the displacement was not counted from first contact: the leg was touched later or earlier"
    parameters = (strength("offset", "mm", "displacement at first contact", 1.0, (-3.0, 5.0)),)
    next_experiment = "start the recording in air, 2 mm before the skin, so that first contact can be seen"

    def untestable(self, observed: Observations) -> str | None:
        """Return whether first contact is stated."""
        if observed.starts_at_contact:
            return None
        return "first contact isn't stated to be at zero, so that every fit finds it"

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return the offset."""
        return np.full(len(force), values["offset"])


_SOURCE = "the correction's own errors"


@dataclass(frozen=True)
class EndEffects(Mechanism):
    r"""The cylinder's ends: force times :math:`1 - s (P(d) + \sum_k a_k p_k(d))`.

    P is the idealised leg's correction, and :math:`p_k` its errors' modes: of the leg's effective
    length, which nobody knows, of the mesh that P was calibrated on, and of where contact begins.
    They are standard deviations, so each :math:`a_k` is known to one beforehand.

    Parameters
    ----------
    correction
        P of the leg; the recordings can't show the ends without it.
    """

    correction: TabulatedCorrection | None = None

    name = "end-effects"
    statement = "the cylinder is short: tissue moves along the leg and its ends carry force"
    parameters = (
        strength("scale", "-", "of the idealised leg's correction P(d)", 1.0, (0.0, 3.0)),
        error_mode("leg_length", "P's error for the leg's unknown length", _SOURCE),
        error_mode("calibration", "P's error by the mesh it was found on", _SOURCE),
        error_mode("first_contact", "P's error where contact begins", _SOURCE),
    )
    MODES: ClassVar[Mapping[str, str]] = {
        "leg_length": "leg length",
        "calibration": "mesh",
        "first_contact": "first contact",
    }
    """Names of the correction's errors by parameter."""
    would_be = "ends of the cylinder that count {} times what is usual"
    next_experiment = "repeat with a cylinder of twice the length"

    def untestable(self, observed: Observations) -> str | None:
        """Return whether there is a correction."""
        return "there is no 3D correction for this leg" if self.correction is None else None

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return the correction as it was calibrated."""
        return ({"scale": 0.5, **dict.fromkeys(self.MODES, 0.0)},)

    def for_length(self, values: Values, factor: float) -> Values:
        """Return a smaller share of the correction: a longer cylinder's ends count less."""
        return {**values, "scale": values["scale"] / factor}

    def relative_change(self, values: Values, at: Stiffness, observed: Observations) -> FloatArray:
        """Return the share of the idealised leg's correction (n,).

        Raises
        ------
        ValueError
            Without a correction.
        """
        correction = self.correction
        if correction is None:
            raise ValueError("there is no 3D correction")
        d = observed.displacement
        c10, c20 = (np.asarray(value) for value in at)
        P = correction.correction(d, c10, c20)
        for name, mode in self.MODES.items():
            if mode in correction.errors:
                P = P + values[name] * np.interp(d, correction.displacement, correction.errors[mode])
        return np.asarray(-values["scale"] * P)
