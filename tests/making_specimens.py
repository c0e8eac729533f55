"""Folders of specimens whose tissue is known, from closed forms and other laws than fitted."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from legfem.data import Recording, write_recording
from legfem.inverse.fit import Fit
from legfem.mechanics.materials import Hyperelastic, ReducedPolynomial
from legfem.specimens.details import RecordingFit, SpecimenDetails, compared

LENGTH, AREA = 10.0, 100.0
BAR = """\
id = "bar"
title = "Made for a test"
origin = "simulated"

[uniaxial]
direction = "compression"
length_mm = 10.0
area_mm2 = 100.0

[recordings]
starts_at_contact = true
"""
PLANTED = ReducedPolynomial(5e-3, 1.0, C20=3e-3)
BRANCHES = ((1.2, 0.3), (0.8, 4.0), (0.5, 60.0), (0.3, 400.0))
"""Ratios and times (s) of a tissue that relaxes; no log-normal spectrum."""


def left_out(fit: Fit[SpecimenDetails]) -> list[RecordingFit]:
    """Return the recordings that a fit was to predict, beside their prediction."""
    return [one for one in compared(fit) if not one.fitted]


def compressed(law: Hyperelastic, displacement: np.ndarray, sign: float = -1.0) -> np.ndarray:
    """Force (N) on an incompressible bar: 2 (l - l^-2) dW/dI1 on its area; l = 1 + sign d / L."""
    stretch = 1 + sign * displacement / LENGTH
    slope = law.distortion_slope(stretch**2 + 2 / stretch - 3)
    return sign * AREA * 2 * slope * (stretch - stretch**-2)


def ramp(depth: float, duration: float, hold: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return times and displacements of a loading, 120 samples, and a hold with 4 a second."""
    time = np.linspace(0.0, duration, 121)
    if hold:
        time = np.concatenate([time, np.arange(duration + 0.25, duration + hold, 0.25)])
    return time, depth * np.minimum(time / duration, 1.0)


def relaxing(elastic: np.ndarray, time: np.ndarray, branches: Sequence = BRANCHES) -> np.ndarray:
    """Add what branches bear of an elastic force's history, step by step."""
    total = elastic.copy()
    for ratio, tau in branches:
        kept = 0.0
        for k in range(1, len(time)):
            step = time[k] - time[k - 1]
            fade = np.exp(-step / tau)
            kept = fade * kept + tau * (1 - fade) / step * (elastic[k] - elastic[k - 1])
            total[k] += ratio * kept
    return total


def crept(law: Hyperelastic, force: np.ndarray, time: np.ndarray, branches: Sequence = BRANCHES) -> np.ndarray:
    """Return the displacement of a bar that relaxes, under a force's history, step by step."""
    ratio, tau = np.array(branches).T
    kept, before, way = np.zeros(len(tau)), 0.0, [0.0]
    for k in range(1, len(time)):
        fade = np.exp(-(time[k] - time[k - 1]) / tau)
        share = tau * (1 - fade) / (time[k] - time[k - 1])
        # What the elastic part has to bear, then how far that is.
        elastic = (force[k] - ratio @ (fade * kept - share * before)) / (1 + ratio @ share)
        kept, before = fade * kept + share * (elastic - before), elastic
        way.append(brentq(lambda d, e=elastic: compressed(law, d) - e, -1e-3, 0.7 * LENGTH))
    return np.array(way)


def record(folder: Path, name: str, time: np.ndarray, d: np.ndarray, force: np.ndarray) -> None:
    """Write a recording with 2 mN of noise."""
    drawn = np.random.default_rng([*name.encode(), round(1e3 * float(np.ptp(force)))])
    noise = drawn.normal(0.0, 2e-3, len(force))
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    write_recording(Recording(time, d, force + noise, name), folder / "recordings" / f"{name}.csv")


def write_bars(folder: Path, law: Hyperelastic, toml: str = BAR, hold: float = 0.0) -> Path:
    """Write a folder with three rates: 0.6, 6 and 60 s to 3 mm, relaxing if they hold."""
    for name, duration in (("fast", 0.6), ("middle", 6.0), ("slow", 60.0)):
        time, d = ramp(3.0, duration, hold)
        force = compressed(law, d)
        record(folder, name, time, d, relaxing(force, time) if hold else force)
    (folder / "specimen.toml").write_text(toml)
    return folder
