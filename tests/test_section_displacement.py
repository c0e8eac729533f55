"""Displacements inside the section: exact derivatives, an image's registration, and frames in a folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making import TOML, press, write_subject
from making_derivatives import PRECISE
from making_mechanics import COARSE, fixed_steps, subject_3

from legfem.channels import Sight
from legfem.channels.kind import FramesFile
from legfem.channels.kinds.section_image import INSIDE, SectionDisplacements
from legfem.channels.laid import STEP_DEG, STEP_MM, WAYS, Laid
from legfem.channels.log import ChannelReader
from legfem.channels.seen import ReadState, Seen, SeenModel
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.experiments.experiment import Solved
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.fem.outlines import PointsInside
from legfem.inverse.errors import IMAGE_LEFT, covariance_of_places, error_model, reading_covariance
from legfem.inverse.observations import observe
from legfem.inverse.trial_noise import estimate_noise
from legfem.legs.loading import load_subject
from legfem.mechanics.contact import ContactSettings

NAMES = ("deep.C10", "superficial.C10", "fascia.C10")
SETTINGS = PlaneStrainSettings(mesh=COARSE, contact=ContactSettings(onset=0.02), newton=PRECISE, steps=fixed_steps(0.5))
DEPTH = 6.0
ENTRY = '[channels.section_displacement]\nfile = "moved-{trial}.csv"\n'


def lattice(test: PlaneStrainIndentation, deep=(18.0, 24.0, 31.0, 40.0), left=(-14.0, -5.0, 3.0, 12.0)) -> FloatArray:
    """Points (m, 2) at depths below the cylinder's axis at first touch, and to the left of the travel."""
    travel = test.section_mesh.direction
    at = np.array([(x, y) for y in deep for x in left])
    return np.asarray(test.section_mesh.touch + at[:, :1] * [-travel[1], travel[0]] + at[:, 1:] * travel)


def sight(points: FloatArray) -> Sight:
    return Sight(INSIDE.name, tuple((float(x), float(y), float(way)) for x, y in points for way in (0, 1)))


@pytest.fixture(scope="module")
def test() -> PlaneStrainIndentation:
    bare = PlaneStrainIndentation(*subject_3(), SETTINGS)
    return replace(bare, sights=(sight(lattice(bare)),))


@pytest.fixture(scope="module")
def solved(test) -> Solved:
    return test.solve(depth=DEPTH, sensitivities=NAMES)


def columns(solved: Solved, at: int = -1, way: str = "") -> FloatArray:
    """Displacements (m, 2) at a step, or what an image does that lies elsewhere."""
    names = [name for name in solved.path.channels if name.startswith(INSIDE.name)]
    names = [name for name in names if (name.endswith(way) if way else name.count(":") == 1)]
    return np.array([solved.path.channels[name][at] for name in names]).reshape(-1, 2)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_differences(test, solved, name):
    value, change = test.parameters[name], 1e-4
    ahead, behind = (test.solve({name: value * (1 + by)}, DEPTH).path for by in (change, -change))
    seen = [channel for channel in solved.path.channels if channel.startswith(INSIDE.name)]
    assert len(seen) == 32 * (1 + len(WAYS))
    largest = max(np.abs(solved.path.channel_sensitivities[channel][name]).max() for channel in seen)
    for channel in seen:
        difference = (ahead.channels[channel] - behind.channels[channel]) / (2 * change * value)
        assert np.abs(solved.path.channel_sensitivities[channel][name] - difference).max() < 1e-4 * largest


def test_points_near_the_cylinder_follow_it_and_those_near_the_bone_stay(test, solved):
    moved = columns(solved) @ test.section_mesh.direction
    under = moved.reshape(4, 4)
    assert (np.diff(under, axis=0) < 0).all() and under[0].max() > 0.5 * DEPTH
    assert (columns(solved, 0) == 0).all()


def test_a_quadratic_field_is_read_exactly_and_points_in_air_are_not(test):
    spaces = test.system.spaces
    points = lattice(test)
    places = spaces.displacement_space.tabulate_dof_coordinates()[:, :2]

    def field(at: FloatArray) -> FloatArray:
        x, y = at.T
        return np.column_stack([1 + 0.1 * x - 0.02 * x * y, 0.3 * y**2 - x])

    found = PointsInside.found(spaces, points).values(field(places))
    np.testing.assert_allclose(found, field(points), rtol=1e-9, atol=1e-9)
    outside = test.section_mesh.touch[None]
    assert np.isnan(PointsInside.found(spaces, outside).values(field(places))).all()


