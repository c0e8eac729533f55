"""The genetic algorithm: pygad, on genes from 0 to 1."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pygad

from legfem.identify.settings import GeneticSettings
from legfem.units import FloatArray

_BLEND = 0.3
_FIRST_MUTATION, _LAST_MUTATION = 0.15, 0.003


@dataclass(frozen=True, eq=False)
class Evolution:
    """What a genetic search found."""

    best: FloatArray
    """Genes."""
    cost: float
    generations: tuple[tuple[FloatArray, float], ...]
    """Best genes and cost of every generation."""


def evolve(
    cost: Callable[[FloatArray], FloatArray],
    starts: FloatArray,
    settings: GeneticSettings,
    seed: int,
) -> Evolution:
    """Minimise a cost with pygad.

    Parameters
    ----------
    cost
        Of a population's genes (n, p), all at once; infinite where it isn't known, which takes the
        individual out of the selection.
    starts
        (k, p) genes that belong to the first population; the rest is random.
    settings
        Of the algorithm.
    seed
        Of all its random numbers.
    """
    rng = np.random.default_rng(seed)
    dimensions = starts.shape[1]
    rest = rng.random((max(settings.population - len(starts), 0), dimensions))
    population = np.vstack([starts, rest])[: settings.population]
    history: list[tuple[FloatArray, float]] = []

    def fitness(_: Any, solutions: Any, __: Any) -> list[float]:
        return [-float(value) for value in cost(np.clip(np.atleast_2d(solutions), 0.0, 1.0))]

    def crossover(parents: FloatArray, size: tuple[int, int], _: Any) -> FloatArray:
        pairs = rng.integers(len(parents), size=(size[0], 2))
        first, second = parents[pairs[:, 0]], parents[pairs[:, 1]]
        share = rng.uniform(-_BLEND, 1 + _BLEND, size)
        return np.clip(first + share * (second - first), 0.0, 1.0)

    def mutation(offspring: FloatArray, ga: Any) -> FloatArray:
        done = ga.generations_completed / max(settings.generations - 1, 1)
        scale = _FIRST_MUTATION * (_LAST_MUTATION / _FIRST_MUTATION) ** min(done, 1.0)
        return np.clip(offspring + scale * rng.standard_normal(offspring.shape), 0.0, 1.0)

    def after(ga: Any) -> str | None:
        values = np.asarray(ga.last_generation_fitness)
        i = int(np.argmax(values))
        history.append((np.array(ga.population[i]), -float(values[i])))
        costs = [value for _, value in history]
        if len(costs) <= settings.saturated or not np.isfinite(costs[-1]):
            return None
        before = costs[-1 - settings.saturated]
        return "stop" if before - costs[-1] <= settings.tolerance * before else None

    kept = np.random.get_state(), random.getstate()  # noqa: NPY002
    try:
        ga = pygad.GA(
            num_generations=settings.generations,
            num_parents_mating=max(2, settings.population // 3),
            initial_population=population,
            fitness_func=fitness,
            fitness_batch_size=settings.population,
            parent_selection_type="tournament",
            K_tournament=3,
            keep_elitism=max(1, settings.population // 16),
            crossover_type=crossover,
            mutation_type=mutation,
            gene_type=float,
            random_seed=seed,
            on_generation=after,
            suppress_warnings=True,
        )
        ga.run()
    finally:
        # pygad seeds the interpreter's shared generators.
        np.random.set_state(kept[0])  # noqa: NPY002
        random.setstate(kept[1])
    best, value = min(history, key=lambda one: one[1])
    return Evolution(best, value, tuple(history))
