r"""A hierarchical model of a cohort: what its people are like, what each leg is beside them, and a prior for new legs.

Of a parameter's logarithm in test i, of a leg of a person at a visit,

.. math::
    \theta_i = x_i^T \beta + u_{person} + v_{leg} + w_{visit} + r_{rater} + g_{rig} + e_i,

with normal effects of unknown standard deviations, groups, logarithms of covariates (whose factors are exponents) and
steps of a rig at a date in x. Each test enters with its likelihood: a normal one of the logarithm whose two halves are
to each other as its interval's two sides, with the standard error over both (flat where the recordings close none), or
over a diagnosis' explanations the sum of theirs, each with its probability (paths cross between explanations a few
standard deviations apart, not between far ones). What a leg's tests err by alike moves their likelihoods together.
NumPyro samples it (NUTS); `studies.cohort` has the calibration by simulation.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date
from typing import Any

import numpy as np
from numpy.typing import NDArray

from legfem.cohort.anomalies import day, rig_steps
from legfem.cohort.members import Member, Members
from legfem.cohort.rows import NORMAL, Measure, Row, cohort_model, measured
from legfem.cohort.statistics import COVARIATES, design_of, values_of
from legfem.common.documents import json_types
from legfem.common.errors import Argument, InputError
from legfem.common.units import FloatArray
from legfem.inverse.population import AGE

type Numbers = NDArray[np.int_]
OPEN = 5.0
"""Standard deviation of a logarithm on a side that nothing closes."""
LEAST_PEOPLE = 5
LEVELS: Mapping[str, float] = {"person": 0.5, "leg": 0.2, "visit": 0.1, "rater": 0.1, "rig": 0.05, "test": 0.1}
"""Scales of the half-normal priors of standard deviations, of logarithms."""
MEAN_SD = 3.0
"""Of the mean of the logarithm, of kPa: a factor of 400 at two standard deviations."""
EXPONENT = "'s exponent"
"""Ends the name of a covariate's effect."""
EFFECT_SD = 0.5
"""Standard deviation of the priors of groups, exponents and steps."""


@dataclass(frozen=True, eq=False)
class Likelihoods:
    """What the recordings of n tests say: sums of k two-sided normal ones, of logarithms; arrays are (n, k)."""

    log_weight: FloatArray
    centre: FloatArray
    below: FloatArray
    """Standard deviation below the centre."""
    above: FloatArray
    alike: FloatArray | float = 0.0
    """(n,): standard deviation of what a test of a leg errs by as its others do."""

    @classmethod
    def of(cls, measures: Sequence[Measure], repeated: bool = False) -> "Likelihoods":
        """Return those of results, which are positive; with errors apart that a leg's tests have alike if repeated."""
        every = [one.explanations or ((1.0, one.value, one.low, one.high),) for one in measures]
        shape = len(every), max(map(len, every))
        found = cls(np.full(shape, -np.inf), np.zeros(shape), np.ones(shape), np.ones(shape), np.zeros(len(every)))
        for i, parts in enumerate(every):
            for k, (weight, value, low, high) in enumerate(parts):
                found.log_weight[i, k], found.centre[i, k] = math.log(weight), math.log(value)
                found.below[i, k] = math.log(value / low) / NORMAL if low and low < value else OPEN
                found.above[i, k] = math.log(high / value) / NORMAL if high and high > value else OPEN
        widths = np.array([_width(one) for one in measures])
        alike = np.array([one.alike if repeated and not one.explanations else 0.0 for one in measures])
        own = (widths * np.sqrt(1 - alike))[:, None]
        closed = (found.below < OPEN) & (found.above < OPEN)
        return replace(
            found,
            below=np.where(closed, own, 1.0) * found.below,
            above=np.where(closed, own, 1.0) * found.above,
            alike=widths * np.sqrt(alike) * np.where(closed, 0.5 * (found.below + found.above), 0.0)[:, 0],
        )


def _width(one: Measure) -> float:
    """Return the standard error over a normal interval's: less than 1 where that allows for few repeats."""
    if one.explanations or one.sd is None or one.low is None or one.high is None or not one.high > one.low:
        return 1.0
    return min(1.0, one.sd * 2 * NORMAL / (one.high - one.low))


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """Who is who: n tests, their design (n, p) but for the mean, and numbers from 0 of what they share by `LEVELS`."""

    names: tuple[str, ...]
    design: FloatArray
    shared: Mapping[str, Numbers]
    """Without ``test``, which is each its own; what has as many as a level above it isn't there."""
    leg: Numbers | None = None
    """Whose tests err alike in part; None where each was tested once."""
    log_ages: FloatArray | None = None
    """(n,); None where age isn't in the design."""

    @property
    def levels(self) -> tuple[str, ...]:
        """Of which a standard deviation is sought."""
        return (*self.shared, "test")


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of the posterior, s of each."""

    mean: FloatArray
    """(s,), of the logarithm at the design's zero."""
    effects: FloatArray
    """(s, p)."""
    sd: Mapping[str, FloatArray]
    """(s,) by level."""
    theta: FloatArray
    """(s, n): each test's logarithm, drawn towards the others."""
    divergent: int
    """Draws whose path left the posterior."""
    effective: float
    """Least effective number of draws of mean, effects and standard deviations."""


