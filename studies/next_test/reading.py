"""What a lab reads that measures an effect of a sealed case by itself.

Readings err by more than a diagnosis is told, half to twice that, with heavy tails.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from legfem.inverse.mechanism import null_of, prior_of
from legfem.legs.mechanisms import Mechanism
from legfem.legs.subject import MeasuredEffect
from studies.concealed.cases import SealedCase
from studies.concealed.legs import SealedLeg

_NO_STRENGTH = ("contact-slip", "leg-movement")
"""Whose concealed forms have no number that is the mechanism's."""
_TAILS = 3.0
"""Degrees of freedom of a reading's error."""
_USUAL_N = 10.0
"""Force at which a hardening support is read."""


def can_be_read(mechanism: Mechanism, case: SealedCase) -> bool:
    """Tell whether the study knows what a lab would read."""
    return mechanism.measured_sd is not None and not (mechanism.name in _NO_STRENGTH and mechanism.name in case.names)


def true_strength(mechanism: Mechanism, case: SealedCase, leg: SealedLeg) -> float:
    """Return a mechanism's strength in a case, in its unit: what the leg is, over what is stated.

    Parameters
    ----------
    mechanism
        Which.
    case
        The case.
    leg
        Its leg: fat, fascia and direction aren't as they are stated without any effect, too.
    """
    strength = null_of(mechanism.parameters[0])
    effects = {name: dict(values) for name, values in case.effects}
    if mechanism.name in effects:
        strength = _of_form(mechanism.name, effects[mechanism.name], case)
    tissue = {"superficial-stiffness": "superficial", "fascia-stiffness": "fascia"}
    if mechanism.name in tissue:
        true, stated = (one.tissues[tissue[mechanism.name]].C10 for one in (leg.true, leg.stated))
        assert true is not None and stated is not None
        strength *= true / stated
    if mechanism.name == "indenter-tilt":
        strength += leg.true.indenter.direction_deg - leg.stated.indenter.direction_deg
    return mechanism.parameters[0].inside(strength)


def _of_form(name: str, values: dict[str, float], case: SealedCase) -> float:
    strength = values["strength"]
    if name == "support-compliance" and case.code == "legfem":
        return strength / (1.0 + values["hardening"] * _USUAL_N)
    if name == "force-drift":
        duration = case.protocol_of_trials.duration
        return strength * (1.0 - math.exp(-duration / values["time"])) / duration
    return strength


def readings_of(
    mechanisms: Sequence[Mechanism], case: SealedCase, leg: SealedLeg, generator: np.random.Generator
) -> list[MeasuredEffect]:
    """Return what a lab reads of mechanisms."""
    found = []
    for mechanism in mechanisms:
        assert mechanism.measured_sd is not None
        first, stated = mechanism.parameters[0], mechanism.measured_sd
        wider = generator.uniform(0.5, 2.0) * math.sqrt((_TAILS - 2) / _TAILS)
        error = stated * wider * float(generator.standard_t(_TAILS))
        true, factor = true_strength(mechanism, case, leg), prior_of(first).scale == "log"
        value = first.inside(true * math.exp(error) if factor else true + error)
        sd = stated * value if factor else stated
        found.append(MeasuredEffect(mechanism.name, value, sd, "read in the study (simulated)"))
    return found
