"""A twisted cylinder: its torque by the integral and by another code, units, errors of sizes, and what is refused."""

from __future__ import annotations

from pathlib import Path

import felupe as fem
import numpy as np
import pytest
from scipy.integrate import quad

import legfem as lf
from legfem.experiments.bodies import TwistedCylinder
from legfem.experiments.torsion import TorsionTest
from legfem.mechanics.materials import ExponentialStiffening, Hyperelastic, NeoHookean, ReducedPolynomial

RADIUS, HEIGHT = 12.5, 6.0
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
LAW = ReducedPolynomial(4e-3, 1.0, C20=2e-3)


def torque(law: Hyperelastic, angle: np.ndarray) -> np.ndarray:
    """N mm, by adaptive quadrature of shear stresses over rings."""

    def ring(radius: float, twist: float) -> float:
        shear = twist * radius
        return float(2 * np.pi * radius**2 * 2 * law.distortion_slope(shear**2) * shear)

    return np.array([quad(ring, 0.0, RADIUS, args=(one / HEIGHT,))[0] for one in angle])


def twisted(folder: Path, columns: tuple[str, str] = ("angle_deg", "torque_mNm"), law: Hyperelastic = LAW) -> Path:
    """Write a folder with a recording to 0.4 rad in 40 s, with noise, an encoder's steps, and a drift of the torque."""
    angle = np.linspace(0.0, 0.4, 160)
    noise = np.random.default_rng(4).normal(0.0, 0.3, len(angle)) + 0.3 * np.sin(9 * angle)
    units = {"angle_deg": 180 / np.pi, "angle_rad": 1.0, "torque_mNm": 1.0, "torque_uNm": 1e3, "torque_Nmm": 1.0}
    given = [100 * angle, np.round(angle, 5) * units[columns[0]], (torque(law, angle) + noise) * units[columns[1]]]
    (folder / "recordings").mkdir(parents=True)
    header = ",".join(("time_s", *columns))
    np.savetxt(folder / "recordings/a.csv", np.column_stack(given), "%.6f", ",", header=header, comments="")
    (folder / "specimen.toml").write_text(TOML)
    return folder


@pytest.mark.parametrize(
    "law", [NeoHookean(5e-3, 1.0), LAW, ExponentialStiffening(1e-3, 1.0, C20=0.0, stiffening=1.5e-3, exponent=1.5)]
)
def test_the_torque_is_the_integral_and_its_derivatives_are_differences(law: Hyperelastic) -> None:
    curve = TorsionTest(BODY, law).solve(None, 0.6, ["deep.C10"]).curve
    angle = np.array([0.1, 0.3, 0.6])
    assert curve(angle) == pytest.approx(torque(law, angle), rel=1e-3)
    more = TorsionTest(BODY, law).solve({"deep.C10": 1.001 * law.parameters["C10"]}, 0.6).curve
    slope = (more(angle) - curve(angle)) / (1e-3 * law.parameters["C10"])
    assert curve.sensitivity("deep.C10", angle) == pytest.approx(slope, rel=1e-4)


def test_a_neo_hookean_cylinder_has_the_polar_moment_of_its_section() -> None:
    solved = TorsionTest(BODY, NeoHookean(5e-3, 1.0)).solve(None, 0.5).curve
    assert solved(0.5) == pytest.approx(2 * 5e-3 * np.pi / 2 * RADIUS**4 * 0.5 / HEIGHT, rel=1e-9)


