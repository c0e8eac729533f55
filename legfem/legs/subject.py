"""A subject: one leg, how it was pressed, its tissues, the recordings, and shear-wave elastography of it."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from legfem.channels import Sight
from legfem.common.errors import Doubt
from legfem.common.input_files import FileTable, Positive, Text, trouble
from legfem.common.units import kpa_to_mpa, mpa_to_kpa
from legfem.data import Instrument, Recording, Segmentation, ranges, segment_all
from legfem.data.recording import Origin
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection
from legfem.inverse.parameter import Prior

Waved = Literal["deep", "superficial"]
Plane = Literal["across", "along"]
HIGHEST_RATIO = 8.0
"""Of shear moduli, up to which fibres are tabulated."""
_FEW_SD = 2.0


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
        error = f" ± {self.sd:.2g}" if self.sd else ""
        return f"{self.value:.3g}{error}"


StatedRatio = Annotated[float, Field(ge=1.0, le=HIGHEST_RATIO, allow_inf_nan=False)]


def check_once(entries: Sequence[ElastographyEntry], ratio_stated: bool) -> None:
    """Check that nothing is said twice, and that fibres are known in both planes or in none.

    Raises
    ------
    PydanticCustomError
        As a validator does.
    """
    seen: dict[tuple[str, str], int] = {}
    for number, entry in enumerate(entries):
        # Fat is alike in all directions.
        plane = entry.plane if entry.tissue == "deep" else "any plane"
        if (entry.tissue, plane) in seen:
            raise trouble(
                f"elastography.{number}",
                f"the {entry.tissue} tissue in {plane} is given twice",
                "give the mean of the measurements, with its standard deviation",
            )
        seen[entry.tissue, plane] = number
    along, across = (seen.get(("deep", plane)) for plane in ("along", "across"))
    if along is None:
        return
    if across is None:
        raise trouble(
            f"elastography.{along}.plane",
            "along the leg without across says nothing of C10",
            "give the deep tissue across the leg too: the two make the fibres' ratio",
        )
    if ratio_stated:
        raise trouble(
            "tissues.deep.fibre_ratio",
            "is given beside elastography along and across",
            "leave it out: the two make the ratio",
        )


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
        yield from ranges.SHEAR_MODULUS.doubts(toml, f"{field}.shear_modulus_kPa", value)
        if one.sd > one.value:
            yield Doubt(str(toml), f"{field}.sd_kPa", "is larger than the modulus itself", "check the units of both")
    by_plane = {one.plane: one for one in moduli if one.tissue == "deep"}
    if len(by_plane) < 2:
        return
    value, relative = _quotient(by_plane["along"], by_plane["across"])
    low, high = (value * (1 + side * _FEW_SD * relative) for side in (-1, 1))
    found = Doubt(
        str(toml),
        "elastography",
        f"the deep tissue's moduli make a ratio of {value:.2g} along the leg to across, which is "
        f"taken as {min(max(value, 1.0), HIGHEST_RATIO):g}",
        "check which plane is which: muscle is stiffer along its fibres",
    )
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


Law = Literal["neo-hookean", "reduced-polynomial"]


@dataclass(frozen=True)
class TissueParameters:
    """A tissue's strain energy; None is a parameter that isn't given (or the law has not)."""

    law: Law
    C10: float | None
    """MPa."""
    C20: float | None
    """MPa; None for neo-Hookean tissues."""
    D1: float
    """1/MPa."""
    D2: float | None
    """1/MPa; None leaves the (J - 1)^4 term out."""


@dataclass(frozen=True)
class LegAccuracy:
    """How well a leg is known, where its folder states it; None where it doesn't."""

    contour_sd: float | None = None
    """Standard deviation of its outlines, mm."""
    aim_sd: float | None = None
    """Standard deviation of the cylinder's line of travel, mm."""
    direction_sd: float | None = None
    """Standard deviation of its direction, degrees."""
    assumed_sd: float | None = None
    """Relative, of what is assumed: stiffness of fat and fascia, compressibility."""

    @property
    def stated(self) -> bool:
        """Whether the folder says anything of it."""
        return self != LegAccuracy()


TYPICAL_FORCE_SD = 0.06
"""Relative, of the force of a typical calf of a leg's girth and fat, pressed from behind: 4 % over usual proportions of
calves, sizes measured to 5 mm and 0.8 mm (fourteen drawn calves); 0 to 7 % on one real leg's outlines at three levels
(BodyParts3D)."""
TYPICAL_ACCURACY = LegAccuracy(contour_sd=3.0, aim_sd=4.0, direction_sd=6.0)
"""Of a typical calf, where a diagnosis weighs what isn't known of a leg."""


@dataclass(frozen=True)
class MeasuredEffect:
    """How strong an effect is that a model may leave out, by other means than the indenter."""

    effect: str
    """Name of a mechanism."""
    value: float
    """In the unit of the mechanism's strength."""
    sd: float
    source: str


@dataclass(frozen=True, eq=False)
class Subject:
    """Everything given about one leg; see ``load_subject``."""

    id: str
    title: str
    origin: Origin
    section: LegSection
    indenter: Indenter
    tissues: Mapping[str, TissueParameters]
    """Keys ``deep``, ``superficial``, ``fascia``."""
    instrument: Instrument
    recordings: tuple[Recording, ...]
    """One a trial; empty when loaded without recordings."""
    directory: Path
    starts_at_contact: bool = False
    """Whether the recordings' displacement is known to count from first touch."""
    plane_strain: bool = False
    """Whether the recordings come from a plane-strain model: they know no end effects."""
    plane_strain_stated: bool = False
    """Whether the folder says so, rather than that no leg was measured."""
    accuracy: LegAccuracy = LegAccuracy()
    confirmed: tuple[str, ...] = ()
    """Fields of subject.toml, or columns, that are unusual and right."""
    cut_from: str = ""
    """File and plane, where the section was cut from a scan."""
    landmark_residual: float | None = None
    """Root mean square of what registered landmarks are apart, mm; None without any."""
    site: str = ""
    """Name among the leg's sites; empty where there is but one."""
    elastography: tuple[ShearModulus, ...] = ()
    fibres: FibreRatio | None = None
    """Ratio of the deep tissue's fibres, along the leg; None where nothing is known of them."""
    measured: tuple[MeasuredEffect, ...] = ()
    stiffness_prior: Prior | None = None
    """Of C10 of the deep tissue (MPa), for a diagnosis: of people like this one."""
    typical_shape: bool = False
    """Whether the section is a typical calf's of the measured girth and fat, in place of the leg's own outlines."""

    @cached_property
    def trials(self) -> tuple[Segmentation, ...]:
        """The recordings as they are read: first contact, phases and noise of each."""
        return segment_all(self.recordings, self.instrument, self.starts_at_contact)

    @property
    def sights(self) -> tuple[Sight, ...]:
        """Places at which channels were read, which a model is to be seen at, too."""
        every = (one for recording in self.recordings for one in recording.channels if one.places)
        return tuple(dict.fromkeys(Sight(one.name, one.places) for one in every))


@dataclass(frozen=True, eq=False)
class SitedLeg:
    """One leg that was pressed at several sites; see `load_sites`."""

    id: str
    title: str
    sites: tuple[Subject, ...]
    """Sites of the same tissues, each with its own section, indenter and recordings."""
    directory: Path

    @property
    def origin(self) -> Origin:
        """Origin of the data."""
        return self.sites[0].origin
