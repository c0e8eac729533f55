"""A section's mesh moved with its outlines: where it moves, and what the force says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import shapely
import shapely.ops
from making_mechanics import COARSE, subject_3

from legfem.channels.laid import WAYS, laid_course
from legfem.common.units import FloatArray
from legfem.experiments.plane_strain import LateralPlacement, PlaneStrainIndentation, PlaneStrainSettings
from legfem.fem.compat import cell_nodes
from legfem.geometry.indenter import Indenter, first_touch
from legfem.geometry.section import CALF, LIMBS, LegSection, smooth_closed_curve
from legfem.legs.finite_element_models import COARSENING
from legfem.legs.nuisances import errors_of_geometry
from legfem.meshing.section import MeshMotion, SectionMesh, mesh_section
from legfem.solve.path import Path

MOTIONS = [
    *(
        MeshMotion(part, arc, size=size)
        for part in ("skin", "fascia")
        for arc, size in ((0.0, 1.0), (0.0, -1.0), (40.0, 1.0), (-20.0, -1.0))
    ),
    MeshMotion("tibia", size=1.0),
    MeshMotion("tibia", size=-1.0),
    MeshMotion("fibula", size=1.0, turned=90.0),
]


@pytest.fixture(scope="module")
def leg():
    section, indenter, _ = subject_3()
    return section, indenter


def meshed(leg) -> SectionMesh:
    section, indenter = leg
    return mesh_section(section, indenter.radius, indenter.aim, indenter.direction, COARSE)


@pytest.fixture(scope="module")
def plain(leg):
    return meshed(leg)


def moved(given: SectionMesh, motion: MeshMotion, section: LegSection, indenter: Indenter) -> SectionMesh:
    """Move a section's mesh in place, and return it with its new first touch."""
    x = given.mesh.geometry.x
    x[:, :2] += motion.displacement(x[:, :2].copy(), section, given.touch, given.direction)
    outline = given.outline + motion.displacement(given.outline, section, given.touch, given.direction)
    return replace(given, outline=outline, touch=first_touch(outline, indenter.radius, indenter.aim, given.direction))


def along(line: shapely.LinearRing, count: int = 400) -> np.ndarray:
    at = np.linspace(0, line.length, count, endpoint=False)
    return shapely.get_coordinates(shapely.line_interpolate_point(line, at))


def ring(section: LegSection, part: str) -> shapely.LinearRing:
    return section.polygon(part).exterior


def inner_face(section: LegSection) -> np.ndarray:
    inner = section.polygon("fascia").buffer(-section.fascia_thickness)
    return along(shapely.LinearRing(inner.exterior.coords))


def shift(motion: MeshMotion, points: np.ndarray, leg, plain: SectionMesh) -> np.ndarray:
    return motion.displacement(points, leg[0], plain.touch, plain.direction)


def test_nothing_moves_by_a_motion_of_no_size(leg, plain):
    points = plain.mesh.geometry.x[:, :2].copy()
    for motion in MOTIONS:
        assert not np.any(shift(replace(motion, size=0.0), points, leg, plain))


@pytest.mark.parametrize("motion", [m for m in MOTIONS if m.outline not in LIMBS[CALF]], ids=str)
def test_an_outline_moves_by_the_size_at_the_hat_s_top_and_not_beyond_its_foot(motion, leg, plain):
    section, _ = leg
    skin = ring(section, "skin")
    touch = shapely.Point(*plain.touch)
    arc = (shapely.line_locate_point(skin, touch) + motion.arc) % skin.length
    top = np.array(shapely.line_interpolate_point(skin, arc).coords)
    if motion.outline == "fascia":
        top = np.array(shapely.ops.nearest_points(ring(section, "fascia"), shapely.Point(top))[0].coords)
    moved = shift(motion, top, leg, plain)[0]
    assert np.linalg.norm(moved) == pytest.approx(abs(motion.size), rel=0.1)
    outline = section.polygon(motion.outline)
    out = shapely.Point(*(top[0] + 0.2 * moved / np.linalg.norm(moved)))
    assert outline.contains(out) == (motion.size < 0), "outwards at a size above zero"
    points = along(ring(section, motion.outline))
    moves = np.linalg.norm(shift(motion, points, leg, plain), axis=1)
    assert moves.max() <= abs(motion.size) * (1 + 1e-9)
    far = np.linalg.norm(points - top[0], axis=1) > 1.6 * motion.width
    assert far.any() and not np.any(moves[far])


@pytest.mark.parametrize("bone", LIMBS[CALF])
def test_a_bone_moves_as_one(bone, leg, plain):
    """Along the travel, or to its left."""
    section, _ = leg
    left = np.array([-plain.direction[1], plain.direction[0]])
    for turned, way in ((0.0, plain.direction), (90.0, left)):
        moved = shift(MeshMotion(bone, size=0.8, turned=turned), along(ring(section, bone), 60), leg, plain)
        np.testing.assert_allclose(moved, 0.8 * np.tile(way, (60, 1)), atol=1e-6)


