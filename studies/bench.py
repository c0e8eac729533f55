"""``python -m studies.bench``: what a curve costs, in counts and ratios, since clocks are noisy.

Times are of the processor, the least of several, and given in units of one factorisation of the
tangent in the same process.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from legfem.common.command_line import command_context, leave_to_first_rank
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.mechanics.contact import ContactSettings
from legfem.solve.path import SolveReport
from studies.command_line import new_app
from studies.reconstruct import read_definition, test_of

SUBJECT = "3"
SENSITIVITIES = ("deep.C10", "deep.C20", "superficial.C10", "fascia.C10")

app = new_app()


@dataclass(frozen=True)
class Work:
    """What one curve took."""

    report: SolveReport
    evaluations: int
    """Of the residual."""
    body_tangents: int
    """That were assembled; the body's part of other tangents was kept."""
    seconds: float
    """Of the processor."""


@dataclass(frozen=True)
class Operations:
    """Seconds of the processor for one of each operation, at the present state."""

    factorisation: float
    tangent: float
    substitution: float
    residual: float
    volume_ratios: float
    product: float
    """Of two matrices of 500 x 500: a unit that doesn't depend on legfem."""


def default_test(settings: PlaneStrainSettings | None = None) -> PlaneStrainIndentation:
    """Return the test of subject 3 with the parameters of the paper's Table 5."""
    known = test_of(read_definition(), SUBJECT)
    return replace(known, settings=settings or PlaneStrainSettings())


def work_of(
    test: PlaneStrainIndentation, depth: float = 30.0, sensitivities: tuple[str, ...] = (), repeats: int = 1
) -> Work:
    """Press to a depth (mm) and return what that took; the time is the least of the repeats."""
    seconds = np.inf
    for _ in range(repeats):
        before, started = (test.system.evaluations, test.system.body_tangents), time.process_time()
        report = test.solve({}, depth, sensitivities).report
        seconds = min(seconds, time.process_time() - started)
    return Work(report, test.system.evaluations - before[0], test.system.body_tangents - before[1], seconds)


def operations_of(test: PlaneStrainIndentation) -> Operations:
    """Time single operations at the test's present state."""
    system, linear = test.system, test.solver.linear_solver
    tangent = system.assemble_tangent()
    right = system.assemble_residual().x.petsc_vec
    solution, diagonal = right.duplicate(), tangent.getDiagonal()

    def factorise() -> None:
        tangent.setDiagonal(diagonal)  # marks the matrix as changed
        linear.getPC().setUp()

    matrix = np.random.default_rng(0).normal(size=(500, 500))
    return Operations(
        factorisation=_least_time(factorise),
        tangent=_least_time(system.assemble_tangent),
        substitution=_least_time(lambda: linear.solve(right, solution), before=factorise),
        residual=_least_time(system.assemble_residual),
        volume_ratios=_least_time(system.minimum_volume_ratio),
        product=_least_time(lambda: matrix @ matrix),
    )


def _least_time(operation: Callable[[], object], before: Callable[[], object] | None = None, times: int = 20) -> float:
    if before is not None:
        before()
    operation()
    seconds = []
    for _ in range(times):
        started = time.process_time()
        operation()
        seconds.append(time.process_time() - started)
    return min(seconds)


def variants() -> dict[str, tuple[PlaneStrainSettings, tuple[str, ...]]]:
    """Return settings and sensitivities by name; the first are the defaults."""
    default = PlaneStrainSettings()
    exponential = replace(default, contact=ContactSettings(normal="exponential"))
    return {
        "default": (default, ()),
        f"{len(SENSITIVITIES)} sensitivities": (default, SENSITIVITIES),
        "exponential contact": (exponential, ()),
        "displacement form": (replace(default, formulation="displacement"), ()),
    }


def parts_of(work: Work, one: Operations) -> dict[str, tuple[int, float]]:
    """Return how often each operation is done on a curve without sensitivities, and its seconds."""
    report = work.report
    return {
        "factorisation": (report.factorisations, one.factorisation),
        "assembly of the tangent": (work.body_tangents, one.tangent),
        "back-substitution": (report.iterations, one.substitution),
        "assembly of the residual": (work.evaluations, one.residual),
        "least volume ratio": (work.evaluations, one.volume_ratios),
    }


def parts_table(work: Work, one: Operations) -> Table:
    """Return the parts of one curve as a table."""
    table = Table("operation", title="Parts of the default curve")
    for heading in ("times", "each over a\nfactorisation", "share of\nthe curve"):
        table.add_column(heading, justify="right")
    rest = 1.0
    for name, (times, each) in parts_of(work, one).items():
        share = times * each / work.seconds
        rest -= share
        table.add_row(name, str(times), f"{each / one.factorisation:.3f}", f"{share:.0%}")
    table.add_row("all else", "", "", f"{rest:.0%}")
    return table


def work_table(works: Mapping[str, Work], one: Operations) -> Table:
    """Return the work of several curves as a table; times are over the first's."""
    table = Table("curve", title=f"Subject {SUBJECT}'s curve")
    headings = (
        "unknowns",
        "steps",
        "rejected",
        "factor-\nisations",
        "Newton\niterations",
        "residuals",
        "time over a\nfactorisation",
        "time over\ndefault",
    )
    for heading in headings:
        table.add_column(heading, justify="right")
    default = next(iter(works.values()))
    for name, work in works.items():
        report = work.report
        counts = (
            report.unknowns,
            len(report.steps),
            report.rejected,
            report.factorisations,
            report.iterations,
            work.evaluations,
        )
        times = work.seconds / one.factorisation, work.seconds / default.seconds
        stopped = "" if report.complete else f", stopped at {report.reached:.1f} mm"
        table.add_row(name + stopped, *map(str, counts), f"{times[0]:.0f}", f"{times[1]:.2f}")
    return table


@app.command()
def bench(
    depth: Annotated[float, typer.Option(min=1.0, help="mm.")] = 30.0,
    repeats: Annotated[int, typer.Option(min=1, help="Of each; the fastest counts.")] = 3,
) -> None:
    """Print the work and the ratios of times of subject 3's curve.

    Example: python -m studies.bench --repeats 5
    """
    leave_to_first_rank()
    with command_context():
        works, one = {}, None
        for name, (settings, sensitivities) in variants().items():
            test = default_test(settings)
            test.solve({}, 1.0, sensitivities)  # compiles
            works[name] = work_of(test, depth, sensitivities, repeats)
            one = one or operations_of(test)
        assert one is not None
        default = next(iter(works.values()))
        console = Console(width=None if Console().is_terminal else 120)
        console.print(work_table(works, one))
        console.print(parts_table(default, one))
        console.print(
            f"default curve: {default.seconds:.2f} s of the processor\n"
            f"one factorisation: {one.factorisation * 1e3:.1f} ms, "
            f"{one.factorisation / one.product:.2f} products of 500 x 500 matrices"
        )


if __name__ == "__main__":
    app(prog_name="python -m studies.bench")
