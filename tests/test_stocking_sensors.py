"""Pressures measured under a stocking: they tell what contours can't, the tension."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
import shapely
from making_stocking import PLANTED_KPA, laws, short_leg

from legfem.common.errors import InputError
from legfem.common.progress import Silent
from legfem.common.units import MPA_PER_MMHG
from legfem.experiments.compression import CompressionSettings
from legfem.geometry.leg_shape import SKIN
from legfem.geometry.slices import calf_levels
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.report.answers import sentence_of
from legfem.report.kinds import page_of
from legfem.report.render import plain_page
from legfem.report.stocking_pressures import sensor_rows
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.details import sensor_notices
from legfem.stockings.equilibrium import EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import Stocking, fitted_stocking
from legfem.stockings.identification import identify_in_stocking
from legfem.stockings.leg import Posture, Sensor, SensorArray, StockingLeg, off_skin
from legfem.stockings.loading import doubts_about_leg
from legfem.stockings.schema import LegFile, parse_leg_file

FINE = SolidMeshSettings(skin_size=8, inside_size=10, bone_size=8)
COARSE = SolidMeshSettings(skin_size=11, inside_size=14, bone_size=9)
TENSION = 0.12
"""By which the true fabric pulls more than the one that is given; known beforehand to as much."""
SENSOR = 0.04
"""Relative error of a sensor."""
ACCURACY = ContourAccuracy(sd=0.1, correlation=16.0, around=30.0, along=40.0, pressure_sd=0.003, tension_sd=TENSION)


def sensor(shape, point, pressure, sd=None, diameter=30.0):
    level = len(shape.levels) // 2
    position = np.array([*shape.contours[SKIN][level, point], shape.levels[level]])
    return Sensor(f"at {point}", position, pressure, sd or SENSOR * pressure, diameter)


def test_a_sensor_feels_the_mean_of_what_lies_under_its_face():
    shape = short_leg()
    sensors = [sensor(shape, 10, 3e-3), sensor(shape, 50, 3e-3, diameter=1.0)]
    sensors_on = SensorArray.on(shape, sensors)
    even = np.full(shape.contours[SKIN].shape[:2], 2.5e-3)
    np.testing.assert_allclose(sensors_on.averages(even), 2.5e-3, rtol=1e-12)
    along = even * shape.levels[:, None] / shape.levels[len(shape.levels) // 2]
    np.testing.assert_allclose(sensors_on.averages(along), 2.5e-3, rtol=1e-2)
    spot = np.zeros_like(even)
    spot[len(shape.levels) // 2, 50] = 1.0
    assert sensors_on.averages(spot)[1] == pytest.approx(1.0), "a small face lies on one point"
    assert off_skin(shape, sensors[0].position) < 1e-9
    assert not list(sensor_notices(sensors_on.compared(3.1e-3 / 2.5e-3 * even)))
    (said,) = map(sentence_of, sensor_notices(sensors_on.compared(even)[:1]))
    assert "at 10" in said and "22.5 ± 0.9 mmHg" in said and "18.8 mmHg" in said
    one, other = sensors_on.compared(even)
    assert one.standardised_residual == pytest.approx((2.5e-3 - 3e-3) / (SENSOR * 3e-3))
    assert other.sensor.name == "at 50"


def test_a_metre_of_blood_presses_with_78_mmhg():
    posture = Posture(1300.0, lying=10 * MPA_PER_MMHG)
    inside = posture.inside(300.0)
    # 1060 kg/m3 x 9.80665 m/s2 x 1 m = 10.395 kPa.
    assert inside["standing"] == pytest.approx(10.395e-3, rel=1e-4)
    assert inside["standing"] / MPA_PER_MMHG == pytest.approx(78.0, abs=0.1)
    assert inside["lying"] / MPA_PER_MMHG == pytest.approx(10.0)
    assert list(Posture(1300.0).inside(0.0)) == ["standing"]


@pytest.mark.parametrize(("diameter", "thickness"), [(50.0, 3.0), (14.0, 0.2), (30.0, 1.0)])
def test_on_a_firm_leg_a_sensor_bears_what_a_string_around_both_turns_over_it(diameter, thickness):
    """A string around a circle with a bump is their convex hull: its tension's resultant on the bump."""
    radius = 50.0
    around, over = np.linspace(0, 2 * np.pi, 40001), np.linspace(-1, 1, 2001) * diameter / (2 * radius)
    circles = [(radius, around), (radius + thickness, over)]
    points = np.vstack([far * np.column_stack([np.cos(turn), np.sin(turn)]) for far, turn in circles])
    ring = np.array(shapely.MultiPoint(points).convex_hull.exterior.coords)[:-1]
    pulls = [step / np.linalg.norm(step, axis=1)[:, None] for k in (1, -1) for step in [np.roll(ring, k, 0) - ring]]
    bump = np.hypot(*ring.T) > radius + 0.5 * thickness
    borne = -(pulls[0] + pulls[1])[bump, 0].sum()
    rise = borne / (2 * np.sin(diameter / (2 * radius))) - 1
    one = Sensor("s", np.zeros(3), 3e-3, 1e-4, diameter, thickness)
    _, firm = one.rises(radius, 3e-3, thickness)
    assert firm == pytest.approx(rise, rel=1e-3)
    assert one.rises(radius, 1e6, thickness)[0] == pytest.approx(firm, rel=1e-3), "nothing sinks into a firm leg"


