"""``diagnosis.json``: everything that was found, values by their fields' names."""

from collections.abc import Iterator, Mapping
from typing import Any

from legfem.common.documents import json_types, versions_of
from legfem.inverse.averaging import left_open
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, key_of
from legfem.inverse.claims import checked_answer
from legfem.inverse.document import estimate_document, fitted_document, members_of
from legfem.inverse.estimates import Estimate
from legfem.inverse.explanation import Explanation
from legfem.inverse.fit import Identity
from legfem.inverse.predictive import HeldOut, checks_by_phase
from legfem.inverse.stored import SCHEMAS
from legfem.inverse.verdict import Diagnosis, explained_share, residual_intervals
from legfem.legs.diagnosis import notices_of
from legfem.legs.subject import Subject
from legfem.report.diagnosis_curves import model_name, places_of
from legfem.report.diagnosis_sentences import next_experiments
from legfem.report.further_channels import channel_misfits

SCHEMA = SCHEMAS["diagnosis.json"]
type Recorded = Subject | Identity
"""Whose recordings they are: a leg's, or another body's that was pressed."""


def document(found: Diagnosis, subject: Recorded, seconds: float) -> dict[str, Any]:
    """Return the diagnosis as JSON types, its values by their fields' names; what isn't finite is null."""
    notices, explained = notices_of(found, subject), found.explained
    said = [one for one in explained.statements() if one.nothing_shows or one.probability > _LEAST]
    return json_types(
        {
            "schema": SCHEMA,
            "units": "N, mm, s and MPa where neither a name nor the entry itself states another",
            "kind": found.kind,
            "subject": subject.id,
            **members_of(subject, "title", "origin"),
            "answer": checked_answer(found, notices).document(),
            "notices": notices,
            "verdict": found.verdict,
            "laws": {found.law: {**fitted_document(found.best_fit, _key), "verdict": found.verdict}},
            "base_model": {
                **fitted_document(found.base, _key),
                "cylinder_ends": found.with_ends,
                **members_of(found.assessment, "p_value", "lack_of_fit"),
                "held_out": found.base_held_out,
                **members_of(found, "emulator_error", "misfit"),
            },
            "explanations": [
                {
                    "mechanisms": one.names,
                    "unknown": one.unnamed,
                    "probability": one.probability,
                    "log_evidence": one.posterior.log_evidence,
                    "parameters": {key_of(name): one.shown(name) for name in one.fit.stiffness},
                }
                for one in explained.every
                if one.probability > _LEAST
            ],
            "statements": said,
            "models": [_model(found, *each) for each in zip(found.models, found.held_out, strict=True)],
            "noise": found.errors.noise,
            "gain_sd": found.best.posterior.gain_sd,
            "zero_sd_N": found.best.posterior.zero_sd,
            "first_contact_mm": {trial: found.first_contact(k) for k, trial in enumerate(found.observed.trials)},
            "moved_by_sd": dict(zip(found.errors.names, found.base_model.posterior.effects, strict=True)),
            "channels": channel_misfits(found),
            "measured": subject.measured if isinstance(subject, Subject) else (),
            **members_of(found.assessment, "windows", "scores"),
            "places": places_of(found),
            **members_of(found, "limits", "untested", "seed"),
            "set_aside": None if found.aside is None else members_of(found.aside, "trial", "phases", "size_N"),
            "by_phase": {
                model_name(model): [*checks_by_phase(model)] for model in (found.weighted_base, *found.models)
            },
            "next_experiment": next_experiments(found),
            "full_solutions": found.solutions,
            "left_open": left_open(found.explained, DEEP_C10),
            "wall_s": seconds,
            "versions": versions(),
        }
    )


_LEAST = 1e-4
"""Probability from which an explanation is written."""


def _model(found: Diagnosis, model: Explanation, held: HeldOut) -> dict[str, Any]:
    """Return an explanation that is listed, with what speaks for each of its mechanisms."""
    return {
        "mechanisms": [
            {
                **members_of(mechanism, "name", "statement"),
                "score": found.assessment.score(mechanism.name),
                "parameters": {p.name: model.shown(f"{mechanism.name}.{p.name}") for p in mechanism.parameters},
            }
            for mechanism in model.fit.mechanisms
        ],
        **members_of(model, "probability", "in_part"),
        "log_bayes_factor": model.posterior.log_evidence - found.weighted_base.posterior.log_evidence,
        "explained_share_of_misfit": explained_share(found, model),
        "remains": residual_intervals(found, model),
        "held_out": held,
        "confirmed_by_full_solutions": model.confirmed,
    }


def versions() -> dict[str, str]:
    """Return those of the programs that a diagnosis rests on."""
    return versions_of("legfem", "dolfinx", "python")


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
