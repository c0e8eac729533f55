"""The idealised leg: its mesh, the finite cylinder, symmetry, and the limit of plane strain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.experiments.indenter_pose import Cylinder
from legfem.experiments.leg_3d import IdealisedLegIndentation, IdealisedLegSettings
from legfem.inverse.correction import smooth_ratio
from legfem.mechanics.indenters import FiniteCylinder
from legfem.mechanics.materials import ReducedPolynomial
from legfem.meshing.section import BONE, SKIN
from legfem.meshing.structured import IdealisedLeg, LegMeshSettings, mesh_leg
from legfem.solve.linear import LinearSettings
from legfem.study.correction.cases import CorrectionCase, Material, solve_case
from legfem.study.correction.command import write_leg_fields

DEEP = {"deep": ReducedPolynomial(2e-3, 28.0, 0.0)}
TINY = LegMeshSettings(contact_size=12, depth_size=20, edge_size=8, growth=0.5, far_size=40)


def pressed(leg: IdealisedLeg, dimension: int, mesh=TINY, cylinder=None, depth=2.0, **more):
    settings = IdealisedLegSettings(mesh=mesh, **more)
    test = IdealisedLegIndentation(leg, cylinder or Cylinder(), DEEP, dimension, settings)
    return test, test.solve(depth=depth)


def values(expression, points: np.ndarray, shape: tuple[int, ...] = ()) -> np.ndarray:
    """Evaluate an expression of the position at points (n, 3) within 99 mm of the origin."""
    corners = [[-99.0] * 3, [99.0] * 3]
    box = mesh.create_box(MPI.COMM_SELF, corners, [1, 1, 1], mesh.CellType.hexahedron)
    compiled = fem.Expression(expression(ufl.SpatialCoordinate(box)), (points + 99) / 198)
    return compiled.eval(box, np.array([0], dtype=np.int32)).reshape(len(points), *shape)


def test_the_finite_cylinder_is_a_signed_distance():
    shape = FiniteCylinder(15.0, 25.0, 2.0)
    x = np.random.default_rng(0).uniform(-30, 30, (200, 3))
    a, b = np.hypot(x[:, 0], x[:, 1]) - 13, np.abs(x[:, 2]) - 23
    outside = np.hypot(np.maximum(a, 0), np.maximum(b, 0))
    expected = outside + np.minimum(np.maximum(a, b), 0) - 2
    assert values(shape.gap, x) == pytest.approx(expected, abs=1e-9)


def test_its_normal_is_the_gradient_of_the_gap():
    shape = FiniteCylinder(15.0, 25.0, 2.0)
    x = np.random.default_rng(1).uniform(-30, 30, (100, 3))
    gradient = values(lambda y: ufl.grad(shape.gap(y)), x, (3,))
    normal = values(shape.normal, x, (3,))
    assert normal == pytest.approx(gradient, abs=1e-9)
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0)


def test_the_mesh_is_a_quarter_of_the_leg():
    leg = IdealisedLeg(length=80, bone_offset=5.0, fat=6.0, fascia=1.0)
    made = mesh_leg(leg, 15.0, 50.0, LegMeshSettings(contact_size=2.0))
    one = fem.Constant(made.mesh, 1.0)
    measure = ufl.Measure("dx", domain=made.mesh, subdomain_data=made.cell_tags)
    inner = leg.radius - 7
    for region, area in (
        ("superficial", leg.radius**2 - 51**2),
        ("fascia", 51**2 - inner**2),
        ("deep", inner**2 - 15**2),
    ):
        volume = fem.assemble_scalar(fem.form(one * measure(made.regions[region])))
        assert volume == pytest.approx(np.pi * area * 80 / 4, rel=0.02)
    side = ufl.Measure("ds", domain=made.mesh, subdomain_data=made.facet_tags)
    for tag, radius in ((SKIN, 57.0), (BONE, 15.0)):
        area = fem.assemble_scalar(fem.form(one * side(tag)))
        assert area == pytest.approx(np.pi * radius * 40, rel=0.02)


@pytest.mark.parametrize("formulation", [pytest.param("displacement", marks=pytest.mark.slow), "mixed"])
def test_with_held_ends_and_a_long_cylinder_3d_is_plane_strain(formulation):
    leg = IdealisedLeg(length=20, ends="held")
    cylinder = Cylinder(length=60)
    _, spatial = pressed(leg, 3, cylinder=cylinder, formulation=formulation)
    _, plane = pressed(leg, 2, cylinder=cylinder, formulation=formulation)
    assert spatial.report.complete
    # The cylinder's force is what its length would carry in plane strain, of which the leg is 1/3.
    ratio = spatial.curve(2.0) / 20 / (plane.curve(2.0) / 60)
    assert ratio == pytest.approx(1.0, abs=1e-6)


def test_forces_and_works_balance():
    test, solved = pressed(IdealisedLeg(length=60), 3, depth=3.0)
    balance = test.system.balance()
    force = balance.contact_force[1]
    assert balance.bone_reaction[1] == pytest.approx(-force, rel=1e-8)
    assert balance.internal_work == pytest.approx(balance.contact_work, rel=1e-8)
    assert solved.curve.force[-1] == pytest.approx(-4 * force)


@pytest.mark.parametrize("formulation", [pytest.param("displacement", marks=pytest.mark.slow), "mixed"])
def test_iterations_and_factors_give_the_same_force(formulation):
    leg = IdealisedLeg(length=60)
    forces = [
        pressed(leg, 3, linear=LinearSettings(solver=solver), formulation=formulation, depth=1.0)[1].curve.force[-1]
        for solver in ("direct", "iterative")
    ]
    assert forces[1] == pytest.approx(forces[0], rel=1e-6)


def test_iterations_leave_the_supports_where_they_are():
    test, _ = pressed(IdealisedLeg(length=60), 3, linear=LinearSettings(solver="iterative", tolerance=1e-3))
    system = test.system
    assert len(system.owned_supports) > 0
    assert np.all(system.unknown.x.array[system.owned_supports] == 0.0)


def test_steps_do_not_depend_on_the_linear_solver():
    walked = [
        [
            step.displacement
            for step in pressed(IdealisedLeg(length=60), 3, linear=LinearSettings(solver=solver), depth=4.0)[
                1
            ].report.steps
        ]
        for solver in ("direct", "iterative")
    ]
    assert walked[0] == walked[1]


def test_at_depth_too_3d_without_ends_is_plane_strain():
    leg = IdealisedLeg(length=50, ends="held")
    settings = IdealisedLegSettings(mesh=TINY)
    outcome = solve_case(CorrectionCase(leg, Cylinder(length=50), settings=settings, depth=25.0))
    assert outcome.complete
    at = np.array([5.0, 10.0, 15.0, 20.0, 25.0])
    P = smooth_ratio(outcome.spatial, outcome.plane, at)
    print(f"P of a cylinder without ends: {np.abs(P).max():.1e}")
    assert np.abs(P).max() < 0.005
    assert outcome.balance < 1e-8


def test_fields_of_the_leg_are_written(tmp_path):
    case = CorrectionCase(IdealisedLeg(length=60), settings=IdealisedLegSettings(mesh=TINY), depth=1.0)
    written = write_leg_fields(case, tmp_path)
    assert {path.name for path in written} >= {"fields.xdmf", "fields.h5"}
    assert all(path.exists() for path in written)


@pytest.mark.parametrize(("c10", "c20"), [(0.2, 0.2), (5.0, 0.0), (0.2, 0.8)])
def test_points_that_lift_off_under_shear_do_not_stop_the_solution(c10, c20):
    case = CorrectionCase(
        IdealisedLeg(length=90),
        material=Material(C10_kPa=c10, C20_kPa=c20),
        settings=IdealisedLegSettings(mesh=TINY),
        depth=15.0,
    )
    laws = case.material.laws
    solved = IdealisedLegIndentation(case.leg, case.cylinder, laws, 3, case.settings).solve(depth=case.depth)
    assert solved.report.complete and not solved.report.earlier_attempts


@pytest.mark.slow
def test_linear_tetrahedra_are_stiffer():
    leg = IdealisedLeg(length=60)
    linear = replace(TINY, cells="tetrahedra", degree=1, edge_size=4.0)
    _, coarse = pressed(leg, 3, mesh=linear, formulation="displacement")
    _, accurate = pressed(leg, 3)
    assert coarse.report.complete
    assert coarse.curve.force[-1] > accurate.curve.force[-1]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: IdealisedLeg(bone_radius=60.0), "bone"),
        (lambda: IdealisedLeg(bone_offset=45.0), "bone"),
        (lambda: CorrectionCase(depth=45.0), "bone"),
        (lambda: pressed(IdealisedLeg(length=50), 3), "free"),
        (lambda: pressed(IdealisedLeg(), 3, cylinder=Cylinder(edge_radius=0.3)), "resolved"),
        (lambda: pressed(IdealisedLeg(), 3, replace(TINY, cells="tetrahedra")), "mixed"),
    ],
)
def test_bad_input_is_one_line(make, words):
    with pytest.raises(InputError, match=words) as caught:
        make()
    assert "\n" not in str(caught.value)
