"""A leg in closed form, for the tests of identification: fast, with exact derivatives."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from making import write_subject

from legfem.curve import ForceCurve
from legfem.identify.forward import DeepTissue, ForwardOutcome
from legfem.identify.identification import Identification, measured_curve
from legfem.identify.result import IdentificationResult
from legfem.identify.settings import IdentificationSettings
from legfem.identify.solver import FullSolver
from legfem.identify.store import SolveStore
from legfem.progress import Silent
from legfem.recording import Instrument, Recording
from legfem.subject import Subject, load_subject

DEPTH = 20.0
LAWS = ("neo-hookean", "reduced-polynomial")


class Killed(BaseException):
    """The process is ended here."""


@dataclass
class AnalyticLeg:
    """Deep tissue in series with fat: F = a (d + b d^2) C10 / (1 + C10 / 6) + c C20 d^3."""

    softest: float = 0.0
    """kPa: below this C10 a solve stops at 12 mm."""
    killed_after: int = 10**9
    calls: int = field(default=0)

    def fingerprint(self) -> Mapping[str, Any]:
        return {"model": "analytic"}

    def solve(self, deep: DeepTissue) -> ForwardOutcome:
        if self.calls >= self.killed_after:
            raise Killed
        self.calls += 1
        complete = deep.C10 >= self.softest
        d = np.linspace(0.0, DEPTH if complete else 12.0, 41)
        soft = 1 + deep.C10 / 6
        rise, cubic = 0.35 * (d + 0.04 * d**2), 6e-4 * d**3
        force = rise * deep.C10 / soft + cubic * deep.C20
        by = {
            "deep.C10": 1e3 * rise / soft**2,
            "deep.C20": 1e3 * cubic,
            "superficial.C10": 10 * force,
            "fascia.C10": 0.5 * force,
        }
        return ForwardOutcome(
            deep, ForceCurve(d, force, by), complete, "" if complete else "made to stop", 10, 0.0
        )


def pressed_leg(
    folder: Path, c10: float, c20: float, seed: int = 0, trials: int = 3, noise: float = 0.03
) -> Subject:
    """Return a subject whose recordings are the analytic leg's, with noise (N) and 0.02 mm."""
    rng = np.random.default_rng(seed)
    curve = AnalyticLeg().solve(DeepTissue(c10, c20, math.inf)).curve
    time = np.arange(0.0, DEPTH / 0.4 + 0.05, 0.1)
    d = np.minimum(0.4 * time, DEPTH)
    recordings = tuple(
        Recording(
            time,
            d + 0.02 * rng.standard_normal(len(d)),
            curve(d) + noise * rng.standard_normal(len(d)),
            f"trial{k + 1}",
        )
        for k in range(trials)
    )
    made = folder if (folder / "subject.toml").exists() else write_subject(folder)
    leg = load_subject(made, need_recordings=False)
    return replace(leg, recordings=recordings, instrument=Instrument(max(noise, 1e-3), 0.02))


def identify(
    subject: Subject,
    settings: IdentificationSettings | None = None,
    model: AnalyticLeg | None = None,
    solves: Path | None = None,
    laws: tuple[Any, ...] = LAWS,
) -> list[IdentificationResult]:
    """Return the results of laws, by default both."""
    model = model or AnalyticLeg()
    store = None if solves is None else SolveStore(solves, model.fingerprint())
    with FullSolver(model, store, 1, Silent()) as solver:
        return Identification(
            subject, measured_curve(subject), solver, settings or IdentificationSettings()
        ).identify(laws)
