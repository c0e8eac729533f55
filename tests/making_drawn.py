"""Results of all kinds with drawn numbers, sound and unsound, for what pages make of them: nothing is solved."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from making_cohort import Truth, fabricated
from making_diagnosed import diagnosed
from making_diagnosis import ramps, two_rates
from making_pages import specimens, stocking, subject_in
from making_results import measured_curve, result

from legfem.common.errors import Doubt
from legfem.inverse.answer import doubted
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import Fit, Goodness, OwnEstimate
from legfem.inverse.parameter import Prior
from legfem.inverse.verdict import Diagnosis
from legfem.legs.subject import SitedLeg
from legfem.report.cohort import cohort_web_page
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.kinds import page_of
from legfem.report.page import WebPage
from legfem.specimens.details import weighed
from legfem.specimens.model_discrepancy import ApartTest, TestsAgreement

type Drawn = np.random.Generator

RELAXES = {
    "viscoelasticity.ratio": 0.6,
    "viscoelasticity.relaxation_time": 8.0,
    "viscoelasticity.spread": 1.5,
    "viscoelasticity.slow": 0.1,
}
DIAGNOSED: Mapping[str, tuple[Mapping[str, float], bool, float, tuple[str, ...] | None]] = {
    "nothing": ({}, False, 0.0, ("fascia-stiffness", "force-drift", "support-compliance", "preconditioning")),
    "nothing at two rates": ({}, True, 0.0, ("viscoelasticity", "force-drift", "preconditioning")),
    "fascia": ({"fascia-stiffness.factor": 4.0}, False, 0.0, ("fascia-stiffness", "force-drift")),
    "fascia or tension": (
        {"fascia-stiffness.factor": 4.0},
        False,
        0.0,
        ("fascia-stiffness", "prestress", "force-drift"),
    ),
    "relaxation": (RELAXES, True, 0.0, ("viscoelasticity", "force-drift")),
    "a bump": ({}, False, 2.0, ("fascia-stiffness", "force-drift", "support-compliance")),
}
"""Effects, whether they were held and pressed at two rates, a bump (N), and the mechanisms that are tried."""


@cache
def _folder() -> Path:
    return Path(tempfile.mkdtemp())


@cache
def _subject():
    return subject_in(_folder())


@cache
def _curve(depth: float):
    return measured_curve(depth=depth)


@cache
def _specimens() -> Fit:
    return specimens(_folder())[0]


@cache
def _stocking() -> Fit:
    return stocking()


@cache
def _diagnosed(name: str) -> Diagnosis:
    effects, rates, bump, asked = DIAGNOSED[name]
    return diagnosed(effects, two_rates(1) if rates else ramps(), bump, asked)


def estimate(draw: Drawn, known: Estimate, fits: bool) -> Estimate:
    """Return an estimate with another value and interval: narrow, wide, lopsided, at a bound, all that was searched."""
    parameter, (low, high) = known.parameter, known.parameter.bounds
    if draw.random() < 0.2:
        parameter = replace(parameter, role="nuisance", prior=Prior(known.value or 1e-3, 0.4, "log"))
    value = float(np.clip(known.value * np.exp(draw.normal(0.0, 0.5)), low, high))
    kind = draw.choice(["usual", "wide", "bound", "searched"], p=[0.6, 0.2, 0.1, 0.1])
    size = 0.05 if kind == "usual" else 1.5
    if kind == "bound":
        value = low if draw.random() < 0.5 else high
    ends = [value * np.exp(side * size * draw.exponential()) for side in (-1, 1)]
    ends = [low, high] if kind == "searched" else list(np.clip(ends, low, high))
    interval = float(min(ends[0], value)), float(max(ends[1], value))
    error = max((interval[1] - interval[0]) / 4, 1e-9)
    made = replace(known, parameter=parameter, value=value, standard_error=error, ci95=interval)
    return replace(made, identifiability=made.verdict(fits))


def goodness(draw: Drawn) -> Goodness:
    """Return one that fits in two of three draws."""
    return Goodness(30.0, 28, float(draw.uniform(0.002, 1.0) if draw.random() < 0.7 else 10 ** draw.uniform(-300, -4)))


def doubts(draw: Drawn) -> tuple:
    """Return up to two doubts, of known sizes and unknown."""
    sizes = draw.choice([0.002, -0.3, np.nan], draw.integers(0, 3))
    effects = [None if np.isnan(size) else float(size) for size in sizes]
    return doubted(Doubt("a.csv", f"field{k}", "is odd", "look", "", one) for k, one in enumerate(effects))


def of_leg(draw: Drawn) -> WebPage:
    """Return the page of a leg, of one or two sites."""
    fits, good, curve = [], goodness(draw), _curve(float(draw.choice([8.0, 26.0])))
    several = draw.random() < 0.3
    for law in ("neo-hookean", "reduced-polynomial"):
        made = result(law, curve, _subject(), goodness=good, weighting=str(draw.choice(["paper", "covariance"])))
        known = {name: estimate(draw, one, good.fits) for name, one in made.estimates.items()}
        made = replace(made, estimates=known, notices=(*doubts(draw), *made.notices))
        if several:
            own = [
                {n: OwnEstimate(e.value, 1e-4, float(draw.normal(0.0, 2.0))) for n, e in known.items()} for _ in "ab"
            ]
            tests = tuple(replace(made.tests[0], name=f"site {k}", by_itself=one) for k, one in enumerate(own))
            sites = tuple(replace(made.details.leg.sites[0], site=f"site {k}") for k in range(2))
            leg = SitedLeg("made", "Made for a test", sites, sites[0].directory)
            details = replace(made.details, leg=leg, corrections=(None, None))
            made = replace(made, tests=tests, details=details, agreement=goodness(draw))
        fits.append(made)
    return page_of(fits)


def of_specimens(draw: Drawn) -> WebPage:
    """Return the page of specimens, of which the ends may be unknown and the tests several."""
    made, good = _specimens(), goodness(draw)
    details = replace(made.details, left_out=made.details.left_out if draw.random() < 0.3 else ())
    if draw.random() < 0.4:
        by = [float(np.exp(draw.normal(0.0, 0.06))) for _ in range(3)]
        each = (ApartTest(f"test {k}", 0.0, one, (one - 0.06, one + 0.06)) for k, one in enumerate(by))
        details = replace(details, agreement=TestsAgreement(float(draw.uniform()), tuple(each)))
    known = {name: estimate(draw, one, good.fits) for name, one in made.estimates.items()}
    made = replace(made, estimates=known, goodness=good, details=details, notices=doubts(draw))
    if draw.random() < 0.3:
        others = {
            name: replace(made, estimates={n: estimate(draw, e, good.fits) for n, e in known.items()}) for name in "ab"
        }
        chances = dict(zip("ab", map(float, draw.dirichlet([1.0, 0.3])), strict=True))
        made = weighed(others, chances, {"a": "ends that slide", "b": "ends that stick"}, "Film it")
    return page_of([made])


def of_diagnosis(draw: Drawn) -> WebPage:
    """Return the page of a diagnosis whose explanations are as probable, and as certain, as was drawn."""
    found = _diagnosed(str(draw.choice(list(DIAGNOSED))))
    wider = float(np.exp(draw.normal(0.5, 1.0)))

    def changed(one):
        posterior = replace(one.posterior, covariance=wider**2 * one.posterior.covariance, components=None)
        return replace(one, posterior=posterior)

    noise = replace(found.errors.noise, beyond_way=float(draw.choice([0.0, 0.06])))
    base = changed(found.explained.base)
    problem = replace(base.problem, errors=replace(base.problem.errors, noise=noise))
    base = replace(base, fit=replace(base.fit, problem=problem))
    every = tuple(base if one.is_base else changed(one) for one in found.explained.every)
    explained = replace(found.explained, every=every, base=base)
    models = tuple(one for one in explained.listed() if one.names) if found.models else ()
    same = found.base_model.fit is found.explained.base.fit
    made = replace(
        found,
        explained=explained,
        base_model=base if same else changed(found.base_model),
        models=models,
        held_out=(found.base_held_out,) * len(models),
        misfit=replace(found.misfit, size=float(draw.choice([0.005, 0.05]))),
    )
    return diagnosis_web_page(made, _subject(), ())


def of_stocking(draw: Drawn) -> WebPage:
    """Return the page of a leg in its stocking."""
    made = _stocking()
    return page_of([replace(made, notices=(*doubts(draw), *made.notices))])


def of_cohort(draw: Drawn) -> WebPage:
    """Return the page of a cohort."""
    truth = Truth(*(float(x) for x in np.abs(draw.normal(0.0, 0.2, 4))), group=float(draw.normal(0.0, 0.3)))
    return cohort_web_page(
        *fabricated(int(draw.integers(3, 9)), truth=truth, seed=int(draw.integers(1000))), "identify"
    )


KINDS: Mapping[str, tuple[int, Callable[[Drawn], WebPage]]] = {
    "leg": (110, of_leg),
    "specimens": (80, of_specimens),
    "diagnosis": (70, of_diagnosis),
    "stocking": (20, of_stocking),
    "cohort": (20, of_cohort),
}
"""How many are drawn of a kind: 300 in all."""
