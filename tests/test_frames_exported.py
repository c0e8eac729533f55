"""Fields and films as programs export them: read as legfem's own table of what was seen, or refused by their cause."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making import write_subject
from making_exports import (
    DEEPEST,
    FRAMES,
    MIDDLE,
    PIXEL,
    PLACES,
    TIMES,
    X,
    columns,
    grid,
    matrices,
    multidic,
    ncorr,
    ncorr_hdf5,
    own,
    own_film,
    pixels,
    rows_of,
    table,
)
from pydantic import ValidationError
from test_face_strain import FACE, bar
from test_section_displacement import folder as section

import legfem as lf
from legfem.channels.kind import Face
from legfem.common.errors import InputError
from legfem.data.channel_reader import ChannelsEntry, SpecimenChannelsEntry, with_channels
from legfem.data.recording import RecordedChannel, Recording
from legfem.geometry.indenter import Site
from legfem.inverse.channel_readings import not_read
from legfem.legs.loading import load_subject
from legfem.legs.plausibility import doubts_about
from legfem.legs.subject import Subject
from legfem.report.answers import sentence_of

ALL = range(len(FRAMES))
T = np.linspace(0.0, 6.0, 61)
PULL = Recording(T, 0.1 * T, 0.5 * T, "a")

type Files = Mapping[str, str | bytes]


def read(folder: Path, files: Files, entry: str) -> RecordedChannel:
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    given = SpecimenChannelsEntry.model_validate(tomllib.loads(f"[face_strain]\n{entry}\n"))
    (recording,) = with_channels(folder / "specimen.toml", given, [PULL], [Face(5.0, 5.0)])
    return recording.channels[0]


def of_own(folder: Path, text: str) -> RecordedChannel:
    return read(folder, {"own.csv": text}, 'file = "own.csv"')


def same(found: RecordedChannel, wanted: RecordedChannel) -> None:
    np.testing.assert_allclose(found.time, wanted.time, atol=1e-9)
    np.testing.assert_array_equal(found.course, wanted.course)
    np.testing.assert_allclose(found.values, wanted.values, atol=2e-6)


MM = 'axes = ["x", "y"]\norigin = [0.0, 0.0]\nclock_s = 0.0\n'
EACH = "frame_s = 1.0\n"
PX = f'axes = ["x", "-y"]\norigin = [{MIDDLE[0]}, {MIDDLE[1]}]\nmm_each = {PIXEL}\nclock_s = 0.0\n'
GOM = ("x", "y", "displacement_x", "displacement_y")
GOM_MM = ("x [mm]", "y [mm]", "dX [mm]", "dY [mm]")
DICE = ("COORDINATE_X", "COORDINATE_Y", "DISPLACEMENT_X", "DISPLACEMENT_Y")
UNDEFORMED = ("x_undef [mm]", "y_undef [mm]", "u [mm]", "v [mm]")


def stages(names=GOM_MM, which=ALL, head="Stage: {f}\nTime: {t} s\n", went=True, **how) -> str:
    """Return GOM's stages one below the other."""
    return "\n".join(head.format(f=f, t=TIMES[f]) + table(columns(f, names, went=went), **how) for f in which)


def dice(which=ALL, head: str = "", **how) -> Files:
    """Return DICe's files, one a frame, with points that it lost as it writes them."""
    return {f"DICe_solution_{f:03d}.txt": head + table(pixels(f, DICE), **how) for f in which}


def mudic(which=ALL, names=("x_px", "y_px", "u_px", "v_px"), frame: str = "frame") -> str:
    every = [{frame: np.full(len(X), float(f)), **pixels(f, names)} for f in which]
    return table({name: np.concatenate([one[name] for one in every]) for name in every[0]})


def in_3d(f: int) -> dict[str, np.ndarray]:
    """Return a frame of which the face lies in the camera's x and z."""
    x, z, ux, uz = columns(f, "abcd").values()
    names = ("id", "x0", "y0", "z0", "dx (mm)", "dy (mm)", "dz (mm)", "epsX")
    other = np.full(len(X), 7.0)
    return dict(zip(names, (np.arange(len(X)), x, other, z, ux, 0 * other, uz, 0 * other), strict=True))


def replaced(text: str, *pairs: tuple[str, str]) -> str:
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    return text


