"""Meshes as files for other programs: read back, every region is as large as in DOLFINx."""

from __future__ import annotations

import json
import re
import signal
from collections import Counter
from pathlib import Path

import meshio
import numpy as np
import pytest
from dolfinx import fem
from dolfinx import io as dolfinx_io
from making_mechanics import COARSE, subject_3
from mpi4py import MPI
from scipy.spatial import ConvexHull
from typer.testing import CliRunner
from ufl import Measure

from legfem.commands.meshing import app
from legfem.meshing.exchange import extruded, measure, named_mesh, write_mesh
from legfem.meshing.section import REGIONS, SKIN, mesh_section
from legfem.meshing.structured import IdealisedLeg, LegMeshSettings, mesh_leg
from studies.meshes import MANIFEST, REFERENCES, checksum, make, page, quality_of_file

MESHES = Path(__file__).resolve().parents[1] / "meshes"


def section():
    shape, indenter, _ = subject_3()
    made = mesh_section(shape, indenter.radius, indenter.aim, indenter.direction, COARSE)
    return made, REGIONS


def quarter(cells: str):
    leg = IdealisedLeg(fat=6.0, fascia=1.0)
    sizes = LegMeshSettings(contact_size=9.0, depth_size=12.0, edge_size=9.0, far_size=30.0, cells=cells)
    made = mesh_leg(leg, 15.0, 50.0, sizes)
    return made, made.regions


MAKERS = {"triangle": section, "hexahedron": lambda: quarter("hexahedra"), "tetra": lambda: quarter("tetrahedra")}


@pytest.fixture(scope="module", params=MAKERS)
def made(request):
    """A mesh with names, and what DOLFINx says of its regions' and its skin's size."""
    meshed, regions = MAKERS[request.param]()
    named = named_mesh(meshed.mesh, meshed.cell_tags, meshed.facet_tags, regions)
    assert named.cells.kind == request.param
    inside = Measure("dx", meshed.mesh, subdomain_data=meshed.cell_tags)
    outside = Measure("ds", meshed.mesh, subdomain_data=meshed.facet_tags)
    one = fem.Constant(meshed.mesh, 1.0)
    sizes = {name: _integral(one * inside(tag)) for name, tag in regions.items()}
    return named, sizes, _integral(one * outside(SKIN))


def _integral(form) -> float:
    return float(fem.assemble_scalar(fem.form(form)))


def read(path: Path) -> tuple[np.ndarray, dict[str, list[np.ndarray]]]:
    """Return points and the corners of the elements of every name, by meshio alone."""
    text = path.read_text(errors="replace")
    if "CPE3" in text:  # meshio knows plane stress only; the nodes are the same
        path = path.with_name("plane-stress.inp")
        path.write_text(text.replace("CPE3", "CPS3"))
    mesh = meshio.read(path)
    found: dict[str, list[np.ndarray]] = {}
    names = {int(tag): name for name, (tag, _) in mesh.field_data.items()}
    for k, block in enumerate(mesh.cells):
        if path.suffix == ".inp":
            members = {name: sets[k] for name, sets in mesh.cell_sets.items() if len(sets[k])}
        elif path.suffix == ".msh":
            tags = mesh.cell_data["gmsh:physical"][k]
            np.testing.assert_array_equal(mesh.cell_data["gmsh:geometrical"][k], tags)
            members = {names[tag]: np.flatnonzero(tags == tag) for tag in np.unique(tags)}
        else:
            fields = {name: data[k] for name, data in mesh.cell_data.items() if name != "tag"}
            members = {name: np.flatnonzero(data) for name, data in fields.items()}
        for name, cells in members.items():
            found.setdefault(name, []).extend(block.data[cells])
    return mesh.points, found


def size_of(points: np.ndarray, elements: list[np.ndarray], dimension: int) -> float:
    return sum(ConvexHull(points[nodes][:, :dimension]).volume for nodes in elements)


@pytest.mark.parametrize("ending", [".msh", ".vtu", ".inp"])
def test_regions_read_back_are_as_large(made, ending, tmp_path):
    named, sizes, _ = made
    (path,) = write_mesh(named, tmp_path / f"leg{ending}")
    points, found = read(path)
    assert set(sizes) <= set(found)
    for name, size in sizes.items():
        assert size_of(points, found[name], named.dimension) == pytest.approx(size, rel=1e-8)


