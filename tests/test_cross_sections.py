"""From sections of a leg's surfaces to a subject folder."""

from __future__ import annotations

import numpy as np
import pytest
from making import SHARED, circle
from shapely import Polygon
from typer.testing import CliRunner

from legfem.common.errors import InputError
from legfem.geometry.__main__ import app
from legfem.geometry.motion import CuttingPlane
from legfem.geometry.section import fat_thickness, girth, minimal_fat_thickness
from legfem.geometry.section_from_outlines import section_from_outlines
from legfem.imaging.leg_source import LegSource
from legfem.legs.folder import folder_of_leg
from legfem.legs.loading import load_subject

REAL = SHARED / "data" / "leg_geometry" / "cross_sections_5mm.csv"
real_leg = pytest.mark.skipif(not REAL.is_file(), reason="needs ../shared/data/leg_geometry")


def _surfaces() -> dict[str, np.ndarray]:
    """A hull that leaves half of the tibia outside, 1 mm under the skin."""
    return {
        "skin": circle(0, 0, 60, 150),
        "muscle_hull": circle(0, 5, 45, 300),
        "tibia": circle(0, -45, 14, 60),
        "fibula": circle(25, -20, 6, 40),
    }


def _source(path):
    return LegSource(str(path), contours=path)


def _write(path, surfaces):
    rows = ["level_mm,part,loop,i,x_mm,y_mm"]
    rows += [f"300,{part},0,{i},{x:.3f},{y:.3f}" for part, xy in surfaces.items() for i, (x, y) in enumerate(xy)]
    path.write_text("\n".join(rows) + "\n")
    return path


def test_a_tibia_under_the_skin_is_wrapped_and_cut_back():
    outlines = {part: Polygon(xy) for part, xy in _surfaces().items()}
    section = section_from_outlines(outlines, 0.6, "made")
    parts = {part: section.polygon(part) for part in section.parts}
    assert minimal_fat_thickness(section) >= 1.5
    for bone in ("tibia", "fibula"):
        assert parts[bone].within(parts["fascia"].buffer(-0.6 - 1.0))
    assert 0.8 < parts["tibia"].area / outlines["tibia"].area < 0.98
    assert parts["fibula"].area == pytest.approx(outlines["fibula"].area, rel=0.03)
    # Away from the bone nothing has moved.
    back = np.array([0.0, 0.0]), np.array([0.0, -1.0])
    assert fat_thickness(section, *back) == pytest.approx(10.0, abs=0.3)


@pytest.mark.parametrize("gap", [-2.0, 0.0, 0.5])
def test_bones_that_meet_below_the_knee_are_set_apart(gap):
    outlines = {part: Polygon(xy) for part, xy in _surfaces().items()}
    outlines["tibia"] = Polygon(circle(0, -15, 14, 60))
    outlines["fibula"] = Polygon(circle(20 + gap, -15, 6, 40))
    section = section_from_outlines(outlines, 0.6, "made")
    tibia, fibula = section.polygon("tibia"), section.polygon("fibula")
    assert tibia.distance(fibula) > 1.0
    assert tibia.area == pytest.approx(outlines["tibia"].area, rel=0.02)
    assert 0.5 < fibula.area / outlines["fibula"].area < 1.0


def test_outlines_of_a_hundred_thousand_points_are_thinned():
    few = {part: Polygon(xy) for part, xy in _surfaces().items()}
    many = dict(few, skin=Polygon(circle(0, 0, 60, 100_000)))
    one, other = (section_from_outlines(outlines, 0.6, "made") for outlines in (few, many))
    assert len(other.skin) == pytest.approx(len(one.skin), abs=2)
    assert other.polygon("skin").area == pytest.approx(one.polygon("skin").area, rel=1e-3)


def test_a_folder_is_written_whole_and_loads(tmp_path):
    path = _write(tmp_path / "sections.csv", _surfaces())
    out = folder_of_leg(_source(path), 300, tmp_path / "out" / "leg (left)", fascia_thickness=0.8)
    subject = load_subject(out, need_recordings=False)
    assert subject.id == "leg -left-", "an id is a plain name"
    assert subject.section.fascia_thickness == 0.8
    assert subject.indenter.direction == pytest.approx([0, -1])
    assert subject.indenter.aim == pytest.approx([0, 60], abs=1.0)
    assert sorted(p.name for p in out.parent.iterdir()) == ["leg (left)"]