class PopulationSampler:
    """Samples a hierarchy's posterior, for likelihoods of one shape; what is compiled is kept."""

    def __init__(self, given: Hierarchy, draws: int = 1000, warm_up: int = 500) -> None:
        from numpyro.infer import MCMC, NUTS

        self.given = given
        # A high target: where few share a level its standard deviation's posterior reaches zero.
        kernel = NUTS(self._model, target_accept_prob=0.95)
        self._mcmc: Any = MCMC(kernel, num_warmup=warm_up, num_samples=draws, progress_bar=False, jit_model_args=True)

    def draw(self, known: Likelihoods, seed: int = 0) -> Draws:
        """Return draws."""
        import jax
        import numpyro
        from numpyro.diagnostics import effective_sample_size

        numpyro.enable_x64()
        alike = np.broadcast_to(known.alike, len(known.centre))
        parts = (known.log_weight, known.centre, known.below, known.above, alike)
        self._mcmc.run(jax.random.PRNGKey(seed), *parts, extra_fields=("diverging",))
        found = {name: np.asarray(values) for name, values in self._mcmc.get_samples().items()}
        divergent = int(np.sum(self._mcmc.get_extra_fields()["diverging"]))
        watched = [found["mean"], *found["effects"].T, *(found[f"sd_{one}"] for one in self.given.levels)]
        return Draws(
            found["mean"],
            found["effects"],
            {one: found[f"sd_{one}"] for one in self.given.levels},
            found["theta"],
            divergent,
            min(float(effective_sample_size(values[None])) for values in watched),
        )

    def _model(self, log_weight: Any, centre: Any, below: Any, above: Any, alike: Any) -> None:
        import jax.numpy as jnp
        import numpyro
        import numpyro.distributions as dist
        from jax.scipy.special import logsumexp

        given = self.given
        mean = numpyro.sample("mean", dist.Normal(0.0, MEAN_SD))
        effects = numpyro.sample("effects", dist.Normal(0.0, EFFECT_SD).expand([given.design.shape[1]]).to_event(1))
        theta = jnp.asarray(given.design) @ effects + (0.0 if "person" in given.shared else mean)
        for level, of in (*given.shared.items(), ("test", np.arange(len(given.design)))):
            sd = numpyro.sample(f"sd_{level}", dist.HalfNormal(LEVELS[level]))
            # People are known well beside how they differ, and the rest isn't: each is sampled as mixes faster.
            about = dist.Normal(mean, sd) if level == "person" else dist.Normal(0.0, 1.0)
            own = numpyro.sample(f"own_{level}", about.expand([int(of.max()) + 1]).to_event(1))
            theta = theta + (own[of] if level == "person" else sd * own[of])
        numpyro.deterministic("theta", theta)
        seen = theta
        if given.leg is not None:
            slip = numpyro.sample("slip", dist.Normal(0.0, 1.0).expand([int(given.leg.max()) + 1]).to_event(1))
            seen = theta + alike * slip[given.leg]
        apart = seen[:, None] - centre
        width = jnp.where(apart < 0, below, above)
        # Two halves that meet at the centre have one height: 2 / (below + above).
        each = log_weight - 0.5 * (apart / width) ** 2 - jnp.log(below + above)
        numpyro.factor("likelihood", jnp.sum(logsumexp(each, axis=1)))


