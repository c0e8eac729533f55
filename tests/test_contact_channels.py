"""Pressure on the cylinder's face and the contact's width: exact derivatives, balance, and films in a folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from making import TOML, press, write_subject
from making_derivatives import PRECISE
from making_mechanics import COARSE, fixed_steps, subject_3

from legfem.channels import Sight
from legfem.channels.kind import PlacedReadings
from legfem.channels.kinds import FILE_OF
from legfem.channels.kinds.contact import PRESSURE
from legfem.common.errors import InputError
from legfem.experiments.experiment import Solved
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.inverse.errors import covariance_of_places, shared_errors
from legfem.inverse.observations import observe
from legfem.legs.loading import load_subject
from legfem.mechanics.contact import ContactSettings

NAMES = ("deep.C10", "superficial.C10")
CONTACT = ContactSettings(onset=0.02, tangential="frictionless")
SETTINGS = PlaneStrainSettings(mesh=COARSE, contact=CONTACT, newton=PRECISE, steps=fixed_steps(0.5))
DEPTH = 6.0
EDGES = np.linspace(-18.0, 18.0, 10)
SIGHT = Sight(PRESSURE.name, tuple(zip(EDGES[:-1].tolist(), EDGES[1:].tolist(), strict=True)))
ENTRY = '[channels.contact_pressure]\nfile = "film-{trial}.csv"\n'


@pytest.fixture(scope="module")
def test() -> PlaneStrainIndentation:
    return PlaneStrainIndentation(*subject_3(), SETTINGS, sights=(SIGHT,))


@pytest.fixture(scope="module")
def solved(test) -> Solved:
    return test.solve(depth=DEPTH, sensitivities=NAMES)


def seen(solved: Solved) -> list[str]:
    return [name for name in solved.path.channels if name.startswith("contact_")]


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_differences(test, solved, name):
    value, change = test.parameters[name], 1e-4
    ahead, behind = (test.solve({name: value * (1 + by)}, DEPTH).path for by in (change, -change))
    assert len(seen(solved)) == len(SIGHT.places) + 1
    for channel in seen(solved):
        difference = (ahead.channels[channel] - behind.channels[channel]) / (2 * change * value)
        exact = solved.path.channel_sensitivities[channel][name]
        assert np.abs(exact - difference)[1:].max() < 2e-4 * np.abs(difference).max() + 1e-9, channel


def test_pressures_add_up_to_the_force(test, solved):
    """Without friction: fine sensels, each times its cosine. The sum of wide ones is the same load."""
    fine = np.linspace(-20.0, 20.0, 81)
    sight = Sight(PRESSURE.name, tuple(zip(fine[:-1].tolist(), fine[1:].tolist(), strict=True)))
    path = replace(test, sights=(sight,)).solve(depth=DEPTH).path
    radius, length = test.indenter.radius, test.indenter.length
    loads = np.array([path.channels[name] * 1e-3 * 0.5 for name in PRESSURE.courses(80)])
    cosine = np.cos(0.5 * (fine[1:] + fine[:-1]) / radius)
    # A film spreads the load by 1.5 mm, by which the cosine bends.
    assert cosine @ loads[:, -1] * length == pytest.approx(path.force[-1], rel=5e-3)
    wide = sum(solved.path.channels[name][-1] * 1e-3 * 4.0 for name in PRESSURE.courses(len(SIGHT.places)))
    assert wide == pytest.approx(loads[:, -1].sum(), rel=1e-3)


def test_the_width_is_where_the_pressure_ends(test, solved):
    """Between the outermost sensels of 0.5 mm that read a hundredth of the largest, but for the film's blur."""
    fine = np.linspace(-20.0, 20.0, 81)
    sight = Sight(PRESSURE.name, tuple(zip(fine[:-1].tolist(), fine[1:].tolist(), strict=True)))
    path = replace(test, sights=(sight,)).solve(depth=DEPTH).path
    pressures = np.array([path.channels[name][-1] for name in PRESSURE.courses(80)])
    pressed = np.flatnonzero(pressures > 0.01 * pressures.max())
    width = fine[pressed[-1] + 1] - fine[pressed[0]]
    assert path.channels["contact_width"][-1] == pytest.approx(width - 2 * 1.5, abs=1.0)
    # At first touch skin that lies within the onset of 0.02 mm is pressed already.
    assert path.channels["contact_width"][0] == pytest.approx(2 * np.sqrt(2 * 15.0 * 0.02), rel=0.1)
    assert (np.diff(path.channels["contact_width"]) > 0).all()


def folder(place: Path, scale: float = 1.0, widest: float = 40.0, every_s: float = 5.0) -> Path:
    leg = load_subject(write_subject(place))
    recording = press()
    angles = np.arange(-widest, widest + 1, 5.0)
    time = np.arange(0.0, recording.time[-1], every_s)
    force = np.interp(time, recording.time, recording.force)
    radius, length = leg.indenter.radius, leg.indenter.length
    shape = np.cos(np.deg2rad(angles) * 90 / 45).clip(0.0)
    each = 1e-3 * length * radius * np.deg2rad(5.0) * np.sum(shape * np.cos(np.deg2rad(angles)))
    rows = ["time_s,angle_deg,pressure_kPa"]
    rows += [
        f"{t:g},{angle:g},{scale * f / each * s:.3f}"
        for t, f in zip(time, force, strict=True)
        for angle, s in zip(angles, shape, strict=True)
    ]
    (place / "film-trial1.csv").write_text("\n".join(rows) + "\n")
    (place / "subject.toml").write_text(TOML + ENTRY)
    return place