UNITS_BELOW = "index_x,index_y,x,y,displacement_x,displacement_y\n[],[],[mm],[mm],[mm],[mm]\n"
INCH = [table(columns(f, ("x (in)", "y (in)", "u (in)", "v (in)"), 25.4)) for f in range(6)]
METRES = [table(columns(f, ("x_m", "y_m", "ux_m", "uy_m"), 1e3)) for f in range(6)]
GERMAN = ("Koordinate X [mm]", "Koordinate Y [mm]", "Verschiebung X [mm]", "Verschiebung Y [mm]")
FRENCH = ("coord. x (mm)", "coord. y (mm)", "déplacement x (mm)", "déplacement y (mm)")
DLR = "".join(f"# current_stage_index   : {f}\n" + table(columns(f, UNDEFORMED), ";") for f in range(6))
LOST = (0, 40, 77)
NCORR = f'axes = ["x", "-y"]\norigin = {(matrices()[2] * PIXEL).tolist()}\nclock_s = 0.0\n'
READ: dict[str, tuple[Files, str, str]] = {
    "stages with times, where points went": ({"a.csv": stages()}, MM, own()),
    "stages, where points were": ({"a.csv": stages(went=False)}, MM, own()),
    "stages whose names are undeformed": ({"a.csv": stages(UNDEFORMED, went=False)}, MM, own()),
    "stages with semicolons and decimal commas": ({"a.csv": stages(delimiter=";", comma=True)}, MM, own()),
    "stages with tabs and decimal commas": ({"a.txt": stages(delimiter="\t", comma=True)}, MM, own()),
    "stages between spaces": ({"a.txt": stages(delimiter="   ")}, MM, own()),
    "stages in German": ({"a.csv": stages(GERMAN, head="Stufe {f}\nZeit: {t} s\n")}, MM, own()),
    "stages in French": ({"a.csv": stages(FRENCH, head="étape {f}\nTemps: {t} s\n")}, MM, own()),
    "stages in UTF-16": ({"a.csv": stages().encode("utf-16")}, MM, own()),
    "stages in cp1252": ({"a.csv": stages(FRENCH).encode("cp1252")}, MM, own()),
    "stages with a byte order mark": ({"a.csv": stages().encode("utf-8-sig")}, MM, own()),
    "stages of Windows' lines": ({"a.csv": stages().replace("\n", "\r\n")}, MM, own()),
    "stages in minutes": (
        {"a.csv": "".join(stages(which=[f], head=f"Stage: {f}\nTime: {f / 60:.9f} min\n") for f in range(6))},
        MM,
        own(),
    ),
    "stages by number": ({"a.csv": stages(head="#Stage: {f}\n")}, MM + EACH, own()),
    "stages that lack": ({"a.csv": stages(which=[0, 2, 3, 5], head="Stage {f}\n")}, MM + EACH, own([0, 2, 3, 5])),
    "stages below one header": (
        {
            "a.csv": table(columns(0, GOM)).split("\n")[0]
            + "\n"
            + "".join(f"Stage {f}\n" + table(columns(f, GOM)).split("\n", 1)[1] for f in range(6))
        },
        MM.replace("clock_s", "mm_each = 1.0\nclock_s") + EACH,
        own(),
    ),
    "stages without numbers": ({"a.csv": stages(head="")}, MM + EACH, own()),
    "stages with points lost": ({"a.csv": stages(lost=LOST)}, MM, own(lost=LOST)),
    "stages with empty cells where points were lost": (
        {"a.csv": stages(lost=LOST, delimiter=";").replace("NaN", "")},
        MM,
        own(lost=LOST),
    ),
    "stages with 0 where points were lost": (
        {"a.csv": stages(went=False, lost=LOST).replace("NaN", "0.000")},
        MM,
        own(lost=LOST),
    ),
    "a stage without points": ({"a.csv": stages() + "Stage: 6\nTime: 6 s\n" + ",".join(GOM) + "\n"}, MM, own()),
    "a stage with points lost altogether": (
        {"a.csv": stages() + stages(which=[5], head="Stage 6\nTime: 5.5 s\n", lost=range(len(X)))},
        MM,
        own(),
    ),
    "units below the names": (
        {
            f"s_{f:03d}.csv": UNITS_BELOW
            + "".join(f"{k},0,{row}\n" for k, row in enumerate(table(columns(f, GOM, went=True)).split("\n")[1:-1]))
            for f in range(6)
        },
        MM + EACH,
        own(),
    ),
    "inches": ({f"s_{f:03d}.csv": INCH[f] for f in range(6)}, MM + EACH, own()),
    "metres": ({f"s_{f:03d}.csv": METRES[f] for f in range(6)}, MM + EACH, own()),
    "stages with units of time before it": ({"a.csv": stages(head="Stage {f}\nTime [s]: {t}\n")}, MM, own()),
    "stages of how many": ({"a.csv": stages(head="Stage {f} of 6\n")}, MM + EACH, own()),
    "names behind axes": (
        {"a.csv": stages(("X coordinate [mm]", "Y coordinate [mm]", "x displacement [mm]", "y displacement [mm]"))},
        MM,
        own(),
    ),
    "an origin elsewhere": (
        {
            "a.csv": "".join(
                f"Stage {f}\n"
                + table({n: c + (40.0 if n == "x0" else 0) for n, c in columns(f, ("x0", "y0", "u", "v")).items()})
                for f in range(6)
            )
        },
        MM.replace("[0.0, 0.0]", "[40.0, 0.0]").replace("clock_s", "mm_each = 1.0\nclock_s") + EACH,
        own(),
    ),
    "a face in x and z": (
        {f"s_{f:03d}.csv": table(in_3d(f)) for f in range(6)},
        MM.replace('"y"', '"z"').replace("clock_s", "mm_each = 1.0\nclock_s") + EACH,
        own(),
    ),
    "x and y exchanged": (
        {
            "a.csv": "".join(
                f"Stage {f}\n" + table(columns(f, ("y undeformed (mm)", "x undeformed (mm)", "v (mm)", "u (mm)")))
                for f in range(6)
            )
        },
        MM.replace('["x", "y"]', '["y", "x"]') + EACH,
        own(),
    ),
    "DLR's exporter": ({"a.txt": DLR}, MM + EACH, own()),
    "a time that is late": (
        {"a.csv": "".join(stages(which=[f], head=f"Time: {f + 10.0} s\n") for f in range(6))},
        MM.replace("clock_s = 0.0", "clock_s = -10.0"),
        own(),
    ),
    "DICe": (dice(), PX + EACH, own()),
    "DICe with stars above": (dice(head="*** DICe\n*** Reference image: a.tif\n"), PX + EACH, own()),
    "DICe without a frame": (dice([0, 1, 4, 5]), PX + EACH, own([0, 1, 4, 5])),
    "DICe with points that it lost": (
        {
            name: "\n".join(
                line + (",SIGMA" if k == 0 else ",-1.0" if k - 1 in LOST else ",0.01")
                for k, line in enumerate(text.strip().split("\n"))
            )
            for name, text in dice().items()
        },
        PX + EACH,
        own(lost=LOST),
    ),
    "muDIC": ({"a.csv": mudic()}, PX + EACH, own()),
    "muDIC with other words": (
        {"a.csv": mudic(names=("x (pixel)", "y (pixel)", "u (pixel)", "v (pixel)"), frame="Image no")},
        PX + EACH,
        own(),
    ),
    "muDIC with times": ({"a.csv": mudic(frame="t (s)")}, PX, own()),
    "muDIC with frames out of order": ({"a.csv": mudic([3, 0, 5, 1, 4, 2])}, PX + EACH, own()),
    "Ncorr in mm": ({"a.mat": ncorr()}, NCORR + EACH, own(range(1, 6))),
    "Ncorr of version 7.3": ({"a.mat": ncorr_hdf5()}, NCORR + EACH, own(range(1, 6))),
    "Ncorr in pixels": (
        {"a.mat": ncorr("pixels", 1.0)},
        NCORR.replace(str((matrices()[2] * PIXEL).tolist()), str(matrices()[2].tolist()))
        + f"mm_each = {PIXEL}\n"
        + EACH,
        own(range(1, 6)),
    ),
    "MultiDIC": ({"a.mat": multidic()}, MM + "mm_each = 1.0\n" + EACH, own()),
}
REFUSED: dict[str, tuple[Files, str, str]] = {
    "nothing said": (
        {"a.csv": stages(head="Stage {f}\n")},
        "",
        r"give with it: frame_s = seconds .*clock_s = .*axes = .*"
        r"origin = where .*middle: x 0.00, y -0.10",
    ),
    "pixels without a scale": (
        dice(),
        PX.replace(f"mm_each = {PIXEL}\n", "") + EACH,
        "give with it: mm_each = mm a pixel",
    ),
    "a scale of what is in mm": ({"a.csv": stages()}, MM + "mm_each = 0.05\n", "mm_each: the file says that itself"),
    "a clock of what has times": ({"a.csv": stages()}, MM + EACH, "frame_s: the file says that itself"),
    "decimal commas between commas": (
        {"a.csv": stages(comma=True)},
        MM,
        "time 0, line 2: 4 names are above 8 cells: commas separate both",
    ),
    "points and commas": (
        {"a.csv": replaced(stages(which=[0, 1], delimiter=";"), ("\n-2.400000000;-0.", "\n-2,400000000;-0,"))},
        MM,
        "a.csv: ",
    ),
    "thousands": (
        {"a.csv": replaced(stages(delimiter=";", comma=True), ("-3,200000000;", "1.003,2;"))},
        MM,
        "thousands' separator",
    ),
    "a row cut short": (
        {"a.csv": replaced(stages(went=False), ("\n-2.400000000,-0.100000000,", "\n-2.4\n"))},
        MM,
        "number 0, time 0, line 57: ",
    ),
    "a word in a row": (
        {"a.csv": replaced(stages(went=False), ("\n-2.400000000,-0.1", "\nerr,-0.1"))},
        MM,
        "number 0, time 0, line 57: ",
    ),
    "frames that aren't told apart": ({"a.csv": replaced(mudic(), ("frame,", "q,"))}, PX, "stand several times"),
    "a frame twice": ({"a.csv": stages(which=[0, 1, 1, 2], head="Stage {f}\n")}, MM + EACH, "two frames have 1"),
    "two trials' files": (
        dice() | {"DICe_solution_b_001.txt": dice()["DICe_solution_001.txt"]},
        PX + EACH,
        "two frames have 1",
    ),
    "some frames with times": (
        {"a.csv": stages(which=[0, 1]) + stages(which=[2], head="Stage 2\n")},
        MM,
        "2 of 3 frames",
    ),
    "one frame of unknown state": (
        {"a.csv": stages(which=[3])},
        MM,
        "where points were before the test, or where they went",
    ),
    "other points in each frame": (
        {
            "a.csv": "".join(
                f"Time: {f} s\n" + table({n: c * (1 + 0.2 * f) + 0.3 * f for n, c in columns(f, GOM_MM).items()})
                for f in range(3)
            )
        },
        MM,
        "don't show whether",
    ),
    "a strain alone": ({"a.csv": stages(("x", "y", "exx", "eyy"))}, MM, "no table names x and y"),
    "one way alone": ({"a.csv": stages(("x", "y", "u", "exx"))}, MM, "no table names x and y"),
    "a matrix without names": (
        {"a.csv": "\n".join(",".join("0.1" for _ in range(30)) for _ in range(30))},
        MM,
        "no table names x and y",
    ),
    "two that may be one": ({"a.csv": "x,y,u,v,ux\n" + "0,0,1,1,1\n" * 9}, MM, "'u' and 'ux' may be the same"),
    "an unknown unit": ({"a.csv": stages(("x (mm)", "y (mm)", "u (%)", "v (%)"))}, MM, "'%' is not a unit of length"),
    "a time without a unit": ({"a.csv": mudic(frame="time")}, PX, "the column has no unit of time"),
    "three axes": ({"a.csv": stages()}, MM.replace('"y"]', '"y", "z"]'), "aren't two each of the file's"),
    "an axis that isn't there": ({"a.csv": stages()}, MM.replace('"y"]', '"z"]'), "aren't two each of the file's"),
    "an unknown axis": ({"a.csv": stages()}, MM.replace('"y"]', '"q"]'), "q"),
    "an origin in a corner": (
        dice(),
        PX.replace(f"{MIDDLE[0]}, {MIDDLE[1]}", "0.0, 0.0") + EACH,
        "outside the specimen's face",
    ),
    "own table with a camera's keys": ({"a.csv": own()}, "mm_each = 0.1\n", "mm_each: the file says that itself"),
    "Ncorr whose displacements weren't formatted": (
        {"a.mat": ncorr().replace(b"plot_u_ref_f", b"plot_u_dic_f")},
        NCORR + EACH,
        "can't be read as Ncorr's or MultiDIC's .*; format displacements",
    ),
    "half of a file": ({"a.mat": ncorr()[:900]}, NCORR + EACH, "can't be read as Ncorr's or MultiDIC's"),
    "a scale of Ncorr's mm": ({"a.mat": ncorr()}, PX + EACH, "mm_each: the file says that itself"),
    "no point that was followed": (
        {
            name: "\n".join(line + (",SIGMA" if k == 0 else ",-1.0") for k, line in enumerate(text.strip().split("\n")))
            for name, text in dice().items()
        },
        PX + EACH,
        "no table names x and y",
    ),
    "no file": ({"b.csv": "x"}, MM, "a.csv: file: not found"),
}


