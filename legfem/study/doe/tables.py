"""A study's numbers: its tables and their chapters, the paper's beside them, and ``result.json``."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from legfem.common.documents import Cells, json_types, row_cells, versions_of
from legfem.common.units import FloatArray
from legfem.report import page as web
from legfem.study.doe.design import Factor, in_words, label_of
from legfem.study.doe.information import IDENTIFIED, Information
from legfem.study.doe.study import MetricAnalysis, StudyResult
from legfem.study.doe.surface import LEVEL, Anova

TABLE_2 = (
    Factor("superficial.C10", 1.0, 30.0, "kPa", "linear"),
    Factor("deep.C10", 0.5, 30.0, "kPa", "linear"),
    Factor("deep.C20", 0.5, 30.0, "kPa", "linear"),
    Factor("fascia.C10", 0.1, 10.0, "MPa", "linear"),
    Factor("fascia.thickness", 0.2, 1.0, "mm", "linear"),
)
"""The paper's factors and their ranges."""

MODEL_DOF, ERROR_DOF = 15, 17
"""What 16 coefficients and 33 runs leave."""


@dataclass(frozen=True)
class PrintedRow:
    """One row of the paper's Table 3 as printed; forces per unit thickness."""

    metric: str
    ssr: str
    msr: str
    sse: str
    mse: str
    r_squared: str

    @property
    def label(self) -> str:
        """Metric as people read it."""
        kind, start, end = self.metric.split("_")
        return f"{kind} {start}-{end} mm"


TABLE_3 = (
    PrintedRow("curvature_0_5", "9.40e-5", "6.3e-6", "6.7e-7", "4.0e-8", "0.9929"),
    PrintedRow("curvature_5_20", "3.2e-5", "2.1e-6", "1.2e-7", "6.9e-9", "0.9964"),
    PrintedRow("curvature_20_30", "1.8e-4", "1.7e-5", "3.2e-7", "1.9e-8", "0.9982"),
    PrintedRow("slope_0_5", "2.2e-2", "1.5e-3", "2.1e-4", "1.2e-5", "0.9907"),
    PrintedRow("slope_5_20", "5.7e-2", "3.8e-3", "1.1e-4", "6.7e-6", "0.9980"),
    PrintedRow("slope_20_30", "0.19", "1.3e-2", "1.4e-2", "8.0e-4", "0.9336"),
)

UNITS_NOTE = "Sums of squares in (N/mm²)² for slopes and (N/mm³)² for curvatures."
TABLE_3_NOTE = (
    f"{UNITS_NOTE} Paper / legfem. 'Half of it': legfem's curvature is the mean second derivative; the coefficient of "
    "d^2 in the least-squares parabola is half of that, and its sums of squares a quarter. The paper prints no F: its "
    "own is (SSR/15)/(SSE/17)."
)


def anova_cells(result: StudyResult) -> Cells:
    """Analysis of variance, as in the paper's Table 3 and with more columns."""
    return row_cells(
        {
            "metric": a.metric.label,
            "SSR": f"{a.anova.ssr:.3g}",
            "MSR": f"{a.anova.msr:.2g}",
            "SSE": f"{a.anova.sse:.2g}",
            "MSE": f"{a.anova.mse:.2g}",
            "R2": f"{a.anova.r_squared:.4f}",
            "R2 predicted": f"{a.anova.predicted_r_squared:.4f}",
            "F": f"{a.anova.F:.0f}",
            "p": f"{a.anova.p_value:.0e}",
            "df": f"{a.anova.model_dof}, {a.anova.error_dof}",
        }
        for a in result.analyses
    )


def table_3_cells(result: StudyResult) -> Cells | None:
    """Analysis beside the paper's Table 3; None where the ranges aren't Table 2's."""
    if set(result.definition.factors) != set(TABLE_2):
        return None
    printed, rows = {row.metric: row for row in TABLE_3}, []
    for a in result.analyses:
        if a.metric.name not in printed:
            continue
        row = printed[a.metric.name]
        paper_f = float(row.ssr) / MODEL_DOF / (float(row.sse) / ERROR_DOF)
        last = [f"{row.r_squared} / {a.anova.r_squared:.4f}", f"{paper_f:.0f} / {a.anova.F:.0f}"]
        rows.append([a.metric.label, *_sums(row, a.anova, 1.0), *last])
        if a.metric.kind == "curvature":
            rows.append(["half of it", *_sums(row, a.anova, 0.25), *last])
    return ["metric: paper / legfem", "SSR", "MSR", "SSE", "MSE", "R2", "F"], rows


