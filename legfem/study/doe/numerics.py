"""How much of the metrics is numerical error: a finer mesh and smaller steps at three points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from legfem.common.units import FloatArray
from legfem.study.doe.definition import Definition
from legfem.study.doe.metrics import Metric, metrics_in
from legfem.study.doe.runs import Workshop, requests_at, run_table
from legfem.study.doe.simulator import REFINEMENT

ORDER = 1.0
"""Assumed of the error in Richardson's extrapolation: the cautious choice, as the irregularity of
unstructured meshes hides the elements' own order in the convergence study."""


@dataclass(frozen=True, eq=False)
class NumericalError:
    """Metrics with the default and with refined settings."""

    runs: tuple[int, ...]
    """Numbers of the runs that were done again."""
    metrics: tuple[Metric, ...]
    default: FloatArray
    """(runs, metrics)."""
    refined: FloatArray
    """(runs, metrics)."""

    @property
    def error(self) -> FloatArray:
        """Estimated error of the default metrics; (runs, metrics)."""
        return (self.default - self.refined) / (1 - REFINEMENT**-ORDER)

    @property
    def relative(self) -> FloatArray:
        """Of the extrapolated metric; (runs, metrics)."""
        return np.asarray(self.error / (self.default - self.error))

    def bound(self, table: pd.DataFrame, metric: Metric) -> float:
        """Return what the error can make of any coefficient, in the metric's unit.

        A coefficient is a mean of signed runs: the largest relative error seen times the mean size
        of the metric bounds it.
        """
        worst = np.nanmax(np.abs(self.relative[:, self.metrics.index(metric)]))
        return float(worst * np.nanmean(np.abs(table[metric.name])))


def study_numerics(
    definition: Definition, coded: FloatArray, table: pd.DataFrame, workshop: Workshop
) -> NumericalError | None:
    """Simulate the centre, the softest and the stiffest corner again; None without them."""
    metrics = metrics_in(definition.windows)
    last = table[metrics[-1].name].to_numpy(dtype=float)
    corners = last[:-1]
    if not np.isfinite(corners).any():
        return None
    chosen = sorted({int(np.nanargmin(corners)), int(np.nanargmax(corners)), len(last) - 1})
    requests = requests_at(definition, coded[chosen], "refined", "refined")
    records = workshop.do("centre and two corners on a finer mesh", requests)
    again = run_table(definition, coded[chosen], records)
    names = [metric.name for metric in metrics]
    return NumericalError(
        tuple(int(table["run"].iloc[k]) for k in chosen),
        metrics,
        table[names].to_numpy(dtype=float)[chosen],
        again[names].to_numpy(dtype=float),
    )
