"""Files of further kinds of instruments: scales and sizes in headings, and what is no recording, by the right cause."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from openpyxl import Workbook

from legfem.common.errors import InputError
from legfem.data.columns import propose
from legfem.data.formats import read_sheets
from legfem.data.reader import read_samples
from legfem.data.recording import Recording, SourceColumn, SourceColumns, recording_of
from legfem.data.stress_tables import StressTableEntry, read_stress_table

T = np.arange(0.0, 2.0, 0.005)
D = 4.0 * np.minimum(T, 2.0 - T)
F = 0.08 * D**1.5
"""s, mm and N of a press and its return."""


def read(path: Path) -> Recording:
    sheets = read_sheets(path)
    return recording_of(path, sheets, propose(path, sheets).channels)


def ddf(offset: float, units: str = "Units\tmm\tmN\t\t\tmm\tmN\n") -> str:
    """Return a file of Aurora's DMC: two channels in volts, two unused ones, and two of commands."""
    head = (
        "DMCv5.3 Data File\nSample Frequency (Hz): 200\nReference Length: NaN mm\nCalibration Data:\n"
        "Channel\tAI0\tAI1\tAI2\tAI3\tAO0\tAO1\n"
        + units
        + "Scale (units/V)\t2.0\t500.0\t0.0\t0.0\t2.0\t500.0\n"
        + f"Offset (volts)\t{offset}\t0.0\t0.0\t0.0\t0.0\t0.0\nTADs\t0.0\t0.0\t0.0\t0.0\t0.0\t0.0\n"
        "Test Comments:\n\nProtocol Array:\n\n0.2\tRamp\tLength Out\t6, 0.5\t\n0.2\tStop\t\t\t\n\n\n"
        "Test Data in Volts:\n\nSample\tAI0\tAI1\tAI2\tAI3\tAO0\tAO1\tStim\n"
    )
    lines = (
        f"{k}\t{D[k] / 2 - offset:.6f}\t{F[k] / 0.5:.6f}\t-0.04\t-0.01\t{D[k] / 2 * 1.3:.6f}\t0.000000\t0\n"
        for k in range(len(T))
    )
    return head + "".join(lines)


@pytest.mark.parametrize("offset", [0.0, 0.25])
def test_volts_of_aurora_become_what_its_scales_and_offsets_say(tmp_path: Path, offset: float) -> None:
    path = tmp_path / "lever.ddf"
    path.write_text(ddf(offset))
    found = read(path)
    np.testing.assert_allclose(found.time, T, atol=1e-9)
    np.testing.assert_allclose(found.displacement, D, atol=3e-6)
    np.testing.assert_allclose(found.force, F, atol=3e-6)


def test_volts_whose_channels_have_no_units_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "lever.ddf"
    path.write_text(ddf(0.0, "Units\t\t\t\t\t\t\n"))
    with pytest.raises(InputError, match=r"lever.ddf: columns: are in volts, as the heading says"):
        read(path)


@pytest.mark.parametrize(
    ("head", "said"),
    [
        ('"Length : 25.00 mm"\n"Width","1.2","cm"\n\n', "length 25 mm, width 12 mm"),
        ("Specimen diameter (mm),12.5\nOperator,A\n", "diameter 12.5 mm"),
        ("Messlänge,20,mm\nPrüfgeschwindigkeit,5,mm\n", "length 20 mm"),
    ],
)
def test_sizes_in_a_heading_are_said(tmp_path: Path, head: str, said: str) -> None:
    path = tmp_path / "bar.csv"
    rows = "".join(f"{t:.3f},{d:.4f},{f:.5f}\n" for t, d, f in zip(T, D, F, strict=True))
    path.write_text(head + "Time (s),Extension (mm),Load (N)\n" + rows)
    reasons = propose(path, read_sheets(path)).reasons
    assert f"its heading states the specimen's {said}" in reasons


