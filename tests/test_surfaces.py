"""A leg's shape from closed surfaces."""

from __future__ import annotations

from pathlib import Path

import making_broken_files
import meshio
import numpy as np
import pytest
import shapely
import trimesh
from making import SHARED
from making_scans import surface, write_polydata

from legfem.common.errors import InputError
from legfem.geometry.leg_shape import LegShape, fat_thickness_around, largest_girth, perimeter
from legfem.geometry.motion import CuttingPlane
from legfem.imaging import polydata_reader
from legfem.imaging.surfaces import _pieces, outlines_of_surfaces, read_surface, read_surfaces, shape_of_surfaces

REAL = SHARED / "data" / "leg_geometry"
real_leg = pytest.mark.skipif(not REAL.is_dir(), reason="needs ../shared/data/leg_geometry")
LEVELS = np.arange(20.0, 81.0, 5.0)


def _cone(path: Path, x: float, y: float, radius: float, slope: float, **change: object) -> Path:
    surface = trimesh.creation.cylinder(radius, height=100, sections=120).subdivide()
    z = surface.vertices[:, 2:] + 50
    grown = surface.vertices[:, :2] * (1 + slope / radius * z)
    surface.vertices = np.column_stack([grown + np.array([x, y]), z])
    middle = surface.triangles_center
    if (level := change.get("hole")) is not None:
        side = np.hypot(*(middle[:, :2] - [x, y]).T) > 0.8 * radius
        surface.update_faces(np.arange(len(surface.faces)) != np.argmin(np.abs(middle[:, 2] - level) + 1e3 * ~side))
    if change.get("open"):
        surface.update_faces(np.abs(surface.face_normals[:, 2]) < 0.9)
    surface.apply_scale(change.get("scale", 1.0))
    surface.export(path)
    return path


def _leg(folder: Path, **change: object) -> dict[str, Path]:
    """A leg whose tibia stands out of the muscles' hull, as at the shin; the front is -y."""
    return {
        "skin": _cone(folder / "skin.stl", 0, 0, 55, 0.05, **change),
        "muscle_hull": _cone(folder / "hull.stl", 0, 6, 42, 0.05, **change),
        "tibia": _cone(folder / "tibia.stl", -5, -34, 13, 0, **change),
        "fibula": _cone(folder / "fibula.stl", 25, -15, 6, 0, **change),
    }


def _shape(parts: dict[str, Path], levels: np.ndarray) -> LegShape:
    surfaces = read_surfaces({part: [path] for part, path in parts.items()})
    return shape_of_surfaces(surfaces, levels, "leg")


def test_a_bone_outside_the_hull_is_taken_into_it(tmp_path):
    shape = _shape(_leg(tmp_path), LEVELS)
    assert shape.bones == ("tibia", "fibula")
    assert perimeter(shape) == pytest.approx(2 * np.pi * (55 + 0.05 * LEVELS), rel=2e-3)
    fat = fat_thickness_around(shape)
    # 7 mm behind; at the front what the tibia with its 1.2 mm leaves.
    behind = np.argmax(shape.contours["skin"][6][:, 1])
    assert fat[6, behind] == pytest.approx(7.0, abs=0.15)
    tibia, hull = (shapely.Polygon(shape.contours[part][6]) for part in ("tibia", "hull"))
    assert hull.contains(tibia)
    # 1.2 mm are asked for; smoothing may take a tenth.
    assert 1.08 < hull.exterior.distance(tibia) < 1.6
    assert tibia.area == pytest.approx(np.pi * 13**2, rel=0.02)


@pytest.mark.parametrize("kind", ["ply", "obj", "vtu", "vtk"])
def test_surfaces_of_other_programs_are_read(tmp_path, kind):
    stl = read_surface(_cone(tmp_path / "s.stl", 3, 4, 20, 0.1))
    if kind.startswith("vt"):
        meshio.Mesh(stl.vertices, [("triangle", stl.faces)]).write(tmp_path / f"s.{kind}")
    else:
        stl.export(tmp_path / f"s.{kind}")
    assert read_surface(tmp_path / f"s.{kind}").volume == pytest.approx(stl.volume, rel=1e-6)


@pytest.mark.parametrize(
    ("kind", "how"),
    [("vtk", "ascii"), ("vtk", "binary"), *(("vtp", how) for how in ("ascii", "binary", "zlib", "raw", "raw zlib"))],
)
def test_vtk_s_polydata_is_the_surface_that_was_written(tmp_path, kind, how):
    stl = surface("tibia")
    read = read_surface(write_polydata(tmp_path / f"s.{kind}", stl, how))
    assert read.volume == pytest.approx(stl.volume, rel=1e-6)
    assert read.bounds == pytest.approx(stl.bounds, abs=1e-4)


