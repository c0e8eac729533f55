"""The cases: several legs, many concealed truths on each, and how each is recorded.

Cases of one leg share its library of responses, and the solutions of its two stiffnesses without an effect. A third is
solved by felupe, and a third is outside what the library describes, or of a form that it hasn't.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from legfem.channels import Sight
from legfem.channels.kinds import CHANNELS
from legfem.common.units import FloatArray
from legfem.geometry.indenter import Site
from legfem.inverse.catalogue import LawName
from legfem.legs.subject import Subject
from legfem.solve.protocol import Protocol
from studies.cases.forms import drawn_values
from studies.cases.sealed_case import DEPTH_MM, SUBJECTS_OF_LEGS, Code, Kind, SealedCase, sealed_leg

FORCE_ALONE: tuple[str, ...] = ()
LATERAL = ("lateral_force",)
THICKNESSES = ("fat_thickness", "muscle_thickness")
RISES = tuple(name for name in CHANNELS if name.startswith("skin_rise"))
INSIDE, PRESSURE = "section_displacement", "contact_pressure"
PROGRAMMES: dict[str, tuple[Protocol, ...]] = {
    "loading": (Protocol.ramp(DEPTH_MM, 0.4),) * 3,
    "holds": (Protocol.cycle(DEPTH_MM, 1.0, 60.0),) * 2 + (Protocol.ramp(DEPTH_MM, 0.25),) * 2,
}
"""Trials of each: loading alone; or a hold of a minute and an unloading, with loadings four times as slow."""
SUBSETS: dict[str, tuple[str, tuple[str, ...]]] = {
    "force alone": ("loading", FORCE_ALONE),
    "lateral force": ("loading", LATERAL),
    "two thicknesses": ("loading", THICKNESSES),
    "skin's profile": ("loading", RISES),
    "inside the section": ("loading", (INSIDE,)),
    "contact pressure": ("loading", (PRESSURE,)),
    "all": ("loading", (*LATERAL, *THICKNESSES, *RISES, INSIDE, PRESSURE)),
    "force, holds": ("holds", FORCE_ALONE),
    "all, holds": ("holds", (*LATERAL, *THICKNESSES, *RISES, INSIDE, PRESSURE)),
}
"""Programme and further channels that each case is diagnosed by, ..."""
_IN_TURN = ("lateral force", "skin's profile", "inside the section", "contact pressure")
"""... but these, one of which each case has."""
C10_KPA = (0.6, 1.2)
REGISTRATIONS = 3
"""Ways in which an image lies beside where it is said to, of each leg; cases have them in turn."""
SHIFT_MM, TURN_DEG = 2.0, 3.0
"""Greatest of them, drawn evenly."""
_POINTS_MM = ((-12.0, 0.0, 12.0), (5.0, 13.0, 21.0))
"""Across and along the travel, of points inside the section, from the face's deepest point."""
_FROM_EDGES_MM = 3.0
SENSELS_MM = tuple((float(a), float(a) + 6.0) for a in range(-24, 24, 6))
"""Where each begins and ends along the face."""

type Concealed = tuple[Kind, Code, tuple[str, ...], tuple[tuple[str, float], ...]]

NULLS: tuple[Concealed, ...] = (("none", "felupe", (), ()), ("none", "legfem", (), ()))
SINGLES: tuple[Concealed, ...] = (
    ("single", "felupe", ("superficial-stiffness",), ()),
    ("single", "legfem", ("indenter-tilt",), ()),
    ("single", "legfem", ("viscoelasticity",), ()),
    ("single", "felupe", ("fascia-stiffness",), ()),
    ("single", "legfem", ("contact-slip",), ()),
    ("single", "felupe", ("support-compliance",), ()),
    ("single", "legfem", ("dermis",), ()),
    ("single", "felupe", ("compressibility",), ()),
    ("single", "legfem", ("preconditioning",), ()),
    ("single", "legfem", ("superficial-stiffness",), ()),
    ("single", "legfem", ("prestress",), ()),
    ("single", "felupe", ("force-drift",), ()),
)
PAIRS: tuple[Concealed, ...] = (
    ("pair", "felupe", ("superficial-stiffness", "fascia-stiffness"), ()),
    ("pair", "legfem", ("viscoelasticity", "fascia-stiffness"), ()),
    ("pair", "legfem", ("superficial-stiffness", "indenter-tilt"), ()),
    ("pair", "felupe", ("superficial-stiffness", "support-compliance"), ()),
    ("pair", "legfem", ("viscoelasticity", "preconditioning"), ()),
    ("pair", "felupe", ("fascia-stiffness", "force-drift"), ()),
)
OUTSIDE: tuple[Concealed, ...] = (
    ("outside", "felupe", (), (("hard-lump", 1.3),)),
    ("outside", "felupe", ("fat-sliding",), ()),
    ("outside", "legfem", (), (("rig-bends", 1.0),)),
    ("outside", "legfem", ("poroelastic-drainage",), ()),
    ("outside", "legfem", (), (("frame", 1.0),)),
    ("outside", "felupe", (), (("tendon", 1.0),)),
    ("outside", "legfem", (), (("twitch", 1.0),)),
    ("outside", "legfem", (), (("clipping", 1.0),)),
    ("outside", "legfem", ("muscle-contraction",), ()),
    ("outside", "legfem", (), (("drop", 1.0),)),
)
"""Kind, code that solves it, effects by mechanisms' names, and effects by names of their own, with their sizes."""
_EACH = ((NULLS, 3), (SINGLES, 7), (PAIRS, 4), (OUTSIDE, 7))
"""How many of each a leg has, taken in turn from leg to leg."""
_LIKE = {
    "hard-lump": "uneven-muscle",
    "tendon": "uneven-muscle",
    "rig-bends": "support-compliance",
    "twitch": "muscle-contraction",
}
"""Mechanisms of the library that stand for what is outside it."""


