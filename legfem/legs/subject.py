"""A subject: one leg, how it was pressed, its tissues, and the recordings."""

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

from legfem.channels import Sight
from legfem.common.drawing import Pictured
from legfem.common.errors import Argument, InputError
from legfem.data import Instrument, Recording, Segmentation, segment_all
from legfem.data.recording import Origin
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import CALF, LegSection
from legfem.inverse import population
from legfem.inverse.accuracy import MeasuredEffect
from legfem.inverse.elastography import FibreRatio, ShearModulus
from legfem.inverse.parameter import Prior
from legfem.inverse.trial_noise import USUAL_AT_REST

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
    contact_sd: float | None = None
    """Standard deviation of first contact in all trials alike, mm, where they are stated to begin there."""
    rig_sd: float | None = None
    """Standard deviation of what the rig yields, mm/N."""

    @property
    def stated(self) -> bool:
        """Whether the folder says anything of the leg itself."""
        return replace(self, contact_sd=None, rig_sd=None) != LegAccuracy()


TYPICAL_ACCURACY = LegAccuracy(contour_sd=3.0, aim_sd=4.0, direction_sd=6.0)
"""Of a typical limb, where a diagnosis weighs what isn't known of a leg."""


@dataclass(frozen=True, eq=False, repr=False)
class Subject(Pictured):
    """Everything given about one leg; see ``load_subject``."""

    id: str
    title: str
    origin: Origin
    section: LegSection
    indenter: Indenter
    tissues: Mapping[str, TissueParameters]
    """Keys ``deep``, ``superficial``, ``fascia``, and muscles and groups that aren't taken as the deep tissue."""
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
    typical_shape: str = ""
    """Which typical limb's section of the measured girth and fat is taken, in place of the leg's own outlines."""

    @property
    def muscles(self) -> tuple[str, ...]:
        """Those, and groups of them, that have a stiffness of their own."""
        return tuple(name for name in (*self.section.groups, *self.section.muscles) if name in self.tissues)

    def with_muscles(self, parameters: Iterable[str]) -> "Subject":
        """Return the leg with those muscles apart from the deep tissue that full names of parameters ask for.

        Raises
        ------
        InputError
            If a group and one of its own muscles are asked for, or a muscle that there isn't but for its spelling.
        """
        asked, section = {name.partition(".")[0].lower() for name in parameters}, self.section
        named = (*section.groups, *section.muscles)
        for group, muscle in ((one, each) for one, own in section.groups.items() for each in own):
            if {group, muscle} <= asked:
                problem = f"is asked for, and so is {group}, a group that it is in"
                raise InputError(Argument("identify"), muscle, problem, "name the group or its muscles")
        others = {name: tissue for name, tissue in self.tissues.items() if name not in named}
        for wrong in asked - {*named, *others}:
            if near := difflib.get_close_matches(wrong, named, 1):
                raise InputError(Argument("identify"), wrong, "is no muscle of the leg", f"did you mean {near[0]}?")
        return replace(self, tissues={**others, **dict.fromkeys((n for n in named if n in asked), others["deep"])})

    @property
    def people(self) -> str:
        """Site of the population's table that the leg is compared with."""
        return population.CALF if self.section.limb == CALF else population.ANYWHERE

    @property
    def at_rest(self) -> float:
        """Least slow error of the force, over the greatest: of a living leg."""
        return USUAL_AT_REST if self.origin == "measured" else 0.0

    @cached_property
    def trials(self) -> tuple[Segmentation, ...]:
        """The recordings as they are read: first contact, phases and noise of each."""
        return segment_all(self.recordings, self.instrument, self.starts_at_contact)

    @property
    def sights(self) -> tuple[Sight, ...]:
        """Places at which channels were read, which a model is to be seen at, too."""
        every = (one for recording in self.recordings for one in recording.channels if one.places)
        return tuple(dict.fromkeys(Sight(one.name, one.places) for one in every))


@dataclass(frozen=True, eq=False, repr=False)
class SitedLeg(Pictured):
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
