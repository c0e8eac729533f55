"""Diagnoses of specimens: planted effects are named, sound tests stay sound, bad ones are told."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from making_specimens import BAR, BRANCHES, compressed, ramp, record, relaxing, write_bars
from typer.testing import CliRunner

from legfem.channels.kinds import CHANNELS
from legfem.commands.diagnose import app
from legfem.common.progress import Silent
from legfem.data import Recording, write_recording
from legfem.data.recording import RecordedChannel
from legfem.experiments.bodies import BallOnLayer, CylinderBetweenPlates, CylinderOnBlock, UniaxialSpecimen
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.responses import BodyModels
from legfem.mechanics.materials import ExponentialStiffening, NeoHookean
from legfem.mechanisms import Solution
from legfem.solve.protocol import Protocol
from legfem.specimens.diagnosis import DiagnosedSpecimen, SpecimenDiagnoser
from legfem.specimens.folder import load_specimen
from legfem.specimens.forward import experiment_of
from legfem.specimens.laws import REFERENCE_MPA, specimen_law
from legfem.specimens.mechanisms import Scale, mechanisms_of, mechanisms_on_a_rig
from legfem.specimens.sizes import Sizes
from legfem.specimens.variants import SpecimenVariants

PLATES = '[plates]\ndiameter_mm = 24.0\nheight_mm = 12.0\nends = "bonded"'
STATED = "[instrument]\nforce_sd_N = 0.002\ndisplacement_sd_mm = 0.002\n"


def diagnosed(folder: Path) -> DiagnosedSpecimen:
    (found,) = SpecimenDiagnoser(None, 1, Silent()).diagnosed(load_specimen(folder))
    return found


def repeats(folder: Path, force_of, compliance: float = 0.0) -> Path:
    """Write three repeats to 3 mm at 0.5 mm/s, by a rig that yields so much (mm/N)."""
    time, d = ramp(3.0, 6.0)
    force = force_of(d)
    for name in ("a", "bb", "ccc"):
        record(folder, name, time, d + compliance * force, force)
    (folder / "specimen.toml").write_text(BAR + STATED)
    return folder


def test_a_sound_test_is_consistent_and_its_stiffness_found(tmp_path: Path) -> None:
    law = NeoHookean(5e-3, 1.0)
    found = diagnosed(repeats(tmp_path, lambda d: compressed(law, d))).diagnosis
    assert found is not None and found.verdict == "consistent"
    low, high = found.intervals[DEEP_C10]
    assert low < 5e-3 < high and high - low < 5e-4
    assert found.emulator_error < 1e-4


def test_a_rig_that_yields_is_named_with_its_compliance(tmp_path: Path) -> None:
    law = NeoHookean(5e-3, 1.0)
    folder = repeats(tmp_path, lambda d: compressed(law, d), compliance=0.08)
    found = diagnosed(folder).diagnosis
    assert found is not None
    named = {name for model in found.models for name in model.names}
    print(found.verdict, [(m.names, m.probability, m.fit.values) for m in found.models])
    assert found.verdict in ("named", "ambiguous") and "support-compliance" in named
    best = next(m for m in found.models if "support-compliance" in m.names)
    low, high = best.interval("support-compliance.compliance")
    assert low < 0.08 < high


@pytest.mark.slow
def test_a_disc_between_plates_is_diagnosed_with_the_width_that_a_video_shows(tmp_path: Path) -> None:
    """As the model itself presses it: that a channel beside the force is carried through, not how well."""
    sizes = Sizes(CylinderBetweenPlates(12.0, 12.0, "bonded"))
    law = NeoHookean(5e-3, 1.0)
    curve = experiment_of(sizes, {"deep": law}, 2.0).solve(None, 2.0).curve
    d = np.linspace(0.0, 1.9, 100)
    width = np.round(500 * curve.channel("lateral_stretch", d[::20])) / 500
    video = RecordedChannel("lateral_stretch", d[::20] / 0.5, width, CHANNELS["lateral_stretch"].usual)
    noise = np.random.default_rng(3).normal(0.0, 0.004, len(d))
    (tmp_path / "recordings").mkdir()
    write_recording(Recording(d / 0.5, d, curve(d) + noise, "a", None, (video,)), tmp_path / "recordings" / "a.csv")
    text = BAR.replace('[uniaxial]\ndirection = "compression"\nlength_mm = 10.0\narea_mm2 = 100.0', PLATES)
    (tmp_path / "specimen.toml").write_text(text + STATED)
    found = diagnosed(tmp_path).diagnosis
    assert found is not None and found.verdict == "consistent"
    assert [one.name for one in found.observed.channels] == ["lateral_stretch"]
    low, high = found.intervals[DEEP_C10]
    assert low < 5e-3 < high


@pytest.mark.slow
def test_relaxation_is_named_by_a_hold(tmp_path: Path) -> None:
    law = NeoHookean(5e-3, 1.0)
    # What lasts isn't known after half a minute, since a part of the stress may fade over ten.
    time, d = ramp(3.0, 3.0, hold=300.0)
    for name in ("a", "bb"):
        record(tmp_path, name, time, d, relaxing(compressed(law, d), time, BRANCHES[:2]))
    (tmp_path / "specimen.toml").write_text(BAR + STATED)
    found = diagnosed(tmp_path).diagnosis
    assert found is not None and found.verdict in ("named", "ambiguous")
    assert all("viscoelasticity" in model.names for model in found.models)
    # Two branches that end within the hold are no spectrum, and a drift may stand in for what it
    # misses; what lasts is still found.
    alone = next(model for model in found.models if model.names == ("viscoelasticity",))
    assert alone.value(DEEP_C10) == pytest.approx(5e-3, rel=0.1)
    low, high = found.intervals[DEEP_C10]
    assert low < 5e-3 < high


@pytest.mark.slow
def test_relaxation_is_named_by_the_law_that_stiffens(tmp_path: Path) -> None:
    law = ExponentialStiffening(1e-3, 1.0, C20=0.0, stiffening=1.5e-3, exponent=1.5)
    found = diagnosed(write_bars(tmp_path, law, BAR + STATED, hold=120.0)).diagnosis
    assert found is not None and found.verdict == "named"
    # The neo-Hookean law, asked first, gives way to the one that stiffens.
    assert found.models[0].names == ("viscoelasticity",) and found.law == "reduced-polynomial"
    low, high = found.intervals[DEEP_C10]
    assert low < 1e-3 < high


@pytest.mark.parametrize(
    ("body", "depth"),
    [
        (CylinderBetweenPlates(10.0, 12.0, "bonded"), 3.0),
        pytest.param(BallOnLayer(12.0, 5.0, 25.0), 3.0, marks=pytest.mark.slow),
        (UniaxialSpecimen(10.0, 100.0), 3.0),
    ],
)
def test_one_solution_serves_every_stiffness(body, depth: float) -> None:
    """Against solutions at that stiffness, and differences of them."""
    c10, c20 = 3.7e-2, 1.9e-2
    models: BodyModels = SpecimenVariants(Sizes(body), depth)
    at = np.linspace(0.3, 1.0, 5) * depth
    asked = ("deep.C10", "deep.C20", "size.height" if hasattr(body, "height") else "deep.D1")
    given = {"deep.C10": c10, "deep.C20": c20}
    solved = models.follow(Protocol.ramp(depth, 1.0), given, Solution("plain"), asked)
    assert solved.report.complete
    found = solved.path

    def direct(first: float, second: float, of=body, channel: str = "") -> np.ndarray:
        law = specimen_law("reduced-polynomial", REFERENCE_MPA, None)
        values = {"deep.C10": first, "deep.C20": second, "deep.D1": law.parameters["D1"] * REFERENCE_MPA / first}
        curve = experiment_of(Sizes(of), {"deep": law}, depth).solve(values, depth).curve
        return curve.channel(channel, at) if channel else curve(at)

    np.testing.assert_allclose(found.force_at(at), direct(c10, c20), rtol=2e-5)
    for name, step in (("deep.C10", (1e-2 * c10, 0.0)), ("deep.C20", (0.0, 1e-2 * c20))):
        up, down = (direct(c10 + s * step[0], c20 + s * step[1]) for s in (1, -1))
        slope = (up - down) / (2 * sum(step))
        np.testing.assert_allclose(found.sensitivity_at(name, at), slope, rtol=5e-3)
        for channel in found.channels:
            ends = [direct(c10 + s * step[0], c20 + s * step[1], channel=channel) for s in (1, -1)]
            slope = (ends[0] - ends[1]) / (2 * sum(step))
            rates = found.each_at(at, found.channel_sensitivities[channel])[name]
            np.testing.assert_allclose(rates, slope, rtol=1e-2, atol=1e-3 * np.abs(slope).max() + 1e-6)
    if hasattr(body, "height"):
        from dataclasses import replace

        up, down = (direct(c10, c20, replace(body, height=h)) for h in (12.24, 11.76))
        slope = (up - down) / 0.48
        np.testing.assert_allclose(found.sensitivity_at("size.height", at), slope, rtol=0.1)


def test_a_return_between_plates_is_followed_to_its_end() -> None:
    """Flat faces come apart all at once: relaxation couldn't be sought in any recording that came back."""
    times, ways = (0.0, 4.0, 10.0, 14.0), (0.0, 1.5, 1.5, 0.0)
    models: BodyModels = SpecimenVariants(Sizes(CylinderBetweenPlates(12.0, 12.0, "bonded")), 1.5)
    solved = models.follow(Protocol(times, ways), {"deep.C10": 8e-3, "deep.C20": 0.0}, Solution("plain"))
    assert solved.report.complete
    found = solved.path
    up, down = (found.force_at([time])[0] for time in (2.0, 12.0))
    assert down == pytest.approx(up, rel=5e-3)
    assert 0.0 <= found.force_at([14.0])[0] < 5e-3 * found.force.max()


