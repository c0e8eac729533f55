"""``python tests/reference_numbers.py``: the numbers users see, for comparing two states of legfem.

``--out a.json`` writes F(d) of the four subjects and of the two crosscheck curves, identified
values with their intervals, P(d), the tables of the design of experiments and one stocking state.
``--compare a.json b.json`` prints the greatest relative difference of every entry. It runs on
checkouts as old as 898bc29, whose modules had other names.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

HERE = Path(__file__).resolve().parent
CROSSCHECK = HERE / "data" / "crosscheck"
OLD_NAMES = {
    "legfem.legs.finite_element_models": "legfem.legs.experiments",
    "legfem.meshing.structured": "legfem.meshing.idealised_leg",
    "legfem.legs.loading": "legfem.legs.subject",
    "legfem.legs.subject": "legfem.subject",
    "legfem.legs.correction_of_leg": "legfem.identify.correction",
    "legfem.inverse.correction": "legfem.legs.correction",
    "legfem.legs.correction": "legfem.correction",
    "legfem.study.correction.cases": "legfem.study.correction_cases",
}
"""Of modules that moved, and of some of their functions: what they were before, since 898bc29."""

# Table 5 of Frauziols et al. (C10, C20 in kPa).
PAPER = {"1": (0.82, 2.61), "2": (0.80, 2.00), "3": (0.70, 0.80), "4": (0.19, 0.24)}
# With which the other code's curves were made; it has no (J - 1)^4 / D2 term.
OTHER_CODE = {
    "neo-hookean": {"deep.C10": 1.50e-3, "deep.C20": 0.0},
    "reduced-polynomial": {"deep.C10": 0.72e-3, "deep.C20": 0.85e-3, "deep.D2": math.inf},
}
Entries = dict[str, list[float]]
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


def module(name: str) -> Any:
    """Import a module under its name, or under one that it had."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        if name not in OLD_NAMES:
            raise
        return module(OLD_NAMES[name])


def own_subject(number: str) -> Any:
    """Load one of the four subjects."""
    subjects = module("legfem.legs.loading")
    return subjects.load_subject(subjects.SUBJECTS.find(number))


def forces() -> Entries:
    """F(d) with given stiffness (N), and its derivatives by two parameters (N/MPa)."""
    test_of = module("legfem.legs.finite_element_models").plane_strain_test
    cases = {
        f"subject {number}": (own_subject(number), {"deep.C10": 1e-3 * c10, "deep.C20": 1e-3 * c20}, 30.0)
        for number, (c10, c20) in PAPER.items()
    }
    load = module("legfem.legs.loading").load_subject
    for name, values in OTHER_CODE.items():
        cases[f"crosscheck {name}"] = load(CROSSCHECK / name), values, 20.0
    found: Entries = {}
    for name, (subject, values, depth) in cases.items():
        solved = test_of(subject).solve(values, depth, ("deep.C10", "superficial.C10"))
        at = np.linspace(2.0, depth, 15)
        found[f"F(d) {name}"] = list(solved.curve(at))
        found[f"factorisations {name}"] = [float(solved.report.factorisations)]
        for parameter in ("deep.C10", "superficial.C10"):
            found[f"dF/d{parameter} {name}"] = list(solved.curve.sensitivity(parameter, at))
    return found


def identified() -> Entries:
    """Values, intervals (kPa) and costs (N2) of the four subjects, by the command."""
    found: Entries = {}
    for number in PAPER:
        (result,) = run("legfem.identify", "--subject", number, "--law", "both", "--jobs", "1")
        laws = result["laws"] if isinstance(result, dict) else {one["law"]: one for one in result}
        for law, document in laws.items():
            name = f"subject {number}, {law}"
            for parameter, estimate in document["parameters"].items():
                found[f"{parameter} {name}"] = [estimate["value"]]
                found[f"interval of {parameter} {name}"] = list(estimate["ci95"])
            found[f"cost {name}"] = [document["cost"]["value"]]
    return found


def corrections() -> Entries:
    """P(d) of the tables at three stiffnesses, and of one coarse idealised leg."""
    choice, tabulated = module("legfem.legs.correction_of_leg"), module("legfem.inverse.correction")
    at = np.linspace(0.0, 25.0, 11)
    stiffness = np.array([0.3, 1.0, 5.0]), np.array([0.0, 1.0, 10.0])
    found: Entries = {}
    for number in PAPER:
        own = choice.correction_of(own_subject(number))
        in_kPa = own.c10[-1] > 0.5
        asked = stiffness if in_kPa else [1e-3 * kPa for kPa in stiffness]
        found[f"P(d) subject {number}"] = list(own.correction(at, *asked).ravel())
    experiment = module("legfem.experiments.leg_3d")
    if not hasattr(experiment, "IdealisedLegSettings"):
        experiment = module("legfem.experiments.indentation_3d")
    meshing = module("legfem.meshing.structured")
    cases = module("legfem.study.correction.cases")
    mesh = meshing.LegMeshSettings(contact_size=8, depth_size=16, edge_size=8, growth=0.5, far_size=40)
    settings = replace(experiment.IdealisedLegSettings(), mesh=mesh)
    kind = getattr(cases, "CorrectionCase", None) or cases.Case  # its name at 898bc29
    case = kind(meshing.IdealisedLeg(length=90), settings=settings, depth=6.0)
    outcome = cases.solve_case(case)
    at = np.linspace(0.0, 6.0, 13)
    ratio = tabulated.smooth_ratio(outcome.spatial, outcome.plane, at)
    return {
        **found,
        "P(d) coarse 3D": list(ratio),
        "F(d) coarse 3D": list(outcome.spatial(at)),
        "F(d) coarse plane": list(outcome.plane(at)),
    }