def named(files: Files) -> str:
    first = sorted(files)[0]
    return f'file = "{first if len(files) == 1 else first[:-7] + "*" + first[-4:]}"\n'


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", READ)
def test_an_export_is_read_as_the_frames_that_were_seen(tmp_path: Path, name: str) -> None:
    files, entry, wanted = READ[name]
    same(read(tmp_path, files, named(files) + entry), of_own(tmp_path, wanted))


@pytest.mark.parametrize("name", REFUSED)
def test_an_export_that_can_t_be_read_for_certain_is_refused_in_a_line(tmp_path: Path, name: str) -> None:
    files, entry, cause = REFUSED[name]
    with pytest.raises((InputError, ValidationError), match=cause) as refused:
        read(tmp_path, files, (named(files) if name != "no file" else 'file = "a.csv"\n') + entry)
    print(refused.value)


TEKSCAN = """\
DATA_TYPE MOVIE
VERSION I-Scan 7.6
ROWS 5
COLS 11
ROW_SPACING 2 mm
COL_SPACING 2 mm
SECONDS_PER_FRAME 1
START_FRAME 0
END_FRAME 5
UNITS KPa
ASCII_DATA @@

"""
XSENSOR = "Frame:{d}{f}\nRows:{d}5\nColumns:{d}11\nUnits:{d}kPa\nSENSELS\n"


