"""Stiffness beside that of living people: what few of them have, and which unit would explain it.

People differ: muscle of one calf in twenty is 2.7 times as stiff as the median's, or as soft. So a
factor of 2 in the force, as of a wrong gain, can't be told from them, and one of 4 often not; nor
can a radius for a diameter, which changes the force of a long cylinder little.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Protocol

import numpy as np
from scipy.special import ndtri

from legfem.common.errors import Doubt
from legfem.common.units import mpa_to_kpa
from legfem.data import ranges
from legfem.inverse.catalogue import key_of
from legfem.inverse.parameter import Prior
from legfem.inverse.population import CALF, SHIN, TISSUES, population, population_prior
from legfem.legs.subject import Subject

_OUTSIDE = float(ndtri(0.995))
"""Standard deviations of the logarithm beyond which one in a hundred people is."""
_USUAL = 2.0
"""Within which a unit explains it."""
_AT_SMALL_STRAIN = 0.5
"""Of C20, that a neo-Hookean C10 of the same force has more: 0.46 to 1.3 of it between Tables 4 and
5 of Frauziols et al. (2015)."""
_IN_FRONT = 0.5
"""Cosine of the angle between tibia and cylinder, above which a leg is pressed at its shin."""
_PLACES = {CALF: "calf", SHIN: "shin"}
_MOST_TOLD = 3
_UNITS = {
    "force_N": {"lbf": 4.448, "kgf": 9.807, "ozf": 0.278, "gf": 9.807e-3, "mN": 1e-3, "kN": 1e3},
    "displacement_mm": {"cm": 0.1, "inches": 1 / 25.4, "tenths of a mm": 10.0},
    "length_mm": {"cm": 0.1, "inches": 1 / 25.4},
}
"""By what a stiffness would change, about, were a column or size in another unit."""


class KnownParameter(Protocol):
    """A parameter as recordings say it, MPa."""

    @property
    def value(self) -> float:
        """Its value."""

    @property
    def standard_error(self) -> float:
        """How far that may be off."""


def doubts_about_stiffness(subject: Subject, parameters: Mapping[str, KnownParameter]) -> tuple[Doubt, ...]:
    """Return stiffnesses that nobody has found so, and those that few people have.

    Left out are those that the folder says were confirmed.
    """
    toml = subject.directory / "subject.toml"
    of_people = tuple(_doubts_beside_people(subject, parameters))
    said = {doubt.field for doubt in of_people}
    published = (
        doubt
        for name, one in parameters.items()
        if name.endswith(".C10") and key_of(name) not in (*said, *subject.confirmed)
        for doubt in ranges.C10[name.partition(".")[0]].likely(
            toml,
            key_of(name),
            mpa_to_kpa(one.value),
            "doubt the units of force_N, displacement_mm, length_mm and the other tissues' C10_kPa",
        )
    )
    return (*of_people, *published)


def _doubts_beside_people(subject: Subject, parameters: Mapping[str, KnownParameter]) -> Iterator[Doubt]:
    """Yield a doubt about each C10 that fewer than one in a hundred people have.

    What the recordings leave open of it counts as people's spread does.
    """
    site = SHIN if _at_shin(subject) else CALF
    for name in TISSUES:
        if name not in parameters or key_of(name) in subject.confirmed:
            continue
        one = parameters[name]
        stiffening = parameters.get(name.replace("C10", "C20"))
        found = one.value + (_AT_SMALL_STRAIN * stiffening.value if stiffening else 0.0)
        if found <= 0:
            continue
        usual = population_prior(name, site)
        sd = math.hypot(usual.sd, one.standard_error / found)
        away = math.log(found / usual.centre)
        if not abs(away) > _OUTSIDE * sd:
            continue
        low, high = (usual.centre * math.exp(k * _OUTSIDE * usual.sd) for k in (-1, 1))
        yield Doubt(
            str(subject.directory / "subject.toml"),
            key_of(name),
            f"{mpa_to_kpa(found):.3g} kPa is {'stiffer' if away > 0 else 'softer'} than in 99 of "
            f"100 people, {mpa_to_kpa(low):.2g} to {mpa_to_kpa(high):.2g} kPa at the "
            f"{_PLACES[site]} ({population().source})",
            "; ".join([*_explained(found, usual), "check units, gain and sizes"]),
        )


def _explained(found: float, usual: Prior) -> list[str]:
    """Return which units would make a stiffness (MPa) usual, the likeliest first."""
    told = []
    for column, units in _UNITS.items():
        for unit, factor in units.items():
            away, then = abs(usual.departure(factor * found)), mpa_to_kpa(factor * found)
            if away < _USUAL:
                told.append((away, f"{column} in {unit}, it would be some {then:.2g} kPa"))
    likeliest = [text for _, text in sorted(told)[:_MOST_TOLD]]
    return [f"were {', or '.join(likeliest)}"] if likeliest else []


def _at_shin(subject: Subject) -> bool:
    """Return whether the leg is pressed from where its tibia is."""
    tibia, skin = (subject.section.polygon(part).centroid for part in ("tibia", "skin"))
    front = np.array([tibia.x - skin.x, tibia.y - skin.y])
    return float(-subject.indenter.direction @ front) > _IN_FRONT * float(np.linalg.norm(front))
