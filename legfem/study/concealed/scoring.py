"""Opening the keys, and what the diagnoses were worth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from legfem.diagnose.fit import Problem, fit
from legfem.diagnose.noise import estimate_errors
from legfem.diagnose.observations import Observations
from legfem.diagnose.predict import Predictor
from legfem.diagnose.run import Diagnoser
from legfem.progress import Silent
from legfem.study.concealed.cases import Case, protocols_of
from legfem.study.concealed.running import case_folders, diagnosis_file
from legfem.study.concealed.seal import read_sealed
from legfem.study.concealed.truth import Truth, blank_observations, force_at
from legfem.subject import load_subject
from legfem.units import FloatArray

LARGEST_SET = 3


@dataclass(frozen=True)
class Scored:
    """One case with its diagnosis."""

    case: Case
    verdict: str
    models: tuple[tuple[str, ...], ...]
    """Named models' mechanisms, the first the best."""
    r_squared: float
    """Of the base model's refit."""
    located: tuple[int, int, int]
    """Observations marked rightly, marked wrongly, missed."""
    bias_before: dict[str, float]
    """Relative errors of C10 and C20 by the base model."""
    bias_after: dict[str, float]
    covered_after: bool | None
    """Whether C10's 95 % interval after repair holds the truth; None where there is none."""
    held_out: tuple[float, float, float]
    """Held-out error before and after repair, and the noise, N."""
    seconds: float
    """Of a processor."""
    full_solutions: int

    @property
    def first(self) -> bool:
        """Whether the best model is the truth."""
        return bool(self.models) and set(self.models[0]) == set(self.case.names)

    @property
    def in_set(self) -> bool:
        """Whether the truth is among a reported set of at most three."""
        near = self.models[:LARGEST_SET] if len(self.models) <= LARGEST_SET else self.models[:1]
        return any(set(model) == set(self.case.names) for model in near)

    @property
    def right(self) -> bool:
        """Whether the verdict is right for its kind of case."""
        if self.case.kind == "none":
            return self.verdict == "consistent"
        if self.case.kind == "outside":
            return self.verdict in ("unexplained", "ambiguous")
        return self.in_set


def score_cases(out: Path, seed: int, diagnoser: Diagnoser) -> list[Scored]:
    """Open every key and compare.

    Raises
    ------
    InputError
        If a key doesn't open, or there are no cases.
    """
    scored = []
    for folder in case_folders(out):
        path = diagnosis_file(out, folder)
        key = read_sealed(out / "keys" / f"{folder.name}.json", seed)
        if path.is_file():
            scored.append(_scored(folder, json.loads(path.read_text()), key, diagnoser))
    return scored


def _scored(
    folder: Path, found: dict[str, Any], key: dict[str, Any], diagnoser: Diagnoser
) -> Scored:
    case = Case.of(key["case"])
    subject = load_subject(folder)
    observed = diagnoser.observations(subject)
    errors = estimate_errors(observed, subject.instrument)
    library, _ = diagnoser.library(subject, observed, Silent())
    truth = Truth(blank_observations(protocols_of(case.protocol)), np.array(key["force_N"]))
    true = _at_stations(truth, observed)
    predictor = Predictor(observed.with_force(true), library, case.law)  # type: ignore[arg-type]
    refit = fit(Problem(predictor, errors), (), {"C10": case.c10_kpa, "C20": case.c20_kpa})
    wrong = np.abs(refit.residual) > errors.trial_sd
    if case.kind == "none":
        wrong[:] = False
    return Scored(
        case,
        found["verdict"],
        tuple(tuple(model["mechanisms"]) for model in found["models"]),
        found["base_model"]["r_squared"],
        _overlap(marked(found, observed), wrong),
        _bias(found["parameters_before"], case),
        _bias(found["parameters_after"], case),
        _covered(found["parameters_after"], case),
        (
            found["base_model"]["held_out_rmse_N"],
            found["models"][0]["held_out_rmse_N"] if found["models"] else float("nan"),
            found["base_model"]["held_out_noise_N"],
        ),
        found["processor_s"],
        found["full_solutions"],
    )


def _at_stations(truth: Truth, observed: Observations) -> FloatArray:
    result = np.empty(len(observed.force))
    for k in range(len(observed.trials)):
        here = observed.trial == k
        result[here] = force_at(truth, k, observed.time[here])
    return result


def marked(found: dict[str, Any], observed: Observations) -> NDArray[np.bool_]:
    """Return which observations (n,) a diagnosis' mismatch intervals hold."""
    mask = np.zeros(len(observed.force), dtype=bool)
    for interval in found["mismatch"]:
        low, high = interval["time_s"]
        mask |= (
            (observed.trial == observed.trials.index(interval["trial"]))
            & (observed.phase == interval["phase"])
            & (observed.time >= low - 1e-6)
            & (observed.time <= high + 1e-6)
        )
    return mask


