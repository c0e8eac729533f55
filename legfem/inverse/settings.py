"""What an identification is asked for, and how it is to be done: its minimiser, emulator, weights, means."""

import random
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pygad

from legfem.common.progress import Progress, Silent
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import IdentifiedLaw, LawName, Values
from legfem.inverse.outcome import Forward, FullSolver
from legfem.inverse.parameter import Parameter

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
    """

    best: FloatArray
    cost: float


type Minimiser = Callable[[Cost, FloatArray, int], Minimum]
"""A search in the unit cube: ``minimiser(cost, starts, seed)``.

``cost`` takes many points at once; ``starts`` (k, p) are genes worth trying; ``seed`` is that of
all random numbers, the same seed giving the same result. What it finds is polished by least squares
and confirmed by full solves, so it needs to find the right valley and no more.

`legfem.inverse.settings.Genetic` (pygad) is the one used by default. SciPy's differential
evolution in its place:

>>> from scipy.optimize import differential_evolution
>>> from legfem.inverse.settings import IdentificationSettings, Minimum
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
    """pygad's genetic algorithm as a `legfem.inverse.settings.Minimiser`.

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
        return Minimum(best, value)

    def _is_saturated(self, costs: list[float]) -> bool:
        if len(costs) <= self.saturated or not np.isfinite(costs[-1]):
            return False
        before = costs[-1 - self.saturated]
        return before - costs[-1] <= self.tolerance * before


AskedWeighting = Literal["paper", "covariance"]


@dataclass(frozen=True)
class IdentificationSettings:
    """Settings of one identification.

    Parameters
    ----------
    weighting : {"covariance", "paper", "equal"}, optional
        What is minimised: the sum weighted with the inverse covariance of all readings, which it is
        without it, the plain sum of squares over the loading (Eq. 12), or one in which readings of
        a channel weigh equally. A prior can't be weighed against the plain sum.
    seed : int
        Of the search.
    most_solves : int
        Full solves after which a search ends unconverged.
    minimiser : Minimiser
        The search on the emulator; see `legfem.inverse.settings`.
    """

    weighting: AskedWeighting | None = None
    seed: int = 1
    most_solves: int = 25
    minimiser: Minimiser = field(default_factory=Genetic)


@dataclass(frozen=True)
class SearchRequest:
    """What is to be identified, and with what means.

    Parameters
    ----------
    parameters : sequence of Parameter, optional
        What to identify, or with the role "nuisance" only to let err, in the model's units; of
        these a law takes what it has. C10 and C20 of the deep tissue without them;
        `legfem.inverse.catalogue.parameter_of` makes one with bounds that suit legs.
    fixed : Mapping[str, float]
        Values that are held, in place of those that the folder gives.
    depth : float, optional
        Greatest displacement to use, mm.
    as_field : bool
        Whether the law that recordings prefer is told from place to place, too.
    start : Mapping[str, float]
        Values about which a law that has no other free ones is looked for first, in place of where legs lie.
    settings : IdentificationSettings
        Of the search.
    out : Path, optional
        Folder in whose ``solves`` every full solve is kept; none is without it.
    responses : Path, optional
        Folder that keeps what errors of the geometry do; ``responses`` in `out` without it.
    jobs : int
        Processes.
    progress : Progress
        Told of every full solve.
    """

    parameters: Sequence[Parameter] | None = None
    fixed: Values = field(default_factory=dict)
    depth: float | None = None
    as_field: bool = False
    start: Values = field(default_factory=dict)
    settings: IdentificationSettings = field(default_factory=IdentificationSettings)
    out: Path | None = None
    responses: Path | None = None
    jobs: int = 1
    progress: Progress = field(default_factory=Silent)

    def solver(
        self, model: Forward, sensitivities: tuple[str, ...], laws: int = 1, folder: str = "solves"
    ) -> FullSolver:
        """Make what solves a model, to be entered; the model is meshed and compiled here.

        That compiles once for all processes, and finds what can't be meshed before files are made.

        Parameters
        ----------
        model
            Of all tests.
        sensitivities
            Full names of the model's parameters that solves are differentiated by.
        laws
            Number of laws that are searched for side by side.
        folder
            Name of that in which solves are kept, if results are.
        """
        kept = None if self.out is None else self.out / folder
        solver = FullSolver(model, kept, self.jobs, self.progress, sensitivities)
        if kept is None or not kept.exists():
            solver.start(most=laws - 1)
        self.progress.stage("meshing; on a machine's first run, compiling forms (some 20 s)")
        try:
            model.prepare()
        except BaseException:
            solver.__exit__(*sys.exc_info())
            raise
        return solver


def free_of_model(laws: Mapping[LawName, IdentifiedLaw]) -> tuple[str, ...]:
    """Full names of the model's parameters, not the instrument's, that are free in any of the laws."""
    return tuple(dict.fromkeys(law.names[k] for law in laws.values() for k in law.of_model))
