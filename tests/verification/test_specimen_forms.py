"""Tests of specimens against closed forms and another mesh: Hertz, Hayes, a bar, a whole block.

Hertz: F = 4/3 E* R^(1/2) d^(3/2), E* = E / (1 - nu^2). The layer under a flat punch:
`test_flat_punch.kappa` (W. C. Hayes and others, J. Biomech. 5 (1972) 541-551).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from making_mechanics import block, one_tissue, press, pressed_block
from making_specimens import AREA, LENGTH, compressed, ramp, record
from test_flat_punch import kappa

import legfem as lf
from legfem.experiments.axisymmetric import AxisymmetricSettings, CylinderCompression
from legfem.experiments.bodies import CylinderBetweenPlates, CylinderOnBlock, UniaxialSpecimen
from legfem.experiments.homogeneous import HomogeneousTest
from legfem.experiments.lying_cylinder import LateralCylinder
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.materials import ExponentialStiffening, NeoHookean, Yeoh
from legfem.meshing.structured import MeridianMeshSettings
from legfem.solve.newton import NewtonSolver
from legfem.solve.settings import StepSettings

C10 = 5e-3
INCOMPRESSIBLE = 1e-5


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    "law",
    [
        NeoHookean(C10, INCOMPRESSIBLE),
        Yeoh(C10, INCOMPRESSIBLE, C20=2e-3, C30=3e-3),
        ExponentialStiffening(C10, INCOMPRESSIBLE, C20=0.0, stiffening=2e-3, exponent=2.0),
    ],
    ids=["neo-Hookean", "Yeoh", "exponential"],
)
def test_an_incompressible_bar_is_that_of_the_textbook(law, sign: float) -> None:
    bar = UniaxialSpecimen(LENGTH, AREA, "tension" if sign > 0 else "compression")
    solved = HomogeneousTest(bar, law).solve(depth=4.0)
    expected = compressed(law, solved.curve.displacement, sign)
    np.testing.assert_allclose(solved.curve.force[1:], expected[1:], rtol=1e-4)


def test_a_compressible_bar_is_the_cylinder_that_slides_between_plates() -> None:
    law = NeoHookean(C10, 0.2 / C10)
    wall = ContactSettings(tangential="frictionless", stiffness=2e7, onset=1e-7)
    settings = AxisymmetricSettings(MeridianMeshSettings(6.0, 0.0), wall)
    meshed = CylinderCompression(CylinderBetweenPlates(10.0, 20.0), law, settings).solve(depth=8.0)
    bar = HomogeneousTest(UniaxialSpecimen(20.0, np.pi * 100.0), law).solve(depth=8.0)
    np.testing.assert_allclose(bar.curve(meshed.curve.displacement[1:]), meshed.curve.force[1:], rtol=1e-5)


def test_a_bars_derivatives_are_those_of_its_force() -> None:
    law = Yeoh(C10, 20.0, C20=2e-3, C30=3e-3)
    bar = HomogeneousTest(UniaxialSpecimen(LENGTH, AREA), law)
    names = ["deep.C10", "deep.C20", "deep.C30", "deep.D1"]
    exact = bar.solve(None, 4.0, names).path.sensitivities
    for name in names:
        value = bar.parameters[name]
        up, down = (bar.solve({name: f * value}, 4.0).path.force for f in (1.0001, 0.9999))
        rounding = 1e-6 * np.abs(exact[name]).max()
        np.testing.assert_allclose(exact[name], (up - down) / (2e-4 * value), rtol=1e-5, atol=rounding)


def test_half_a_block_under_a_cylinder_is_half_of_the_whole_one() -> None:
    """On another mesh, with both sides of the mirror, and the force of the whole cylinder."""
    test = CylinderOnBlock(20.0, 40.0, 3.0, 8.0)
    contact = ContactSettings(stiffness=4000.0)
    solved = LateralCylinder(test, NeoHookean(C10, 28.0)).solve(depth=3.0)
    assert solved.report.complete
    penalty = contact.penalty({"deep.C10": C10}, 8.0)
    x, y = np.linspace(-20, 20, 65), np.linspace(-20, 0, 33)
    whole = pressed_block("mixed", contact, one_tissue(C10, 28.0), 8.0, penalty, meshed=block(x, y))
    report = press(whole, NewtonSolver(whole), [3.0], StepSettings(first=0.5, largest=0.5))
    assert report.complete
    print(solved.curve.force[-1] / (3.0 * whole.force()))
    assert solved.curve.force[-1] == pytest.approx(3.0 * whole.force(), rel=0.01)


def _identified(folder: Path, toml: str, depth: float, force) -> tuple[float, float, float]:
    """Return C10 (MPa) and its interval from recordings of a closed form."""
    time, d = ramp(depth, 5.0)
    (folder / "specimen.toml").write_text(
        'id = "made"\ntitle = "Closed form"\norigin = "simulated"\n'
        f"{toml}\n[tissue]\nrelaxes = false\n[recordings]\nstarts_at_contact = true\n"
    )
    for name in ("a", "bb"):
        record(folder, name, time, d, 100.0 * force(d) / force(d)[-1])
    found = lf.identify(lf.load_specimen(folder), "neo-hookean")["neo-hookean"]
    estimate = found.estimates["deep.C10"]
    scale = force(d)[-1] / 100.0
    return estimate.value * scale, *(end * scale for end in estimate.ci95)


@pytest.mark.slow
def test_a_ball_finds_what_hertz_planted(tmp_path: Path) -> None:
    toml = '[ball]\nball_diameter_mm = 10.0\nthickness_mm = 60.0\ndiameter_mm = 120.0\nball = "frictionless"\n'
    found, low, high = _identified(tmp_path, toml, 0.2, lambda d: 16 / 9 * 6 * C10 * 5**0.5 * d**1.5)
    print(found / C10, low, high)
    assert found == pytest.approx(C10, rel=0.015)


@pytest.mark.slow
def test_a_punch_finds_what_hayes_planted(tmp_path: Path) -> None:
    """With the radius of the flat face: a shallow contact hardly climbs the rounded edge."""
    toml = (
        "[punch]\npunch_diameter_mm = 10.0\nedge_mm = 0.1\nthickness_mm = 5.0\n"
        'diameter_mm = 80.0\npunch = "frictionless"\n'
    )
    poisson = 0.4995
    flat = 4.9
    factor = kappa(flat / 5.0, poisson, "bonded")
    found, low, high = _identified(tmp_path, toml, 0.1, lambda d: 2 * flat * factor * 6 * C10 * d / (1 - poisson**2))
    print(found / C10, low, high)
    assert found == pytest.approx(C10, rel=0.03)
