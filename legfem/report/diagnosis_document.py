"""``diagnosis.json``: everything that was found, with units."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Protocol

import numpy as np

from legfem.common.documents import json_types, versions_of
from legfem.common.units import mpa_to_kpa
from legfem.data.recording import Origin
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, key_of
from legfem.inverse.document import estimate_document, fitted_document
from legfem.inverse.estimates import Estimate
from legfem.inverse.explanation import Explanation
from legfem.inverse.fit import r_squared
from legfem.inverse.linearised import LinearisedFit
from legfem.inverse.location import runs
from legfem.inverse.notice import FitNotice
from legfem.inverse.predictive import HeldOut, checks_by_phase
from legfem.inverse.stored import SCHEMAS
from legfem.inverse.verdict import Diagnosis, answer_of, explained_share, residual_intervals
from legfem.legs.diagnosis import notices_of
from legfem.legs.subject import Subject
from legfem.report.diagnosis_sentences import next_experiments
from legfem.report.further_channels import channel_misfits, channel_sentences

SCHEMA = SCHEMAS["diagnosis.json"]


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
        """Origin of the recordings."""
        ...


def kind_of(subject: Recorded) -> str:
    """Return what was pressed, in a word."""
    return "Subject" if isinstance(subject, Subject) else "Specimen"


def document(found: Diagnosis, subject: Recorded, seed: int, seconds: float) -> dict[str, Any]:
    """Return the diagnosis as JSON types; what isn't finite is null."""
    posterior, base = found.base_model.posterior, found.base
    notices = notices_of(found, subject)
    return json_types(
        {
            "schema": SCHEMA,
            "kind": found.kind,
            "subject": subject.id,
            "title": subject.title,
            "origin": subject.origin,
            "laws": {found.law: {**fitted_document(found.best_fit, _key), "verdict": found.verdict}},
            "answer": answer_of(found, sum(one.code == FitNotice.DOUBTFUL for one in notices)).document(),
            "notices": [asdict(one) for one in notices],
            "verdict": found.verdict,
            "probability_that_nothing_shows": found.explained.adequacy,
            "statements": [
                {
                    "mechanisms": list(one.names),
                    "unknown": one.unnamed,
                    "like": list(one.like),
                    "probability": one.probability,
                }
                for one in found.explained.statements()
                if one.nothing_shows or one.probability > 1e-4
            ],
            "explanations": [
                {
                    "mechanisms": list(e.names),
                    "unknown": e.unnamed,
                    "probability": e.probability,
                    "log_evidence": e.posterior.log_evidence,
                    "parameters": {key_of(name): _parameter(e, name) for name in e.fit.stiffness},
                }
                for e in found.explained.every
                if e.probability > 1e-4
            ],
            "noise": {
                "force_sd_N": found.errors.noise.force_sd,
                "white_sd_N": found.errors.noise.white_sd,
                "correlation_time_s": found.errors.noise.correlation_time,
                "displacement_wander_sd_mm": found.errors.noise.wander_sd,
                "gain_sd": found.best.posterior.gain_sd,
                "zero_sd_N": found.best.posterior.zero_sd,
                "source": found.errors.noise.source,
            },
            "first_contact": [
                # As found in the recording, moved by the fit.
                {"trial": trial, "displacement_mm": at, "ci95": list(interval)}
                for k, trial in enumerate(found.observed.trials)
                for at, interval in (found.first_contact(k),)
            ],
            "base_model": {
                **fitted_document(base, _key),
                "cylinder_ends": found.with_ends,
                "p_value": found.assessment.p_value,
                "lack_of_fit_p_value": found.assessment.lack_of_fit,
                "r_squared": base.cost.r_squared,
                "held_out_rmse_N": found.base_held_out.rmse,
                "held_out_noise_N": found.base_held_out.noise,
                "held_out": found.base_held_out.how,
                "emulator_error": found.emulator_error,
            },
            "not_known_exactly": [
                {"what": name, "departure_in_sd": float(z)}
                for name, z in zip(found.errors.names, posterior.effects, strict=True)
            ],
            "channels": [asdict(one) for one in channel_misfits(found)],
            "beside_the_force": list(channel_sentences(found)),
            "measured": [asdict(one) for one in (subject.measured if isinstance(subject, Subject) else ())],
            "mismatch": mismatches(found),
            "physics": [
                entry
                for model, held in zip(found.models, found.held_out, strict=True)
                for entry in _physics(found, model, held)
            ],
            "models": [
                {
                    "mechanisms": list(model.names),
                    "probability": model.probability,
                    "in_part": model.in_part,
                    "explained_share_of_misfit": explained_share(found, model),
                    "remains": [asdict(r) for r in residual_intervals(found, model)],
                    "held_out_rmse_N": held.rmse,
                    "confirmed_by_full_solutions": model.confirmed,
                }
                for model, held in zip(found.models, found.held_out, strict=True)
            ],
            "indistinguishable": indistinguishable(found.models),
            "score_tests": [
                {
                    "name": score.name,
                    "statistic": score.statistic,
                    "p_value": score.p_value,
                    "share_concealed_by_refit": score.concealed,
                }
                for score in found.assessment.scores
            ],
            "upper_limits": [
                {
                    "name": limit.name,
                    "parameter": limit.parameter,
                    "unit": limit.unit,
                    "between": [limit.low, limit.high],
                    "open": [limit.open_low, limit.open_high],
                    "greatest_change_of_force_N": limit.effect,
                    "stiffness_kPa": {
                        n.removeprefix("deep."): list(map(mpa_to_kpa, ends)) for n, ends in limit.stiffness.items()
                    },
                    "unseen": [
                        {"at": dict(end.values), "open": end.open, "C10_kPa": mpa_to_kpa(end.c10)} for end in limit.ends
                    ],
                }
                for limit in found.limits
            ],
            "set_aside": None
            if found.aside is None
            else {
                "trial": found.aside.trial,
                "phases": list(found.aside.phases),
                "greatest_departure_N": found.aside.size_N,
            },
            "by_phase": [
                {"mechanisms": list(model.names), **asdict(check)}
                for model in (found.weighted_base, *found.models)
                for check in checks_by_phase(model)
            ],
            "untested": found.untested,
            "next_experiment": next_experiments(found),
            "full_solutions": found.solutions,
            "seed": seed,
            "wall_s": seconds,
            "versions": versions(),
        }
    )


