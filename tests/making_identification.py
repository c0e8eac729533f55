"""A leg in closed form, for the tests of identification: fast, with exact derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from making import write_subject

from legfem.common.progress import Silent
from legfem.data import Instrument, Recording
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.fit import Fit
from legfem.inverse.outcome import FullSolver, JointForward, Outcome
from legfem.inverse.parameter import Parameter
from legfem.inverse.problem import fit_with
from legfem.inverse.settings import IdentificationSettings, SearchRequest
from legfem.legs.details import LegDetails
from legfem.legs.identification import as_leg
from legfem.legs.loading import load_subject
from legfem.legs.problem import leg_problem
from legfem.legs.site import beyond_of
from legfem.legs.subject import LegAccuracy, Subject
from legfem.legs.unknowns import unknown_geometry
from legfem.solve.path import ForceCurve

DEPTH = 20.0
LAWS = ("neo-hookean", "reduced-polynomial")


class Killed(BaseException):
    """The process is ended here."""


@dataclass
class AnalyticLeg:
    """Deep tissue in series with fat: a (d + b d^2) C10 / (1 + C10 / 3 fat) + c C20 d^3 + ..."""

    softest: float = 0.0
    """kPa: below this C10 a solve stops at 12 mm."""
    killed_after: int = 10**9
    compromise: str = ""
    depth: float = DEPTH + 0.5
    early: float = 0.05
    """Of the fat's own share; without it a curve tells what both give together, and no more."""
    calls: int = field(default=0)

    def prepare(self) -> None:
        """Nothing is to be meshed."""

    def fingerprint(self) -> Mapping[str, Any]:
        return {"model": "analytic"}

    @property
    def nominal(self) -> Mapping[str, float]:
        tissues = {"superficial": 2e-3, "fascia": 0.1}
        assumed = {f"{name}.C10": c10 for name, c10 in tissues.items()}
        return {"deep.C10": 1e-3, "deep.D1": 28.0, "deep.C20": 0.0, "deep.D2": 28.0, **assumed}

    def solve(self, values: Mapping[str, float], sensitivities: Sequence[str]) -> Outcome:
        if self.calls >= self.killed_after:
            raise Killed
        self.calls += 1
        every = {**self.nominal, **values}
        deep, fat, stiffening = (1e3 * every[name] for name in ("deep.C10", "superficial.C10", "deep.C20"))
        complete = deep >= self.softest
        d = np.linspace(0.0, self.depth if complete else 12.0, 41)
        soft = 1 + deep / (3 * fat)
        rise, cubic = 0.35 * (d + 0.04 * d**2), 6e-4 * d**3
        # Fat gives way first: its share fades with depth.
        early = self.early * d * np.exp(-d / 6)
        force = rise * deep / soft + cubic * stiffening + early * (fat - 2)
        by = {
            "deep.C10": 1e3 * rise / soft**2,
            "deep.C20": 1e3 * cubic,
            "superficial.C10": 1e3 * (rise * deep**2 / (3 * fat**2) / soft**2 + early),
            "fascia.C10": 0.5 * force,
            "deep.D1": np.zeros(len(d)),
        }
        curve = ForceCurve(d, force, {name: by[name] for name in sensitivities})
        return Outcome(values, (curve,), complete, "" if complete else "made to stop", 10, 0.0, self.compromise)


def curve_of(c10: float, c20: float, fat: float = 2.0) -> ForceCurve:
    """Return the analytic leg's curve for stiffnesses in kPa."""
    values = {"deep.C10": 1e-3 * c10, "deep.C20": 1e-3 * c20, "superficial.C10": 1e-3 * fat}
    return AnalyticLeg().solve(values, ("deep.C10", "deep.C20", "superficial.C10")).curve


def pressed_leg(
    folder: Path, c10: float, c20: float, seed: int = 0, trials: int = 3, noise: float = 0.03, fat: float = 2.0
) -> Subject:
    """Return a subject whose recordings are the analytic leg's, with noise (N) and 0.02 mm, on a stiff rig."""
    rng = np.random.default_rng(seed)
    curve = curve_of(c10, c20, fat)
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
    instrument, stiff = Instrument(max(noise, 1e-3), 0.02), LegAccuracy(rig_sd=0.0)
    return replace(leg, recordings=recordings, instrument=instrument, accuracy=stiff)


def identify(
    subject: Subject,
    settings: IdentificationSettings | None = None,
    model: AnalyticLeg | None = None,
    solves: Path | None = None,
    laws: tuple[Any, ...] = LAWS,
    parameters: Sequence[Parameter] | None = None,
    fixed: Mapping[str, float] | None = None,
    correction: TabulatedCorrection | None = None,
) -> list[Fit[LegDetails]]:
    """Return the results of laws, by default both."""
    model = model or AnalyticLeg(depth=DEPTH + 0.5 + beyond_of(parameters or (), fixed or {}))
    settings = settings or IdentificationSettings()
    request = SearchRequest(parameters, fixed or {}, settings=settings)
    problem = leg_problem(as_leg(subject), laws, request, [correction], JointForward((model,)), unknown_geometry)
    with FullSolver(problem.forward, solves, 1, Silent(), problem.sensitivities) as solver:
        return fit_with(problem, laws, solver, settings)
