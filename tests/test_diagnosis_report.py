"""Reports of diagnoses: verdict, numbers and cautions are in the text; figures are all there."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from making import write_subject
from making_diagnosed import diagnosed, diagnosed_anew, diagnosed_of
from making_diagnosis import problem_of, ramps
from matplotlib.image import imread

from legfem.common.numbers import number, percent, probability
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.location import runs_within
from legfem.inverse.verdict import LARGE, answer_of
from legfem.legs.loading import load_subject
from legfem.report import diagnosis_numbers as tables
from legfem.report import results as report
from legfem.report.answers import headline_of
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.diagnosis_curves import leading, matched, model_name, places_of, signatures_of, strongest
from legfem.report.diagnosis_document import document
from legfem.report.diagnosis_sentences import next_experiments, verdict_sentence
from legfem.report.render import PAGE_FILES, plain_page

ASKED = ("fascia-stiffness", "force-drift", "support-compliance", "contact-onset")
TWINS = ("fascia-stiffness", "prestress", "force-drift")
"""The first two are alike in closed form."""
CASES = {
    "consistent": ({}, 0.0, ASKED),
    "named": ({"fascia-stiffness.factor": 4.0}, 0.0, ASKED),
    "ambiguous": ({"fascia-stiffness.factor": 4.0}, 0.0, TWINS),
    "unexplained": ({}, 2.0, ASKED),
}


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    folder = write_subject(tmp_path_factory.mktemp("report") / "made")
    return load_subject(folder, need_recordings=False)


@pytest.fixture(scope="module")
def found():
    made = {name: diagnosed(e, bump=b, asked=a) for name, (e, b, a) in CASES.items()}
    assert {name: d.verdict for name, d in made.items()} == {name: name for name in CASES}
    return made


def text_of(found, subject) -> str:
    return plain_page(diagnosis_web_page(found, subject), [])


def flat(text: str) -> str:
    return " ".join(text.split())


def test_a_page_of_what_there_was_time_for_claims_nothing_of_the_rest(found, subject):
    assert found["consistent"].limits
    cut = replace(
        found["consistent"], provisional=True, limits=(), assessment=replace(found["named"].assessment, scores=())
    )
    text = flat(text_of(cut, subject))
    assert "Verdict so far: CONSISTENT" in text and "Nothing was tested: there was no time." in text
    assert "None of them can change" not in text and "The table below says how strong" not in text


@pytest.mark.parametrize("verdict", CASES)
def test_page_states_verdict_origin_and_open_questions(found, subject, verdict):
    page = text_of(found[verdict], subject)
    text = flat(page)
    assert f"Verdict: {verdict.upper()}" in text and verdict_sentence(found[verdict]) in text
    assert text.index("*** SIMULATED DATA ***") < text.index("Verdict")
    assert "A constant factor on the force" in text, "a gain can't be told from the stiffness"
    assert "there is no 3D correction for this leg" in text
    assert "an effect of rate cannot be determined from one loading ramp" in text
    assert "3.70 mm of air before first contact" in text
    assert "No full finite-element solution confirmed" in text
    for line in next_experiments(found[verdict]):
        assert line[1:] in text
    assert max(len(line) for line in page.splitlines()) <= 100


def test_page_of_a_name_gives_its_size_its_evidence_and_the_stiffness_before_and_after(found, subject):
    named = found["named"]
    text = flat(text_of(named, subject))
    model, base = named.models[0], named.base_model
    alone = named.weighted_base
    factor = "fascia-stiffness.factor"
    low, high = model.interval(factor)
    spread = (high - low) / 4
    ends = f"{number(low, spread)} to {number(high, spread)}"
    assert (
        f"stiffness times thickness over the assumed one: {number(model.value(factor), spread)} (95 % {ends})" in text
    )
    assert f"{model.posterior.log_evidence - alone.posterior.log_evidence:.1f}" in text
    assert percent(model.probability) in text
    assert f"{named.base_held_out.rmse:.3f}" in text and f"{named.held_out[0].rmse:.3f}" in text
    assert "NOT confirmed" in text
    for name in (DEEP_C10, DEEP_C20):
        for one in (base, model):
            low, high = one.shown(name).ci95
            assert f"{number(low, (high - low) / 4)} to {number(high, (high - low) / 4)}" in text
    assert "over all explanations" in text
    confirmed = replace(named, models=(replace(model, confirmed=True),))
    assert "NOT confirmed" not in text_of(confirmed, subject)


def test_ambiguous_page_prefers_no_candidate(found, subject):
    page = flat(text_of(found["ambiguous"], subject))
    assert "left out one of these" in page and "this test cannot determine which of these" in page
    names = [model_name(model) for model in found["ambiguous"].models]
    assert set(names) == {"prestress", "fascia stiffness"}
    assert found["ambiguous"].models[0].probability < 0.9


def test_unexplained_page_warns_of_the_stiffness(found, subject):
    page = text_of(replace(found["unexplained"], misfit=LARGE), subject)
    assert "that is not a finding" in flat(page)
    stiffness = [line for line in re.split("^- ", page, flags=re.MULTILINE) if "C10, " in line]
    told = [line for line in stiffness if "(95 %" in line]
    assert len(told) == 3 and all("DO NOT RELY ON IT" in flat(line) for line in told)
    assert page.index("NO. Report no number.") < page.index("DO NOT RELY")
    (searched,) = (p.bounds for p in found["unexplained"].base_model.fit.parameters if p.name == DEEP_C10)
    assert replace(found["unexplained"], misfit=LARGE).intervals[DEEP_C10] == searched, "it may be off by any amount"


def test_a_page_gives_no_probability_to_what_describes_nothing(subject):
    observed = problem_of(ramps())[0].predictor.observed
    ripple = 0.2 * np.sin(2 * np.pi * observed.displacement)
    asked = ("contact-onset", "force-drift", "support-compliance")
    page = flat(text_of(diagnosed_of(observed.with_force(observed.force + ripple), asked), subject))
    assert re.search("comes closest of them, and explains [0-9]+ % of the misfit: that is", page)
    assert "something unknown over 99 %" in page


def test_consistent_page_claims_no_proof_shows_no_change_and_gives_upper_limits(found, subject):
    page = text_of(found["consistent"], subject)
    assert "no proof that nothing was left out" in flat(page)
    assert not re.search("  change$", page, re.MULTILINE) and "before and after" not in page
    assert "Where the base model is wrong" not in page
    limits = found["consistent"].limits
    assert {limit.name for limit in limits} == set(ASKED)
    for limit in limits:
        assert f"{number(limit.low)} to {number(limit.high)}" in flat(page)


def test_parameters_that_are_at_a_bound_or_unseen_are_flagged(found):
    model = found["named"].models[0]
    k = model.fit.free.index(DEEP_C20)
    assert tables.flag(model, DEEP_C10, 0.0) == ""

    def with_sd(sd: float):
        covariance = model.posterior.covariance.copy()
        covariance[k, k] = sd**2
        posterior = replace(model.posterior, covariance=covariance, components=None)
        return replace(model, posterior=posterior)

    values = {**model.fit.values, DEEP_C20: model.fit.parameters[k].bounds[1]}
    at_bound = replace(model, fit=replace(model.fit, values=values))
    assert tables.flag(at_bound, DEEP_C20, 0.0).startswith("AT THE BOUND")
    assert tables.flag(with_sd(0.99), DEEP_C20, 0.0).startswith("NOT DETERMINED")
    assert tables.interval(with_sd(0.99), DEEP_C20) == "not narrowed by this test"
    assert tables.flag(with_sd(0.5), DEEP_C20, 0.0) == "not distinguishable from 0"


def test_places_have_one_sign_and_hold_what_was_located(found):
    for name in ("named", "ambiguous", "unexplained"):
        diagnosis = found[name]
        places = places_of(diagnosis)
        covered = sum(len(place.stations) * len(place.trials) for place in places)
        assert covered == diagnosis.located.sum()
        assert all(place.noise > 0 for place in places)
    bump = max(places_of(found["unexplained"]), key=lambda place: place.weight)
    assert bump.displacement[0] <= 12.5 and bump.displacement[1] >= 11.5, "it was put at 12 mm"
    observed = found["unexplained"].observed
    marks = np.zeros(len(observed.force), dtype=int)
    marks[[1, 2]], marks[[3, 5]] = 1, -1
    assert [(k, run.tolist()) for k, run in runs_within(observed, marks)] == [(0, [1, 2]), (0, [3]), (0, [5])]
    whole = [set(observed.trial[run]) | {str(observed.phase[run[0]])} for _, run in runs_within(observed, marks**0)]
    assert len(whole) == len({*zip(observed.trial.tolist(), observed.segment.tolist(), strict=True)})
    assert all(len(one) == 2 for one in whole), "none goes on into another trial"


def test_ranking_shows_what_may_be_left_out_the_most_probable_first(found):
    for verdict in CASES:
        bars = tables.explanation_bars(found[verdict]).bars
        assert "nothing detectable" in {bar.name for bar in bars}
        assert "something unknown" in {bar.name for bar in bars} or verdict != "unexplained"
        values = [bar.value for bar in bars]
        assert values == sorted(values, reverse=True) and sum(values) <= 100.1
        assert {model_name(model) for model in found[verdict].models} <= {bar.name for bar in bars}


def test_signature_of_the_true_mechanism_matches_the_misfit(found):
    named = found["named"]
    assert leading(named)[0] == "fascia-stiffness"
    shape, share = matched(named, strongest(named, "fascia-stiffness"))
    base = named.weighted_base.fit
    assert share > 0.9, "the true mechanism's signature is nearly all of the misfit"
    left = named.errors.whitened(base.residual - shape)
    assert left @ left < base.chi2
    (block,) = signatures_of(named)
    difference, first, *_ = block.lines
    assert "reported" in first.name and "matches" in first.name
    assert np.linalg.norm(first.above - difference.above) < 0.3 * np.linalg.norm(difference.above)
    assert not signatures_of(found["consistent"])


@pytest.mark.parametrize(
    "verdict",
    [pytest.param(name, marks=[] if name in ("consistent", "ambiguous") else pytest.mark.slow) for name in CASES],
)
def test_report_lists_every_file_it_writes(found, subject, tmp_path, verdict):
    path = report.write_diagnosis_report(found[verdict], subject, tmp_path / "out")
    written = {entry.name for entry in path.parent.iterdir()}
    wanted = {"section", "recording"}
    wanted |= set() if verdict == "consistent" else {"signatures"}
    pictures = {f"{name}.png" for name in wanted}
    assert written == set(PAGE_FILES) | pictures
    assert all(name in path.read_text() for name in written - {"report.txt"})
    for name in wanted:
        picture = imread(path.parent / f"{name}.png")
        assert picture.shape[1] > 1000 and picture[..., :3].std() > 0.02


def test_a_neo_hookean_leg_gets_its_report(tmp_path):
    """Its base model has no C20."""
    folder = write_subject(tmp_path / "leg")
    toml = (folder / "subject.toml").read_text().replace("D2_per_MPa = 28.0\n", "")
    (folder / "subject.toml").write_text(toml.replace("reduced-polynomial", "neo-hookean"))
    subject = load_subject(folder, need_recordings=False)
    made = diagnosed({}, asked=ASKED, law="neo-hookean")
    path = report.write_diagnosis_report(made, subject, tmp_path / "out")
    assert "Press the leg" in (path.parent / "report.html").read_text()
    assert "C20" not in path.read_text()


def test_nothing_is_written_when_drawing_fails(found, subject, tmp_path, monkeypatch):
    def fail(*_):
        raise RuntimeError("no ink")

    monkeypatch.setattr(report, "signatures_of", fail)
    with pytest.raises(RuntimeError, match="no ink"):
        report.write_diagnosis_report(found["named"], subject, tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


def test_the_same_recordings_get_the_same_diagnosis(found, subject):
    effects, _, asked = CASES["ambiguous"]
    again = diagnosed_anew(effects, ramps(), 0.0, asked, 1)
    one, other = (document(d, subject, 1.0) for d in (found["ambiguous"], again))
    assert one == other
    noisier = diagnosed(effects, asked=asked, seed=2)
    assert document(noisier, subject, 1.0) != one


def test_numbers_have_the_digits_that_their_errors_leave():
    assert number(1.01893, 0.0017) == "1.019"
    assert number(0.996, 0.038) == "1.00"
    assert number(123.4, 20.0) == "123"
    assert number(0.0) == "0" and number(float("nan")) == "-"
    assert probability(5e-4) == "p < 0.001" and probability(None) == "p unknown"


@pytest.mark.parametrize(
    ("missing", "in_part", "heading"),
    [
        ({}, False, "The corrected model fits, and C10 may be off by 19 %."),
        ({}, True, "The corrected model fits in part, and C10 may be off by 19 %."),
        ({"viscoelasticity": ()}, True, "The corrected model fits, but not in all parts, and C10 may be off by 19 %."),
    ],
)
def test_a_model_that_explains_a_part_is_not_said_to_fit(monkeypatch, missing, in_part, heading):
    monkeypatch.setattr("legfem.inverse.verdict.wide", lambda found: True)
    model = SimpleNamespace(missing=missing, in_part=in_part, names=("fibres",), probability=0.9)
    given = {
        "misfit": SimpleNamespace(size=0.0),
        "aside": None,
        "base_model": SimpleNamespace(fit=SimpleNamespace(free=())),
        "weighed": (20, 20),
        "in_part": in_part,
    }
    found = SimpleNamespace(
        provisional=False, withheld=False, verdict="named", models=[model], may_be_off=0.19, **given
    )
    worded = headline_of(answer_of(found))
    assert (worded.tone, worded.heading) == ("caution", heading)
