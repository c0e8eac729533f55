"""A study's numbers: its tables and their chapters, what to measure by them, and ``result.json``."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd

from legfem.common.documents import Cells, row_cells, versions_of
from legfem.common.units import FloatArray
from legfem.report import page as web
from legfem.report.curves import Curves, Line
from legfem.report.words import TOLD
from legfem.study.doe.design import Definition, in_words, label_of
from legfem.study.doe.figures import STAGE_COLOURS
from legfem.study.doe.information import IDENTIFIED, IDENTIFIED_WITHIN, Information
from legfem.study.doe.runs import NumericalError
from legfem.study.doe.study import StudyResult
from legfem.study.doe.surface import LEVEL, MetricAnalysis

UNITS_NOTE = "Sums of squares in (N/mm²)² for slopes and (N/mm³)² for curvatures."


def anova_cells(result: StudyResult) -> Cells:
    """Analysis of variance, as in Table 3 of Frauziols et al. and with more columns."""
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


def _effects_row(a: MetricAnalysis) -> dict[str, str]:
    """What a statistician looks at beside the t tests: Lenth's limits, curvature, normality."""
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


def _numerics_rows(result: StudyResult, found: NumericalError) -> Iterator[dict[str, str]]:
    """Yield the numerical errors of each metric beside the effects."""
    for k, metric in enumerate(found.metrics):
        bound = found.bound(result.table, metric)
        tests = next((a.tests[1:] for a in result.analyses if a.metric == metric), ())
        below = sum(t.significant and abs(t.value) < bound for t in tests)
        errors = zip(found.runs, found.relative[:, k], strict=True)
        yield {
            "metric": metric.label,
            **{f"run {number}": f"{value:+.2%}" for number, value in errors},
            "bound on a coefficient": f"{bound:.1e}",
            "of the largest": f"{bound / max(abs(t.value) for t in tests):.2%}" if tests else "-",
            "significant ones below it": f"{below}" if tests else "-",
        }


def _information_rows(found: Information, depths: Sequence[float]) -> Iterator[dict[str, str]]:
    """Yield 95 % half-widths by depth, and the least depth from which each parameter is identified to 50 %."""
    pair = [name for name in IDENTIFIED if name in found.names]
    for k, name in enumerate(found.names):
        told = found.told_from(name, within_ranges=True)
        sds = {
            f"alone, at {', '.join(f'{d:g}' for d in depths)} mm": [found.relative_sd(d, [name])[0] for d in depths],
            "deep pair unknown": [found.relative_sd(d, pair)[pair.index(name)] for d in depths if name in pair],
            "others within their ranges": [found.relative_sd(d, within_ranges=True)[k] for d in depths],
            "all unknown": [found.relative_sd(d)[k] for d in depths],
        }
        halves = {
            column: ", ".join(f"{1.96 * sd:.1%}" if 1.96 * sd < 10 else "> 1000 %" for sd in values) or "-"
            for column, values in sds.items()
        }
        known = "never" if told is None else f"{told:g} mm"
        yield {"parameter": label_of(name), **halves, "others within ranges: determined from": known}


def versions() -> dict[str, str]:
    """Versions of the programs that make a study."""
    return versions_of("legfem", "fenics-dolfinx", "statsmodels", "SALib", "pyDOE3")


def study_document(result: StudyResult, seed: int, wall_s: float) -> dict[str, Any]:
    """Result as a document: every number with its unit."""
    definition = result.definition
    stopped = [(number, result.outcomes[number - 1]) for number in result.failed]
    return {
        "schema": 1,
        "study": "doe",
        "title": definition.title,
        "subject": result.subject.id,
        "origin": result.subject.origin,
        "seed": seed,
        "wall_s": wall_s,
        "versions": versions(),
        "forward_solves": len(result.outcomes),
        "depth_mm": definition.depth,
        "windows_mm": [list(window) for window in definition.windows],
        "factors": [asdict(factor) for factor in definition.factors],
        "failed_runs": [{"run": n, "reached_mm": r.reached, "reason": r.reason} for n, r in stopped],
        "significance_level": LEVEL,
        "metrics": [_metric(analysis) for analysis in result.analyses],
        "not_analysed": [{"metric": m.name, "why": why} for m, why in result.not_analysed],
        "numerical_error": None if result.numerics is None else _numerics(result.numerics, result.table),
        "sobol": _sobol(result),
        "information": None if result.information is None else _information(result.information, definition),
    }


