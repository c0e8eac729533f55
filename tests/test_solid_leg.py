"""Tetrahedral meshes of a leg's segment."""

from __future__ import annotations

from dataclasses import replace

import dolfinx.fem
import numpy as np
import pytest
import ufl
from making import circle
from making_legs_3d import round_leg
from making_ranks import run_on_ranks
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.fem.compat import cell_nodes
from legfem.geometry.leg_shape import LegShape, shape_of_contours
from legfem.meshing.leg_sizes import SolidMeshSettings, settings_for_cells
from legfem.meshing.section import BONE, DEEP, SKIN, SUPERFICIAL
from legfem.meshing.solid_leg import mesh_solid_leg
from legfem.meshing.structured import END, LegMesh


def measure(leg: LegMesh, tag: int) -> float:
    """Volume (mm3) of a region or area (mm2) of tagged facets."""
    tags, kind = (leg.cell_tags, "dx") if tag in (SUPERFICIAL, DEEP) else (leg.facet_tags, "ds")
    measure = ufl.Measure(kind, domain=leg.mesh, subdomain_data=tags)(tag)
    one = dolfinx.fem.Constant(leg.mesh, 1.0)
    return float(leg.mesh.comm.allreduce(dolfinx.fem.assemble_scalar(dolfinx.fem.form(one * measure)), op=MPI.SUM))


def calf() -> LegShape:
    """A leg that tapers, with two bones and fat of 2 mm at the front (-y)."""
    levels = np.arange(0.0, 81.0, 10.0)
    parts = {
        "skin": [circle(0, 0, 58 - 0.08 * z, 400) for z in levels],
        "hull": [circle(0, -2.5, 53.5 - 0.08 * z, 300) for z in levels],
        "tibia": [circle(-10, -35 + 0.1 * z, 13, 100) for z in levels],
        "fibula": [circle(25, -20, 6, 100) for z in levels],
    }
    return shape_of_contours(levels, parts, 120)


@pytest.fixture(scope="module")
def round_mesh() -> LegMesh:
    shape = round_leg(radius=50, hull_radius=42, core_radius=12, length=40)
    return mesh_solid_leg(shape, SolidMeshSettings(skin_size=5, inside_size=7, bone_size=2.5))


def test_a_round_leg_has_its_volumes_and_faces(round_mesh):
    # Nodes stand on the surfaces, so chords cut off h^2 / (12 R) of a radius on average.
    assert measure(round_mesh, SUPERFICIAL) == pytest.approx(np.pi * (50**2 - 42**2) * 40, rel=0.01)
    assert measure(round_mesh, DEEP) == pytest.approx(np.pi * (42**2 - 12**2) * 40, rel=0.01)
    assert measure(round_mesh, SKIN) == pytest.approx(2 * np.pi * 50 * 40, rel=0.005)
    assert measure(round_mesh, BONE) == pytest.approx(2 * np.pi * 12 * 40, rel=0.01)
    assert measure(round_mesh, END) == pytest.approx(2 * np.pi * (50**2 - 12**2), rel=0.005)


def enclosed(leg: LegMesh, tag: int) -> float:
    """Volume (mm3) within tagged facets about the z axis, by the divergence theorem."""
    x, n = ufl.SpatialCoordinate(leg.mesh), ufl.FacetNormal(leg.mesh)
    facets = ufl.Measure("ds", domain=leg.mesh, subdomain_data=leg.facet_tags)(tag)
    return abs(dolfinx.fem.assemble_scalar(dolfinx.fem.form((x[0] * n[0] + x[1] * n[1]) / 2 * facets)))


