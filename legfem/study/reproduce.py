"""Tables 4 and 5 of Frauziols et al., from the reconstructed subjects."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from legfem.common.documents import Cells, markdown_table, row_cells, write_atomically, write_document
from legfem.common.progress import progress_on
from legfem.common.resources import resource
from legfem.common.units import kpa_to_mpa
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.document import fit_document
from legfem.inverse.fit import Fit
from legfem.inverse.settings import AskedWeighting, IdentificationSettings, SearchRequest
from legfem.legs.correction_of_leg import correction_of, size_of
from legfem.legs.details import LegDetails
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


PAPER = resource("frauziols/paper", dict[str, PaperRow])


def run(
    seed: int, out: Path, jobs: int, corrected: bool = False, quiet: bool = False, weighting: AskedWeighting = "paper"
) -> dict[str, list[Fit[LegDetails]]]:
    """Identify the four subjects with both laws and write the tables.

    Parameters
    ----------
    seed
        Seed of the genetic algorithm.
    out
        Folder; full solves are kept there.
    jobs
        Processes.
    corrected
        Whether to identify them with their legs' own 3D corrections too.
    quiet
        Whether progress is kept to oneself.
    weighting
        Objective of the search: the paper's Eq. 12, or weighted with the covariance.

    Returns
    -------
    dict of list of Fit
        Each subject's fits without a correction, neo-Hookean first.
    """
    found: dict[str, list[Fit[LegDetails]]] = {}
    with_correction: dict[str, list[Fit[LegDetails]]] = {}
    settings = IdentificationSettings(seed=seed, weighting=weighting)
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
    made = [neo_hookean_cells(found), polynomial_cells(found), effort_cells(found)]
    if corrected:
        made += [correction_cells(found, with_correction), corrections_by_leg_cells()]
    tables = "\n".join(markdown_table(*cells) for cells in made)
    documents = [fit_document(pair) for pair in (*found.values(), *with_correction.values())]
    write_document(out / "result.json", documents)
    write_atomically(out / "tables.md", tables)
    print(tables)
    print(f"tables: {out / 'tables.md'}\nresult: {out / 'result.json'}")
    return found


def neo_hookean_cells(found: dict[str, list[Fit[LegDetails]]]) -> Cells:
    """Table 4: the paper's and ours."""
    return row_cells(
        {
            "subject": name,
            "paper: C10 (kPa), cost (N2)": f"{PAPER[name].neo_hookean_c10:.2f}, {PAPER[name].neo_hookean_cost:g}",
            "legfem: C10 (kPa), 95 %": _estimate(neo_hookean, DEEP_C10),
            **_cost(neo_hookean),
        }
        for name, (neo_hookean, _) in found.items()
    )


def polynomial_cells(found: dict[str, list[Fit[LegDetails]]]) -> Cells:
    """Table 5: the paper's, which is the truth of the reconstruction, and ours."""
    rows = []
    for name, (_, polynomial) in found.items():
        paper = PAPER[name]
        c10, c20 = polynomial.estimates[DEEP_C10], polynomial.estimates[DEEP_C20]
        rows.append(
            {
                "subject": name,
                "paper: C10, C20 (kPa), cost (N2)": f"{paper.c10:.2f}, {paper.c20:.2f}, {paper.cost:g}",
                "legfem: C10 (kPa), 95 %": _estimate(polynomial, DEEP_C10),
                "C20 (kPa), 95 %": _estimate(polynomial, DEEP_C20),
                "error of C10, C20": f"{c10.shown.value / paper.c10 - 1:+.1%}, {c20.shown.value / paper.c20 - 1:+.1%}",
                **_cost(polynomial),
                "verdicts": f"{c10.identifiability}, {c20.identifiability}",
            }
        )
    return row_cells(rows)


def effort_cells(found: dict[str, list[Fit[LegDetails]]]) -> Cells:
    """Work done for each subject."""
    return row_cells(
        {
            "subject": name,
            "forward solves (neo-Hookean, reduced polynomial)": ", ".join(str(r.log.forward_solves) for r in pair),
            "seconds (both)": f"{sum(result.log.wall_s for result in pair):.0f}",
        }
        for name, pair in found.items()
    )


def correction_cells(without: dict[str, list[Fit[LegDetails]]], corrected: dict[str, list[Fit[LegDetails]]]) -> Cells:
    """Stiffnesses without and with the 3D correction."""
    header = [
        "subject",
        "neo-Hookean C10 (kPa), 95 %: without",
        "with",
        "reduced polynomial C10, C20 (kPa), 95 %: without",
        "with",
        "rms (N) without, with",
    ]
    rows = []
    for name, pair in without.items():
        cells = [
            " and ".join(_estimate(result, stiffness) for stiffness in result.estimates)
            for law in (0, 1)
            for result in (pair[law], corrected[name][law])
        ]
        rows.append([name, *cells, f"{pair[1].cost.rms:.3f}, {corrected[name][1].cost.rms:.3f}"])
    return header, rows


def corrections_by_leg_cells() -> Cells:
    """P of each subject's leg at Table 5's stiffness, with its error."""
    depths = np.array([5.0, 10.0, 15.0, 20.0, 25.0])
    rows = []
    for name, paper in PAPER.items():
        subject = load_subject(SUBJECTS.find(name), need_recordings=False)
        correction = correction_of(subject)
        P = correction.correction(depths, kpa_to_mpa(np.array(paper.c10)), kpa_to_mpa(np.array(paper.c20)))
        sd = correction.standard_deviation(depths)
        radius, depth = size_of(subject)
        row = {"subject": name, "radius, depth to bone (mm)": f"{radius:.1f}, {depth:.1f}"}
        rows.append(row | {f"P at {d:g} mm (sd)": f"{p:+.2f} ({s:.2f})" for d, p, s in zip(depths, P, sd, strict=True)})
    return row_cells(rows)


def _cost(result: Fit[LegDetails]) -> dict[str, str]:
    cost = result.cost
    return {"cost (N2)": f"{cost.value:.4g}", "cost ((N/mm)2)": f"{cost.per_length:.3g}", "rms (N)": f"{cost.rms:.3f}"}


def _estimate(result: Fit[LegDetails], name: str) -> str:
    found = result.estimates[name].shown
    return f"{found.value:.3f} [{found.ci95[0]:.3f}, {found.ci95[1]:.3f}]"