def test_sizes_beside_a_sheet_s_table_are_said(tmp_path: Path) -> None:
    book = Workbook()
    page = book.active
    assert page is not None
    for row in (["Diameter", 8.0, "mm"], ["Height (mm)", 4.5], [], ["Time (s)", "Extension (mm)", "Load (N)"]):
        page.append(row)
    for row in np.column_stack([T, D, F]).tolist():
        page.append(row)
    book.save(tmp_path / "disc.xlsx")
    reasons = propose(tmp_path / "disc.xlsx", read_sheets(tmp_path / "disc.xlsx")).reasons
    assert "its heading states the specimen's diameter 8 mm, height 4.5 mm" in reasons


def points(head: str, columns: int) -> str:
    return head + "".join(",".join(f"{0.1 * k + 0.01 * c:.3f}" for c in range(columns)) + "\n" for k in range(90))


def grid(k: int) -> str:
    return "\n".join(",".join(f"{k * (5 - abs(i - 4)):.2f}" for _ in range(6)) for i in range(9))


FIELD = r"columns: are a camera's field of points, no recording's; give \[channels.face_strain\]"
FILM = r"file: is a pressure film's frames, and no recording; give \[channels.contact_pressure\]"
SWEEP = r"columns: are an oscillation's \(G', G''\), which is none of legfem's tests; export a step"
STAGE = "index_x,index_y,x,y,z,displacement_x,displacement_y,displacement_z\n[],[],[mm],[mm],[mm],[mm],[mm],[mm]\n"
SUBSETS = "SUBSET_ID,COORDINATE_X,COORDINATE_Y,DISPLACEMENT_X,DISPLACEMENT_Y,SIGMA,GAMMA,STATUS_FLAG\n"
OTHER_KINDS = {
    "stage.csv": (points("Stage: 3\nTime: 1.5 s\n" + STAGE, 8), FIELD),
    "gom.csv": (points("#Stage: 1\n#id,x (mm),y (mm),z (mm),dx (mm),dy (mm),dz (mm),epsX,epsY\n", 9), FIELD),
    "dice.txt": (points("*** DICe\n*** Reference image: a.tif\n" + SUBSETS, 8), FIELD),
    "pixels.csv": (points("frame,x_px,y_px,u_px,v_px\n", 5), FIELD),
    "multi.csv": (points("X [mm],Y [mm],Z [mm],U [mm],V [mm],W [mm],J,Lambda1\n", 8), FIELD),
    "matrix_003.csv": (points("", 30), r"columns: has 30 columns without names, as a camera's or film's frame"),
    "mat.asf": (
        "DATA_TYPE MOVIE\nROWS 9\nCOLS 6\nSECONDS_PER_FRAME 0.1\nUNITS KPa\nASCII_DATA @@\n"
        + "".join(f"Frame {k}\n{grid(k)}\n\n" for k in range(9)),
        FILM,
    ),
    "mat.csv": ("".join(f"Frame:,{k}\nRows:,9\nUnits:,kPa\nSENSELS\n{grid(k)}\n\n" for k in range(9)), FILM),
    "mat.asc": (points("pliance expert\nsensor type: S2013\ntime per frame [secs]: 0.02\n", 20), FILM),
    "sweep.csv": (points("Frequency (Hz),Storage modulus (Pa),Loss modulus (Pa),Temperature (°C)\n", 4), SWEEP),
    "short.csv": (points("f in Hz,G' in Pa,G'' in Pa\n", 3), SWEEP),
    "bent.csv": (
        points("Time (s),Crosshead (mm),Load (N),Flexural stress (MPa)\n", 4),
        "columns: are a bending test's, which is none of legfem's; press, pull or shear the specimen",
    ),
    "rheometer.json": (
        '{"schema": "a rheometer\'s", "results": {}}',
        r"file: is JSON; .* angle and torque \(an oscillation's G' is no test\)",
    ),
}


@pytest.mark.parametrize("name", OTHER_KINDS)
def test_other_kinds_of_files_are_refused_by_what_they_are_with_what_to_give(tmp_path: Path, name: str) -> None:
    text, cause = OTHER_KINDS[name]
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=cause) as refused:
        read(tmp_path / name)
    assert "\n" not in str(refused.value)
    assert "--displacement" not in str(refused.value)


