"""Reports of diagnoses: verdict, numbers and cautions are in the text; figures are all there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making import write_subject
from making_diagnosed import diagnosed
from matplotlib.image import imread

from legfem.diagnose.document import document
from legfem.diagnose.sentences import next_experiments, verdict_sentence
from legfem.diagnose.windows import runs
from legfem.report import diagnosis as report
from legfem.report import diagnosis_tables as tables
from legfem.report.diagnosis_text import diagnosis_page
from legfem.report.located import places_of
from legfem.report.ranking_figure import ranking
from legfem.report.signature_figure import leading, matched, strongest
from legfem.report.words import number, probability
from legfem.subject import load_subject

ASKED = ("fascia-stiffness", "force-drift", "support-compliance", "contact-onset")
CASES = {
    "consistent": ({}, 0.0),
    "named": ({"contact-onset.offset": 0.3}, 0.0),
    "ambiguous": ({"fascia-stiffness.excess": 1.5}, 0.0),
    "unexplained": ({}, 0.6),
}


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    folder = write_subject(tmp_path_factory.mktemp("report") / "made")
    return load_subject(folder, need_recordings=False)


@pytest.fixture(scope="module")
def found():
    made = {name: diagnosed(e, bump=b, asked=ASKED) for name, (e, b) in CASES.items()}
    assert {name: d.verdict for name, d in made.items()} == {name: name for name in CASES}
    return made


def flat(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.parametrize("verdict", CASES)
def test_page_states_verdict_origin_and_open_questions(found, subject, verdict):
    page = diagnosis_page(found[verdict], subject, [])
    text = flat(page)
    assert f"Verdict: {verdict.upper()}" in text
    assert verdict_sentence(found[verdict]) in text
    assert text.index("*** SIMULATED DATA ***") < text.index("Verdict")
    assert "A constant factor on the force" in text, "a gain can't be told from the stiffness"
    assert "there is no 3D correction for this leg" in text
    assert "an effect of rate can't be told from one loading ramp" in text
    assert "3.70 mm of air before first contact" in text
    assert "No full finite-element solution was made" in text
    for line in next_experiments(found[verdict]):
        assert line[1:] in text
    assert max(len(line) for line in page.splitlines()) <= 100


def test_page_of_a_name_gives_its_size_its_evidence_and_the_stiffness_before_and_after(
    found, subject
):
    named = found["named"]
    text = flat(diagnosis_page(named, subject, []))
    model = named.models[0]
    offset = "contact-onset.offset"
    assert f"{number(model.fit.values[offset], model.fit.sd(offset))} mm" in text
    assert f"{named.base.fit.bic - model.fit.bic:.0f}" in text
    assert f"{named.base_held_out.rmse:.3f}" in text and f"{model.held_out.rmse:.3f}" in text
    assert "NOT confirmed" in text
    for name in ("C10", "C20"):
        for fitted in (named.base.fit, model.fit):
            low, high = (number(end, fitted.sd(name)) for end in fitted.interval(name))
            assert f"{low} to {high}" in text
    candidate = replace(model.candidate, confirmed=True)
    confirmed = replace(named, models=(replace(model, candidate=candidate),))
    assert "NOT confirmed" not in diagnosis_page(confirmed, subject, [])


def test_ambiguous_page_prefers_no_candidate(found, subject):
    page = flat(diagnosis_page(found["ambiguous"], subject, []))
    assert "What it left out is one of these" in page
    assert "fascia stiffness; force drift: each explains the recordings" in page
    assert "Which of them it is can't be said" in page


def test_unexplained_page_warns_of_the_stiffness(found, subject):
    page = diagnosis_page(found["unexplained"], subject, [])
    assert "DO NOT RELY ON THIS STIFFNESS" in page
    assert "that is not a finding" in flat(page)
    assert page.index("DO NOT RELY") < page.index("C10 (kPa)")


def test_consistent_page_claims_no_proof_and_shows_no_change(found, subject):
    page = diagnosis_page(found["consistent"], subject, [])
    assert "no proof that nothing was left out" in flat(page)
    assert "  change" not in page and "before and after" not in page
    assert "Where the base model is wrong" not in page


def test_parameters_that_are_at_a_bound_or_unseen_are_flagged(found):
    fitted = found["named"].models[0].fit
    assert tables.flag(replace(fitted, at_bound=("C20",)), "C20", 0.0).startswith("AT THE BOUND")
    jacobian = fitted.jacobian.copy()
    jacobian[:, fitted.free.index("C20")] = 0.0
    blind = replace(fitted, jacobian=jacobian)
    assert tables.flag(blind, "C20", 0.0).startswith("NOT SEEN")
    assert tables.interval(blind, "C20") == "unknown"
    assert tables.flag(replace(fitted, jacobian=1e-3 * fitted.jacobian), "C20", 0.0) == (
        "can't be told from 0"
    )
    assert tables.flag(fitted, "C10", 0.0) == ""


def test_places_have_one_sign_and_hold_what_was_located(found):
    for name in ("named", "ambiguous", "unexplained"):
        diagnosis = found[name]
        places = places_of(diagnosis)
        covered = sum(len(place.stations) * len(place.trials) for place in places)
        assert covered == diagnosis.located.sum()
        assert all(place.noise > 0 for place in places)
    bump = max(places_of(found["unexplained"]), key=lambda place: place.weight)
    assert bump.displacement[0] <= 12.5 and bump.displacement[1] >= 11.5, "it was put at 12 mm"
    assert runs(np.array([0, 1, 1, -1, 0, -1])) == [(1, 3), (3, 4), (5, 6)]
    assert runs(np.array([1])) == [(0, 1)]


def test_ranking_marks_what_is_reported(found):
    entries = ranking(found["ambiguous"])
    assert [entry.name for entry in entries if entry.reported] == [
        "fascia stiffness", "force drift"
    ]  # fmt: skip
    assert entries[0].above_best == 0 and "base model" in [entry.name for entry in entries]
    assert not any(entry.reported for entry in ranking(found["unexplained"]))


def test_signature_of_the_true_mechanism_matches_the_misfit(found):
    named = found["named"]
    assert leading(named)[0] == "contact-onset"
    shape, share = matched(named, strongest(named, "contact-onset"))
    base = named.base.fit
    assert share > 0.9, "the true mechanism's signature is nearly all of the misfit"
    left = named.errors.whitened(base.residual - shape)
    assert left @ left < base.chi2 - 20


@pytest.mark.parametrize("verdict", CASES)
def test_report_lists_every_file_it_writes(found, subject, tmp_path, verdict):
    path = report.write_diagnosis_report(found[verdict], subject, tmp_path / "out")
    written = {entry.name for entry in path.parent.iterdir()}
    wanted = {"recording", "parameters"}
    wanted |= {"tests"} if verdict == "consistent" else {"signatures", "ranking"}
    pictures = {f"{name}.png" for name in wanted}
    small = {f"{name}.svg" for name in wanted - {"recording", "signatures"}}
    assert written == {"report.txt"} | pictures | small
    assert all(name in path.read_text() for name in written - {"report.txt"})
    for name in wanted:
        picture = imread(path.parent / f"{name}.png")
        assert picture.shape[1] > 1000 and picture[..., :3].std() > 0.02


def test_nothing_is_written_when_drawing_fails(found, subject, tmp_path, monkeypatch):
    def fail(*_):
        raise RuntimeError("no ink")

    monkeypatch.setattr(report, "signature_figure", fail)
    with pytest.raises(RuntimeError, match="no ink"):
        report.write_diagnosis_report(found["named"], subject, tmp_path / "out")
    assert list((tmp_path / "out").iterdir()) == []


def test_the_same_recordings_get_the_same_diagnosis(found, subject):
    again = diagnosed(CASES["ambiguous"][0], asked=ASKED)
    one, other = (document(d, subject, 0, 1.0) for d in (found["ambiguous"], again))
    assert one == other
    noisier = diagnosed(CASES["ambiguous"][0], asked=ASKED, seed=2)
    assert document(noisier, subject, 0, 1.0) != one


def test_numbers_have_the_digits_that_their_errors_leave():
    assert number(1.01893, 0.0017) == "1.019"
    assert number(0.996, 0.038) == "1.00"
    assert number(123.4, 20.0) == "123"
    assert number(0.0) == "0" and number(float("nan")) == "-"
    assert probability(5e-4) == "p < 0.001" and probability(None) == "p unknown"
