"""Minimisers of the search: the seam for one of your own, and pygad's genetic algorithm."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pygad

from legfem.common.units import FloatArray

type Cost = Callable[[FloatArray], FloatArray]
"""What is minimised: costs (n,) of genes (n, p), each from 0 to 1; infinite where not known."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """What a minimiser found.

    Parameters
    ----------
    best : (p,) array
        Genes of the least cost.
    cost : float
        There.
    path : tuple of (array, float)
        Genes and cost on the way, one a generation or step; drawn and written, not needed.
    """

    best: FloatArray
    cost: float
    path: tuple[tuple[FloatArray, float], ...] = ()


type Minimiser = Callable[[Cost, FloatArray, int], Minimum]
"""A search in the unit cube: ``minimiser(cost, starts, seed)``.

``cost`` takes many points at once; ``starts`` (k, p) are genes worth trying; ``seed`` is that of
all random numbers, the same seed giving the same result. What it finds is polished by least squares
and confirmed by full solves, so it needs to find the right valley and no more.

`legfem.inverse.minimiser.Genetic` (pygad) is the one used by default. SciPy's differential
evolution in its place:

>>> from scipy.optimize import differential_evolution
>>> from legfem.inverse.settings import IdentificationSettings
>>> from legfem.inverse.minimiser import Minimum
>>>
>>>
>>> def by_differential_evolution(cost, starts, seed):
...     found = differential_evolution(
...         lambda columns: cost(columns.T),
...         bounds=[(0, 1)] * starts.shape[1],
...         x0=starts[0],
...         seed=seed,
...         vectorized=True,
...         updating="deferred",
...         polish=False,
...         popsize=8,
...         maxiter=40,
...     )
...     return Minimum(found.x, float(found.fun))
>>>
>>>
>>> settings = IdentificationSettings(minimiser=by_differential_evolution)
"""


_BLEND = 0.3
_FIRST_MUTATION, _LAST_MUTATION = 0.15, 0.003


@dataclass(frozen=True)
class Genetic:
    """pygad's genetic algorithm as a `legfem.inverse.minimiser.Minimiser`.

    Parameters
    ----------
    population : int
        Individuals.
    generations : int
        At most.
    tolerance : float
        Relative fall of the cost below which a generation counts as saturated; the paper's.
    saturated : int
        Generations in a row without a greater fall after which the search ends.
    """

    population: int = 48
    generations: int = 60
    tolerance: float = 1e-3
    saturated: int = 12

    def __call__(self, cost: Cost, starts: FloatArray, seed: int) -> Minimum:
        """Minimise a cost; ``starts`` (k, p) belong to the first population, the rest is random.

        An infinite cost takes an individual out of the selection.
        """
        rng = np.random.default_rng(seed)
        rest = rng.random((max(self.population - len(starts), 0), starts.shape[1]))
        population = np.vstack([starts, rest])[: self.population]
        history: list[tuple[FloatArray, float]] = []

        def fitness(_: Any, solutions: Any, __: Any) -> list[float]:
            return [-float(value) for value in cost(np.clip(np.atleast_2d(solutions), 0.0, 1.0))]

        def crossover(parents: FloatArray, size: tuple[int, int], _: Any) -> FloatArray:
            pairs = rng.integers(len(parents), size=(size[0], 2))
            first, second = parents[pairs[:, 0]], parents[pairs[:, 1]]
            share = rng.uniform(-_BLEND, 1 + _BLEND, size)
            return np.clip(first + share * (second - first), 0.0, 1.0)

        def mutation(offspring: FloatArray, ga: Any) -> FloatArray:
            done = ga.generations_completed / max(self.generations - 1, 1)
            scale = _FIRST_MUTATION * (_LAST_MUTATION / _FIRST_MUTATION) ** min(done, 1.0)
            return np.clip(offspring + scale * rng.standard_normal(offspring.shape), 0.0, 1.0)

        def after(ga: Any) -> str | None:
            values = np.asarray(ga.last_generation_fitness)
            i = int(np.argmax(values))
            history.append((np.array(ga.population[i]), -float(values[i])))
            return "stop" if self._is_saturated([value for _, value in history]) else None

        kept = np.random.get_state(), random.getstate()  # noqa: NPY002
        try:
            ga = pygad.GA(
                num_generations=self.generations,
                num_parents_mating=max(2, self.population // 3),
                initial_population=population,
                fitness_func=fitness,
                fitness_batch_size=self.population,
                parent_selection_type="tournament",
                K_tournament=3,
                keep_elitism=max(1, self.population // 16),
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
        return Minimum(best, value, tuple(history))

    def _is_saturated(self, costs: list[float]) -> bool:
        if len(costs) <= self.saturated or not np.isfinite(costs[-1]):
            return False
        before = costs[-1 - self.saturated]
        return before - costs[-1] <= self.tolerance * before