def _metric(a: MetricAnalysis) -> dict[str, Any]:
    contrasts = None
    if a.lenth is not None:
        limits = {name: getattr(a.lenth, name) for name in ("pseudo_standard_error", "margin", "simultaneous_margin")}
        omitted = [term for term in a.lenth.beyond if term not in a.fit.params]
        contrasts = {"values": _by(a.lenth.terms, a.lenth.values), **limits, "omitted_beyond_margin": omitted}
    return {
        "metric": a.metric.name,
        "unit": a.metric.unit,
        "runs_missing": list(a.missing),
        "formula": a.fit.model.formula,
        "anova": asdict(a.anova),
        "coefficients": [{**asdict(t), "significant": t.significant} for t in a.tests],
        "lenth": contrasts,
        "centre_curvature": None if a.centre is None else asdict(a.centre),
        "normality_p_values": {"outputs": asdict(a.outputs), "residuals": asdict(a.residuals)},
    }


def _numerics(found: NumericalError, table: pd.DataFrame) -> dict[str, Any]:
    metrics = {
        metric.name: {
            "unit": metric.unit,
            "default": found.default[:, k],
            "refined": found.refined[:, k],
            "relative_error": found.relative[:, k],
            "bound_on_a_coefficient": found.bound(table, metric),
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


def _information(found: Information, definition: Definition) -> dict[str, Any]:
    spread, vectors = found.directions(definition.depth)
    sds = {
        name: {f"{depth:g} mm": found.relative_sd(depth, within_ranges=within) for depth in definition.ends}
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
    if result.numerics is not None:
        caption = "Numerical errors, and how much they can change a coefficient"
        table = web.WebTable.of(caption, _numerics_rows(result, result.numerics))
        chapters.append(web.Chapter("Numerical error of the metrics", [table, web.Prose(TOLD["finer_mesh"])]))
    if result.sobol:
        labels = [f.label for f in result.definition.factors]
        rows = (
            {
                "metric": s.metric.label,
                **{name: f"{one:.3f}, {all_:.3f}" for name, one, all_ in zip(labels, s.first, s.total, strict=True)},
                "sum of first": f"{s.first.sum():.3f}",
                "emulator's rms error / sd": f"{s.error.relative:.2%} ({s.error.points} runs)",
            }
            for s in result.sobol
        )
        table = web.WebTable.of("First order, total", rows)
        chapters.append(web.Chapter("Sobol indices", [table, web.Prose(TOLD["sobol"])]))
    return chapters


def _variance(result: StudyResult) -> list[web.Block]:
    effects = "Effects without an error estimate (Lenth), curvature at the centre, normality"
    return [
        web.Bullets(result.run_notes()),
        web.Prose(f"{UNITS_NOTE} {TOLD['degrees_of_freedom']}"),
        web.WebTable("Analysis of variance of each metric", *anova_cells(result)),
        web.WebTable.of(effects, map(_effects_row, result.analyses), folded=True),
        web.Prose(TOLD["lack_of_fit"]),
    ]


_UNSEEN = 0.01
"""Share of a metric's variation below which a factor doesn't show."""


def not_seen(result: StudyResult) -> list[str]:
    """Factors whose shares are small in every metric."""
    every = [analysis.shares()[0] for analysis in result.analyses]
    return [in_words(f.name) for f in result.definition.factors if all(main[f.symbol] < _UNSEEN for main in every)]


def to_know(result: StudyResult) -> str:
    """Say which assumed parameter moves the identified ones most."""
    ranked = _ranked_biases(result)
    if not ranked:
        return "Not computed: run it without --factorial-only."
    name, errors = ranked[0]
    moved = " and ".join(
        f"{in_words(one)} {abs(10 * error):.0f} % too {'high' if error > 0 else 'low'}"
        for one, error in zip(IDENTIFIED, errors, strict=True)
    )
    assumed = in_words(name)
    return f"{assumed[:1].upper()}{assumed[1:]} matters most: if it is assumed 10 % too high, the test gives {moved}."


def to_measure(result: StudyResult) -> list[str]:
    """Say what to measure, the most important first."""
    information, depth = result.information, result.definition.depth
    ranked = _ranked_biases(result)
    if information is None or not ranked:
        return ["Run it without --factorial-only: then it says how well each parameter can be known."]
    sds = dict(zip(information.names, information.relative_sd(depth, within_ranges=True), strict=True))
    within = {name: 1.96 * sds[name] for name in IDENTIFIED}
    halves = " and ".join(
        f"{in_words(name)} to within {100 * half:.0f} %" if half < 1 else f"no value of {in_words(name)}"
        for name, half in within.items()
    )
    if all(half <= IDENTIFIED_WITHIN for half in within.values()):
        first = f"Press {depth:g} mm deep: with fat and fascia known within their ranges, one trial gives {halves}."
    else:
        first = TOLD["one_press_is_little"].format(depth=depth, halves=halves, first=in_words(ranked[0][0]))
    depths = {n: information.told_from(n, within_ranges=True) for n in information.names if n in IDENTIFIED}
    return [
        first,
        *(
            f"{in_words(name)} is known to within 50 % from a depth of {at:g} mm."
            if at is not None
            else f"{in_words(name)} is not known to within 50 % at any depth while fat and fascia are only known "
            "within their ranges: do not identify it from this test alone."
            for name, at in depths.items()
        ),
        f"These assumed values matter, the most important first: {', '.join(in_words(name) for name, _ in ranked)}.",
    ]


def _ranked_biases(result: StudyResult) -> list[tuple[str, list[float]]]:
    """Errors of the identified parameters by the assumed one that makes them, the largest first."""
    found = {} if result.information is None else result.information.biases(result.definition.depth)
    return sorted(found.items(), key=lambda pair: -max(map(abs, pair[1])))


def information_blocks(result: StudyResult) -> list[web.Block]:
    """Return what a curve to each depth tells of the parameters; nothing where it isn't known."""
    found, definition = result.information, result.definition
    if found is None:
        return []
    depth, instrument = definition.depth, result.subject.instrument
    caption = "Smallest possible 95 % half-widths of the parameters, by depth"
    point = ", ".join(f"{label_of(name)} {value:.4g}" for name, value in zip(found.names, found.nominal, strict=True))
    directions = []
    for sd, vector in zip(*(one.T for one in found.directions(depth)), strict=True):
        parts = " ".join(f"{v:+.2f} ln {label_of(name)}" for v, name in zip(vector, found.names, strict=True))
        directions.append(f"{100 * sd:.2g} % (sd): {parts}" if sd < 1 else f"not determined: {parts}")
    moved = [
        f"If {in_words(assumed)} is assumed 10 % too high, C10 of the deep tissue changes by {10 * first:+.1f} % and "
        f"C20 by {10 * second:+.1f} %."
        for assumed, (first, second) in found.biases(depth).items()
    ]
    return [
        web.WebTable.of(caption, _information_rows(found, definition.ends)),
        _half_widths(found),
        web.Prose(TOLD["half_widths_of_study"].format(point=point, instrument=instrument) + TOLD["information"]),
        web.Prose(TOLD["combinations"]),
        web.Bullets(directions),
        *([web.Bullets(moved)] if moved else []),
    ]


def _half_widths(found: Information) -> Curves:
    widths = 1.96 * np.array([found.relative_sd(float(d), within_ranges=True) for d in found.displacement])
    shown = np.where(widths < 1, 100 * widths, np.nan)
    return Curves(
        "information",
        TOLD["half_widths"],
        f"; lines begin at 100 %. A parameter is determined below {100 * IDENTIFIED_WITHIN:.0f} %.",
        found.displacement,
        "depth of the recorded curve (mm)",
        "half-width (% of the parameter)",
        [
            Line(label_of(name), shown[:, k], None, STAGE_COLOURS[k % len(STAGE_COLOURS)])
            for k, name in enumerate(found.names)
        ],
    )
