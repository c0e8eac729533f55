"""The study's tables as cells, for its page and for the one on all claims."""

from __future__ import annotations

import numpy as np

from legfem.study.doe.anova import Anova
from legfem.study.doe.factors import label_of
from legfem.study.doe.information import IDENTIFIED
from legfem.study.doe.paper import ERROR_DOF, MODEL_DOF, TABLE_2, TABLE_3, PrintedRow
from legfem.study.doe.study import MetricAnalysis, StudyResult

type Cells = tuple[list[str], list[list[str]]]
"""A table's header and rows."""


def anova_cells(result: StudyResult) -> Cells:
    """Return the analysis of variance, as in the paper's Table 3 and with more columns."""
    rows = []
    for a in result.analyses:
        found = a.anova
        rows.append(
            [
                a.metric.label,
                f"{found.ssr:.3g}",
                f"{found.msr:.2g}",
                f"{found.sse:.2g}",
                f"{found.mse:.2g}",
                f"{found.r_squared:.4f}",
                f"{found.predicted_r_squared:.4f}",
                f"{found.F:.0f}",
                f"{found.p_value:.0e}",
                f"{found.model_dof}, {found.error_dof}",
            ]
        )
    return ["metric", "SSR", "MSR", "SSE", "MSE", "R2", "R2 predicted", "F", "p", "df"], rows


def table_3_cells(result: StudyResult) -> Cells | None:
    """Return the analysis beside the paper's Table 3; None where the ranges aren't Table 2's."""
    printed = {row.metric: row for row in TABLE_3}
    if set(result.definition.factors) != set(TABLE_2):
        return None
    rows = []
    for a in result.analyses:
        if a.metric.name not in printed:
            continue
        row = printed[a.metric.name]
        paper_f = float(row.ssr) / MODEL_DOF / (float(row.sse) / ERROR_DOF)
        r_squared = f"{row.r_squared} / {a.anova.r_squared:.4f}"
        ratio = f"{paper_f:.0f} / {a.anova.F:.0f}"
        rows.append([a.metric.label, *_sums(row, a.anova, 1.0), r_squared, ratio])
        if a.metric.kind == "curvature":
            rows.append(["half of it", *_sums(row, a.anova, 0.25), r_squared, ratio])
    header = ["metric: paper / legfem", "SSR", "MSR", "SSE", "MSE", "R2", "F"]
    return header, rows


def _sums(row: PrintedRow, found: Anova, scale: float) -> list[str]:
    pairs = (row.ssr, found.ssr), (row.msr, found.msr), (row.sse, found.sse), (row.mse, found.mse)
    return [f"{_powers(float(paper))} / {_powers(scale * own)}" for paper, own in pairs]


def _powers(value: float) -> str:
    """Return a number with two digits and its power of ten, as the paper prints them."""
    mantissa, _, exponent = f"{value:.1e}".partition("e")
    return f"{mantissa}e{int(exponent)}"


def effects_cells(result: StudyResult) -> Cells:
    """Return what a statistician looks at beside the t tests."""
    rows = [_effects_row(a) for a in result.analyses]
    header = [
        "metric",
        "largest",
        "Lenth's PSE",
        "margin",
        "simultaneous",
        "beyond it",
        "corners - centre",
        "its p",
        "its share of SSE",
        "normal: outputs",
        "residuals",
    ]
    return header, rows


def _effects_row(a: MetricAnalysis) -> list[str]:
    tests = [f"{a.outputs.shapiro:.1g}", f"{a.residuals.shapiro:.1g}"]
    if a.lenth is None:
        return [a.metric.label, *["-"] * 8, *tests]
    size = np.abs(a.lenth.values)
    centre = ["-", "-", "-"]
    if a.centre is not None:
        centre = [f"{a.centre.relative:+.1%} of the largest", f"{a.centre.p_value:.1g}", f"{a.centre.share_of_sse:.1%}"]
    return [
        a.metric.label,
        f"{size.max():.2e}",
        f"{a.lenth.pseudo_standard_error:.1e}",
        f"{a.lenth.margin:.1e}",
        f"{a.lenth.simultaneous_margin:.1e}",
        f"{int((size > a.lenth.simultaneous_margin).sum())} of {len(size)}",
        *centre,
        *tests,
    ]


def numerics_cells(result: StudyResult) -> Cells | None:
    """Return the metrics' numerical errors beside the effects; None where none was computed."""
    found = result.numerics
    if found is None:
        return None
    rows = []
    for k, metric in enumerate(found.metrics):
        cells = [f"{value:+.2%}" for value in found.relative[:, k]]
        bound = found.bound(result.table, metric)
        analysis = next((a for a in result.analyses if a.metric == metric), None)
        beside = ["-", "-"]
        if analysis is not None:
            sizes = [abs(t.value) for t in analysis.tests[1:]]
            above = [t for t in analysis.tests[1:] if t.significant and abs(t.value) < bound]
            beside = [f"{bound / max(sizes):.2%}", f"{len(above)}"]
        rows.append([metric.label, *cells, f"{bound:.1e}", *beside])
    header = [
        "metric",
        *(f"run {number}" for number in found.runs),
        "bound on a coefficient",
        "of the largest",
        "significant ones below it",
    ]
    return header, rows


def sobol_cells(result: StudyResult) -> Cells | None:
    """Return first-order and total indices, and the emulator's error; None without them."""
    if not result.sobol:
        return None
    header = ["metric", *(f.label for f in result.definition.factors), "sum of first", "emulator's rms error / sd"]
    rows = [
        [
            s.metric.label,
            *(f"{a:.3f}, {b:.3f}" for a, b in zip(s.first, s.total, strict=True)),
            f"{s.first.sum():.3f}",
            f"{s.error.relative:.2%} ({s.error.points} runs)",
        ]
        for s in result.sobol
    ]
    return header, rows


def information_cells(result: StudyResult) -> Cells | None:
    """Return 95 % half-widths by depth, and the least depth from which each is told.

    None where no information was computed.
    """
    found = result.information
    if found is None:
        return None
    depths = sorted({end for _, end in result.definition.windows})
    pair = [name for name in IDENTIFIED if name in found.names]
    rows = []
    for k, name in enumerate(found.names):
        alone = [found.relative_sd(d, [name])[0] for d in depths]
        joint = [found.relative_sd(d)[k] for d in depths]
        two = [found.relative_sd(d, pair)[pair.index(name)] for d in depths] if name in pair else []
        within = [found.relative_sd(d, within_ranges=True)[k] for d in depths]
        told = found.told_from(name, within_ranges=True)
        rows.append(
            [
                label_of(name),
                *(", ".join(map(_half, v)) or "-" for v in (alone, two, within, joint)),
                "never" if told is None else f"{told:g} mm",
            ]
        )
    at = ", ".join(f"{d:g}" for d in depths)
    header = [
        "parameter",
        f"alone, at {at} mm",
        "deep pair unknown",
        "others within their ranges",
        "all unknown",
        "others within ranges: told from",
    ]
    return header, rows


def _half(sd: float) -> str:
    half = 1.96 * sd
    return f"{half:.1%}" if half < 10 else "> 1000 %"
