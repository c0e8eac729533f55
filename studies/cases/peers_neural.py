"""A neural posterior estimate: C10 and the cause, by a network that is trained on legfem's own simulations of a leg.

G. Papamakarios, I. Murray, Adv. Neural Inf. Process. Syst. 29 (2016) 1028-1036; M. Deistler, P. J. Goncalves, J. H.
Macke, ibid. 35 (2022) 23135-23149, who draw anew within what a first network leaves.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.errors import COMMON_GAIN_SD, GAIN_SDS, numerical_covariance
from legfem.inverse.explain import PRIOR_NONE, PRIOR_PAIR, PRIOR_SINGLE
from legfem.inverse.intervals import NUMERICAL_LENGTH_MM
from legfem.inverse.laplace import WIDTHS
from legfem.inverse.linearised import LinearisedFit
from legfem.inverse.mechanism import Mechanism, prior_of
from legfem.inverse.parameter import Parameter
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.subject import Subject
from legfem.mechanisms import OCCURRENCES
from studies.cases.outcomes import Interval
from studies.cases.peers_fitted import Answer
from studies.cases.peers_selected import screened

NUMBERS = np.array([PRIOR_NONE, PRIOR_SINGLE, PRIOR_PAIR])
"""How common none, one and two mechanisms are."""
ROUNDS = (8_000, 80_000)
"""Simulations: over all C10 that the responses hold for, then over what a first network leaves of it."""
TAIL, BEYOND = 1e-3, 0.3
"""What the second round leaves out at either end of the first's posterior, and adds over what is between them."""
APART, SAMPLES, SEED = 1_000, 4_000, 0
"""Simulations of each round that nothing is learned from; samples of a posterior."""
FEATURES, LEAST_SIZE = 24, 1e-3
SPLINES = {"num_transforms": 3, "num_bins": 10, "hidden_features": 64, "discrete_hidden_features": 100}
LEARNING = "torch", "sbi.inference", "sbi.neural_nets.net_builders", "sbi.utils.tracking", "torch.utils.tensorboard"


