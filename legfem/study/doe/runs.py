"""The simulations of a design: one solve, all of them done once and kept, tabulated with the curves' metrics."""

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Literal

import numpy as np
import pandas as pd

from legfem.common.progress import Progress, duration
from legfem.common.units import FloatArray
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings, Tissues
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection
from legfem.inverse.outcome import Outcome
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, code_fingerprint, finish
from legfem.legs.finite_element_models import tissues_of
from legfem.legs.subject import Subject
from legfem.solve.path import ForceCurve
from legfem.solve.settings import StepSettings
from legfem.study.doe.design import Definition

Fidelity = Literal["default", "refined"]
REFINEMENT = 1.5
_MESHES_KEPT = 4
_FEWEST_STEPS = 4
"""Steps of a curve that has a slope and a curvature."""


@dataclass(frozen=True)
class Request:
    """One simulation to do."""

    stage: str
    """What it is for: ``factorial``, ``training``, ``testing``, ``refined``, ``nominal``."""
    number: int
    """Within its stage."""
    values: tuple[tuple[str, float], ...]
    """Parameters in the model's units, by name."""
    depth: float
    """mm."""
    fidelity: Fidelity = "default"
    sensitivities: tuple[str, ...] = ()

    @property
    def asked(self) -> object:
        """What the outcome depends on."""
        return self.values, self.depth, self.fidelity, sorted(self.sensitivities)


@dataclass(eq=False)
class PlaneStrainSimulator:
    """A subject's plane-strain test; a mesh is made once for every geometry in a process."""

    section: LegSection
    indenter: Indenter
    tissues: Tissues

    @classmethod
    def of_subject(cls, subject: Subject) -> "PlaneStrainSimulator":
        """Return the simulator of a subject's leg."""
        return cls(subject.section, subject.indenter, tissues_of(subject))

    def fingerprint(self) -> Mapping[str, Any]:
        """Return section, indenter, tissues, settings and code."""
        geometry = self.section.fascia_thickness, 2 * self.indenter.radius
        return {
            "default": self._test(*geometry, "default").fingerprint(),
            "refined": self._test(*geometry, "refined").fingerprint(),
            "code": code_fingerprint("legfem.study.doe.runs"),
        }

    def solve(self, request: Request) -> Outcome:
        """Simulate; the curve's force is per length of the cylinder (N/mm), and nothing raises.

        What can't be meshed or solved has no curve.
        """
        values = dict(request.values)
        thickness = values.pop("fascia.thickness", self.section.fascia_thickness)
        diameter = values.pop("indenter.diameter", 2 * self.indenter.radius)
        try:
            test = self._test(thickness, diameter, request.fidelity)
            solved = test.solve(values, request.depth, request.sensitivities)
        except Exception as error:  # whatever it is, the other simulations go on
            if os.environ.get("LEGFEM_DEBUG"):
                raise
            return Outcome(values, (), False, " ".join(f"{type(error).__name__}: {error}".split()), 0, 0.0)
        curve, length = solved.curve, self.indenter.length
        by = {name: slopes / length for name, slopes in curve.sensitivities.items()}
        return Outcome.of(values, ForceCurve(curve.displacement, curve.force / length, by), solved.report)

    @lru_cache(_MESHES_KEPT)  # noqa: B019 - a simulator ends with the program
    def _test(self, thickness: float, diameter: float, fidelity: Fidelity) -> PlaneStrainIndentation:
        return PlaneStrainIndentation(
            replace(self.section, fascia_thickness=thickness),
            replace(self.indenter, radius=diameter / 2),
            self.tissues,
            settings_of(fidelity),
        )


def settings_of(fidelity: Fidelity) -> PlaneStrainSettings:
    """Return the numerical settings: the default, or a finer mesh with small steps."""
    base = PlaneStrainSettings()
    if fidelity == "default":
        return base
    steps = StepSettings(first=0.1, largest=0.5)
    return replace(base, mesh=base.mesh.refined(REFINEMENT), steps=steps)


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
        if len(curve.displacement) < _FEWEST_STEPS or curve.depth < self.end - 1e-9:
            return math.nan
        mean = curve.mean_slope if self.kind == "slope" else curve.mean_curvature
        return mean(self.start, self.end)


def metrics_in(windows: tuple[tuple[float, float], ...]) -> tuple[Metric, ...]:
    """Metrics in the order of the paper's Table 3."""
    return (*(Metric("curvature", *window) for window in windows), *(Metric("slope", *window) for window in windows))