@pytest.mark.parametrize("motion", MOTIONS, ids=str)
def test_other_outlines_stay(motion, leg, plain):
    section, _ = leg
    others = {
        "skin": along(ring(section, "skin")),
        "fascia": along(ring(section, "fascia")),
        **{bone: along(ring(section, bone), 60) for bone in section.bones},
    }
    del others[motion.outline]
    for points in others.values():
        np.testing.assert_allclose(shift(motion, points, leg, plain), 0.0, atol=1e-6)


def test_the_fascia_keeps_its_thickness(leg, plain):
    """Its inner face moves as its outer one does, where the hat lets it."""
    section, _ = leg
    motion = MeshMotion("fascia", size=1.0)
    inner = inner_face(section)
    outer_ring = ring(section, "fascia")
    outer = shapely.get_coordinates(
        shapely.line_interpolate_point(outer_ring, shapely.line_locate_point(outer_ring, shapely.points(inner)))
    )
    apart = shift(motion, outer, leg, plain) - shift(motion, inner, leg, plain)
    assert np.linalg.norm(apart, axis=1).max() < 0.1


def quality(given: SectionMesh) -> np.ndarray:
    """Return triangles' area over that of the equilateral one with their longest side."""
    corners = given.mesh.geometry.x[cell_nodes(given.mesh)[:, :3], :2]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    longest = np.max([np.linalg.norm(v, axis=1) for v in (a, b, b - a)], axis=0)
    return area / (np.sqrt(3) / 4 * longest**2)


@pytest.mark.parametrize("motion", MOTIONS, ids=str)
def test_a_moved_mesh_stays_sound(motion, leg, plain):
    """Two standard deviations of an outline either way: no element turns over or becomes a film."""
    section, indenter = leg
    before = quality(plain)
    way = np.sign(before[0])
    mesh = plain.mesh.geometry.x.copy()
    try:
        there = moved(plain, motion, section, indenter)
        after = quality(there)
    finally:
        plain.mesh.geometry.x[:] = mesh
    assert np.all(after * way > 0)
    assert (after * way).min() > 0.5 * (before * way).min()
    # The cylinder touches the leg where it now is: sooner where the skin came out.
    if motion.outline == "skin" and motion.arc == 0.0:
        way_back = -(there.touch - plain.touch) @ plain.direction
        assert way_back == pytest.approx(motion.size, abs=0.3)
    # The mesh's skin is a spline through the contour's points, some micrometres off the polygon.
    if motion.outline != "skin":
        np.testing.assert_allclose(there.touch, plain.touch, atol=5e-3)


def moved_section(section: LegSection, motion: MeshMotion, plain: SectionMesh) -> LegSection:
    """Return a section whose contours are moved, to be meshed anew; fine enough for the hat."""
    parts = {}
    for part in section.parts:
        points = smooth_closed_curve(section.contour(part)).evenly(800)
        parts[part] = points + motion.displacement(points, section, plain.touch, plain.direction)
    return LegSection.of_parts(parts, section.fascia_thickness)


def moved_test(test: PlaneStrainIndentation, motion: MeshMotion) -> PlaneStrainIndentation:
    """Return the test on a mesh of its own that is moved."""
    return replace(test, meshed=moved(meshed((test.section, test.indenter)), motion, test.section, test.indenter))


ERRORS = {
    **{f"{m.outline} at {m.arc:g}, {m.turned:g}": replace(m, size=0.5) for m in (MOTIONS[0], MOTIONS[3], MOTIONS[4])},
    "tibia": MOTIONS[8],
    "fibula": MOTIONS[10],
}
NEAR, SMALL = 3e-4, 0.1
SLIDING = MeshMotion("skin", width=120.0, size=1.0, along=True)


@pytest.fixture(scope="module")
def pressed():
    """A coarse section, and its path with derivatives by errors of outlines."""
    test = PlaneStrainIndentation(*subject_3(), PlaneStrainSettings(mesh=COARSE), motions=ERRORS)
    return test, test.solve(depth=6.0, sensitivities=tuple(ERRORS)).path


