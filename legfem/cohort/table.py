"""The cohort as one table, a row a member, and a second one with each column's unit and meaning."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from legfem.cohort.members import DESIGN, Member
from legfem.cohort.rows import Row
from legfem.common.documents import literal
from legfem.inverse.catalogue import unit_suffix

if TYPE_CHECKING:
    import pandas as pd

CSV, UNITS, WORKBOOK, PARQUET = "cohort.csv", "cohort-units.csv", "cohort.xlsx", "cohort.parquet"
_MEANINGS = {
    "member": "folder of the member, below the cohort's",
    "subject": "person",
    "problem": "why there is no result; empty where there is one",
    "judgement": "sound, caution, open or wrong, as on the member's own page",
    "verdict": "of a diagnosis",
    "model": "strain energy that the recordings ask for, or the model that the numbers are of",
    "warnings": "number of warnings on the member's own page",
    "fat_thickness_mm": "thickness of the fat under the indenter, from the outlines",
    "girth_mm": "perimeter of the section, from the outlines",
    "seconds": "wall time that it took",
    "peak_MB": "most memory of the process that did it",
    "report": "page, as seen from the folder of results",
    "origin": "of the recordings",
}


def cohort_frame(members: Sequence[Member], rows: Sequence[Row]) -> pd.DataFrame:
    """Return a row a member, in the members' order; empty cells where there is nothing."""
    import pandas as pd

    by_name = {one.name: one for one in members}
    entries = []
    for row in rows:
        member = by_name[row.member]
        entry: dict[str, object] = {"member": row.name, "subject": member.person, **member.given}
        entry |= {"problem": row.problem, "judgement": row.judged.tone, "verdict": row.verdict}
        warnings = len(row.judged.warnings) if row.done else None
        entry |= {"model": row.judged.preferred, "warnings": warnings, "origin": row.origin}
        entry |= {"fat_thickness_mm": row.shape.fat_mm, "girth_mm": row.shape.girth_mm}
        for model, found in row.models.items():
            entry[column(model, "fit_p_value")] = found.p_value
            for name, one in found.measures.items():
                suffix = unit_suffix(one.unit)
                entry[column(model, name, suffix)] = one.value
                entry[column(model, name, "low", suffix)] = one.low
                entry[column(model, name, "high", suffix)] = one.high
                entry[column(model, name, "standard_error", suffix)] = one.sd
                entry[column(model, name, "identifiability")] = one.verdict
        entry |= {"seconds": row.seconds or None, "peak_MB": row.peak_mb or None, "report": row.report}
        entries.append(entry)
    frame = pd.DataFrame(entries)
    return frame.drop(columns=[name for name in frame if frame[name].isin(["", None]).all()])


def column(model: str, *parts: str) -> str:
    """Return the name of a model's column: ``neo_hookean_c10_deep_low_kPa``."""
    words = [model.replace("-", "_").replace(" ", "_"), *parts]
    return "_".join(word for word in words if word)


def units_frame(frame: pd.DataFrame, rows: Sequence[Row]) -> pd.DataFrame:
    """Return unit and meaning of each of a frame's columns."""
    import pandas as pd

    known: dict[str, tuple[str, str]] = {name: (_unit(name), text) for name, text in _MEANINGS.items()}
    for row in rows:
        for model, found in row.models.items():
            under = f" under {model}" if model else ""
            known[column(model, "fit_p_value")] = ("1", f"probability of so poor a fit by chance{under}")
            for name, one in found.measures.items():
                suffix, of = unit_suffix(one.unit), f"of {name}{under}"
                known |= {
                    column(model, name, suffix): (one.unit, f"{name}{under}"),
                    column(model, name, "low", suffix): (one.unit, f"lower end of the 95 % interval {of}"),
                    column(model, name, "high", suffix): (one.unit, f"upper end of the 95 % interval {of}"),
                    column(model, name, "standard_error", suffix): (one.unit, f"standard error {of}"),
                    column(model, name, "identifiability"): ("", f"how well the recordings determine {name}{under}"),
                }
    given = {name: ("", "as in the cohort's table") for name in frame if name not in known}
    every: Mapping[str, tuple[str, str]] = known | given | {name: ("", "as in the cohort's table") for name in DESIGN}
    return pd.DataFrame([{"column": name, "unit": every[name][0], "meaning": every[name][1]} for name in frame])


def _unit(name: str) -> str:
    return {"seconds": "s", "peak_MB": "MB"}.get(name, "mm" if name.endswith("_mm") else "")


def write_tables(frame: pd.DataFrame, units: pd.DataFrame, folder: Path) -> list[Path]:
    """Write the table as CSV and as a workbook, and as Parquet where pyarrow is installed; return the paths."""
    import pandas as pd

    plain = frame.map(literal)
    written = [folder / CSV, folder / UNITS, folder / WORKBOOK]
    plain.to_csv(written[0], index=False)
    units.to_csv(written[1], index=False)
    with pd.ExcelWriter(written[2]) as writer:
        plain.to_excel(writer, sheet_name="cohort", index=False)
        units.to_excel(writer, sheet_name="units", index=False)
    if find_spec("pyarrow"):
        written.append(folder / PARQUET)
        frame.to_parquet(written[-1], index=False)
    return written