def _overlap(found: NDArray[np.bool_], true: NDArray[np.bool_]) -> tuple[int, int, int]:
    return int((found & true).sum()), int((found & ~true).sum()), int((true & ~found).sum())


def _bias(parameters: dict[str, Any], case: Case) -> dict[str, float]:
    true = {"c10_deep": case.c10_kpa, "c20_deep": case.c20_kpa}
    return {
        name: parameters[name]["value"] / value - 1
        for name, value in true.items()
        if name in parameters and value > 0
    }


def _covered(parameters: dict[str, Any], case: Case) -> bool | None:
    low, high = parameters["c10_deep"]["ci95"]
    return None if low is None or high is None else bool(low <= case.c10_kpa <= high)


@dataclass(frozen=True)
class Rate:
    """A share with its 95 % interval (Clopper and Pearson)."""

    count: int
    total: int

    @property
    def share(self) -> float:
        """The share; NaN of nothing."""
        return self.count / self.total if self.total else float("nan")

    def __str__(self) -> str:
        """Return it as text."""
        if not self.total:
            return "no case"
        low, high = binomtest(self.count, self.total).proportion_ci(0.95)
        return f"{self.count}/{self.total} = {self.share:.0%} ({low:.0%} to {high:.0%})"


@dataclass(frozen=True)
class Summary:
    """What all cases say together."""

    first: Rate
    in_set: Rate
    false_alarms: Rate
    outside: Rate
    pairs: Rate
    f1: float
    r_squared_above: Rate
    bias_before: dict[str, float]
    """Median of the absolute relative error, single effects and pairs."""
    bias_after: dict[str, float]
    bias_after_named_rightly: dict[str, float]
    covered: Rate
    """Of those named rightly, C10 within its 95 % interval after repair."""
    held_out: Rate
    """Of those named rightly, within 1.2 times the noise."""
    same_name: Rate
    """Of twins, with other noise on the same physics: the same first name."""
    same_answer: Rate
    """Of twins: each one's first name is among the other's, or neither has any."""
    same_verdict: Rate
    """Of twins: the same verdict on the same mechanisms, a set where it is ambiguous."""


def summarise(everything: Sequence[Scored]) -> Summary:
    """Return the summary of scored cases; twins count for the name's stability alone."""
    scored = [s for s in everything if s.case.twin_of is None]
    first = {s.case.number: s for s in scored}
    twins = [(s, first[s.case.twin_of]) for s in everything if s.case.twin_of in first]
    single = [s for s in scored if s.case.kind == "single"]
    pairs = [s for s in scored if s.case.kind == "pair"]
    none = [s for s in scored if s.case.kind == "none"]
    outside = [s for s in scored if s.case.kind == "outside"]
    effects = [*single, *pairs]
    hit, wrong, missed = np.sum([s.located for s in [*effects, *outside]], axis=0)
    repaired = [s for s in effects if s.first]
    return Summary(
        Rate(sum(s.first for s in single), len(single)),
        Rate(sum(s.in_set for s in single), len(single)),
        Rate(sum(s.verdict != "consistent" for s in none), len(none)),
        Rate(sum(s.right for s in outside), len(outside)),
        Rate(sum(s.in_set for s in pairs), len(pairs)),
        float(2 * hit / (2 * hit + wrong + missed)),
        Rate(sum(s.r_squared > 0.99 for s in scored), len(scored)),
        _median_bias(effects, "bias_before"),
        _median_bias(effects, "bias_after"),
        _median_bias(repaired, "bias_after"),
        Rate(sum(bool(s.covered_after) for s in repaired), len(repaired)),
        Rate(sum(s.held_out[1] <= 1.2 * s.held_out[2] for s in repaired), len(repaired)),
        Rate(sum(a.models[:1] == b.models[:1] for a, b in twins), len(twins)),
        Rate(sum(_agree(a, b) for a, b in twins), len(twins)),
        Rate(sum(_alike(a, b) for a, b in twins), len(twins)),
    )


def _alike(one: Scored, other: Scored) -> bool:
    """Tell whether two diagnoses say the same, whatever the order within a set or a pair."""
    sets = [{frozenset(names) for names in s.models} for s in (one, other)]
    return one.verdict == other.verdict and sets[0] == sets[1]


def _agree(one: Scored, other: Scored) -> bool:
    """Return whether each one's first model is among the other's; sets of two have no order."""
    a, b = ([frozenset(model) for model in s.models] for s in (one, other))
    if not a or not b:
        return one.verdict == other.verdict
    return a[0] in b and b[0] in a


def _median_bias(scored: Sequence[Scored], which: str) -> dict[str, float]:
    result = {}
    for name in ("c10_deep", "c20_deep"):
        sizes = [abs(getattr(s, which)[name]) for s in scored if name in getattr(s, which)]
        result[name] = float(np.median(sizes)) if sizes else float("nan")
    return result
