"""Several specimens' diagnoses together: a table of all, and how their tests agree."""

from collections.abc import Sequence
from typing import Any

from legfem.common.documents import json_types
from legfem.inverse.catalogue import DEEP_C10
from legfem.report import diagnosis_document
from legfem.report import diagnosis_numbers as tables
from legfem.report.diagnosis_curves import model_name
from legfem.report.render import filled
from legfem.specimens.diagnosis import DiagnosedSpecimen, tests_finding, thickness_finding
from legfem.specimens.folder import SpecimenFolder


def specimens_document(made: Sequence[DiagnosedSpecimen], folder: SpecimenFolder) -> dict[str, Any]:
    """Return what ``diagnosis.json`` holds of several specimens, a row each."""
    return json_types(
        {
            "schema": diagnosis_document.SCHEMA,
            "kind": "specimens",
            "subject": folder.id,
            "title": folder.title,
            "origin": folder.origin,
            "specimens": [_row(one) for one in made],
            "goes_with_thickness": thickness_finding(made),
            "agreement_of_tests": tests_finding(made),
            "agreement_after": tests_finding(made, after=True),
            "recordings_not_used": folder.left_out,
        }
    )


def _row(one: DiagnosedSpecimen) -> dict[str, Any]:
    if one.diagnosis is None:
        return {"specimen": one.id, "problem": str(one.problem)}
    found = one.diagnosis
    return {
        "specimen": one.id,
        "verdict": found.verdict,
        "explanations": [{"mechanisms": list(model.names), "probability": model.probability} for model in found.models],
        "laws": {
            found.law: {
                "law": found.law,
                "verdict": found.verdict,
                "parameters": diagnosis_document.diagnosed_parameters(found.estimates),
                "goodness": {"p_value": found.assessment.lack_of_fit},
            }
        },
        "parameters_of_base_model": diagnosis_document.diagnosed_parameters(found.base.estimates),
        "recordings_not_used": one.left_out,
    }


def specimens_page(made: Sequence[DiagnosedSpecimen], folder: SpecimenFolder) -> str:
    """Return the text of the report on all specimens: a table, and what wasn't used."""
    thickness = thickness_finding(made)
    rows, missing = [], [f"{one.name}: {one.reason}" for one in folder.left_out]
    for one in made:
        missing += [f"{each.name}: {each.reason}" for each in one.left_out]
        if one.diagnosis is None:
            missing.append(f"{one.id}: {one.problem}")
        else:
            found = one.diagnosis
            contradicted = thickness is not None and found.verdict == "consistent"
            left_out = "; or ".join(map(model_name, found.models)) or "-"
            before, after = (tables.estimate(model, DEEP_C10) for model in (found.base_model, found.best))
            verdict = "consistent by itself" if contradicted else found.verdict
            rows.append([one.id, verdict, left_out, before, after if found.models else "-"])
    columns = ["specimen", "verdict", "what was left out", "C10 before (kPa)", "C10 after (kPa)"]
    as_given, repaired = tests_finding(made), tests_finding(made, after=True)
    first = [] if thickness is None else [f"WARNING: {thickness.text} Don't rely on any one specimen's verdict."]
    if as_given is not None and repaired is not None:
        remedy = repaired.remedy if repaired.disagree else ""
        said = f" With what each diagnosis found to be left out: {repaired.text} {remedy}"
        first.append(f"WARNING: {as_given.text}{said}".strip() if as_given.disagree else as_given.text)
    return filled("specimens.txt", folder=folder, first=first, columns=columns, rows=rows, missing=missing)