def test_every_mechanism_is_tested_or_said_why_not() -> None:
    scale = Scale(3.0, 5.0, 10.0, 5e-3, 1000.0)
    for body in (UniaxialSpecimen(10.0, 100.0), CylinderOnBlock(20.0, 40.0, 30.0), BallOnLayer(12.0)):
        sizes = Sizes(body)
        able, unable = mechanisms_of(sizes, scale)
        assert {m.name for m in able} | set(unable) == {m.name for m in mechanisms_on_a_rig()}
        assert ("contact-slip" in unable) == (sizes.slipping is None)
        words = " ".join(f"{m.statement} {m.next_experiment}" for m in able)
        for of_a_leg in (" leg", "skin", "muscle", "bone", "shin", "tape"):
            assert of_a_leg not in words
    assert Sizes(BallOnLayer(12.0, ball="frictionless")).slipping is None


def test_a_bad_recording_and_a_bad_specimen_cost_themselves_alone(tmp_path: Path) -> None:
    """Of a bar said to be 3.05 mm long hardly anything is left at 3 mm."""
    law = NeoHookean(5e-3, 1.0)
    repeats(tmp_path, lambda d: compressed(law, d))
    (tmp_path / "recordings" / "letters.csv").write_text("time_s,displacement_mm,force_N\na,b,c\n")
    entries = "".join(
        f'[[specimen]]\nname = "{name}"\nlength_mm = {length}\nrecordings = {files}\n'
        for name, length, files in (
            ("sound", 10.0, '["recordings/a.csv", "recordings/bb.csv", "recordings/l*.csv"]'),
            ("short", 3.05, '["recordings/ccc.csv"]'),
        )
    )
    (tmp_path / "specimen.toml").write_text(BAR.replace("length_mm = 10.0\n", "") + STATED + entries)
    out = tmp_path / "out"
    asked = ["--specimen-dir", str(tmp_path), "--jobs", "1", "--library", str(tmp_path / "kept")]
    done = CliRunner().invoke(app, [*asked, "--out", str(out)])
    assert done.exit_code == 0, done.output
    table = json.loads((out / "diagnosis.json").read_text())
    rows = {row["specimen"]: row for row in table["specimens"]}
    assert rows["sound"]["verdict"] == "consistent"
    assert "can't be solved" in rows["short"]["problem"]
    (left,) = table["recordings_not_used"]
    assert left["name"] == "letters" and "not a number" in left["reason"]
    own = json.loads((out / "sound" / "diagnosis.json").read_text())
    assert own["subject"] == "sound" and own["origin"] == "simulated"
    report = (out / "sound" / "report.txt").read_text()
    assert "SIMULATED" in report and "a specimen of one tissue has no fascia" in report
    assert " leg" not in report, [line for line in report.splitlines() if " leg" in line]
    assert (out / "sound" / "report.html").is_file()
    short = CliRunner().invoke(app, [*asked, "--specimen", "short", "--out", str(out / "short")])
    assert short.exit_code == 2 and "can't be solved" in short.output
    assert not (out / "short").exists()