def test_another_code_twists_by_the_same_torque_and_pushes_the_plates_apart() -> None:
    """Hexahedra of felupe, whose side is free and whose circle has corners: an area 2 % less."""
    mesh = fem.mesh.expand(fem.Circle(radius=RADIUS, n=6), n=6, z=HEIGHT)
    field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(mesh), dim=3)])
    solid = fem.SolidBodyNearlyIncompressible(fem.NeoHooke(mu=2 * 5e-3), field, bulk=10.0)
    top = np.isclose(mesh.points[:, 2], HEIGHT)
    turned = fem.Boundary(field[0], mask=top)
    bounds = {"held": fem.Boundary(field[0], mask=np.isclose(mesh.points[:, 2], 0.0)), "turned": turned}
    places, angle = mesh.points[turned.points], 0.3
    turn = np.array([[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]])
    turned.value = (places @ turn.T - places).ravel()
    free = dict(zip(("dof0", "dof1"), fem.dof.partition(field, bounds), strict=True))
    solve = getattr(fem, "newtonraphson", None) or fem.newtonrhapson
    solve(items=[solid], x0=field, ext0=fem.dof.apply(field, bounds, free["dof0"]), verbose=0, **free)
    force = solid.results.force.toarray().reshape(-1, 3)[top]
    x, y = (mesh.points + field[0].values)[top, :2].T
    felt = float(x @ force[:, 1] - y @ force[:, 0])
    own = TorsionTest(BODY, NeoHookean(5e-3, 1.0)).solve(None, angle).curve(angle)
    print(felt / own, force[:, 2].sum() / (-0.5 * angle / HEIGHT * own))
    assert felt == pytest.approx(own, rel=0.02)
    assert force[:, 2].sum() == pytest.approx(-0.5 * angle / HEIGHT * own, rel=0.05)


@pytest.mark.parametrize(
    "columns", [("angle_deg", "torque_mNm"), ("angle_rad", "torque_uNm"), ("angle_rad", "torque_Nmm")]
)
def test_a_law_is_found_in_any_unit(tmp_path: Path, columns: tuple[str, str]) -> None:
    found = lf.identify(lf.load_specimen(twisted(tmp_path / "gel", columns)), "reduced-polynomial")
    fit = found["reduced-polynomial"]
    for name, true in (("deep.C10", LAW.C10), ("deep.C20", LAW.C20)):
        low, high = fit.estimates[name].ci95
        print(name, fit.estimates[name].value, low, high)
        assert low < true < high
    assert fit.tests[0].recording.axes.load_text(5.0) == "5 N mm"


def test_a_radius_that_is_off_counts_four_times(tmp_path: Path) -> None:
    folder = twisted(tmp_path / "gel")
    (folder / "specimen.toml").write_text(TOML + "[accuracy]\nsizes_percent = 0.0\ndiameter_mm = 0.25\n")
    one = lf.identify(lf.load_specimen(folder), "reduced-polynomial")["reduced-polynomial"].estimates["deep.C10"]
    own = one.standard_error * np.sqrt(one.error_shares["sizes"]) / one.value
    assert own == pytest.approx(0.04, rel=0.1)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("angle_deg", "angle_rad", "check whether the angle is in degrees or rad"),
        ("angle_deg", "displacement_mm", "header"),
        ("torque_mNm", "force_N", "header"),
    ],
)
def test_other_columns_and_angles_are_refused(tmp_path: Path, before: str, after: str, said: str) -> None:
    path = twisted(tmp_path / "gel") / "recordings/a.csv"
    path.write_text(path.read_text().replace(before, after))
    with pytest.raises(lf.InputError, match=said) as refused:
        lf.load_specimen(tmp_path / "gel")
    print(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("factor", [1.0, -1.0, 0.2])
def test_plates_that_are_pushed_apart_otherwise_are_doubted(tmp_path: Path, factor: float) -> None:
    """Rivlin's relation: half the twist per height times the torque, whatever the law."""
    path = twisted(tmp_path / "gel") / "recordings/a.csv"
    table = np.loadtxt(path, delimiter=",", skiprows=1)
    angle = np.deg2rad(table[:, 1])
    push = factor * 0.5 * angle / HEIGHT * torque(LAW, angle) + np.random.default_rng(1).normal(0.0, 0.02, len(angle))
    header = "time_s,angle_deg,torque_mNm,normal_force_N"
    np.savetxt(path, np.column_stack([table, push]), "%.6f", ",", header=header, comments="")
    doubts = lf.load_specimen(tmp_path / "gel").doubts
    print([str(one) for one in doubts])
    assert [one.field for one in doubts] == ([] if factor == 1.0 else ["normal_force_N"])