def test_nothing_is_written_when_it_cannot_be_whole(tmp_path):
    surfaces = _surfaces() | {"tibia": circle(0, -70, 3)}
    path = _write(tmp_path / "sections.csv", surfaces)
    with pytest.raises(InputError, match="tibia"):
        folder_of_leg(_source(path), 300, tmp_path / "leg")
    assert [p.name for p in tmp_path.iterdir()] == ["sections.csv"]
    good = _write(tmp_path / "sections.csv", _surfaces())
    with pytest.raises(InputError, match="misses the leg") as caught:
        folder_of_leg(_source(good), 300, tmp_path / "leg", aim=np.array([200.0, 0.0]))
    assert caught.value.source == str(tmp_path / "leg" / "subject.toml")
    assert [p.name for p in tmp_path.iterdir()] == ["sections.csv"]


def test_an_existing_folder_is_left_alone(tmp_path):
    path = _write(tmp_path / "sections.csv", _surfaces())
    (tmp_path / "leg").mkdir()
    (tmp_path / "leg" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="exists already"):
        folder_of_leg(_source(path), 300, tmp_path / "leg")
    assert [p.name for p in (tmp_path / "leg").iterdir()] == ["notes.txt"]


def test_wrong_level_and_missing_surface_are_explained(tmp_path):
    surfaces = _surfaces()
    del surfaces["fibula"]
    path = _write(tmp_path / "sections.csv", surfaces)
    with pytest.raises(InputError, match="there is no level 305 mm, only 300 mm"):
        _source(path).outlines(CuttingPlane.at_level(305))
    with path.open("a") as file:
        file.writelines(f"310,fibula,0,{i},{x},{y}\n" for i, (x, y) in enumerate(_surfaces()["fibula"]))
    with pytest.raises(InputError, match="fibula: missing at level 300"):
        _source(path).outlines(CuttingPlane.at_level(300))
    del surfaces["tibia"]
    with pytest.raises(InputError, match="bones: there are none at level 300"):
        _source(_write(path, surfaces)).outlines(CuttingPlane.at_level(300))


def test_a_calf_from_a_scan_without_its_fibula_is_doubted(tmp_path):
    surfaces = _surfaces()
    del surfaces["fibula"]
    path = _write(tmp_path / "sections.csv", surfaces)
    done = CliRunner().invoke(app, ["--cross-sections", str(path), "--out", str(tmp_path / "leg"), "--level", "300"])
    assert done.exit_code == 0 and "there is no fibula, which a calf has" in " ".join(done.output.split())


def test_the_command_exits_2_with_one_line(tmp_path):
    path = _write(tmp_path / "sections.csv", _surfaces())
    options = ["--cross-sections", str(path), "--out", str(tmp_path / "leg"), "--level"]
    failed = CliRunner().invoke(app, [*options, "305"])
    assert failed.exit_code == 2
    assert failed.output.count("\n") == 1
    assert "level" in failed.output
    done = CliRunner().invoke(app, [*options, "300"])
    assert done.exit_code == 0
    assert "girth 377 mm" in done.output
    assert (tmp_path / "leg" / "contours.csv").is_file()


@real_leg
def test_the_real_calf_becomes_a_subject(tmp_path):
    out = folder_of_leg(_source(REAL), 300, tmp_path / "calf")
    section = load_subject(out, need_recordings=False).section
    assert girth(section) == pytest.approx(378, abs=1)
    assert minimal_fat_thickness(section) > 1.5
    subject = load_subject(out, need_recordings=False)
    fat = fat_thickness(section, subject.indenter.aim, subject.indenter.direction)
    assert fat == pytest.approx(12, abs=1)


@real_leg
@pytest.mark.parametrize("level", [170, 250, 380])
def test_other_levels_convert_too(level):
    section = section_from_outlines(_source(REAL).outlines(CuttingPlane.at_level(level)), 0.6, REAL)
    assert minimal_fat_thickness(section) > 1.5