def test_polygons_strips_and_slicer_s_axes_of_polydata_are_read(tmp_path):
    corners = "0 0 0 1 0 0 1 1 0 0 1 0 0 0 1 1 0 1 1 1 1 0 1 1"
    sides = "4 0 3 2 1\n4 4 5 6 7\n4 0 1 5 4\n4 1 2 6 5\n4 2 3 7 6\n4 3 0 4 7\n"
    head = "# vtk DataFile Version 4.2\n3D Slicer output. SPACE=RAS\nASCII\nDATASET POLYDATA\n"
    (tmp_path / "box.vtk").write_text(f"{head}POINTS 8 float\n{corners}\nPOLYGONS 6 30\n{sides}")
    box = read_surface(tmp_path / "box.vtk")
    assert box.is_watertight and box.volume == pytest.approx(1.0)
    assert box.bounds == pytest.approx(np.array([[-1, -1, 0], [0, 0, 1]]))
    # The four sides as one strip round the box, its ends as polygons.
    strip = "TRIANGLE_STRIPS 1 11\n10 0 4 1 5 2 6 3 7 0 4\n"
    ends = "POLYGONS 2 10\n4 0 3 2 1\n4 4 5 6 7\n"
    (tmp_path / "strip.vtk").write_text(f"{head.replace('SPACE=RAS', '')}POINTS 8 float\n{corners}\n{ends}{strip}")
    found = read_surface(tmp_path / "strip.vtk")
    assert found.is_watertight and abs(found.volume) == pytest.approx(1.0)


@pytest.mark.parametrize("end", [2_000_000_000, -3])
def test_a_polygon_that_ends_beyond_its_points_is_refused_at_once(tmp_path, end):
    path = write_polydata(tmp_path / "s.vtp", surface("tibia"), "ascii")
    text = path.read_text()
    ends = text.index('Name="offsets"')
    first = text.index(">", ends) + 1
    path.write_text(text[:first] + f"3 {end}" + text[text.index("<", first) :])
    with pytest.raises(InputError, match='"offsets" array is not long enough'):
        read_surface(path)


@pytest.mark.parametrize(
    ("how", "old", "new", "words"),
    [
        ("binary", 'NumberOfPolys="', 'NumberOfPolys="9999999', "VTK's reader breaks down on it"),
        ("raw zlib", 'NumberOfComponents="', 'NumberOfComponents="429496729', "VTK hasn't read it within 5 s"),
    ],
    ids=["a crash", "no end"],
)
def test_what_ends_or_holds_vtk_s_reader_costs_its_own_process_alone(
    tmp_path, monkeypatch, capfd, how, old, new, words
):
    monkeypatch.setattr(polydata_reader, "_LONGEST_S", 5)
    path = write_polydata(tmp_path / "s.vtp", surface("fibula"), how)
    assert old.encode() in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(old.encode(), new.encode(), 1))
    with pytest.raises(InputError, match=words) as caught:
        read_surface(path)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


DAMAGE = ("_cut", "_bits", "_nothing", "_zeros", "_page", "_twice", "_cell", "_row", "_headless", "_column")


@pytest.mark.parametrize(
    ("kind", "how"), [("vtk", "ascii"), ("vtk", "binary"), ("vtp", "ascii"), ("vtp", "binary"), ("vtp", "raw zlib")]
)
def test_broken_polydata_are_refused_in_a_line_or_read_whole(tmp_path, kind, how):
    content = write_polydata(tmp_path / f"good.{kind}", surface("fibula"), how).read_bytes()
    good = read_surface(tmp_path / f"good.{kind}")
    refused = 0
    for number, name in enumerate(DAMAGE):
        path = tmp_path / f"{name}.{kind}"
        path.write_bytes(getattr(making_broken_files, name)(np.random.default_rng([58, number]), content))
        try:
            read = read_surface(path)
        except InputError as error:
            refused += 1
            assert "\n" not in str(error) and error.remedy, name
        else:
            # A bit may make another digit of one.
            assert name == "_bits" or (len(read.faces), read.volume) == (len(good.faces), good.volume), name
    assert refused >= 5


def test_outlines_are_cut_at_any_level_also_through_vertices(tmp_path):
    surface = read_surface(_cone(tmp_path / "s.stl", 3, 4, 20, 0.1))
    levels = [1e-3, 50.0, 99.9]
    for level in levels:
        plane = CuttingPlane.at_level(level)
        outline = outlines_of_surfaces({"bone": [surface]}, plane, "s")["bone"]
        assert outline.area == pytest.approx(np.pi * (20 + 0.1 * level) ** 2, rel=2e-3)


