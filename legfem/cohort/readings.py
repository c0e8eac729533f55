"""Plain tables of readings, a row a reading: what a hand probe, a Myoton or elastography leaves of a study."""

import re
from pathlib import Path

from legfem.cohort.members import cells_of, check_numbers, plain_numbers
from legfem.cohort.statistics import COVARIATES, FACTORS, REPEATS, Statistics, statistics_of_readings
from legfem.common.errors import InputError

_KNOWN = {"member": "person", "subject": "person", "person": "person", "visit": "session", "error": "own"} | {
    name: name for name in (*FACTORS, *COVARIATES, *REPEATS, "date")
}
"""What a heading, in lower case and without its unit, is called in statistics."""
_UNIT = re.compile(r"\s*(?:\(([^()]*)\)|\[([^\[\]]*)\])\s*$")


def read_readings(path: Path) -> Statistics:
    """Read a plain table of readings, and return what its columns permit.

    Parameters
    ----------
    path
        CSV or workbook with columns member, one that holds the values (its heading may name the unit, as in
        ``stiffness (N/m)``), at least one of visit, rater and method, and any of error (the reading's own standard
        error, in the values' unit), side, group, rig, sex, age and BMI.

    Raises
    ------
    InputError
        If a column is missing or there twice, or a cell can't be used.
    """
    cells = cells_of(path)
    heads = {name: (_UNIT.sub("", name), "".join(m.groups("")) if (m := _UNIT.search(name)) else "") for name in cells}
    known = {name: _KNOWN[head.lower()] for name, (head, _) in heads.items() if head.lower() in _KNOWN}
    others = [name for name in cells if name not in known]
    values = [name for name in others if heads[name][0].lower() == "value"] or others
    if len(set(known.values())) < len(known):
        raise InputError(path, "header", "two columns say the same", "leave one of them, as one of member and subject")
    if "person" not in known.values() or not set(REPEATS) & set(known.values()):
        by = "one of visit, rater and method" if "person" in known.values() else "member"
        raise InputError(path, "header", f"there is no column {by}", "add it; each row is one reading")
    if len(values) != 1:
        remedy = "call one of them value, with its unit as in value (kPa); each row is one reading"
        raise InputError(path, "header", f"the readings stand in one of {', '.join(others) or 'no column'}", remedy)
    (value,) = values
    name, unit = heads[value]
    for heading in known:
        if known[heading] == "own" and heads[heading][1] not in ("", unit):
            raise InputError(path, heading, f"has another unit than {value}", "write both in one unit")
    for heading in (*known, value):
        meant, texts = known.get(heading, "value"), cells[heading]
        if meant in ("person", "own", *REPEATS) and (empty := texts.index[texts == ""]).size:
            raise InputError(path, f"{heading}, line {empty[0]}", "is empty", "fill it, or remove the row")
        if meant in ("value", "own", *COVARIATES):
            check_numbers(path, cells, heading, positive=meant != "value")
    table = cells[[*known, value]].rename(columns={**known, value: "value"}).replace("", None)
    for column in ("value", "own", *COVARIATES):
        table[column] = plain_numbers(table[column]) if column in table else 0.0 if column == "own" else None
    empty = table.index[table["value"].isna()]
    left = f"Lines without a reading are left out: {', '.join(map(str, empty[:8]))} ({len(empty)})."
    return statistics_of_readings(table.drop(index=empty), name, unit, [left] * (len(empty) > 0))
