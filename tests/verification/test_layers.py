r"""What presses on layers against linear elasticity, one layer, and another mesh.

The closed form is that of one layer (`test_flat_punch`), with the surface's answer to a pressure of
one wave number found from both layers' general solutions: in each, at depth z,
:math:`u_z = (A + B k z) e^{-kz}`, :math:`u_x = (A + B (k z - \kappa)) e^{-kz}`,
:math:`\kappa = 3 - 4 \nu`, and its mirror image (L. A. Galin, Contact Problems, 1961, ch. 3).
"""

from __future__ import annotations

import numpy as np
import pytest
from making_mechanics import fixed_steps
from test_flat_punch import kappa, law

from legfem.common.errors import InputError
from legfem.experiments.axisymmetric import AxisymmetricSettings, BallIndentation, Layer
from legfem.experiments.bodies import BallOnLayer, CylinderOnBlock, PunchOnLayer
from legfem.experiments.flat_punch import FlatPunchIndentation
from legfem.experiments.lying_cylinder import LateralCylinder
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.structured import MeridianMeshSettings
from legfem.solve.settings import StepSettings

RADIUS, EDGE, DEPTH = 5.0, 0.1, 0.02
MU = 0.01
"""Of `law`, MPa."""


def faces(k: float, h: float, mu: float, nu: float) -> tuple[np.ndarray, np.ndarray]:
    """Return u_x, u_z, tension and shear (4, 4) at a layer's upper and lower face."""
    kappa = 3 - 4 * nu
    rows = []
    for z in (0.0, h):
        near, far = np.exp(-k * z), np.exp(-k * (h - z))
        down, up = k * z, k * (h - z)
        rows.append(
            np.array(
                [
                    [near, (down - kappa) * near, far, (up - kappa) * far],
                    [near, down * near, -far, -up * far],
                    [
                        -2 * mu * k * near,
                        -2 * mu * k * (down - 1 + 2 * nu) * near,
                        -2 * mu * k * far,
                        -2 * mu * k * (up - 1 + 2 * nu) * far,
                    ],
                    [
                        -2 * mu * k * near,
                        -2 * mu * k * (down - 2 + 2 * nu) * near,
                        2 * mu * k * far,
                        2 * mu * k * (up - 2 + 2 * nu) * far,
                    ],
                ]
            )
        )
    return rows[0], rows[1]


def softness(k: float, superficial, deep) -> float:
    """Return the surface's sinking (mm/MPa) under a pressure of wave number k (1/mm)."""
    upper, lower = faces(k, *superficial), faces(k, *deep)
    system, load = np.zeros((8, 8)), np.zeros(8)
    system[:2, :4], load[0] = upper[0][2:], -1.0
    system[2:6, :4], system[2:6, 4:] = upper[1], -lower[0]
    system[6:, 4:] = lower[1][:2]
    return float(upper[0][1] @ np.linalg.solve(system, load)[:4])


def stiffness_factor(contact: float, superficial, deep) -> float:
    """Return the force over that on a half space of the superficial tissue."""
    h, mu, nu = superficial
    s = np.linspace(1e-4, 12.0, 600) / h
    T = np.array([softness(k, superficial, deep) for k in s]) * mu * s / (1 - nu)
    x, weights = np.polynomial.legendre.leggauss(40)
    x, weights = (x + 1) / 2 * contact, weights / 2 * contact

    def G(u):
        return np.trapezoid((1 - T) * np.cos(s * u[..., None]), s)

    kernel = G(x[:, None] - x) + G(x[:, None] + x)
    matrix = np.eye(len(x)) - kernel * weights / np.pi
    return float(weights @ np.linalg.solve(matrix, np.ones_like(x))) / contact


def stiffer(ratio: float, poisson: float) -> NeoHookean:
    """Return the law of `law`, stiffer by a ratio."""
    one = law(poisson)
    return NeoHookean(ratio * one.C10, one.D1 / ratio)


def fat_on_muscle(superficial: float, deep: float, ratio: float, poisson: float):
    """Return layers of thicknesses (mm), the upper one stiffer by a ratio."""
    return (Layer("muscle", deep, law(poisson)), Layer("fat", superficial, stiffer(ratio, poisson)))


@pytest.mark.parametrize(
    ("superficial", "deep", "ratio", "poisson"),
    [
        (3.0, 7.0, 0.2, 0.45),
        pytest.param(3.0, 7.0, 5.0, 0.45, marks=pytest.mark.slow),
        pytest.param(5.0, 3.0, 0.2, 0.3, marks=pytest.mark.slow),
        pytest.param(2.0, 20.0, 4.0, 0.49, marks=pytest.mark.slow),
    ],
)
def test_the_force_is_that_of_linear_elasticity(superficial, deep, ratio, poisson):
    """Between those of the flat part and of the whole face; ratio is superficial over deep."""
    thickness = superficial + deep
    settings = AxisymmetricSettings(
        MeridianMeshSettings(0.5 * EDGE, 0.25, 0.1 * thickness),
        ContactSettings(tangential="frictionless", stiffness=4e4, onset=1e-5),
        steps=fixed_steps(DEPTH),
    )
    given = PunchOnLayer(thickness, RADIUS, EDGE, RADIUS + 6 * thickness, "frictionless")
    layers = fat_on_muscle(superficial, deep, ratio, poisson)
    solved = FlatPunchIndentation(given, layers, settings).solve(depth=DEPTH)
    assert solved.report.complete
    modulus = 2 * ratio * MU / (1 - poisson)
    layers = (superficial, ratio * MU, poisson), (deep, MU, poisson)
    least, most = (2 * a * stiffness_factor(a, *layers) * modulus * DEPTH for a in (RADIUS - EDGE, RADIUS))
    force = float(solved.curve.force[-1])
    print(superficial, deep, ratio, force / least - 1, force / most - 1)
    assert 0.99 * least < force < most


