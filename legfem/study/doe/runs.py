"""A list of simulations done once: kept, reported one line each, and taken up again."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.jobs.pool import Workers
from legfem.jobs.ranks import take_in
from legfem.jobs.store import Store, finish
from legfem.study.doe.definition import Definition
from legfem.study.doe.factors import model_values
from legfem.study.doe.metrics import metrics_in
from legfem.study.doe.simulator import Fidelity, Record, Request, Simulator


@dataclass(frozen=True, eq=False)
class Workshop:
    """What simulations are done with."""

    workers: Workers[Simulator, Request, Record]
    store: Store[Record]
    progress: Progress

    def do(
        self, text: str, requests: Sequence[Request], on_found: Callable[[dict[int, Record]], None] = lambda found: None
    ) -> list[Record]:
        """Return the records of all requests; those kept from an earlier run aren't done again.

        Parameters
        ----------
        text
            Of the stage.
        requests
            What to simulate.
        on_found
            Called with all records so far, by place in the list, whenever there is a new one.
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
    """Simulate; meanwhile the first of several ranks takes in what the others have done."""
    return simulator.simulate(request, lambda _: take_in())


def progress_line(request: Request, record: Record) -> str:
    """Return one line on a finished simulation."""
    end = "" if record.complete else f" FAILED: {record.reason}"
    force = f", {record.force_per_length[-1]:.3g} N/mm" if len(record.displacement) else ""
    return (
        f"{request.stage} {request.number + 1}: {record.reached:.2f} of {request.depth:g} mm"
        f"{force}, {record.seconds:.1f} s{end}"
    )


def requests_at(definition: Definition, coded: FloatArray, stage: str, fidelity: Fidelity = "default") -> list[Request]:
    """Return the simulations of coded points (n, k)."""
    return [
        Request(
            stage,
            number,
            tuple(sorted({**definition.fixed, **model_values(definition.factors, point)}.items())),
            definition.depth,
            fidelity,
        )
        for number, point in enumerate(coded)
    ]


def run_table(definition: Definition, coded: FloatArray, records: Sequence[Record | None]) -> pd.DataFrame:
    """Return a row a simulation: coded levels, values, metrics, how it went.

    Nothing in it depends on the machine's speed: the same study gives the same table.
    Metrics of a simulation that stopped short are there as far as it came, and NaN beyond.
    """
    metrics = metrics_in(definition.windows)
    rows = []
    for number, (point, record) in enumerate(zip(coded, records, strict=True)):
        row: dict[str, object] = {"run": number + 1}
        row |= {f.symbol: float(c) for f, c in zip(definition.factors, point, strict=True)}
        row |= {f"{f.symbol}_{f.unit}": f.value(float(c)) for f, c in zip(definition.factors, point, strict=True)}
        curve = None if record is None else record.curve
        row |= {m.name: np.nan if curve is None else m.of(curve) for m in metrics}
        if record is not None:
            row |= {
                "reached_mm": record.reached,
                "complete": record.complete,
                "reason": record.reason,
                "contact_stiffness_factor": record.contact_stiffness_factor,
                "factorisations": record.factorisations,
            }
        rows.append(row)
    return pd.DataFrame(rows)


def as_csv(definition: Definition, table: pd.DataFrame) -> str:
    """Return a run table as CSV whose columns have their units."""
    units = {m.name: f"{m.name}_{_plain(m.unit)}" for m in metrics_in(definition.windows)}
    coded = {f.symbol: f"{f.symbol}_coded" for f in definition.factors}
    text = io.StringIO()
    table.rename(columns={**units, **coded}).to_csv(text, index=False)
    return text.getvalue()


def _plain(unit: str) -> str:
    return unit.replace("/", "_per_")