def test_a_specimen_pressed_to_a_tenth_of_its_length_ends_with_a_verdict(tmp_path: Path) -> None:
    """A more compressible law has no force left there, and no ratio to tabulate."""
    law = NeoHookean(5e-3, 1.0)
    repeats(tmp_path, lambda d: compressed(law, d))
    (tmp_path / "specimen.toml").write_text(BAR.replace("length_mm = 10.0", "length_mm = 3.3") + STATED)
    assert diagnosed(tmp_path).diagnosis is not None


@pytest.mark.slow
@pytest.mark.parametrize("kept", ["a", "bb", "ccc"])
def test_so_does_one_recording_of_it(tmp_path: Path, kept: str) -> None:
    """Whose mechanisms have effects beyond what rounding bears."""
    law = NeoHookean(5e-3, 1.0)
    repeats(tmp_path, lambda d: compressed(law, d))
    for path in (tmp_path / "recordings").glob("*.csv"):
        if path.stem != kept:
            path.unlink()
    (tmp_path / "specimen.toml").write_text(BAR.replace("length_mm = 10.0", "length_mm = 3.3") + STATED)
    assert diagnosed(tmp_path).diagnosis is not None


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--specimen", "nobody"], "is not a specimen of the folder"),
        (["--subject", "3"], "is given as well"),
        (["--seed", "-1"], "is not possible here"),
    ],
)
def test_a_wrong_option_is_one_line(tmp_path: Path, more: list[str], words: str) -> None:
    write_bars(tmp_path, NeoHookean(5e-3, 1.0))
    done = CliRunner().invoke(app, ["--specimen-dir", str(tmp_path), "--jobs", "1", *more])
    assert done.exit_code == 2 and words in done.output