def test_no_element_is_inside_out_and_sizes_agree(made):
    named, sizes, _ = made
    assert named.measures() == pytest.approx(sizes, rel=1e-10)
    assert measure(named.points, named.cells.kind, named.cells.nodes).min() > 0


def test_xdmf_is_for_dolfinx(made, tmp_path):
    named, sizes, skin = made
    path, *_ = made_files = write_mesh(named, tmp_path / "leg.xdmf")
    facets = path.with_name("leg-surfaces.xdmf")
    assert {path, facets} == {file for file in made_files if file.suffix == ".xdmf"}
    with dolfinx_io.XDMFFile(MPI.COMM_SELF, path, "r") as file:
        mesh = file.read_mesh(name="Grid")
        cells = file.read_meshtags(mesh, name="Grid")
    mesh.topology.create_connectivity(mesh.topology.dim - 1, mesh.topology.dim)
    with dolfinx_io.XDMFFile(MPI.COMM_SELF, facets, "r") as file:
        tags = file.read_meshtags(mesh, name="Grid")
    assert mesh.geometry.dim == named.dimension
    one = fem.Constant(mesh, 1.0)
    for name, tag in named.regions.items():
        region = Measure("dx", mesh, subdomain_data=cells)(tag)
        assert _integral(one * region) == pytest.approx(sizes[name], rel=1e-8)
    outside = Measure("ds", mesh, subdomain_data=tags)(SKIN)
    assert _integral(one * outside) == pytest.approx(skin, rel=1e-8)


@pytest.fixture
def interrupts_kept():
    """Ctrl-C as it was: what DOLFINx calls of gmsh leaves it ending the process."""
    handler = signal.getsignal(signal.SIGINT)
    yield
    signal.signal(signal.SIGINT, handler)


@pytest.mark.usefixtures("interrupts_kept")
def test_dolfinx_and_gmsh_read_the_msh(made, tmp_path):
    named, sizes, skin = made
    (path,) = write_mesh(named, tmp_path / "leg.msh")
    gmsh_io = dolfinx_io.gmsh if hasattr(dolfinx_io, "gmsh") else dolfinx_io.gmshio
    mesh, cells, facets = gmsh_io.read_from_msh(path, MPI.COMM_SELF, 0, gdim=named.dimension)[:3]
    one = fem.Constant(mesh, 1.0)
    region = Measure("dx", mesh, subdomain_data=cells)(named.regions["deep"])
    assert _integral(one * region) == pytest.approx(sizes["deep"], rel=1e-8)
    outside = Measure("ds", mesh, subdomain_data=facets)(SKIN)
    assert _integral(one * outside) == pytest.approx(skin, rel=1e-8)
    quality = quality_of_file(path)
    assert quality.elements == dict(
        Counter(name for name, tag in named.regions.items() for _ in np.flatnonzero(named.cells.tags == tag))
    )
    assert quality.worst > 0


def abaqus_surface(text: str, name: str) -> list[tuple[int, int]]:
    """Return elements and their faces of a surface in an input file."""
    sets = {
        match[1]: [int(number) for number in match[2].replace("\n", ",").split(",") if number]
        for match in re.finditer(r"\*ELSET, ELSET=(\S+)\n([\d, \n]+)", text)
    }
    (listed,) = re.findall(rf"\*SURFACE, TYPE=ELEMENT, NAME={name}\n([^*]+)", text)
    faces = [line.split(", S") for line in listed.strip().splitlines()]
    return [(element, int(side)) for cells, side in faces for element in sets[cells]]


def test_abaqus_surfaces_are_faces_on_the_boundary(made, tmp_path):
    """A face given by its number and the element's lies on the skin: its nodes are the skin's."""
    named, _, _ = made
    (path,) = write_mesh(named, tmp_path / "leg.inp")
    faces = abaqus_surface(path.read_text(), "skin")
    assert len(faces) == len(set(faces)) == sum((f.tags == SKIN).sum() for f in named.facets)
    skin = {n for f in named.facets for n in f.nodes[f.tags == SKIN].ravel()}
    # An element that is on the skin with one face has as many nodes there as the face.
    on_skin = Counter(element for element, _ in faces)
    corners = named.facets[0].nodes.shape[1]
    for element, count in on_skin.items():
        if count == 1:
            assert len(skin.intersection(named.cells.nodes[element - 1])) >= corners