def tekscan(which: Iterable[int] = ALL, head: str = TEKSCAN, scale: float = 1.0, **how) -> str:
    return head + "\n".join(f"Frame {f}\n{rows_of(grid(f) * scale, **how)}" for f in which)


def xsensor(head: str = XSENSOR, delimiter: str = ",", comma: bool = False) -> str:
    return "\n".join(head.format(d=delimiter, f=f) + rows_of(grid(f), delimiter, comma) for f in ALL)


def novel(head: str = "pliance expert\nsensor type: S2013\n[kPa]\n", numbers: int = 55) -> str:
    names = "\t".join(["time[secs]", *(str(k + 1) for k in range(numbers))])
    rows = ["\t".join([f"{TIMES[f]:.2f}", *(f"{one:.5f}" for one in grid(f).ravel())]) for f in ALL]
    return head + "\n".join([names, *rows]) + "\n"


FILM = f'axes = ["columns"]\norigin = [{DEEPEST}]\nclock_s = 0.0\n'
FILMS: dict[str, tuple[Files, str, dict]] = {
    "Tekscan": ({"a.asf": tekscan()}, FILM, {}),
    "Tekscan in CSV": ({"a.csv": tekscan(delimiter=",").replace("\n", ",\n")}, FILM, {}),
    "Tekscan with semicolons and decimal commas": ({"a.asf": tekscan(delimiter=";", comma=True)}, FILM, {}),
    "Tekscan in psi": ({"a.asf": tekscan(head=TEKSCAN.replace("KPa", "PSI"), scale=1 / 6.894757293168)}, FILM, {}),
    "Tekscan in mmHg": ({"a.asf": tekscan(head=TEKSCAN.replace("KPa", "mmHg"), scale=1 / 0.133322387415)}, FILM, {}),
    "Tekscan without frames": ({"a.asf": tekscan([0, 1, 4])}, FILM, {"frames": [0, 1, 4]}),
    "Tekscan with no sensels at its corners": ({"a.asf": tekscan().replace("\n0.0,0.0,", "\nB,B,", 1)}, FILM, {}),
    "Tekscan turned by a quarter": (
        {
            "a.asf": TEKSCAN.replace("ROWS 5", "ROWS 11").replace("COLS 11", "COLS 5")
            + "\n".join(f"Frame {f}\n{rows_of(grid(f).T)}" for f in ALL)
        },
        FILM.replace("columns", "rows"),
        {},
    ),
    "Tekscan laid the other way": ({"a.asf": tekscan()}, FILM.replace("columns", "-columns"), {"sign": -1.0}),
    "Tekscan wider than the cylinder is long": (
        {
            "a.asf": TEKSCAN.replace("ROWS 5", "ROWS 205")
            + "\n".join(
                f"Frame {f}\n{rows_of(np.vstack([np.zeros((100, 11)), grid(f), np.zeros((100, 11))]))}" for f in ALL
            )
        },
        FILM + "lines = [101, 105]\n",
        {},
    ),
    "XSENSOR": ({"a.csv": xsensor()}, FILM + EACH + "mm_each = 2.0\n", {}),
    "XSENSOR in UTF-16": ({"a.csv": xsensor().encode("utf-16")}, FILM + EACH + "mm_each = 2.0\n", {}),
    "XSENSOR with semicolons": ({"a.csv": xsensor(delimiter=";", comma=True)}, FILM + EACH + "mm_each = 2.0\n", {}),
    "XSENSOR with a peak in another unit": (
        {"a.csv": xsensor(XSENSOR.replace("Rows", "Peak [mmHg]{d}9\nRows"))},
        FILM + EACH + "mm_each = 2.0\n",
        {},
    ),
    "XSENSOR with quotes": ({"a.csv": xsensor().replace("Frame:,", '"Frame:",')}, FILM + EACH + "mm_each = 2.0\n", {}),
    "a frame a file": (
        {f"film_{f:03d}.csv": rows_of(grid(f)) for f in ALL},
        FILM + EACH + 'mm_each = 2.0\nunit = "kPa"\n',
        {},
    ),
    "novel": ({"a.asc": novel()}, FILM + "mm_each = 2.0\ngrid = [5, 11]\n", {}),
    "novel without a unit": ({"a.asc": novel("pliance\n")}, FILM + 'mm_each = 2.0\ngrid = [5, 11]\nunit = "kPa"\n', {}),
    "novel with decimal commas": ({"a.asc": novel().replace(".", ",")}, FILM + "mm_each = 2.0\ngrid = [5, 11]\n", {}),
}
FILMS_REFUSED: dict[str, tuple[Files, str, str]] = {
    "nothing said": ({"a.csv": xsensor()}, "", r"give with it: frame_s = .*clock_s = .*axes = .*origin = .*mm_each = "),
    "no unit": ({"a.asf": tekscan(head=TEKSCAN.replace("UNITS KPa\n", ""))}, FILM, "give with it: unit"),
    "one line": ({"a.asf": tekscan()}, FILM + "lines = [3]\n", "lines.*wrong length|at least 2 items"),
    "milliseconds": (
        {"a.asf": tekscan(head=TEKSCAN.replace("SECONDS_PER_FRAME 1", "MILLISECONDS_PER_FRAME 1000"))},
        FILM,
        "give with it: frame_s",
    ),
    "raw counts": ({"a.asf": tekscan(head=TEKSCAN.replace("KPa", "Raw"))}, FILM, "unit: 'Raw' is none of pressure"),
    "another unit": ({"a.asf": tekscan()}, FILM + 'unit = "mmHg"\n', "unit: the file says that itself"),
    "decimal commas between commas": (
        {"a.asf": tekscan(comma=True)},
        FILM,
        "rows: have .* decimal commas between commas",
    ),
    "decimal commas between commas that nothing tells": (
        {"a.csv": xsensor(comma=True).replace("Columns:,11\n", "")},
        FILM + EACH + "mm_each = 2.0\n",
        "decimal commas",
    ),
    "a row too few": ({"a.asf": tekscan() + "Frame 6\n" + rows_of(grid(5)[:4])}, FILM, "7 frames, of 2 shapes"),
    "a row cut short": ({"a.asf": tekscan()[:-9]}, FILM, "rows: have .* decimal commas between commas"),
    "an origin in a corner": ({"a.asf": tekscan()}, FILM.replace("6.5", "-40.0"), "beyond 90 degrees"),
    "a film that is longer": (
        {
            "a.asf": TEKSCAN.replace("ROWS 5", "ROWS 205")
            + "\n".join(
                f"Frame {f}\n{rows_of(np.vstack([np.zeros((100, 11)), grid(f), np.zeros((100, 11))]))}" for f in ALL
            )
        },
        FILM,
        "don't lie on a cylinder of",
    ),
    "a grid of another size": ({"a.asc": novel()}, FILM + "mm_each = 2.0\ngrid = [4, 11]\n", "isn't that of its 55"),
    "no grid": ({"a.asc": novel()}, FILM + "mm_each = 2.0\n", r"grid = \[rows, columns\] of its 55 sensels"),
    "totals alone": (
        {"a.fgt": "time[secs]\tforce[N]\tarea[cm2]\n" + "0.1\t3.0\t2.0\n" * 9},
        FILM,
        "1 frames, of 1 shapes",
    ),
    "a camera's axes": ({"a.asf": tekscan()}, FILM.replace("columns", "x"), "aren't a film's one"),
    "a frame twice": ({"a.asf": tekscan([0, 1, 1])}, FILM, "two frames have 1"),
}


