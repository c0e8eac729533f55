"""Arrays with names: MATLAB's .mat (by pymatreader), HDF5 (by h5py), LabVIEW's TDMS (by npTDMS) and LVM (by lvm_read).

Sources: National Instruments, *Specification for the LabVIEW Measurement File (.lvm)*, and the
waveform properties ``wf_increment``, ``wf_start_offset`` and ``unit_string`` of *The NI TDMS File
Format*.
"""

import logging
import math
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import lvm_read
import numpy as np
from nptdms import TdmsFile
from nptdms.log import log_manager
from pymatreader import read_mat
from scipy.io import whosmat

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.data.formats.labels import name_and_unit, one_unit
from legfem.data.formats.sheet import FEWEST_ROWS, NAMELESS, Column, Sheet, check_size

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
        columns = []
        for c in channels:
            unit = next((c.properties[key] for key in _UNIT_PROPERTIES if c.properties.get(key)), None)
            values = np.asarray(c[:])
            if values.dtype.kind == "M":  # times of day
                unit, values = "s", (values - values[0]) / np.timedelta64(1, "s")
            columns.append(_column(c.name, unit, values.astype(np.float64)))
        steps = {float(c.properties.get("wf_increment", 0.0)) for c in channels} - {0.0}
        remarks: tuple[str, ...] = ()
        if len(steps) == 1 and columns and not any("time" in c.name.lower() or c.unit == "s" for c in columns):
            step = steps.pop()
            columns.insert(0, _clock(step, len(columns[0].values)))
            remarks = (f"the time is counted in the waveforms' wf_increment of {step:g} s",)
        if columns:
            check_lengths(path, group.name, columns)
            sheets.append(Sheet(group.name, tuple(columns), remarks))
    return sheets


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


def _clock(step: float, count: int) -> Column:
    return Column("time", "s", step * np.arange(count))


_NAMES = ("columns", "colheaders", "headers", "labels", "names")
"""What the names of a matrix' columns are called; ``importdata`` of MATLAB says colheaders."""
_UNITS = ("unit", "units", "unit_string", "ni_unitdescription", "y_unit")
_VALUES = ("data", "value", "values", "signal")
"""What a structure of one channel calls its readings, beside its unit and perhaps its name."""

type Arrays = dict[str, tuple[Any, Any]]
"""Values and unit by name."""


def read_matlab(path: Path) -> list[Sheet]:
    """Read vectors, and the fields of structures, of a .mat file; a structure is a sheet.

    A matrix is one with its columns' names beside it, as ``colheaders`` for example. The unit of
    ``force`` may stand in its name (``force_N``), in ``force_unit`` or in
    ``units.force``.
    """
    return _sheets_of(path, "", content_of_matlab(path))


def content_of_matlab(path: Path, names: list[str] | None = None) -> dict[str, Any]:
    """Return the variables of a .mat file, or those of some names that it has; raises InputError of a large one."""
    if not h5py.is_hdf5(path):
        check_size(path, sum(8 * math.prod(shape) for _, shape, _ in whosmat(path)))
    else:
        with h5py.File(path) as file:
            _check_datasets(path, file)
    with warnings.catch_warnings():
        # Of objects of MATLAB's classes, which aren't read.
        warnings.simplefilter("ignore", UserWarning)
        found: dict[str, Any] = read_mat(str(path), variable_names=names)
    return found


def read_hdf5(path: Path) -> list[Sheet]:
    """Read the datasets of an HDF5 file; a group, and a table of named fields, is a sheet.

    A matrix needs its columns' names in an attribute, as ``columns`` for example. The unit stands
    in a dataset's attribute ``unit`` or ``units``, or in its name. Numbers packed as integers are
    multiplied by ``scale_factor`` and added to ``add_offset``; source: *NetCDF Climate and Forecast
    (CF) Metadata Conventions 1.11*, section 8.1.
    """
    sheets = []
    with h5py.File(path) as file:
        _check_datasets(path, file)
        groups: list[Any] = [file]
        file.visititems(lambda _, item: groups.append(item) if isinstance(item, h5py.Group) else None)
        for group in groups:
            arrays: Arrays = {}
            for name, item in group.items():
                if not isinstance(item, h5py.Dataset):
                    continue
                names, unit = _said(item.attrs, _NAMES), _said(item.attrs, _UNITS)
                if item.dtype.names:
                    table = {field: (item[field], None) for field in item.dtype.names}
                    sheets += _sheet(path, item.name.strip("/"), table)
                elif item.ndim == 2 and names is not None:
                    matrix = _of_matrix(item[()], names)
                    units = np.ravel(unit) if np.size(unit) == len(matrix) else [None] * len(matrix)
                    columns = {n: (v, one) for (n, v), one in zip(matrix.items(), units, strict=True)}
                    sheets += _sheet(path, item.name.strip("/"), columns)
                else:
                    arrays[name] = (_unpacked(item), unit)
            sheets += _of_pandas(path, group) or _sheet(path, group.name.strip("/"), arrays)
    return sheets