@pytest.mark.parametrize(
    ("kind", "faces"),
    [
        # Abaqus Elements Guide: unit elements, and where the middles of S1, S2, ... lie.
        ("triangle", [(0.5, 0, 0), (0.5, 0.5, 0), (0, 0.5, 0)]),
        ("tetra", [(1 / 3, 1 / 3, 0), (1 / 3, 0, 1 / 3), (1 / 3, 1 / 3, 1 / 3), (0, 1 / 3, 1 / 3)]),
        ("hexahedron", [(0.5, 0.5, 0), (0.5, 0.5, 1), (0.5, 0, 0.5), (1, 0.5, 0.5), (0.5, 1, 0.5), (0, 0.5, 0.5)]),
        ("wedge", [(1 / 3, 1 / 3, 0), (1 / 3, 1 / 3, 1), (0.5, 0, 0.5), (0.5, 0.5, 0.5), (0, 0.5, 0.5)]),
    ],
)
def test_faces_are_numbered_as_in_abaqus(kind, faces):
    from legfem.meshing.exchange import _FACES

    below = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    triangle = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    corners = {
        "triangle": triangle,
        "tetra": [*triangle, (0, 0, 1)],
        "wedge": [*triangle, *((x, y, 1) for x, y, _ in triangle)],
        "hexahedron": [*below, *((x, y, 1) for x, y, _ in below)],
    }[kind]
    middles = [np.mean([corners[k] for k in face], axis=0) for face in _FACES[kind]]
    np.testing.assert_allclose(middles, faces)


def test_a_slab_has_the_sections_area_times_its_thickness(tmp_path):
    meshed, regions = section()
    named = named_mesh(meshed.mesh, meshed.cell_tags, meshed.facet_tags, regions)
    slab = extruded(named, 2.5)
    for ending in (".msh", ".inp"):
        (path,) = write_mesh(slab, tmp_path / f"slab{ending}")
        points, found = read(path)
        for name, area in named.measures().items():
            assert size_of(points, found[name], 3) == pytest.approx(2.5 * area, rel=1e-8)
    text = (tmp_path / "slab.inp").read_text()
    assert len(abaqus_surface(text, "end")) == 2 * len(named.cells.nodes)
    assert measure(slab.points, "wedge", slab.cells.nodes).min() > 0


def run(*words: str):
    return CliRunner().invoke(app, words)


def test_the_command_writes_a_section(tmp_path):
    done = run("--subject", "3", "--finer", "0.4", "--out", str(tmp_path / "new" / "leg.inp"))
    assert done.exit_code == 0, done.output
    assert "deep: " in done.output and "surfaces: skin, bone" in done.output
    assert [file.name for file in (tmp_path / "new").iterdir()] == ["leg.inp"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--subject", "3", "--out", "leg.stl"], "there is no format .stl"),
        (["--out", "leg.msh"], "none is given"),
        (["--subject", "3", "--idealised", "--out", "leg.msh"], "more than one is given"),
        (["--idealised", "--extrude", "1", "--out", "leg.msh"], "is in 3D already"),
        (["--subject-dir", "nowhere", "--out", "leg.msh"], "not found"),
        (["--stocking", "9", "--out", "leg.msh"], "unknown subject"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(words, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = run(*words)
    assert done.exit_code == 2
    assert message in done.output and done.output.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_reference_meshes_are_those_of_the_manifest():
    manifest = json.loads((MESHES / MANIFEST).read_text())
    names = {mesh["file"] for mesh in manifest["meshes"]}
    assert names == {path.name for path in MESHES.glob("*.msh")}
    assert names == {f"{reference.name}.msh" for reference in REFERENCES}
    for mesh in manifest["meshes"]:
        assert checksum(MESHES / mesh["file"]) == mesh["sha256"]
    assert (MESHES / "README.md").read_text(encoding="utf-8") == page(manifest)
    assert sum(path.stat().st_size for path in MESHES.iterdir()) < 5e6


@pytest.mark.parametrize("name", ["idealised-coarse", "section-4"])
def test_a_reference_mesh_is_what_its_command_makes(name, tmp_path):
    """Whatever gmsh's version, which may number and place nodes otherwise."""
    (reference,) = (entry for entry in REFERENCES if entry.name == name)
    (kept,) = (m for m in json.loads((MESHES / MANIFEST).read_text())["meshes"] if m["file"] == f"{name}.msh")
    entry = make(reference, tmp_path)
    assert entry["command"] == kept["command"]
    assert entry["nodes"] == pytest.approx(kept["nodes"], rel=0.05)
    for region, held in kept["regions"].items():
        assert entry["regions"][region]["size"] == pytest.approx(held["size"], rel=1e-3)
