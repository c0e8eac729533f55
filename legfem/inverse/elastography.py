"""Shear-wave elastography of a leg: entries of its file, priors of stiffnesses, and the muscle fibres' ratio."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from legfem.common.errors import Doubt
from legfem.common.input_files import FileTable, Positive, Text, Trouble
from legfem.common.units import kpa_to_mpa, mpa_to_kpa
from legfem.data.ranges import RANGES
from legfem.inverse.answer import FitNotice, Notice
from legfem.inverse.parameter import Prior

Waved = Literal["deep", "superficial"]
Plane = Literal["across", "along"]
HIGHEST_RATIO = 8.0
"""Largest ratio of shear moduli at which fibres are tabulated."""
_FEW_SD = 2.0
_DISAGREES = 2.0
"""Standard deviations that two ways of measuring shouldn't lie apart."""


class ElastographyEntry(FileTable):
    """One of ``[[elastography]]``."""

    tissue: Waved
    plane: Plane
    """In which the wave ran and moved the tissue: across the leg, or along it."""
    shear_modulus_kPa: Positive
    sd_kPa: Positive
    source: Text = "shear-wave elastography"


@dataclass(frozen=True)
class ShearModulus:
    """A tissue's shear modulus in one plane, measured by shear waves."""

    tissue: Waved
    plane: Plane
    value: float
    """MPa."""
    sd: float
    """MPa."""
    source: str

    @property
    def C10(self) -> float:
        """Of a law with this shear modulus, 2 C10, at small strain (MPa)."""
        return self.value / 2

    @classmethod
    def of(cls, entry: ElastographyEntry) -> "ShearModulus":
        """Return what an entry of the file says."""
        value, sd = kpa_to_mpa(entry.shear_modulus_kPa), kpa_to_mpa(entry.sd_kPa)
        return cls(entry.tissue, entry.plane, value, sd, entry.source)


@dataclass(frozen=True)
class FibreRatio:
    """Shear modulus of muscle along the leg over that across."""

    value: float
    """At least 1."""
    sd: float
    """Zero where it was stated without."""
    provenance: Literal["measured", "prior", "assumed"]
    """By shear waves, or stated with its error, or stated as exact."""
    source: str

    def __str__(self) -> str:
        """Return it with its error, as reports show it."""
        return f"{self.value:.3g}{f' ± {self.sd:.2g}' if self.sd else ''}"


StatedRatio = Annotated[float, Field(ge=1.0, le=HIGHEST_RATIO, allow_inf_nan=False)]


def elastography_troubles(entries: Sequence[ElastographyEntry], ratio_stated: bool) -> Iterator[Trouble]:
    """Yield what is said twice, and fibres that are known in one plane alone, or by their ratio too."""
    seen: dict[tuple[str, str], int] = {}
    for number, entry in enumerate(entries):
        # Fat is alike in all directions.
        plane = entry.plane if entry.tissue == "deep" else "any plane"
        if (entry.tissue, plane) in seen:
            remedy = "give the mean of the measurements, with its standard deviation"
            yield f"elastography.{number}", f"the {entry.tissue} tissue in {plane} is given twice", remedy
        seen[entry.tissue, plane] = number
    along, across = (seen.get(("deep", plane)) for plane in ("along", "across"))
    if along is None:
        return
    if across is None:
        remedy = "give the deep tissue across the leg too: the two make the fibres' ratio"
        yield f"elastography.{along}.plane", "along the leg without across says nothing of C10", remedy
    if ratio_stated:
        problem = "is given beside elastography along and across"
        yield "tissues.deep.fibre_ratio", problem, "leave it out: the two make the ratio"


def fibre_ratio(moduli: Sequence[ShearModulus], stated: float | None, stated_sd: float | None) -> FibreRatio | None:
    """Return the fibres' ratio: measured along and across, else as stated; None where unknown."""
    by_plane = {one.plane: one for one in moduli if one.tissue == "deep"}
    if len(by_plane) == 2:
        along, across = by_plane["along"], by_plane["across"]
        value, relative = _quotient(along, across)
        sources = " and ".join(dict.fromkeys((along.source, across.source)))
        value = min(max(value, 1.0), HIGHEST_RATIO)
        return FibreRatio(value, value * relative, "measured", sources)
    if stated is None:
        return None
    provenance: Literal["prior", "assumed"] = "prior" if stated_sd else "assumed"
    return FibreRatio(stated, stated_sd or 0.0, provenance, "subject.toml")


def doubts_about_elastography(toml: Path, moduli: Sequence[ShearModulus]) -> Iterator[Doubt]:
    """Yield what is unlikely in it.

    Raises
    ------
    InputError
        For moduli that no soft tissue has.
    """
    for number, one in enumerate(moduli):
        field = f"elastography.{number}"
        value = mpa_to_kpa(one.value)
        yield from RANGES["shear_modulus"].doubts(toml, f"{field}.shear_modulus_kPa", value)
        if one.sd > one.value:
            yield Doubt(str(toml), f"{field}.sd_kPa", "is larger than the modulus itself", "check the units of both")
    by_plane = {one.plane: one for one in moduli if one.tissue == "deep"}
    if len(by_plane) < 2:
        return
    value, relative = _quotient(by_plane["along"], by_plane["across"])
    low, high = (value * (1 + side * _FEW_SD * relative) for side in (-1, 1))
    problem = f"the deep tissue's moduli make a ratio of {value:.2g} along the leg to across"
    problem += f", which is taken as {min(max(value, 1.0), HIGHEST_RATIO):g}"
    remedy = "check which plane is which: muscle is stiffer along its fibres"
    found = Doubt(str(toml), "elastography", problem, remedy)
    if high < 1.0 or low > HIGHEST_RATIO:
        raise found.error()
    if not 1.0 <= value <= HIGHEST_RATIO:
        yield found


def _quotient(along: ShearModulus, across: ShearModulus) -> tuple[float, float]:
    """Return the moduli's ratio and its relative error."""
    return along.value / across.value, math.hypot(along.sd / along.value, across.sd / across.value)


def elastography_priors(moduli: Iterable[ShearModulus]) -> dict[str, Prior]:
    r"""Return priors of stiffnesses (MPa), by full name.

    At small strain the shear modulus of every law here is :math:`2 C_{10}`, of muscle with fibres
    that across them.
    """
    return {
        f"{one.tissue}.C10": Prior(one.C10, one.sd / 2, "linear", one.source)
        for one in moduli
        if one.tissue == "superficial" or one.plane == "across"
    }


def disagreement(
    name: str, prior: Prior, value: float, standard_error: float, found_by: str = "indentation"
) -> Iterator[Notice]:
    r"""Say that a stiffness found with a prior from elastography is far from that.

    Where both are right, an optimum departs from a prior of standard deviation :math:`s_0` by one
    of :math:`\sqrt{s_0^2 - s^2}`, with its own error s.

    Parameters
    ----------
    name
        Full name, of a stiffness in MPa as all numbers here.
    found_by
        What the stiffness was found from, with the prior.
    """
    if not standard_error < prior.sd:
        return
    apart = (value - prior.centre) / math.sqrt(prior.sd**2 - standard_error**2)
    if abs(apart) > _DISAGREES:
        higher, lower = (found_by, "elastography") if apart > 0 else ("elastography", found_by)
        known = {"source": prior.source, "centre": prior.centre, "sd": prior.sd}
        said = {"name": name, "higher": higher, "lower": lower, "departure": abs(apart), **known}
        yield Notice.of(FitNotice.ELASTOGRAPHY_DISAGREES, **said)