def test_small_displacements_that_are_rounded_to_nothing_are_no_lost_points(tmp_path: Path) -> None:
    small = [np.round(0.02 * frame, 3) for frame in FRAMES]
    rows = [
        f"{t:g},{x},{y},{u},{v}"
        for t, one in zip(TIMES, small, strict=True)
        for (x, y), (u, v) in zip(PLACES, one, strict=True)
    ]
    text = "".join(
        f"Time: {t} s\n" + table(dict(zip(UNDEFORMED, np.hstack([PLACES, one]).T, strict=True)))
        for t, one in zip(TIMES, small, strict=True)
    )
    assert any((0 < (one == 0).all(axis=1).sum() < len(one)) for one in small)
    wanted = of_own(tmp_path, "\n".join(["time_s,x_mm,y_mm,ux_mm,uy_mm", *rows]))
    same(read(tmp_path, {"a.csv": text}, 'file = "a.csv"\n' + MM), wanted)


def test_a_channel_of_one_reading_has_no_place_for_a_camera_s_keys(tmp_path: Path, leg: Subject) -> None:
    given = ChannelsEntry.model_validate({"lateral_force": {"frame_s": 1.0}})
    with pytest.raises(InputError, match="frame_s: the file says that itself, or has no place for it; leave it out"):
        with_channels(tmp_path / "subject.toml", given, [PULL])