@pytest.mark.parametrize("name", ERRORS)
def test_a_derivative_by_an_outline_is_the_difference_of_two_moved_legs(name, pressed):
    """Of the force and of every channel, at rest, too, where all take the same steps: mesh and error are the same."""
    test, path = pressed
    ahead, behind = (
        moved_test(test, replace(ERRORS[name], size=way * SMALL * ERRORS[name].size)).solve(depth=6.0).path
        for way in (1.0, -1.0)
    )
    steps = [*range(6), -1]
    for one in (ahead, behind):
        np.testing.assert_allclose(one.displacement[steps], path.displacement[steps])

    def slope(course: Callable[[Path], FloatArray]) -> FloatArray:
        return (course(ahead)[steps] - course(behind)[steps]) / (2 * SMALL)

    by_force = slope(lambda one: one.force)
    np.testing.assert_allclose(path.sensitivities[name][steps], by_force, atol=NEAR * path.force.max())
    assert np.abs(by_force[1:] / path.force[steps][1:]).max() > 1e-3, "the motion tells something"
    images = tuple(laid_course("", way) for way in WAYS)
    stated = [course for course in path.channels if not course.endswith(images)]
    assert {"fat_thickness", "muscle_thickness", "lateral_force"} <= set(stated)
    for course in stated:
        expected = slope(lambda one, course=course: one.channels[course])
        near = 3e-3 * max(1.0, np.abs(expected).max())
        found = path.channel_sensitivities[course][name][steps]
        np.testing.assert_allclose(found, expected, atol=near, err_msg=course)


@pytest.mark.parametrize(("name", "near"), [("aim", 1.5e-3), ("direction", 3e-3)])
def test_a_derivative_by_the_line_of_travel_is_smooth_where_a_difference_is_about_it(name, near):
    """The skin's elements follow the cylinder: within what they do to a difference, for which it moves over them."""
    error = errors_of_geometry(LIMBS[CALF])[name]
    settings = PlaneStrainSettings(mesh=PlaneStrainSettings().mesh.refined(1 / COARSENING))
    test, at = PlaneStrainIndentation(*subject_3(), settings, motions={name: error}), np.array([3.0, 6.0, 9.0])
    path = test.solve(depth=9.0, sensitivities=[name]).path
    ahead, behind = (
        test.solve(depth=9.0, placement=LateralPlacement(way * error.tilt_deg, way * error.offset_mm)).path
        for way in (1.0, -1.0)
    )
    expected = 0.5 * (ahead.force_at(at) - behind.force_at(at)) / path.force_at(at)
    np.testing.assert_allclose(path.sensitivity_at(name, at) / path.force_at(at), expected, atol=near)
    assert np.abs(expected).max() > 2 * near


def test_a_shift_leaves_mesh_and_cylinder_where_they_were(pressed):
    test, path = pressed
    again = PlaneStrainIndentation(test.section, test.indenter, test.tissues, test.settings).solve(depth=6.0)
    np.testing.assert_array_equal(again.curve.force, test.solve(depth=6.0).curve.force)
    np.testing.assert_allclose(again.curve.force, path.force, rtol=1e-7)


def test_skin_slides_along_itself_to_the_left_of_the_travel(leg, plain):
    section, _ = leg
    slid = shift(SLIDING, plain.outline, leg, plain)
    top = np.argmax(np.linalg.norm(slid, axis=1))
    left = np.array([-plain.direction[1], plain.direction[0]])
    assert slid[top] @ left == pytest.approx(1.0, abs=0.05)
    line = ring(section, "skin")
    before, after = (shapely.distance(shapely.points(x), line) for x in (plain.outline, plain.outline + slid))
    assert np.abs(after - before).max() < 0.02, "the leg's shape stays"
    assert not np.any(shift(SLIDING, along(ring(section, "fascia")), leg, plain) > 1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    "motion", [MeshMotion("skin", size=1.0), MeshMotion("fascia", size=1.0), MeshMotion("tibia")], ids=str
)
def test_the_force_s_change_agrees_with_that_of_another_mesh_of_the_moved_contours(motion):
    """Within the noise that another mesh brings (that of two meshes of one leg), and a tenth."""
    section, indenter, tissues = subject_3()
    settings = PlaneStrainSettings()
    first = PlaneStrainIndentation(section, indenter, tissues, settings)
    d = np.linspace(5.0, 15.0, 11)

    def force(test: PlaneStrainIndentation) -> np.ndarray:
        return np.asarray(test.solve(depth=15.5).curve(d))

    before = force(first)
    there = moved_section(section, motion, first.section_mesh)
    finer = replace(settings, mesh=settings.mesh.refined(1.1))
    noise = np.abs(force(PlaneStrainIndentation(section, indenter, tissues, finer)) / before - 1)
    after = force(replace(first, meshed=moved(first.section_mesh, motion, section, indenter))) / before - 1
    anew = force(PlaneStrainIndentation(there, indenter, tissues, settings)) / before - 1
    assert np.abs(after).max() > 5e-3, "the motion tells something"
    # A mesh's edges miss the hat's crest by up to this, and first touch is there.
    crest = 0.5 * settings.mesh.contact_size * motion.size / motion.width
    touch = crest * np.gradient(before, d) / before if motion.outline == "skin" else 0.0
    apart = np.abs(after - anew)
    assert np.all(apart < max(3 * noise.max(), 0.1 * np.abs(after).max()) + touch)
