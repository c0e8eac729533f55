"""The plain search: pygad calls the forward model at every evaluation."""

from __future__ import annotations

import numpy as np

from legfem.identify.forward import DeepTissue
from legfem.identify.genetic import evolve
from legfem.identify.result import Generation
from legfem.identify.search import Search, SearchError
from legfem.units import FloatArray


def run_plain(search: Search) -> None:
    """Search without an emulator; a repeated individual isn't solved again."""
    domain, settings = search.domain, search.settings
    done: dict[DeepTissue, float] = {}

    def objective(genes: FloatArray) -> FloatArray:
        points = [search.law.deep(*stiffness) for stiffness in domain.stiffness(genes)]
        new = [point for point in dict.fromkeys(points) if point not in done]
        for trial in search.solve(new, "genetic"):
            done[trial.outcome.deep] = trial.objective
        return np.array([done[point] for point in points])

    middle = np.full((1, domain.dimensions), 0.5)
    evolution = evolve(objective, middle, settings.plain_genetic, settings.seed)
    if not search.complete:
        raise SearchError(f"no full solve reaches {search.misfit.displacement[-1]:g} mm")
    costs = {trial.outcome.deep: trial for trial in search.complete}
    for number, (genes, _) in enumerate(evolution.generations):
        point = search.law.deep(*domain.stiffness(genes))
        trial = costs.get(point)
        if trial is not None and trial.prediction is not None:
            cost = float(search.misfit.cost(trial.prediction.force))
            search.generations.append(Generation(0, number, point.C10, point.C20, cost))
    search.converged = search.is_near_optimum()
