"""The section's mesh: what it covers, how fine it is, and where the indenter touches it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import gmsh
import numpy as np
import pytest
import shapely
from dolfinx import fem, mesh
from making import circle, leg
from making_mechanics import COARSE, subject_3

from legfem.common.errors import InputError
from legfem.fem.compat import cell_nodes
from legfem.geometry.indenter import first_touch
from legfem.geometry.section import LegSection
from legfem.meshing.gmsh_mesh import generate, gmsh_model
from legfem.meshing.section import BONE, REGIONS, SKIN, SectionMesh, SectionMeshSettings, mesh_section


@pytest.fixture(scope="module")
def section() -> LegSection:
    return subject_3()[0]


@pytest.fixture(scope="module")
def meshed(section) -> SectionMesh:
    indenter = subject_3()[1]
    return mesh_section(section, indenter.radius, indenter.aim, indenter.direction)


def _areas(meshed: SectionMesh) -> dict[str, float]:
    cells = np.arange(meshed.mesh.topology.index_map(2).size_local, dtype=np.int32)
    corners = meshed.mesh.geometry.x[cell_nodes(meshed.mesh)][:, :, :2]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    assert np.array_equal(np.sort(meshed.cell_tags.indices), cells), "every cell has a region"
    return {name: float(area[meshed.cell_tags.find(tag)].sum()) for name, tag in REGIONS.items()}


def test_regions_have_the_areas_of_the_contours(section, meshed):
    areas = _areas(meshed)
    polygons = {part: section.polygon(part) for part in ("skin", "fascia", "tibia", "fibula")}
    inside = polygons["fascia"].area - polygons["tibia"].area - polygons["fibula"].area
    layer = section.fascia_thickness * polygons["fascia"].length
    assert areas["superficial"] == pytest.approx(polygons["skin"].area - polygons["fascia"].area, rel=2e-3)
    assert areas["fascia"] == pytest.approx(layer, rel=1e-2)
    assert areas["deep"] == pytest.approx(inside - layer, rel=2e-3)


def test_the_whole_boundary_is_skin_or_bone(meshed):
    meshed.mesh.topology.create_connectivity(1, 2)
    boundary = mesh.exterior_facet_indices(meshed.mesh.topology)
    marked = np.concatenate([meshed.facet_tags.find(tag) for tag in (SKIN, BONE)])
    np.testing.assert_array_equal(np.sort(marked), np.sort(boundary))


def _skin_edges(meshed: SectionMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return midpoints and lengths of the skin's edges."""
    facets = meshed.facet_tags.find(SKIN)
    nodes = mesh.entities_to_geometry(meshed.mesh, 1, facets)
    ends = meshed.mesh.geometry.x[nodes][:, :, :2]
    return ends.mean(axis=1), np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)


def test_the_mesh_is_fine_where_the_indenter_comes(meshed):
    settings = SectionMeshSettings()
    midpoints, lengths = _skin_edges(meshed)
    near = np.linalg.norm(midpoints - meshed.touch, axis=1) < 17.0
    assert near.sum() > 5
    assert lengths[near].max() < 1.05 * settings.contact_size
    assert lengths.max() < 1.1 * settings.far_size
    assert lengths.max() > 3 * settings.contact_size


def test_elements_are_sound(meshed):
    assert meshed.quality.worst > 0.15
    assert set(meshed.quality.minimum) == set(REGIONS)
    assert sum(meshed.quality.elements.values()) == meshed.mesh.topology.index_map(2).size_global


def test_the_fascia_is_one_layer_of_its_thickness(section, meshed):
    """Every one of its cells spans the layer: its height on its longest side along it."""
    cells = meshed.cell_tags.find(REGIONS["fascia"])
    corners = meshed.mesh.geometry.x[cell_nodes(meshed.mesh)[cells]][:, :, :2]
    outer = section.polygon("fascia").exterior
    depth = np.array([[outer.distance(shapely.Point(p)) for p in cell] for cell in corners[::7]])
    is_outer = depth < 0.5 * section.fascia_thickness
    assert (is_outer.sum(axis=1) % 3 > 0).all(), "no cell lies on one face alone"
    assert depth[~is_outer] == pytest.approx(section.fascia_thickness, abs=0.1)


