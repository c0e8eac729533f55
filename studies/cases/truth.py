"""What a case's leg really did: legfem on another discretisation, or another code.

legfem's truths come from a finer mesh, the exponential contact law, smaller steps and another
quadrature than the diagnosis uses. Finite-element solutions are kept on disk.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.channels import Sight
from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.jobs.store import Store
from legfem.legs.finite_element_models import LegVariants
from legfem.legs.subject import Subject
from legfem.mechanics.contact import ContactSettings
from legfem.mechanisms import Solution, TissueMechanism, mechanism_named
from legfem.meshing.section import SectionMeshSettings
from legfem.solve.protocol import Protocol
from legfem.solve.settings import StepSettings
from studies.cases.forms import BRANCHES_S, ON_COURSE, OUTSIDE_ON_COURSE, Pressed
from studies.cases.sealed_case import DEPTH_MM, SealedCase
from studies.making.recording import SAMPLING_HZ, Course

FINE = PlaneStrainSettings(
    mesh=SectionMeshSettings(0.85, 0.16, 5.0, 2.2),
    contact=ContactSettings(normal="exponential", stiffness=3000.0, onset=0.01),
    steps=StepSettings(first=0.1, largest=0.8),
    quadrature_degree=5,
)
"""Another discretisation than the one that inverts."""
TRUTH_SETTINGS = replace(
    FINE,
    contact=ContactSettings(normal="exponential", stiffness=2000.0, onset=0.02),
    steps=StepSettings(first=0.15, largest=1.2),
)
ELASTIC_RATE = 1.0
"""mm/s, of a loading whose force knows no rate."""
LUMPS = {"hard-lump": (14.0, 6.0, 6.0, 10.0, 0.0), "tendon": (17.0, 2.5, 9.0, 10.0, 7.0)}
"""Distance of the middle from first touch along the travel (mm), half-axes along it and across (mm), how many times as
stiff as the muscle, and how far aside (mm); half-axes are times the root of a case's size."""
TAKES_WAY = ("support-compliance", "rig-bends")
_OTHER_STEP_MM = 0.8
_FINE = 401
"""Points of a segment that are kept."""


@dataclass(frozen=True)
class ForceCourse:
    """A solution's force (N) and further channels at times (s) of its protocol; empty where it stopped."""

    time: list[float]
    force: list[float]
    channels: dict[str, list[float]] = field(default_factory=dict)

    @classmethod
    def of(cls, time: FloatArray, force: FloatArray, channels: Mapping[str, FloatArray] | None = None) -> ForceCourse:
        """Return the course of arrays (n,)."""
        beside = {name: [float(v) for v in values] for name, values in (channels or {}).items()}
        return cls([float(v) for v in time], [float(v) for v in force], beside)


