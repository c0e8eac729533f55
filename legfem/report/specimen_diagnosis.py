"""The diagnoses of a folder's specimens: each one's report, and a table of all."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from legfem.common.documents import json_types, write_document
from legfem.inverse.verdict import Diagnosis
from legfem.report import diagnosis_tables as tables
from legfem.report.diagnosis import write_diagnosis_report
from legfem.report.diagnosis_document import document, parameters
from legfem.report.diagnosis_style import model_name
from legfem.report.folder import REPORT, made_in_place
from legfem.report.text import bullets, fill, table
from legfem.report.words import ORIGINS
from legfem.specimens.diagnosis import DiagnosedSpecimen
from legfem.specimens.folder import SpecimenFolder
from legfem.specimens.recorded import LeftOut

DOCUMENT = "diagnosis.json"
SCHEMA = 1


def write_specimen_diagnoses(
    found: Iterable[DiagnosedSpecimen], folder: SpecimenFolder, out: Path, seed: int, command: str = ""
) -> tuple[Path, Path]:
    """Write every diagnosis as it comes; return the paths of the document and the report.

    Of one specimen they are a leg's; of several each has a folder of its name, and beside them
    stands a table of all.

    Parameters
    ----------
    found
        Diagnoses.
    folder
        Of the specimens.
    out
        Folder; made if missing.
    seed
        Of the draws behind p-values.
    command
        That was given, for who wants to repeat it.

    Raises
    ------
    InputError
        If no specimen could be diagnosed.
    """
    alone = len(folder.specimens) == 1
    made = []
    for one in found:
        made.append(one)
        if one.diagnosis is not None:
            where = out if alone else out / _folder_name(one.id)
            content = document(one.diagnosis, one, seed, one.seconds)
            content["recordings_not_used"] = _not_used(one, folder)
            write_document(where / DOCUMENT, content)
            write_diagnosis_report(one.diagnosis, one, where, command=command)
    problems = [one.problem for one in made if one.problem is not None]
    if len(problems) == len(made):
        raise problems[0]
    if alone:
        return out / DOCUMENT, out / REPORT
    path = write_document(
        out / DOCUMENT,
        json_types(
            {
                "schema": SCHEMA,
                "folder": folder.id,
                "origin": folder.origin,
                "specimens": [_row(one) for one in made],
                "recordings_not_used": [asdict(one) for one in folder.left_out],
            }
        ),
    )
    with made_in_place(out) as hidden:
        (hidden / REPORT).write_text(specimens_page(made, folder), encoding="utf-8")
    return path, out / REPORT


def _folder_name(name: str) -> str:
    return name.replace(" ", "_").replace("/", "_")


def _not_used(one: DiagnosedSpecimen, folder: SpecimenFolder) -> list[dict[str, Any]]:
    several = len(folder.specimens) > 1
    left: tuple[LeftOut, ...] = one.left_out if several else (*folder.left_out, *one.left_out)
    return [asdict(each) for each in left]


def _row(one: DiagnosedSpecimen) -> dict[str, Any]:
    if one.diagnosis is None:
        return {"specimen": one.id, "problem": str(one.problem)}
    found = one.diagnosis
    return {
        "specimen": one.id,
        "verdict": found.verdict,
        "explanations": [{"mechanisms": list(model.names), "probability": model.probability} for model in found.models],
        "parameters_before": parameters(found.base),
        "parameters_after": parameters(found.best),
        "recordings_not_used": [asdict(each) for each in one.left_out],
    }


def specimens_page(made: Iterable[DiagnosedSpecimen], folder: SpecimenFolder) -> str:
    """Return the text of the report on all specimens: a table, and what wasn't used."""
    rows, missing = [], [f"{one.name}: {one.reason}" for one in folder.left_out]
    for one in made:
        missing += [f"{each.name}: {each.reason}" for each in one.left_out]
        if one.diagnosis is None:
            missing.append(f"{one.id}: {one.problem}")
        else:
            rows.append(_cells(one.id, one.diagnosis))
    heading = f"Specimens {folder.id} ({folder.title}): does the model describe the recordings?"
    columns = ["specimen", "verdict", "what was left out", "C10 before (kPa)", "C10 after (kPa)"]
    blocks = [
        f"{heading}\n{'=' * min(len(heading), 100)}",
        f"*** {ORIGINS[folder.origin].partition(' (')[0].upper()} ***",
        table(columns, rows),
        fill("Each specimen has a folder with its own report beside this one."),
    ]
    if missing:
        blocks.append(f"Not used\n--------\n{bullets(missing)}")
    return "\n\n".join(blocks) + "\n"


def _cells(name: str, found: Diagnosis) -> list[str]:
    left_out = "; or ".join(model_name(model) for model in found.models) or "-"
    after = tables.estimate(found.best, "C10") if found.models else "-"
    return [name, found.verdict, left_out, tables.estimate(found.base, "C10"), after]
