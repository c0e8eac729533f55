"""Specimens: planted laws are found, and what was left out is predicted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making_specimens import BAR, PLANTED, compressed, ramp, record, write_bars

import legfem as lf
from legfem.inverse.fit import Fit
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.search import Search, is_settled
from legfem.mechanics.materials import ExponentialStiffening, NeoHookean, Yeoh
from legfem.report.answers import sentences_of
from legfem.report.results import write_report
from legfem.specimens.details import compared, rms_percent


def test_a_planted_law_is_found_from_recordings_together(bars: Path) -> None:
    found = lf.identify(lf.load_specimen(bars), "reduced-polynomial")["reduced-polynomial"]
    assert len(found.tests) == 3 and found.log.converged and not sentences_of([found])
    for name, truth in (("deep.C10", 5e-3), ("deep.C20", 3e-3)):
        estimate = found.estimates[name]
        assert estimate.value == pytest.approx(truth, rel=0.01)
        assert estimate.ci95[0] < truth < estimate.ci95[1]
        assert estimate.identifiability == "identifiable"


@pytest.mark.parametrize(
    ("law", "planted"),
    [
        ("neo-hookean", NeoHookean(5e-3, 1.0)),
        pytest.param("yeoh", Yeoh(5e-3, 1.0, C20=1e-3, C30=4e-3), marks=pytest.mark.slow),
        pytest.param(
            "exponential",
            ExponentialStiffening(5e-3, 1.0, C20=0.0, stiffening=4e-3, exponent=2.0),
            marks=pytest.mark.slow,
        ),
    ],
)
def test_any_law_takes_the_stiffness_that_was_pulled(tmp_path: Path, law, planted) -> None:
    toml = BAR.replace('"compression"', '"tension"')
    for name, depth in (("less", 5.0), ("more", 9.0)):
        time, d = ramp(depth, 5.0)
        record(tmp_path, name, time, d, compressed(planted, d, sign=1.0))
    (tmp_path / "specimen.toml").write_text(toml)
    found = lf.identify(lf.load_specimen(tmp_path), law, leave_out=["more"])[law]
    (predicted,) = (one for one in compared(found) if not one.fitted)
    print(found.values, predicted.force.r_squared, predicted.force.rms / predicted.course.peak)
    if law != "yeoh":
        # Beyond the strain fitted; Yeoh's last two coefficients trade off below it.
        assert predicted.force.r_squared > 0.999
    found = lf.identify(lf.load_specimen(tmp_path), law)[law]
    assert rms_percent(found) < 0.5
    assert found.estimates["deep.C10"].value == pytest.approx(5e-3, rel=0.03)


@pytest.mark.slow
def test_a_third_rate_with_its_hold_is_predicted_from_two(tmp_path: Path) -> None:
    """Another law and another spectrum than those that are fitted."""
    law = ExponentialStiffening(1e-3, 1.0, C20=0.0, stiffening=1.5e-3, exponent=1.5)
    folder = lf.load_specimen(write_bars(tmp_path, law, hold=300.0))
    assert folder.relaxes
    found = lf.identify(folder, "reduced-polynomial", leave_out=["middle"])["reduced-polynomial"]
    (predicted,) = (one for one in compared(found) if not one.fitted)
    print(predicted.force.r_squared)
    assert predicted.name == "middle" and predicted.force.r_squared > 0.99
    ratio = found.estimates["viscoelasticity.ratio"]
    assert 2.0 < ratio.value < 4.0 and ratio.ci95[0] < ratio.value < ratio.ci95[1]
    assert ratio.ci95[1] - ratio.ci95[0] < ratio.value


def test_a_prior_and_a_held_value_count(bars: Path) -> None:
    folder = lf.load_specimen(bars)
    tight = Prior(4e-3, 1e-6, source="test")
    given = Parameter("deep.C10", "MPa", (1e-3, 1e-2), tight, scale="log")
    found = lf.identify(folder, "neo-hookean", identify=[given])["neo-hookean"]
    assert found.estimates["deep.C10"].value == pytest.approx(4e-3, rel=0.01)
    held = lf.identify(folder, "reduced-polynomial", fix={"deep.C20": 3e-3})
    assert list(held["reduced-polynomial"].estimates) == ["deep.C10"]


def test_what_another_unit_or_size_would_do_is_said_and_so_it_is(tmp_path: Path) -> None:
    def c10(force: float, way: float) -> Fit:
        folder = tmp_path / f"{force:g}{way:g}"
        for name, duration in (("fast", 0.6), ("slow", 60.0)):
            time, d = ramp(2.0, duration)
            record(folder, name, time, way * d, force * compressed(NeoHookean(5e-3, 1.0), d))
        (folder / "specimen.toml").write_text(BAR)
        return lf.identify(lf.load_specimen(folder), "neo-hookean")["neo-hookean"]

    found = c10(1.0, 1.0)
    one = found.estimates["deep.C10"]
    assert one.moves["force_N"] == pytest.approx(0.1, rel=1e-3)
    assert c10(1.1, 1.0).values["deep.C10"] / one.value - 1 == pytest.approx(0.1, rel=0.01)
    deeper = c10(1.0, 1.02).values["deep.C10"] / one.value - 1
    assert one.moves["displacement_mm"] == pytest.approx(5 * deeper, rel=0.1)
    write_report([found], tmp_path)
    assert "an area_mm2 of half the true value doubles the stiffness" in " ".join(
        (tmp_path / "report.txt").read_text().split()
    )


def test_a_value_at_its_bound_is_told(bars: Path) -> None:
    given = [
        Parameter("deep.C10", "MPa", (1e-3, 1e-2), scale="log"),
        Parameter("deep.C20", "MPa", (0.0, 1e-3), scale="log"),
    ]
    found = lf.identify(lf.load_specimen(bars), "reduced-polynomial", identify=given)
    assert any("C20 stands at the upper bound" in text for text in sentences_of([found.fits[0]]))


def test_a_test_that_stops_costs_itself_alone(tmp_path: Path) -> None:
    """Of a bar said to be 0.5 mm long, 3 mm of compression are more than there is."""
    several = BAR.replace("length_mm = 10.0\n", "").replace("[recordings]", "[given]")
    entries = "".join(
        f'[[specimen]]\nname = "{name}"\nlength_mm = {length}\nrecordings = ["recordings/{name}.csv"]\n'
        for name, length in (("fast", 10.0), ("middle", 10.0), ("slow", 0.5))
    )
    write_bars(tmp_path, PLANTED, several.replace("[given]", "[recordings]") + entries)
    found = lf.identify(lf.load_specimen(tmp_path), "reduced-polynomial")["reduced-polynomial"]
    assert [one.name for one in found.tests if one.fitted] == ["fast", "middle"]
    (left,) = found.details.left_out
    assert left.name == "slow" and "displacement_mm: a depth of 5.95 of what" in left.reason
    assert found.estimates["deep.C10"].value == pytest.approx(5e-3, rel=0.01)


def test_specimens_of_several_sizes_are_one_tissue(tmp_path: Path) -> None:
    bare = BAR.replace("length_mm = 10.0\narea_mm2 = 100.0\n", "")
    for number, (length, area) in enumerate(((10.0, 100.0), (20.0, 50.0))):
        time, d = ramp(0.3 * length, 5.0)
        force = compressed(PLANTED, 10.0 * d / length) * area / 100.0
        record(tmp_path / f"day{number}", "one", time, d, force)
        bare += f'[[specimen]]\nname = "s{number}"\nlength_mm = {length}\narea_mm2 = {area}\n'
        bare += f'recordings = ["day{number}/recordings/*.csv"]\n'
    (tmp_path / "specimen.toml").write_text(bare)
    folder = lf.load_specimen(tmp_path)
    assert [one.name for one in folder.recordings] == ["day0/recordings/one", "day1/recordings/one"]
    found = lf.identify(folder, "reduced-polynomial", leave_out=["s1"])["reduced-polynomial"]
    (predicted,) = (one for one in compared(found) if not one.fitted)
    assert predicted.recording.specimen == "s1" and predicted.force.r_squared > 0.999
    assert predicted.scale == pytest.approx(1.0, abs=0.01)


def test_a_solve_that_makes_it_worse_is_no_sign_of_convergence(bars: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every proposal after the first is solved to a worse fit than the emulator promised."""
    assert is_settled(5e-5) and not is_settled(5e-3) and not is_settled(-5e-3)
    solve, gains = Search.solve, list[float]()

    def worse(search, points, stage):
        before = min((t.objective for t in search.trials), default=np.inf)
        trials = solve(search, points, stage)
        if stage == "proposal" and len(search.trials) > 4:
            raised = replace(trials[0], objective=before + 10.0)
            search.trials[-1] = raised
            trials = [raised]
        if stage == "proposal":
            gains.append(1 - trials[0].objective / before)
        return trials

    monkeypatch.setattr(Search, "solve", worse)
    monkeypatch.setattr(Search, "is_stationary", lambda search: False)
    monkeypatch.setattr(Search, "newton_step", lambda search, trial=None: 0.01 * (trial or search.best).point)
    monkeypatch.setattr(Search, "_is_settled_at", lambda *_: False)
    found = lf.identify(lf.load_specimen(bars), "reduced-polynomial")["reduced-polynomial"]
    assert any(gained < 0 for gained in gains)
    assert not found.log.converged
    assert "ended before it converged" in sentences_of([found])[0]


def test_a_step_that_goes_too_far_is_refuted_and_the_emulators_optimum_stands(
    bars: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As along a curved valley, where derivatives promise more than there is."""
    folder = lf.load_specimen(bars)
    asked = lf.identify(folder, "reduced-polynomial")["reduced-polynomial"]
    monkeypatch.setattr(Search, "is_stationary", lambda search: False)
    monkeypatch.setattr(Search, "newton_step", lambda search, trial=None: 0.05 * (trial or search.best).point)
    found = lf.identify(folder, "reduced-polynomial")["reduced-polynomial"]
    assert found.log.converged and found.log.forward_solves > asked.log.forward_solves
    for name, one in found.estimates.items():
        assert one.value == pytest.approx(asked.estimates[name].value, rel=2e-3)
