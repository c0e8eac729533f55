"""Mechanisms: nothing at their nulls, found by the registry, judged by what was recorded."""

from __future__ import annotations

import importlib.metadata
import logging
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from making_diagnosis import TRUTH, observations, ramps, two_rates
from scipy.stats import norm

from legfem import mechanisms as registered
from legfem.common import registry
from legfem.inverse.correction import read_correction
from legfem.inverse.mechanism import null_of, prior_of, strength
from legfem.inverse.parameter import Parameter
from legfem.inverse.predictor import onset_name
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import with_correction
from legfem.mechanisms import Mechanism, TissueMechanism, mechanism_named, mechanisms
from legfem.mechanisms.time_dependence import TIMES_S, spectrum

EVERY = with_correction(mechanisms(), read_correction(REFERENCE))


@pytest.fixture(scope="module")
def blank():
    return observations(two_rates())


@pytest.mark.parametrize("mechanism", EVERY, ids=lambda m: m.name)
def test_a_mechanism_vanishes_at_its_null(mechanism, blank):
    """Whatever its other parameters are: those that a search begins from, and odd ones."""
    observed, predictor = blank
    first, *rest = mechanism.parameters
    odd = {p.name: p.inside(prior_of(p).value_at(0.7)) for p in rest}
    for shape in (*mechanism.starts(observed), {first.name: 0.0, **odd}):
        values = {f"{mechanism.name}.{key}": value for key, value in shape.items()}
        values |= {**TRUTH, f"{mechanism.name}.{first.name}": null_of(first)}
        np.testing.assert_allclose(predictor(values, [mechanism]), predictor(TRUTH), rtol=1e-12)


@pytest.mark.parametrize("mechanism", [m for m in EVERY if not isinstance(m, TissueMechanism)], ids=lambda m: m.name)
def test_a_mechanism_that_needs_no_solution_does_something_off_its_null(mechanism, blank):
    observed, predictor = blank
    for values in mechanism.starts(observed):
        full = {f"{mechanism.name}.{key}": value for key, value in values.items()}
        change = predictor({**TRUTH, **full}, [mechanism]) - predictor(TRUTH)
        assert np.abs(change).max() > 1e-3


@pytest.mark.parametrize("mechanism", mechanisms(), ids=lambda m: m.name)
def test_a_mechanism_says_what_it_is_and_what_is_known_of_it(mechanism, blank):
    observed, _ = blank
    assert mechanism_named(mechanism.name) is mechanism
    assert mechanism.statement and mechanism.next_experiment
    names = [p.name for p in mechanism.parameters]
    for p in mechanism.parameters:
        prior = prior_of(p)
        assert prior.source and p.statement
        assert p.bounds[0] <= prior.centre <= p.bounds[1]
    for start in mechanism.starts(observed):
        assert list(start) == names
        for p in mechanism.parameters:
            assert p.bounds[0] <= start[p.name] <= p.bounds[1]
        assert start[names[0]] != null_of(mechanism.parameters[0])
    if isinstance(mechanism, TissueMechanism) and mechanism.strengths:
        first = mechanism.parameters[0]
        assert null_of(first) not in mechanism.strengths
        assert all(first.bounds[0] <= s <= first.bounds[1] for s in mechanism.strengths)


def test_an_effect_of_rate_is_not_sought_in_one_ramp():
    observed, _ = observations(ramps())
    for name in ("viscoelasticity", "superficial-viscoelasticity", "poroelastic-drainage"):
        why = mechanism_named(name).untestable(observed)
        assert why is not None
        assert "one loading ramp" in why


def test_preconditioning_is_not_sought_in_one_trial():
    observed, _ = observations(ramps(1))
    assert mechanism_named("preconditioning").untestable(observed) is not None


def test_a_stiffer_first_trial_fades_and_varies_with_depth():
    observed, _ = observations(ramps())
    values = {"softening": 0.2, "fading": 0.5, "slope": -1.0, "staying": 1.0}
    factor = mechanism_named("preconditioning").deep_factor(values, observed)
    middle = np.abs(observed.displacement / observed.depth - 0.5) < 0.02
    for trial, excess in enumerate((0.2, 0.1, 0.05)):
        here = observed.trial == trial
        assert factor[here & middle].mean() == pytest.approx(1 + excess, abs=0.01)
        assert factor[here][0] - factor[here][-1] == pytest.approx(excess, rel=0.1)


def test_a_trial_s_onset_moves_that_trial_alone(blank):
    observed, predictor = blank
    moved = predictor({**TRUTH, onset_name(1): 0.5}) - predictor(TRUTH)
    assert not np.any(moved[observed.trial != 1])
    deep = (observed.trial == 1) & (observed.displacement > 5)
    assert np.all(moved[deep] < 0)


