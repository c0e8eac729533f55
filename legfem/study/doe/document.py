"""``result.json`` of a study: every number with its unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from legfem.common.documents import json_types
from legfem.common.units import FloatArray
from legfem.common.versions import versions_of
from legfem.study.doe.anova import LEVEL
from legfem.study.doe.effects import omitted_terms
from legfem.study.doe.study import MetricAnalysis, StudyResult
from legfem.study.doe.verdict import Verdict, verdicts


def study_document(result: StudyResult, seed: int, wall_s: float) -> dict[str, Any]:
    """Return the result as plain types."""
    definition = result.definition
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
        "failed_runs": [
            {"run": n, "reached_mm": result.records[n - 1].reached, "reason": result.records[n - 1].reason}
            for n in result.failed
        ],
        "degrees_of_freedom_count": result.counting,
        "significance_level": LEVEL,
        "metrics": [_metric(analysis) for analysis in result.analyses],
        "not_analysed": [{"metric": m.name, "why": why} for m, why in result.not_analysed],
        "numerical_error": _numerics(result),
        "sobol": _sobol(result),
        "information": _information(result),
        "claims": verdict_documents(verdicts([result]), [definition.title]),
    }
    plain: dict[str, Any] = json_types(document)
    return plain


def versions() -> dict[str, str]:
    """Return those of the programs that make a study."""
    return versions_of("legfem", "fenics-dolfinx", "statsmodels", "SALib", "pyDOE3")


def verdict_documents(found: Sequence[Verdict], titles: Sequence[str]) -> list[dict[str, Any]]:
    """Return the claims as plain types."""
    return [
        {
            "claim": verdict.claim,
            "verdict": verdict.verdict,
            "findings": [
                {"study": title, **asdict(finding)} for title, finding in zip(titles, verdict.findings, strict=True)
            ],
        }
        for verdict in found
    ]


def _metric(a: MetricAnalysis) -> dict[str, Any]:
    found = a.anova
    contrasts = None
    if a.lenth is not None:
        contrasts = {
            "values": _by(a.lenth.terms, a.lenth.values),
            "pseudo_standard_error": a.lenth.pseudo_standard_error,
            "margin": a.lenth.margin,
            "simultaneous_margin": a.lenth.simultaneous_margin,
            "omitted_beyond_margin": omitted_terms(a.lenth, a.surface),
        }
    return {
        "metric": a.metric.name,
        "unit": a.metric.unit,
        "runs_missing": list(a.surface.missing),
        "formula": a.surface.formula,
        "anova": {
            "ssr": found.ssr,
            "msr": found.msr,
            "sse": found.sse,
            "mse": found.mse,
            "r_squared": found.r_squared,
            "predicted_r_squared": found.predicted_r_squared,
            "F": found.F,
            "p_value": found.p_value,
            "model_dof": found.model_dof,
            "error_dof": found.error_dof,
        },
        "coefficients": [{**asdict(t), "significant": t.significant} for t in a.tests],
        "lenth": contrasts,
        "centre_curvature": None if a.centre is None else asdict(a.centre),
        "normality_p_values": {"outputs": asdict(a.outputs), "residuals": asdict(a.residuals)},
    }


def _numerics(result: StudyResult) -> dict[str, Any] | None:
    found = result.numerics
    if found is None:
        return None
    return {
        "runs": list(found.runs),
        "metrics": {
            metric.name: {
                "unit": metric.unit,
                "default": found.default[:, k].tolist(),
                "refined": found.refined[:, k].tolist(),
                "relative_error": found.relative[:, k].tolist(),
                "bound_on_a_coefficient": found.bound(result.table, metric),
            }
            for k, metric in enumerate(found.metrics)
        },
    }


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
    found = result.information
    if found is None:
        return None
    spread, vectors = found.directions(result.definition.depth)
    return {
        "parameters": list(found.names),
        "nominal_MPa_mm": list(found.nominal),
        "displacement_mm": found.displacement.tolist(),
        "force_N": found.force.tolist(),
        "sensitivity_N_per_log": found.sensitivity.T.tolist(),
        "noise_sd_N": found.noise_sd.tolist(),
        "relative_sd_all_unknown": {
            f"{depth:g} mm": found.relative_sd(depth).tolist()
            for depth in sorted({end for _, end in result.definition.windows})
        },
        "relative_sd_others_within_ranges": {
            f"{depth:g} mm": found.relative_sd(depth, within_ranges=True).tolist()
            for depth in sorted({end for _, end in result.definition.windows})
        },
        "eigenvectors": vectors.T.tolist(),
        "eigenvector_relative_sd": spread.tolist(),
        "told_within_50_percent_from_mm": {name: found.told_from(name, within_ranges=True) for name in found.names},
    }


def _by(names: Sequence[str], values: FloatArray) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True)}
