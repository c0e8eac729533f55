"""The page that a person reads first: what was done, what was found, and the list of files."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from legfem.common.units import mpa_to_kpa
from legfem.identify.result import IdentificationResult
from legfem.mechanics.materials import Hyperelastic
from legfem.report.style import LAW_NAMES
from legfem.report.text import ORIGINS, WIDTH, fit_report, summary
from legfem.subjects.subject import Subject

NUMBERS = "all numbers with their units"


@dataclass(frozen=True)
class ReportFile:
    """A file of a report, or several of one kind, and what it shows."""

    paths: Sequence[Path]
    shows: str


RESULT = ReportFile([Path("result.json")], NUMBERS)


def report_page(
    results: Sequence[IdentificationResult],
    subject: Subject,
    files: Sequence[ReportFile],
    note: str = "",
) -> str:
    """Return the text of ``report.txt``: one result a law, and what else was written."""
    heading = f"Stiffness of the deep tissue of subject {subject.id} from indentation"
    what, _, explanation = ORIGINS[subject.origin].partition(" (")
    blocks = [
        f"{heading}\n{'=' * len(heading)}",
        f"*** {what.upper()} ***" + (f" ({explanation}" if explanation else ""),
        headline("Summary") + summary(results).rstrip(),
        headline("What was done") + procedure(results[0], subject),
        headline("Tissues") + _tissues(results, subject),
        *(
            headline(f"Result: {LAW_NAMES[result.law]}") + fit_report(result).rstrip()
            for result in results
        ),
        headline("Files") + listing([*files, RESULT], note),
    ]
    return "\n\n".join(blocks) + "\n"


def headline(name: str) -> str:
    """Return a section's title, underlined."""
    return f"{name}\n{'-' * len(name)}\n"


def procedure(result: IdentificationResult, subject: Subject) -> str:
    """Return what was done with the recordings, as a paragraph."""
    measured, indenter = result.measured, subject.indenter
    correction = (
        f"with the 3D correction {result.correction.name}"
        if result.correction
        else "without a correction for 3D effects"
    )
    searched = (
        "an emulator of the model, which full solves refined and confirmed"
        if result.settings.get("emulator", True)
        else "the full model itself"
    )
    trials = f"{measured.n_trials} trial{'s' * (measured.n_trials > 1)}"
    return textwrap.fill(
        f"The recordings ({trials}) are of a rigid cylinder, {2 * indenter.radius:g} mm in "
        f"diameter and {indenter.length:g} mm long, pressed into the calf. Their loading was "
        f"brought to one mean curve with its errors, {len(measured.displacement)} points to "
        f"{measured.displacement[-1]:g} mm after first contact. A plane-strain finite-element "
        f"model of the section gives the force per length, taken times the cylinder's length, "
        f"{correction}. {_searcher(result)} searched for {_sought(result)} on "
        f"{searched}. What was recorded in unloading or at rest was not used.",
        WIDTH,
    )


def _sought(result: IdentificationResult) -> str:
    if all(name.startswith("deep.") for name in result.parameters):
        return "the deep tissue's parameters"
    return ", ".join(result.parameters)


def _searcher(result: IdentificationResult) -> str:
    own = result.settings.get("genetic", {}).get("minimiser")
    return "A genetic algorithm (pygad)" if own is None else f"A search of the user's ({own})"


def _tissues(results: Sequence[IdentificationResult], subject: Subject) -> str:
    stated = [
        (name, result.law if name == "deep" else subject.tissues[name].law, result)
        for name in ("deep", "superficial", "fascia")
        for result in results
    ]
    rows = [
        f"{'tissue':<12} {'law':<19} {'C10 (kPa)':>10}            {'D1 (1/MPa)':>11} "
        f"{'K/mu':>7} {'Poisson':>8}"
    ]
    negative = False
    for name, law, result in stated:
        tissue, mark = _tissue(name, result)
        ratio = tissue.bulk_modulus / tissue.shear_modulus
        negative |= tissue.poisson_ratio < 0
        row = (
            f"{name:<12} {LAW_NAMES[law]:<19} {mpa_to_kpa(tissue.C10):>10.4g} {mark:<10} "
            f"{tissue.D1:>11.4g} {ratio:>7.3g} {tissue.poisson_ratio:>8.3f}"
        )
        if row not in rows:
            rows.append(row)
    thickness = subject.section.fascia_thickness
    rows.append(f"The fascia is {thickness:g} mm thick; the bones are rigid and fixed.")
    if negative:
        rows.append(
            "A Poisson's ratio below zero follows from the C10 and D1 given: "
            "the published values of the\nfascia are such."
        )
    return "\n".join(rows)


def _tissue(name: str, result: IdentificationResult) -> tuple[Hyperelastic, str]:
    """Return a tissue's compressible part at the optimum, and how its C10 is known."""
    every = {**result.assumed, **result.values}
    found = result.parameters.get(f"{name}.C10")
    mark = "assumed" if found is None else found.parameter.role
    return Hyperelastic(C10=every[f"{name}.C10"], D1=every[f"{name}.D1"]), mark


def listing(files: Sequence[ReportFile], note: str = "") -> str:
    """Return a report's files and what each shows."""
    rows = []
    for entry in files:
        rows.append(", ".join(path.name for path in entry.paths))
        indent = " " * 4
        rows.append(
            textwrap.fill(entry.shows, WIDTH, initial_indent=indent, subsequent_indent=indent)
        )
    return "\n".join([*rows, *(["", textwrap.fill(note, WIDTH)] if note else [])])