@pytest.mark.parametrize("time", [0.05, 0.3, 8.0, 150.0, 900.0])
@pytest.mark.parametrize("spread", [0.0, 0.4, 1.5, 4.0])
def test_shares_of_a_spectrum_sum_to_one(time, spread):
    shares = np.array(spectrum(time, spread))
    assert shares.sum() == pytest.approx(1.0, abs=1e-12)
    assert np.all(shares >= 0)


def test_a_narrow_spectrum_is_one_branch():
    for k, time in enumerate(TIMES_S):
        shares = np.array(spectrum(time, 1e-3))
        assert shares[k] > 0.95, "the rest is what a step between the spectrum's points makes"
    between = np.array(spectrum(float(np.sqrt(TIMES_S[2] * TIMES_S[3])), 1e-3))
    assert between[2] == pytest.approx(between[3], abs=0.05)
    assert between[2] + between[3] == pytest.approx(1.0, abs=1e-6)


def test_a_wide_spectrum_relaxes_in_proportion_to_the_logarithm_of_time():
    """Against a straight line in ln t, and the integral over the spectrum itself."""
    middle, spread = 7.0, 3.0
    t = np.geomspace(1.0, 40.0, 30)
    shares = np.array(spectrum(middle, spread))
    relaxed = shares @ np.exp(-t[None, :] / np.array(TIMES_S)[:, None])
    line = np.polynomial.Polynomial.fit(np.log(t), relaxed, 1)(np.log(t))
    assert np.abs(relaxed - line).max() < 0.02 * np.ptp(relaxed)
    one = np.exp(-t / middle)
    straight = np.polynomial.Polynomial.fit(np.log(t), one, 1)(np.log(t))
    assert np.abs(one - straight).max() > 0.08 * np.ptp(one), "one branch levels off"
    # The branches stand for times from the shortest to the longest; what lies beyond is at these.
    logs = np.linspace(np.log(middle) - 9 * spread, np.log(middle) + 9 * spread, 20001)
    density = norm.pdf(logs, np.log(middle), spread)
    within = np.clip(np.exp(logs), TIMES_S[0], TIMES_S[-1])
    course = np.exp(-t[:, None] / within[None, :])
    exact = np.trapezoid(density[None, :] * course, logs, axis=1)
    np.testing.assert_allclose(relaxed, exact, atol=0.02)


@dataclass(frozen=True)
class Lifted(Mechanism):
    """A mechanism of another package."""

    name: ClassVar[str] = "lifted"
    statement: ClassVar[str] = "the leg was lifted"
    parameters: ClassVar[tuple[Parameter, ...]] = (strength("size", "N", "of the lift", 0.1, (0.0, 2.0)),)
    next_experiment: ClassVar[str] = "leave it where it is"


@dataclass(frozen=True)
class Entry:
    """An entry point, working or not."""

    name: str
    what: object

    def load(self):
        """Return what it points at, or fail as a package that isn't whole does."""
        if isinstance(self.what, Exception):
            raise self.what
        return self.what


@pytest.fixture
def entries(monkeypatch):
    """Stand in for the entry points of installed packages; the registry forgets them after."""
    given: list[Entry] = []

    def fake(*, group):
        return given if group == "legfem.mechanisms" else []

    monkeypatch.setattr(importlib.metadata, "entry_points", fake)
    monkeypatch.setattr(registry, "entry_points", fake)
    registered.mechanisms.cache_clear()
    yield given
    monkeypatch.undo()
    registered.mechanisms.cache_clear()


def test_an_entry_point_adds_a_mechanism(entries):
    entries.append(Entry("lifted", Lifted))
    found = registered.mechanisms()
    assert registered.mechanism_named("lifted") == Lifted()
    assert [m.name for m in found] == sorted(m.name for m in found)
    assert len(found) == 1 + len({m.name for m in found} - {"lifted"})


@pytest.mark.parametrize("what", [ImportError("no such module"), lambda: None, 7])
def test_an_entry_point_that_is_broken_costs_a_line_only(entries, caplog, what):
    entries += [Entry("broken", what), Entry("lifted", Lifted)]
    with caplog.at_level(logging.WARNING, "legfem"):
        names = [m.name for m in registered.mechanisms()]
    assert "lifted" in names and "viscoelasticity" in names
    assert [record.name for record in caplog.records] == ["legfem"]
    assert "entry point broken can't be used" in caplog.text


def test_a_name_that_no_mechanism_has_is_refused():
    with pytest.raises(KeyError, match="levitation"):
        mechanism_named("levitation")