@dataclass
class Outlook:
    """How many simulations all stages to come have, and how long the ones before took."""

    ahead: int = 0
    done: int = 0
    seconds: float = 0.0

    def begin(self, requests: int) -> str:
        """Begin a stage; return what is left from there on, nothing where that isn't known."""
        left, self.ahead = self.ahead, max(self.ahead - requests, 0)
        if not left or not self.done:
            return f", of {left} simulations in all" if left > requests else ""
        return f"; about {duration(self.seconds / self.done * left)} left in all"


@dataclass(frozen=True, eq=False)
class Workshop:
    """What simulations are done with: workers, the store of those that are done, progress, what is to come."""

    workers: Workers[PlaneStrainSimulator, Request, Outcome]
    store: Store[Outcome]
    progress: Progress
    outlook: Outlook = field(default_factory=Outlook)

    def do(
        self,
        text: str,
        requests: Sequence[Request],
        on_found: Callable[[dict[int, Outcome]], None] = lambda found: None,
    ) -> list[Outcome]:
        """Simulate what isn't kept from an earlier run.

        Parameters
        ----------
        text
            Name of the stage.
        requests
            What to simulate.
        on_found
            Called with all outcomes so far, by place in the list: those that are kept, and whenever there is a new one.

        Returns
        -------
        list of Outcome
            One a request, in their order.
        """
        new = sum(not self.store.path(request.asked).exists() for request in requests)
        began = time.perf_counter()
        # What gave nothing at all may lack memory or a disk: it is tried again the next time.
        outcomes = finish(
            self.workers,
            requests,
            self.store,
            self.progress,
            text + self.outlook.begin(len(requests)),
            progress_line,
            asked=lambda request: request.asked,
            worth=lambda outcome: bool(outcome.curves),
            on_found=on_found,
        )
        self.outlook.done += new
        self.outlook.seconds += time.perf_counter() - began
        return outcomes


def progress_line(request: Request, found: Outcome) -> str:
    """One line on a finished simulation: how far it came, its last force, its time."""
    end = "" if found.complete else f" FAILED: {found.reason}"
    force = f", {found.curve.force[-1]:.3g} N/mm" if found.curves else ""
    return (
        f"{request.stage} {request.number + 1}: {found.reached:.2f} of {request.depth:g} mm"
        f"{force}, {found.seconds:.1f} s{end}"
    )


def requests_at(definition: Definition, coded: FloatArray, stage: str, fidelity: Fidelity = "default") -> list[Request]:
    """Simulations of coded points (n, k)."""
    points = [{f.name: f.model_value(float(c)) for f, c in zip(definition.factors, row, strict=True)} for row in coded]
    return [
        Request(stage, number, tuple(sorted({**definition.fixed, **point}.items())), definition.depth, fidelity)
        for number, point in enumerate(points)
    ]


_TOLD = ("complete", "reason", "contact_stiffness_factor", "factorisations")
"""What of a simulation's outcome is tabulated as it is."""


def run_table(definition: Definition, coded: FloatArray, outcomes: Sequence[Outcome | None]) -> pd.DataFrame:
    """Tabulate coded levels, values, metrics and how it went, a row a simulation.

    Nothing in it depends on the machine's speed: the same study gives the same table.
    Metrics of a simulation that stopped short are there as far as it came, and NaN beyond.
    """
    rows = []
    for number, (point, found) in enumerate(zip(coded, outcomes, strict=True)):
        levels = [(f, float(level)) for f, level in zip(definition.factors, point, strict=True)]
        curve = found.curve if found is not None and found.curves else None
        row: dict[str, object] = {"run": number + 1}
        row |= {f.symbol: level for f, level in levels}
        row |= {f"{f.symbol}_{f.unit}": f.value(level) for f, level in levels}
        row |= {m.name: np.nan if curve is None else m.of(curve) for m in metrics_in(definition.windows)}
        if found is not None:
            row["reached_mm"] = found.reached
            row |= {name: getattr(found, name) for name in _TOLD}
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
    outcomes = workshop.do("centre and two corners on a finer mesh", requests)
    again = run_table(definition, coded[chosen], outcomes)
    runs = tuple(int(table["run"].iloc[k]) for k in chosen)
    default, refined = table[names].to_numpy(dtype=float)[chosen], again[names].to_numpy(dtype=float)
    return NumericalError(runs, metrics, default, refined)
