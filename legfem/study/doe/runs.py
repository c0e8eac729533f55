"""The simulations of a design: done once, kept, tabulated with the curves' metrics, and how exact these are."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.solve.path import ForceCurve
from legfem.study.doe.design import Definition
from legfem.study.doe.simulator import REFINEMENT, Fidelity, Record, Request, Simulator

ORDER = 1.0
"""Assumed of the error in Richardson's extrapolation: the cautious choice, as the irregularity of
unstructured meshes hides the elements' own order in the convergence study."""


@dataclass(frozen=True)
class Metric:
    """Slope or curvature of the force per unit length of the cylinder, from ``start`` to ``end`` (mm)."""

    kind: Literal["curvature", "slope"]
    start: float
    end: float

    @property
    def name(self) -> str:
        """Name in a formula and as a table's column."""
        return f"{self.kind}_{self.start:g}_{self.end:g}".replace(".", "p")

    @property
    def label(self) -> str:
        """Name as people read it."""
        return f"{self.kind} {self.start:g}-{self.end:g} mm"

    @property
    def unit(self) -> str:
        """Unit in plain letters."""
        return "N/mm2" if self.kind == "slope" else "N/mm3"

    @property
    def typeset_unit(self) -> str:
        """Unit with raised digits."""
        return self.unit.replace("mm2", "mm²").replace("mm3", "mm³")

    def of(self, curve: ForceCurve) -> float:
        """Mean over the window; NaN where the curve ends before the window does."""
        if curve.depth < self.end - 1e-9:
            return math.nan
        mean = curve.mean_slope if self.kind == "slope" else curve.mean_curvature
        return mean(self.start, self.end)


def metrics_in(windows: tuple[tuple[float, float], ...]) -> tuple[Metric, ...]:
    """Metrics in the order of the paper's Table 3."""
    return (*(Metric("curvature", *window) for window in windows), *(Metric("slope", *window) for window in windows))


@dataclass(frozen=True, eq=False)
class Workshop:
    """What simulations are done with: workers, the store of those that are done, progress."""

    workers: Workers[Simulator, Request, Record]
    store: Store[Record]
    progress: Progress

    def do(
        self, text: str, requests: Sequence[Request], on_found: Callable[[dict[int, Record]], None] = lambda found: None
    ) -> list[Record]:
        """Simulate what isn't kept from an earlier run.

        Parameters
        ----------
        text
            Name of the stage.
        requests
            What to simulate.
        on_found
            Called with all records so far, by place in the list, whenever there is a new one.

        Returns
        -------
        list of Record
            One a request, in their order.
        """
        # What gave nothing at all may lack memory or a disk: it is tried again the next time.
        return finish(
            self.workers,
            requests,
            self.store,
            self.progress,
            text,
            progress_line,
            asked=lambda request: request.asked,
            worth=lambda record: len(record.displacement) > 0,
            on_found=on_found,
        )


def simulate(simulator: Simulator, request: Request) -> Record:
    """Simulate."""
    return simulator.simulate(request)


def progress_line(request: Request, record: Record) -> str:
    """One line on a finished simulation: how far it came, its last force, its time."""
    end = "" if record.complete else f" FAILED: {record.reason}"
    force = f", {record.force_per_length[-1]:.3g} N/mm" if len(record.displacement) else ""
    return (
        f"{request.stage} {request.number + 1}: {record.reached:.2f} of {request.depth:g} mm"
        f"{force}, {record.seconds:.1f} s{end}"
    )


def requests_at(definition: Definition, coded: FloatArray, stage: str, fidelity: Fidelity = "default") -> list[Request]:
    """Simulations of coded points (n, k)."""
    points = [{f.name: f.model_value(float(c)) for f, c in zip(definition.factors, row, strict=True)} for row in coded]
    return [
        Request(stage, number, tuple(sorted({**definition.fixed, **point}.items())), definition.depth, fidelity)
        for number, point in enumerate(points)
    ]


def run_table(definition: Definition, coded: FloatArray, records: Sequence[Record | None]) -> pd.DataFrame:
    """Tabulate coded levels, values, metrics and how it went, a row a simulation.

    Nothing in it depends on the machine's speed: the same study gives the same table.
    Metrics of a simulation that stopped short are there as far as it came, and NaN beyond.
    """
    rows = []
    for number, (point, record) in enumerate(zip(coded, records, strict=True)):
        levels = [(f, float(level)) for f, level in zip(definition.factors, point, strict=True)]
        curve = None if record is None else record.curve
        row: dict[str, object] = {"run": number + 1}
        row |= {f.symbol: level for f, level in levels}
        row |= {f"{f.symbol}_{f.unit}": f.value(level) for f, level in levels}
        row |= {m.name: np.nan if curve is None else m.of(curve) for m in metrics_in(definition.windows)}
        if record is not None:
            row["reached_mm"] = record.reached
            row |= {name: getattr(record, name) for name in ("complete", "reason", "contact_stiffness_factor")}
            row["factorisations"] = record.factorisations
        rows.append(row)
    return pd.DataFrame(rows)


def as_csv(definition: Definition, table: pd.DataFrame) -> str:
    """Write a run table as CSV whose columns have their units."""
    units = {m.name: f"{m.name}_{m.unit.replace('/', '_per_')}" for m in metrics_in(definition.windows)}
    coded = {f.symbol: f"{f.symbol}_coded" for f in definition.factors}
    return table.rename(columns={**units, **coded}).to_csv(index=False)


@dataclass(frozen=True, eq=False)
class NumericalError:
    """Metrics with the default and with refined settings.

    Attributes
    ----------
    runs : tuple of int
        Numbers of the runs that were done again.
    default, refined : ndarray
        (runs, metrics).
    """

    runs: tuple[int, ...]
    metrics: tuple[Metric, ...]
    default: FloatArray
    refined: FloatArray

    @property
    def relative(self) -> FloatArray:
        """Error of the default metrics over the extrapolated ones; (runs, metrics)."""
        error = (self.default - self.refined) / (1 - REFINEMENT**-ORDER)
        return np.asarray(error / (self.default - error))

    def bound(self, table: pd.DataFrame, metric: Metric) -> float:
        """Greatest part of any coefficient that the error can make, in the metric's unit.

        A coefficient is a mean of signed runs: the largest relative error seen times the mean size
        of the metric bounds it.
        """
        worst = np.nanmax(np.abs(self.relative[:, self.metrics.index(metric)]))
        return float(worst * np.nanmean(np.abs(table[metric.name])))


def study_numerics(
    definition: Definition, coded: FloatArray, table: pd.DataFrame, workshop: Workshop
) -> NumericalError | None:
    """Simulate the centre, the softest and the stiffest corner on a finer mesh; None without them."""
    metrics = metrics_in(definition.windows)
    names = [metric.name for metric in metrics]
    corners = table[names[-1]].to_numpy(dtype=float)[:-1]
    if not np.isfinite(corners).any():
        return None
    chosen = sorted({int(np.nanargmin(corners)), int(np.nanargmax(corners)), len(corners)})
    requests = requests_at(definition, coded[chosen], "refined", "refined")
    records = workshop.do("centre and two corners on a finer mesh", requests)
    again = run_table(definition, coded[chosen], records)
    runs = tuple(int(table["run"].iloc[k]) for k in chosen)
    default, refined = table[names].to_numpy(dtype=float)[chosen], again[names].to_numpy(dtype=float)
    return NumericalError(runs, metrics, default, refined)
