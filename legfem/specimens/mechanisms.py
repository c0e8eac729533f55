"""What a specimen's test may have left out: the diagnosis' mechanisms brought to its sizes, and its rig's own."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from legfem.channels.kinds.face_strain import FACE_STRAIN
from legfem.common.resources import resource
from legfem.common.units import FloatArray
from legfem.inverse.mechanism import factor, prior_of, shape, strength
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Prior
from legfem.mechanisms import Mechanism, TissueMechanism, Values, mechanisms
from legfem.mechanisms.rig import ContactSlip, SupportCompliance
from legfem.specimens.sizes import Sizes


class RigCompliance(Mechanism):
    r"""Springs in series: :math:`d_{tissue} = d - c F`; a specimen has no bones."""

    name = SupportCompliance.name
    statement = "the rig or the base gave way with the force"
    parameters = SupportCompliance.parameters[:1]
    next_experiment = "press a rigid block on the same rig, and subtract what that yields"

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return what the rig takes up."""
        return values["compliance"] * force


_ANY_TIME = Prior(0.3, 0.3, "linear", "any time")


class GripSlip(Mechanism):
    r"""From a displacement on a share of the travel is lost: :math:`d_{tissue} = d - s \max(\hat d - d_0, 0)`.

    With :math:`\hat d` the farthest so far: what slipped doesn't come back.
    """

    name = "grip-slip"
    statement = "the grips slipped: a part of the travel did not reach the specimen"
    parameters = (
        strength("share", "-", "share of the travel that is lost", 0.15, (0.0, 0.9)),
        shape("onset", "-", "from which displacement on, over the greatest", _ANY_TIME, (0.0, 0.95)),
    )
    next_experiment = "mark the specimen at the grips and film it, hold it in sandpaper, and repeat"

    def untestable(self, observed: Observations) -> str | None:
        """Return whether nothing but the force was recorded."""
        if any(one.name == FACE_STRAIN.name for one in observed.channels):
            return None
        return "grips that slip look like a softer tissue by the force alone: track points on the face"

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return slips that begin early and late."""
        return tuple({"share": 0.1, "onset": onset} for onset in (0.05, 0.3, 0.6))

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return what has slipped."""
        lost = np.zeros(len(force))
        for mine in (observed.trial == k for k in range(len(observed.trials))):
            farthest = np.maximum.accumulate(observed.displacement[mine])
            lost[mine] = values["share"] * np.maximum(farthest - values["onset"] * observed.depth, 0.0)
        return lost


def mechanisms_on_a_rig() -> tuple[Mechanism, ...]:
    """Return all mechanisms for a body that gives way with its rig or its grips, not with two bones."""
    return (*(RigCompliance() if m.name == RigCompliance.name else m for m in mechanisms()), GripSlip())


_LEG_MM, _LEG_N, _LEG_S, _LEG_C10 = 20.0, 20.0, 100.0, 1e-3
_TEXTS = resource("specimens/mechanisms", dict[str, dict[str, Any]])
_TOLD: Mapping[str, Mapping[str, str]] = _TEXTS["told"]
"""What a specimen's diagnosis says of mechanisms in place of what it says of a leg."""
_NONE: Mapping[str, str] = _TEXTS["none"]
_OF_LAYERS: Mapping[str, str] = _TEXTS["none_of_layers"]
"""Why specimens, and those of layers, don't have a mechanism; empty where they do."""
_WITHOUT_TIME = ("viscoelasticity", "force-drift", "leg-movement", "preconditioning")
_LEAST_BULK = 5.0
"""Bulk over shear modulus down to which compressibility is tabulated: Poisson's ratio 0.41."""
_LEAST_FACTOR = 3.0
_RIG = 0.2
"""Usual drift of a bench's load cell over that of a leg's, as a share of the greatest force."""


@dataclass(frozen=True)
class Scale:
    """What a specimen's test is like.

    Parameters
    ----------
    depth
        mm.
    force
        Greatest, N.
    duration
        s.
    c10
        Roughly, MPa.
    bulk
        Modulus over the shear modulus, as given.
    """

    depth: float
    force: float
    duration: float
    c10: float
    bulk: float

    @property
    def over_a_leg(self) -> dict[str, float]:
        """Usual strengths over those of a leg, by mechanism."""
        depth, force = self.depth / _LEG_MM, self.force / _LEG_N
        return {
            "strain-stiffening": self.c10 / _LEG_C10,
            RigCompliance.name: depth / force,
            "contact-onset": depth,
            "leg-movement": depth,
            "force-drift": _RIG * force * _LEG_S / self.duration,
        }


def mechanisms_of(sizes: Sizes, scale: Scale, timed: bool = True) -> tuple[list[Mechanism], dict[str, str]]:
    """Return the mechanisms that a specimen may have, and why it can't have the others.

    Parameters
    ----------
    sizes
        Of the test.
    scale
        Of the recordings.
    timed
        Whether they have a time, which tables of stretch and stress haven't.
    """
    able: list[Mechanism] = []
    unable: dict[str, str] = {}
    kind, body = sizes.kind, sizes.body
    for mechanism in mechanisms_on_a_rig():
        why = _NONE.get(mechanism.name, "")
        if sizes.layers:
            why = _OF_LAYERS.get(mechanism.name, why)
        if mechanism.name == ContactSlip.name and sizes.slipping is None:
            why = kind.no_slip
        if mechanism.name == GripSlip.name and (kind.presses(body) or kind.face(body) is None):
            why = "nothing pulls the specimen by grips"
        if isinstance(mechanism, TissueMechanism) and mechanism.name not in (*_TOLD, *_NONE):
            why = "it doesn't say what it does to a specimen"
        if not timed and mechanism.name in _WITHOUT_TIME:
            why = "a table of stretch and stress has no time"
        if why:
            unable[mechanism.name] = why
        else:
            able.append(_of_specimen(mechanism, scale))
    return able, unable


def _of_specimen(mechanism: Mechanism, scale: Scale) -> Mechanism:
    told = _TOLD.get(mechanism.name, {})
    first, *rest = mechanism.parameters
    strengths = mechanism.strengths if isinstance(mechanism, TissueMechanism) else None
    if mechanism.name == "compressibility":
        most = max(_LEAST_FACTOR, scale.bulk / _LEAST_BULK)
        log_sd, source = max(1.3, 0.5 * math.log(most)), "gels hardly lose volume, foams and drained tissues lose much"
        first = factor("factor", "D1 over the assumed one", (0.1, 1.5 * most), log_sd, source)
        strengths = (most ** (1 / 3), most ** (2 / 3), most)
    over = scale.over_a_leg.get(mechanism.name, 1.0)
    if over != 1.0:
        prior, (low, high) = prior_of(first), first.bounds
        first = replace(first, bounds=(over * low, over * high), prior=replace(prior, sd=over * prior.sd))
    # Another body's strength isn't said in a leg's words.
    found = mechanism.restated(**told, would_be="", steps=(), parameters=(first, *rest))
    return found if strengths is None else found.restated(strengths=tuple(over * value for value in strengths))
