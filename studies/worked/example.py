"""What an example is, beside its truth: the diagnosis, its files, and a row of the table."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from legfem.common.documents import write_document
from legfem.common.units import mpa_to_kpa
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.verdict import Diagnosis
from legfem.report.diagnosis_curves import recording_figure
from legfem.report.diagnosis_document import Recorded, document, r_squared_of
from legfem.report.results import write_diagnosis_report

FIGURE = "example.png"
"""The recordings with the models, small."""


@dataclass(frozen=True)
class WorkedTruth:
    """What was simulated."""

    c10_kpa: float
    c20_kpa: float
    effect: str
    """Name of the mechanism that the base model leaves out."""
    discretisation: str
    """In words."""


@dataclass(frozen=True)
class ExampleRow:
    """An example's truth beside what was found; stiffnesses in kPa with 95 % intervals."""

    name: str
    truth: WorkedTruth
    verdict: str
    models: tuple[tuple[str, ...], ...]
    """Mechanisms of the models that suit, the best first."""
    base_c10: float
    base_interval: tuple[float, float]
    base_r_squared: float
    base_probability: float
    """Of the base model alone."""
    repaired_c10: float | None
    repaired_interval: tuple[float, float] | None
    """Over all explanations."""
    strength: float | None
    """First parameter of the effect in the best model that has it."""
    strength_interval: tuple[float, float] | None
    held_out_how: str
    held_out_before: float
    """N."""
    held_out_after: float | None
    held_out_noise: float
    """N: what the errors alone would make."""
    solutions: int
    seconds: float

    @property
    def right(self) -> bool:
        """Whether the effect alone was named, or comes first among what isn't told apart."""
        return bool(self.models) and self.models[0] == (self.truth.effect,)

    def document(self) -> dict[str, Any]:
        """Return it as JSON types."""
        return {**asdict(self), "right": self.right, "origin": "simulated"}


def row_of(name: str, truth: WorkedTruth, found: Diagnosis, seconds: float) -> ExampleRow:
    """Return a diagnosis beside its truth."""
    base = found.base
    best = found.models[0] if found.models else None
    own = next((model for model in found.models if truth.effect in model.names), None)
    strength = None
    if own is not None:
        mechanism = next(m for m in own.fit.mechanisms if m.name == truth.effect)
        strength = f"{truth.effect}.{mechanism.parameters[0].name}"
    return ExampleRow(
        name,
        truth,
        found.verdict,
        tuple(model.names for model in found.models),
        mpa_to_kpa(base.value(DEEP_C10)),
        base.shown(DEEP_C10).ci95,
        r_squared_of(base.fit, found),
        base.probability,
        mpa_to_kpa(best.value(DEEP_C10)) if best else None,
        found.shown_interval(DEEP_C10) if best else None,
        own.value(strength) if own is not None and strength else None,
        own.interval(strength) if own is not None and strength else None,
        found.base_held_out.how,
        found.base_held_out.rmse,
        found.held_out[0].rmse if best else None,
        found.base_held_out.noise,
        found.solutions,
        seconds,
    )


def diagnosed(
    name: str, truth: WorkedTruth, subject: Recorded, diagnose: Callable[[], Diagnosis], out: Path
) -> ExampleRow:
    """Diagnose, write diagnosis.json, report and figures into a folder, and return the row."""
    started = time.perf_counter()
    found = diagnose()
    seconds = time.perf_counter() - started
    write_document(out / "diagnosis.json", document(found, subject, 0, seconds))
    write_diagnosis_report(found, subject, out)
    recording_figure(found, 0, subject.title, subject.origin).savefig(out / FIGURE, dpi=80)
    return row_of(name, truth, found, seconds)
