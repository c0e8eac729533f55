"""What labs export besides a plain table: sizes in headings, rheometers' tests, coarse counters, odd rows and cells."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from openpyxl import Workbook
from test_face_strain import FACE, bar
from test_torsion import HEIGHT, LAW, TOML, torque
from typer.testing import CliRunner

import legfem as lf
from legfem.channels.kinds.layer_thickness import FAT, refused
from legfem.commands.data import app
from legfem.common.errors import InputError
from legfem.data import segment
from legfem.data.columns import propose
from legfem.data.contact import LEG
from legfem.data.formats import read_sheets
from legfem.data.phases import HOLD, LOADING
from legfem.data.plausibility import magnitude_doubts, trial_doubts
from legfem.data.recording import Recording, recording_of
from legfem.data.smoothing import between_steps
from legfem.report.preview import preview_of

T = np.arange(400) * 0.05
D = np.minimum(T, 12.0)
F = 0.03 * D**1.6 * np.where(T > 12.0, 0.8 + 0.2 * np.exp(-(T - 12.0) / 2.0), 1.0)
F += np.random.default_rng(0).normal(0.0, 0.005, len(T))
HEAD = "Time (s),Displacement (mm),Force (N)\n"


def rows(row: Callable[[float, float, float], str] = "{:.3f},{:.4f},{:.4f}".format) -> str:
    return "".join(row(t, d, f) + "\n" for t, d, f in zip(T, D, F, strict=True))


def read(path: Path) -> Recording:
    sheets = read_sheets(path)
    return recording_of(path, sheets, propose(path, sheets).channels)


def written(path: Path, text: str, encoding: str = "utf-8") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode(encoding))
    return path


BAR = {"width": 4.9, "thickness": 2.1, "length": 20.0}
DISC = {"diameter": 12.5, "height": 4.0}
SIZES = {
    "Bluehill, a line each": ('"Width","4.9","mm"\n"Thickness","2.1","mm"\n"Length","20.00","mm"\n\n', BAR),
    "Bluehill, a table": (",Label,Width (mm),Thickness (mm),Length (mm),Load (N)\n1,s,4.9,2.1,20,3\n\n", BAR),
    "a table with its units below": ("Label,Diameter,Height\n,mm,cm\n1,12.5,0.4\n\n", DISC),
    "German": ("Probenbreite b0,4.9,mm\nProbendicke a0,2.1,mm\nEinspannlänge,20,mm\n", BAR),
    "testXpert's letters": ("a0,2.1,mm\nb0,4.9,mm\nL0,20,mm\nS0,0.1029,cm²\n", {**BAR, "area": 10.29}),
    "French": ("Diamètre de l'éprouvette,12.5,mm\nHauteur,4,mm\n", DISC),
    "behind marks": ("# Specimen diameter [mm] = 12.5\n# Specimen height [mm] = 4.0\n", DISC),
    "inches": ("Diameter,0.5,in\n", {"diameter": 12.7}),
    "an indenter's, a cable's and a way's": ("Indenter diameter,3,mm\nCable length: 30 mm\nStroke length,9,mm\n", {}),
    "without a unit, negative, or none": ("Diameter,12\nLength,-5,mm\nWidth,0,mm\n", {}),
    "of several specimens": ("Thickness (mm),Width (mm)\n2.0,10\n2.1,11\n\n", {}),
    "stated twice, otherwise": ("Diameter,12,mm\nDiameter,13,mm\nHeight,4,mm\n", {"height": 4.0}),
    "beside a long remark": ("Note," + "x" * 200_000 + "\nHeight,4,mm\n", {"height": 4.0}),
}


@pytest.mark.parametrize("name", SIZES)
def test_a_specimen_s_sizes_are_read_in_a_heading_and_no_other_lengths(tmp_path: Path, name: str) -> None:
    head, sizes = SIZES[name]
    found = read(written(tmp_path / "a.csv", head + HEAD + rows()))
    assert found.sizes == pytest.approx(sizes)
    np.testing.assert_allclose(found.force, F, atol=1e-4)


@pytest.mark.parametrize(
    ("head", "wanted"),
    [
        (SIZES["German"][0], {"length_mm": 20.0, "area_mm2": 10.29}),
        (SIZES["French"][0], {"diameter_mm": 12.5, "height_mm": 4.0}),
    ],
)
def test_a_look_at_files_writes_a_specimen_each_with_its_heading_s_sizes(
    tmp_path: Path, head: str, wanted: dict[str, float]
) -> None:
    files = [str(written(tmp_path / f"{name}.csv", head + HEAD + rows())) for name in ("a", "b c")]
    done = CliRunner().invoke(app, ["look", *files, "--out", str(tmp_path / "out")])
    assert done.exit_code == 0 and "its heading states the specimen's" in done.output
    given = tomllib.loads((tmp_path / "out/recordings.toml").read_text())
    assert given["specimen"] == [
        {"name": name, "recordings": [f"recordings/{name}.csv"], **wanted} for name in ("a", "b c")
    ]


PLATES = """\
id = "gel"
title = "Made for a test"
origin = "measured"
[plates]
diameter_mm = 12.5
height_mm = 5.0
ends = "bonded"
[recordings]
[recordings.time]
column = "Time"
unit = "s"
[recordings.displacement]
column = "Displacement"
unit = "mm"
[recordings.force]
column = "Force"
unit = "N"
"""


def test_a_size_that_the_heading_states_otherwise_is_doubted_and_the_form_begins_with_it(tmp_path: Path) -> None:
    head = "Diameter,12.5,mm\nHeight,4,mm\n" + HEAD
    written(tmp_path / "gel/recordings/a.csv", head + rows(lambda t, d, f: f"{t:.3f},{d / 10:.5f},{f:.4f}"))
    written(tmp_path / "gel/specimen.toml", PLATES)
    doubts = {one.field: str(one) for one in lf.load_specimen(tmp_path / "gel").doubts}
    assert "is 4 in its heading, and 5 by specimen.toml" in doubts["height_mm"]
    assert "diameter_mm" not in doubts
    (tmp_path / "out").mkdir()
    assert preview_of(tmp_path / "gel", tmp_path / "out").recordings[0].sizes == DISC


def trios(steps: dict[str, dict[str, tuple[str, Sequence[float]]]], part: str = "Processed") -> str:
    """Return a TRIOS export of steps, whose columns are a unit and readings."""
    heads, lines, ids = {}, [], []
    for name, columns in steps.items():
        ids.append({"Id": name, "Name": name})
        keys = {f"{column}_{unit}": (column, unit, values) for column, (unit, values) in columns.items()}
        heads |= {key: {"DisplayName": name, "Unit": {"Name": unit}} for key, (name, unit, _) in keys.items()}
        own = zip(*(values for *_, values in keys.values()), strict=True)
        lines += [{"Results Step Id": name, **dict(zip(keys, map(float, one), strict=True))} for one in own]
    geometry = {"Diameter": {"Value": 25.0, "Unit": {"Name": "mm"}}, "Gap": {"Value": 6000.0, "Unit": {"Name": "µm"}}}
    return json.dumps(
        {
            "Schema": {"Url": "https://software.tainstruments.com/schemas/TRIOSJSONExportSchema"},
            "Procedure": {"Configuration": {"InstrumentConfigurations": [{"Geometry": geometry}]}},
            "Results": {part: {"ResultsSteps": ids, "ColumnHeaders": heads, "Rows": lines}},
        }
    )


ANGLE = np.linspace(0.0, 0.4, 160)
NOISE = np.random.default_rng(4).normal(0.0, 0.3, len(ANGLE)) + 0.3 * np.sin(9 * ANGLE)
READ = torque(LAW, ANGLE) + NOISE
TWIST = {
    "Run time": ("s", 300 + 100 * ANGLE),
    "Step time": ("s", 100 * ANGLE),
    "Displacement": ("rad", 0.7 - np.round(ANGLE, 5)),
    "Torque": ("µN.m", -1e3 * READ),
    "Gap": ("mm", 6.0 + 1e-4 * NOISE),
    "Axial force": ("N", 0.5 * ANGLE / HEIGHT * READ),
}
SWEEP = {
    "Run time": ("s", np.arange(20.0)),
    "Frequency": ("Hz", np.logspace(-1, 1, 20)),
    "Oscillation torque": ("µN.m", np.full(20, 9.0)),
    "Storage modulus": ("Pa", np.full(20, 900.0)),
    "Loss modulus": ("Pa", np.full(20, 90.0)),
    "Gap": ("mm", 1.5 + 1e-6 * np.arange(20)),
    "Axial force": ("N", 0.1 + 0.01 * np.arange(20)),
}
HALVES = [
    {name: (unit, values[half]) for name, (unit, values) in TWIST.items()} for half in (slice(80), slice(80, None))
]
EXPORTS = {
    "twist.json": trios({"Ramp": TWIST}),
    "raw.json": trios({"Ramp": TWIST}, "Unprocessed"),
    "after.json": trios({"Conditioning": SWEEP, "Ramp": TWIST}),
    "two.json": trios({"Ramp": HALVES[0], "On": HALVES[1]}),
    "paar.csv": "Time (s),Deflection Angle (mrad),Torque (mN·m)\n"
    + "".join(f"{100 * a:.3f},{1e3 * a:.5f},{m:.5f}\n" for a, m in zip(ANGLE, READ, strict=True)),
    "haake.txt": "RheoWin 4.61\tDatendatei\n\nt in s\tphi in rad\tM in µNm\n"
    + "".join(f"{100 * a:.3f}\t{a:.5f}\t{1e3 * m:.2f}\n".replace(".", ",") for a, m in zip(ANGLE, READ, strict=True)),
}


@pytest.mark.parametrize("name", EXPORTS)
def test_a_rheometer_s_export_of_a_twist_gives_its_law(tmp_path: Path, name: str) -> None:
    written(tmp_path / "gel/recordings" / name, EXPORTS[name], "cp1252" if name.endswith("txt") else "utf-8")
    written(tmp_path / "gel/recordings/notes.json", '{"operator": "A"}')
    written(tmp_path / "gel/specimen.toml", TOML)
    folder = lf.load_specimen(tmp_path / "gel")
    assert not folder.left_out and not folder.doubts
    fit = lf.identify(folder, "reduced-polynomial")["reduced-polynomial"]
    for parameter, true in (("deep.C10", LAW.C10), ("deep.C20", LAW.C20)):
        low, high = fit.estimates[parameter].ci95
        assert low < true < high


def test_a_gap_that_a_rheometer_states_otherwise_is_doubted(tmp_path: Path) -> None:
    written(tmp_path / "gel/recordings/twist.json", EXPORTS["twist.json"])
    written(tmp_path / "gel/specimen.toml", TOML.replace("height_mm = 6.0", "height_mm = 5.0"))
    assert "height_mm" in {one.field for one in lf.load_specimen(tmp_path / "gel").doubts}


def table(columns: dict[str, tuple[str, Sequence[float]]]) -> str:
    names = ",".join(f"{name} ({unit})" for name, (unit, _) in columns.items())
    values = np.column_stack([values for _, values in columns.values()])
    return names + "\n" + "".join(",".join(f"{one:.6f}" for one in row) + "\n" for row in values)


OSCILLATES = r"columns: are an oscillation's \(G', G''\), which is none of legfem's tests"
TWISTED = r"columns: are an angle's and a torque's: a cylinder was twisted; give \[torsion\] diameter_mm and height_mm"
BENT = "columns: are a bending test's, which is none of legfem's; press, pull or shear the specimen"
NO_PRESS = {
    "a sweep by TRIOS": ("a.json", trios({"Sweep": SWEEP}), OSCILLATES),
    "a sweep with a gap and a normal force": (
        "a.csv",
        table({n: one for n, one in SWEEP.items() if not n.startswith("Osc")}),
        OSCILLATES,
    ),
    "Haake's sweep": (
        "a.txt",
        "t in s\tf in Hz\tG' in Pa\tG'' in Pa\tFn in N\th in mm\n"
        + "".join(f"{k}\t{k + 1}\t9{k}\t{k}\t0,0{k}\t1,50{k}\n" for k in range(20)),
        OSCILLATES,
    ),
    "French": (
        "a.txt",
        "t en s\tf en Hz\tG' en Pa\tG\" en Pa\n" + "".join(f"{k}\t{k + 1}\t9\t1\n" for k in range(20)),
        OSCILLATES,
    ),
    "a twist by TRIOS": ("a.json", EXPORTS["after.json"], TWISTED),
    "a twist": ("a.csv", EXPORTS["paar.csv"], TWISTED),
    "bending, by a column": (
        "a.csv",
        HEAD.replace("\n", ",Flexure strain (%)\n") + rows(lambda t, d, f: f"{t:.3f},{d:.4f},{f:.4f},1"),
        BENT,
    ),
    "bending, by the heading": ("a.csv", "Test,3-point bend\n" + HEAD + rows(), BENT),
    "bending, in German": ("a.csv", "Prüfart,3-Punkt-Biegung\n" + HEAD + rows(), BENT),
    "a damaged export": ("a.json", EXPORTS["twist.json"][:900], "file: can't be read as .json"),
    "strain over time": (
        "a.csv",
        "Time (s),Strain (%),Load (N)\n" + rows(),
        "contains strain ('Strain') and force over time and no displacement; export displacement in mm",
    ),
    "names and units exchanged": (
        "a.csv",
        "Time (s),Displacement (N),Force (mm)\n" + rows(),
        "columns: 'Force' is in mm, and 'Displacement' in N; correct the names or the units",
    ),
}


@pytest.mark.parametrize("name", NO_PRESS)
def test_what_is_no_press_is_refused_by_what_it_is(tmp_path: Path, name: str) -> None:
    file, text, cause = NO_PRESS[name]
    path = written(tmp_path / file, text, "cp1252" if file.endswith("txt") else "utf-8")
    with pytest.raises(InputError, match=cause.replace("('Strain')", r"\('Strain'\)")) as said:
        read(path)
    assert "\n" not in str(said.value) and "--displacement" not in str(said.value)


BY_FORCE = """\
id = "bar"
title = "Made for a test"
origin = "measured"
[uniaxial]
direction = "tension"
{area}
[recordings]
table = {{ strain = "{strain}", percent = true, stress = "Force 2", unit = "N" }}
"""


@pytest.mark.parametrize("strain", ["Strain (%)", "Strain in %", "strain_percent", "strain"])
def test_a_table_of_strain_and_two_forces_gives_the_bar_s_stiffness_on_its_area(tmp_path: Path, strain: str) -> None:
    stretch = np.linspace(1.0, 1.3, 60)
    stress = 2 * 4e-3 * (stretch - stretch**-2) + np.random.default_rng(2).normal(0.0, 2e-5, 60)
    columns = np.column_stack([100 * (stretch - 1), 1.3 * 50 * stress, 50 * stress])
    text = f"{strain},Force 1 (N),Force 2 (N)\n" + "".join(f"{a:.4f},{b:.6f},{c:.6f}\n" for a, b, c in columns)
    path = written(tmp_path / "bar/recordings/a.csv", text)
    with pytest.raises(InputError, match=r"'Force 1' or 'Force 2' in N\) without a time.*percent = true"):
        read(path)
    name = read_sheets(path)[0].columns[0].name
    toml = written(tmp_path / "bar/specimen.toml", BY_FORCE.format(area="", strain=name))
    with pytest.raises(InputError, match="a force in N is one on an area; give area_mm2"):
        lf.load_specimen(tmp_path / "bar")
    written(toml, BY_FORCE.format(area="length_mm = 20.0\narea_mm2 = 50.0", strain=name))
    fit = lf.identify(lf.load_specimen(tmp_path / "bar"), "neo-hookean")["neo-hookean"]
    assert fit.estimates["deep.C10"].value == pytest.approx(4e-3, rel=0.02)


def test_frames_of_some_trials_alone_are_asked_about(tmp_path: Path) -> None:
    folder = bar(tmp_path / "bar", repeats=2)
    (folder / "face-b.csv").unlink()
    with pytest.raises(InputError, match=r"trial b has none: there is no face-b.csv; add it, or optional = true"):
        lf.load_specimen(folder)
    toml = folder / "specimen.toml"
    written(toml, toml.read_text().replace(FACE, FACE + "optional = true\n"))
    channels = {one.name: len(one.recording.channels) for one in lf.load_specimen(folder).recordings}
    assert channels == {"a": 1, "b": 0}


@pytest.mark.parametrize(
    ("depth", "read_mm", "refuses"),
    [
        ([5.0, 7.5, 10.0], [8.0, 7.8, 11.5], False),
        ([0.0, 5.0, 7.5, 9.9, 10.0], [9.0, 8.5, 8.0, 13.0, 13.5], False),
        ([0.0, 3.0, 6.0, 10.0], [8.0, 8.8, 9.8, 11.5], True),
        ([0.0, 5.0, 10.0], [8.0, 10.0, 12.0], True),
    ],
)
def test_a_layer_may_grow_in_its_last_frame_and_not_all_along(
    depth: list[float], read_mm: list[float], refuses: bool
) -> None:
    found = refused(FAT, 9.0, np.array(depth), np.array(read_mm), FAT.usual, 0.1)
    assert (found is not None) == refuses


def pressed(rate: float, speed: float, hold: float, back: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return times (s) and the way (mm) of a press by 12 mm, a hold, and perhaps the way back."""
    arrives = 12.0 / speed
    t = np.arange(0.0, arrives + hold + back * arrives, 1 / rate)
    return t, np.minimum(speed * t, np.where(t > arrives + hold, 12.0 - speed * (t - arrives - hold), 12.0))


