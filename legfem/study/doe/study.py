"""A study from its definition to all that is found."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd

from legfem.common.units import FloatArray
from legfem.legs.subject import Subject
from legfem.study.doe.anova import Anova, CoefficientTest, Counting, anova, coefficient_tests
from legfem.study.doe.definition import Definition
from legfem.study.doe.design import factorial_design, space_filling_design
from legfem.study.doe.effects import CentreCurvature, Lenth, Normality, centre_curvature, lenth, normality
from legfem.study.doe.information import Information, study_information
from legfem.study.doe.metrics import Metric, metrics_in
from legfem.study.doe.numerics import NumericalError, study_numerics
from legfem.study.doe.runs import Workshop, requests_at, run_table
from legfem.study.doe.simulator import Record
from legfem.study.doe.sobol import SobolIndices, sobol_indices
from legfem.study.doe.surface import NotEstimableError, Surface, fit_surface


@dataclass(frozen=True, eq=False)
class MetricAnalysis:
    """All that the factorial says of one metric."""

    metric: Metric
    surface: Surface
    anova: Anova
    tests: tuple[CoefficientTest, ...]
    """Intercept first."""
    lenth: Lenth | None
    """None where a corner is missing."""
    centre: CentreCurvature | None
    outputs: Normality
    residuals: Normality

    def main(self, prefix: str = "") -> list[CoefficientTest]:
        """Return main effects whose factor's symbol begins like this."""
        return [test for test in self.tests[1:] if not test.is_interaction and test.term.startswith(prefix)]

    def interactions(self) -> list[CoefficientTest]:
        """Return the two-factor interactions."""
        return [test for test in self.tests if test.is_interaction]


@dataclass(frozen=True, eq=False)
class StudyResult:
    """What was simulated and found."""

    definition: Definition
    subject: Subject
    counting: Counting
    coded: FloatArray
    """(n, k)."""
    records: tuple[Record, ...]
    table: pd.DataFrame
    analyses: tuple[MetricAnalysis, ...]
    not_analysed: tuple[tuple[Metric, str], ...]
    """Metrics whose surface can't be estimated, and why."""
    numerics: NumericalError | None
    sobol: tuple[SobolIndices, ...]
    information: Information | None
    seconds: float
    """Of the factorial's simulations, wall clock; what was known already took none."""

    @property
    def failed(self) -> list[int]:
        """Numbers of the runs that stopped short."""
        return [k + 1 for k, record in enumerate(self.records) if not record.complete]


def study(
    definition: Definition,
    subject: Subject,
    workshop: Workshop,
    counting: Counting,
    seed: int,
    beyond: bool,
    on_table: Callable[[pd.DataFrame], None],
) -> StudyResult:
    """Simulate and analyse.

    Parameters
    ----------
    beyond
        Whether to go beyond the factorial: numerical error, Sobol indices, information.
    on_table
        Called with the table of the factorial's runs whenever there is a new one.
    """
    coded = factorial_design(len(definition.factors))
    requests = requests_at(definition, coded, "factorial")

    def show(found: dict[int, Record]) -> None:
        on_table(run_table(definition, coded, [found.get(k) for k in range(len(coded))]))

    began = time.perf_counter()
    records = workshop.do(f"full factorial: {definition.title}", requests, show)
    seconds = time.perf_counter() - began
    table = run_table(definition, coded, records)
    on_table(table)
    analyses, not_analysed = analyse(definition, table, counting)
    numerics, information = None, None
    sobol: tuple[SobolIndices, ...] = ()
    if beyond:
        numerics = study_numerics(definition, coded, table, workshop)
        information = study_information(definition, subject, workshop)
        sobol = _sobol(definition, table, workshop, seed)
    return StudyResult(
        definition,
        subject,
        counting,
        coded,
        tuple(records),
        table,
        analyses,
        not_analysed,
        numerics,
        sobol,
        information,
        seconds,
    )


def analyse(
    definition: Definition, table: pd.DataFrame, counting: Counting
) -> tuple[tuple[MetricAnalysis, ...], tuple[tuple[Metric, str], ...]]:
    """Return the analyses of the metrics that can be analysed, and why others can't."""
    done, not_done = [], []
    for metric in metrics_in(definition.windows):
        try:
            surface = fit_surface(table, definition.factors, metric)
        except NotEstimableError as why:
            not_done.append((metric, str(why)))
            continue
        contrasts = lenth(table, definition.factors, metric)
        done.append(
            MetricAnalysis(
                metric,
                surface,
                anova(surface, counting),
                coefficient_tests(surface, counting),
                contrasts,
                None if contrasts is None else centre_curvature(table, metric, contrasts, surface),
                normality(surface.response),
                normality(surface.residuals),
            )
        )
    return tuple(done), tuple(not_done)


def _sobol(definition: Definition, table: pd.DataFrame, workshop: Workshop, seed: int) -> tuple[SobolIndices, ...]:
    if not definition.training or not definition.testing:
        return ()
    tables = {}
    for stage, points, offset in (("training", definition.training, 0), ("testing", definition.testing, 1_000_000)):
        coded = space_filling_design(len(definition.factors), points, seed + offset)
        records = workshop.do(f"{stage} the emulator", requests_at(definition, coded, stage))
        tables[stage] = run_table(definition, coded, records)
    learn = pd.concat([table, tables["training"]], ignore_index=True)
    found = (
        sobol_indices(learn, tables["testing"], definition.factors, metric, seed)
        for metric in metrics_in(definition.windows)
    )
    return tuple(indices for indices in found if indices is not None)
