"""Channels of a pressed section beside its force: exact derivatives, geometry and balance."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from making_derivatives import PRECISE
from making_mechanics import COARSE, fixed_steps, subject_3

from legfem.channels.kinds import CHANNELS
from legfem.channels.kinds.contact import ContactForces
from legfem.channels.kinds.skin_rise import RISES
from legfem.channels.laid import AS_STATED, WAYS, Laid, laid_course
from legfem.channels.log import ChannelReader
from legfem.channels.seen import ReadState
from legfem.experiments.experiment import Solved
from legfem.experiments.plane_strain import LateralPlacement, PlaneStrainIndentation, PlaneStrainSettings
from legfem.fem.outlines import first_crossings
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection
from legfem.mechanics.contact import ContactSettings
from legfem.meshing.section import SectionMeshSettings
from legfem.solve.path import Path

NAMES = ("deep.C10", "superficial.C10", "superficial.D1", "fascia.C10")
THICKNESSES = ("fat_thickness", "muscle_thickness")
SETTINGS = PlaneStrainSettings(mesh=COARSE, contact=ContactSettings(onset=0.02), newton=PRECISE, steps=fixed_steps(0.5))
DEPTH = 6.0


@pytest.fixture(scope="module")
def test() -> PlaneStrainIndentation:
    return PlaneStrainIndentation(*subject_3(), SETTINGS)


@pytest.fixture(scope="module")
def solved(test) -> Solved:
    return test.solve(depth=DEPTH, sensitivities=NAMES)


def test_every_channel_is_a_known_kind(solved):
    forces = {"lateral_force", "axis_moment", "contact_width"}
    rises = {one.name for one in RISES.values()}
    seen = {*forces, *THICKNESSES, "tissue_thickness", *rises}
    assert seen <= set(CHANNELS)
    assert seen | {laid_course(name, way) for name in rises for way in WAYS} == set(solved.curve.channels)


def compare(exact: Path, ahead: Path, behind: Path, name: str, change: float) -> None:
    """Derivatives with differences; what an image does that lies elsewhere by the size of what is read in it."""
    differences = {one: (ahead.channels[one] - behind.channels[one]) / change for one in exact.channels}
    for channel, difference in differences.items():
        size = np.abs(differences[channel.partition(":")[0]]).max()
        assert np.abs(exact.channel_sensitivities[channel][name] - difference).max() < 1e-4 * size, channel


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_differences(test, solved, name):
    value, change = test.parameters[name], 1e-4
    ahead, behind = (test.solve({name: value * (1 + by)}, DEPTH).path for by in (change, -change))
    compare(solved.path, ahead, behind, name, 2 * change * value)


def test_derivatives_turn_with_the_travel(test):
    placed = {"placement": LateralPlacement(tilt_deg=12.0, offset_mm=4.0)}
    name, value, change = "superficial.C10", test.parameters["superficial.C10"], 1e-4
    exact = test.solve(depth=4.0, sensitivities=[name], **placed).path
    ahead, behind = (test.solve({name: value * (1 + by)}, 4.0, **placed).path for by in (change, -change))
    compare(exact, ahead, behind, name, 2 * change * value)


def test_force_and_lateral_force_are_the_bones_reaction(test):
    placement = LateralPlacement(tilt_deg=12.0)
    path = test.solve(depth=DEPTH, placement=placement).path
    reaction = -test.system.balance().bone_reaction * test.indenter.length
    travel = placement.travel(test.section_mesh.direction)
    assert path.force[-1] == pytest.approx(reaction @ travel, rel=1e-6)
    assert path.channels["lateral_force"][-1] == pytest.approx(reaction @ [-travel[1], travel[0]], rel=1e-6)
    assert abs(path.channels["lateral_force"][-1]) > 0.02 * path.force[-1]


def test_thicknesses_at_first_touch_are_the_section_s(test, solved):
    section, indenter = test.section, test.indenter
    line = shapely.LineString([indenter.aim - 200 * indenter.direction, indenter.aim + 200 * indenter.direction])

    def place(polygon: shapely.Polygon) -> float:
        return float(((shapely.get_coordinates(line & polygon.exterior) - indenter.aim) @ indenter.direction).min())

    skin = place(shapely.Polygon(test.section_mesh.outline))
    fascia, bone = (
        place(section.polygon("fascia")),
        min(place(section.polygon(b)) for b in ("tibia", "fibula") if line.intersects(section.polygon(b))),
    )
    inner = place(section.polygon("fascia").buffer(-section.fascia_thickness))
    channels = solved.path.channels
    # Beside the skin's corners, outlines are smoothed and meshed: 0.05 mm.
    assert channels["fat_thickness"][0] == pytest.approx(fascia - skin, abs=0.05)
    assert channels["muscle_thickness"][0] == pytest.approx(bone - inner, abs=0.05)
    assert all(channels[kind.name][0] == 0.0 for kind in RISES.values())


def test_the_skin_under_the_cylinder_is_as_deep_as_the_cylinder(test, solved):
    """Layers, fascia and what the skin has sunk add up: the bone doesn't move."""
    channels, path = solved.path.channels, solved.path
    lost = sum(channels[name][0] - channels[name] for name in THICKNESSES)
    # The fascia is 0.5 mm thick and the contact's penalty lets the cylinder sink in a little.
    assert np.abs(lost - path.displacement)[1:].max() < 0.25
    assert all((np.diff(channels[name]) < 0).all() for name in THICKNESSES)