@pytest.mark.parametrize("rate", [20.0, 100.0])
@pytest.mark.parametrize("speed", [0.5, 3.0])
@pytest.mark.parametrize(("hold", "back"), [(0.0, True), (10.0, True), (10.0, False)])
@pytest.mark.parametrize("count", [np.floor, np.round])
def test_a_counter_of_half_millimetres_is_read_between_its_steps(
    rate: float, speed: float, hold: float, back: bool, count: Callable[[np.ndarray], np.ndarray]
) -> None:
    t, way = pressed(rate, speed, hold, back)
    wobble = 0.05 * np.sin(40 * t) * (rate > 50)
    found, step = between_steps(t, 0.5 * count((way + wobble) / 0.5))
    assert step == 0.5
    # A floor is half a step off in all; a reading is better than the counter's own, but of two or three a step.
    off, counted = found - way, 0.5 * count((way + wobble) / 0.5) - way
    assert np.abs(off - np.median(off)).max() < 0.5
    assert np.std(off) < (0.9 if rate / speed > 10 else 1.1) * np.std(counted)
    force = 0.05 * way**1.5 + np.random.default_rng(1).normal(0.0, 0.01, len(t))
    trial = segment(Recording(t, found, force, "a", step=step), scales=LEG)
    assert np.mean(trial.labels == LOADING) == pytest.approx((12.0 / speed) / t[-1], abs=0.12)
    # Where it goes to and fro it seems to rest.
    assert np.mean(trial.labels == HOLD) == pytest.approx(hold / t[-1], abs=0.15)
    assert not [*magnitude_doubts(trial), *trial_doubts([trial])]