def test_the_closed_form_of_equal_layers_is_that_of_one():
    layers = (4.0, MU, 0.45), (6.0, MU, 0.45)
    assert stiffness_factor(5.0, *layers) == pytest.approx(kappa(0.5, 0.45, "bonded"), rel=1e-3)


SETTINGS = AxisymmetricSettings(MeridianMeshSettings(0.375, 0.35, 6.0), steps=StepSettings(first=0.3, largest=0.8))


ON_25 = {
    "flat punch": (FlatPunchIndentation, PunchOnLayer(25.0, 10.0, 1.5, 50.0)),
    "ball": (BallIndentation, BallOnLayer(25.0, 10.0, 50.0)),
    "cylinder": (LateralCylinder, CylinderOnBlock(25.0, 80.0, 40.0, 10.0)),
}


@pytest.mark.parametrize("name", ON_25)
def test_equal_layers_are_one_layer_in_finite_strain(name: str) -> None:
    kind, given = ON_25[name]
    three = tuple(Layer(f"layer{k}", h, law(0.49)) for k, h in enumerate((12.0, 8.0, 5.0)))
    layered = kind(given, three, SETTINGS).solve(depth=7.0)
    one = kind(given, law(0.49), SETTINGS).solve(depth=7.0)
    print(name, layered.curve.force[-1] / one.curve.force[-1] - 1)
    assert layered.report.complete
    assert layered.curve.force[-1] == pytest.approx(one.curve.force[-1], rel=5e-3)


@pytest.fixture(scope="module")
def soft_on_stiff():
    given, layers = PunchOnLayer(20.0, 10.0, 1.5, 50.0), fat_on_muscle(5.0, 15.0, 0.3, 0.49)
    return [
        FlatPunchIndentation(given, layers, AxisymmetricSettings(mesh, steps=SETTINGS.steps)).solve(depth=5.0)
        for mesh in (SETTINGS.mesh, SETTINGS.mesh.refined(2.0))
    ]


def lost(solved, name: str) -> np.ndarray:
    """Return what a layer has lost of its thickness at the axis, mm."""
    thickness = solved.path.channels[f"{name}_thickness"]
    return thickness[0] - thickness


def test_a_finer_mesh_tells_the_same(soft_on_stiff):
    coarse, fine = soft_on_stiff
    print(coarse.path.force[-1] / fine.path.force[-1] - 1, lost(coarse, "fat")[-1] / lost(fine, "fat")[-1] - 1)
    assert coarse.path.force[-1] == pytest.approx(fine.path.force[-1], rel=5e-3)
    assert lost(coarse, "fat")[-1] == pytest.approx(lost(fine, "fat")[-1], rel=1e-2)


def test_the_layers_lose_what_the_punch_takes(soft_on_stiff):
    coarse, _ = soft_on_stiff
    assert coarse.report.complete
    both = lost(coarse, "fat") + lost(coarse, "muscle")
    np.testing.assert_allclose(lost(coarse, "tissue"), both, atol=1e-12)
    assert both[-1] == pytest.approx(5.0, rel=5e-3)
    assert all((np.diff(lost(coarse, name)) > 0).all() for name in ("fat", "muscle"))
    # The softer layer loses the greater share of its thickness, and less than its softness says.
    fat, muscle = lost(coarse, "fat")[-1] / 5.0, lost(coarse, "muscle")[-1] / 15.0
    assert muscle < fat < muscle / 0.3


def test_derivatives_by_each_layer_s_stiffness_are_those_of_differences():
    """Of a ball; the contact's penalty is in proportion to all of them."""
    ball = BallIndentation(
        BallOnLayer(20.0, 8.0, 40.0),
        fat_on_muscle(5.0, 15.0, 0.3, 0.45),
        AxisymmetricSettings(MeridianMeshSettings(1.5, 0.35, 6.0), steps=fixed_steps(0.5)),
    )
    names = ("fat.C10", "muscle.C10")
    solved = ball.solve(None, 2.0, names)
    for name in names:
        own, step = ball.parameters[name], 1e-4
        ends = [ball.solve({name: own * factor}, 2.0).curve for factor in (1 + step, 1 - step)]
        slope = (ends[0].force[-1] - ends[1].force[-1]) / (2 * step * own)
        assert solved.curve.sensitivities[name][-1] == pytest.approx(slope, rel=1e-4)
        for layer in ("fat_thickness", "muscle_thickness"):
            up, down = (end.channels[layer][-1] for end in ends)
            found = solved.curve.channel_sensitivities[layer][name][-1]
            assert found == pytest.approx((up - down) / (2 * step * own), rel=1e-3)


def test_layers_that_do_not_fill_the_body_are_refused():
    with pytest.raises(InputError, match="thickness"):
        Layer("fat", 0.0, law(0.49))
    given = BallOnLayer(25.0, 5.0, 40.0)
    with pytest.raises(InputError, match="20 mm together, and the body is 25 mm"):
        _ = BallIndentation(given, fat_on_muscle(5.0, 15.0, 1.0, 0.45)).interfaces