def test_a_film_is_read_above_its_threshold_and_creeps(tmp_path):
    leg = load_subject(folder(tmp_path / "leg"))
    (channel,) = leg.recordings[0].channels
    assert channel.kind == PRESSURE and len(channel.places) == 17
    assert channel.values.min() >= PRESSURE.usual.threshold
    width = np.diff(channel.places).ravel()
    np.testing.assert_allclose(width, np.deg2rad(5.0) * leg.indenter.radius, rtol=1e-3)
    (one,) = observe(leg.trials).channels
    creep = shared_errors(one, one.values, np.zeros(len(one.values)))["contact pressure: creep"]
    np.testing.assert_allclose(creep, 0.05 * np.log10(1 + one.time) * one.values)


def test_a_film_laid_beside_where_it_is_said_to_be_reads_its_neighbours_pressure():
    """Of half an ellipse of pressure, whose means over sensels are known, but for the contact's steep edge."""
    half, middles, moved = 14.0, np.arange(-11.0, 12.0, 2.0), 0.8

    def means(shift: float) -> np.ndarray:
        ends = (np.column_stack([middles - 1.0, middles + 1.0]) + shift) / half
        primitive = 0.5 * (ends * np.sqrt(1 - ends**2) + np.arcsin(ends)) * half
        return 9.0 * np.diff(primitive, axis=1).ravel() / 2.0

    places = np.column_stack([middles - 1.0, middles + 1.0])
    order = np.random.default_rng(1).permutation(2 * len(middles))
    frame = np.repeat([0, 1], len(middles))[order]
    read = np.concatenate([means(0.0), 0.5 * means(0.0)])[order]
    both = PlacedReadings(np.tile(places, (2, 1))[order], np.ones(len(order)), frame, read)
    effect = FILE_OF[PRESSURE.name].shared(both, replace(PRESSURE.usual, shift=moved))["place"]
    expected = np.concatenate([means(moved) - means(0.0), 0.5 * (means(moved) - means(0.0))])[order]
    inner = np.abs(np.tile(middles, 2)[order]) < 10.0
    np.testing.assert_allclose(effect[inner], expected[inner], atol=0.05)
    assert np.abs(expected[inner]).max() > 0.3


def test_each_sensel_s_own_scale_is_alike_in_all_its_readings(tmp_path):
    """Readings that a sensel's scale multiplies are as likely as the factor is, and no neighbour takes part."""
    leg = load_subject(folder(tmp_path / "leg"))
    (one,) = observe(leg.trials).channels
    covariance = covariance_of_places(one, one.values, {})
    own = one.course == one.course[0]
    off = 0.08 * one.values[own]
    part = covariance[np.ix_(own, own)] + 1e-8 * np.eye(own.sum())
    assert off @ np.linalg.solve(part, off) == pytest.approx((0.08 / PRESSURE.usual.each) ** 2, rel=1e-3)
    assert not covariance[np.ix_(own, ~own)].any()


def test_a_film_s_noise_above_the_threshold_is_no_pressure(tmp_path):
    """Sensels that nothing presses flicker above it now and then, and those that something presses stay there."""
    place = folder(tmp_path / "leg", widest=55.0, every_s=0.5)
    film = pd.read_csv(place / "film-trial1.csv")
    idle = film["pressure_kPa"] < 0.5
    drawn = np.random.default_rng(3).random(idle.sum())
    film.loc[idle, "pressure_kPa"] = np.where(drawn < 0.2, 1.4, 0.0)
    film.to_csv(place / "film-trial1.csv", index=False)
    leg = load_subject(place)
    (recorded,), (read,) = leg.recordings[0].channels, observe(leg.trials).channels
    angles = [np.rad2deg(np.abs(np.mean(one.place, axis=1))) / leg.indenter.radius for one in (recorded, read)]
    assert (angles[0] > 45.0).sum() > 10 and len(read.values)
    assert angles[1].max() < 45.0


@pytest.mark.parametrize(
    ("change", "words"),
    [({"scale": 1000.0}, "times the force"), ({"widest": 100.0}, "within 90 degrees"), ({"scale": 1e-3}, "no reading")],
)
def test_a_film_that_cannot_be_is_refused(tmp_path, change, words):
    with pytest.raises(InputError, match=words):
        load_subject(folder(tmp_path / "leg", **change))


def test_a_film_s_angles_in_radians_are_not_taken_for_degrees(tmp_path):
    place = folder(tmp_path / "leg", widest=90.0)
    film = pd.read_csv(place / "film-trial1.csv")
    film["angle_deg"] = np.deg2rad(film["angle_deg"])
    film.to_csv(place / "film-trial1.csv", index=False)
    with pytest.raises(InputError, match="radians"):
        load_subject(place)


def test_keys_of_other_instruments_are_refused(tmp_path):
    place = folder(tmp_path / "leg")
    (place / "subject.toml").write_text(TOML + ENTRY + "turn_deg = 1.0\n")
    with pytest.raises(InputError, match="turn_deg"):
        load_subject(place)
