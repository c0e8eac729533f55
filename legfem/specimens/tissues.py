"""The tissues of a specimen: one, or layers on each other, and what is stated of each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from legfem.common.units import kpa_to_mpa
from legfem.inverse.catalogue import RATIO, LawName
from legfem.inverse.fibre_ratio import USUAL_RATIO
from legfem.mechanics.materials import ExponentialStiffening, Hyperelastic, NeoHookean, ReducedPolynomial, Yeoh
from legfem.specimens.schema import FibresEntry, LayerEntry, SpecimenFile

ONE = "deep"
"""What the tissue of a specimen of one is called, as the leg's that is identified."""

REFERENCE_MPA = 0.01
"""Stiffness C10 at which a test is solved before anything is known."""
BULK_RATIO = 1000.0
"""Bulk over shear modulus of what is called incompressible."""
KINDS: dict[LawName, type[Hyperelastic]] = {
    "neo-hookean": NeoHookean,
    "reduced-polynomial": ReducedPolynomial,
    "yeoh": Yeoh,
    "exponential": ExponentialStiffening,
}


def bulk_ratio(poisson_ratio: float | None) -> float:
    """Return the bulk over the shear modulus at small strain."""
    if poisson_ratio is None:
        return BULK_RATIO
    return 2 * (1 + poisson_ratio) / (3 * (1 - 2 * poisson_ratio))


def specimen_law(name: LawName, c10: float, poisson_ratio: float | None) -> Hyperelastic:
    """Return a law at a stiffness C10 (MPa), without stiffening."""
    ratio = bulk_ratio(poisson_ratio)
    kind = KINDS[name]
    plain = NeoHookean(c10, 1 / (ratio * c10))
    return plain if kind is NeoHookean else kind(**{"C20": 0.0, **plain.parameters})


@dataclass(frozen=True)
class SpecimenTissue:
    """What is given of a tissue.

    Parameters
    ----------
    name : str
        By which its parameters are called.
    law : str, optional
        The one that is asked for without it.
    poisson_ratio : float, optional
        At small strain; a bulk modulus of 1000 shear moduli without it.
    stated : Mapping[str, float]
        Numbers of its law that aren't looked for, MPa, and the ratio of its fibres.
    fibrous : bool
        Whether it is stiffer along its fibres.
    """

    name: str = ONE
    law: LawName | None = None
    poisson_ratio: float | None = None
    stated: Mapping[str, float] = field(default_factory=dict)
    fibrous: bool = False

    @property
    def fibre_ratio(self) -> float:
        """Shear modulus along the fibres over that across: as stated, or a usual one."""
        return self.stated.get(RATIO, USUAL_RATIO)

    @property
    def bulk_ratio(self) -> float:
        """Bulk over shear modulus at small strain."""
        return bulk_ratio(self.poisson_ratio)

    def of_law(self, name: LawName) -> SpecimenTissue:
        """Return the tissue with the law that is asked for, unless it has its own."""
        return self if self.law else replace(self, law=name)

    def at(self, c10: float) -> Hyperelastic:
        """Return its law at a stiffness C10 (MPa) if none is stated."""
        plain = specimen_law(self.law or "neo-hookean", self.stated.get("C10", c10), self.poisson_ratio)
        known = plain.parameters
        return replace(plain, **{n: v for n, v in self.stated.items() if n in known})  # type: ignore[type-var]


def tissues_of(given: SpecimenFile) -> tuple[SpecimenTissue, ...]:
    """Return a file's tissues, from the base up."""
    poisson_ratio = given.tissue.poisson_ratio
    if not given.layers:
        one = SpecimenTissue(poisson_ratio=poisson_ratio)
        return (one if given.fibres is None else _with_fibres(one, given.fibres),)
    every = (_layer(entry, poisson_ratio) for entry in reversed(given.layers))
    fibres = given.fibres
    return tuple(_with_fibres(one, fibres) if fibres is not None and fibres.layer == one.name else one for one in every)


def _with_fibres(tissue: SpecimenTissue, fibres: FibresEntry) -> SpecimenTissue:
    known = {} if fibres.ratio is None else {RATIO: fibres.ratio}
    return replace(tissue, stated={**tissue.stated, **known}, fibrous=True)


def _layer(entry: LayerEntry, poisson_ratio: float | None) -> SpecimenTissue:
    stated = {"C10": entry.C10_kPa, "C20": entry.C20_kPa}
    law: LawName | None = entry.law
    if law is None and stated["C20"] is not None:
        law = "reduced-polynomial"
    elif law is None and stated["C10"] is not None:
        law = "neo-hookean"
    own = poisson_ratio if entry.poisson_ratio is None else entry.poisson_ratio
    return SpecimenTissue(entry.name, law, own, {n: kpa_to_mpa(v) for n, v in stated.items() if v is not None})


def begin_at(tissues: Sequence[SpecimenTissue], usual: float) -> float:
    """Return the stiffness C10 (MPa) to begin at: about what is stated, else the usual one."""
    stated = [math.log(one.stated["C10"]) for one in tissues if "C10" in one.stated]
    return math.exp(sum(stated) / len(stated)) if stated else usual
