"""Bars at three rates with long holds, of memories that aren't the ones that are fitted."""

from __future__ import annotations

from collections.abc import Callable
from math import gamma
from pathlib import Path

import numpy as np
from making_specimens import BAR, compressed
from scipy.integrate import solve_ivp

from legfem.data import Recording, write_recording
from legfem.mechanics.materials import ExponentialStiffening

LAW = ExponentialStiffening(0.6e-3, 1.0, C20=0.0, stiffening=1.2e-3, exponent=2.0)
DEPTH, HOLD = 3.0, 300.0
RATES = {"fast": 0.6, "middle": 6.0, "slow": 60.0}
"""Seconds of loading."""

type Memory = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""What time (s), elastic force (N) and displacement (mm) make of the force (N)."""


def power_law(time: np.ndarray, elastic: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Quasi-linear: 1 + 3 (1 + t / 0.1 s)^-0.25, which never ends."""
    start = 0.1
    return elastic + 3.0 * _hereditary(time, elastic, lambda t: start / 0.75 * ((1 + t / start) ** 0.75 - 1))


def fractional(time: np.ndarray, elastic: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """A spring beside a springpot of order 0.2: 1 + 2.5 t^-0.2 / gamma(0.8)."""
    order = 0.2
    return elastic + 2.5 * _hereditary(time, elastic, lambda t: t ** (1 - order) / gamma(2 - order))


def strain_dependent(time: np.ndarray, elastic: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Two branches that relax up to five times faster the more they are strained."""
    force = elastic.copy()
    for ratio, slow in ((2.0, 2.0), (1.0, 60.0)):
        kept = 0.0
        for k in range(1, len(time)):
            step = time[k] - time[k - 1]
            tau = slow * np.exp(-np.log(5.0) * displacement[k] / DEPTH)
            fade = np.exp(-step / tau)
            kept = fade * kept + tau * (1 - fade) / step * (elastic[k] - elastic[k - 1])
            force[k] += ratio * kept
    return force


def stress_activated(time: np.ndarray, elastic: np.ndarray, displacement: np.ndarray) -> np.ndarray:
    """Two branches whose dashpots yield: they relax as the hyperbolic sine of what they bear."""
    ratios, slow = np.array([2.0, 1.0]), np.array([8.0, 120.0])
    bears = 0.25 * ratios * float(elastic.max())
    slope = np.diff(elastic) / np.diff(time)

    def rate(now: float, held: np.ndarray) -> np.ndarray:
        rise = slope[min(int(np.searchsorted(time, now, side="right")) - 1, len(slope) - 1)]
        return ratios * rise - bears / slow * np.sinh(held / bears)

    span = (float(time[0]), float(time[-1]))
    made = solve_ivp(rate, span, [0.0, 0.0], "LSODA", time, rtol=1e-6, atol=1e-9)
    return np.asarray(elastic + made.y.sum(axis=0))


MEMORIES: dict[str, Memory] = {
    "power law": power_law,
    "fractional": fractional,
    "strain-dependent": strain_dependent,
    "stress-activated": stress_activated,
}


def _hereditary(time: np.ndarray, elastic: np.ndarray, integral: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Integrate a relaxation, given as its integral over time, with a force straight by pieces."""
    slope = np.diff(elastic) / np.diff(time)
    since = np.maximum(time[:, None] - time[None, :], 0.0)
    return (integral(since[:, :-1]) - integral(since[:, 1:])) @ slope


def write_rates(folder: Path, memory: Memory, seed: int = 1, sampled: float = 20.0) -> Path:
    """Write three rates as a lab has them.

    The drive rounds its corners; recordings start in contact, but for some hundredths of a mm;
    each is off by a gain (3 %), a zero and a drift, has noise of 0.5 % and steps of 0.1 %.
    """
    generator = np.random.default_rng(seed)
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    (folder / "specimen.toml").write_text(BAR)
    for name, duration in RATES.items():
        step = min(1 / sampled, duration / 60)
        time = np.arange(0.0, duration, step)
        time = np.concatenate([time, np.arange(duration, duration + HOLD, max(step, 0.1))])
        way = np.minimum(time / duration, 1.0)
        corner = 0.02
        rounded = way - np.where(way > 1 - corner, np.clip(way - 1 + corner, 0, corner) ** 2 / (2 * corner), 0.0)
        displacement = DEPTH * rounded / rounded.max()
        elastic = compressed(LAW, displacement)
        force = memory(time, elastic, displacement)
        peak = float(force.max())
        force = force * (1 + generator.normal(0, 0.03)) + peak * generator.normal(0, 0.003)
        force += peak * generator.normal(0, 0.005) * time / time[-1]
        force += generator.normal(0, 0.005 * peak, len(time))
        unit = 1e-3 * peak
        read = displacement + generator.normal(0, 0.03) + generator.normal(0, 0.003, len(time))
        write_recording(
            Recording(time, read, np.round(force / unit) * unit, name), folder / "recordings" / f"{name}.csv"
        )
    return folder
