"""What TA Instruments' TRIOS writes of a rheometer's tests as JSON.

Source: TA Instruments, *TRIOS JSON Export Schema*, https://software.tainstruments.com/schemas/TRIOSJSONExportSchema.
"""

import json
from pathlib import Path
from typing import Any

import pandas as pd

from legfem.data.formats.labels import sizes_in
from legfem.data.formats.refused import refuse_other_kind
from legfem.data.formats.sheet import FEWEST_ROWS, Column, Sheet


def read_trios(path: Path) -> list[Sheet]:
    """Read the table of all steps that are no oscillations; a specimen is as large as the gap of the plates.

    Raises
    ------
    InputError
        If all steps are oscillations.
    """
    document = json.loads(path.read_text(encoding="utf-8-sig"), parse_constant=lambda name: None)
    results = _in(document, "Results", "Processed") or _in(document, "Results", "Unprocessed")
    heads, rows = results.get("ColumnHeaders", {}), pd.DataFrame(results.get("Rows", ()))
    still = rows[rows.filter(regex="^Oscillation").isna().all(axis=1)]
    if not len(still):
        refuse_other_kind(path, [*rows])
    read = still.dropna(axis=1, thresh=int(_MOSTLY * len(still))).select_dtypes("number").dropna()
    units = {key: _in(head, "Unit").get("Name") for key, head in heads.items()}
    columns = [Column(heads[key]["DisplayName"], units[key], read[key].to_numpy(dtype=float)) for key in read]
    rigs = _in(document, "Procedure", "Configuration").get("InstrumentConfigurations") or ()
    stated = ((name, _in(one, "Geometry", key)) for one in rigs for key, name in _SIZES.items())
    sizes = sizes_in([[name, one.get("Value"), _in(one, "Unit").get("Name")] for name, one in stated])
    lost = len(still) - len(read)
    remarks = (f"rows with missing numbers are left out: {lost}",) if lost else ()
    return [Sheet("", tuple(columns), remarks, sizes)] if len(read) >= FEWEST_ROWS else []


_MOSTLY = 0.9
"""Share of the rows in which a column has a number."""
_SIZES = {"Diameter": "diameter", "Gap": "height"}
"""What a rig's geometry says of what is between its plates."""


def _in(of: Any, *keys: str) -> dict[str, Any]:
    """Return what stands in an object's object; nothing where there is none."""
    for key in keys:
        of = (of or {}).get(key)
    return of or {}
