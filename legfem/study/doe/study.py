"""A study from its definition to all that is found, and what has to be said of its runs."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd
from SALib.analyze import sobol as sobol_analysis
from SALib.sample import sobol as sobol_sample
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from legfem.common.units import FloatArray
from legfem.inverse.outcome import Outcome
from legfem.legs.subject import Subject
from legfem.mechanics.materials import Hyperelastic
from legfem.study.doe.design import Definition, Factor, factorial_design, space_filling_design
from legfem.study.doe.information import Information, information_requests, study_information
from legfem.study.doe.runs import Metric, NumericalError, Workshop, metrics_in, requests_at, run_table, study_numerics
from legfem.study.doe.surface import MetricAnalysis, NotEstimableError, analyse_metric

_STARTS = (0.8, 2.0, 5.0)
_LENGTHS = (0.2, 30.0)
_NUGGETS = (1e-10, 1e-1)


class MetricEmulator:
    """Kriging about a full quadratic, with one length a factor.

    The squared-exponential covariance's lengths and its nugget are those of the greatest
    likelihood.

    Parameters
    ----------
    at : ndarray
        (n, k), coded.
    values : ndarray
        (n,).
    """

    def __init__(self, at: FloatArray, values: FloatArray) -> None:
        self.at = at
        self._mean, self._scale = float(values.mean()), float(values.std()) or 1.0
        self._values = (values - self._mean) / self._scale
        # A quadratic needs more points than it has coefficients.
        self._squares = len(values) > 2 * _terms(at[:1], True).shape[1]
        self._trend_at = _terms(at, self._squares)
        k = at.shape[1]
        bounds = [tuple(np.log(_LENGTHS))] * k + [tuple(np.log(_NUGGETS))]
        fits = [
            minimize(self._cost, np.log([start] * k + [1e-6]), method="L-BFGS-B", bounds=bounds) for start in _STARTS
        ]
        self._solve(min(fits, key=lambda fit: float(fit.fun)).x)

    def __call__(self, at: FloatArray) -> FloatArray:
        """Return the metric at coded points (m, k)."""
        smooth = _covariance(at, self.at, self._lengths) @ self._weights
        standard = _terms(at, self._squares) @ self._trend + smooth
        return np.asarray(self._mean + self._scale * standard)

    def _cost(self, logs: FloatArray) -> float:
        try:
            return self._solve(logs)
        except np.linalg.LinAlgError:
            return 1e10

    def _solve(self, logs: FloatArray) -> float:
        """Fit with given lengths and nugget; return -2 ln of their likelihood."""
        self._lengths = np.exp(logs[:-1])
        covariance = _covariance(self.at, self.at, self._lengths)
        covariance += np.exp(logs[-1]) * np.eye(len(self.at))
        factor = cho_factor(covariance, lower=True)
        whitened = cho_solve(factor, self._trend_at)
        self._trend = np.linalg.solve(self._trend_at.T @ whitened, whitened.T @ self._values)
        rest = self._values - self._trend_at @ self._trend
        self._weights = cho_solve(factor, rest)
        n = len(rest)
        variance = max(float(rest @ self._weights) / n, 1e-300)
        return n * np.log(variance) + 2 * float(np.log(np.diag(factor[0])).sum())


@dataclass(frozen=True)
class EmulatorError:
    """How far an emulator is from simulations that it hasn't seen."""

    points: int
    rms: float
    """In the metric's unit."""
    relative: float
    """rms over the standard deviation of the simulations."""


def _terms(at: FloatArray, squares: bool) -> FloatArray:
    products = [at[:, i] * at[:, j] for i, j in combinations(range(at.shape[1]), 2)]
    columns = [np.ones(len(at)), *at.T, *products]
    return np.column_stack([*columns, *(at.T**2)] if squares else columns)


def _covariance(a: FloatArray, b: FloatArray, lengths: FloatArray) -> FloatArray:
    apart = a[:, None, :] / lengths - b[None, :, :] / lengths
    return np.asarray(np.exp(-0.5 * np.sum(apart**2, axis=-1)))


_BASE_SAMPLES = 2048
_ENOUGH = 5


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """Shares of a metric's variance, the factors uniform in their coded ranges."""

    metric: Metric
    first: FloatArray
    """(k,): by a factor alone."""
    first_ci95: FloatArray
    """(k,): half-width, of the sampling."""
    total: FloatArray
    """(k,): with all its interactions."""
    total_ci95: FloatArray
    error: EmulatorError


