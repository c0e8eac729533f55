"""The page on the paper's claims, over all studies of one command."""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path

from legfem.report.text import ORIGINS, WIDTH
from legfem.study.doe import tables
from legfem.study.doe.study import StudyResult
from legfem.study.doe.verdict import Verdict

FIGURES = ("response.svg",)
"""Those of every study that the page shows."""

UNITS_NOTE = "Sums of squares in (N/mm2)^2 for slopes, (N/mm3)^2 for curvatures."
TABLE_3_NOTE = (
    f"{UNITS_NOTE} Paper / legfem. 'Half of it': legfem's "
    "curvature is the mean second derivative; the coefficient of d^2 in the least-squares parabola "
    "is half of that, and its sums of squares a quarter. The paper prints no F: its own is "
    "(SSR/15)/(SSE/17)."
)


def claims_page(results: Sequence[StudyResult], found: Sequence[Verdict], command: str) -> str:
    """Return the page's text.

    Parameters
    ----------
    found
        The verdicts on all studies.
    command
        What wrote the page.
    """
    subject = results[0].subject
    titles = [result.definition.title for result in results]
    blocks = [
        "# The paper's design of experiments: its claims",
        f"Written by `{command}`.",
        _fill(
            f"Subject {subject.id}, {ORIGINS[subject.origin]}. Forces are simulated in plane "
            "strain, in N per mm of the cylinder's length. Each claim is put to the studies "
            f"below: {'; '.join(titles)}. Their own reports have all figures."
        ),
        tables.markdown(["claim", "verdict"], [[v.claim, v.verdict] for v in found]),
    ]
    for result in results:
        blocks += [
            f"![Response surface: {result.definition.title}]({path})" for path in shown(result)
        ]
    blocks.append(f"## What shows it\n\n{tables.verdict_page(found, titles)}")
    for result in results:
        beside = tables.beside_table_3(result)
        if beside:
            blocks.append(f"## Beside the paper's Table 3\n\n{beside}\n{_fill(TABLE_3_NOTE)}")
    for result in results:
        blocks += _numbers(result)
    return "\n\n".join(block.rstrip() for block in blocks) + "\n"


def shown(result: StudyResult) -> list[str]:
    """Return where the page finds a study's figures."""
    return [f"figures/{result.definition.source.stem}-{name}" for name in FIGURES]


def gather_figures(results: Sequence[StudyResult], folders: Sequence[Path], out: Path) -> None:
    """Copy the figures of the studies to where the page, in ``out``, finds them."""
    for result, folder in zip(results, folders, strict=True):
        for name, path in zip(FIGURES, shown(result), strict=True):
            if (folder / name).exists():
                (out / path).parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(folder / name, out / path)


def _numbers(result: StudyResult) -> list[str]:
    title = result.definition.title
    total = len(result.records)
    blocks = [
        f"## In numbers: {title}\n\n{total - len(result.failed)} of {total} runs reach "
        f"{result.definition.depth:g} mm. {UNITS_NOTE}",
        tables.anova_table(result),
    ]
    if result.numerics is not None:
        blocks.append(
            "Numerical error of the metrics at two corners and the centre, from a finer mesh and "
            "smaller steps, and what it can make of a coefficient:\n\n"
            + tables.numerics_table(result)
        )
    if result.sobol:
        blocks.append(f"Sobol indices, first order and total:\n\n{tables.sobol_table(result)}")
    if result.information is not None:
        blocks.append(
            "95 % half-widths of the parameters by the curve's depth:\n\n"
            + tables.information_table(result)
        )
    return blocks


def _fill(text: str) -> str:
    return textwrap.fill(text, WIDTH)