def state_of(test: PlaneStrainIndentation, field: Callable[[FloatArray], FloatArray]) -> Seen:
    """A state whose displacements are a field's."""
    system = test.system
    unknown = np.zeros_like(system.unknown.x.array)
    places = system.spaces.displacement_space.tabulate_dof_coordinates()[:, :2]
    unknown[system.spaces.displacement_dofs] = field(places).ravel()
    none = np.zeros((0, 2))
    state = ReadState(unknown, np.zeros((0, len(unknown))), np.zeros(2), none, none, np.zeros((0, 0, 2)))
    return Seen(SeenModel(system, test.sights), state)


def test_a_field_of_known_gradient_has_its_own_registration(test):
    """u = A X and a parabola: A s for a shift, A (e_z x X) - e_z x u for a small turn about the image's middle."""
    gradient, points = np.array([[0.02, -0.05], [0.01, -0.08]]), lattice(test)
    middle = points.mean(axis=0)

    def field(at: FloatArray) -> FloatArray:
        away = at - middle
        return away @ gradient.T + np.column_stack([0.002 * away[:, 0] ** 2, -0.003 * away[:, 0] * away[:, 1]])

    read = of_images(SectionDisplacements(), state_of(test, field))
    away, u = points - middle, field(points)
    slope = np.tile(gradient, (len(points), 1, 1))
    slope[:, 0, 0] += 0.004 * away[:, 0]
    slope[:, 1] += np.column_stack([-0.003 * away[:, 1], -0.003 * away[:, 0]])
    beside = np.column_stack([-away[:, 1], away[:, 0]])
    turned = np.einsum("pij,pj->pi", slope, beside) - np.column_stack([-u[:, 1], u[:, 0]])
    np.testing.assert_allclose(read["shift in x"], slope[:, :, 0] * STEP_MM, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(read["shift in y"], slope[:, :, 1] * STEP_MM, rtol=1e-6, atol=1e-9)
    # Of the third order in the step.
    np.testing.assert_allclose(read["turn"], np.deg2rad(STEP_DEG) * turned, atol=2e-3 * np.abs(read["turn"]).max())


def of_images(file: FramesFile, seen: Seen) -> dict[str, FloatArray]:
    """What a step in each way does, (m, 2)."""
    found = ChannelReader(seen.model.system, [file], seen.model.sights).read(seen.state)
    return {way: np.array([found[n][0] for n in found if n.endswith(way)]).reshape(-1, 2) for way in WAYS}


def test_an_image_that_lies_elsewhere_reads_what_its_steps_say(test, solved):
    """A shift of 1.6 mm and a turn of 2.5 degrees, against solving for the points where they truly lie."""
    points = lattice(test)
    away, image = points - points.mean(axis=0), Laid((1.3, -0.9), 2.5)
    angle = np.deg2rad(2.5)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    truly = points.mean(axis=0) + np.array([1.3, -0.9]) + away @ turn.T
    np.testing.assert_allclose(image.truly(points, points.mean(axis=0)), truly)
    there = columns(replace(test, sights=(sight(truly),)).solve(depth=DEPTH)) @ turn
    times = {"shift in x": 1.3 / STEP_MM, "shift in y": -0.9 / STEP_MM, "turn": 2.5 / STEP_DEG}
    said = sum(times[way] * columns(solved, way=way) for way in WAYS)
    change = there - columns(solved)
    assert np.abs(change).max() > 0.2
    # What is left is of the second order.
    assert np.sqrt(np.mean((said - change) ** 2)) < 2 * IMAGE_LEFT * np.sqrt(np.mean(change**2))


def moved(points: FloatArray, leg, depth: FloatArray) -> FloatArray:
    """Move points (m, 2) by what the cylinder does (n,), less the farther away: (n, m, 2)."""
    away = np.linalg.norm(points - leg.indenter.aim, axis=1)
    return depth[:, None, None] * np.exp(-away / 25.0)[:, None] * leg.indenter.direction


def folder(
    place: Path, scale: float = 1.0, sign: float = 1.0, shift: float = 0.0, before: float = 0.0, unit: float = 1.0
) -> Path:
    leg = load_subject(write_subject(place))
    x, y = np.meshgrid(np.arange(-20.0, 21.0, 2.0), np.arange(3.0, 30.0, 2.0))
    travel = leg.indenter.direction
    skin = leg.indenter.aim
    points = skin + x.reshape(-1, 1) * [-travel[1], travel[0]] + y.reshape(-1, 1) * travel
    recording = press()
    time = np.arange(0.0, recording.time[-1], 5.0)
    depth = np.interp(time, recording.time, recording.displacement)
    u = sign * scale * (moved(points, leg, depth) + before * travel)
    rows = ["time_s,x_mm,y_mm,ux_mm,uy_mm"]
    rows += [
        f"{t:g},{unit * px + shift:.6g},{unit * py:.6g},{ux:.4f},{uy:.4f}"
        for t, frame in zip(time, u, strict=True)
        for (px, py), (ux, uy) in zip(points, frame, strict=True)
    ]
    (place / "moved-trial1.csv").write_text("\n".join(rows) + "\n")
    (place / "subject.toml").write_text(TOML + ENTRY)
    return place


def test_a_grid_of_points_becomes_a_few_cells_that_move_as_they_do(tmp_path):
    leg = load_subject(folder(tmp_path / "leg"))
    (channel,) = leg.recordings[0].channels
    assert channel.kind == INSIDE and 8 <= len(channel.places) // 2 <= 20
    assert leg.sights == (Sight(INSIDE.name, channel.places),)
    recording = leg.recordings[0]
    depth = np.interp(channel.time, recording.time, recording.displacement)
    places = channel.place
    truth = np.array(
        [moved(place[None, :2], leg, d[None])[0, 0, int(place[2])] for place, d in zip(places, depth, strict=True)]
    )
    # A cell's mean is not quite its middle's: the field bends.
    assert np.abs(channel.values - truth).max() < 0.03 * np.abs(truth).max()


def test_a_file_is_taken_together_in_as_many_cells_as_its_entry_asks_for(tmp_path):
    place = folder(tmp_path / "leg")
    (place / "subject.toml").write_text(TOML + ENTRY + "cells = 60\n")
    (channel,) = load_subject(place).recordings[0].channels
    assert 25 < len(channel.places) // 2 <= 60
    (place / "subject.toml").write_text(TOML + "[channels.lateral_force]\ncells = 60\n")
    with pytest.raises(InputError, match="channel is no image"):
        load_subject(place)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"scale": 10.0}, "check the unit"),
        ({"sign": -1.0}, "against the cylinder's travel"),
        ({"shift": 300.0}, "soft tissue"),
        ({"before": 8.0}, "before the cylinder touches"),
        ({"unit": 1e-3}, "give mm, not m"),
    ],
)
def test_displacements_that_cannot_be_are_refused(tmp_path, change, words):
    with pytest.raises(InputError, match=words):
        load_subject(folder(tmp_path / "leg", **change))