def sobol_indices(
    learn: pd.DataFrame, test: pd.DataFrame, factors: tuple[Factor, ...], metric: Metric, seed: int
) -> SobolIndices | None:
    """Return the indices; None where too few simulations have the metric."""
    symbols = [f.symbol for f in factors]
    learn, test = learn[np.isfinite(learn[metric.name])], test[np.isfinite(test[metric.name])]
    if len(learn) < 4 * len(factors) or len(test) < _ENOUGH:
        return None
    emulator = MetricEmulator(coordinates(factors, learn[symbols].to_numpy(float)), learn[metric.name].to_numpy(float))
    at, unseen = coordinates(factors, test[symbols].to_numpy(float)), test[metric.name].to_numpy(float)
    rms = float(np.sqrt(np.mean((emulator(at) - unseen) ** 2)))
    error = EmulatorError(len(unseen), rms, rms / float(unseen.std()))
    found = sobol_of(lambda coded: emulator(coordinates(factors, coded)), symbols, seed)
    return SobolIndices(metric, found["S1"], found["S1_conf"], found["ST"], found["ST_conf"], error)


def coordinates(factors: tuple[Factor, ...], coded: FloatArray) -> FloatArray:
    """Return where an emulator sees coded points (n, k).

    Over a linear range of several tens the metrics bend near its lower end: the square root of the
    value, scaled to -1..1, spreads that end out. A logarithmic coding has done so already.
    """
    columns = []
    for column, factor in zip(coded.T, factors, strict=True):
        if factor.coding == "linear":
            low, high = np.sqrt(factor.low), np.sqrt(factor.high)
            value = factor.low + (factor.high - factor.low) * (column + 1) / 2
            columns.append(2 * (np.sqrt(value) - low) / (high - low) - 1)
        else:
            columns.append(column)
    return np.column_stack(columns)


def sobol_of(function: Callable[[FloatArray], FloatArray], symbols: list[str], seed: int) -> dict[str, FloatArray]:
    """Return SALib's indices of a function of coded points (n, k)."""
    problem = {"num_vars": len(symbols), "names": symbols, "bounds": [[-1.0, 1.0]] * len(symbols)}
    sample = sobol_sample.sample(problem, _BASE_SAMPLES, calc_second_order=False, seed=seed)
    values = np.concatenate([function(part) for part in np.array_split(sample, 16)])
    # The estimators lose digits where the mean is large beside the spread.
    values = (values - values.mean()) / values.std()
    found = sobol_analysis.analyze(problem, values, calc_second_order=False, seed=seed)
    return {name: np.asarray(found[name]) for name in ("S1", "S1_conf", "ST", "ST_conf")}


@dataclass(frozen=True, eq=False)
class StudyResult:
    """What was simulated and found.

    Attributes
    ----------
    coded : ndarray
        (n, k).
    table : DataFrame
        See `legfem.study.doe.runs.run_table`.
    not_analysed : tuple
        Metrics whose surface can't be estimated, and why.
    seconds : float
        Wall time of the factorial's simulations; what was known already took none.
    """

    definition: Definition
    subject: Subject
    coded: FloatArray
    outcomes: tuple[Outcome, ...]
    table: pd.DataFrame
    analyses: tuple[MetricAnalysis, ...]
    not_analysed: tuple[tuple[Metric, str], ...]
    numerics: NumericalError | None
    sobol: tuple[SobolIndices, ...]
    information: Information | None
    seconds: float

    @property
    def failed(self) -> list[int]:
        """Numbers of the runs that stopped short."""
        return [k + 1 for k, one in enumerate(self.outcomes) if not one.complete]

    def largest_share(self) -> tuple[Factor, float, Metric]:
        """Factor that makes most of the last metric: the slope in the deepest window."""
        main, _ = self.analyses[-1].shares()
        factor = max(self.definition.factors, key=lambda one: main[one.symbol])
        return factor, main[factor.symbol], self.analyses[-1].metric

    def stopped_short(self) -> str:
        """Which runs stopped short; nothing where none did."""
        if not self.failed:
            return ""
        runs = ", ".join(map(str, self.failed))
        return (
            f"{len(self.failed)} of {len(self.outcomes)} runs stopped short (run {runs}): "
            "the analysis is of what there is"
        )

    def run_notes(self) -> list[str]:
        """How many runs reach their depth, and what follows where some don't."""
        total, failed = len(self.outcomes), self.failed
        lines = [f"{total - len(failed)} of {total} runs reach {self.definition.depth:g} mm."]
        for number in failed:
            stopped = self.outcomes[number - 1]
            lines.append(f"Run {number} stops at {stopped.reached:.2f} mm: {stopped.reason}.")
        for analysis in self.analyses:
            if analysis.missing:
                runs = ", ".join(map(str, analysis.missing))
                lines.append(
                    f"{analysis.metric.label} is analysed without run {runs}: fewer degrees of "
                    "freedom, and the coefficients are no longer independent of each other."
                )
        soft = sum(one.contact_stiffness_factor < 1 for one in self.outcomes)
        return [*lines, f"{soft} runs needed a softer contact law to go on."] if soft else lines

    def fascia_note(self) -> str:
        """Remark where the fascia's Poisson's ratio is negative; else nothing."""
        given = self.subject.tissues["fascia"]
        levels = [f.model_value(at) for f in self.definition.factors if f.name == "fascia.C10" for at in (-1, 1)]
        levels = levels or [self.definition.fixed.get("fascia.C10", given.C10 or 0.0)]
        ratios = [Hyperelastic(level, given.D1).poisson_ratio for level in levels]
        if min(ratios) >= 0:
            return ""
        span = f"{min(ratios):.2f}" if len(ratios) == 1 else f"{max(ratios):.2f} to {min(ratios):.2f}"
        return (
            f"The fascia's Poisson's ratio is {span}: it follows from the C10 and the D1 of "
            f"{given.D1:g}/MPa that the paper gives, which make its bulk modulus the smaller one."
        )


