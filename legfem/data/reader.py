"""Reading ``recordings/*.csv``: ``time_s,displacement_mm,force_N``; and instruments' files."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from legfem.common.errors import InputError
from legfem.common.tables import read_table
from legfem.common.units import MPA_PER_KPA, MPA_PER_MMHG
from legfem.data.columns import Channels, recording_of
from legfem.data.contact import find_first_contact
from legfem.data.formats import read_sheets
from legfem.data.recording import Recording, backwards, not_increasing
from legfem.data.smoothing import sample_noise, smooth_displacement

HEADER = ("time_s", "displacement_mm", "force_N")
MINIMAL_DEPTH_MM = 5.0
MINIMAL_SAMPLES = 20
# A leg pressed by some mm answers with tenths of a newton at least.
MINIMAL_RISE_N = 0.05


def read_recording(path: Path, minimal_depth: float = MINIMAL_DEPTH_MM) -> Recording:
    """Read one trial and check that a stiffness can be identified from it.

    Parameters
    ----------
    path : Path
        CSV file with the header ``time_s,displacement_mm,force_N``; force is positive in
        compression, displacement grows towards the leg.
    minimal_depth : float
        Least depth of loading after contact, mm.

    Raises
    ------
    InputError
        If the table can't be read (see `legfem.common.tables.read_table`) or the trial can't be
        used (see `check_recording`).
    """
    recording = read_samples(path)
    check_recording(recording, minimal_depth)
    return recording


def read_samples(path: Path, channels: Channels | None = None, area: float | None = None) -> Recording:
    """Read one trial whatever it holds, only that time increases.

    Parameters
    ----------
    path : Path
        The file.
    channels : Channels, optional
        Where an instrument's file holds the quantities; legfem's own CSV without it.
    area : float, optional
        mm2; a pressure on it is read in the force's place: a column ``pressure_kPa``,
        ``pressure_mbar`` or ``pressure_mmHg`` of the CSV.

    Raises
    ------
    InputError
        As `read_recording` does for the table, or if the file lacks what ``channels`` name.
    """
    path = Path(path)
    if channels is not None:
        return recording_of(path, read_sheets(path), channels, area)
    column, factor = HEADER[2], 1.0
    if area is not None:
        column, factor = _pressure_column(path)
        factor *= area
    table = read_table(path, (*HEADER[:2], column))
    time = table["time_s"].to_numpy(dtype=np.float64)
    rows = not_increasing(time)
    if rows:
        raise InputError(
            path,
            f"time_s, line {table.index[rows[0]]}",
            f"{backwards(time, rows[0])})",
            "sort the rows by time, remove repeated ones, and keep one trial a file",
        )
    return Recording(
        time=time,
        displacement=table["displacement_mm"].to_numpy(dtype=np.float64),
        force=factor * table[column].to_numpy(dtype=np.float64),
        trial=path.stem,
        source=path,
    )


def _pressure_column(path: Path) -> tuple[str, float]:
    """Return the name of the column of pressures, and the factor to MPa."""
    factors = {"kPa": MPA_PER_KPA, "mbar": 0.1 * MPA_PER_KPA, "mmHg": MPA_PER_MMHG}
    first = path.read_bytes()[:200].split(b"\n")[0].decode("utf-8", "replace") if path.is_file() else ""
    unit = next((unit for unit in factors if f"pressure_{unit}" in first), "kPa")
    return f"pressure_{unit}", factors[unit]


def read_instrument_file(path: Path, channels: Channels, minimal_depth: float = MINIMAL_DEPTH_MM) -> Recording:
    """Read one trial from an instrument's file and check that it can be used.

    Raises
    ------
    InputError
        If the file can't be read, lacks what ``channels`` name, or the trial can't be used.
    """
    recording = read_samples(path, channels)
    check_recording(recording, minimal_depth)
    return recording


def check_recording(recording: Recording, minimal_depth: float = MINIMAL_DEPTH_MM) -> None:
    """Check that a stiffness can be identified from a trial.

    Raises
    ------
    InputError
        If the trial has fewer than 20 samples of loading or less than ``minimal_depth`` mm of
        it after contact, starts backwards, never touches, has tension for compression, or
        seems to be in other units.
    """
    source = recording.source or recording.trial
    if len(recording) < MINIMAL_SAMPLES:
        raise InputError(
            source, "rows", f"{len(recording)} samples are too few", f"record at least {MINIMAL_SAMPLES} during loading"
        )
    _check_motion(recording, source)
    _check_touch(recording, source)
    contact = find_first_contact(recording)
    smooth, _ = smooth_displacement(recording.time, recording.displacement)
    deepest = int(np.argmax(smooth))
    depth = float(smooth[deepest]) - contact.displacement
    # Smoothing and contact are known to about the reading's noise: don't refuse for that.
    if depth < minimal_depth - 0.1:
        raise InputError(
            source,
            "displacement_mm",
            f"{depth:.1f} mm of loading after contact are too short to identify from",
            f"press at least {minimal_depth:g} mm beyond first touch",
        )
    samples = int(np.count_nonzero(smooth[: deepest + 1] > contact.displacement))
    if samples < MINIMAL_SAMPLES:
        raise InputError(
            source,
            "rows",
            f"{samples} samples of loading after contact are too few",
            f"record at least {MINIMAL_SAMPLES}: sample faster or press more slowly",
        )


def _check_motion(recording: Recording, source: str | Path) -> None:
    noise = sample_noise(recording.displacement)
    smooth, _ = smooth_displacement(recording.time, recording.displacement)
    away = smooth - smooth[0]
    travel = float(np.ptp(smooth))
    if travel < 0.1:
        raise InputError(
            source,
            "displacement_mm",
            f"the cylinder moves {travel:.3g} mm in all",
            "give displacement in mm (multiply metres by 1000), or record a deeper press",
        )
    moved = max(0.5, 5.0 * noise)
    first = np.flatnonzero(np.abs(away) > moved)
    if len(first) and away[first[0]] < 0:
        raise InputError(
            source,
            "displacement_mm",
            "falls at the start",
            "let it grow towards the leg: change its sign or remove rows of moving away",
        )


def _check_touch(recording: Recording, source: str | Path) -> None:
    smooth, _ = smooth_displacement(recording.time, recording.displacement)
    low, high = float(smooth.min()), float(smooth.max())
    before = max(3, int(np.argmax(smooth - smooth[0] > 0.05 * (high - low))))
    rest = float(np.median(recording.force[:before]))
    deep = recording.force[smooth >= high - 0.05 * (high - low)]
    rise = float(np.median(deep)) - rest
    spread = sample_noise(recording.force)
    if rise < -5.0 * max(spread, 0.002):
        raise InputError(
            source,
            "force_N",
            f"falls by {-rise:.3g} N as the cylinder presses (tension)",
            "change its sign: force is positive in compression",
        )
    if rise < max(5.0 * spread, MINIMAL_RISE_N):
        hint = " or give force in N (multiply kN by 1000)" if 0 < rise < MINIMAL_RISE_N else ""
        raise InputError(
            source,
            "force_N",
            f"never touches: the force rises by {rise:.3g} N only, its noise is {spread:.2g} N",
            f"remove this trial, or record it until the cylinder presses the leg{hint}",
        )