def test_readings_of_one_frame_share_errors_and_the_image_s_place(tmp_path):
    """Near places err alike, far ones and the two directions by themselves; the registration is in all frames."""
    leg = load_subject(folder(tmp_path / "leg"))
    (one,) = observe(leg.trials).channels
    covariance = reading_covariance(one, one.slope(one.values), 50.0, [[0]])
    np.linalg.cholesky(covariance + 1e-12 * np.eye(len(covariance)))
    sd = np.sqrt(np.diag(covariance))
    alike = covariance / np.outer(sd, sd)
    same = np.equal.outer(one.frame, one.frame)
    across = same & np.not_equal.outer(one.place[:, 2], one.place[:, 2])
    lag = one.accuracy.lag * one.slope(one.values) * one.speed
    assert np.abs((covariance - np.outer(lag, lag))[across]).max() < 1e-12
    far = same & np.equal.outer(one.place[:, 2], one.place[:, 2])
    apart = np.linalg.norm(one.place[:, None, :2] - one.place[None, :, :2], axis=-1)
    assert alike[far & (apart > 20)].max() < alike[far & (apart > 0) & (apart < 8)].max()
    laid = {way: times * np.sin(one.place[:, 0] / 9.0) for way, times in one.accuracy.laid.items()}
    beyond = covariance_of_places(one, one.values, laid)
    assert np.all(beyond[np.not_equal.outer(one.course, one.course)] == 0) and beyond.diagonal().max() > 0.01
    noise = estimate_noise(observed := observe(leg.trials), leg.instrument)
    errors = error_model(observed, noise, observed.values, images={one.name: laid})
    span, plain = observed.data.spans[1], error_model(observed, noise, observed.values)
    known = dict(zip(errors.names, errors.known.T, strict=True))
    assert set(errors.names) - set(plain.names) == {f"image of displacements: {way}" for way in WAYS}
    np.testing.assert_allclose(known["image of displacements: turn"][span], laid["turn"])
    np.testing.assert_allclose((errors.dense - plain.dense)[span, span], beyond, atol=1e-12)