def test_stages_of_a_bar_are_what_its_face_says(tmp_path: Path) -> None:
    folder = bar(tmp_path / "bar")
    (wanted,) = lf.load_specimen(folder).recordings[0].recording.channels
    rows = np.loadtxt(folder / "face-a.csv", delimiter=",", skiprows=1)
    text = "\n".join(
        f"Stage: {f}\nTime: {time + 3} s\n"
        + table(dict(zip(GOM_MM, (rows[rows[:, 0] == time, 1:] + [20.0, 7.0, 0.0, 0.0]).T, strict=True)))
        for f, time in enumerate(np.unique(rows[:, 0]))
    )
    (folder / "face-a.csv").write_text(text)
    toml = folder / "specimen.toml"
    said = 'axes = ["x", "y"]\norigin = [20.0, 7.0]\nclock_s = -3.0\n'
    toml.write_text(toml.read_text().replace(FACE, FACE + said))
    (found,) = lf.load_specimen(folder).recordings[0].recording.channels
    np.testing.assert_allclose(found.values, wanted.values, atol=1e-6)
    toml.write_text(toml.read_text().replace("7.0]", "17.0]"))
    with pytest.raises(InputError, match="outside the specimen's face"):
        lf.load_specimen(folder)


def test_images_of_a_leg_s_section_in_pixels_are_its_displacements(tmp_path: Path) -> None:
    leg = load_subject(section(tmp_path / "leg"))
    (wanted,) = leg.recordings[0].channels
    rows = np.loadtxt(tmp_path / "leg/moved-trial1.csv", delimiter=",", skiprows=1)
    for f, time in enumerate(np.unique(rows[:, 0])):
        own = rows[rows[:, 0] == time, 1:] * [10.0, -10.0, 10.0, -10.0] + [300.0, 500.0, 0.0, 0.0]
        name = f"leg/recordings/DICe_trial1_{f:02d}.txt"
        (tmp_path / name).write_text(table(dict(zip(DICE, own.T, strict=True))))
    said = 'file = "DICe_{trial}_*.txt"\naxes = ["x", "-y"]\norigin = [300.0, 500.0]\nmm_each = 0.1\n'
    text = (tmp_path / "leg/subject.toml").read_text().replace('file = "moved-{trial}.csv"\n', said)
    (tmp_path / "leg/subject.toml").write_text(text + "frame_s = 5.0\nclock_s = 0.0\n")
    again = load_subject(tmp_path / "leg")
    np.testing.assert_allclose(again.recordings[0].channels[0].values, wanted.values, atol=1e-6)
    assert not [doubt for doubt in doubts_about(again) if "DICe" in str(doubt)]