@dataclass(frozen=True, eq=False)
class Laid:
    """An image laid into the section beside where it is: turned about the face's deepest point, and shifted."""

    shift: FloatArray
    turn: float
    about: FloatArray

    @property
    def _turned(self) -> FloatArray:
        return np.array([[np.cos(self.turn), -np.sin(self.turn)], [np.sin(self.turn), np.cos(self.turn)]])

    def truly(self, points: FloatArray) -> FloatArray:
        """Return where points (n, 2) of the image are in the leg."""
        return np.asarray(self.about + self.shift + (points - self.about) @ self._turned.T)

    def seen(self, moves: FloatArray) -> FloatArray:
        """Return displacements (..., 2) of the leg as the image shows them."""
        return np.asarray(moves @ self._turned)


def channel_cases(legs: int, seed: int) -> list[SealedCase]:
    """Return all cases, leg after leg."""
    found: list[SealedCase] = []
    for leg in range(legs):
        law: LawName = SUBJECTS_OF_LEGS[leg % len(SUBJECTS_OF_LEGS)][1]
        generator = np.random.default_rng([seed, 36, leg])
        middle = float(np.exp(generator.uniform(*np.log(C10_KPA))))
        people = [middle * float(np.exp(generator.uniform(-0.3, 0.3))) for _ in range(2)]
        ratios = [0.0 if law == "neo-hookean" else float(generator.uniform(0.4, 2.0)) for _ in people]
        every = [group[(leg * count + k) % len(group)] for group, count in _EACH for k in range(count)]
        own = [every[k] for k in generator.permutation(len(every))]
        for turn, (kind, code, names, outside) in enumerate(own):
            c10, ratio = people[turn % 2], ratios[turn % 2]
            effects = tuple((name, drawn_values(name, generator)) for name in names)
            sized = tuple((name, size * float(generator.uniform(0.7, 1.3))) for name, size in outside)
            noise = int(generator.integers(2**31))
            number = len(found)
            found.append(SealedCase(number, kind, leg, law, code, c10, c10 * ratio, effects, sized, noise))
    return found


def truths_of(case: SealedCase) -> tuple[str, ...]:
    """Return what a case's diagnosis should name: nothing of what has no mechanism."""
    return tuple(name for name, _ in case.effects) + tuple(_LIKE[name] for name, _ in case.outside if name in _LIKE)


def subsets_of(case: SealedCase) -> list[str]:
    """Return what a case is diagnosed by; another code's friction is solved for a loading alone."""
    slides = case.code == "felupe" and "contact-slip" in dict(case.effects)
    left_out = set(_IN_TURN) - {_IN_TURN[case.number % len(_IN_TURN)]}
    return [n for n, (programme, _) in SUBSETS.items() if n not in left_out and not (slides and programme == "holds")]


def points_of(leg: int, seed: int) -> FloatArray:
    """Return points (n, 2) of an image that lie in tissue, as stated and wherever the image is laid."""
    both = sealed_leg(leg, seed)
    site = Site(both.stated.section, both.stated.indenter)
    across, along = (part.ravel() for part in np.meshgrid(*_POINTS_MM))
    left = np.array([-site.direction[1], site.direction[0]])
    points = site.deepest + along[:, None] * site.direction + across[:, None] * left
    truly = [_in_tissue(both.true, one.truly(points)) for one in laid(leg, seed)]
    return points[np.all([_in_tissue(both.stated, points), *truly], axis=0)]


def _in_tissue(subject: Subject, points: FloatArray) -> FloatArray:
    tissue = subject.section.polygon("skin").buffer(-_FROM_EDGES_MM)
    for bone in subject.section.bones:
        tissue = tissue.difference(subject.section.polygon(bone).buffer(_FROM_EDGES_MM))
    return np.asarray(shapely.contains_xy(tissue, points[:, 0], points[:, 1]))


def places_of(points: FloatArray) -> tuple[tuple[float, ...], ...]:
    """Return places of both directions at points."""
    return tuple((round(float(x), 3), round(float(y), 3), float(way)) for x, y in points for way in (0, 1))


def laid(leg: int, seed: int) -> list[Laid]:
    """Return the ways in which a leg's images are laid."""
    generator = np.random.default_rng([seed, 38, leg])
    stated = sealed_leg(leg, seed).stated
    about = Site(stated.section, stated.indenter).deepest
    turns = np.deg2rad(generator.uniform(-TURN_DEG, TURN_DEG, REGISTRATIONS))
    return [Laid(generator.uniform(-SHIFT_MM, SHIFT_MM, 2), float(turn), about) for turn in turns]


def true_sights(leg: int, seed: int) -> tuple[Sight, ...]:
    """Return where a true leg is seen: at the images' points, one registration after the other, and at the sensels."""
    points = points_of(leg, seed)
    truly = np.concatenate([one.truly(points) for one in laid(leg, seed)])
    return Sight(INSIDE, places_of(truly)), Sight(PRESSURE, SENSELS_MM)