def designed() -> Entries:
    """Tables of the design of experiments, by the command."""
    documents = run("legfem.study", "doe", "--factorial-only", "--jobs", "1")
    return {
        f"doe {document['title']}: {metric['metric']} {name}": values
        for document in documents
        if "metrics" in document
        for metric in document["metrics"]
        for name, values in numbers(metric)
    }


def stocking() -> Entries:
    """The first leg in its stocking, coarse, with given stiffness: pressure and shape."""
    legs = module("legfem.stockings.loading")
    worn, meshing = module("legfem.stockings.equilibrium"), module("legfem.meshing.solid_leg")
    worn_leg, model_of = worn.EquilibriumSolver, worn.LegModel3D
    leg = legs.load_leg(legs.LEGS.find("1"))
    mesh = meshing.SolidMeshSettings(skin_size=9, inside_size=11, bone_size=8)
    model = model_of(leg.bare, leg.tissues, mesh)
    values = {"deep.C10": 6e-3, "superficial.C10": 2.5e-3}
    worn = worn_leg(model, leg.stocking).solve(values)
    moved = model.displacement("skin", worn.state.unknown)
    return {
        "stocking pressure (MPa)": list(worn.pressure.mean(axis=1)),
        "stocking displacement (mm)": list(np.linalg.norm(moved, axis=2).mean(axis=1)),
    }


PARTS: Mapping[str, Callable[[], Entries]] = {
    "force": forces,
    "identify": identified,
    "correction": corrections,
    "doe": designed,
    "stocking": stocking,
}


def run(command: str, *options: str) -> list[Any]:
    """Run a command in an empty folder and return the documents it wrote."""
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", command, *options, "--out", f"{folder}/out"]
        subprocess.run(words, check=True, cwd=folder, env=os.environ, stdout=subprocess.DEVNULL)
        paths = sorted(Path(folder, "out").rglob("result.json"))
        return [json.loads(path.read_text()) for path in paths]


def numbers(value: Any, name: str = "") -> Iterator[tuple[str, list[float]]]:
    """Yield the numbers of a document with the words that lead to them."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from numbers(item, f"{name} {key}".strip())
    elif isinstance(value, list) and all(isinstance(item, int | float) for item in value):
        yield name, [float(item) for item in value]
    elif isinstance(value, list):
        for number, item in enumerate(value):
            yield from numbers(item, f"{name} {number}".strip())
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield name, [float(value)]


def difference(before: list[float], after: list[float]) -> float:
    """Return the greatest difference, relative to the entry's greatest number."""
    a, b = np.array(before), np.array(after)
    if a.shape != b.shape:
        return math.inf
    scale = float(np.abs(a).max(initial=0.0)) or 1.0
    return float(np.abs(a - b).max(initial=0.0)) / scale


@app.command()
def main(
    out: Annotated[Path | None, typer.Option(help="Write the numbers here.")] = None,
    compare: Annotated[tuple[Path, Path] | None, typer.Option(help="Print how two such files differ.")] = None,
    only: Annotated[list[str] | None, typer.Option(help=f"Of {', '.join(PARTS)}.")] = None,
    tolerance: Annotated[float, typer.Option(help="Above which comparing fails.")] = 1e-9,
) -> None:
    """Write the numbers users see, or compare two files of them."""
    if out is not None:
        found: dict[str, Entries] = {}
        for part in only or PARTS:
            print(part, flush=True)
            found[part] = PARTS[part]()
            out.write_text(json.dumps(found, indent=1) + "\n")
    if compare is None:
        return
    before, after = (json.loads(path.read_text()) for path in compare)
    worst = 0.0
    for part in [p for p in PARTS if p in before and p in after]:
        for name in {**before[part], **after[part]}:
            if name not in before[part] or name not in after[part]:
                print(f"{part}: {name}: only {'after' if name in after[part] else 'before'}")
                worst = math.inf
                continue
            change = difference(before[part][name], after[part][name])
            worst = max(worst, change)
            print(f"{part}: {name}: {change:.1e}")
    print(f"greatest: {worst:.1e}")
    raise typer.Exit(int(worst > tolerance))


if __name__ == "__main__":
    app()