def test_flat_facets_may_enclose_what_the_surfaces_do():
    shape = round_leg(radius=50, hull_radius=42, core_radius=12, length=40)
    coarse = SolidMeshSettings(skin_size=16, inside_size=20, bone_size=12, turn_elements=7)
    inscribed, enclosing, finer = (
        mesh_solid_leg(shape, settings)
        for settings in (coarse, replace(coarse, enclosing=True), replace(coarse.refined(2), enclosing=True))
    )
    for tag, radius in ((SKIN, 50), (BONE, 12)):
        off = [enclosed(leg, tag) / (np.pi * radius**2 * 40) - 1 for leg in (inscribed, enclosing)]
        assert off[0] < -0.004
        assert abs(off[1]) < 0.2 * abs(off[0])
    assert abs(enclosed(finer, BONE) / (np.pi * 12**2 * 40) - 1) < 0.003


def test_facets_and_cells_stand_where_their_tags_say(round_mesh):
    mesh, x = round_mesh.mesh, round_mesh.mesh.geometry.x
    mesh.topology.create_connectivity(2, 0)
    vertices = mesh.topology.connectivity(2, 0)
    mesh.topology.create_connectivity(3, 0)
    # In first-order tetrahedra vertices are the geometry's nodes; their numbers may differ.
    node = np.empty(mesh.topology.index_map(0).size_local, dtype=np.int64)
    cells = mesh.topology.connectivity(3, 0).array.reshape(-1, 4)
    node[cells.ravel()] = cell_nodes(mesh).ravel()
    for tag, radius in ((SKIN, 50), (BONE, 12)):
        facets = round_mesh.facet_tags.find(tag)
        corners = node[np.concatenate([vertices.links(f) for f in facets])]
        assert np.linalg.norm(x[corners, :2], axis=1) == pytest.approx(radius, abs=1e-4)
    ends = round_mesh.facet_tags.find(END)
    assert set(np.round(x[node[np.concatenate([vertices.links(f) for f in ends])], 2], 9)) == {0, 40}
    for tag, low, high in ((SUPERFICIAL, 42, 50), (DEEP, 12, 42)):
        radius = np.linalg.norm(x[cell_nodes(mesh)[round_mesh.cell_tags.find(tag)], :2], axis=-1)
        assert radius.min() >= low - 0.01 * low
        assert radius.max() <= high + 1e-4
    assert [s.tag for s in round_mesh.supports] == [BONE]


def test_a_leg_with_thin_fat_is_meshed_soundly():
    shape = calf()
    leg = mesh_solid_leg(shape, SolidMeshSettings(skin_size=7.0))
    assert leg.quality.worst > 0.1
    assert min(leg.quality.mean.values()) > 0.7
    assert [s.tag for s in leg.supports] == [BONE]
    assert leg.copies == 1


@pytest.mark.parametrize("cells", [8_000, 40_000])
def test_about_as_many_tetrahedra_as_asked_for(cells):
    shape = calf()
    leg = mesh_solid_leg(shape, settings_for_cells(shape, cells))
    assert sum(leg.quality.elements.values()) == pytest.approx(cells, rel=0.3)


def test_bad_shapes_and_settings_give_one_line():
    shape = calf()
    crossing = LegShape(shape.levels, {**shape.contours, "tibia": shape.contours["tibia"] + [0, -8]})
    with pytest.raises(InputError, match="tibia, level 0 mm: crosses or touches the hull"):
        mesh_solid_leg(crossing)
    with pytest.raises(InputError, match=r"--cells: \d+: this leg cannot be meshed with"):
        settings_for_cells(shape, 10)


@pytest.mark.mpi
def test_two_ranks_have_the_same_mesh(tmp_path):
    two = run_on_ranks(2, "ranks_solid_leg.py", tmp_path / "2.npz")
    one = mesh_solid_leg(calf(), SolidMeshSettings(skin_size=8.0))
    assert two["cells"] == one.mesh.topology.index_map(3).size_global
    for name, tags in (("volumes", (SUPERFICIAL, DEEP)), ("areas", (SKIN, BONE, END))):
        assert two[name] == pytest.approx([measure(one, tag) for tag in tags], rel=1e-12)
    assert "outside the skin" in str(two["error"])
