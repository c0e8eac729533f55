"""The plain search: the minimiser calls the forward model at every evaluation."""

from __future__ import annotations

import numpy as np

from legfem.common.units import FloatArray
from legfem.identify.result import Generation
from legfem.identify.search import Search, SearchError
from legfem.identify.solver import Key, key_of_values
from legfem.identify.trial import Trial


def run_plain(search: Search) -> None:
    """Search without an emulator; a repeated individual isn't solved again."""
    domain, settings, law = search.domain, search.settings, search.law
    done: dict[Key, Trial] = {}

    def cost(genes: FloatArray) -> FloatArray:
        points = domain.values(genes)
        keys = [key_of_values(law.values(point)) for point in points]
        new = {key: point for key, point in zip(keys, points, strict=True) if key not in done}
        if new:
            trials = search.solve(np.array(list(new.values())), "genetic")
            done.update(zip(new, trials, strict=True))
        return np.array([done[key].objective for key in keys])

    middle = np.full((1, len(law.parameters)), 0.5)
    found = settings.plain_minimiser(cost, middle, settings.seed)
    if not search.complete:
        raise SearchError(f"no full solve reaches {search.misfit.reach}")
    for number, (genes, _) in enumerate(found.path):
        values = law.values(domain.values(genes))
        trial = done.get(key_of_values(values))
        if trial is not None and trial.prediction is not None:
            misfit = float(search.misfit.cost(trial.prediction.force))
            search.generations.append(Generation(0, number, values, misfit))
    search.converged = search.is_near_optimum()