def test_on_a_soft_leg_a_sensor_sinks_in_until_the_leg_bears_it():
    radius, width, thickness, pressure, stiffness = 50.0, 30.0, 1.0, 3e-3, 3e-3
    one = Sensor("s", np.zeros(3), pressure, 1e-4, width, thickness)
    yielding, firm = one.rises(radius, stiffness, thickness)
    # Sneddon's rigid disc on a half-space: the force is 2 d a E / (1 - nu^2), with E = 6 C10 and nu = 1/2.
    outside, sunk = thickness, 0.0
    for _ in range(400):
        share = np.sqrt(2 * radius * outside) / (0.5 * width)
        sunk = share * pressure * np.pi * (0.5 * width) ** 2 / (2 * 0.5 * width * 6 * stiffness / 0.75)
        outside += 0.1 * (thickness - sunk - outside)
    assert outside + sunk == pytest.approx(thickness, rel=1e-6)
    # That is for small turns: the rise itself is by their sines.
    assert yielding == pytest.approx(share, rel=0.1)
    assert 0 < yielding < 0.5 * firm
    corrected = one.corrected(radius, stiffness)
    assert corrected.pressure * (1 + yielding) == pytest.approx(pressure)
    assert corrected.sd > 0.5 * firm / np.sqrt(12) * pressure, "which share of it is left isn't known"
    thin = replace(one, thickness=0.0).corrected(radius, stiffness)
    assert (thin.pressure, thin.sd) == pytest.approx((pressure, 1e-4))
    asis = replace(one, thickness=None).corrected(radius, stiffness)
    assert (asis.pressure, asis.sd) == pytest.approx((pressure, 1e-4))


def test_a_sensor_whose_thickness_is_not_stated_is_asked_for_it(tmp_path):
    shape = short_leg()
    sensors = tuple(replace(sensor(shape, point, 3e-3), thickness=t) for point, t in ((10, None), (50, 0.5)))
    leg = StockingLeg(
        *("t", "Test", "simulated", shape, shape, None, None),
        *(fitted_stocking(shape, "2"), ACCURACY, laws(3.0, 3.0), True, "held", calf_levels(shape), (), sensors),
    )
    found = [one for one in doubts_about_leg(leg, tmp_path / "leg.toml") if "thickness" in one.field]
    (doubt,) = found
    assert doubt.field == "sensor at 10, thickness_mm" and "thickness" in doubt.remedy
    assert re.search(r"one of 1 mm may read (\d+) % too much", doubt.problem)


