"""Specimens of layers: equal ones are one, planted stiffness is found, or said not to be told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from making_layers import OtherLayer, OtherLayers
from making_specimens import BAR, record
from scipy.interpolate import CubicSpline
from typer.testing import CliRunner

import legfem as lf
from legfem.channels.kinds import CHANNELS
from legfem.commands.identify import app
from legfem.common.errors import InputError
from legfem.data import Recording, write_recording
from legfem.data.recording import RecordedChannel
from legfem.experiments.bodies import BallOnLayer, PunchOnLayer
from legfem.inverse.outcome import JointForward
from legfem.inverse.parse_parameters import AskedParameters
from legfem.inverse.readings import READINGS
from legfem.mechanisms import Solution
from legfem.solve.protocol import Protocol
from legfem.specimens.comparison import comparison_of
from legfem.specimens.folder import _doubts_about_bodies, tissue_asked_for
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.laws import SpecimenTissue, identified_law, request_of, tissues_of
from legfem.specimens.mechanisms import Scale, mechanisms_of
from legfem.specimens.schema import SpecimenFile
from legfem.specimens.sizes import Sizes
from legfem.specimens.variants import SpecimenVariants

FAT, MUSCLE, BULK = 2e-3, 8e-3, 10.0
POISSON = (3 * BULK - 2) / (2 * (3 * BULK + 1))
PUNCH = f"""\
id = "layered"
title = "Made by another code"
origin = "simulated"

[punch]
punch_diameter_mm = 12.0
edge_mm = 0.3
diameter_mm = 80.0

[[layers]]
name = "fat"
thickness_mm = 5.0
[[layers]]
name = "muscle"
thickness_mm = 12.0

[tissue]
one_stiffness = true
poisson_ratio = {POISSON}

