"""A subject: one leg, how it was pressed, its tissues, and the recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, frozen_array
from legfem.geometry.section import LegSection
from legfem.recording import Instrument, Recording
from legfem.subjects.elastography import FibreRatio, ShearModulus

Law = Literal["neo-hookean", "reduced-polynomial"]
Origin = Literal["measured", "reconstructed", "simulated"]
IndenterShape = Literal["cylinder", "ball", "punch"]


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


@dataclass(frozen=True, eq=False)
class Indenter:
    """A rigid cylinder, ball or punch, and its line of travel."""

    radius: float
    """mm."""
    length: float
    """mm, of a cylinder along its axis; of a ball its diameter."""
    aim: FloatArray
    """(2,), mm: a point on the line of travel of the cylinder's axis."""
    direction_deg: float
    """Direction of travel, degrees counter-clockwise from +x."""
    shape: IndenterShape = "cylinder"
    """A punch is a cylinder that is pressed with its flat end."""
    axis_deg: float = 0.0
    """Of a cylinder, by which it is turned about its travel: 0 lies along the leg, 90 across."""

    def __post_init__(self) -> None:
        """Keep a read-only copy of the aim."""
        object.__setattr__(self, "aim", frozen_array(self.aim))

    @property
    def direction(self) -> FloatArray:
        """Unit vector of travel; (2,)."""
        angle = np.deg2rad(self.direction_deg)
        return np.array([np.cos(angle), np.sin(angle)])

    @property
    def lies_along(self) -> bool:
        """Whether it is a cylinder along the leg: a section in plane strain has no other."""
        return self.shape == "cylinder" and self.axis_deg % 180 == 0

    @property
    def extent(self) -> float:
        """How much of the leg's length it takes (mm)."""
        if self.shape != "cylinder":
            return 2 * self.radius
        turn = np.deg2rad(self.axis_deg)
        return float(self.length * abs(np.cos(turn)) + 2 * self.radius * abs(np.sin(turn)))

    def __str__(self) -> str:
        """Say what it is, as reports have it."""
        across = f"{2 * self.radius:g} mm in diameter"
        if self.shape == "ball":
            return f"ball, {across}"
        if self.shape == "punch":
            return f"flat punch, {across}"
        turn = self.axis_deg % 180
        words = {0.0: "", 90.0: ", across the leg"}
        lies = words.get(turn, f", turned by {turn:g}° from the leg's axis")
        return f"cylinder, {across} and {self.length:g} mm long{lies}"

    def check_lies_along(self, source: str) -> None:
        """Check that a section in plane strain can have it.

        Raises
        ------
        InputError
            For a ball, a punch or a cylinder that doesn't lie along the leg.
        """
        if not self.lies_along:
            raise InputError(
                source,
                "indenter",
                f"a {self} isn't there in a section in plane strain",
                "solve the leg in 3D: python -m legfem.identify --model 3d",
            )


@dataclass(frozen=True)
class LegAccuracy:
    """How well a leg is known, where its folder states it; None where it doesn't."""

    contour_sd: float | None = None
    """Of its outlines, mm."""
    aim_sd: float | None = None
    """Of the cylinder's line of travel, mm."""
    direction_sd: float | None = None
    """Of its direction, degrees."""
    assumed_sd: float | None = None
    """Relative, of what is assumed: stiffness of fat and fascia, compressibility."""

    @property
    def stated(self) -> bool:
        """Whether the folder says anything of it."""
        return self != LegAccuracy()


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
    """Of the leg's sites which; empty where there is but one."""
    elastography: tuple[ShearModulus, ...] = ()
    fibres: FibreRatio | None = None
    """Of the deep tissue, along the leg; None where nothing is known of them."""
    measured: tuple[MeasuredEffect, ...] = ()


@dataclass(frozen=True, eq=False)
class SitedLeg:
    """One leg that was pressed at several sites; see `load_sites`."""

    id: str
    title: str
    sites: tuple[Subject, ...]
    """Of the same tissues, each with its own section, indenter and recordings."""
    directory: Path

    @property
    def origin(self) -> Origin:
        """Of the data."""
        return self.sites[0].origin