def _sums(row: PrintedRow, found: Anova, scale: float) -> list[str]:
    names = ("ssr", "msr", "sse", "mse")
    return [f"{_powers(float(getattr(row, n)))} / {_powers(scale * getattr(found, n))}" for n in names]


def _powers(value: float) -> str:
    """Two digits and the power of ten, as the paper prints numbers."""
    mantissa, _, exponent = f"{value:.1e}".partition("e")
    return f"{mantissa}e{int(exponent)}"


def effects_cells(result: StudyResult) -> Cells:
    """What a statistician looks at beside the t tests: Lenth's limits, curvature, normality."""
    return row_cells(_effects_row(a) for a in result.analyses)


def _effects_row(a: MetricAnalysis) -> dict[str, str]:
    found, centre = a.lenth, a.centre
    size = np.abs(found.values) if found else np.zeros(0)
    return {
        "metric": a.metric.label,
        "largest": f"{size.max():.2e}" if found else "-",
        "Lenth's PSE": f"{found.pseudo_standard_error:.1e}" if found else "-",
        "margin": f"{found.margin:.1e}" if found else "-",
        "simultaneous": f"{found.simultaneous_margin:.1e}" if found else "-",
        "beyond it": f"{int((size > found.simultaneous_margin).sum())} of {len(size)}" if found else "-",
        "corners - centre": f"{centre.relative:+.1%} of the largest" if centre else "-",
        "its p": f"{centre.p_value:.1g}" if centre else "-",
        "its share of SSE": f"{centre.share_of_sse:.1%}" if centre else "-",
        "normal: outputs": f"{a.outputs.shapiro:.1g}",
        "residuals": f"{a.residuals.shapiro:.1g}",
    }


def numerics_cells(result: StudyResult) -> Cells | None:
    """Numerical errors of the metrics beside the effects; None where none was computed."""
    found = result.numerics
    if found is None:
        return None
    rows = []
    for k, metric in enumerate(found.metrics):
        bound = found.bound(result.table, metric)
        tests = next((a.tests[1:] for a in result.analyses if a.metric == metric), ())
        below = sum(t.significant and abs(t.value) < bound for t in tests)
        errors = zip(found.runs, found.relative[:, k], strict=True)
        rows.append(
            {"metric": metric.label}
            | {f"run {number}": f"{value:+.2%}" for number, value in errors}
            | {
                "bound on a coefficient": f"{bound:.1e}",
                "of the largest": f"{bound / max(abs(t.value) for t in tests):.2%}" if tests else "-",
                "significant ones below it": f"{below}" if tests else "-",
            }
        )
    return row_cells(rows)


def sobol_cells(result: StudyResult) -> Cells | None:
    """First-order and total indices, and the emulator's error; None without them."""
    if not result.sobol:
        return None
    labels = [f.label for f in result.definition.factors]
    return row_cells(
        {"metric": s.metric.label}
        | {name: f"{one:.3f}, {all_:.3f}" for name, one, all_ in zip(labels, s.first, s.total, strict=True)}
        | {
            "sum of first": f"{s.first.sum():.3f}",
            "emulator's rms error / sd": f"{s.error.relative:.2%} ({s.error.points} runs)",
        }
        for s in result.sobol
    )


def information_cells(result: StudyResult) -> Cells | None:
    """95 % half-widths by depth, and the least depth from which each parameter is identified to 50 %.

    None where no information was computed.
    """
    found = result.information
    if found is None:
        return None
    depths = result.definition.ends
    pair = [name for name in IDENTIFIED if name in found.names]
    rows = []
    for k, name in enumerate(found.names):
        told = found.told_from(name, within_ranges=True)
        sds = {
            f"alone, at {', '.join(f'{d:g}' for d in depths)} mm": [found.relative_sd(d, [name])[0] for d in depths],
            "deep pair unknown": [found.relative_sd(d, pair)[pair.index(name)] for d in depths if name in pair],
            "others within their ranges": [found.relative_sd(d, within_ranges=True)[k] for d in depths],
            "all unknown": [found.relative_sd(d)[k] for d in depths],
        }
        rows.append(
            {"parameter": label_of(name)}
            | {column: ", ".join(map(_half, values)) or "-" for column, values in sds.items()}
            | {"others within ranges: determined from": "never" if told is None else f"{told:g} mm"}
        )
    return row_cells(rows)


def _half(sd: float) -> str:
    half = 1.96 * sd
    return f"{half:.1%}" if half < 10 else "> 1000 %"


def versions() -> dict[str, str]:
    """Versions of the programs that make a study."""
    return versions_of("legfem", "fenics-dolfinx", "statsmodels", "SALib", "pyDOE3")