@pytest.mark.parametrize("seed", range(4))
def test_a_noisy_counter_s_loading_is_one_whole(seed: int) -> None:
    t = np.arange(0.0, 50.0, 0.1)
    way = 0.4 * t
    noise = np.random.default_rng(seed).normal(0.0, [[0.1], [0.02]], (2, len(t)))
    found, step = between_steps(t, 0.5 * np.floor((way + noise[0]) / 0.5))
    trial = segment(Recording(t, found, 0.05 * way**1.5 + noise[1], "a", step=step), scales=LEG)
    assert trial.phases[0] == LOADING and np.mean(trial.labels == LOADING) > 0.9
    assert trial.depth == pytest.approx(20.0, abs=0.75)
    assert np.std(found - way) < 0.6 * 0.5 / np.sqrt(12)


def test_what_is_no_coarse_counter_is_left_as_it_is() -> None:
    t, way = pressed(50.0, 1.0, 5.0, True)
    noisy = way + np.random.default_rng(0).normal(0.0, 0.02, len(t))
    for one in (way, noisy, np.round(way, 2), 0.0 * way, np.where(t > 3.0, 12.0, 0.0), 2.0 * (np.arange(len(t)) // 1)):
        found, step = between_steps(t, one)
        assert step == 0.0
        np.testing.assert_array_equal(found, one)


@pytest.mark.parametrize("start", [0.0, -30.0, 14.2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_press_from_any_reading_of_a_gap_or_a_crosshead_begins_at_its_start(start: float, sign: float) -> None:
    t = np.linspace(0.0, 40.0, 400)
    way = np.minimum(0.1 * t, 3.0)
    force = 0.8 * way**1.3 + np.random.default_rng(3).normal(0.0, 1e-3, len(t))
    found = segment(Recording(t, start + way, force, "a"), scales=replace(LEG, way=0.3))
    assert found.contact.displacement == pytest.approx(start, abs=0.05)
    # What is pressed from the start as far as its displacement says was zeroed at first touch.
    zeroed = segment(Recording(t, 2.0 + way, 0.8 * (2.0 + way) ** 1.3, "a"), scales=replace(LEG, way=0.3))
    assert zeroed.contact.displacement == pytest.approx(0.0, abs=0.01)


READS = {
    "a mark of bytes among the rows": HEAD + rows().replace("\n5.000,", "\n\ufeff5.000,"),
    "curly quotes": "“Time (s)”,“Displacement (mm)”,“Force (N)”\n" + rows(),
    "a total without a time": HEAD + rows() + f",,{F.sum():.3f}\n",
    "a cell of 300,000 letters above": "Note," + "x" * 300_000 + "\n" + HEAD + rows(),
    "a second trial that is empty": HEAD + rows() + "\nTrial 2\n" + HEAD,
    "times below zero": HEAD + rows(lambda t, d, f: f"{t - 5:.3f},{d:.4f},{f:.4f}"),
    "a second time that begins anew": "Time (s),Step time (s),Displacement (mm),Force (N)\n"
    + rows(lambda t, d, f: f"{t:.3f},{t % 10:.3f},{d:.4f},{f:.4f}"),
    "Arabic figures": HEAD + rows().translate(str.maketrans("0123456789", "٠١٢٣٤٥٦٧٨٩")),
    "inches by their German name": "Time (s),Displacement (Zoll),Force (N)\n"
    + rows(lambda t, d, f: f"{t:.3f},{d / 25.4:.6f},{f:.4f}"),
    "an old Mac's line ends": (HEAD + rows()).replace("\n", "\r"),
}


@pytest.mark.parametrize("name", READS)
def test_an_odd_table_is_read_as_what_it_holds(tmp_path: Path, name: str) -> None:
    found = read(written(tmp_path / "a.csv", READS[name]))
    np.testing.assert_allclose(found.displacement, D, atol=1e-3)
    np.testing.assert_allclose(found.force, F, atol=1e-4)
    np.testing.assert_allclose(found.time - found.time[0], T, atol=1e-9)


def some(cell: str, wrong: Callable[[float], bool] = lambda t: 6.0 < t < 6.3) -> str:
    return HEAD + rows(lambda t, d, f: f"{t:.3f},{d:.4f},{cell if wrong(t) else f'{f:.4f}'}")


REFUSED = {
    "overloads": (some("OVLD", lambda t: t > 9), r"column 'Force \(N\)': contains 'OVLD'; export it as numbers"),
    "cells too narrow": (some("####", lambda t: t > 9), r"column 'Force \(N\)': contains '####'"),
    "nothing but a dash": (some("-"), "line 123: '-' where 3 numbers are needed"),
    "no number": (some("NaN"), "line 123: there is no finite number"),
    "a further cell in a few rows": (
        HEAD + rows(lambda t, d, f: f"{t:.3f},{d:.4f},{f:.4f}{',OK' if 5 < t < 5.3 else ''}"),
        "line 103: 4 cells where 3 numbers are needed",
    ),
    "codes of what is missing": (some("-9999"), "readings are -9999, which stands for missing ones"),
    "a row of sums": (
        HEAD + rows() + f"{T.sum():.3f},{D.sum():.3f},{F.sum():.3f}\n",
        "rows: the last is the sum of those above it; remove it",
    ),
    "numbers that none are": (some("1e308"), "numbers cannot be readings"),
    "a clock that begins anew": (HEAD + rows(lambda t, d, f: f"{t % 8:.3f},{d:.4f},{f:.4f}"), "time runs backwards"),
    "two of one name that differ": (
        "Time (s),Displacement (mm),Force (N),Force (N)\n" + rows(lambda t, d, f: f"{t:.3f},{d:.4f},{f:.4f},{2 * f}"),
        "may be any of 'Force', 'Force', which differ",
    ),
    "a percentage": ("Time (s),Displacement (percent),Force (N)\n" + rows(), "is not a unit of displacement"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_an_odd_table_that_can_t_be_read_is_refused_by_its_cause(tmp_path: Path, name: str) -> None:
    text, cause = REFUSED[name]
    with pytest.raises(InputError, match=cause) as said:
        read(written(tmp_path / "a.csv", text))
    assert "\n" not in str(said.value)


@pytest.mark.parametrize("odd", ["merged title", "total below", "dates for numbers"])
def test_a_workbook_s_merged_cells_totals_and_dates(tmp_path: Path, odd: str) -> None:
    book = Workbook()
    page = book.active
    assert page is not None
    if odd == "merged title":
        page.append(["Trial 1", None, None])
        page.merge_cells("A1:C1")
    page.append(["Time (s)", "Displacement (mm)", "Force (N)"])
    for t, d, f in zip(T.tolist(), D.tolist(), F.tolist(), strict=True):
        page.append([t, datetime(2024, 4, 1) if odd == "dates for numbers" and 3 < t < 4 else d, f])
    if odd == "total below":
        page.append([None, None, float(F.sum())])
        page.append(["Mean", float(D.mean()), float(F.mean())])
    book.save(tmp_path / "a.xlsx")
    if odd == "dates for numbers":
        with pytest.raises(InputError, match="'2024-04-01' is a date, which a spreadsheet took a number for"):
            read(tmp_path / "a.xlsx")
    else:
        np.testing.assert_allclose(read(tmp_path / "a.xlsx").force, F)
