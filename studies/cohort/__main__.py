"""``python -m studies.cohort``."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import partial
from typing import Annotated

import numpy as np
import typer
from scipy.stats import chisquare

from legfem.cohort.population_model import EFFECT_SD, LEVELS, MEAN_SD, Hierarchy, Likelihoods, PopulationSampler
from legfem.common.command_line import study_context
from legfem.common.documents import markdown_table
from legfem.common.progress import progress_on
from legfem.common.units import FloatArray
from legfem.jobs.store import Store
from studies.command_line import DONE_IS_KEPT, Out, Seed, new_app, write_results

app = new_app()
OWN_SD, ALIKE_SD = 0.06, 0.05
"""Of each test's logarithm: half-width of 12 %, that of a leg by loading with a hold; and what a leg's tests err by
alike."""
KEPT = 39
"""Draws of a posterior beside which a truth is ranked: ranks are 0 to 39."""
_BINS = 8


@dataclass(frozen=True)
class Ranked:
    """Where the truths lie among the draws, by name."""

    ranks: dict[str, int]
    divergent: int
    effective: float


def small_cohort(people: int) -> Hierarchy:
    """Return people of two groups, each with two legs tested at two visits."""
    person = np.repeat(np.arange(people), 4)
    leg, visit = np.repeat(np.arange(2 * people), 2), np.array([2 * p + v for p in range(people) for v in (0, 1, 0, 1)])
    group = (person % 2).astype(np.float64)
    return Hierarchy(("group",), group[:, None], {"person": person, "leg": leg, "visit": visit}, leg)


def ranked(sampler: PopulationSampler, seed: int) -> Ranked:
    """Draw a truth from the priors and recordings from it, and rank it among the posterior's draws."""
    given, generator = sampler.given, np.random.default_rng(seed)
    sd = {level: abs(LEVELS[level] * generator.normal()) for level in given.levels}
    mean, effect = MEAN_SD * generator.normal(), EFFECT_SD * generator.normal()
    n = len(given.design)
    theta = mean + effect * given.design[:, 0] + sd["test"] * generator.normal(size=n)
    for level, of in given.shared.items():
        theta += sd[level] * generator.normal(size=of.max() + 1)[of]
    assert given.leg is not None
    slip = ALIKE_SD * generator.normal(size=given.leg.max() + 1)[given.leg]
    centre = (theta + slip + OWN_SD * generator.normal(size=n))[:, None]
    width = np.full((n, 1), OWN_SD)
    draws = sampler.draw(Likelihoods(np.zeros((n, 1)), centre, width, width, np.full(n, ALIKE_SD)), seed)
    pairs: dict[str, tuple[FloatArray, float]] = {"mean": (draws.mean, mean), "group": (draws.effects[:, 0], effect)}
    pairs |= {f"sd of {level}": (draws.sd[level], sd[level]) for level in given.levels}
    pairs["first test"] = (draws.theta[:, 0], float(theta[0]))
    every = len(draws.mean) // KEPT
    return Ranked(
        {name: int(np.sum(values[::every][:KEPT] < true)) for name, (values, true) in pairs.items()},
        draws.divergent,
        draws.effective,
    )


@app.command()
def cohort(
    n: Annotated[int, typer.Option("--n", min=1, help="Cohorts.")] = 100,
    people: Annotated[int, typer.Option(min=4, help="Of each.")] = 10,
    seed: Seed = 1,
    out: Out = None,
) -> None:
    """Simulation-based calibration of the population model (Talts et al. 2018): ranks of truths are uniform.

    Every cohort is kept as it is done: the same command goes on where it was stopped.

    Example: python -m studies.cohort --n 20
    """
    with study_context("cohort", out, 1, DONE_IS_KEPT) as (folder, _), progress_on() as progress:
        sampler = PopulationSampler(small_cohort(people), draws=20 * KEPT, warm_up=500)
        store = Store(folder / "ranks", Ranked, people, [__name__, "legfem.cohort.population_model"])
        found = []
        progress.stage("cohorts", n)
        for k in range(seed, seed + n):
            found.append(store.get_or_make(k, partial(ranked, sampler, k)))
            progress.advance("cohort")
        rows = []
        for name in found[0].ranks:
            ranks = np.array([one.ranks[name] for one in found])
            counts = np.bincount(ranks * _BINS // (KEPT + 1), minlength=_BINS)
            inside = int(np.sum((ranks >= 1) & (ranks < KEPT)))
            rows.append([name, f"{chisquare(counts).pvalue:.2f}", f"{inside} of {n}", " ".join(map(str, counts))])
        header = ["of", "p-value of uniform ranks", "inside all but the outermost draws (95 %)", "truths by eighths"]
        effective = np.array([one.effective for one in found])
        text = markdown_table(header, rows) + (
            f"\n{sum(one.divergent for one in found)} divergent draws in {n} cohorts of {people} people; least "
            f"effective draws {np.median(effective):.0f} in the median, {effective.min():.0f} at the least.\n"
        )
        write_results(folder, {"people": people, "cohorts": [asdict(one) for one in found]}, text)


if __name__ == "__main__":
    app(prog_name="python -m studies.cohort")
