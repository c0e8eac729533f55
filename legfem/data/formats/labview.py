"""LabVIEW's files: TDMS (by npTDMS) and LVM (by lvm_read).

Sources: National Instruments, *Specification for the LabVIEW Measurement File (.lvm)*, and the
waveform properties ``wf_increment``, ``wf_start_offset`` and ``unit_string`` of *The NI TDMS File
Format*.
"""

import logging
from pathlib import Path

import lvm_read
import numpy as np
from nptdms import TdmsChannel, TdmsFile
from nptdms.log import log_manager

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data.formats.labels import name_and_unit, one_unit
from legfem.data.formats.sheet import Column, Sheet

# Of a file that breaks off it would print; the lengths of channels tell.
log_manager.set_level(logging.ERROR)
_UNIT_PROPERTIES = ("unit_string", "NI_UnitDescription", "unit", "Unit", "units", "Units")


def read_tdms(path: Path) -> list[Sheet]:
    """Read the groups of a TDMS file; a waveform's time comes from its increment."""
    sheets = []
    # Given a path, npTDMS trusts an index beside the file, which may be another one's.
    with path.open("rb") as content:
        file = TdmsFile.read(content)
    for group in file.groups():
        channels = [c for c in group.channels() if len(c) and c.dtype.kind in "iufM"]
        columns = [_column(c.name, _unit_of(c), _numbers(c)) for c in channels]
        steps = {float(c.properties.get("wf_increment", 0.0)) for c in channels} - {0.0}
        remarks: tuple[str, ...] = ()
        if len(steps) == 1 and columns and not any(_is_time(c) for c in columns):
            step = steps.pop()
            columns.insert(0, _clock(step, len(columns[0].values)))
            remarks = (f"the time is counted in the waveforms' wf_increment of {step:g} s",)
        if columns:
            check_lengths(path, group.name, columns)
            sheets.append(Sheet(group.name, tuple(columns), remarks))
    return sheets


def _unit_of(channel: TdmsChannel) -> object:
    if channel.dtype.kind == "M":
        return "s"
    return next((channel.properties[key] for key in _UNIT_PROPERTIES if channel.properties.get(key)), None)


def _numbers(channel: TdmsChannel) -> FloatArray:
    """Return a channel's values as numbers; times of day as seconds since the first."""
    values = np.asarray(channel[:])
    if values.dtype.kind == "M":
        return (values - values[0]) / np.timedelta64(1, "s")
    return values.astype(np.float64)


def read_lvm(path: Path) -> list[Sheet]:
    """Read the segment of an LVM file.

    Raises
    ------
    InputError
        If it has several segments: they are trials, or pieces whose gaps aren't known.
    """
    found = lvm_read.read(str(path), read_from_pickle=False, dump_file=False)
    count = int(found["Segments"])
    if count != 1:
        raise InputError(path, "segments", f"there are {count} in one file", "save each trial in a file of its own")
    segment = found[0]
    values = np.asarray(segment["data"], dtype=np.float64)
    labels = [str(name).strip() for name in segment["Channel names"]]
    units = _units_of(labels, [str(unit).strip() for unit in segment.get("Y_Unit_Label") or ()])
    columns = []
    for k, label in enumerate(labels):
        if label == "X_Value":
            columns.append(Column(label, "s", values[:, k]))
        elif label != "Comment":
            columns.append(_column(label, units.get(k), values[:, k]))
    clocks = [c for c in columns if c.name == "X_Value"]
    if any(not np.array_equal(c.values, clocks[0].values) for c in clocks[1:]):
        raise InputError(path, "X_Columns", "every channel has a time of its own", "save one time for all")
    if clocks:
        same = (f"{len(clocks)} channels have a time of their own, all the same",) if len(clocks) > 1 else ()
        return [Sheet("", (clocks[0], *(c for c in columns if c.name != "X_Value")), same)]
    step = float(np.atleast_1d(segment["Delta_X"])[0])
    remark = f"the time is counted in the header's Delta_X of {step:g} s"
    return [Sheet("", (_clock(step, len(values)), *columns), (remark,))]


def _units_of(labels: list[str], given: list[str]) -> dict[int, str]:
    """Return the units of an LVM segment's columns: they stand above those, but for a file's first time.

    Of several times each has an empty unit; where none is empty units belong to the channels in turn.
    """
    channels = [k for k, label in enumerate(labels) if label not in ("X_Value", "Comment")]
    if labels.count("X_Value") > 1 and given[1:2] != [""]:
        return dict(zip(channels, given, strict=False))
    first = 1 if labels[:1] == ["X_Value"] else 0
    return {k: given[k - first] for k in channels if k - first < len(given)}


def check_lengths(path: Path, name: str, columns: list[Column]) -> None:
    """Check that columns are of one length.

    Raises
    ------
    InputError
        If they aren't: a sample of one can't be told from one of another.
    """
    lengths = {len(c.values): c.name for c in columns}
    if len(lengths) > 1:
        told = ", ".join(f"'{column}' {length}" for length, column in lengths.items())
        raise InputError(path, name or "columns", f"they differ in length: {told}", "record them together")


def _column(label: str, unit: object, values: FloatArray) -> Column:
    name, named = name_and_unit(label)
    return Column(name, one_unit(named, str(unit) if unit else None), values)


def _is_time(column: Column) -> bool:
    return "time" in column.name.lower() or column.unit == "s"


def _clock(step: float, count: int) -> Column:
    return Column("time", "s", step * np.arange(count))
