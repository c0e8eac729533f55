"""``diagnosis.json``: everything that was found, with units."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from legfem.diagnose.diagnosis import Diagnosis, Repaired
from legfem.diagnose.fit import Fit
from legfem.diagnose.sentences import next_experiments
from legfem.diagnose.windows import runs
from legfem.documents import json_types
from legfem.identify.forward import legfem_version, package_version
from legfem.subject import Origin

SCHEMA = 1


class Recorded(Protocol):
    """Whose recordings they are: a subject, or another body that was pressed."""

    @property
    def id(self) -> str:
        """Short name."""
        ...

    @property
    def title(self) -> str:
        """In words."""
        ...

    @property
    def origin(self) -> Origin:
        """Of the recordings."""
        ...


def document(found: Diagnosis, subject: Recorded, seed: int, seconds: float) -> dict[str, Any]:
    """Return the diagnosis as JSON types; what isn't finite is null."""
    return json_types(
        {
            "schema": SCHEMA,
            "subject": subject.id,
            "origin": subject.origin,
            "law": found.law,
            "verdict": found.verdict,
            "noise": {
                "force_sd_N": found.errors.noise.force_sd,
                "white_sd_N": found.errors.noise.white_sd,
                "correlation_time_s": found.errors.noise.correlation_time,
                "displacement_wander_sd_mm": found.errors.noise.wander_sd,
                "source": found.errors.noise.source,
                "effective_samples": found.errors.effective_samples,
            },
            "base_model": {
                "p_value": found.base.assessment.p_value,
                "lack_of_fit_p_value": found.base.assessment.lack_of_fit,
                "r_squared": r_squared(found.base.fit, found),
                "held_out_rmse_N": found.base_held_out.rmse,
                "held_out_noise_N": found.base_held_out.noise,
                "held_out": found.base_held_out.how,
                "emulator_error": found.emulator_error,
            },
            "mismatch": mismatches(found),
            "physics": [entry for model in found.models for entry in _physics(found, model)],
            "models": [
                {
                    "mechanisms": list(model.fit.names),
                    "bic": model.fit.bic,
                    "p_value": model.candidate.assessment.p_value,
                    "held_out_rmse_N": model.held_out.rmse,
                    "confirmed_by_full_solutions": model.confirmed,
                }
                for model in found.models
            ],
            "indistinguishable": indistinguishable(found.models),
            "score_tests": [
                {
                    "name": score.name,
                    "statistic": score.statistic,
                    "p_value": score.p_value,
                    "share_concealed_by_refit": score.concealed,
                }
                for score in found.base.assessment.scores
            ],
            "untested": found.untested,
            "remarks": list(found.observed.remarks),
            "next_experiment": next_experiments(found),
            "parameters_before": parameters(found.base.fit),
            "parameters_after": parameters(found.models[0].fit if found.models else found.base.fit),
            "full_solutions": found.solutions,
            "seed": seed,
            "wall_s": seconds,
            "versions": {
                "legfem": legfem_version(),
                "dolfinx": package_version("fenics-dolfinx"),
                "python": platform.python_version(),
            },
        }
    )


def r_squared(fitted: Fit, found: Diagnosis) -> float:
    """Return the coefficient of determination over all observations."""
    force = found.observed.force
    return 1.0 - float(np.sum(fitted.residual**2) / np.sum((force - force.mean()) ** 2))


def mismatches(found: Diagnosis) -> list[dict[str, Any]]:
    """Return the intervals in which the base model errs by more than a trial's noise."""
    observed, base = found.observed, found.base
    windows = base.assessment.windows
    result = []
    for k, trial in enumerate(observed.trials):
        for segment in np.unique(observed.segment[observed.trial == k]):
            here = np.flatnonzero((observed.trial == k) & (observed.segment == segment))
            for first, end in runs(found.located[here].astype(int)):
                run = here[first:end]
                touching = [w.p_value for w in windows if set(w.stations) & set(map(int, run))]
                d, t = observed.displacement[run], observed.time[run]
                result.append(
                    {
                        "trial": trial,
                        "phase": str(observed.phase[run[0]]),
                        "displacement_mm": [float(d.min()), float(d.max())],
                        "time_s": [float(t.min()), float(t.max())],
                        "size_N": float(base.fit.residual[run].mean()),
                        "p_value": min([*touching, base.assessment.p_value]),
                    }
                )
    return result


def _physics(found: Diagnosis, model: Repaired) -> list[dict[str, Any]]:
    entries = []
    for mechanism in model.fit.mechanisms:
        score = found.base.assessment.score(mechanism.name)
        entries.append(
            {
                "name": mechanism.name,
                "statement": mechanism.statement,
                "together_with": [n for n in model.fit.names if n != mechanism.name],
                "parameters": {
                    p.name: _parameter(model.fit, f"{mechanism.name}.{p.name}", p.unit)
                    for p in mechanism.parameters
                },
                "evidence": {
                    "delta_bic": found.base.fit.bic - model.fit.bic,
                    "p_value": score.p_value if score else None,
                    "held_out_rmse_before_N": found.base_held_out.rmse,
                    "held_out_rmse_after_N": model.held_out.rmse,
                },
            }
        )
    return entries


def indistinguishable(models: Sequence[Repaired]) -> list[list[str]]:
    """Return the set of names that the data can't tell apart, if there is one."""
    if len(models) < 2:
        return []
    names = [set(model.fit.names) for model in models]
    common = set.intersection(*names)
    return [sorted(set.union(*names) - common)]


def parameters(fitted: Fit) -> dict[str, Any]:
    """Return a fit's parameters with units and intervals."""
    result = {
        f"{name.lower()}_deep": _parameter(fitted, name, "kPa")
        for name in ("C10", "C20")
        if name in fitted.free
    }
    for mechanism in fitted.mechanisms:
        for p in mechanism.parameters:
            name = f"{mechanism.name}.{p.name}"
            result[name] = _parameter(fitted, name, p.unit)
    return result


def _parameter(fitted: Fit, name: str, unit: str) -> dict[str, Any]:
    low, high = fitted.interval(name)
    return {"value": fitted.values[name], "unit": unit, "ci95": [low, high]}
