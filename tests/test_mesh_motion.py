"""A section's mesh moved with its outlines: where it moves, and what the force says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
import shapely.ops
from making_mechanics import COARSE, subject_3

from legfem.experiments.experiment import Solved
from legfem.fem.compat import cell_nodes
from legfem.geometry.section import BONES, PARTS, LegSection, smooth_closed_curve
from legfem.meshing.section import MeshMotion, SectionMesh, mesh_section, moved_section_mesh

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


@pytest.mark.parametrize("motion", [m for m in MOTIONS if m.outline not in BONES], ids=str)
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


@pytest.mark.parametrize("bone", BONES)
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
        **{bone: along(ring(section, bone), 60) for bone in BONES},
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
        moved = moved_section_mesh(plain, motion, section, indenter.radius, indenter.aim)
        after = quality(moved)
    finally:
        plain.mesh.geometry.x[:] = mesh
    assert np.all(after * way > 0)
    assert (after * way).min() > 0.5 * (before * way).min()
    # The cylinder touches the leg where it now is: sooner where the skin came out.
    if motion.outline == "skin" and motion.arc == 0.0:
        way_back = -(moved.touch - plain.touch) @ plain.direction
        assert way_back == pytest.approx(motion.size, abs=0.3)
    # The mesh's skin is a spline through the contour's points, some micrometres off the polygon.
    if motion.outline != "skin":
        np.testing.assert_allclose(moved.touch, plain.touch, atol=5e-3)


def moved_section(section: LegSection, motion: MeshMotion, plain: SectionMesh) -> LegSection:
    """Return a section whose contours are moved, to be meshed anew; fine enough for the hat."""
    parts = {}
    for part in PARTS:
        points = smooth_closed_curve(section.contour(part)).evenly(800)
        parts[part] = points + motion.displacement(points, section, plain.touch, plain.direction)
    return LegSection(**parts, fascia_thickness=section.fascia_thickness)


def test_a_leg_moved_from_geometry_to_geometry_is_meshed_once_and_has_the_force_of_another_mesh(monkeypatch):
    """Outlines beside first touch and at it, a bone, and the first again: none remembers where the last ones were."""
    from legfem.experiments import plane_strain
    from legfem.inverse.body_models import Displaced
    from legfem.inverse.mechanism import Solution
    from legfem.legs.finite_element_models import LegVariants
    from legfem.solve.protocol import Protocol

    section, indenter, tissues = subject_3()
    settings = plane_strain.PlaneStrainSettings(mesh=COARSE)
    base = plane_strain.PlaneStrainIndentation(section, indenter, tissues, settings)
    made: list[SectionMesh] = []
    meshing = plane_strain.mesh_section
    monkeypatch.setattr(plane_strain, "mesh_section", lambda *given: made.append(meshing(*given)) or made[-1])
    variants, loading = LegVariants(base), Protocol.ramp(6.0, 1.0)

    def solved(motion: MeshMotion | None) -> Solved:
        geometry = None if motion is None else Displaced("", motion, None)
        return variants.follow(loading, {}, Solution(), geometry=geometry)

    before = solved(None)
    followed = [solved(motion) for motion in (MOTIONS[0], MOTIONS[7], MOTIONS[8], MOTIONS[0])]
    assert len(made) == 2, "the leg as it is, and one that is moved"
    np.testing.assert_array_equal(solved(None).curve.force, before.curve.force)
    np.testing.assert_array_equal(followed[0].curve.force, followed[3].curve.force)
    assert np.abs(followed[0].curve(5.0) / before.curve(5.0) - 1) > 1e-3, "the motion tells something"
    for motion, found in zip((MOTIONS[0], MOTIONS[7], MOTIONS[8]), followed, strict=False):
        anew = replace(base, moved=motion).solve(protocol=loading)
        np.testing.assert_array_equal(found.curve.displacement, anew.curve.displacement)
        np.testing.assert_allclose(found.curve.force, anew.curve.force, rtol=1e-10)
        for name, course in anew.path.channels.items():
            np.testing.assert_allclose(found.path.channels[name], course, rtol=1e-8, atol=1e-10, err_msg=name)


@pytest.mark.slow
@pytest.mark.parametrize(
    "motion", [MeshMotion("skin", size=1.0), MeshMotion("fascia", size=1.0), MeshMotion("tibia")], ids=str
)
def test_the_force_s_change_agrees_with_that_of_another_mesh_of_the_moved_contours(motion):
    """Within the noise that another mesh brings (that of two meshes of one leg), and a tenth."""
    from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings

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
    moved = force(replace(first, moved=motion)) / before - 1
    anew = force(PlaneStrainIndentation(there, indenter, tissues, settings)) / before - 1
    assert np.abs(moved).max() > 5e-3, "the motion tells something"
    # A mesh's edges miss the hat's crest by up to this, and first touch is there.
    crest = 0.5 * settings.mesh.contact_size * motion.size / motion.width
    touch = crest * np.gradient(before, d) / before if motion.outline == "skin" else 0.0
    apart = np.abs(moved - anew)
    assert np.all(apart < max(3 * noise.max(), 0.1 * np.abs(moved).max()) + touch)
