"""Strengths measured by themselves: as good as integrating, and they settle what is open."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making_diagnosed import diagnosed, diagnosed_of
from making_diagnosis import SOUGHT, TRUTH, problem_of, ramps
from scipy.special import logsumexp
from scipy.stats import norm

from legfem.common.errors import InputError
from legfem.inverse.accuracy import MATERIAL_LOG_SD, Accuracy, MeasuredEffect, measured_strength, measured_strengths
from legfem.inverse.averaging import averaged_intervals
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.evidence import Evidence, possible_discrepancies
from legfem.inverse.explain import explain
from legfem.inverse.laplace import laplace_posterior
from legfem.inverse.map_fit import fit
from legfem.inverse.mechanism import null_of, prior_of
from legfem.legs.diagnosis import accuracy_of
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.mechanisms import mechanism_named, mechanisms
from legfem.report.diagnosis_headline import headline
from legfem.report.diagnosis_sentences import next_experiments

DRIFT = mechanism_named("force-drift")
SUPPORT = mechanism_named("support-compliance")


def reading(mechanism, value, sd):
    return measured_strength(mechanism, value, sd, Accuracy())


@pytest.fixture(scope="module")
def drifting():
    problem, base = problem_of(ramps(), {"force-drift.rate": 0.002}, seed=2)
    unknowns = possible_discrepancies(problem.predictor.observed, base.prediction)
    return problem, base, Evidence(problem.errors, unknowns), [u.log_prior for u in unknowns]


def test_a_reading_is_what_integrating_the_strength_says(drifting):
    """A drift is linear: held at many rates, each as likely as the reading makes it."""
    problem, base, evidence, shares = drifting
    read = reading(DRIFT, 0.0035, 0.0007)
    problem = replace(problem, measured=(read,))
    told = laplace_posterior(evidence, fit(problem, [DRIFT], base.values), shares)
    prior, name = prior_of(DRIFT.parameters[0]), "force-drift.rate"
    z = np.linspace(-1.0, 2.0, 121)
    logs, stiffness = [], []
    for one in z:
        held = fit(problem, [DRIFT], {**base.values, name: prior.value_at(one)}, (name,))
        given = laplace_posterior(evidence, held, shares)
        logs.append(given.log_evidence + norm.logpdf(one) + np.log(z[1] - z[0]))
        stiffness.append(given.mean[held.free.index(DEEP_C10)])
    weights = np.exp(np.array(logs) - logsumexp(logs))
    assert told.log_evidence == pytest.approx(float(logsumexp(logs)), abs=0.05)
    free = fit(problem, [DRIFT], base.values).free
    k = free.index(name)
    assert told.mean[k] == pytest.approx(float(weights @ z), abs=0.02)
    assert told.covariance[k, k] == pytest.approx(float(weights @ z**2 - (weights @ z) ** 2), rel=0.1)
    assert told.mean[free.index(DEEP_C10)] == pytest.approx(float(weights @ stiffness), abs=0.01)


def test_without_the_effect_a_reading_counts_against_it(drifting):
    problem, base, evidence, shares = drifting
    plain = laplace_posterior(evidence, base, shares).log_evidence
    for value in (0.0, 0.004):
        read = reading(DRIFT, value, 0.001)
        told = replace(base, problem=replace(problem, measured=(read,)))
        gained = laplace_posterior(evidence, told, shares).log_evidence - plain
        assert gained == pytest.approx(norm.logpdf(value / 0.001) - np.log(read.sd))


@pytest.mark.parametrize("gives_way", [True, False])
def test_a_dial_gauge_settles_whether_a_support_gives_way(gives_way):
    """Two effects that do the same here: what is read decides, whichever it is."""
    effects = {"support-compliance.compliance": 0.015}
    problem, base = problem_of(ramps(1), effects, seed=5)
    before = explain(base, SOUGHT)
    read = reading(SUPPORT, 0.015 if gives_way else 0.0, 0.002)
    after = explain(replace(base, problem=replace(problem, measured=(read,))), SOUGHT)

    def held(found):
        return sum(e.probability for e in found.every if SUPPORT.name in e.names)

    assert 0.02 < held(before) < 0.9, "nothing would be to be settled"
    assert held(after) > 0.95 if gives_way else held(after) < held(before)
    if gives_way:
        low, high = next(averaged_intervals(after, DEEP_C10))
        wide = next(averaged_intervals(before, DEEP_C10))
        assert high - low < wide[1] - wide[0]
        assert low <= TRUTH[DEEP_C10] <= high


def test_what_was_measured_is_not_asked_for_again():
    """A fascia that is named, and was measured."""
    effects = {"fascia-stiffness.factor": 4.0}
    plain = diagnosed(effects, asked=("fascia-stiffness", "force-drift"))
    read = Accuracy(effects=(MeasuredEffect("fascia-stiffness", 4.0, 1.0, "shear waves"),))
    found = diagnosed_of(plain.observed, ("fascia-stiffness", "force-drift"), accuracy=read)
    assert plain.verdict == found.verdict == "named"
    assert len(next_experiments(plain)) == 1 and next_experiments(found) == []
    to_do = dict(headline(found, ()).answers)["What to do"]
    assert to_do.startswith("Use the corrected number. What could settle the cause was recorded already")


def test_what_is_assumed_may_be_off_beside_a_reading():
    fascia = mechanism_named("fascia-stiffness")
    sd = prior_of(fascia.parameters[0]).sd * reading(fascia, 2.0, 0.3).sd
    assert sd == pytest.approx(np.hypot(0.3, MATERIAL_LOG_SD["fascia.C10"]))
    assert reading(SUPPORT, 0.1, 0.02).sd == pytest.approx(0.02 / 0.2)


def test_readings_of_effects_that_are_not_weighed_tell_nothing():
    given = Accuracy(effects=(MeasuredEffect("force-drift", 0.001, 0.001, "zeros"),))
    assert not list(measured_strengths(given, [SUPPORT]))
    (one,) = measured_strengths(given, [SUPPORT, DRIFT])
    assert one.name == "force-drift.rate" and one.prior_z == pytest.approx(np.arcsinh(0.2))


@pytest.mark.parametrize("mechanism", mechanisms(), ids=lambda m: m.name)
def test_what_can_be_measured_is_a_strength_that_matters(mechanism):
    """A reading that couldn't tell a usual strength from none wouldn't be worth proposing."""
    if mechanism.measured_sd is not None:
        assert reading(mechanism, null_of(mechanism.parameters[0]), mechanism.measured_sd).sd < 0.7


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copytree(SUBJECTS.find("3"), tmp_path / "leg")
    return tmp_path / "leg"


def stated(folder: Path, *tables: str) -> Path:
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text() + "".join(f"\n[[measured]]\n{table}\n" for table in tables))
    return folder


def test_a_folder_states_what_was_measured(folder):
    table = 'effect = "support-compliance"\nvalue = 0.01\nsd = 0.02\nsource = "dial gauge"'
    found = load_subject(stated(folder, table))
    assert found.measured == (MeasuredEffect("support-compliance", 0.01, 0.02, "dial gauge"),)
    assert accuracy_of(found).effects == found.measured


@pytest.mark.parametrize(
    ("tables", "field", "remedy"),
    [
        (['effect = "suport"\nvalue = 0.1\nsd = 0.02'], "measured.0.effect", "support-compliance"),
        (['effect = "contact-slip"\nvalue = 3\nsd = 0.1'], "measured.0.value", "0 to 1"),
        (['effect = "dermis"\nvalue = 0.1\nsd = 0'], "measured.0.sd", "above 0"),
        (['effect = "dermis"\nsd = 0.1'], "measured.0.value", "add it"),
        (['effect = "dermis"\nvalue = 0.1\nsd = 0.1'] * 2, "measured.1.effect", "mean"),
    ],
)
def test_a_wrong_reading_is_one_line(folder, tables, field, remedy):
    with pytest.raises(InputError) as error:
        accuracy_of(load_subject(stated(folder, *tables)))
    line = str(error.value)
    assert field in line and "\n" not in line
    print(line)
    assert remedy in line
