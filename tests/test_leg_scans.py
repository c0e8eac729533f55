"""Legs from scans: one section, whatever it is cut from; the indenter's pose; what is refused."""

from __future__ import annotations

import locale
from pathlib import Path

import nibabel
import numpy as np
import pytest
import SimpleITK
from making import SHARED, TOML
from making_scans import (
    HEIGHT,
    PARTS,
    SPACING,
    ellipse,
    labels,
    outline,
    surface,
    turned_labels,
    write_cross_sections,
    write_nifti,
    write_polydata,
    write_surfaces,
)
from shapely import Polygon
from typer.testing import CliRunner

from legfem.common.errors import InputError
from legfem.experiments.plane_strain import PlaneStrainIndentation
from legfem.geometry.__main__ import app
from legfem.geometry.plane import CuttingPlane
from legfem.geometry.rigid import RigidTransform
from legfem.geometry.shape_file import read_shape
from legfem.imaging.leg_source import LegSource
from legfem.imaging.outlines import OutlineSettings
from legfem.imaging.surfaces import read_surfaces
from legfem.imaging.volume import LabelVolume
from legfem.imaging.volume_file import read_volume
from legfem.subjects.loading import load_subject
from legfem.subjects.plausibility import doubts_about
from legfem.subjects.subject import Subject