def simulations_of(definition: Definition, beyond: bool) -> int:
    """Return how many simulations a study has, at most three of them on a finer mesh."""
    factorial = len(factorial_design(len(definition.factors)))
    if not beyond:
        return factorial
    emulated = definition.training + definition.testing if definition.training and definition.testing else 0
    return factorial + 3 + len(information_requests(definition)) + emulated


def study(
    definition: Definition,
    subject: Subject,
    workshop: Workshop,
    seed: int,
    beyond: bool,
    on_table: Callable[[pd.DataFrame], None],
) -> StudyResult:
    """Simulate and analyse.

    Parameters
    ----------
    beyond
        Whether to go beyond the factorial: numerical error, Sobol indices, information.
    on_table
        Called with the table of the factorial's runs, also where they are interrupted.
    """
    coded = factorial_design(len(definition.factors))

    began = time.perf_counter()
    requests, found = requests_at(definition, coded, "factorial"), dict[int, Outcome]()
    try:
        outcomes = workshop.do(f"full factorial: {definition.title}", requests, found.update)
    finally:
        table = run_table(definition, coded, [found.get(k) for k in range(len(coded))])
        on_table(table)
    seconds = time.perf_counter() - began
    done, not_done = analyse(definition, table)
    return StudyResult(
        definition,
        subject,
        coded,
        tuple(outcomes),
        table,
        done,
        not_done,
        numerics=study_numerics(definition, coded, table, workshop) if beyond else None,
        information=study_information(definition, subject, workshop) if beyond else None,
        sobol=_sobol(definition, table, workshop, seed) if beyond else (),
        seconds=seconds,
    )


def analyse(
    definition: Definition, table: pd.DataFrame
) -> tuple[tuple[MetricAnalysis, ...], tuple[tuple[Metric, str], ...]]:
    """Analyse the metrics that can be analysed; the others are returned second, with the reason."""
    done, not_done = [], []
    for metric in metrics_in(definition.windows):
        try:
            done.append(analyse_metric(table, definition.factors, metric))
        except NotEstimableError as why:
            not_done.append((metric, str(why)))
    return tuple(done), tuple(not_done)


def _sobol(definition: Definition, table: pd.DataFrame, workshop: Workshop, seed: int) -> tuple[SobolIndices, ...]:
    if not definition.training or not definition.testing:
        return ()
    factors, tables = definition.factors, []
    for stage, points, at in (
        ("training", definition.training, seed),
        ("testing", definition.testing, seed + 1_000_000),
    ):
        coded = space_filling_design(len(factors), points, at)
        outcomes = workshop.do(f"{stage} the emulator", requests_at(definition, coded, stage))
        tables.append(run_table(definition, coded, outcomes))
    learn = pd.concat([table, tables[0]], ignore_index=True)
    found = (sobol_indices(learn, tables[1], factors, metric, seed) for metric in metrics_in(definition.windows))
    return tuple(indices for indices in found if indices is not None)