[recordings]
starts_at_contact = true
"""
OPEN = (SpecimenTissue("muscle"), SpecimenTissue("fat"))


def given(text: str = PUNCH) -> SpecimenFile:
    import tomllib

    return SpecimenFile.model_validate(tomllib.loads(text))


def press(folder: Path, name: str, fat: float, muscle: float, depth: float = 2.0) -> None:
    """Record a punch on layers of thicknesses (mm), made by the other code."""
    layers = OtherLayer(muscle, MUSCLE, BULK), OtherLayer(fat, FAT, BULK)
    knots = np.linspace(0.0, depth, 9)
    force = OtherLayers(layers, 40.0, [6.0], 0.3).punched(6.0, knots[1:])
    time = np.linspace(0.0, 4.0, 161)
    d = depth * time / 4.0
    curve = np.polynomial.Polynomial.fit(knots, [0.0, *force], 5)
    record(folder, name, time, d, curve(d) - curve(0.0))


@pytest.mark.parametrize(
    "whole",
    [
        pytest.param(BallOnLayer(12.0, 5.0, 40.0), id="ball"),
        pytest.param(PunchOnLayer(12.0, 5.0, 1.0, 40.0), id="punch", marks=pytest.mark.slow),
    ],
)
def test_equal_layers_are_one_tissue_and_so_are_their_derivatives(whole) -> None:
    layered = Sizes(whole, (("muscle", 7.0), ("fat", 5.0)))
    c10, depth = 5e-3, 1.2
    one = SpecimenForward(Sizes(whole), depth, (SpecimenTissue(),), c10)
    two = SpecimenForward(layered, depth, OPEN, c10)
    alone = one.solve({"deep.C10": c10}, ["deep.C10"]).curves[0]
    both = two.solve({"fat.C10": c10, "muscle.C10": c10}, ["fat.C10", "muscle.C10"]).curves[0]
    # Where a ball's contact is a few elements wide, its force rises in steps.
    at = np.linspace(0.4, 1.2, 5)
    np.testing.assert_allclose(both(at), alone(at), rtol=7e-3)
    # The force is in proportion to all stiffnesses together, at each tissue's Poisson's ratio.
    slopes = sum(both.sensitivity(name, at) for name in ("fat.C10", "muscle.C10"))
    np.testing.assert_allclose(c10 * slopes, both(at), rtol=5e-3)


def test_layers_are_read_from_the_top_and_stand_from_the_base() -> None:
    stated = PUNCH.replace('name = "fat"', 'name = "fat"\nC10_kPa = 2.0\npoisson_ratio = 0.49')
    muscle, fat = tissues_of(given(stated))
    assert (muscle.name, fat.name) == ("muscle", "fat")
    assert not muscle.stated and fat.stated == {"C10": pytest.approx(2e-3)}
    assert fat.at(1.0).parameters["C10"] == pytest.approx(2e-3)
    assert muscle.poisson_ratio == POISSON and fat.poisson_ratio == 0.49


def test_what_is_stated_is_held_and_what_is_open_is_free() -> None:
    open_law = identified_law("reduced-polynomial", OPEN, 5e-3, 0.0, request_of(AskedParameters(), OPEN))
    assert open_law.names == ("muscle.C10", "muscle.C20", "fat.C10", "fat.C20")
    stated = (OPEN[0], SpecimenTissue("fat", "neo-hookean", stated={"C10": 2e-3}))
    law = identified_law("neo-hookean", stated, 5e-3, 0.0, request_of(AskedParameters(), stated))
    assert law.names == ("muscle.C10",) and law.fixed["fat.C10"] == 2e-3
    # D1 isn't held: it follows from C10 and Poisson's ratio.
    assert not any(name.endswith("D1") for name in law.fixed)
    written = AskedParameters(priors=["fat.C10=2 x/ 1.2 kPa"], fixed=["muscle.C10=7 kPa"])
    law = identified_law("neo-hookean", OPEN, 5e-3, 0.0, request_of(written, OPEN))
    assert law.names == ("fat.C10",) and law.parameters[0].prior is not None


def test_a_thickness_is_a_size_and_slip_is_the_whole_test_s() -> None:
    test = Sizes(PunchOnLayer(17.0, 6.0, 0.3, 40.0), (("muscle", 12.0), ("fat", 5.0)))
    assert test.lengths["fat_thickness"] == 5.0 and "thickness" not in test.lengths
    thicker = test.resized("fat_thickness", 6.0)
    assert thicker.lengths["fat_thickness"] == 6.0 and thicker.body.thickness == 18.0
    wider = test.resized("radius", 7.0)
    assert wider.layers == test.layers and wider.body.radius == 7.0 and wider.body.thickness == 17.0
    free = test.slipping
    assert free is not None and free.layers == test.layers and free.body.punch == "frictionless"
    assert "fat 5 mm on muscle 12 mm" in str(test)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("thickness_mm = 5.0\n", ""), "give it, or layers_mm with every [[specimen]]"),
        (("diameter_mm = 80.0", "diameter_mm = 80.0\nthickness_mm = 9.0"), "remove it"),
        (('[[layers]]\nname = "muscle"\nthickness_mm = 12.0\n', ""), "there is one"),
        (('name = "muscle"', 'name = "fat"'), "'fat' stands twice"),
        (('name = "muscle"', 'name = "instrument"'), "is the name of something else"),
        (('name = "muscle"', 'name = "two words"'), "layers"),
        (('name = "fat"', 'name = "fat"\nlaw = "neo-hookean"\nC20_kPa = 1.0'), "C20_kPa"),
        (('name = "fat"', 'name = "fat"\nC10_kPA = 1.0'), "did you mean 'C10_kPa'?"),
        (
            ("[tissue]", '[[specimen]]\nname = "a"\nrecordings = ["*.csv"]\nlayers_mm = [1.0, 2.0, 3.0]\n[tissue]'),
            "3 thicknesses of 2 [[layers]]",
        ),
    ],
)
def test_what_is_wrong_with_layers_is_one_line(tmp_path: Path, change, words: str) -> None:
    (tmp_path / "specimen.toml").write_text(PUNCH.replace(*change))
    (tmp_path / "a.csv").write_text("")
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "a.csv").write_text("")
    with pytest.raises(InputError) as error:
        lf.load_specimen(tmp_path)
    assert words in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (("thickness_mm = 5.0", "thickness_mm = 0.005"), "layers.fat.thickness_mm"),
        (("thickness_mm = 12.0", "thickness_mm = 120.0"), "layers.muscle.thickness_mm"),
        (
            ("[tissue]", '[[specimen]]\nname = "a"\nrecordings = ["*.csv"]\nlayers_mm = [0.005, 12.0]\n[tissue]'),
            "specimen a.layers_mm",
        ),
    ],
)
def test_a_layer_in_another_unit_is_doubted(change: tuple[str, str], field: str) -> None:
    assert not _doubts_about_bodies(Path("specimen.toml"), given())
    (doubt,) = _doubts_about_bodies(Path("specimen.toml"), given(PUNCH.replace(*change)))
    assert doubt.field == field and "a layer's thickness" in doubt.problem


def test_an_edge_in_another_unit_is_refused() -> None:
    with pytest.raises(InputError, match="the rounding of an edge"):
        _doubts_about_bodies(Path("specimen.toml"), given(PUNCH.replace("edge_mm = 0.3", "edge_mm = 0.0003")))


def test_layers_are_not_for_every_test(tmp_path: Path) -> None:
    layers = PUNCH[PUNCH.index("[[layers]]") : PUNCH.index("[tissue]")]
    (tmp_path / "specimen.toml").write_text(BAR.replace("[recordings]", layers + "[recordings]"))
    with pytest.raises(InputError, match="layers"):
        lf.load_specimen(tmp_path)


@pytest.mark.slow
def test_a_diagnosis_solves_the_open_layer_on_the_stated_one() -> None:
    """As the forward model does, at another stiffness than that which is solved for."""
    test = Sizes(BallOnLayer(17.0, 6.0, 40.0), (("muscle", 12.0), ("fat", 5.0)))
    fat = SpecimenTissue("fat", "neo-hookean", POISSON, {"C10": 2e-3})
    tissues = SpecimenTissue("muscle", None, POISSON), fat
    at, depth, c10 = np.linspace(0.4, 1.2, 5), 1.2, 3e-3
    models = SpecimenVariants(test, depth, tissues)
    solved = models.follow(
        Protocol.ramp(depth, 1.0), {"deep.C10": c10, "deep.C20": 0.0}, Solution("plain"), ("deep.C10",)
    )
    assert solved.report.complete
    found = solved.path
    forward = SpecimenForward(test, depth, tuple(one.of_law("neo-hookean") for one in tissues), c10)
    same = forward.solve({"muscle.C10": c10}, ["muscle.C10"]).curves[0]
    np.testing.assert_allclose(found.force_at(at), same(at), rtol=1e-5)
    slopes = found.sensitivity_at("deep.C10", at)
    np.testing.assert_allclose(slopes, same.sensitivity("muscle.C10", at), rtol=1e-4)
    # All stiffness alike doubled is all force doubled; the mechanism's factor is on the fat's.
    twice = models.follow(
        Protocol.ramp(depth, 1.0),
        {"deep.C10": 2 * c10, "deep.C20": 0.0},
        Solution("plain", scaled={"superficial.C10": 2.0}),
    )
    assert twice.report.complete
    np.testing.assert_allclose(twice.path.force_at(at), 2 * found.force_at(at), rtol=1e-9)
    # Layers are seen under their own names, whichever is open.
    other = SpecimenVariants(test, depth, (replace(fat, name="muscle"), replace(tissues[0], name="fat")))
    same_way = other.follow(Protocol.ramp(depth, 1.0), {"deep.C10": c10, "deep.C20": 0.0}, Solution("plain"))
    assert same_way.report.complete
    for path in (found, same_way.path):
        assert [float(path.channels[name][0]) for name in SEEN] == [5.0, 12.0]
        lost = [path.channels[name][0] - path.channels[name][-1] for name in SEEN]
        assert sum(lost) == pytest.approx(depth, rel=0.02)
    able, _ = mechanisms_of(test, Scale(depth, 1.0, 4.0, 3e-3, BULK))
    assert "superficial-stiffness" in [mechanism.name for mechanism in able]


def test_a_diagnosis_of_layers_needs_all_but_one_stated(tmp_path: Path) -> None:
    time = np.linspace(0.0, 4.0, 81)
    record(tmp_path, "a", time, 0.5 * time, 0.5 * time)
    (tmp_path / "specimen.toml").write_text(PUNCH)
    with pytest.raises(InputError, match="stiffness is open of muscle, fat"):
        tissue_asked_for(lf.load_specimen(tmp_path))
    found = lf.diagnose(lf.load_specimen(tmp_path), library=tmp_path / "responses")
    with pytest.raises(lf.InputError, match="C10_kPa of all layers but one"):
        found["layered"]
    assert not found.verdicts and "Not used" in found.summary()
    with pytest.raises(InputError, match="stiffness is open"):
        found.write(tmp_path / "out")


@pytest.fixture(scope="module")
def sheets(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Thin and thick fat on muscle."""
    folder = tmp_path_factory.mktemp("sheets")
    entries = ""
    for name, fat in (("thin", 3.0), ("thick", 9.0)):
        press(folder, name, fat, 12.0)
        entries += f'[[specimen]]\nname = "{name}"\nlayers_mm = [{fat}, 12.0]\nrecordings = ["recordings/{name}.csv"]\n'
    (folder / "specimen.toml").write_text(PUNCH + entries)
    return folder


