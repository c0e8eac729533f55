"""The cases: a leg, an effect that felupe solves, a programme, and a lab's recordings of it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.common.units import FloatArray
from legfem.geometry.section import first_crossing
from legfem.jobs.store import Store
from legfem.legs.loading import load_subject
from legfem.legs.subject import Subject
from legfem.solve.protocol import Protocol
from studies.lab.recording import INSTRUMENT, SAMPLING_HZ, Course, LabErrors, record
from studies.other_code.plane_leg import Lump, OtherCase, OtherCode

type Programme = Literal["loading", "holds"]

DEPTH_MM, TRIALS = 15.0, 3
PROGRAMMES: Mapping[Programme, Protocol] = {
    "loading": Protocol.ramp(DEPTH_MM, 0.4),
    "holds": Protocol.cycle(DEPTH_MM, 1.0, 60.0),
}
LEGS: Mapping[str, tuple[float, float]] = {"neo-hookean": (0.75, 0.0), "reduced-polynomial": (0.6, 0.7)}
"""True C10 and C20 (kPa) by the folder of the cross-check."""
ERRORS = LabErrors(gain_sd=0.007)
_STEP_MM, _POINTS = 0.8, 401


@dataclass(frozen=True)
class Effect:
    """What was concealed.

    Parameters
    ----------
    lump
        Depth of its middle below the fascia, half-axes along the travel and across, factor, side.
    factors, friction
        See `studies.other_code.plane_leg.OtherCase`.
    tilt
        Of the travel about first touch, degrees.
    """

    lump: tuple[float, float, float, float, float] | None = None
    factors: tuple[tuple[str, float], ...] = ()
    friction: float = np.inf
    tilt: float = 0.0


EFFECTS: Mapping[str, Effect] = {
    "none": Effect(),
    **{
        f"lump {2 * across:g} x {2 * along:g} mm, {depth:g} mm deep, x {factor:g}": Effect(
            lump=(depth, along, across, factor, 0.0)
        )
        for along, across, depth, factor in (
            (5.0, 10.0, 8.0, 10.0),
            (5.0, 10.0, 8.0, 3.0),
            (5.0, 10.0, 16.0, 10.0),
            (6.0, 6.0, 10.0, 10.0),
            (7.0, 15.0, 12.0, 5.0),
        )
    },
    "lump 20 x 10 mm, 10 mm deep, 10 mm aside, x 10": Effect(lump=(10.0, 5.0, 10.0, 10.0, 10.0)),
    "fat x 2.5": Effect(factors=(("superficial", 2.5),)),
    "fat x 0.4": Effect(factors=(("superficial", 0.4),)),
    "tilt 5 degrees": Effect(tilt=5.0),
    "tilt 10 degrees": Effect(tilt=-10.0),
    "slip": Effect(friction=0.05),
}
NULLS = 4
"""Draws of a lab's errors of recordings without effect; of the others there is one."""


@dataclass(frozen=True)
class HiddenCase:
    """One set of recordings."""

    leg: str
    programme: Programme
    effect: str
    turn: int = 0

    @property
    def name(self) -> str:
        """For progress and pages."""
        return f"{self.leg}, {self.programme}: {self.effect}" + (f", {self.turn + 1}" if self.turn else "")

    @property
    def true_c10(self) -> float:
        """Half the shear modulus of the deep tissue, kPa."""
        return LEGS[self.leg][0]


def cases_of(legs: Sequence[str], programmes: Sequence[Programme]) -> list[HiddenCase]:
    """Return the cases; a leg's nulls come first, about whose stiffness its library is made."""
    return [
        HiddenCase(leg, programme, effect, turn)
        for leg in legs
        for programme in programmes
        for effect in EFFECTS
        for turn in range(NULLS if effect == "none" else 1)
    ]


@dataclass(frozen=True)
class SolvedCurve:
    """The force (N) of one loading at evenly spaced displacements; empty where the code stopped."""

    force: list[float]


@dataclass(eq=False)
class Recorder:
    """Makes recordings of cases; felupe's solutions are kept on disk.

    Parameters
    ----------
    crosscheck
        Folder of the legs.
    out
        Of what is kept.
    seed
        Of a lab's errors.
    """

    crosscheck: Path
    out: Path
    seed: int
    _legs: dict[str, Subject] = field(default_factory=dict, repr=False)

    def subject(self, case: HiddenCase) -> Subject | None:
        """Return the leg as it is stated, with recordings; None where the other code stopped."""
        leg = self._leg(case.leg)
        force = self._force(case)
        if len(force) == 0:
            return None
        protocol = PROGRAMMES[case.programme]
        time = np.append(np.arange(0.0, protocol.duration - 1e-9, 1 / SAMPLING_HZ), protocol.duration)
        d = protocol.displacement_at(time)
        course = Course(time, d, np.asarray(CubicSpline(np.linspace(0.0, DEPTH_MM, len(force)), force)(d)))
        digest = hashlib.sha256(case.name.encode()).digest()
        generator = np.random.default_rng([self.seed, int.from_bytes(digest[:8], "big")])
        trials = record([course] * TRIALS, ERRORS, generator)
        return replace(leg, recordings=tuple(trials), instrument=INSTRUMENT)

    def _leg(self, name: str) -> Subject:
        if name not in self._legs:
            self._legs[name] = load_subject(self.crosscheck / name, need_recordings=False)
        return self._legs[name]

    def _force(self, case: HiddenCase) -> FloatArray:
        effect = EFFECTS[case.effect]
        store = Store(self.out / "curves", SolvedCurve, case.leg, ("studies.other_code.plane_leg",))
        asked = [DEPTH_MM, *LEGS[case.leg], effect.lump, effect.factors, effect.friction, effect.tilt]
        return np.array(store.get_or_make(asked, lambda: self._solved(case.leg, effect)).force)

    def _solved(self, name: str, effect: Effect) -> SolvedCurve:
        from legfem.meshing.section import first_touch

        leg = self._leg(name)
        indenter, skin = leg.indenter, leg.section.skin
        touch = np.asarray(first_touch(skin, indenter.radius, indenter.aim, indenter.direction))
        lump = None
        if effect.lump is not None:
            depth, along, across, factor, side = effect.lump
            fascia = first_crossing(leg.section.polygon("fascia").exterior, touch, indenter.direction)
            lump = Lump(fascia - indenter.radius + depth, along, across, factor, side)
        if effect.tilt:
            turned = replace(indenter, aim=touch, direction_deg=indenter.direction_deg + effect.tilt)
            leg = replace(leg, indenter=turned)
        c10, c20 = LEGS[name]
        other = OtherCase(c10, c20, factors=dict(effect.factors), friction=effect.friction, lump=lump)
        curve = OtherCode(leg, other).solve(DEPTH_MM, _STEP_MM)
        if not curve.reached:
            return SolvedCurve([])
        at = np.linspace(0.0, DEPTH_MM, _POINTS)
        return SolvedCurve([float(v) for v in CubicSpline(curve.displacement, curve.force)(at)])