def test_refining_divides_all_lengths(section):
    settings = SectionMeshSettings()
    finer = settings.refined(2.0)
    assert (finer.contact_size, finer.far_size) == (settings.contact_size / 2, settings.far_size / 2)
    indenter = subject_3()[1]
    sizes = [
        mesh_section(section, indenter.radius, indenter.aim, indenter.direction, s)
        .mesh.topology.index_map(2)
        .size_global
        for s in (COARSE, COARSE.refined(2.0))
    ]
    assert 2.5 < sizes[1] / sizes[0] < 4.5


def test_the_same_section_gives_the_same_mesh(section, meshed):
    indenter = subject_3()[1]
    again = mesh_section(section, indenter.radius, indenter.aim, indenter.direction)
    np.testing.assert_array_equal(again.mesh.geometry.x, meshed.mesh.geometry.x)


def test_the_indenter_touches_the_mesh_and_no_more(meshed):
    midpoints, _ = _skin_edges(meshed)
    space = fem.functionspace(meshed.mesh, ("Lagrange", 1))
    gaps = np.linalg.norm(space.tabulate_dof_coordinates()[:, :2] - meshed.touch, axis=1) - 15.0
    assert gaps.min() > -1e-9
    assert (np.linalg.norm(midpoints - meshed.touch, axis=1) - 15.0).min() < 0.02


def test_first_touch_of_a_circle():
    outline = circle(3.0, -2.0, 50.0, 4000)
    for degrees in (0.0, 90.0, 213.0):
        direction = np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
        centre = first_touch(outline, 15.0, np.array([3.0, -2.0]), direction)
        np.testing.assert_allclose(centre, np.array([3.0, -2.0]) - 65.0 * direction, atol=1e-4)


def test_first_touch_off_centre():
    """5 mm beside the centre line the distance of centres is still the sum of radii."""
    outline = circle(0.0, 0.0, 50.0, 4000)
    centre = first_touch(outline, 15.0, np.array([5.0, 0.0]), np.array([0.0, 1.0]))
    np.testing.assert_allclose(centre, [5.0, -np.sqrt(65.0**2 - 25.0)], atol=1e-4)


def test_an_indenter_that_passes_by_is_explained():
    with pytest.raises(InputError, match="misses the leg"):
        first_touch(circle(0, 0, 50.0), 15.0, np.array([80.0, 0.0]), np.array([0.0, 1.0]))


def test_a_simple_leg_is_meshed_from_any_side():
    parts = leg()
    made = LegSection.of_parts(parts, 0.6)
    for degrees in (0.0, 135.0, 270.0):
        direction = np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
        found = mesh_section(made, 15.0, np.zeros(2), direction, COARSE)
        assert found.quality.worst > 0.1
        np.testing.assert_allclose(found.touch, -75.0 * direction, atol=0.1)


def _square(side: float, size: float) -> None:
    corners = [gmsh.model.geo.addPoint(*at, 0) for at in ((0, 0), (side, 0), (side, side))]
    lines = [gmsh.model.geo.addLine(corners[k - 1], corners[k]) for k in range(3)]
    gmsh.model.geo.addPlaneSurface([gmsh.model.geo.addCurveLoop(lines)])
    gmsh.model.geo.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)


def test_a_mesh_that_takes_too_long_ends_in_one_line_with_exit_status_2():
    """In a process of its own: gmsh can't be used again after that."""
    code = """
from legfem.common.command_line import command_context
from legfem.meshing.gmsh_mesh import generate, gmsh_model
from test_meshing import _square
import typer
try:
    with command_context(), gmsh_model("endless") as model:
        _square(100.0, 0.02)
        generate(model, 2, seconds=0.2)
except typer.Exit as end:
    raise SystemExit(end.exit_code)
"""
    folder = Path(__file__).parent
    paths = os.pathsep.join([str(folder), str(folder.parent)])
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "PYTHONPATH": paths},
        cwd=folder.parent,
    )
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("contours: mesh: gmsh was given up after 0.2 s; check the")


def test_after_a_mesh_in_time_gmsh_can_be_used_again():
    for size in (1.0, 0.5):
        with gmsh_model("quick") as model:
            _square(10.0, size)
            generate(model, 2)
            triangles = len(model.mesh.getElementsByType(2)[0])
        # Half the square, of equilateral triangles.
        assert triangles == pytest.approx(50 / (np.sqrt(3) / 4 * size**2), rel=0.35)


def test_what_gmsh_raises_is_raised():
    class Model:
        class mesh:  # noqa: N801
            @staticmethod
            def generate(dimension: int) -> None:
                raise RuntimeError(f"no mesh of {dimension}")

    with pytest.raises(RuntimeError, match="no mesh of 3"):
        generate(Model, 3)
