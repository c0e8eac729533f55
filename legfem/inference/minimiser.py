"""The seam for a search of one's own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

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

`legfem.inference.genetic.Genetic` (pygad) is the one used by default. SciPy's differential
evolution in its place:

>>> from scipy.optimize import differential_evolution
>>> from legfem.identify.settings import IdentificationSettings
>>> from legfem.inference.minimiser import Minimum
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