TOML = """
id = "s"
title = "S"
origin = "simulated"
[bare]
contours = "bare.csv"
[compressed]
contours = "worn.csv"
[stocking]
compression_class = "2"
[[sensor]]
name = "B1"
position_mm = [0.0, 60.0, 80.0]
pressure_mmHg = 22.0
instrument = "PicoPress"
"""


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ('instrument = "PicoPress"', "", "sd_mmHg"),
        ('instrument = "PicoPress"', 'instrument = "PicoPress"\nsd_mmHg = 1.0', "sd_mmHg"),
        ('"PicoPress"', '"Picopress"', "instrument"),
        ("22.0", "-1.0", "pressure_mmHg"),
        ("22.0", "2200.0", "pressure_mmHg"),
        ("pressure_mmHg", "pressure_kPa", "pressure_kPa"),
        ("22.0", "22.0\nthickness_mm = -1.0", "thickness_mm"),
        ("[0.0, 60.0, 80.0]", "[0.0, 60.0]", "position_mm"),
    ],
)
def test_what_is_wrong_with_a_sensor_is_named(tmp_path, before, after, said):
    toml = tmp_path / "leg.toml"
    toml.write_text(TOML)
    parse_leg_file(toml)
    toml.write_text(TOML.replace(before, after))
    with pytest.raises(InputError, match=rf"sensor\.0\.{said}"):
        parse_leg_file(toml)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("[0.0, 60.0, 80.0]", "[0.0, 200.0, 80.0]", "off the bare leg's skin"),
        ("80.0]", "800.0]", "is not in the part of the leg"),
    ],
)
def test_a_sensor_off_the_leg_is_refused(tmp_path, before, after, said):
    from legfem.stockings.loading import _sensors

    given = LegFile.model_validate(tomllib.loads(TOML.replace(before, after)))
    with pytest.raises(InputError, match=said):
        _sensors(tmp_path / "leg.toml", given, short_leg())


@pytest.mark.slow
def test_two_sensors_of_4_percent_narrow_what_an_uncertain_fabric_leaves_open(tmp_path):
    """The fabric pulls 12 % more than is given; the scan is another mesh's, readings err."""
    shape = short_leg()
    given = fitted_stocking(shape, "3")
    true = Stocking((1 + TENSION) * given.stiffness, given.levels, given.unstretched)
    model = LegModel3D(shape, laws(*PLANTED_KPA), FINE, CompressionSettings(stabilisation=0.3))
    worn = EquilibriumSolver(model, true).solve()
    places = [sensor(shape, point, 1e-3) for point in (20, 65)]
    felt = SensorArray.on(shape, places).averages(worn.load.pressure)
    # One reads too much and one too little, by their standard deviation.
    sensors = tuple(
        sensor(shape, point, float(p) * (1 + sign * SENSOR))
        for point, p, sign in zip((20, 65), felt, (1, -1), strict=True)
    )
    slices = calf_levels(shape)
    leg = StockingLeg(
        "t",
        "Test",
        "simulated",
        shape,
        shape,
        worn.shape,
        None,
        given,
        ACCURACY,
        laws(3.0, 3.0),
        False,
        "held",
        slices,
        (),
        sensors,
    )
    found, width = {}, {}
    for name, one in (("without", replace(leg, sensors=())), ("with", leg)):
        fit = identify_in_stocking(one, Silent(), mesh=COARSE, folder=tmp_path / "kept")
        result, best = fit.details, fit.details.best
        assert best is not None and fit.log.converged and best.tension is not None
        found[name] = best
        intervals = np.array([known.shown.ci95 for known in fit.estimates.values()])
        for planted, (low, high) in zip(PLANTED_KPA, intervals, strict=True):
            assert low < planted < high
        width[name] = np.diff(np.log(intervals), axis=1)[:, 0]
    narrower = width["with"] / width["without"]
    tension = {name: (best.tension.value, best.tension.sd) for name, best in found.items()}
    print(f"intervals of muscle and fat: {narrower} of their width; tension {tension}")
    # Two sensors of 4 % know the mean to 2.8 %, where the fabric was known to 12 %.
    assert tension["without"][1] == pytest.approx(TENSION, rel=0.05)
    assert tension["with"][1] == pytest.approx(SENSOR / np.sqrt(2), rel=0.1)
    assert abs(tension["with"][0] - TENSION) < 3 * tension["with"][1]
    # The muscle's interval carries the fabric's; the fat's is ruled by the outlines' errors.
    assert narrower[0] < 0.85 and narrower[1] < 1.05
    assert len(sensor_rows(result)) == 2
    # So does the mean pressure by height, whose tension the sensors narrow.
    along = result.pressure_along
    middle = len(along.levels) // 2
    assert 0.9 * SENSOR / np.sqrt(2) < along.sd[middle] / along.mean[middle] < 0.5 * TENSION
    said = plain_page(page_of([fit]), [])
    assert "tension of the fabric, relative to what was given" in said and "at 20" in said
    assert result.equilibrium.load.pressure.mean() == pytest.approx(worn.load.pressure.mean(), rel=0.06)
    assert all(abs(one.standardised_residual) < 3 for one in result.sensors)
    assert MPA_PER_MMHG * 10 < result.pressures.mean_interface < MPA_PER_MMHG * 100
