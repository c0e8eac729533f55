"""``python -m studies.cohort.air``: what air before first contact does to C10, in draws that cost no solve.

Recordings of `studies.cohort.simulated` are drawn anew, and C10 alone is sought between the solved curves that they
were drawn from, as `legfem identify` seeks it: by the plain sum of squares, with its interval and its goodness of fit.
What is tested is what a lab's recordings do, not the model.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Annotated

import numpy as np
import typer
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from legfem.common.command_line import study_context
from legfem.common.documents import markdown_table
from legfem.common.progress import progress_on
from legfem.common.units import FloatArray
from legfem.data import mean_loading_curve, segment_all
from legfem.inverse.errors import numerical_covariance
from legfem.inverse.fit import LEAST_CHANCE
from legfem.inverse.intervals import quantile
from studies.cohort.simulated import (
    GRID_KPA,
    OF_GRID,
    Spread,
    Tested,
    all_pressed,
    between,
    by_shape,
    depths,
    drawn_people,
    recorded,
)
from studies.command_line import DONE_IS_KEPT, Jobs, Out, Seed, new_app, write_results
from studies.making.recording import INSTRUMENT

app = new_app()
_ENDS = float(np.log(GRID_KPA[0])), float(np.log(GRID_KPA[-1]))


@dataclass(frozen=True)
class Drawn:
    """One test."""

    in_air: int
    """Trials that by themselves show air."""
    error: float
    """Of ln C10."""
    sd: float
    """Its standard error, as a cohort has it: without what the interval allows for few repeats."""
    held: bool
    """Whether the interval holds the truth."""
    p_value: float
    """Of the fit."""


def drawn(test: Tested, curves: FloatArray, spread: Spread, seed: int) -> Drawn:
    """Return what is found of a test's recordings, of the curves (m, n), N, of its shape by `GRID_KPA`."""
    trials = segment_all(recorded(test, between(curves, test.c10), spread, seed), INSTRUMENT)
    curve = mean_loading_curve(trials)
    by_stiffness = CubicSpline(depths(), CubicSpline(np.log(GRID_KPA), curves)(np.linspace(*_ENDS, 101)), axis=1)
    model = CubicSpline(np.linspace(*_ENDS, 101), by_stiffness(curve.displacement))

    def left(log: float) -> FloatArray:
        return np.asarray(model(log) - curve.force)

    covariance = curve.covariance + numerical_covariance(curve.displacement, curve.smooth, power=1.0)
    weights = np.linalg.inv(covariance)
    plain = float(minimize_scalar(lambda log: np.sum(left(log) ** 2), bounds=_ENDS, method="bounded").x)
    least = float(minimize_scalar(lambda log: left(log) @ weights @ left(log), bounds=_ENDS, method="bounded").fun)
    slope = model(plain, 1)
    gain = slope / (slope @ slope)
    error = plain - float(np.log(test.c10 * (spread.drift if test.drifted else 1.0)))
    variance = float(gain @ covariance @ gain)
    return Drawn(
        sum(one.contact.in_air for one in trials),
        error,
        float(np.sqrt(variance - gain @ curve.few_repeats @ gain)),
        abs(error) <= quantile(curve.noise.repeat_dof) * np.sqrt(variance),
        float(chi2.sf(least, len(slope) - 1)),
    )


def row_of(name: str, tests: Sequence[Drawn]) -> list[str]:
    """Return a row of the table."""
    errors = np.array([one.error for one in tests])
    refused = sum(one.p_value < LEAST_CHANCE for one in tests)
    return [
        name,
        f"{len(tests)}",
        f"{refused} ({100 * refused / len(tests):.1f} %)",
        f"{100 * errors.mean():+.1f} %",
        f"{100 * errors.std():.1f} %",
        f"{100 * np.sqrt(np.mean([one.sd**2 for one in tests])):.1f} %",
        f"{100 * np.mean([one.held for one in tests]):.0f} %",
    ]


@app.command()
def air(
    n: Annotated[int, typer.Option("--n", min=1, max=240, help="Tests.")] = 240,
    seed: Seed = 31,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Draw recordings that begin in air, and find how often a sound one is refused and by how much C10 errs.

    With the folder of `studies.cohort.simulated` as --out its curves are used, which take minutes otherwise.

    Example: python -m studies.cohort.air --out results/sixty
    """
    with study_context("cohort-air", out, jobs, DONE_IS_KEPT) as (folder, processes), progress_on() as progress:
        spread, grids = Spread(), by_shape(all_pressed(folder, OF_GRID, processes, progress))
        found = [drawn(one, grids[one.shape], spread, seed) for one in drawn_people(60, spread, seed)[:n]]
        every = {f"{k} of 3": [one for one in found if one.in_air == k] for k in range(4)} | {"all": found}
        header = ["air shown by", "tests", "said not to fit", "C10's mean error", "its sd", "own sd", "interval holds"]
        text = markdown_table(header, [row_of(name, tests) for name, tests in every.items() if tests])
        write_results(folder, {"seed": seed, "tests": [asdict(one) for one in found]}, text)


if __name__ == "__main__":
    app(prog_name="python -m studies.cohort.air")
