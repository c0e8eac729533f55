"""Tables 4 and 5 of Frauziols et al., from the reconstructed subjects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from legfem.common.documents import markdown_table, write_atomically, write_document
from legfem.common.progress import progress_on
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.document import fit_document
from legfem.inverse.fit import Fit
from legfem.inverse.settings import IdentificationSettings, SearchRequest
from legfem.legs.correction import TabulatedCorrection
from legfem.legs.correction_of_leg import correction_of, size_of
from legfem.legs.details import LegDetails
from legfem.legs.document import LegDocument
from legfem.legs.identification import fit_leg
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS


@dataclass(frozen=True)
class PaperRow:
    """One subject of Tables 4 and 5 as printed (kPa, N2)."""

    neo_hookean_c10: float
    neo_hookean_cost: float
    c10: float
    c20: float
    cost: float


PAPER = {
    "1": PaperRow(2.11, 0.45, 0.82, 2.61, 6.5e-3),
    "2": PaperRow(1.72, 0.48, 0.80, 2.00, 2.5e-2),
    "3": PaperRow(1.21, 0.23, 0.70, 0.80, 3.5e-1),
    "4": PaperRow(0.51, 0.16, 0.19, 0.24, 4.3e-1),
}


def run(seed: int, out: Path, jobs: int, corrected: bool = False, quiet: bool = False) -> None:
    """Identify the four subjects with both laws and write the tables.

    Parameters
    ----------
    seed
        Of the genetic algorithm.
    out
        Folder; full solves are kept there.
    jobs
        Processes.
    corrected
        Whether to identify them with their legs' own 3D corrections too.
    quiet
        Whether progress isn't told.
    """
    found: dict[str, list[Fit[LegDetails]]] = {}
    with_correction: dict[str, list[Fit[LegDetails]]] = {}
    settings = IdentificationSettings(seed=seed)
    with progress_on(quiet=quiet) as progress:
        request = SearchRequest(settings=settings, jobs=jobs, progress=progress)

        def identify(name: str, correction: TabulatedCorrection | None) -> list[Fit[LegDetails]]:
            return fit_leg(
                load_subject(SUBJECTS.find(name)),
                ["neo-hookean", "reduced-polynomial"],
                replace(request, out=out / f"subject-{name}"),
                [correction],
            )

        for name in PAPER:
            found[name] = identify(name, None)
            if corrected:
                subject = load_subject(SUBJECTS.find(name), need_recordings=False)
                with_correction[name] = identify(name, correction_of(subject))
    tables = neo_hookean_table(found) + "\n" + polynomial_table(found) + "\n" + effort_table(found)
    if corrected:
        tables += "\n" + correction_table(found, with_correction) + "\n" + own_corrections_table()
    documents = [fit_document(pair, LegDocument()) for pair in (*found.values(), *with_correction.values())]
    write_document(out / "result.json", documents)
    write_atomically(out / "tables.md", tables)
    print(tables)
    print(f"tables: {out / 'tables.md'}\nresult: {out / 'result.json'}")


def neo_hookean_table(found: dict[str, list[Fit[LegDetails]]]) -> str:
    """Return Table 4, the paper's and ours, in Markdown."""
    rows = []
    for name, (neo_hookean, _) in found.items():
        paper, cost = PAPER[name], neo_hookean.cost
        rows.append(
            [
                name,
                f"{paper.neo_hookean_c10:.2f}, {paper.neo_hookean_cost:g}",
                _estimate(neo_hookean, DEEP_C10),
                f"{cost.value:.4g}",
                f"{cost.per_length:.3g}",
                f"{cost.rms:.3f}",
            ]
        )
    header = [
        "subject",
        "paper: C10 (kPa), cost (N2)",
        "legfem: C10 (kPa), 95 %",
        "cost (N2)",
        "cost ((N/mm)2)",
        "rms (N)",
    ]
    return markdown_table(header, rows)


def polynomial_table(found: dict[str, list[Fit[LegDetails]]]) -> str:
    """Return Table 5, the paper's (the truth of the reconstruction) and ours, in Markdown."""
    rows = []
    for name, (_, polynomial) in found.items():
        paper, cost = PAPER[name], polynomial.cost
        c10, c20 = polynomial.estimates[DEEP_C10], polynomial.estimates[DEEP_C20]
        rows.append(
            [
                name,
                f"{paper.c10:.2f}, {paper.c20:.2f}, {paper.cost:g}",
                _estimate(polynomial, DEEP_C10),
                _estimate(polynomial, DEEP_C20),
                f"{c10.shown.value / paper.c10 - 1:+.1%}, {c20.shown.value / paper.c20 - 1:+.1%}",
                f"{cost.value:.4g}",
                f"{cost.per_length:.3g}",
                f"{cost.rms:.3f}",
                f"{c10.identifiability}, {c20.identifiability}",
            ]
        )
    header = [
        "subject",
        "paper: C10, C20 (kPa), cost (N2)",
        "legfem: C10 (kPa), 95 %",
        "C20 (kPa), 95 %",
        "error of C10, C20",
        "cost (N2)",
        "cost ((N/mm)2)",
        "rms (N)",
        "verdicts",
    ]
    return markdown_table(header, rows)


def effort_table(found: dict[str, list[Fit[LegDetails]]]) -> str:
    """Return the work done, in Markdown."""
    rows = []
    for name, pair in found.items():
        solves = ", ".join(str(result.log.forward_solves) for result in pair)
        rows.append([name, solves, f"{sum(result.log.wall_s for result in pair):.0f}"])
    header = ["subject", "forward solves (neo-Hookean, reduced polynomial)", "seconds (both)"]
    return markdown_table(header, rows)


def correction_table(without: dict[str, list[Fit[LegDetails]]], corrected: dict[str, list[Fit[LegDetails]]]) -> str:
    """Return the stiffnesses without and with the 3D correction, in Markdown."""
    rows = []
    for name, pair in without.items():
        cells = [
            " and ".join(_estimate(result, stiffness) for stiffness in result.estimates)
            for law in (0, 1)
            for result in (pair[law], corrected[name][law])
        ]
        rows.append([name, *cells, f"{pair[1].cost.rms:.3f}, {corrected[name][1].cost.rms:.3f}"])
    header = [
        "subject",
        "neo-Hookean C10 (kPa), 95 %: without",
        "with",
        "reduced polynomial C10, C20 (kPa), 95 %: without",
        "with",
        "rms (N) without, with",
    ]
    return markdown_table(header, rows)


def own_corrections_table() -> str:
    """Return P of each subject's leg at Table 5's stiffness, with its error, in Markdown."""
    depths = np.array([5.0, 10.0, 15.0, 20.0, 25.0])
    rows = []
    for name, paper in PAPER.items():
        subject = load_subject(SUBJECTS.find(name), need_recordings=False)
        own = correction_of(subject)
        P = own.correction(depths, np.array(paper.c10), np.array(paper.c20))
        cells = [f"{p:+.2f} ({sd:.2f})" for p, sd in zip(P, own.standard_deviation(depths), strict=True)]
        radius, depth = size_of(subject)
        rows.append([name, f"{radius:.1f}, {depth:.1f}", *cells])
    at = (f"P at {d:g} mm (sd)" for d in depths)
    return markdown_table(["subject", "radius, depth to bone (mm)", *at], rows)


def _estimate(result: Fit[LegDetails], name: str) -> str:
    found = result.estimates[name].shown
    return f"{found.value:.3f} [{found.ci95[0]:.3f}, {found.ci95[1]:.3f}]"