def _said(fields: Mapping[str, Any], keys: tuple[str, ...]) -> Any:
    """Return what stands under one of the keys, whatever its capitals."""
    return next((value for name, value in fields.items() if name.lower() in keys), None)


def _of_pandas(path: Path, group: Any) -> list[Sheet]:
    """Read a data frame that pandas stored: blocks of columns, each with their names."""
    blocks = [name.removesuffix("_items") for name in group if name.startswith("block") and name.endswith("_items")]
    if not all(f"{name}_values" in group for name in blocks):
        return []
    found = [_of_matrix(group[f"{name}_values"][()], group[f"{name}_items"][()]) for name in blocks]
    columns = {name: (values, None) for one in found for name, values in one.items()}
    return _sheet(path, group.name.strip("/"), columns) if columns else []


def _unpacked(item: h5py.Dataset) -> Any:
    factor, offset = item.attrs.get("scale_factor", 1.0), item.attrs.get("add_offset", 0.0)
    packed = np.issubdtype(item.dtype, np.number) and (factor != 1.0 or offset != 0.0)
    return item[()] * float(factor) + float(offset) if packed else item[()]


def _check_datasets(path: Path, file: h5py.File) -> None:
    sizes: list[int] = []
    file.visititems(lambda _, item: sizes.append(item.nbytes) if isinstance(item, h5py.Dataset) else None)
    check_size(path, sum(sizes))


def _sheets_of(path: Path, name: str, content: Mapping[str, Any]) -> list[Sheet]:
    units = content.get("units")
    named = units if isinstance(units, Mapping) else {}
    content = {key: value for name, field in content.items() for key, value in _channels(name, field).items()}
    arrays: Arrays = {
        key: (value, named.get(key, content.get(f"{key}_unit")))
        for key, value in content.items()
        if not key.startswith("__")
    }
    names = next((content[key] for key in _NAMES if key in content), None)
    sheets = _sheet(path, name, arrays)
    for key, value in content.items():
        if isinstance(value, np.ndarray) and value.ndim == 2 and min(value.shape) > 1:
            labels = [f"column {k + 1}" for k in range(value.shape[1])] if names is None else names
            matrix = {label: (column, None) for label, column in _of_matrix(value, labels).items()}
            remarks = (NAMELESS,) if names is None else ()
            sheets += _sheet(path, f"{name}.{key}".strip("."), matrix, remarks)
    for key, value in content.items():
        if isinstance(value, Mapping) and key != "units":
            sheets += _sheets_of(path, f"{name}.{key}".strip("."), value)
    return sheets


def _channels(name: str, field: Any) -> dict[str, Any]:
    """Return a field, or the channels in it: structures of readings with units and perhaps names."""
    if isinstance(field, list) and field and all(isinstance(one, Mapping) for one in field):
        return {key: value for k, one in enumerate(field) for key, value in _channels(f"{name}{k}", one).items()}
    if not isinstance(field, Mapping):
        return {name: field}
    values, units = _said(field, _VALUES), _said(field, _UNITS)
    names = _said(field, ("name", "label"))
    if isinstance(values, list) and isinstance(names, list) and len(values) == len(names):
        units = units if isinstance(units, list) and len(units) == len(names) else [None] * len(names)
        found = zip(names, values, units, strict=True)
    elif np.ndim(values) == 1 and isinstance(units, str):
        found = zip([names if isinstance(names, str) else name], [values], [units], strict=True)
    else:
        return {name: field}
    return {key: value for label, one, unit in found for key, value in ((label, one), (f"{label}_unit", unit))}


def _of_matrix(values: Any, names: Any) -> dict[str, Any]:
    """Return the columns of a matrix by their names; nothing where these aren't as many."""
    texts = [
        one.decode() if isinstance(one, bytes) else str(one).strip()
        for one in np.ravel(np.asarray(names, dtype=object))
    ]
    rows = np.asarray(values)
    columns = list(rows if len(rows) == len(texts) != rows.shape[-1] else rows.T)
    return dict(zip(texts, columns, strict=True)) if len(texts) == len(columns) else {}


def _sheet(path: Path, name: str, arrays: Arrays, remarks: tuple[str, ...] = ()) -> list[Sheet]:
    columns = []
    for label, (given, unit) in arrays.items():
        values = np.squeeze(np.asarray(None if isinstance(given, Mapping | str) else given))
        if values.ndim != 1 or not np.issubdtype(values.dtype, np.number) or len(values) < FEWEST_ROWS:
            continue
        one = np.ravel(unit)[0] if np.size(unit) == 1 else None
        columns.append(_column(label, one.decode() if isinstance(one, bytes) else one, values.astype(np.float64)))
    if not columns:
        return []
    check_lengths(path, name, columns)
    return [Sheet(name, tuple(columns), remarks)]