@pytest.mark.slow
def test_both_layers_stiffness_is_found_from_two_thicknesses(sheets: Path) -> None:
    found = lf.identify(lf.load_specimen(sheets), "neo-hookean")["neo-hookean"]
    for name, truth in (("fat.C10", FAT), ("muscle.C10", MUSCLE)):
        estimate = found.estimates[name]
        print(name, estimate.value / truth - 1, np.array(estimate.ci95) / truth, estimate.identifiability)
        assert estimate.value == pytest.approx(truth, rel=0.05)
        assert estimate.ci95[0] < truth < estimate.ci95[1]
        assert estimate.identifiability in ("identifiable", "weakly identifiable")


@pytest.mark.slow
def test_one_thickness_does_not_tell_the_layers_apart_and_a_prior_does(sheets: Path, tmp_path: Path) -> None:
    entry = PUNCH.replace("thickness_mm = 5.0", "thickness_mm = 3.0")
    (tmp_path / "specimen.toml").write_text(entry)
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "thin.csv").symlink_to(sheets / "recordings" / "thin.csv")
    folder = lf.load_specimen(tmp_path)
    alone = lf.identify(folder, "neo-hookean")["neo-hookean"]
    for name in ("fat.C10", "muscle.C10"):
        estimate = alone.estimates[name]
        print(name, estimate.value, estimate.ci95, estimate.identifiability)
    assert all(one.identifiability == "not identifiable" for one in alone.estimates.values())
    out = tmp_path / "out"
    asked = [
        "--specimen-dir",
        str(tmp_path),
        "--law",
        "neo-hookean",
        "--jobs",
        "1",
        "--prior",
        "fat.C10=2 x/ 1.05 kPa",
        "--out",
        str(out),
    ]
    done = CliRunner().invoke(app, asked)
    print(done.output)
    assert done.exit_code == 0, done.output
    assert "C10 of the muscle" in done.output