@dataclass(eq=False)
class Truths:
    """Simulates cases on one true leg; it is meshed and compiled when first asked for.

    Parameters
    ----------
    leg
        The true leg.
    folder
        Of solutions.
    sights
        Places of the true leg at which channels are read.
    """

    leg: Subject
    folder: Path
    sights: tuple[Sight, ...] = ()
    _variants: dict[str, LegVariants] = field(default_factory=dict, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave finite-element models out."""
        return {**self.__dict__, "_variants": {}}

    def of(self, case: SealedCase, protocols: Sequence[Protocol]) -> tuple[Course, ...] | None:
        """Return what a case's leg did; None where a solution stopped.

        Parameters
        ----------
        case
            The case.
        protocols
            One a trial, none deeper than `DEPTH_MM`.
        """
        plain = self._elastic(case, {})
        models = {protocol: self._model_force(case, protocol) for protocol in protocols}
        if plain is None:
            return None
        grid, forces = np.array(plain.time) * ELASTIC_RATE, np.array(plain.force)

        def elastic(at: FloatArray) -> FloatArray:
            return np.asarray(np.interp(at, grid, forces))

        effects = {name: dict(values) for name, values in case.effects}
        trials = []
        for k, protocol in enumerate(protocols):
            model = models[protocol]
            if model is None:
                return None
            # To the end of the protocol exactly: `shortened` looks there for the deepest point.
            time = np.append(np.arange(0.0, protocol.duration - 1e-9, 1 / SAMPLING_HZ), protocol.duration)
            d = protocol.displacement_at(time)
            pressed = np.interp(time, model.time, model.force)
            trial = Pressed(k, time, d, pressed, elastic)
            for name, act in ON_COURSE.items():
                if name in effects and not _in_model(case, name):
                    trial = replace(trial, force=act(trial, effects[name]))
            for name, size in case.outside:
                if name in OUTSIDE_ON_COURSE:
                    trial = replace(trial, force=OUTSIDE_ON_COURSE[name](trial, size))
            # What takes up a part of the way leaves the leg as it is at the rest of it.
            moves = any(name in TAKES_WAY and not _in_model(case, name) for name in (*effects, *dict(case.outside)))
            at, seen = time, model
            if moves and not _along_path(effects):
                curve = self._elastic(case, _effects_inside(case))
                assert curve is not None, "the model's course is of this curve"
                at, seen = np.interp(trial.force, curve.force, curve.time), curve
            beside = {name: np.interp(at, seen.time, values) for name, values in seen.channels.items()}
            trials.append(Course(time, d, trial.force, beside))
        return tuple(trials)

    def _model_force(self, case: SealedCase, protocol: Protocol) -> ForceCourse | None:
        """Return the force along a protocol with the effects that are in the model."""
        inside = _effects_inside(case)
        timed = protocol if _along_path(inside) else None
        if timed is not None and case.code == "legfem":
            return self._solved(case, inside, timed)
        curve = self._elastic(case, inside)
        if curve is None:
            return None
        time = np.linspace(0.0, protocol.duration, 4 * round(protocol.duration) + 1)
        d = protocol.displacement_at(time)
        grid = np.array(curve.time) * ELASTIC_RATE
        beside = {name: np.interp(d, grid, values) for name, values in curve.channels.items()}
        return ForceCourse.of(time, np.interp(d, grid, curve.force), beside)

    def _elastic(self, case: SealedCase, effects: dict[str, dict[str, float]]) -> ForceCourse | None:
        return self._solved(case, effects, Protocol.ramp(DEPTH_MM, ELASTIC_RATE))

    def _solved(self, case: SealedCase, effects: dict[str, dict[str, float]], protocol: Protocol) -> ForceCourse | None:
        modules = ("studies.making.plane_leg" if case.code == "felupe" else "legfem.experiments.plane_strain",)
        store = Store(self.folder, ForceCourse, [*leg_of(self.leg), list(self.sights), LUMPS], modules)
        asked = [
            case.code,
            case.c10_kpa,
            case.c20_kpa,
            sorted([name, sorted(values.items())] for name, values in effects.items()),
            list(protocol.time),
            list(protocol.displacement),
        ]
        made = self._by_other_code if case.code == "felupe" else self._by_legfem
        found = store.get_or_make(asked, lambda: made(case, effects, protocol))
        return found if found.time else None

    def _by_legfem(self, case: SealedCase, effects: dict[str, dict[str, float]], protocol: Protocol) -> ForceCourse:
        deep = {"deep.C10": kpa_to_mpa(case.c10_kpa), "deep.C20": kpa_to_mpa(case.c20_kpa)}
        settings, solution = TRUTH_SETTINGS, Solution()
        for name, v in effects.items():
            mechanism = mechanism_named(name, self.leg.section)
            assert isinstance(mechanism, TissueMechanism)
            first, more = mechanism.parameters[0].name, Solution()
            if name == "contact-slip":
                contact = replace(settings.contact, tangential="coulomb", friction=v["strength"])
                settings = replace(settings, contact=contact)
            elif name == "viscoelasticity":
                more = _branches(mechanism.region, mechanism.variant, v)  # type: ignore[attr-defined]
            else:
                rest = {key: value for key, value in v.items() if key != "strength"}
                more = mechanism.solution({first: v["strength"], **rest})
            joined = solution.joined(more)
            assert joined is not None, f"no model shows {', '.join(effects)}"
            solution = joined
        variants = self._variants.setdefault(repr(settings.contact), self._made(settings))
        solved = variants.follow(protocol, deep, solution)
        if not solved.report.complete:
            return ForceCourse([], [])
        parts = [np.linspace(a, b, _FINE)[:-1] for a, b in pairwise(protocol.time)]
        time = np.concatenate([*parts, [protocol.duration]])
        return ForceCourse.of(time, solved.path.force_at(time), solved.path.channels_at(time))

    def _made(self, settings: Any) -> LegVariants:
        from legfem.legs.finite_element_models import plane_strain_test

        return LegVariants(replace(plane_strain_test(self.leg, settings), sights=self.sights))

    def _by_other_code(self, case: SealedCase, effects: dict[str, dict[str, float]], protocol: Protocol) -> ForceCourse:
        from studies.making.plane_leg import OtherCode

        curve = OtherCode(self.leg, _other_case(case, effects), sights=self.sights).solve(DEPTH_MM, _OTHER_STEP_MM)
        if not curve.reached:
            return ForceCourse([], [])
        d = np.linspace(0.0, DEPTH_MM, _FINE)
        force = CubicSpline(curve.displacement, curve.force)(d)
        beside = {name: CubicSpline(curve.displacement, own)(d) for name, own in curve.channels.items()}
        return ForceCourse.of((d / ELASTIC_RATE), force, beside)


def _other_case(case: SealedCase, effects: dict[str, dict[str, float]]) -> Any:
    from studies.making.plane_leg import Lump, OtherCase

    def strength(name: str) -> float | None:
        return effects.get(name, {}).get("strength")

    factors = {
        "superficial": strength("superficial-stiffness") or 1.0,
        "fascia": strength("fascia-stiffness") or 1.0,
        "deep": strength("compressibility") or 1.0,
    }
    friction, compliance = strength("contact-slip"), strength("support-compliance")
    lumps = []
    for name, (distance, along, across, factor, side) in LUMPS.items():
        if name in effects:
            root = float(np.sqrt(effects[name]["size"]))
            lumps = [Lump(distance, root * along, root * across, factor, side)]
    return OtherCase(
        case.c10_kpa,
        case.c20_kpa,
        (0.0, 1.0),
        factors,
        np.inf if friction is None else friction,
        # Two bones share the force.
        None if compliance is None else 0.5 / compliance,
        lumps,
        0.0 if "fat-sliding" in effects else None,
    )


def _effects_inside(case: SealedCase) -> dict[str, dict[str, float]]:
    """Return the numbers of the effects that are solved by finite elements."""
    inside = {name: dict(v) for name, v in case.effects if _in_model(case, name)}
    return inside | {name: {"size": s} for name, s in case.outside if name in LUMPS}


def _in_model(case: SealedCase, name: str) -> bool:
    """Tell whether an effect is solved by finite elements."""
    springs = name == "support-compliance" and case.code == "felupe"
    return springs or name not in ON_COURSE


def _along_path(effects: dict[str, dict[str, float]]) -> bool:
    """Tell whether a solution has to follow the protocol."""
    return any(name in ("viscoelasticity", "poroelastic-drainage", "contact-slip") for name in effects)


def _branches(region: str, variant: str, v: dict[str, float]) -> Solution:
    """Return a spectrum of branches whose shares are a power of their time."""
    shares = np.array(BRANCHES_S) ** -v["power"]
    shares /= shares.sum()
    given: dict[str, float] = {}
    for k, (time, share) in enumerate(zip(BRANCHES_S, shares, strict=True)):
        name = f"{region}.viscoelasticity{k + 1}"
        given |= {f"{name}.ratio": v["strength"] * float(share), f"{name}.relaxation_time": time}
    return Solution(variant, given)


def leg_of(leg: Subject) -> list[object]:
    """Return all that a solution on a leg depends on."""
    indenter = leg.indenter
    return [
        *(leg.section.contour(part) for part in ("skin", "fascia", "tibia", "fibula")),
        leg.section.fascia_thickness,
        [indenter.radius, indenter.length, indenter.aim.tolist(), indenter.direction_deg],
        [repr(leg.tissues[name]) for name in sorted(leg.tissues)],
    ]
