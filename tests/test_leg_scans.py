"""Legs from scans: one section and one force, whatever it is cut from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from making import SHARED
from making_scans import PARTS, ellipse, entry_of, made_leg, outline, subject_of_scan, write_nifti
from shapely import Polygon
from typer.testing import CliRunner

from legfem.geometry.__main__ import app
from legfem.geometry.motion import CuttingPlane
from legfem.imaging.leg_source import LegSource
from legfem.imaging.outlines import read_shape
from legfem.imaging.surfaces import read_surfaces
from legfem.imaging.volume_file import read_volumes
from legfem.legs.finite_element_models import plane_strain_test

REAL = SHARED / "data" / "leg_geometry"
LEVEL = 52.7
TILTED = CuttingPlane(np.array([0.0, 10.0, 50.0]), np.array([0.1, -0.15, 1.0]))
WITHIN = {"nifti": 0.12, "oblique": 0.12, "stl": 0.03, "vtp": 0.03, "csv": 0.03}
"""mm, off the ellipses: labels know an outline to a tenth of a voxel or so."""


@pytest.fixture(scope="module")
def sources(leg_files: Path) -> dict[str, LegSource]:
    surfaces = read_surfaces({part: [leg_files / f"{part}.stl"] for part in PARTS})
    return {
        "nifti": LegSource("leg.nii.gz", volume=read_volumes(leg_files / "leg.nii.gz")[0]),
        "oblique": LegSource("turned.nii", volume=read_volumes(leg_files / "turned.nii")[0]),
        "stl": LegSource("surfaces", surfaces=surfaces),
        "vtp": LegSource("surfaces", surfaces=read_surfaces({part: [leg_files / f"{part}.vtp"] for part in PARTS})),
        "csv": LegSource("sections.csv", contours=leg_files / "sections.csv"),
    }


@pytest.mark.parametrize("plane", [CuttingPlane.at_level(LEVEL), TILTED], ids=str)
@pytest.mark.parametrize("kind", WITHIN)
def test_a_section_lies_on_the_leg_whatever_it_is_cut_from(sources, kind, plane):
    for part, cut in sources[kind].outlines(plane).items():
        flat = np.asarray(cut.exterior.coords)
        points = flat @ plane.axes + (plane.point @ plane.normal) * plane.normal
        x, y, a, b = ellipse(part, points[:, 2])
        off = (np.hypot((points[:, 0] - x) / a, (points[:, 1] - y) / b) - 1) * np.minimum(a, b)
        assert np.sqrt((off**2).mean()) < WITHIN[kind], part


@pytest.mark.slow
def test_the_force_is_the_same_from_label_volume_surfaces_and_cross_sections(tmp_path, leg_files):
    force = {}
    for kind in WITHIN:
        section = f"{entry_of(leg_files, kind)}\nlevel_mm = {LEVEL}"
        leg = subject_of_scan(tmp_path / kind, section, "aim_mm = [3.0, 0.0]\ndirection_deg = 270.0")
        test = plane_strain_test(leg)
        solved = test.solve({"deep.C10": 1e-3, "deep.C20": 1e-3}, depth=20.0)
        force[kind] = solved.curve([5.0, 10.0, 15.0, 20.0])
    for kind in WITHIN:
        print(kind, np.abs(force[kind] / force["csv"] - 1).max())
        assert force[kind] == pytest.approx(force["csv"], rel=5e-3), kind


def _filled(surface, level: float, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return which points of a grid lie inside a surface at a level, by counting crossings."""
    corners = surface.triangles
    inside = np.zeros((len(x), len(y)), dtype=bool)
    cut = corners[(corners[..., 2].min(axis=1) < level) & (corners[..., 2].max(axis=1) > level)]
    ends = []
    for a, b in ((0, 1), (1, 2), (2, 0)):
        with np.errstate(divide="ignore"):
            share = (level - cut[:, a, 2]) / (cut[:, b, 2] - cut[:, a, 2])
        point = cut[:, a, :2] + share[:, None] * (cut[:, b, :2] - cut[:, a, :2])
        ends.append(np.where(((share > 0) & (share < 1))[:, None], point, np.nan))
    ends = np.stack(ends, axis=1)
    order = np.argsort(np.isnan(ends[..., 0]), axis=1)[:, :2]
    start, end = (ends[np.arange(len(ends)), order[:, k]] for k in (0, 1))
    for k, row in enumerate(y):
        over = (start[:, 1] <= row) != (end[:, 1] <= row)
        share = (row - start[over, 1]) / (end[over, 1] - start[over, 1])
        at = start[over, 0] + share * (end[over, 0] - start[over, 0])
        inside[:, k] = (x[:, None] > at).sum(axis=1) % 2 == 1
    return inside