SEEN = ("fat_thickness", "muscle_thickness")
WIDER = 3.0
"""Of all lengths: ultrasound reads whole limbs to a few tenths of a millimetre."""


@pytest.fixture(scope="module")
def seen_layers(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One press on 15 mm of fat, with two ultrasound frames; by the other code, whose punch has no rounding."""
    folder = tmp_path_factory.mktemp("seen")
    text = PUNCH
    for key, value in (
        ("punch_diameter", 12.0),
        ("edge", 0.3),
        ("diameter", 80.0),
        ("thickness", 5.0),
        ("thickness", 12.0),
    ):
        text = text.replace(f"\n{key}_mm = {value}\n", f"\n{key}_mm = {WIDER * value}\n")
    (folder / "specimen.toml").write_text(text)
    layers, depths = (OtherLayer(12.0, MUSCLE, BULK), OtherLayer(5.0, FAT, BULK)), np.linspace(0.0, 2.0, 9)
    other = OtherLayers(layers, 40.0, [6.0], 0.3)
    force, thickness = [0.0], [(5.0, 12.0)]
    for depth in depths[1:]:
        force.append(float(other.punched(6.0, [depth])[0]))
        interface = 12.0 + other.sunk(12.0)
        thickness.append((17.0 - depth - interface, interface))
    rng, time, frames = np.random.default_rng(7), np.linspace(0.0, 4.0, 161), np.array([2.0, 3.9])
    curve = np.polynomial.Polynomial.fit(depths, force, 5)
    pressed = WIDER**2 * (curve(0.5 * time) - curve(0.0))
    read = WIDER * CubicSpline(2.0 * depths, thickness)(frames)
    read += rng.laplace(0.0, 0.2, (2, 2)) + rng.uniform(-0.3, 0.3, 2)
    usual = CHANNELS["fat_thickness"].usual
    channels = tuple(RecordedChannel(name, frames, read[:, k], usual) for k, name in enumerate(SEEN))
    (folder / "recordings").mkdir()
    press = Recording(time, WIDER * 0.5 * time, pressed, "press", channels=channels)
    write_recording(press, folder / "recordings" / "press.csv")
    return folder


def test_what_is_read_is_what_another_code_shows(seen_layers: Path) -> None:
    """Of layers as stiff as planted: within what frames err by; and read as it is predicted."""
    folder = lf.load_specimen(seen_layers)
    (one,) = folder.recordings
    truth = {"fat.C10": FAT, "muscle.C10": MUSCLE}
    tissues = tuple(tissue.of_law("neo-hookean") for tissue in folder.tissues)
    model = JointForward((SpecimenForward(one.sizes, 1.02 * one.course.depth, tissues, MUSCLE),))
    comparison = comparison_of([one], model, folder, False).with_channels([folder.sizes_sd])
    instrument = np.array([number.null for number in READINGS.values()])
    found = comparison.predict(model.solve(truth, list(truth)), instrument)
    np.testing.assert_allclose(found.values, comparison.read(found.model_values, instrument), atol=1e-9)
    left = comparison.measured - found.values
    for name in SEEN:
        at = comparison.channels[name]
        print(name, left[at])
        assert len(at) == 2 and np.abs(left[at]).max() < 0.8
        # Stiffer fat gives way less, and a stiffer muscle lets it do so more.
        assert (found.sensitivities["fat.C10"][at] * found.sensitivities["muscle.C10"][at] < 0).all()
    assert np.linalg.eigvalsh(comparison.covariance)[0] > 0


@pytest.mark.slow
def test_two_frames_tell_layers_apart_that_one_force_does_not(seen_layers: Path) -> None:
    found = lf.identify(lf.load_specimen(seen_layers), "neo-hookean")["neo-hookean"]
    for name, truth in (("fat.C10", FAT), ("muscle.C10", MUSCLE)):
        estimate = found.estimates[name]
        print(name, estimate.value / truth, np.array(estimate.ci95) / truth, dict(estimate.information_shares))
        assert estimate.ci95[0] < truth < estimate.ci95[1]
        assert estimate.identifiability != "not identifiable"
        assert estimate.information_shares["fat_thickness"] > 0.1
    (press,) = found.tests
    assert [one.channel.name for one in press.channels] == ["force", *SEEN]
    assert all(np.abs(one.residual).max() < 1.0 for one in press.channels[1:])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda table: table.assign(fat_thickness_mm=0.1 * table.fat_thickness_mm), "fat thickness is 1.3"),
        (lambda table: table.drop(columns="fat_thickness_mm"), "no recording has a column fat_thickness_mm"),
    ],
)
def test_thicknesses_that_cannot_be_are_one_line(seen_layers: Path, tmp_path: Path, change, words: str) -> None:
    (tmp_path / "recordings").mkdir()
    text = (seen_layers / "specimen.toml").read_text()
    (tmp_path / "specimen.toml").write_text(text + "[channels.fat_thickness]\nsd_mm = 0.4\n")
    table = pd.read_csv(seen_layers / "recordings" / "press.csv")
    table.to_csv(tmp_path / "recordings" / "press.csv", index=False)
    (press,) = lf.load_specimen(tmp_path).recordings
    assert [one.accuracy.reading for one in press.recording.channels] == [0.4, 0.3]
    change(table).to_csv(tmp_path / "recordings" / "press.csv", index=False)
    with pytest.raises(InputError) as error:
        lf.load_specimen(tmp_path)
    assert words in str(error.value) and "\n" not in str(error.value)


def test_a_frame_at_the_end_of_a_press_counts(seen_layers: Path, tmp_path: Path) -> None:
    (tmp_path / "recordings").mkdir()
    (tmp_path / "specimen.toml").write_text((seen_layers / "specimen.toml").read_text())
    table = pd.read_csv(seen_layers / "recordings" / "press.csv")
    last = table.index == len(table) - 1
    table["fat_thickness_mm"] = np.where(last, 12.0, np.nan)
    # Smoothed, the last displacement is a little deeper than it was read.
    table["displacement_mm"] = table.displacement_mm.round(1)
    table.to_csv(tmp_path / "recordings" / "press.csv", index=False)
    folder = lf.load_specimen(tmp_path)
    (one,) = folder.recordings
    model = JointForward((SpecimenForward(one.sizes, one.course.depth, folder.tissues, MUSCLE),))
    (seen,) = comparison_of([one], model, folder, False).with_channels([0.01]).tests
    assert [len(channel.values) for channel in seen.channels] == [1, 2]