@pytest.mark.parametrize(
    ("change", "levels", "message"),
    [
        ({"hole": 50.0}, LEVELS, r"leg: skin: has a hole at level \d+ mm, near \(.*: 3 of its edges are free"),
        ({"scale": 0.1}, LEVELS, "look like centimetres; multiply the coordinates by 10"),
        ({"scale": 10.0}, LEVELS, "not a leg's"),
        ({"scale": 0.001}, LEVELS, "look like metres"),
        ({}, LEVELS + 60, r"skin: no closed outline at level 100 mm; choose levels between 0.0 and"),
    ],
)
def test_bad_surfaces_give_one_line(tmp_path, change, levels, message):
    with pytest.raises(InputError, match=message) as caught:
        _shape(_leg(tmp_path, **change), levels)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("change", [{"hole": 95.0}, {"open": True}], ids=["a hole beyond the levels", "open ends"])
def test_a_scan_that_is_open_away_from_the_levels_is_cut_as_if_it_were_closed(tmp_path, change):
    (tmp_path / "closed").mkdir()
    whole, found = _shape(_leg(tmp_path / "closed"), LEVELS), _shape(_leg(tmp_path, **change), LEVELS)
    assert not read_surface(tmp_path / "skin.stl").is_watertight
    for part in whole.parts:
        np.testing.assert_allclose(found.contours[part], whole.contours[part], atol=1e-3)


def test_a_plane_beyond_the_open_end_is_refused(tmp_path):
    surface = read_surface(_cone(tmp_path / "s.stl", 0, 0, 55, 0.05, open=True))
    tilted = CuttingPlane(np.array([0.0, 0.0, 90.0]), np.array([0.3, 0.0, 1.0]))
    with pytest.raises(InputError, match="skin: has a hole at plane through") as caught:
        outlines_of_surfaces({"skin": [surface]}, tilted, "leg")
    assert "\n" not in str(caught.value)


def test_bad_files_give_one_line(tmp_path):
    parts = _leg(tmp_path)
    with pytest.raises(InputError, match="skin: the part is missing"):
        _shape({k: v for k, v in parts.items() if k != "skin"}, LEVELS)
    with pytest.raises(InputError, match="not found"):
        _shape({**parts, "tibia": tmp_path / "none.stl"}, LEVELS)
    header = "# vtk DataFile Version 4.2\nSlicer\nASCII\nDATASET POLYDATA\nPOINTS 1 float\n0 0 0\n"
    for text, words in (
        (header, "contains no triangles"),
        (f"{header}POLYGONS 1 4\n3 0 1 2\n", r"names a point that isn't there.*save it as STL"),
        (f"{header}POLYGONS 2 8\n3 0 0 0\n", "Error reading ascii cell data"),
    ):
        (tmp_path / "slicer.vtk").write_text(text)
        with pytest.raises(InputError, match=words) as caught:
            read_surface(tmp_path / "slicer.vtk")
        assert "\n" not in str(caught.value)
    (tmp_path / "s.vtp").write_text("<VTKFile type='ImageData'></VTKFile>")
    with pytest.raises(InputError, match="Cannot find PolyData"):
        read_surface(tmp_path / "s.vtp")
    (tmp_path / "text.stl").write_text("nothing")
    with pytest.raises(InputError, match=r"text.stl: file"):
        read_surface(tmp_path / "text.stl")


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("a.svg", "<svg/>", "contains a drawing, not a surface"),
        ("a.dxf", "0\nSECTION\n2\nENTITIES\n0\nENDSEC\n0\nEOF\n", r"a\.dxf: file"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n1\n", r"a\.ply: file"),
        ("a.xyz", "0 0 0\n1 0 0\n0 1 0\n", r"a\.xyz: file: "),
        ("a.off", "OFF\n4 4 0\n0 0 0\nnan 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n", r"a\.off: "),
    ],
)
def test_what_is_no_surface_of_numbers_is_refused_in_one_line(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_surface(tmp_path / name)
    assert "\n" not in str(caught.value)


@real_leg
def test_a_real_leg_is_read():
    parts = ("skin", "muscle_hull", "tibia", "fibula")
    files = {part: REAL / f"right_{part}.stl" for part in parts}
    shape = _shape(files, np.arange(260.0, 341.0, 5.0))
    assert largest_girth(shape) == pytest.approx(300, abs=5)
    assert perimeter(shape).max() == pytest.approx(378, abs=2)
    fat = fat_thickness_around(shape)
    assert 1.5 < fat.min() < 3.5
    assert 15 < fat.max() < 25


def test_closed_surfaces_of_files_with_few_digits_are_cut_whole() -> None:
    """Six digits, as STL files are written, put many points half way between two of the last one that is kept."""
    plane = CuttingPlane(np.array([0.0, 0.0, 50.0]), np.array([0.0, 0.0, 1.0]))
    for k in range(20):
        made = trimesh.creation.cylinder(radius=12.0 + 0.037 * k, segment=[[3.1 * k, 1.7, 0.0], [3.1 * k, 1.7, 100.0]])
        made.vertices = [[float(f"{x:.6g}") for x in point] for point in made.vertices]
        (piece,) = _pieces(made, plane)
        assert piece.area == pytest.approx(np.pi * (12.0 + 0.037 * k) ** 2, rel=0.01)
