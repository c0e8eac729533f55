"""The page on the paper's claims, over all studies of one command."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path

from legfem.common.documents import markdown_table
from legfem.report.render.text import bullets, fill
from legfem.report.words import ORIGINS
from legfem.study.doe import tables
from legfem.study.doe.study import StudyResult
from legfem.study.doe.verdict import Verdict
from legfem.study.doe.web_numbers import TABLE_3_NOTE, UNITS_NOTE

FIGURES = ("response.svg",)
"""Those of every study that the page shows."""


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
        fill(
            f"Subject {subject.id}, {ORIGINS[subject.origin]}. Forces are simulated in plane "
            "strain, in N per mm of the cylinder's length. Each claim is put to the studies "
            f"below: {'; '.join(titles)}. Their own reports have all figures."
        ),
        _markdown(["claim", "verdict"], [[v.claim, v.verdict] for v in found]),
    ]
    for result in results:
        blocks += [f"![Response surface: {result.definition.title}]({path})" for path in shown(result)]
    blocks.append(f"## What shows it\n\n{_evidence(found, titles)}")
    for result in results:
        if beside := tables.table_3_cells(result):
            table = _markdown(*beside)
            blocks.append(f"## Beside the paper's Table 3\n\n{table}\n{fill(TABLE_3_NOTE)}")
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
        _markdown(*tables.anova_cells(result)),
    ]
    for caption, cells in (
        (
            "Numerical error of the metrics at two corners and the centre, from a finer mesh and "
            "smaller steps, and what it can make of a coefficient",
            tables.numerics_cells(result),
        ),
        ("Sobol indices, first order and total", tables.sobol_cells(result)),
        ("95 % half-widths of the parameters by the curve's depth", tables.information_cells(result)),
    ):
        if cells is not None:
            blocks.append(f"{caption}:\n\n{_markdown(*cells)}")
    return blocks


def _evidence(found: Sequence[Verdict], titles: Sequence[str]) -> str:
    """Return the claims, what became of each, and what shows it."""
    blocks = []
    for verdict in found:
        lines = [f"**{verdict.claim}**: {verdict.verdict}.", ""]
        for title, finding in zip(titles, verdict.findings, strict=True):
            where = f" ({finding.shown_in})" if finding.shown_in else ""
            text = f"{title + ': ' if len(titles) > 1 else ''}{finding.evidence}{where}"
            lines.append(bullets([text]))
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks) + "\n"


def _markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return markdown_table(header, rows, aligned=True)
