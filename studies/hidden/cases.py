"""The cases: a drawn leg, an effect of drawn size, a programme, and a lab's recordings with drawn errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.geometry.indenter import first_touch
from legfem.geometry.section import first_crossing
from legfem.inverse.mechanism import Solution
from legfem.inverse.responses import Stopped
from legfem.jobs.key import Contents
from legfem.jobs.store import Store
from legfem.legs.subject import Subject
from legfem.legs.variants import LegVariants
from legfem.solve.protocol import Protocol
from studies.concealed.cases import DEPTH_MM as FORMS_DEPTH_MM
from studies.concealed.cases import SealedLeg, sealed_leg
from studies.concealed.forms import NAMED, ON_COURSE, OUTSIDE_ON_COURSE, Pressed
from studies.concealed.truth import TRUTH_SETTINGS, leg_of
from studies.lab.recording import INSTRUMENT, SAMPLING_HZ, Course, record
from studies.lab.stated import drawn_errors
from studies.other_code import plane_leg, pressing
from studies.other_code.plane_leg import Lump, OtherCase, OtherCode

type Programme = Literal["loading", "holds"]

DEPTH_MM, TRIALS = 15.0, 3
PROGRAMMES: Mapping[Programme, Protocol] = {
    "loading": Protocol.ramp(DEPTH_MM, 0.4),
    "holds": Protocol.cycle(DEPTH_MM, 1.0, 60.0),
}
_STEP_MM, _POINTS = 0.8, 401
_MORE = 0.05
"""Of the muscle's stiffness: what is more of the force for it is the muscle's own part."""
BRANCHES_S = (0.6, 5.0, 40.0, 300.0)
"""Times of a relaxing muscle; none is one of the diagnosis'."""


@dataclass(frozen=True)
class Effect:
    """What was concealed.

    Parameters
    ----------
    lump
        Depth of its middle below the fascia, half-axes along the travel and across, factor, side.
    factors, friction, sliding
        See `studies.other_code.plane_leg.OtherCase`.
    tilt
        Of the travel about first touch, degrees.
    relaxing
        Stress of every branch of the muscle (`BRANCHES_S`) over the lasting one.
    permeability, skeleton
        Of a muscle whose fluid drains, see `legfem.mechanics.terms.Drainage`.
    first_trial, outside
        What acts on recorded courses, see `studies.concealed.forms`: excess, fading and grading of a stiffer first
        trial; one that no mechanism describes, with its size.
    """

    lump: tuple[float, float, float, float, float] | None = None
    factors: tuple[tuple[str, float], ...] = ()
    friction: float | None = None
    sliding: float | None = None
    tilt: float = 0.0
    relaxing: tuple[float, ...] = ()
    permeability: float = 0.0
    skeleton: float = 0.0
    first_trial: tuple[float, float, float] | None = None
    outside: tuple[str, float] | None = None


def _between(generator: np.random.Generator, low: float, high: float) -> float:
    """Return a number between two, evenly in its logarithm."""
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


def _relaxing(generator: np.random.Generator) -> Effect:
    shares = np.array(BRANCHES_S) ** -float(generator.uniform(0.0, 0.3))
    ratios = _between(generator, 0.15, 0.8) * shares / shares.sum()
    return Effect(
        factors=(("fascia", _between(generator, 4.0, 15.0)),), relaxing=tuple(float(ratio) for ratio in ratios)
    )


def _lump(generator: np.random.Generator) -> Effect:
    across, along = _between(generator, 5.0, 15.0), _between(generator, 4.0, 8.0)
    depth, side = along + float(generator.uniform(1.0, 12.0)), float(generator.uniform(-10.0, 10.0))
    return Effect(lump=(depth, along, across, _between(generator, 3.0, 10.0), side))


def _fat(generator: np.random.Generator) -> Effect:
    factor = _between(generator, 1.6, 4.0) ** generator.choice([-1, 1])
    return Effect(factors=(("superficial", float(factor)),))


def _two(generator: np.random.Generator) -> Effect:
    """Return the fat and one more."""
    fat, more = _fat(generator), str(generator.choice(["fascia", "slip", "tilt"]))
    if more == "fascia":
        return replace(fat, factors=(*fat.factors, ("fascia", _between(generator, 4.0, 15.0))))
    return replace(KINDS[more].drawn(generator), factors=fat.factors)


def _first_trial(generator: np.random.Generator) -> Effect:
    fading, grading = generator.uniform(0.0, 0.6), generator.uniform(-0.4, 0.4)
    return Effect(first_trial=(_between(generator, 0.06, 0.2), float(fading), float(grading)))


_UNNAMED = tuple(name for name in OUTSIDE_ON_COURSE if name not in NAMED)