def test_a_recording_with_moduli_or_points_beside_it_is_still_read(tmp_path: Path) -> None:
    head = "Time (s),Gap (mm),Axial force (N),Storage modulus (MPa),Loss modulus (MPa),eps_x,eps_y\n"
    rows = "".join(f"{t:.3f},{9 - d:.4f},{f:.5f},0,0,{d / 9:.4f},0.1\n" for t, d, f in zip(T, D, F, strict=True))
    (tmp_path / "squeeze.csv").write_text(head + rows)
    np.testing.assert_allclose(read(tmp_path / "squeeze.csv").force, F, atol=1e-5)


def test_a_column_s_whole_heading_names_it(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    lines = "".join(f"{t:.3f},{d:.4f},{f:.5f}\n" for t, d, f in zip(T, D, F, strict=True))
    path.write_text("Time (s),Extension (mm),Load (N)\n" + lines)
    named = SourceColumns(
        SourceColumn("Time (s)", "s"), SourceColumn("Extension (mm)", "mm"), SourceColumn("Load (N)", "N")
    )
    np.testing.assert_allclose(recording_of(path, read_sheets(path), named).force, F, atol=1e-5)
    found = propose(path, read_sheets(path), {"force": "Load (N)"}).channels
    np.testing.assert_allclose(recording_of(path, read_sheets(path), found).force, F, atol=1e-5)
    with pytest.raises(InputError, match=r"there is no column 'Load \(kN\)'; give one of 'Time'"):
        recording_of(path, read_sheets(path), replace(named, force=SourceColumn("Load (kN)", "kN")))


def test_a_strain_called_x_in_percent_is_read_by_the_line_that_is_given(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("x[%],stress[kPa]\n" + "".join(f"{k},{k * k}\n" for k in range(20)))
    with pytest.raises(InputError, match=r"strain = \"x\", percent = true, stress = \"stress\", unit = \"kPa\""):
        read(path)
    for name in ("x", "x[%]"):
        entry = StressTableEntry(strain=name, stress="stress[kPa]", unit="kPa", percent=True)
        strain, stress = read_stress_table(path, entry, 1.0)
        np.testing.assert_allclose(strain, 0.01 * np.arange(20))
        np.testing.assert_allclose(stress, 1e-3 * np.arange(20.0) ** 2)


@pytest.mark.parametrize(
    "head", ["time_s,displacement_mm,force_N,lateral_N", "Time (s),Way (mm),Force (N),Lateral (N)"]
)
def test_a_force_across_called_lateral_is_its_channel(tmp_path: Path, head: str) -> None:
    path = tmp_path / "a.csv"
    lines = "".join(f"{t:.3f},{d:.4f},{f:.5f},{0.1 * f:.6f}\n" for t, d, f in zip(T, D, F, strict=True))
    path.write_text(head.replace("Way", "Travel") + "\n" + lines)
    (one,) = read_samples(path).channels
    assert one.name == "lateral_force"
    np.testing.assert_allclose(one.values, 0.1 * F, atol=1e-5)


def test_a_few_times_in_two_rows_are_averaged_and_many_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = [f"{t:.3f},{d:.4f},{f:.5f}\n" for t, d, f in zip(T, D, F, strict=True)]
    few = [*rows[:100], f"{T[99]:.3f},{D[99] + 0.02:.4f},{F[99] + 0.004:.5f}\n", rows[100], rows[100], *rows[101:]]
    path.write_text("Time (s),Extension (mm),Load (N)\n" + "".join(few))
    found = read(path)
    assert len(found) == len(T)
    assert found.displacement[99] == pytest.approx(D[99] + 0.01, abs=1e-4)
    assert found.force[99] == pytest.approx(F[99] + 0.002, abs=1e-5)
    told = propose(path, read_sheets(path)).reasons
    assert "rows with the time of the one before, averaged with it: 1" in told
    assert "rows that repeat the one before, left out: 1" in told
    coarse = "".join(f"{t:.2f},{d:.4f},{f:.5f}\n" for t, d, f in zip(T, D, F, strict=True))
    path.write_text("Time (s),Extension (mm),Load (N)\n" + coarse)
    with pytest.raises(InputError, match="time repeats"):
        read(path)
