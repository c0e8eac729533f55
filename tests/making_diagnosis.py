"""A leg's responses in closed form and recordings of it, for tests of the diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.data import Instrument, Recording, segment_all
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.errors import error_model
from legfem.inverse.fit import Identity
from legfem.inverse.library import NO_CHANNELS, ChannelTables, Detail, NuisanceChanges
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem
from legfem.inverse.map_fit import fit
from legfem.inverse.mechanism import strength
from legfem.inverse.observations import Observations, observe
from legfem.inverse.predictor import Predictor
from legfem.inverse.responses import Acting, Columns
from legfem.inverse.stations import Stations
from legfem.inverse.trial_noise import Noise
from legfem.legs.finite_element_models import LegVariants, plane_strain_test
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.mechanisms import Mechanism, Stiffness, mechanism_named, mechanisms
from legfem.mechanisms.rig import ForceDrift
from legfem.mechanisms.time_dependence import TIMES_S, TissueRelaxation
from legfem.solve.protocol import Protocol

SOUGHT = tuple(
    mechanism_named(name) for name in ("contact-onset", "force-drift", "preconditioning", "support-compliance")
)


MADE = Identity("closed", "a closed form", "simulated")
INSTRUMENT = Instrument(force_sd=0.03, displacement_sd=0.01)
NOISE = Noise(0.02, 0.02, 12.0, 0.02, 0.008, "made")
GRID = np.arange(0.5, 20.6, 0.5)
TRUTH = {DEEP_C10: 0.001, DEEP_C20: 0.0008}


def force_at(c10: float, c20: float, displacement: FloatArray) -> FloatArray:
    """Return the closed form of a stiffness (MPa): forces of a first, a second and a fourth power, N."""
    x = np.maximum(displacement, 0.0) / 20
    return np.asarray(1e4 * (c10 * (x + x**2) + 0.3e-3 * x + 2.0 * c20 * x**4))


def fat(displacement: FloatArray) -> FloatArray:
    """Return the relative change of the force by that of the fat's stiffness."""
    return np.asarray(0.2 * np.exp(-8 * displacement / 20))


def relaxed(stations: Stations, time: FloatArray, tau: float) -> FloatArray:
    """Return a spring and dashpot's displacement behind a protocol's, at times; mm."""
    total = np.zeros(len(time))
    ends, at = np.array(stations.protocol.time), np.array(stations.protocol.displacement)
    for first, last, rate in zip(ends[:-1], ends[1:], np.diff(at) / np.diff(ends), strict=True):
        until = np.clip(time, first, last)
        total += (
            rate * tau * (np.exp(np.minimum(until - time, 0.0) / tau) - np.exp(np.minimum(first - time, 0.0) / tau))
        )
    return total


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """Responses of no leg in particular; passes for a library of solved ones."""

    grid: FloatArray = field(default_factory=GRID.copy)
    c10_bounds: tuple[float, float] = (5e-5, 0.02)
    c20_bounds: tuple[float, float] = (0.0, 0.02)
    missing: Mapping[str, str] = field(default_factory=dict)
    """Mechanisms that aren't tested, and why."""
    nuisances: NuisanceChanges = field(default_factory=lambda: NuisanceChanges(GRID, {}, {}))
    detail: Detail = field(default_factory=lambda: Detail.of_all(mechanisms()))
    beside: ChannelTables = NO_CHANNELS

    def curve(self, c10: FloatArray, c20: FloatArray) -> FloatArray:
        """Return the forces (k, m), N."""
        return np.array([force_at(*one, self.grid) for one in zip(c10, c20, strict=True)])

    def elastic_courses(self, at: Stiffness) -> Columns:
        """Return the forces (m,) of a stiffness."""
        return {"force": force_at(*at, self.grid)}

    def relative_change(self, acting: Acting, at: Stiffness, observed: Observations) -> FloatArray:
        """Return shapes, nothing at their nulls.

        They differ from mechanism to mechanism, but for those of a stiffer and of a tense fascia.
        """
        (mechanism, values), x = acting, observed.displacement / 20
        if isinstance(mechanism, TissueRelaxation):
            change = np.empty(len(x))
            for number, stations in enumerate(observed.protocols):
                here = observed.protocol == number
                branches = [relaxed(stations, observed.time[here], tau) for tau in TIMES_S]
                change[here] = mechanism.shares(values) @ np.array(branches)
                change[here] /= np.maximum(observed.displacement[here], 1e-9)
            return change
        shapes = {
            "strain-stiffening": x**6,
            "compressibility": -0.15 * np.exp(-3 * x),
            "fascia-stiffness": 0.15 * np.cos(2 * x),
            "prestress": 1.5e-3 * np.cos(2 * x),
            "superficial-stiffness": fat(observed.displacement),
            "indenter-tilt": 0.002 * np.sin(6 * x),
        }
        strength = next(iter(values.values()))
        first = mechanism.parameters[0]
        if first.scale == "log":
            strength = np.log(strength)
        return strength * shapes.get(mechanism.name, np.zeros(len(x)))

    def nuisances_beside(self, present: object) -> NuisanceChanges:
        """Return the nuisances, which no mechanism alters."""
        return self.nuisances

    def pair_change(self, pair: object, stiffness: Stiffness) -> Columns:
        """Return nothing: two effects act each as if alone."""
        return {}