def _outside(generator: np.random.Generator) -> Effect:
    return Effect(outside=(str(generator.choice(_UNNAMED)), float(generator.uniform(0.5, 1.5))))


@dataclass(frozen=True)
class Kind:
    """A kind of effect: how it is drawn, the names that are right for it, and whether only time shows it."""

    drawn: Callable[[np.random.Generator], Effect]
    names: tuple[str, ...]
    needs_time: bool = False


KINDS: Mapping[str, Kind] = {
    "none": Kind(lambda _: Effect(), ()),
    "lump": Kind(_lump, ("uneven-muscle",)),
    "fat": Kind(_fat, ("superficial-stiffness",)),
    "tilt": Kind(lambda g: Effect(tilt=float(g.choice([-1, 1]) * g.uniform(5.0, 11.0))), ("indenter-tilt",)),
    "slip": Kind(lambda g: Effect(friction=_between(g, 0.03, 0.25)), ("contact-slip",)),
    "sliding fat": Kind(lambda g: Effect(sliding=float(g.choice([0.0, 0.05]))), ("fat-sliding",)),
    "drainage": Kind(
        lambda g: Effect(permeability=_between(g, 50.0, 1500.0), skeleton=_between(g, 0.01, 0.1)),
        ("poroelastic-drainage",),
        True,
    ),
    "relaxation, stiff fascia": Kind(_relaxing, ("viscoelasticity", "fascia-stiffness"), True),
    "fat and another": Kind(_two, ("superficial-stiffness", "fascia-stiffness", "contact-slip", "indenter-tilt")),
    "first trial": Kind(_first_trial, ("preconditioning",)),
    "outside": Kind(_outside, ()),
}
STIFFNESS_KPA = 0.5, 1.8


@dataclass(frozen=True)
class HiddenCase:
    """One set of recordings; C10 and C20 in kPa."""

    number: int
    leg: int
    kind: str
    programme: Programme
    true_c10: float
    true_c20: float
    effect: Effect

    @property
    def name(self) -> str:
        """For progress and pages."""
        return f"{self.number}: leg {self.leg + 1}, {self.programme}, {self.kind}"


def cases_of(number: int, legs: int, seed: int) -> list[HiddenCase]:
    """Return drawn cases, every kind about as often and two nulls for each other kind."""
    generator = np.random.default_rng([seed, 37])
    kinds = ["none", *KINDS]
    found: list[HiddenCase] = []
    while len(found) < number:
        for kind in generator.permutation(kinds):
            own = KINDS[str(kind)]
            leg = int(generator.integers(legs))
            programme: Programme = "holds" if own.needs_time or generator.random() < 0.5 else "loading"
            c10, c20 = _between(generator, *STIFFNESS_KPA), 0.0
            if sealed_leg(leg, seed).true.tissues["deep"].law != "neo-hookean":
                c20 = c10 * float(generator.uniform(0.3, 2.0))
            found.append(HiddenCase(len(found) + 1, leg, str(kind), programme, c10, c20, own.drawn(generator)))
    return found[:number]


@dataclass(frozen=True)
class SolvedCurve:
    """A force (N) at evenly spaced displacements, or times; empty where the code stopped."""

    force: list[float]