def versions() -> dict[str, str]:
    """Return those of the programs that a diagnosis rests on."""
    return versions_of("legfem", "dolfinx", "python")


def r_squared_of(fitted: LinearisedFit, found: Diagnosis) -> float:
    """Return the coefficient of determination over all forces."""
    return r_squared(float(np.sum(fitted.residual[found.observed.data.spans[0]] ** 2)), found.observed.force)


def mismatches(found: Diagnosis) -> list[dict[str, Any]]:
    """Return the intervals in which the base model errs by more than a trial's noise."""
    observed, base = found.observed, found.base_model.fit
    result = []
    for k, trial in enumerate(observed.trials):
        for segment in np.unique(observed.segment[observed.trial == k]):
            here = np.flatnonzero((observed.trial == k) & (observed.segment == segment))
            for first, end in runs(found.located[here].astype(int)):
                run = here[first:end]
                touching = [w.p_value for w in found.assessment.windows if set(w.stations) & set(map(int, run))]
                d, t = observed.displacement[run], observed.time[run]
                result.append(
                    {
                        "trial": trial,
                        "phase": str(observed.phase[run[0]]),
                        "displacement_mm": [float(d.min()), float(d.max())],
                        "time_s": [float(t.min()), float(t.max())],
                        "size_N": float(base.residual[run].mean()),
                        "p_value": min([*touching, found.assessment.p_value]),
                    }
                )
    return result


def _physics(found: Diagnosis, model: Explanation, held: HeldOut) -> list[dict[str, Any]]:
    entries = []
    for mechanism in model.fit.mechanisms:
        score = found.assessment.score(mechanism.name)
        gain = model.posterior.log_evidence - found.weighted_base.posterior.log_evidence
        entries.append(
            {
                "name": mechanism.name,
                "statement": mechanism.statement,
                "together_with": [n for n in model.names if n != mechanism.name],
                "probability": model.probability,
                "parameters": {p.name: _parameter(model, f"{mechanism.name}.{p.name}") for p in mechanism.parameters},
                "evidence": {
                    # Twice the logarithm of the Bayes factor: what BIC estimates.
                    "delta_bic": 2 * gain,
                    "log_bayes_factor": gain,
                    "p_value": score.p_value if score else None,
                    "held_out_rmse_before_N": found.base_held_out.rmse,
                    "held_out_rmse_after_N": held.rmse,
                },
            }
        )
    return entries


def indistinguishable(models: Sequence[Explanation]) -> list[list[str]]:
    """Return the set of names that the data can't tell apart, if there is one."""
    if len(models) < 2:
        return []
    names = [set(model.names) for model in models]
    common = set.intersection(*names)
    return [sorted(set.union(*names) - common)]


def diagnosed_parameters(found: Mapping[str, Estimate]) -> dict[str, Any]:
    """Return estimates by key: ``c10_deep``, a mechanism's by its full name."""
    return {_key(name): estimate_document(one) for name, one in found.items()}


def parameter_rows(found: Diagnosis) -> Iterator[dict[str, Any]]:
    """Yield a row a parameter of the base model and of the repaired one."""
    for when, model in (("before repair", found.base.estimates), ("after repair", found.estimates)):
        for name, one in diagnosed_parameters(model).items():
            low, high = one["ci95"]
            numbers = {key: one[key] for key in ("value", "unit", "identifiability")}
            yield {"model": when, "parameter": name, "low": low, "high": high, **numbers}


def _key(name: str) -> str:
    return key_of(name) if name in (DEEP_C10, DEEP_C20) else name


def _parameter(model: Explanation, name: str) -> dict[str, Any]:
    shown = model.shown(name)
    return {"value": shown.value, "unit": shown.unit, "ci95": list(shown.ci95)}
