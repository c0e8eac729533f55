"""What a specimen's test may leave out: the diagnosis' mechanisms, in its own words and sizes.

Usual strengths are a leg's (20 mm deep, 20 N, C10 of 1 kPa); a specimen's are brought to its own
depth, force, duration and stiffness.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

from legfem.common.units import FloatArray
from legfem.inverse.mechanism import factor, prior_of
from legfem.inverse.observations import Observations
from legfem.inverse.parameter import Parameter
from legfem.legs.mechanisms import Mechanism, TissueMechanism, Values, mechanisms
from legfem.legs.mechanisms.support import SupportCompliance
from legfem.specimens.sizes import Sizes, kind_in, layered, slipping


@dataclass(frozen=True)
class RigCompliance(Mechanism):
    r"""Springs in series: :math:`d_{tissue} = d - c F`; a specimen has no bones."""

    name: ClassVar[str] = SupportCompliance.name
    statement: ClassVar[str] = "the rig or the base gave way with the force"
    parameters: ClassVar[tuple[Parameter, ...]] = SupportCompliance.parameters[:1]
    next_experiment: ClassVar[str] = "press a rigid block on the same rig, and subtract what that yields"

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return what the rig takes up."""
        return values["compliance"] * force


def mechanisms_on_a_rig() -> tuple[Mechanism, ...]:
    """Return all mechanisms for a body that gives way with its rig, not with two bones."""
    return tuple(RigCompliance() if m.name == RigCompliance.name else m for m in mechanisms())


_LEG_MM, _LEG_N, _LEG_S = 20.0, 20.0, 100.0
_FACES = (
    "contact-slip",
    "what touches the specimen let it slip along: its faces did not hold",
    "mark the specimen at the contact's edge and film it, or repeat with sandpaper and with oil",
)
_TOLD: Mapping[str, tuple[str, str]] = {
    "viscoelasticity": (
        "the tissue relaxes: its force depends on the rate and fades while held",
        "hold the deepest position for a minute, and press at two rates",
    ),
    "strain-stiffening": (
        "the tissue stiffens with strain more than the law used can describe",
        "press deeper, or with a smaller indenter: larger strains",
    ),
    "compressibility": (
        "the tissue loses or keeps more volume than Poisson's ratio as given says",
        "measure the specimen's girth under load, and how its volume changes",
    ),
    "contact-slip": _FACES[1:],
    "contact-onset": (
        "the displacement was not counted from first contact",
        "start the recording in air, 2 mm before contact, so that first contact can be seen",
    ),
    "force-drift": (
        "the load cell's zero drifted in time",
        "record a minute in air before and after each trial, and compare the zeros",
    ),
    "superficial-stiffness": (
        "the layers of stated stiffness are stiffer or softer than stated",
        "test one of those layers by itself, or press with a smaller tip",
    ),
    "leg-movement": (
        "the specimen moved during the test, or slipped in its rig",
        "film the specimen against the rig during the test, hold it faster, and repeat",
    ),
    "preconditioning": (
        "the tissue softened from one trial to the next: it was not preconditioned",
        "cycle five to ten times before recording, and rest between trials",
    ),
}
_NONE: Mapping[str, str] = {
    "dermis": "a specimen of one tissue has no skin over it",
    "end-effects": "the specimen's model has no length beyond the indenter's",
    "fascia-stiffness": "a specimen of one tissue has no fascia",
    "indenter-tilt": "the specimen's model is symmetric about the travel, so that it can't tilt",
    "muscle-contraction": "a specimen doesn't tense",
    "muscle-fibres": "fibres of a specimen are stated or identified: [fibres] in specimen.toml",
    "poroelastic-drainage": "specimen.toml doesn't say through which faces fluid leaves",
    "prestress": "a specimen of one tissue has no fascia",
    "superficial-stiffening": "a specimen of one tissue has no fat over it",
    "superficial-stiffness": "a specimen of one tissue has no fat over it",
    "superficial-viscoelasticity": "a specimen of one tissue has no fat over it",
    "uneven-muscle": "a specimen of one tissue is taken to be alike everywhere",
}
_OF_LAYERS: Mapping[str, str | None] = {
    "superficial-stiffness": None,
    "superficial-stiffening": "layers of stated stiffness are taken as stated but for a factor",
    "superficial-viscoelasticity": "layers of stated stiffness are taken not to relax",
}
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
        Roughly, kPa.
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
            "strain-stiffening": self.c10,
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
    for mechanism in mechanisms_on_a_rig():
        why = _NONE.get(mechanism.name)
        if layered(sizes) is not None:
            why = _OF_LAYERS.get(mechanism.name, why)
        if mechanism.name == _FACES[0] and slipping(sizes) is None:
            why = kind_in(sizes).no_slip
        if isinstance(mechanism, TissueMechanism) and mechanism.name not in (*_TOLD, *_NONE):
            why = "it doesn't say what it does to a specimen"
        if not timed and mechanism.name in _WITHOUT_TIME:
            why = "a table of stretch and stress has no time"
        if why is not None:
            unable[mechanism.name] = why
        else:
            able.append(_of_specimen(mechanism, scale))
    return able, unable


def _of_specimen(mechanism: Mechanism, scale: Scale) -> Mechanism:
    statement, next_experiment = _TOLD.get(mechanism.name, (mechanism.statement, mechanism.next_experiment))
    first, *rest = mechanism.parameters
    strengths = mechanism.strengths if isinstance(mechanism, TissueMechanism) else None
    if mechanism.name == "compressibility":
        most = max(_LEAST_FACTOR, scale.bulk / _LEAST_BULK)
        first = factor(
            "factor",
            "on D1",
            (0.1, 1.5 * most),
            max(1.3, 0.5 * math.log(most)),
            "gels hardly lose volume, foams and drained tissues lose much",
        )
        strengths = (most ** (1 / 3), most ** (2 / 3), most)
    over = scale.over_a_leg.get(mechanism.name, 1.0)
    return mechanism.restated(
        statement,
        next_experiment,
        (_times(first, over), *rest),
        None if strengths is None else tuple(over * value for value in strengths),
    )


def _times(parameter: Parameter, over: float) -> Parameter:
    if over == 1.0:
        return parameter
    prior, (low, high) = prior_of(parameter), parameter.bounds
    return replace(parameter, bounds=(over * low, over * high), prior=replace(prior, sd=over * prior.sd))