@pytest.mark.parametrize("tilt", [0.0, 12.0])
def test_the_skin_beside_is_where_its_deformed_polygon_is(test, tilt):
    """Against shapely on the deformed skin's nodes, whose chords are a little inside; a tilt doesn't turn the image."""
    rises = test.solve(depth=DEPTH, placement=LateralPlacement(tilt_deg=tilt)).path.channels
    system, travel = test.system, test.section_mesh.direction
    left = np.array([-travel[1], travel[0]])
    nodes = system.spaces.skin_space.tabulate_dof_coordinates()[:, :2]
    moved = nodes + system.skin.domain.unknown.x.array.reshape(-1, 2)
    edges = system.spaces.skin_space.dofmap.list
    halves = np.concatenate([edges[:, [0, 2]], edges[:, [2, 1]]])

    def rise(beside: float, image: Laid = AS_STATED) -> float:
        way, start = image.turned(travel), test.section_mesh.touch
        origin = image.truly(start + beside * left - 200 * travel, start)
        line = shapely.LineString([origin, origin + 400 * way])
        before, after = (line & shapely.MultiLineString(list(points[halves])) for points in (nodes, moved))
        place = [((shapely.get_coordinates(crossing) - origin) @ way).min() for crossing in (before, after)]
        return float(place[0] - place[1])

    for beside, kind in RISES.items():
        assert rises[kind.name][-1] == pytest.approx(rise(beside), abs=0.02)
        for name, image in WAYS.items():
            elsewhere = 0.5 * (rise(beside, image) - rise(beside, image.other_side))
            assert rises[laid_course(kind.name, name)][-1] == pytest.approx(elsewhere, abs=0.02)


def symmetric() -> tuple[LegSection, Indenter]:
    turn = 2 * np.pi * (np.arange(240) + 0.5) / 240
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    bones = {"tibia": 9 * circle + [-18, 0], "fibula": 9 * circle + [18, 0]}
    section = LegSection(50 * circle, 43 * circle, bones, fascia_thickness=0.6)
    return section, Indenter(15.0, 50.0, np.array([0.0, 0.0]), -90.0)


def test_a_symmetric_leg_has_no_lateral_force_and_no_bone_ahead():
    """The line passes between the bones: there is no muscle thickness. The mesh isn't symmetric: 0.3 %."""
    *_, tissues = subject_3()
    settings = replace(SETTINGS, mesh=SectionMeshSettings())
    path = PlaneStrainIndentation(*symmetric(), tissues, settings).solve(depth=8.0).path
    assert "muscle_thickness" not in path.channels
    assert np.abs(path.channels["lateral_force"]).max() < 3e-3 * path.force[-1]
    left, right = (path.channels[RISES[beside].name][-1] for beside in (25.0, -25.0))
    assert left == pytest.approx(right, rel=0.02)


def test_a_line_meets_a_patch_that_is_stretched_uniformly_where_geometry_says():
    """Two edges of a straight outline, sheared and compressed; the line meets their common node."""
    ends = np.array([[[-2.0, 1.0], [0.0, 1.0]], [[0.0, 1.0], [3.0, 1.0]]])
    nodes = np.concatenate([ends, ends.mean(axis=1, keepdims=True)], axis=1)
    strain = np.array([[0.1, 0.3], [0.05, -0.2]])
    moved = nodes + nodes @ strain.T
    down = np.array([[0.0, -1.0]])
    found = first_crossings(moved, np.array([[0.4, 5.0]]), down)
    # x = 1.1 X + 0.3 and y = 0.05 X + 0.8 on the outline Y = 1.
    at = (0.4 - 0.3) / 1.1
    assert found.along[0] == pytest.approx(5.0 - (0.05 * at + 0.8), rel=1e-12)
    # By the size of the strain, the place at 0.4 changes as that of the same formula.
    rate = found.rates((nodes @ strain.T)[None], down)[0, 0]
    step = 1e-6
    further = (0.4 - 0.3 * (1 + step)) / (1 + 0.1 * (1 + step))
    change = (1 - 0.2 * (1 + step) + 0.05 * (1 + step) * further) - (0.05 * at + 0.8)
    assert rate == pytest.approx(-change / step, rel=1e-5)


def test_a_line_beside_an_outline_meets_nothing():
    edge = np.array([[[0.0, 0.0], [1.0, 0.0], [0.5, 0.1]]])
    down = np.array([0.0, -1.0])
    beside, past, through = np.array([[2.0, 5.0], [3.2, 5.0], [0.5, 5.0]])
    found = first_crossings(edge, np.array([beside, through, past]), np.array([down, down, down]))
    assert np.isnan(found.along).tolist() == [True, False, True]


def test_forces_in_3d_turn_with_the_travel():
    """To the left of the travel as in a section, and along the leg; both are channels that the model in 3D gives."""
    direction = np.array([0.6, -0.8, 0.0])
    reader = ChannelReader(SimpleNamespace(direction=direction), (ContactForces(),))
    force = 2.0 * direction + 0.5 * np.array([0.8, 0.6, 0.0]) + np.array([0.0, 0.0, 0.1])
    read = reader.read(
        ReadState(np.zeros(0), np.zeros((1, 0)), force, 3.0 * force[None], np.zeros((0, 3)), np.zeros((1, 0, 3)))
    )
    assert read["lateral_force"][0] == pytest.approx(0.5) and read["axial_force"][0] == pytest.approx(0.1)
    assert read["lateral_force"][1] == pytest.approx([1.5]) and read["axial_force"][1] == pytest.approx([0.3])
    assert set(read) == {name for name, kind in CHANNELS.items() if "3d" in kind.models}