def two_rates(repeats: int = 3) -> list[Recording]:
    """Return noiseless recordings of nothing: repeats at each of two rates."""
    return [
        _blank(Protocol.cycle(20.0, rate, hold=60.0), f"rate{rate:g}_{k + 1}")
        for rate in (0.4, 2.0)
        for k in range(repeats)
    ]


def one_at_each_rate() -> list[Recording]:
    """Return the same without repeats."""
    return two_rates(1)


def ramps(number: int = 3) -> list[Recording]:
    """Return noiseless recordings of nothing: slow loadings."""
    return [_blank(Protocol.ramp(20.0, 0.4), f"trial{k + 1}") for k in range(number)]


def _blank(protocol: Protocol, name: str) -> Recording:
    time = np.arange(0, protocol.duration + 1e-9, 0.1)
    return Recording(time, protocol.displacement_at(time), np.zeros(len(time)), name)


def pressed(
    airs: Sequence[float], gains: Sequence[float] | None = None, seed: int = 0, zeros: Sequence[float] | None = None
) -> list[Recording]:
    """Return recordings that begin in air: each trial reads (1 + gain) F(d - air) + zero.

    Parameters
    ----------
    airs
        mm before the skin in each trial. Every trial goes 20 mm deep.
    gains
        Relative, of each trial; none without it.
    seed
        Of white noise, 0.02 N and 0.005 mm.
    zeros
        N, of each trial; none without it.
    """
    generator = np.random.default_rng(seed)
    found = []
    for k, air in enumerate(airs):
        way = 20.0 + air
        time = np.arange(0, way / 0.4 + 1e-9, 0.1)
        at = 0.4 * time
        force = (1 + (gains[k] if gains else 0.0)) * force_at(TRUTH[DEEP_C10], TRUTH[DEEP_C20], at - air)
        force = force + (zeros[k] if zeros else 0.0) + 0.02 * generator.normal(size=len(time))
        found.append(Recording(time, at + 0.005 * generator.normal(size=len(time)), force, f"trial{k + 1}"))
    return found


def observations(recordings: list[Recording]) -> tuple[Observations, Predictor]:
    """Return empty observations, from first contact on, with a predictor for them."""
    observed = observe(segment_all(recordings, INSTRUMENT, True))
    observed = replace(
        observed, white_sd=NOISE.white_sd, white_variance=np.full(len(observed.force), NOISE.white_sd**2 / 8)
    )
    return observed, Predictor(observed, ClosedForm(), "reduced-polynomial")


def noisy(observed: Observations, force: FloatArray, seed: int) -> Observations:
    """Return observations of a force with drawn errors."""
    true = observed.with_force(force)
    errors = error_model(true, NOISE, force).draw(1, np.random.default_rng(seed))[0]
    return true.with_force(force + errors)


def problem_of(
    recordings: list[Recording],
    effects: Mapping[str, float] | None = None,
    seed: int = 0,
    extra: FloatArray | None = None,
) -> tuple[LinearisedProblem, LinearisedFit]:
    """Return a problem whose errors are known, and its base fit.

    Parameters
    ----------
    recordings
        Protocols.
    effects
        Values of mechanisms' parameters and trials' onsets by full name.
    seed
        Of the errors.
    extra
        (n,), N: what no mechanism makes.
    """
    observed, predictor = observations(recordings)
    force = predictor({**TRUTH, **(effects or {})}, mechanisms_in(effects or {}))
    seen = noisy(observed, force if extra is None else force + extra, seed)
    problem = LinearisedProblem(replace(predictor, observed=seen), error_model(seen, NOISE, force))
    return problem, fit(problem, (), {DEEP_C10: 0.0007, DEEP_C20: 0.0004})


class LinearDrift(ForceDrift):
    """A drift whose prior is normal, beside which a problem is linear."""

    parameters = (strength("rate", "N/s", "drift of the zero", 0.005, (-0.1, 0.1)),)


def mechanisms_in(effects: Mapping[str, float]) -> tuple[Mechanism, ...]:
    """Return the mechanisms that parameters are of."""
    names = dict.fromkeys(name.split(".")[0] for name in effects if not name.startswith("trial"))
    return tuple(mechanism_named(name) for name in names)


def coarse_leg() -> LegVariants:
    """Return subject 3's leg on a mesh coarse enough for tests."""
    subject = load_subject(SUBJECTS.find("3"), need_recordings=False)
    settings = PlaneStrainSettings(mesh=PlaneStrainSettings().mesh.refined(0.4))
    return LegVariants(plane_strain_test(subject, settings))