@pytest.fixture(scope="module")
def leg(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    return load_subject(write_subject(tmp_path_factory.mktemp("leg")))


def film(folder: Path, leg: Subject, files: Files, entry: str) -> RecordedChannel:
    for name, content in files.items():
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    given = ChannelsEntry.model_validate(tomllib.loads(f"[contact_pressure]\n{entry}\nthreshold_kPa = 0.0\n"))
    (recording,) = with_channels(folder / "subject.toml", given, [PULL], Site(leg.section, leg.indenter))
    return recording.channels[0]


@pytest.mark.parametrize("name", FILMS)
def test_a_film_is_read_as_the_pressures_that_were_there(tmp_path: Path, leg: Subject, name: str) -> None:
    files, entry, how = FILMS[name]
    found = film(tmp_path, leg, files, named(files) + entry)
    text = own_film(leg.indenter.radius, **how)
    wanted = film(tmp_path, leg, {"own.csv": text}, 'file = "own.csv"')
    np.testing.assert_allclose(found.time, wanted.time)
    np.testing.assert_allclose(np.array(found.places), np.array(wanted.places), atol=1e-4)
    np.testing.assert_allclose(found.values, wanted.values, atol=2e-4)


def test_a_film_s_sensels_at_their_limit_are_left_out(tmp_path: Path, leg: Subject) -> None:
    limit = 8.0
    rows = "\n".join(f"Frame {f}\n{rows_of(np.minimum(grid(f), limit))}" for f in ALL)
    found = film(tmp_path, leg, {"a.asf": TEKSCAN + rows}, 'file = "a.asf"\n' + FILM)
    whole = film(tmp_path, leg, {"b.asf": tekscan()}, 'file = "b.asf"\n' + FILM)
    told = np.array([(grid(f) < limit).all(axis=0) for f in ALL]).ravel()
    assert 0.3 < told.mean() < 0.9
    np.testing.assert_allclose(found.values, whole.values[told])
    np.testing.assert_allclose(found.place, whole.place[told])
    assert found.left_out["limit"] == (~told).sum()


def test_a_page_says_how_many_of_a_film_s_readings_are_left_out_and_why_and_which_trials_have_none(
    tmp_path: Path, leg: Subject
) -> None:
    seen = [rows_of(np.minimum(grid(f), 8.0)) for f in ALL]
    dead = ["\n".join(",".join(["B", *line.split(",")[1:]]) for line in rows.splitlines()) for rows in seen]
    rows = "\n".join(f"Frame {f}\n{one}\n" for f, one in enumerate(dead))
    (tmp_path / "a.asf").write_text(TEKSCAN + rows)
    entry = f'[contact_pressure]\nfile = "{{trial}}.asf"\n{FILM}\nthreshold_kPa = 2.0\noptional = true\n'
    pulls = [replace(PULL, trial=name) for name in ("a", "b")]
    site = Site(leg.section, leg.indenter)
    read = with_channels(tmp_path / "subject.toml", ChannelsEntry.model_validate(tomllib.loads(entry)), pulls, site)
    pressures = np.array([grid(f)[:, 1:] for f in ALL])
    limited = (pressures >= 8.0).any(axis=1)
    faint = ~limited & (pressures.mean(axis=1) < 2.0)
    assert limited.any() and faint.any()
    without, left = map(sentence_of, not_read(read))
    assert without.startswith("1 of 2 trials have no contact pressure (b): their force alone is used.")
    counts = limited.sum(), len(ALL), faint.sum()
    assert (
        f"{sum(counts)} of {len(ALL) * (pressures.shape[2] + 1)} readings of the contact pressure are left out" in left
    )
    for count, why in zip(counts, ("with a sensel at the film's limit", "without a number", "below what"), strict=True):
        assert f" {count} {why}" in left
    assert not list(not_read([PULL, PULL])), "nothing was recorded, and nothing is said"


@pytest.mark.parametrize("name", FILMS_REFUSED)
def test_a_film_that_can_t_be_read_for_certain_is_refused_in_a_line(tmp_path: Path, leg: Subject, name: str) -> None:
    files, entry, cause = FILMS_REFUSED[name]
    with pytest.raises((InputError, ValidationError), match=cause) as refused:
        film(tmp_path, leg, files, named(files) + entry)
    print(refused.value)
