"""Specimens of one law, each with a stiffness of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from making_specimens import BAR, PLANTED, compressed, ramp, record

import legfem as lf
from legfem.inverse.fit import Fit
from legfem.specimens.details import RecordingFit, compared, rms_percent
from legfem.specimens.nuisances import OwnStiffness


def left_out(fit: Fit) -> list[RecordingFit]:
    """Return the recordings that a fit predicts."""
    return [one for one in compared(fit) if not one.fitted]


def test_specimens_of_differing_stiffness_tell_one_law(tmp_path: Path) -> None:
    """The deepest are of the softest: taken together they would hide how the tissue stiffens."""
    factors = {"a": 1.8, "b": 1.2, "c": 0.8, "d": 0.5}
    bars = BAR
    for (name, factor), depth in zip(factors.items(), (1.5, 2.0, 3.0, 4.0), strict=True):
        time, d = ramp(depth, 5.0)
        record(tmp_path, name, time, d, factor * compressed(PLANTED, d))
        bars += f'[[specimen]]\nname = "{name}"\nrecordings = ["recordings/{name}.csv"]\n'
    (tmp_path / "specimen.toml").write_text(bars)
    folder = lf.load_specimen(tmp_path)
    found = lf.identify(folder, "reduced-polynomial")["reduced-polynomial"]
    typical = float(np.exp(np.mean(np.log(list(factors.values())))))
    assert found.log.converged
    for name, factor in factors.items():
        assert found.details.stiffness[name] == pytest.approx(factor / typical, rel=0.02)
    for name, truth in (("deep.C10", 5e-3 * typical), ("deep.C20", 3e-3 * typical)):
        estimate = found.estimates[name]
        print(name, truth, estimate.value, estimate.ci95)
        assert estimate.value == pytest.approx(truth, rel=0.05)
        assert estimate.ci95[0] < truth < estimate.ci95[1]
    # What a typical stiffness is can't be known better than four specimens tell.
    low, high = found.estimates["deep.C10"].ci95
    assert np.log(high / low) > 2 * found.details.stiffness_spread / np.sqrt(4)
    assert rms_percent(found) < 0.5
    (tmp_path / "specimen.toml").write_text(f"{bars}[tissue]\none_stiffness = true\n")
    alike = lf.identify(lf.load_specimen(tmp_path), "reduced-polynomial")["reduced-polynomial"]
    assert not alike.details.stiffness and rms_percent(alike) > 10 * rms_percent(found)


def test_a_recording_left_out_is_predicted_by_its_specimen_s_own_stiffness(tmp_path: Path) -> None:
    bars = BAR
    for name, factor in (("soft", 0.6), ("stiff", 1.7)):
        for number, duration in enumerate((5.0, 6.0)):
            time, d = ramp(3.0, duration)
            record(tmp_path, f"{name}{number}", time, d, factor * compressed(PLANTED, d))
        bars += f'[[specimen]]\nname = "{name}"\nrecordings = ["recordings/{name}*.csv"]\n'
    (tmp_path / "specimen.toml").write_text(bars)
    found = lf.identify(lf.load_specimen(tmp_path), "reduced-polynomial", leave_out=["soft1"])
    (predicted,) = left_out(found["reduced-polynomial"])
    assert predicted.force.r_squared > 0.999 and predicted.scale == pytest.approx(1.0, abs=0.01)
    words = " ".join(found.summary().split())
    assert "with the stiffness of its specimen in the other recordings" in words
    found = lf.identify(lf.load_specimen(tmp_path), "neo-hookean", leave_out=["soft"])
    predicted = left_out(found["neo-hookean"])[0]
    # Another specimen's stiffness can't be known; its course can.
    assert predicted.force.r_squared < 0.9 < predicted.shape_r_squared


def test_derivatives_with_factors_are_those_of_the_factors_too() -> None:
    generator = np.random.default_rng(0)
    specimen = np.repeat([0, 1, 2], 6)
    felt, by, by_too = (generator.uniform(0.5, 2.0, 18) for _ in range(3))
    measured = felt * generator.uniform(0.8, 1.2, 18)
    own = OwnStiffness(("a", "b", "c"), specimen, measured, lambda values: values / felt[:, None])
    step = 1e-6
    ends = [x * own(x) for x in (felt + step * by, felt - step * by)]
    np.testing.assert_allclose(own.slope(felt, by), (ends[0] - ends[1]) / (2 * step), rtol=1e-6)
    assert np.prod(list(own.named(felt).values())) == pytest.approx(1.0)
    # A factor that all share is the law's: it moves no specimen against another.
    np.testing.assert_allclose(own(3.0 * felt), own(felt))
    known = OwnStiffness(("a", "b", "c"), specimen, felt, np.asarray, {"b": 2.0})
    np.testing.assert_allclose(known.slope(felt, by_too), by_too * known(felt))
    assert set(known(felt)) == {1.0, 2.0}