@dataclass(frozen=True, eq=False)
class Simulator:
    """Draws a leg's recordings as a diagnosis expects them: with no mechanism, one or two, and errors of instruments.

    Parameters
    ----------
    base
        The base model's fit, for its predictor and the errors about it.
    mechanisms
        That recordings can show.
    rng
        Draws.
    """

    base: LinearisedFit
    mechanisms: Sequence[Mechanism]
    rng: np.random.Generator

    def value(self, parameter: Parameter, strength_of: Mechanism | None = None) -> float:
        """Return a value within its bounds, by what is known of it; a strength is of any width, or strong."""
        prior, possible = prior_of(parameter), OCCURRENCES.get(strength_of.name) if strength_of else None
        low, high = parameter.bounds
        if possible is not None:
            low, high = max(low, possible.low), min(high, possible.high)
            if self.rng.random() < possible.strong:
                return prior.value_at(self.rng.uniform(prior.departure(low), prior.departure(high)))
        widths = WIDTHS if strength_of and prior.scale == "linear" else {1.0: 1.0}
        width = self.rng.choice(list(widths), p=list(widths.values()))
        while True:
            value = prior.value_at(width * self.rng.standard_normal())
            if low <= value <= high:
                return value

    def truth(self, logs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return ln C10 (MPa) with whether each mechanism is there (1 + m,), and forces without errors (n,), N."""
        predictor, common = self.base.problem.predictor, np.array([one.expected for one in self.mechanisms])
        number = self.rng.choice(3, p=NUMBERS / NUMBERS.sum())
        there = self.rng.choice(len(common), number, replace=False, p=common / common.sum())
        values = {one.name: self.value(one) for one in predictor.parameters}
        values[DEEP_C10] = float(np.exp(self.rng.uniform(*logs)))
        chosen = [self.mechanisms[k] for k in there]
        for one in chosen:
            strength = one.parameters[0]
            values |= one.by_full_name({p.name: self.value(p, one if p is strength else None) for p in one.parameters})
        return np.array([np.log(values[DEEP_C10]), *np.isin(range(len(common)), there)]), predictor(values, chosen)

    def recordings(self, count: int, logs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return so many truths between two ends of ln C10, but those whose solutions stop, and forces as recorded."""
        errors, observed, rng = self.base.problem.errors, self.base.problem.predictor.observed, self.rng
        every = (self.truth(logs) for _ in range(count))
        truths, forces = map(np.array, zip(*((t, f) for t, f in every if np.isfinite(f).all()), strict=True))
        count, trials = len(truths), errors.zeros.T
        alike = np.ones(len(observed.force))
        of_model = numerical_covariance(observed.displacement, alike, observed.way * NUMERICAL_LENGTH_MM)
        correlated = partial(rng.multivariate_normal, 0 * alike, size=count, method="cholesky")
        noise, shares = correlated(errors.dense - errors.of_model), correlated(of_model)

        def by_trial(sds: Sequence[float]) -> FloatArray:
            return np.asarray(rng.choice(sds, (count, 1)) * rng.standard_normal((count, len(trials))) @ trials)

        gains, zeros = by_trial(GAIN_SDS), by_trial(errors.zero_sds)
        common = COMMON_GAIN_SD * rng.standard_normal((count, 1))
        return truths, forces * (1 + common + gains + shares) + zeros + noise


def features(base: LinearisedFit, seen: FloatArray, forces: FloatArray) -> FloatArray:
    """Return what a network sees of forces seen (n,) and simulated (k, n), N, in rows (1 + k, 1 + `FEATURES`).

    That is their size over the base model's, and the simulations' main components of what is left in standard errors,
    of which great ones count by their logarithms.
    """
    expected, white = (base.problem.whitened(one.T) for one in (base.prediction, np.vstack([seen, forces])))
    size = np.maximum(expected @ white / (expected @ expected), LEAST_SIZE)
    left = np.arcsinh(white / size - expected[:, None]).T
    axes = np.linalg.eigh(np.cov(left[1:].T))[1][:, -FEATURES:]
    return np.column_stack([np.log(size), (left - left[1:].mean(axis=0)) @ axes])


def learning(*names: str) -> tuple[Any, ...]:
    """Import modules of what trains networks, which legfem doesn't install.

    Raises
    ------
    InputError
        If a package isn't there.
    """
    try:
        return tuple(import_module(name) for name in names)
    except ModuleNotFoundError as missing:
        problem = f"isn't installed ({missing.name} is missing), and a neural posterior estimate needs it"
        raise InputError("python -m studies.cases peers", "sbi", problem, "pip install sbi") from missing


def trained(drawn: FloatArray, seen: FloatArray) -> Callable[[FloatArray, int], FloatArray]:
    """Train a network: a mass of which mechanisms are there, and splines for ln C10 given these (sbi's mixed NPE).

    Parameters
    ----------
    drawn
        (k, 1 + m): ln C10, and whether each mechanism is there.
    seen
        (k, f): features of the recordings.

    Returns
    -------
    Draws so many rows like ``drawn`` for each of some features: (count, k, 1 + m).
    """
    torch, inference, nets, tracking, boards = learning(*LEARNING)
    torch.manual_seed(SEED)
    build = partial(nets.build_mnpe, num_categories_per_variable=torch.full((drawn.shape[1] - 1,), 2), **SPLINES)
    with TemporaryDirectory() as logs:
        log = tracking.TensorBoardTracker(boards.SummaryWriter(logs))
        trainer = inference.MNPE(density_estimator=build, tracker=log, show_progress_bars=False)
        trainer.append_simulations(*(torch.tensor(one, dtype=torch.float32) for one in (drawn, seen)))
        network = trainer.train(training_batch_size=500, learning_rate=1e-3, stop_after_epochs=10)
    return lambda asked, count: network.sample((count,), torch.tensor(asked, dtype=torch.float32)).numpy()


def causes(samples: FloatArray) -> FloatArray:
    """Return the most frequent set of mechanisms (k, m), by whether each is there, in samples (count, k, m)."""
    return np.array([Counter(map(tuple, own)).most_common(1)[0][0] for own in samples.swapaxes(0, 1)])


def by_network(leg: Subject, folder: Path) -> Answer:
    """Learn from simulations by the responses that a diagnosis keeps in a folder; ``solves`` are what those take."""
    learning("sbi")
    base, mechanisms, solves = screened(leg, Diagnoser(folder, None))
    predictor = base.problem.predictor
    simulator, logs = Simulator(base, mechanisms, np.random.default_rng(SEED)), np.log(predictor.responses.c10_bounds)
    for count in ROUNDS:
        true, forces = simulator.recordings(count, logs)
        own, *others = features(base, predictor.observed.force, forces)
        sample = trained(true[APART:], np.array(others[APART:]))
        found = sample(own[None], SAMPLES)
        low, high = np.quantile(found[:, 0, 0], [TAIL, 1 - TAIL])
        logs = np.clip([low - BEYOND * (high - low), high + BEYOND * (high - low)], *logs)
    low, middle, high = (mpa_to_kpa(float(np.exp(one))) for one in np.quantile(found[:, 0, 0], [0.025, 0.5, 0.975]))
    named = [one.name for one, there in zip(mechanisms, causes(found[..., 1:])[0], strict=True) if there]
    apart, true = sample(np.array(others[:APART]), SAMPLES // 10), true[:APART]
    lows, highs = np.quantile(apart[..., 0], [0.025, 0.975], axis=0)
    held = np.mean((lows <= true[:, 0]) & (true[:, 0] <= highs))
    right = np.mean((causes(apart[..., 1:]) == true[:, 1:]).all(axis=1))
    return Answer(Interval(middle, low, high), solves, named, tried=[float(held), float(right)])