@pytest.mark.slow
@pytest.mark.skipif(not REAL.is_dir(), reason="needs ../shared/data/leg_geometry")
def test_the_force_on_a_real_leg_is_the_same_from_all_three(tmp_path):
    names = {part: REAL / f"right_{part}.stl" for part in PARTS}
    surfaces = {part: faces[0] for part, faces in read_surfaces({part: [file] for part, file in names.items()}).items()}
    spacing = np.array([0.8, 0.8, 1.0])
    low = np.array([*surfaces["skin"].bounds[0, :2] - 5.0, 255.0])
    high = np.array([*surfaces["skin"].bounds[1, :2] + 5.0, 345.0])
    x, y, z = (np.arange(a, b, s) for a, b, s in zip(low, high, spacing, strict=True))
    found = np.zeros((len(x), len(y), len(z)), dtype=np.uint8)
    for k, level in enumerate(z):
        for part, label in zip(PARTS, (1, 2, 3, 3), strict=True):
            # Nothing of the leg lies outside of its skin, but for a mm of the real hull's.
            there = _filled(surfaces[part], level + 1e-4, x, y)
            found[there if part == "skin" else there & (found[:, :, k] > 0), k] = label
    write_nifti(tmp_path / "leg.nii.gz", found, low, spacing)
    leg_files = ", ".join(f'{part} = "{file}"' for part, file in names.items())
    entries = {
        "nifti": f'scan = "{tmp_path}/leg.nii.gz"',
        "stl": f"surfaces = {{{leg_files}}}",
        "csv": f'contours = "{REAL}/cross_sections_5mm.csv"',
    }
    force = {}
    for kind, entry in entries.items():
        place = "aim_mm = [-80.0, 0.0]\ndirection_deg = 270.0"
        leg = subject_of_scan(tmp_path / kind, f"{entry}\nlevel_mm = 300.0", place)
        test = plane_strain_test(leg)
        solved = test.solve({"deep.C10": 1e-3, "deep.C20": 1e-3}, depth=20.0)
        force[kind] = solved.curve([5.0, 10.0, 15.0, 20.0])
    for kind in ("nifti", "stl"):
        assert force[kind] == pytest.approx(force["csv"], rel=5e-3), kind


def test_muscles_may_have_a_surface_or_a_loop_each(tmp_path, leg_files, sources):
    plane = CuttingPlane.at_level(50.0)
    hull = Polygon(outline("muscle_hull", 50.0))
    rows = (leg_files / "sections.csv").read_text().splitlines()
    kept = [row for row in rows if not row.startswith("50,muscle_hull")]
    for loop, side in enumerate((hull & _half(1.0), hull & _half(-1.0))):
        kept += [f"50,muscle_hull,{loop},{i},{x:.4f},{y:.4f}" for i, (x, y) in enumerate(side.exterior.coords[:-1])]
    (tmp_path / "muscles.csv").write_text("\n".join(kept) + "\n")
    source = LegSource("muscles", contours=tmp_path / "muscles.csv")
    assert source.outlines(plane)["muscle_hull"].area == pytest.approx(hull.area, rel=2e-3)
    halves = sources["stl"].surfaces["muscle_hull"] * 2
    both = LegSource("both", surfaces={**sources["stl"].surfaces, "muscle_hull": halves})
    assert both.outlines(plane)["muscle_hull"].area == pytest.approx(hull.area, rel=1e-3)


def _half(side: float) -> Polygon:
    """Return what lies more than 1 mm on a side of x = 0."""
    return Polygon([(side, -99), (99 * side, -99), (99 * side, 99), (side, 99)])


def test_what_geometry_writes_of_a_scan_is_read_as_a_stockings_leg(tmp_path, leg_files):
    options = [f"--surface={part}={leg_files}/{part}.stl" for part in PARTS]
    leg = made_leg(tmp_path / "leg", *options, "--level", "50")
    assert leg.section.skin[:, 1].max() == pytest.approx(sum(ellipse("skin", 50.0)[[1, 3]]), abs=0.1)
    shape = read_shape(tmp_path / "leg" / "cross-sections.csv")
    assert shape.length >= 40.0 and shape.bones == ("tibia", "fibula")
    assert shape.at("skin", 50.0)[:, 1].max() == pytest.approx(leg.section.skin[:, 1].max(), abs=0.1)
    again = LegSource("again", contours=tmp_path / "leg" / "cross-sections.csv")
    cut = again.outlines(CuttingPlane.at_level(50.0))["skin"]
    assert cut.hausdorff_distance(Polygon(outline("skin", 50.0))) < 0.1


def test_the_picture_of_a_folder_that_names_a_scan_is_made_alone(tmp_path, leg_files):
    subject_of_scan(tmp_path / "leg", f"{entry_of(leg_files, 'stl')}\nlevel_mm = 50.0")
    done = CliRunner().invoke(app, ["--subject-dir", str(tmp_path / "leg")])
    assert done.exit_code == 0, done.output
    assert sorted(p.name for p in (tmp_path / "leg").iterdir()) == ["section.png", "subject.toml"]