REAL = SHARED / "data" / "leg_geometry"
LEVEL = 52.7
TILTED = CuttingPlane(np.array([0.0, 10.0, 50.0]), np.array([0.1, -0.15, 1.0]))
FLAT = 'contours = "contours.csv"'
PLACE = "aim_mm = [0.0, 0.0]\ndirection_deg = 90.0"
WITHIN = {"nifti": 0.12, "oblique": 0.12, "stl": 0.03, "vtp": 0.03, "csv": 0.03}
"""mm, off the ellipses: labels know an outline to a tenth of a voxel or so."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("leg")
    write_nifti(folder / "leg.nii.gz", *labels())
    write_surfaces(folder)
    for part in PARTS:
        write_polydata(folder / f"{part}.vtp", surface(part), "raw zlib")
    turned, affine = turned_labels(17.0)
    nibabel.save(
        nibabel.Nifti1Image(turned, np.diag([-1, -1, 1, 1]) @ affine), folder / "turned.nii"
    )
    write_cross_sections(folder / "sections.csv", np.arange(0.0, HEIGHT + 1, 5.0))
    return folder


@pytest.fixture(scope="module")
def sources(files: Path) -> dict[str, LegSource]:
    surfaces = read_surfaces({part: [files / f"{part}.stl"] for part in PARTS})
    return {
        "nifti": LegSource("leg.nii.gz", volume=read_volume(files / "leg.nii.gz")),
        "oblique": LegSource("turned.nii", volume=read_volume(files / "turned.nii")),
        "stl": LegSource("surfaces", surfaces=surfaces),
        "vtp": LegSource(
            "surfaces",
            surfaces=read_surfaces({part: [files / f"{part}.vtp"] for part in PARTS}),
        ),
        "csv": LegSource("sections.csv", contours=files / "sections.csv"),
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


def _subject(folder: Path, section: str, place: str = PLACE, more: str = "") -> Subject:
    folder.mkdir(exist_ok=True)
    toml = TOML.replace(FLAT, section).replace(PLACE, place)
    toml = toml.replace("D1_per_MPa = 22.5\n\n[instrument]", "D1_per_MPa = 22.5\n\n[instrument]")
    (folder / "subject.toml").write_text(toml + more)
    return load_subject(folder, need_recordings=False)


def _entry(files: Path, kind: str) -> str:
    return {
        "nifti": f'scan = "{files}/leg.nii.gz"',
        "oblique": f'scan = "{files}/turned.nii"',
        "stl": "surfaces = {" + ", ".join(f'{p} = "{files}/{p}.stl"' for p in PARTS) + "}",
        "vtp": "surfaces = {" + ", ".join(f'{p} = "{files}/{p}.vtp"' for p in PARTS) + "}",
        "csv": f'contours = "{files}/sections.csv"',
    }[kind]


@pytest.mark.slow
def test_the_force_is_the_same_from_label_volume_surfaces_and_cross_sections(tmp_path, files):
    force = {}
    for kind in WITHIN:
        section = f"{_entry(files, kind)}\nlevel_mm = {LEVEL}"
        leg = _subject(tmp_path / kind, section, "aim_mm = [3.0, 0.0]\ndirection_deg = 270.0")
        test = PlaneStrainIndentation.of_subject(leg)
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
    surfaces = {part: faces[0] for part, faces in read_surfaces(
        {part: [file] for part, file in names.items()}).items()}  # fmt: skip
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
    files = ", ".join(f'{part} = "{file}"' for part, file in names.items())
    entries = {
        "nifti": f'scan = "{tmp_path}/leg.nii.gz"',
        "stl": f"surfaces = {{{files}}}",
        "csv": f'contours = "{REAL}/cross_sections_5mm.csv"',
    }
    force = {}
    for kind, entry in entries.items():
        leg = _subject(tmp_path / kind, f"{entry}\nlevel_mm = 300.0",
                       "aim_mm = [-80.0, 0.0]\ndirection_deg = 270.0")  # fmt: skip
        test = PlaneStrainIndentation.of_subject(leg)
        solved = test.solve({"deep.C10": 1e-3, "deep.C20": 1e-3}, depth=20.0)
        force[kind] = solved.curve([5.0, 10.0, 15.0, 20.0])
    for kind in ("nifti", "stl"):
        assert force[kind] == pytest.approx(force["csv"], rel=5e-3), kind


def test_a_pose_in_the_scan_makes_plane_aim_and_direction(tmp_path, files):
    entry = _entry(files, "stl")
    at_level = _subject(tmp_path / "level", f"{entry}\nlevel_mm = 50.0",
                        "aim_mm = [3.0, 70.0]\ndirection_deg = 250.0")  # fmt: skip
    angle = np.radians(250.0)
    way = np.array([np.cos(angle), np.sin(angle), 0.0])
    posed = _subject(tmp_path / "posed", entry, _pose(np.array([3.0, 70.0, 50.0]), way))
    assert posed.indenter.direction_deg == pytest.approx(250.0)
    assert posed.indenter.aim == pytest.approx([3.0, 70.0])
    assert posed.section.skin == pytest.approx(at_level.section.skin)
    # Pressed downwards by 12 degrees, the plane tilts with the travel.
    down = np.array([0.0, -np.cos(np.radians(12)), -np.sin(np.radians(12))])
    tilted = _subject(tmp_path / "tilted", entry, _pose(np.array([3.0, 70.0, 65.0]), down))
    assert tilted.indenter.direction == pytest.approx([0, -1])
    height = np.ptp(tilted.section.skin[:, 1]) / np.ptp(at_level.section.skin[:, 1])
    assert height == pytest.approx(1 / np.cos(np.radians(12)), rel=0.02)


def _pose(position: np.ndarray, way: np.ndarray, more: str = "") -> str:
    return f"position_mm = {position.tolist()}\ndirection = {way.tolist()}\n{more}"


def _landmarks(folder: Path, scan: np.ndarray, tracker: np.ndarray) -> str:
    rows = ["name,x_mm,y_mm,z_mm,scan_x_mm,scan_y_mm,scan_z_mm"]
    rows += [
        f"point {k},{a[0]:.4f},{a[1]:.4f},{a[2]:.4f},{b[0]:.4f},{b[1]:.4f},{b[2]:.4f}"
        for k, (a, b) in enumerate(zip(tracker, scan, strict=True))
    ]
    (folder / "landmarks.csv").write_text("\n".join(rows) + "\n")
    return f'landmarks = "{folder}/landmarks.csv"'


SCAN_POINTS = np.array([[-10.0, -60, 5], [30, -50, 90], [60, 10, 20], [-58, 5, 70.0]])
TRACKER = RigidTransform.of_angles((40.0, -25.0, 130.0), np.array([500.0, -200.0, 90.0]))


def test_landmarks_bring_a_pose_from_the_tracker_into_the_scan(tmp_path, files):
    entry, way = _entry(files, "csv"), np.array([0.1, -1.0, 0.05])
    position = np.array([3.0, 70.0, 50.0])
    there = _subject(tmp_path / "scan", entry, _pose(position, way))
    more = _landmarks(tmp_path, SCAN_POINTS, TRACKER(SCAN_POINTS))
    pose = _pose(TRACKER(position), TRACKER.rotation @ way, more)
    tracked = _subject(tmp_path / "tracker", entry, pose)
    assert tracked.indenter.aim == pytest.approx(there.indenter.aim, abs=1e-3)
    assert tracked.indenter.direction_deg == pytest.approx(there.indenter.direction_deg, abs=1e-3)
    assert tracked.section.skin == pytest.approx(there.section.skin, abs=0.01)
    assert tracked.landmark_residual == pytest.approx(0.0, abs=1e-3)
    _landmarks(tmp_path, SCAN_POINTS, TRACKER(SCAN_POINTS) + 4 * np.eye(4, 3))
    off = load_subject(tmp_path / "tracker", need_recordings=False)
    assert [doubt.field for doubt in doubts_about(off)] == ["indenter.landmarks"]
    _landmarks(tmp_path, SCAN_POINTS, TRACKER(SCAN_POINTS[[1, 0, 2, 3]]))
    with pytest.raises(InputError, match=r"point \d: lies .* mm off once registered"):
        load_subject(tmp_path / "tracker", need_recordings=False)


@pytest.mark.parametrize(
    ("section", "place", "words"),
    [
        ("level_mm = 500.0", PLACE, "leaves the scan|levels between"),
        ("", PLACE, "section.level_mm: missing"),
        ("level_mm = 50.0", "position_mm = [0.0, 70.0, 50.0]\ndirection = [0.0, -1.0, 0.0]",
         "beside indenter.position_mm"),
        ("", "position_mm = [0.0, 70.0, 50.0]\ndirection_deg = 270.0", "belong together"),
        ("", "position_mm = [0.0, 70.0, 50.0]\ndirection = [0.0, 0.1, 1.0]",
         "doesn't lie across the leg"),
        ("", "position_mm = [0.0, 70.0, 50.0]\ndirection = [0.0, -1.0, 0.0]\n"
         "axis = [0.0, -1.0, 1.0]", "axis: stands at 45 degrees"),
        ("", "position_mm = [0.0, 70.0, 90.0]\ndirection = [0.0, -1.0, 0.3]",
         "ends within the section|leaves the scan"),
        ("level_mm = 50.0", f"{PLACE}\naxis = [0.0, 0.0, 1.0]", "of use with position_mm alone"),
        ("level_mm = 50.0\nseries = 'dicom'", PLACE, "series: is given without a scan"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("kind", ["stl", "csv"])
def test_planes_that_cut_no_leg_give_one_line(tmp_path, files, kind, section, place, words):
    if kind == "csv" and not section and "aim_mm" in place:
        words = "level_mm: these are contours at several levels"
    with pytest.raises(InputError, match=words) as caught:
        _subject(tmp_path / "leg", f"{_entry(files, kind)}\n{section}", place)
    assert "\n" not in str(caught.value)


def _split(half: float) -> LegSource:
    """Return a scan of 30 mm in which fat of twice a width (mm) splits the muscle behind."""
    found, origin = labels()
    y = origin[1] + SPACING[1] * np.arange(found.shape[1])
    band = found[:, np.abs(y - 12.0) < half]
    found[:, np.abs(y - 12.0) < half] = np.where(band == 2, 1, band)
    origin = origin + np.array([0.0, 0.0, 18 * SPACING[2]])
    return LegSource("scan", volume=LabelVolume(found[:, :, 18:33], SPACING, origin, "scan"))


def test_muscles_apart_are_joined_to_one_hull():
    plane = CuttingPlane.at_level(LEVEL)
    hull, whole = (_split(half).outlines(plane)["muscle_hull"] for half in (2.0, 0.0))
    # The taut sheet is a chord where the gap meets the hull's edge: 4 mm of a radius of 50.
    assert hull.area == pytest.approx(whole.area, rel=5e-3)
    assert hull.hausdorff_distance(whole) < 1.0
    with pytest.raises(InputError, match=r"muscle_hull: is in 2 pieces at slice .* 20 mm apart"):
        _split(14.0).outlines(plane)


def test_muscles_may_have_a_surface_or_a_loop_each(tmp_path, files, sources):
    plane = CuttingPlane.at_level(50.0)
    hull = Polygon(outline("muscle_hull", 50.0))
    rows = (files / "sections.csv").read_text().splitlines()
    kept = [row for row in rows if not row.startswith("50,muscle_hull")]
    for loop, side in enumerate((hull & _half(1.0), hull & _half(-1.0))):
        kept += [f"50,muscle_hull,{loop},{i},{x:.4f},{y:.4f}"
                 for i, (x, y) in enumerate(side.exterior.coords[:-1])]  # fmt: skip
    (tmp_path / "muscles.csv").write_text("\n".join(kept) + "\n")
    source = LegSource("muscles", contours=tmp_path / "muscles.csv")
    assert source.outlines(plane)["muscle_hull"].area == pytest.approx(hull.area, rel=2e-3)
    halves = sources["stl"].surfaces["muscle_hull"] * 2
    both = LegSource("both", surfaces={**sources["stl"].surfaces, "muscle_hull": halves})
    assert both.outlines(plane)["muscle_hull"].area == pytest.approx(hull.area, rel=1e-3)


def _half(side: float) -> Polygon:
    """Return what lies more than 1 mm on a side of x = 0."""
    return Polygon([(side, -99), (99 * side, -99), (99 * side, 99), (side, 99)])


def test_a_scan_without_a_skin_is_refused(tmp_path, files):
    found, origin = labels()
    write_nifti(tmp_path / "muscle.nii", np.where(found == 1, 0, found), origin)
    with pytest.raises(InputError, match=r"labelled 1 \(superficial\); segment fat and skin"):
        read_volume(tmp_path / "muscle.nii")
    entry = _entry(files, "stl").replace(f'skin = "{files}/skin.stl", ', "")
    with pytest.raises(InputError, match="skin: the part is missing"):
        _subject(tmp_path / "leg", f"{entry}\nlevel_mm = 50.0")
    entry = _entry(files, "stl").replace(f"{files}/skin.stl", f"{files}/muscle_hull.stl")
    with pytest.raises(InputError, match="skin: lies on the muscles' hull along 100 %"):
        _subject(tmp_path / "leg", f"{entry}\nlevel_mm = 50.0")


def _write_series(folder: Path, found: np.ndarray, origin: np.ndarray) -> Path:
    """Write a DICOM series, a file a slice."""
    folder.mkdir()
    image = SimpleITK.GetImageFromArray(found.transpose(2, 1, 0).astype(np.int16))
    writer = SimpleITK.ImageFileWriter()
    writer.KeepOriginalImageUIDOn()
    for k in range(image.GetDepth()):
        cut = image[:, :, k]
        cut.SetSpacing((0.8, 0.9))
        for tag, value in (
            ("0008|0060", "OT"), ("0020|000d", "1.2.3"), ("0020|000e", "1.2.3.4"),
            ("0008|0018", f"1.2.3.4.{k + 1}"), ("0020|0013", str(k)),
            ("0020|0037", r"1\0\0\0\1\0"),
            ("0020|0032", f"{origin[0]}\\{origin[1]}\\{origin[2] + SPACING[2] * k}"),
        ):  # fmt: skip
            cut.SetMetaData(tag, value)
        writer.SetFileName(str(folder / f"{k:03d}.dcm"))
        writer.Execute(cut)
    return folder


def test_a_dicom_series_of_labels_is_a_volume_and_places_one(tmp_path, files):
    found, origin = labels()
    found, origin = found[:, :, :12], origin + 40.0
    before = locale.setlocale(locale.LC_ALL)
    series = _write_series(tmp_path / "dicom", found, origin)
    locale.setlocale(locale.LC_ALL, before)
    read = read_volume(series)
    assert locale.setlocale(locale.LC_ALL) == before, "SimpleITK would leave it at C"
    assert np.array_equal(read.labels, found)
    assert read.origin == pytest.approx(origin) and read.spacing == pytest.approx(SPACING)
    lost = nibabel.Nifti1Image(found, None)
    nibabel.save(lost, tmp_path / "lost.nii")
    with pytest.raises(InputError, match="says not where the volume lies"):
        _subject(tmp_path / "leg", f'scan = "{tmp_path}/lost.nii"',
                 _pose(np.array([0.0, 70.0, 50.0]), np.array([0.0, -1.0, 0.0])))  # fmt: skip
    placed = read_volume(tmp_path / "lost.nii", series=series)
    assert placed.transform and placed.origin == pytest.approx(origin)
    nibabel.save(nibabel.Nifti1Image(found[1:], None), tmp_path / "lost.nii")
    with pytest.raises(InputError, match=r"shape: \d+ x \d+ x 12 voxels, but"):
        read_volume(tmp_path / "lost.nii", series=series)


def _made(folder: Path, *options: str) -> Subject:
    done = CliRunner().invoke(app, [*options, "--out", str(folder)])
    assert done.exit_code == 0, done.output
    assert f"picture: {folder}/section.png" in done.output.replace("\n", "")
    return load_subject(folder, need_recordings=False)


@pytest.mark.parametrize("angle", [0.0, 45.0, 90.0, 200.0])
def test_the_aim_follows_the_direction(tmp_path, files, angle):
    leg = _made(tmp_path / "leg", "--cross-sections", str(files / "sections.csv"), "--level", "50",
                "--direction", str(angle))  # fmt: skip
    x, y, a, b = ellipse("skin", 50.0)
    way = -leg.indenter.direction
    # The ellipse's point with this normal.
    facing = np.array([x, y]) + np.array([a**2, b**2]) * way / np.hypot(a * way[0], b * way[1])
    across = np.array([-way[1], way[0]])
    assert (leg.indenter.aim - facing) @ across == pytest.approx(0.0, abs=1.0)
    assert (leg.indenter.aim - facing) @ way == pytest.approx(0.0, abs=0.1)


def test_what_geometry_writes_of_a_scan_is_read_as_a_stockings_leg(tmp_path, files):
    options = [f"--surface={part}={files}/{part}.stl" for part in PARTS]
    leg = _made(tmp_path / "leg", *options, "--level", "50")
    assert leg.section.skin[:, 1].max() == pytest.approx(
        sum(ellipse("skin", 50.0)[[1, 3]]), abs=0.1
    )
    shape = read_shape(tmp_path / "leg" / "cross-sections.csv")
    assert shape.length >= 40.0 and shape.bones == ("tibia", "fibula")
    assert shape.at("skin", 50.0)[:, 1].max() == pytest.approx(
        leg.section.skin[:, 1].max(), abs=0.1
    )
    again = LegSource("again", contours=tmp_path / "leg" / "cross-sections.csv")
    cut = again.outlines(CuttingPlane.at_level(50.0))["skin"]
    assert cut.hausdorff_distance(Polygon(outline("skin", 50.0))) < 0.1


def test_the_picture_of_a_folder_that_names_a_scan_is_made_alone(tmp_path, files):
    _subject(tmp_path / "leg", f"{_entry(files, 'stl')}\nlevel_mm = 50.0")
    done = CliRunner().invoke(app, ["--subject-dir", str(tmp_path / "leg")])
    assert done.exit_code == 0, done.output
    assert sorted(p.name for p in (tmp_path / "leg").iterdir()) == ["section.png", "subject.toml"]


def test_a_scan_of_both_legs_is_refused():
    found, origin = labels()
    both = LabelVolume(np.concatenate([found, found]), SPACING, origin, "leg.nii")
    with pytest.raises(InputError, match=r"leg.nii: slice \d+: shows two legs"):
        LegSource("leg.nii", volume=both).outlines(CuttingPlane.at_level(LEVEL))


def test_labels_without_a_scan_are_refused_and_a_cut_is_told(tmp_path, files):
    section = f"{_entry(files, 'csv')}\nlevel_mm = 50.0"
    assert _subject(tmp_path / "leg", section).cut_from == "sections.csv, level 50 mm"
    with pytest.raises(InputError, match="labels: are given without a scan"):
        _subject(tmp_path / "leg", section, more="\n[labels]\ndeep = 2\n")


def test_what_lies_beyond_a_segment_may_be_anything():
    found, origin = labels()
    fat, muscle = (found == label for label in (1, 2))
    fat[:, :, :20] = muscle[:, :, :20] = False
    found[fat], found[muscle] = 2, 1
    scan = LegSource("leg.nii", volume=LabelVolume(found, SPACING, origin, "leg.nii"))
    with pytest.raises(InputError, match="lies outermost, where fat is"):
        scan.shape(OutlineSettings(), None)
    shape = scan.between(0.0, 38.0).shape(OutlineSettings(), None)
    assert shape.bones == ("tibia", "fibula") and shape.levels[-1] <= 38.0
