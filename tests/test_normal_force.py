"""Normal force of a twisted cylinder, the load cell's second axis: its model, its weight in a fit, and relaxation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import legfem as lf
from legfem.channels.kinds.normal_force import NORMAL_FORCE
from legfem.experiments.bodies import TwistedCylinder
from legfem.experiments.torsion import TorsionTest
from legfem.mechanics.materials import NeoHookean

RADIUS, HEIGHT, C10 = 12.5, 6.0, 5e-3
BODY = TwistedCylinder(RADIUS, HEIGHT)
TOML = """\
id = "gel"
title = "Made for a test"
origin = "simulated"
[torsion]
diameter_mm = 25.0
height_mm = 6.0
[recordings]
starts_at_contact = true
"""
RATIO, TAU = 0.6, 14.0


def loads(time: np.ndarray, angle: np.ndarray, relaxes: bool) -> tuple[np.ndarray, np.ndarray]:
    """Torque (N mm) and normal force (N) of a neo-Hookean cylinder, with one branch that relaxes."""
    twist = angle / HEIGHT
    torque = np.pi * C10 * twist * RADIUS**4
    every = []
    for elastic in (torque, 0.5 * twist * torque):
        held = np.zeros_like(elastic)
        for k in range(1, len(time)):
            # The branch's own equation by the midpoint rule, in steps that are short against its time.
            step = (time[k] - time[k - 1]) / TAU
            held[k] = (held[k - 1] * (1 - step / 2) + elastic[k] - elastic[k - 1]) / (1 + step / 2)
        every.append(elastic + (RATIO * held if relaxes else 0.0))
    return every[0], every[1]


def written(folder: Path, normal: bool = True, relaxes: bool = False, factor: float = 1.0) -> Path:
    """Write a folder with a recording to 0.4 rad in 8 s, and a hold if it relaxes."""
    time = np.arange(0.0, 48.0 if relaxes else 8.001, 0.05)
    angle = np.minimum(0.05 * time, 0.4)
    rng = np.random.default_rng(3)
    torque, push = loads(time, angle, relaxes)
    columns = {"time_s": time, "angle_rad": angle, "torque_Nmm": torque + rng.normal(0.0, 0.3, len(time))}
    if normal:
        columns["normal_force_N"] = factor * push + rng.normal(0.0, 0.01, len(time))
    (folder / "recordings").mkdir(parents=True)
    table = np.column_stack(list(columns.values()))
    np.savetxt(folder / "recordings/a.csv", table, "%.6f", ",", header=",".join(columns), comments="")
    (folder / "specimen.toml").write_text(TOML)
    return folder


def test_it_is_half_the_twist_times_the_torque_and_its_derivative_a_difference() -> None:
    """Another code's is within 5 % of that: test_torsion.py."""
    curve = TorsionTest(BODY, NeoHookean(C10, 1.0)).solve(None, 0.4, ["deep.C10"]).curve
    angle = np.array([0.1, 0.2, 0.4])
    known = 0.5 * angle / HEIGHT * np.pi * C10 * angle / HEIGHT * RADIUS**4
    assert curve.channel(NORMAL_FORCE.name, angle) == pytest.approx(known, rel=1e-6)
    assert curve.interpolated(curve.channel_sensitivities[NORMAL_FORCE.name]["deep.C10"], angle) == pytest.approx(
        known / C10, rel=1e-6
    )


@pytest.mark.parametrize("relaxes", [False, True])
def test_it_is_weighed_with_the_torque(tmp_path: Path, relaxes: bool) -> None:
    found = {}
    for normal in (False, True):
        folder = written(tmp_path / str(normal), normal, relaxes)
        found[normal] = lf.identify(lf.load_specimen(folder), "neo-hookean")["neo-hookean"]
    fit, alone = found[True], found[False]
    estimate = fit.estimates["deep.C10"]
    print({name: (one.value, one.ci95) for name, one in fit.estimates.items()}, estimate.information_shares)
    assert estimate.ci95[0] < C10 < estimate.ci95[1]
    assert 0.0 < estimate.information_shares[NORMAL_FORCE.name] < 1.0
    assert not alone.estimates["deep.C10"].information_shares
    (push,) = fit.tests[0].channels[1:]
    assert push.channel.name == NORMAL_FORCE.name and push.rms < 0.02 and push.channel.values.max() > 0.3
    assert fit.goodness.fits


@pytest.mark.parametrize("factor", [-1.0, 0.2])
def test_one_that_contradicts_the_torque_is_doubted_and_not_weighed(tmp_path: Path, factor: float) -> None:
    specimen = lf.load_specimen(written(tmp_path / "gel", factor=factor))
    assert [one.field for one in specimen.doubts] == ["normal_force_N"] and "isn't weighed" in str(specimen.doubts[0])
    assert not specimen.recordings[0].recording.channels


def test_its_stated_accuracy_counts(tmp_path: Path) -> None:
    folder = written(tmp_path / "gel")
    (folder / "specimen.toml").write_text(f"{TOML}[channels.normal_force]\nsd_N = 0.05\ngain_percent = 2.0\n")
    (one,) = lf.load_specimen(folder).recordings[0].recording.channels
    assert (one.accuracy.reading, one.accuracy.gain) == (0.05, 0.02)
