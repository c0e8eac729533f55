"""Arrays with names: MATLAB's .mat (by pymatreader, any version) and HDF5 (by h5py)."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from pymatreader import read_mat
from scipy.io import whosmat

from legfem.data.formats.labview import check_lengths
from legfem.data.formats.sheet import FEWEST_ROWS, NAMELESS, Column, Sheet, check_size, name_and_unit

_NAMES = ("columns", "colheaders", "headers", "labels", "names")
"""What the names of a matrix' columns are called; ``importdata`` of MATLAB says colheaders."""

type Arrays = dict[str, tuple[Any, Any]]
"""Values and unit by name."""


def read_matlab(path: Path) -> list[Sheet]:
    """Read vectors, and the fields of structures, of a .mat file; a structure is a sheet.

    A matrix is one with its columns' names beside it, as ``colheaders`` for example. The unit of
    ``force`` may stand in its name (``force_N``), in ``force_unit`` or in
    ``units.force``.
    """
    if not h5py.is_hdf5(path):
        check_size(path, sum(8 * math.prod(shape) for _, shape, _ in whosmat(path)))
    else:
        with h5py.File(path) as file:
            _check_datasets(path, file)
    return _sheets_of(path, "", read_mat(str(path)))


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
        file.visititems(lambda _, item: groups.append(item) if _is_group(item) else None)
        for group in groups:
            arrays: Arrays = {}
            for name, item in group.items():
                if not isinstance(item, h5py.Dataset):
                    continue
                names = next((item.attrs[key] for key in _NAMES if key in item.attrs), None)
                if item.dtype.names:
                    table = {field: (item[field], None) for field in item.dtype.names}
                    sheets += _sheet(path, item.name.strip("/"), table)
                elif item.ndim == 2 and names is not None:
                    matrix = {n: (v, None) for n, v in _of_matrix(item[()], names).items()}
                    sheets += _sheet(path, item.name.strip("/"), matrix)
                else:
                    arrays[name] = (_unpacked(item), item.attrs.get("unit", item.attrs.get("units")))
            sheets += _sheet(path, group.name.strip("/"), arrays)
    return sheets


def _unpacked(item: h5py.Dataset) -> Any:
    factor, offset = item.attrs.get("scale_factor", 1.0), item.attrs.get("add_offset", 0.0)
    packed = np.issubdtype(item.dtype, np.number) and (factor != 1.0 or offset != 0.0)
    return item[()] * float(factor) + float(offset) if packed else item[()]


def _check_datasets(path: Path, file: h5py.File) -> None:
    sizes: list[int] = []
    file.visititems(lambda _, item: sizes.append(item.nbytes) if isinstance(item, h5py.Dataset) else None)
    check_size(path, sum(sizes))


def _is_group(item: object) -> bool:
    return isinstance(item, h5py.Group)


def _sheets_of(path: Path, name: str, content: Mapping[str, Any]) -> list[Sheet]:
    units = content.get("units")
    named = units if isinstance(units, Mapping) else {}
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


def _of_matrix(values: Any, names: Any) -> dict[str, Any]:
    """Return the columns of a matrix by their names; nothing where these aren't as many."""
    texts = [
        one.decode() if isinstance(one, bytes) else str(one).strip()
        for one in np.ravel(np.asarray(names, dtype=object))
    ]
    columns = list(np.transpose(np.asarray(values)))
    return dict(zip(texts, columns, strict=True)) if len(texts) == len(columns) else {}


def _sheet(path: Path, name: str, arrays: Arrays, remarks: tuple[str, ...] = ()) -> list[Sheet]:
    columns = []
    for label, (given, unit) in arrays.items():
        values = np.squeeze(np.asarray(given)) if not isinstance(given, Mapping | str) else None
        if values is None or values.ndim != 1 or not np.issubdtype(values.dtype, np.number):
            continue
        if len(values) < FEWEST_ROWS:
            continue
        short, named = name_and_unit(label)
        text = unit.decode() if isinstance(unit, bytes) else unit
        columns.append(Column(short, str(text) if text else named, values.astype(np.float64)))
    if not columns:
        return []
    check_lengths(path, name, columns)
    return [Sheet(name, tuple(columns), remarks)]
