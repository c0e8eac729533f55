"""Whether what is named is there in every part of the recordings: trials, phases, depths and channels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosed import BASE, diagnosed_of
from making_diagnosis import NOISE, mechanisms_in, observations, problem_of, ramps
from test_channels_weighed import Seen, seen

from legfem.inverse.errors import error_model
from legfem.inverse.linearised import ShareOfPart, shares_by_part
from legfem.inverse.map_fit import fit
from legfem.inverse.predictor import Predictor
from legfem.inverse.verdict import Diagnosis
from legfem.mechanisms import mechanism_named
from legfem.report.diagnosis_headline import headline
from legfem.report.diagnosis_numbers import statement_name
from legfem.report.diagnosis_sentences import verdict_sentence

DRIFT = mechanism_named("force-drift")
CHANNELS = ("fat_thickness", "muscle_thickness", "lateral_force")


def of_drift(rates: tuple[float, ...], seed: int) -> tuple[float, list[ShareOfPart]]:
    """Return the rate that is fitted to trials whose zeros drift each at its own (N/s), and its shares in them."""
    time = observations(ramps(3))[0].time
    trial = observations(ramps(3))[0].trial
    problem, base = problem_of(ramps(3), {}, seed, np.array(rates)[trial] * time)
    fitted = fit(problem, [DRIFT], base.values)
    found = shares_by_part(fitted)["force-drift"]
    return fitted.values["force-drift.rate"], [one for one in found if one.part.startswith("trial")]


def test_shares_of_trials_are_their_own_strengths_over_the_one_fitted() -> None:
    """A drift is linear in its rate, so that each trial's is its share of the fitted one; in all seeds by its sd."""
    rates, away = (0.03, 0.035, 0.045), []
    for seed in range(8):
        rate, shares = of_drift(rates, seed)
        away += [(one.share * rate - own) / (one.sd * rate) for one, own in zip(shares, rates, strict=True)]
        assert len(shares) == 3 and not any(one.missing for one in shares)
    assert 0.4 < np.std(away) < 1.5 and np.abs(away).max() < 4.0


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_one_trial_has_is_missing_from_the_others(seed: int) -> None:
    _, shares = of_drift((0.0, 0.05, 0.0), seed)
    assert [one.missing for one in shares] == [True, False, True]
    assert shares[1].share > 2.0 > shares[1].others


def test_what_no_trial_has_is_missing_from_none() -> None:
    """Held at a drift upwards where all drift downwards, one of them by more."""
    name, observed = "force-drift.rate", observations(ramps(3))[0]
    rates = np.array([-0.05, -0.03, -0.03])
    problem, base = problem_of(ramps(3), {}, 1, rates[observed.trial] * observed.time)
    shares = shares_by_part(fit(problem, [DRIFT], {**base.values, name: 0.05}, (name,)))["force-drift"]
    assert all(one.share < -0.3 for one in shares) and not any(one.missing for one in shares)


def pushed(channels_too: bool, seed: int) -> Diagnosis:
    """Return the diagnosis of a leg pushed back by springs of 0.25 mm/N, or of a cell that reads as much less."""
    observed = seen(ramps(3), CHANNELS)
    predictor = Predictor(observed, Seen(), "reduced-polynomial")
    effects = {"support-compliance.compliance": 0.25, "support-compliance.at_bones": 0.0}
    readings = predictor({**BASE, **effects}, mechanisms_in(effects))
    if not channels_too:
        readings[len(observed.force) :] = predictor(BASE)[len(observed.force) :]
    errors = error_model(observed.with_values(readings), NOISE, readings)
    drawn = errors.draw(1, np.random.default_rng(seed))[0]
    asked = ("support-compliance", "force-drift", "preconditioning")
    return diagnosed_of(observed.with_values(readings + drawn), asked, library=Seen())


@pytest.mark.parametrize("seed", [1, 2])
def test_springs_behind_a_leg_are_named_where_its_layers_give_way_too(seed: int) -> None:
    found = pushed(True, seed)
    first = found.explained.statements()[0]
    assert first.names == ("support-compliance",) and not first.like and first.probability > 0.8
    assert not found.models[0].missing


@pytest.mark.parametrize("seed", [1, 2])
def test_a_force_that_gives_way_while_the_layers_do_not_is_no_support(seed: int) -> None:
    found = pushed(False, seed)
    sure = [one for one in found.explained.statements() if one.probability > 0.8]
    assert not any(one.names for one in sure)
    for one in found.explained.statements():
        if one.like:
            assert "like support compliance" in statement_name(one)
            assert "not seen in" in verdict_sentence(found)
            assert "looks as if" in dict(headline(found, ()).answers)["Problems found"]


def test_parts_that_are_set_aside_tell_nothing() -> None:
    """Without the one trial that has it, nothing is left to compare."""
    observed = observations(ramps(3))[0]
    problem, base = problem_of(ramps(3), {}, 1, 0.05 * observed.time * (observed.trial == 1))
    rest = replace(problem.setting_aside(observed.trial == 1), kept=None)
    shares = shares_by_part(fit(rest, [DRIFT], base.values))["force-drift"]
    assert not any(one.missing for one in shares)
    assert "trial2" not in {one.part for one in shares}