@dataclass(eq=False)
class Recorder:
    """Makes recordings of cases; the other code's solutions are kept on disk.

    Parameters
    ----------
    out
        Of what is kept.
    seed
        Of legs and errors.
    """

    out: Path
    seed: int
    _legs: dict[int, SealedLeg] = field(default_factory=dict, repr=False)

    def subject(self, case: HiddenCase) -> Subject | None:
        """Return the leg as it is stated, with recordings; None where the other code stopped."""
        leg = self._leg(case.leg)
        protocol = PROGRAMMES[case.programme]
        time = np.append(np.arange(0.0, protocol.duration - 1e-9, 1 / SAMPLING_HZ), protocol.duration)
        d = protocol.displacement_at(time)
        force = self._drained(case, time) if case.effect.permeability else self._elastic(case, time, d)
        if force is None:
            return None
        generator = np.random.default_rng([self.seed, 38, case.number])
        courses = [Course(time, d, _as_pressed(case.effect, k, time, d, force)) for k in range(TRIALS)]
        trials = record(courses, drawn_errors(generator), generator)
        # In air to begin with, and a section's force times a length, whatever the leg's own folder says of its tests.
        return replace(
            leg.stated,
            recordings=tuple(trials),
            instrument=INSTRUMENT,
            starts_at_contact=False,
            plane_strain=True,
            plane_strain_stated=True,
        )

    def _leg(self, number: int) -> SealedLeg:
        if number not in self._legs:
            self._legs[number] = sealed_leg(number, self.seed)
        return self._legs[number]

    def _elastic(self, case: HiddenCase, time: FloatArray, d: FloatArray) -> FloatArray | None:
        """Return the force at times; where the muscle relaxes, with what its part of it did before."""
        whole = self._curve(case, 1.0)
        if whole is None:
            return None
        force = whole(d)
        if case.effect.relaxing:
            stiffer = self._curve(case, 1.0 + _MORE)
            if stiffer is None:
                return None
            muscle = (stiffer(d) - force) / _MORE
            for tau, ratio in zip(BRANCHES_S, case.effect.relaxing, strict=True):
                force = force + ratio * _remembered(time, muscle, tau)
        return np.asarray(force)

    def _curve(self, case: HiddenCase, factor: float) -> CubicSpline | None:
        effect = replace(case.effect, relaxing=(), first_trial=None, outside=None)
        c10, c20 = factor * case.true_c10, factor * case.true_c20
        store = Store(self.out / "curves", SolvedCurve, (leg_of(self._leg(case.leg).true), *_CODE))
        asked = [DEPTH_MM, c10, c20, repr(effect)]
        force = store.get_or_make(asked, lambda: self._solved(case, effect, c10, c20)).force
        return CubicSpline(np.linspace(0.0, DEPTH_MM, len(force)), force) if force else None

    def _solved(self, case: HiddenCase, effect: Effect, c10: float, c20: float) -> SolvedCurve:
        leg = self._leg(case.leg).true
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
        friction = np.inf if effect.friction is None else effect.friction
        other = OtherCase(c10, c20, factors=dict(effect.factors), friction=friction, lump=lump, sliding=effect.sliding)
        curve = OtherCode(leg, other).solve(DEPTH_MM, _STEP_MM)
        if not curve.reached:
            return SolvedCurve([])
        at = np.linspace(0.0, DEPTH_MM, _POINTS)
        return SolvedCurve([float(v) for v in CubicSpline(curve.displacement, curve.force)(at)])

    def _drained(self, case: HiddenCase, time: FloatArray) -> FloatArray | None:
        """Return the force of a muscle that drains, by legfem on another discretisation; None where that stopped."""
        store = Store(self.out / "drained", SolvedCurve, leg_of(self._leg(case.leg).true), ("legfem.legs.variants",))
        found = store.get_or_make([case.true_c10, case.true_c20, repr(case.effect)], lambda: self._porous(case, time))
        return np.array(found.force) if found.force else None

    def _porous(self, case: HiddenCase, time: FloatArray) -> SolvedCurve:
        from legfem.legs.experiments import tissues_of

        leg = self._leg(case.leg).true
        variants = LegVariants(leg.section, leg.indenter, tissues_of(leg), TRUTH_SETTINGS)
        deep = {"deep.C10": kpa_to_mpa(case.true_c10), "deep.C20": kpa_to_mpa(case.true_c20)}
        numbers = {f"deep.drainage.{name}": getattr(case.effect, name) for name in ("permeability", "skeleton")}
        path = variants.follow(PROGRAMMES[case.programme], deep, Solution("porous", numbers))
        if isinstance(path, Stopped):
            return SolvedCurve([])
        return SolvedCurve([float(v) for v in path.force_at(time)])


def _as_pressed(effect: Effect, trial: int, time: FloatArray, d: FloatArray, force: FloatArray) -> FloatArray:
    """Return a trial's force (n,) with what acts on its course; depths of forms are shares of theirs."""
    pressed = Pressed(trial, time, d * (FORMS_DEPTH_MM / DEPTH_MM), force, _no_other, _no_other)
    if effect.first_trial is not None:
        given = dict(zip(("strength", "fading", "grading"), effect.first_trial, strict=True))
        return ON_COURSE["preconditioning"](pressed, given)
    if effect.outside is not None:
        name, size = effect.outside
        return OUTSIDE_ON_COURSE[name](pressed, size)
    return force


def _no_other(at: FloatArray) -> FloatArray:
    return np.ones_like(at)


_CODE = Contents(Path(plane_leg.__file__)), Contents(Path(pressing.__file__))
"""What a solution of the other code depends on, with the leg; not on legfem."""


def _remembered(time: FloatArray, course: FloatArray, tau: float) -> FloatArray:
    """Return what a branch of one relaxation time bears of a course (n,) that begins at nothing."""
    found = np.zeros(len(time))
    steps = np.diff(time)
    fades = np.exp(-steps / tau)
    for k, (fade, rise, step) in enumerate(zip(fades, np.diff(course), steps, strict=True)):
        found[k + 1] = fade * found[k] + rise * (1 - fade) * tau / step
    return found