def study_document(
    result: StudyResult, seed: int, wall_s: float, claims: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Result as plain types: every number with its unit.

    Parameters
    ----------
    claims
        The paper's claims put to this study, as plain types.
    """
    definition = result.definition
    stopped = [(number, result.records[number - 1]) for number in result.failed]
    document = {
        "schema": 1,
        "study": "doe",
        "title": definition.title,
        "subject": result.subject.id,
        "origin": result.subject.origin,
        "seed": seed,
        "wall_s": wall_s,
        "versions": versions(),
        "forward_solves": len(result.records),
        "depth_mm": definition.depth,
        "windows_mm": [list(window) for window in definition.windows],
        "factors": [asdict(factor) for factor in definition.factors],
        "failed_runs": [{"run": n, "reached_mm": r.reached, "reason": r.reason} for n, r in stopped],
        "degrees_of_freedom_count": result.counting,
        "significance_level": LEVEL,
        "metrics": [_metric(analysis) for analysis in result.analyses],
        "not_analysed": [{"metric": m.name, "why": why} for m, why in result.not_analysed],
        "numerical_error": _numerics(result),
        "sobol": _sobol(result),
        "information": _information(result),
        "claims": claims,
    }
    plain: dict[str, Any] = json_types(document)
    return plain


_ANOVA = "ssr msr sse mse r_squared predicted_r_squared F p_value model_dof error_dof"


def _metric(a: MetricAnalysis) -> dict[str, Any]:
    contrasts = None
    if a.lenth is not None:
        limits = {name: getattr(a.lenth, name) for name in ("pseudo_standard_error", "margin", "simultaneous_margin")}
        omitted = a.lenth.omitted_from(a.surface)
        contrasts = {"values": _by(a.lenth.terms, a.lenth.values), **limits, "omitted_beyond_margin": omitted}
    return {
        "metric": a.metric.name,
        "unit": a.metric.unit,
        "runs_missing": list(a.surface.missing),
        "formula": a.surface.formula,
        "anova": {name: getattr(a.anova, name) for name in _ANOVA.split()},
        "coefficients": [{**asdict(t), "significant": t.significant} for t in a.tests],
        "lenth": contrasts,
        "centre_curvature": None if a.centre is None else asdict(a.centre),
        "normality_p_values": {"outputs": asdict(a.outputs), "residuals": asdict(a.residuals)},
    }


def _numerics(result: StudyResult) -> dict[str, Any] | None:
    found = result.numerics
    if found is None:
        return None
    metrics = {
        metric.name: {
            "unit": metric.unit,
            "default": found.default[:, k],
            "refined": found.refined[:, k],
            "relative_error": found.relative[:, k],
            "bound_on_a_coefficient": found.bound(result.table, metric),
        }
        for k, metric in enumerate(found.metrics)
    }
    return {"runs": list(found.runs), "metrics": metrics}


def _sobol(result: StudyResult) -> list[dict[str, Any]]:
    names = [factor.name for factor in result.definition.factors]
    return [
        {
            "metric": s.metric.name,
            "first_order": _by(names, s.first),
            "first_order_ci95_half_width": _by(names, s.first_ci95),
            "total": _by(names, s.total),
            "total_ci95_half_width": _by(names, s.total_ci95),
            "emulator_error": {**asdict(s.error), "unit": s.metric.unit},
        }
        for s in result.sobol
    ]


def _information(result: StudyResult) -> dict[str, Any] | None:
    found, depths = result.information, result.definition.ends
    if found is None:
        return None
    spread, vectors = found.directions(result.definition.depth)
    sds = {
        name: {f"{depth:g} mm": found.relative_sd(depth, within_ranges=within) for depth in depths}
        for name, within in (("relative_sd_all_unknown", False), ("relative_sd_others_within_ranges", True))
    }
    return {
        "parameters": list(found.names),
        "nominal_MPa_mm": list(found.nominal),
        "displacement_mm": found.displacement,
        "force_N": found.force,
        "sensitivity_N_per_log": found.sensitivity.T,
        "noise_sd_N": found.noise_sd,
        **sds,
        "eigenvectors": vectors.T,
        "eigenvector_relative_sd": spread,
        "told_within_50_percent_from_mm": {name: found.told_from(name, within_ranges=True) for name in found.names},
    }


def _by(names: Sequence[str], values: FloatArray) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True)}


def number_chapters(result: StudyResult) -> list[web.Chapter]:
    """Return the analysis of variance, the paper's beside it, numerical errors, Sobol indices."""
    chapters = [web.Chapter("Analysis of variance", _variance(result))]
    if beside := table_3_cells(result):
        table = web.WebTable("Paper / legfem", *beside)
        chapters.append(web.Chapter("Beside the paper's Table 3", [table, web.Prose(TABLE_3_NOTE)]))
    if numerics := numerics_cells(result):
        note = (
            "Errors of the default settings, from a mesh 1.5 times finer with steps of at most 0.5 mm, extrapolated as "
            "for first order: at the softest corner, the stiffest and the centre. The bound on a coefficient is the "
            "largest of these relative errors times the mean size of the metric."
        )
        table = web.WebTable("Numerical errors, and how much they can change a coefficient", *numerics)
        chapters.append(web.Chapter("Numerical error of the metrics", [table, web.Prose(note)]))
    if sobol := sobol_cells(result):
        note = (
            "Shares of the variance with the factors uniform in their coded ranges, on an emulator trained on the runs "
            "above and a Latin hypercube. Its error is at simulations that it has not seen."
        )
        table = web.WebTable("First order, total", *sobol)
        chapters.append(web.Chapter("Sobol indices", [table, web.Prose(note)]))
    return chapters


def _variance(result: StudyResult) -> list[web.Block]:
    return [
        web.Bullets(result.run_notes()),
        web.Prose(f"{UNITS_NOTE} R² predicted is that of runs that were not used in the fit. {_counting(result)}"),
        web.WebTable("Analysis of variance of each metric", *anova_cells(result)),
        web.WebTable(
            "Effects without an error estimate (Lenth), curvature at the centre, normality",
            *effects_cells(result),
            folded=True,
        ),
        web.Prose(
            "The runs are deterministic, so the error in the t tests is the surface's lack of fit. Lenth's pseudo "
            "standard error (PSE) is estimated from the small contrasts; a contrast beyond its simultaneous margin "
            "is not due to chance (95 % for all together). 'corners - centre' is 0 for a surface without squared "
            "terms. The column for normality gives the probability in Shapiro and Wilk's test."
        ),
    ]


def _counting(result: StudyResult) -> str:
    if result.counting == "coefficients":
        return (
            "Degrees of freedom: coefficients less 1, and runs less coefficients, as in the "
            "paper's Table 3 (15 and 17), not as in its text; --count factors gives the text's."
        )
    return (
        "Degrees of freedom: factors less 1, and runs less factors, as in the paper's text "
        "(p = 5: 4 and 28). Its Table 3 and statistics use the number of coefficients instead."
    )


def information_blocks(result: StudyResult) -> list[web.Block]:
    """Return what a curve to each depth tells of the parameters; nothing where it isn't known."""
    found, cells = result.information, information_cells(result)
    if found is None or cells is None:
        return []
    depth, instrument = result.definition.depth, result.subject.instrument
    point = ", ".join(f"{label_of(name)} {value:.4g}" for name, value in zip(found.names, found.nominal, strict=True))
    return [
        web.WebTable("Smallest possible 95 % half-widths of the parameters, by depth", *cells),
        web.Prose(
            "The half-widths are relative to the value. No unbiased estimate can have smaller ones at "
            f"{point} (MPa, mm), from one trial with one independent reading a mm and errors of "
            f"{instrument.force_sd:.3g} N and {instrument.displacement_sd:.3g} mm (sd). They do not include the "
            "model's own error. 'Others within their ranges' means that all but C10 and C20 of the deep tissue "
            "are known before the test, with the ranges above as 95 % intervals of their logarithms. A parameter is "
            "called determined when it is known within 50 %."
        ),
        web.Prose(
            "Combinations of parameters at full depth (eigenvectors of the information), the best determined first, "
            "each with its standard deviation:"
        ),
        web.Bullets(_eigenvectors(found, depth)),
        *([web.Bullets(moved)] if (moved := _moved(found, depth)) else []),
    ]


def _eigenvectors(found: Information, depth: float) -> list[str]:
    lines = []
    spread, vectors = found.directions(depth)
    for k, sd in enumerate(spread):
        parts = " ".join(f"{v:+.2f} ln {label_of(name)}" for v, name in zip(vectors[:, k], found.names, strict=True))
        lines.append(f"{100 * sd:.2g} % (sd): {parts}" if sd < 1 else f"not determined: {parts}")
    return lines


def _moved(found: Information, depth: float) -> list[str]:
    return [
        f"If {in_words(assumed)} is assumed 10 % too high, C10 of the deep tissue changes by {10 * first:+.1f} % and "
        f"C20 by {10 * second:+.1f} %."
        for assumed, (first, second) in found.biases(depth).items()
    ]