def hierarchy_of(members: Sequence[Member], rows: Sequence[Row], key: str) -> tuple[Hierarchy, Likelihoods, list[str]]:
    """Return who is who of the rows that have a positive value, what each says, and their names.

    Raises
    ------
    InputError
        For fewer people than a population needs.
    """
    table, _ = values_of(members, [row for row in rows if row.judged.tone != "wrong"], key)
    table = table[table["value"] > 0]
    for name in COVARIATES:
        numbers = table[name].astype(np.float64)
        table[name] = np.log(numbers.where(numbers > 0))
    days = table["date"].map(day)
    steps = []
    for rig, step in rig_steps(members, rows):
        name = f"step{rig and f'_of_{rig}'}"
        own = table["rig"].fillna("").astype(str) == rig
        table[name] = np.where(own & (days >= step.after), date.fromordinal(step.after).isoformat(), "before")
        steps.append(name)
    kept, shown, design = design_of(table, ("group", "sex", *steps), COVARIATES, {})
    people = kept["person"].nunique()
    if people < LEAST_PEOPLE:
        raise InputError(
            Argument("population"), key, f"only {people} people have one", f"a population needs {LEAST_PEOPLE}"
        )
    text = kept[["person", "side", "session", "date", "rater", "rig"]].fillna("").astype(str)
    visit = text["session"].where(text["session"] != "", text["date"])
    whose = {
        "person": text["person"],
        "leg": text["person"] + "\0" + text["side"],
        "visit": text["person"] + "\0" + visit,
    }
    shared = {level: np.unique(of, return_inverse=True)[1] for level, of in whose.items()}
    counts = {level: int(of.max()) + 1 for level, of in shared.items()}
    kept_levels = {"person"} if counts["person"] < len(kept) else set()
    kept_levels |= {level for level in ("leg", "visit") if counts["person"] < counts[level] < len(kept)}
    found = {level: of for level, of in shared.items() if level in kept_levels}
    several = {name: np.unique(text[name], return_inverse=True)[1] for name in ("rater", "rig")}
    found |= {name: of for name, of in several.items() if of.max() > 0}
    names = tuple(text.replace(", by one more", EXPONENT) for text, _ in shown)
    repeated = counts["leg"] < len(kept)
    ages = kept["age"].to_numpy() if AGE in names else None
    given = Hierarchy(names, design[:, 1:], found, shared["leg"] if repeated else None, ages)
    return given, Likelihoods.of(list(kept["measure"]), repeated), list(kept["row"])


def sampled(members: Sequence[Member], rows: Sequence[Row], key: str, seed: int = 0) -> "PopulationFit":
    """Return the population of a parameter over a cohort."""
    given, known, names = hierarchy_of(members, rows, key)
    draws = PopulationSampler(given).draw(known, seed)
    generator = np.random.default_rng(seed)
    # Of somebody like those of the cohort: its groups and covariates as they are, and a rig before its steps.
    beside = [not name.startswith("step") for name in given.names]
    like = generator.integers(len(names), size=len(draws.mean))
    new = draws.mean + np.sum(given.design[like] * beside * draws.effects, axis=1)
    new = new + sum(sd * generator.normal(size=len(sd)) for sd in draws.sd.values())
    return PopulationFit(key, given, draws, tuple(names), float(np.mean(new)), float(np.std(new)))


def populations(members: Sequence[Member], rows: Sequence[Row], seed: int = 0) -> tuple["PopulationFit", ...]:
    """Return the populations of all stiffnesses that are positive throughout."""
    every = [found.measures for _, found in measured(rows, cohort_model(rows))]
    keys = dict.fromkeys(key for one in every for key, of in one.items() if of.unit == "kPa")
    positive = [key for key in keys if all(of[key].value > 0 for of in every if key in of)]
    return tuple(sampled(members, rows, key, seed) for key in positive)


def population_document(found: Sequence["PopulationFit"], members: Members, rows: Sequence[Row]) -> dict[str, Any]:
    """Return what ``population.json`` holds, which `legfem.inverse.population` reads."""
    people = {one.name: one.person for one in members.every}
    of_row = {row.name: people[row.member] for row in rows}
    source, law = members.folder.resolve().name, cohort_model(rows)
    entries = {one.key: one.document(len({of_row[name] for name in one.tests}), law, source) for one in found}
    return {"schema_version": 1, "parameters": json_types(entries)}


@dataclass(frozen=True, eq=False)
class PopulationFit:
    """What is known of a parameter over people."""

    key: str
    given: Hierarchy
    draws: Draws
    tests: tuple[str, ...]
    """Whose they are, in the order of ``draws.theta``."""
    log_median: float
    log_sd: float
    """Of the logarithm in somebody not yet seen, on any day: how people differ and how well that is known."""

    @property
    def converged(self) -> bool:
        """Whether the draws can be relied on."""
        return self.draws.effective > 100 and self.draws.divergent <= 0.01 * len(self.draws.mean)

    def document(self, people: int, law: str, source: str) -> dict[str, Any]:
        """Return what a file of priors holds of it; stiffness in kPa."""
        draws, ages = self.draws, self.given.log_ages

        def of(values: FloatArray, through: Callable[[Any], Any] = lambda v: v) -> dict[str, Any]:
            low, middle, high = through(np.quantile(values, (0.025, 0.5, 0.975)))
            return {"value": float(middle), "ci95": [float(low), float(high)]}

        return {
            "median": math.exp(self.log_median),
            "log_sd": self.log_sd,
            "people": people,
            "law": law,
            "source": source,
            "log_ages": ages if ages is None else [float(of(ages)) for of in (np.mean, np.std, np.min, np.max)],
            "mean": of(draws.mean, np.exp),
            "log_sd_of": {level: of(values) for level, values in draws.sd.items()},
            "log_effects": {name: of(draws.effects[:, k]) for k, name in enumerate(self.given.names)},
            "shrunk": {name: of(draws.theta[:, k], np.exp) for k, name in enumerate(self.tests)},
            "divergent_draws": draws.divergent,
            "least_effective_draws": draws.effective,
        }
