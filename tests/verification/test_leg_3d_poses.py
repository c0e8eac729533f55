"""A leg pressed in 3D in other poses: turned bodies, balance of forces, exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from legfem.experiments.indenter_pose import Ball, Cylinder, LegIndenter, Pose, Punch
from legfem.experiments.leg_3d import LegIndentation3D, SolidLegSettings
from legfem.geometry.leg_shape import LegShape
from legfem.mechanics.materials import NeoHookean
from legfem.mechanics.terms import Fibres
from legfem.meshing.leg_sizes import SolidMeshSettings

pytestmark = pytest.mark.slow
C10 = 1e-3
TISSUES = {"deep": NeoHookean(C10, 28.0), "superficial": NeoHookean(2e-3, 22.5)}
COARSE = SolidMeshSettings(
    skin_size=30.0, inside_size=40.0, bone_size=20.0, layer_elements=0.2, turn_elements=3.0, enclosing=True
)
FLAT = SolidMeshSettings(skin_size=14.0, inside_size=20.0, bone_size=9.0, layer_elements=0.5)
CYLINDER, PUNCH = Cylinder(radius=10.0, length=24.0), Punch(radius=8.0, length=20.0)


def slab(half: float = 40.0) -> LegShape:
    """Return a flat body, as long as it is wide: to what stands on it both ways are alike."""

    def block(within: float) -> np.ndarray:
        edge = shapely.box(25.0 - half, -15.0, half - 25.0, 15.0).buffer(25.0 - within).exterior
        points = edge.interpolate(np.linspace(0, 1, 160, endpoint=False), normalized=True)
        return shapely.get_coordinates(points)

    angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    levels = np.linspace(-half, half, 7)
    parts = {
        "skin": block(0.0),
        "hull": block(10.0),
        "tibia": 9.0 * np.column_stack([np.cos(angle), np.sin(angle)]) + (0.0, -18.0),
    }
    return LegShape(levels, {part: np.tile(xy, (7, 1, 1)) for part, xy in parts.items()})


def round_leg() -> LegShape:
    angle = np.linspace(0, 2 * np.pi, 96, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    levels = np.linspace(-32, 32, 9)
    radii = {"skin": 40.0, "hull": 31.0, "tibia": 12.0}
    return LegShape(levels, {p: np.tile(r * ring, (len(levels), 1, 1)) for p, r in radii.items()})


def pressed(
    given: LegIndenter,
    axis_deg: float,
    ratio: float = 1.0,
    shape: LegShape | None = None,
    mesh: SolidMeshSettings = COARSE,
) -> LegIndentation3D:
    fibres = () if ratio == 1 else (Fibres.of_ratio("deep", C10, ratio),)
    return LegIndentation3D(
        shape or round_leg(),
        given,
        Pose((0.0, 0.0), 0.0, 270.0, axis_deg),
        TISSUES,
        settings=SolidLegSettings(mesh=mesh, contact_size=5.0),
        mechanisms=fibres,
    )


def test_on_a_flat_body_that_is_alike_in_all_directions_a_cylinder_may_lie_as_it_will():
    at = np.array([2.0, 3.0, 4.0, 5.0])
    forces = []
    for axis_deg in (0.0, 90.0):
        solved = pressed(CYLINDER, axis_deg, shape=slab(), mesh=FLAT).solve(depth=5.0)
        assert solved.report.complete
        forces.append(solved.curve(at))
    print(np.array(forces) / forces[0])
    np.testing.assert_allclose(forces[1], forces[0], rtol=0.025)


@pytest.fixture(scope="module")
def across():
    """Press a cylinder that lies across a leg with fibres, with derivatives."""
    by = ("deep.C10", *Fibres("deep").parameters)
    test = pressed(CYLINDER, 90.0, 2.0)
    solved = test.solve(depth=4.0, sensitivities=by)
    assert solved.report.complete
    return test, solved.curve, test.system.balance()


def test_forces_balance_under_a_cylinder_across_the_leg(across):
    _, curve, balance = across
    total = balance.contact_force[:2] + balance.bone_reaction[:2]
    assert np.abs(total).max() < 1e-6 * np.abs(balance.contact_force).max()
    assert np.abs(balance.contact_force[0]) < 0.02 * np.abs(balance.contact_force[1])
    assert np.linalg.norm(balance.contact_force) == pytest.approx(curve.force[-1], rel=1e-3)


@pytest.mark.parametrize("name", ["deep.C10", *Fibres("deep").parameters])
def test_derivatives_across_the_leg_are_those_of_solves_beside(across, name):
    test, curve, _ = across
    at, step = np.array([2.0, 3.0, 4.0]), 1e-2 * C10
    value = test.parameters[name]
    up, down = (test.solve({name: value + side * step}, 4.0).curve(at) for side in (1, -1))
    np.testing.assert_allclose(curve.sensitivity(name, at), (up - down) / (2 * step), rtol=0.01)


def test_fibres_along_the_leg_stiffen_it_less_under_a_cylinder_across_them(across):
    """A cylinder across bends the fibres along all of its length, one along them at its ends."""
    rises = []
    for given, axis_deg in ((CYLINDER, 0.0), (CYLINDER, 90.0), (Ball(10.0), 0.0), (PUNCH, 0.0)):
        plain, fibrous = (pressed(given, axis_deg, ratio).solve(depth=4.0).curve(4.0) for ratio in (1.0, 3.0))
        rises.append(fibrous / plain - 1)
    print(rises)
    along, other, ball, punch = rises
    assert 0.1 < along < ball < punch < other < 0.3
    assert other > 1.5 * along
