"""report.html: whole in one file, well-formed, and it says verdict, warnings and provenance."""

from __future__ import annotations

import base64
from dataclasses import replace
from datetime import date

import browser
import numpy as np
import pytest
from driving import Driven
from making import write_subject
from making_diagnosed import diagnosed
from making_diagnosis import two_rates
from making_results import measured_curve, result
from reading_page import read
from test_diagnosis_report import CASES

from legfem.common.errors import Doubt
from legfem.common.numbers import number
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.fem.fields import FieldReader, fields_of
from legfem.inverse.answer import doubted
from legfem.inverse.averaging import POWER
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.plan import Design, DesignValue
from legfem.inverse.verdict import LARGE, TRUSTED, Diagnosis
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.loading import load_subject
from legfem.meshing.section import SectionMeshSettings
from legfem.report.curves import Curves, Line, ways
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.diagnosis_headline import headline
from legfem.report.estimates import QUESTION, high_or_low
from legfem.report.kinds import page_of
from legfem.report.pressed_section import Film, State, pressed_section
from legfem.report.render import rendered

MOST_BYTES = 700_000
DEPTH = 4.0


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    folder = write_subject(tmp_path_factory.mktemp("page") / "made")
    return load_subject(folder, need_recordings=False)


@pytest.fixture(scope="module")
def both():
    measured = measured_curve(depth=DEPTH)
    return [result("neo-hookean", measured), result("reduced-polynomial", measured)]


@pytest.fixture(scope="module")
def film(subject):
    coarse = PlaneStrainSettings(mesh=SectionMeshSettings(contact_size=3.0, far_size=12.0))
    taken = Film(plane_strain_test(subject, coarse), DEPTH)
    solved = taken.experiment.solve({}, DEPTH, on_step=taken.take)
    return taken, solved, State.of(DEPTH, fields_of(taken.experiment.system))


@pytest.fixture(scope="module")
def pressed(film):
    taken, solved, _ = film
    return pressed_section(taken, solved.curve.displacement, solved.curve.force, "A leg")


def test_the_page_of_an_identification_says_verdict_warnings_and_provenance(subject, both, pressed):
    command = "legfem identify --subject-dir 'my <leg>'"
    html = rendered(page_of(both, pressed, command))
    page = read(html)
    assert len(html.encode()) < MOST_BYTES
    c10 = both[1].estimates["deep.C10"].shown
    assert f"Muscle stiffness C10 = {number(c10.value, c10.standard_error)}" in page.words
    assert page.words.index("1 warning") < page.words.index("Recordings and model")
    assert "The fascia's Poisson's ratio is -0.14" in page.words
    assert "Simulated data" in page.words or "simulated data" in page.words
    for name in ("C10 of the deep tissue", "C10 of the fascia", "noise of a force reading"):
        assert name in page.words
    for provenance in ("estimated", "assumed", "simulated", "prior"):
        assert f'<span class="tag {provenance}">' in html
    assert '<span class="tag measured">' not in html, "nothing simulated is called measured"
    assert command in page.words
    assert "What could not be tested" in page.words
    assert "C10 by +14 % if all forces were 10 % higher" in page.words


def test_a_law_that_does_not_fit_is_not_praised(subject, both):
    page = page_of(both[:1])
    assert page.headline.tone == "wrong"
    assert "don't rely on it" in dict(page.headline.answers)["Effect on C10"]
    assert "legfem diagnose" in dict(page.headline.answers)["What to do"]
    unsure = replace(both[1].estimates["deep.C20"], identifiability="weakly identifiable")
    poly = replace(both[1], estimates={**both[1].estimates, "deep.C20": unsure})
    page = page_of([both[0], poly])
    assert page.headline.tone == "caution"
    assert "C20" in dict(page.headline.answers)["What to do"]


def test_doubtful_input_is_said_in_the_verdict_not_below_it(subject, both):
    doubts = [Doubt("trial1.csv", "force_N", "reads +7 N more back where it began", "tare it")] * 2
    for fits in (both, both[:1]):
        usual, page = (
            page_of(fits).headline,
            page_of([replace(fit, notices=doubted(doubts)) for fit in fits]).headline,
        )
        answers = dict(page.answers)
        assert answers["Problems found"].startswith("2 inputs are doubtful")
        assert answers["What to do"].startswith("Check the doubtful input first")
        assert page.tone == ("wrong" if usual.tone == "wrong" else "caution")


def test_a_law_with_a_parameter_that_the_data_do_not_need_is_not_chosen(subject, both):
    neo, poly = both
    alike = replace(neo, goodness=replace(neo.goodness, chi_square=poly.goodness.chi_square + 0.5, p_value=0.3))
    page = page_of([alike, poly])
    assert "The neo-Hookean law describes" in page.headline.sentence


@pytest.mark.parametrize("verdict", CASES)
def test_the_page_of_a_diagnosis_says_what_is_wrong_how_sure_and_what_to_do(subject, verdict):
    effects, bump, asked = CASES[verdict]
    found = diagnosed(effects, bump=bump, asked=asked)
    if verdict == "unexplained":
        found = replace(found, misfit=LARGE)
    plan = [DesignValue(Design("press to 25 mm", ()), {}, 0.7)]
    html = rendered(diagnosis_web_page(found, subject, plan))
    page, answers = read(html), dict(diagnosis_web_page(found, subject).headline.answers)
    assert len(html.encode()) < MOST_BYTES
    asked = ["Problems found", "How sure", "Effect on C10", "What to do"]
    assert [question for question in answers if question != QUESTION] == asked
    assert (QUESTION in answers) == (verdict != "unexplained")
    assert all(answers.values())
    assert "3.70 mm of air before first contact" in page.words
    assert page.words.index("warning") < page.words.index("Recordings and model")
    for model in found.models:
        assert model.fit.mechanisms[0].statement in page.words.lower()
        low, _ = model.shown(DEEP_C10).ci95
        assert f"{low:.2f} to " in page.words
    if verdict == "unexplained":
        assert "Report no number" in page.words and "Report: C10" not in page.words
    if verdict in ("named", "ambiguous"):
        advice = page.words.lower().index("press to 25 mm (70 % chance")
        assert advice < page.words.index("Recordings and model")


@pytest.fixture(scope="module")
def sound() -> Diagnosis:
    """Holds and two rates are there: nothing of the tissue's behaviour in time is left to be tested."""
    return diagnosed({}, recordings=two_rates())


def test_a_null_of_several_phases_is_trusted_and_nothing_that_matters_is_open(sound):
    assert sound.verdict == "consistent" and sound.may_be_off < TRUSTED
    verdict = headline(sound, ())
    assert verdict.heading == "Yes." and verdict.doubted(0) is verdict
    told = verdict.doubted(1)
    assert told.tone == "caution" and told.heading == "Check the doubtful input first. If it is right: yes."
    assert not sound.hidden


def test_a_test_that_asks_for_nothing_more_says_so(subject, sound):
    found = sound
    assert found.verdict == "consistent"
    answers = dict(diagnosis_web_page(found, subject).headline.answers)
    assert answers["What to do"] == "Use the number together with the law that it belongs to. No other test is needed."


def test_a_sound_model_whose_stiffness_may_be_moved_unseen_is_a_range_and_says_by_what(subject, sound):
    found = sound
    wide = next(e for e in found.explained.every if e.names == ("fascia-stiffness",))
    k = wide.fit.free.index(DEEP_C10)
    covariance = wide.posterior.covariance.copy()
    covariance[k, k] = (0.5 / wide.fit.parameters[k].prior.sd) ** 2
    # As probable in the interval, where evidence counts with a power, as the best explanation.
    weights = [one.log_prior + POWER * one.posterior.log_evidence for one in found.explained.every]
    prior = max(weights) - POWER * wide.posterior.log_evidence
    moved = replace(
        wide,
        probability=0.3,
        log_prior=prior,
        posterior=replace(wide.posterior, covariance=covariance, components=None),
    )
    every = tuple(moved if e is wide else e for e in found.explained.every)
    found = replace(found, explained=replace(found.explained, every=every))
    headline = diagnosis_web_page(found, subject).headline
    answers = dict(headline.answers)
    assert headline.heading.startswith("The model fits, and C10 may be off by ")
    assert headline.sentence.startswith("Report a range: C10 between ")
    assert moved.fit.mechanisms[0].statement in answers["What to do"]
    assert moved.fit.mechanisms[0].next_experiment in answers["What to do"]


def test_the_film_holds_the_solutions_last_state(film, pressed):
    _, solved, last = film
    data = pressed.data
    assert data["displacement"][0] == 0 and data["displacement"][-1] == pytest.approx(DEPTH)
    assert len(data["displacement"]) > 5
    assert data["force"][-1] == pytest.approx(solved.curve.force[-1])
    vertices = np.reshape(data["vertices"], (-1, 2))
    cells = np.frombuffer(base64.b64decode(data["cells"]), "<u2").reshape(-1, data["corners"])
    moves = np.frombuffer(base64.b64decode(data["moves"]), "<i2") * data["mm_a_count"]
    moves = moves.reshape(-1, len(vertices), 2)
    assert not moves[0].any()
    np.testing.assert_allclose(vertices[cells], last.corners, atol=1e-3)
    np.testing.assert_allclose(moves[-1][cells], last.moved, atol=3e-3)
    for measure, first, known in zip(data["measures"], (0.0, 0.0, 1.0), last.measures, strict=True):
        low, high = measure["range"]
        shares = np.frombuffer(base64.b64decode(measure["values"]), "<u2") * data["share_a_count"]
        shown = low + (high - low) * shares.reshape(len(moves), -1)
        counted = 2 * (high - low) * data["share_a_count"]
        np.testing.assert_allclose(shown[0], first, atol=counted)
        expected = np.clip(known, low, high)
        np.testing.assert_allclose(shown[-1], expected, atol=counted)
    assert 1.0 < data["measures"][2]["range"][1] < 3.0
    touch, centre = data["centres"][0], data["centres"][-1]
    assert np.linalg.norm(np.subtract(centre, touch)) == pytest.approx(DEPTH)


def test_a_film_forgets_an_attempt_that_was_given_up(film, monkeypatch):
    last = fields_of(film[0].experiment.system)
    monkeypatch.setattr(FieldReader, "read", lambda reader: last)
    taken = Film(film[0].experiment, DEPTH)
    for at in (1.0, 2.0, 0.5, 1.5):
        taken.take(at)
    assert [state.displacement for state in taken.states] == [0.5, 1.5]


def test_the_table_behind_a_plot_holds_what_is_drawn():
    x = np.linspace(0.0, 10.0, 60)
    lines = [Line("one", x**2, None), Line("other", 2 * x, x, tabled=False)]
    curves = Curves("name", "caption", "", x, "mm", "N", lines, below_label="dN")
    assert curves.header == ["mm", "one: N"]
    assert len(curves.rows) == 25
    assert curves.rows[0] == ["0.00", "0.000"] and curves.rows[-1] == ["10.00", "100.000"]
    drawn = curves.data
    assert drawn["lines"][0]["values"] == [pytest.approx(x**2, rel=1e-5), None]
    assert [line["read"] for line in drawn["lines"]] == [True, False]


def test_a_band_over_loading_hold_and_unloading_is_drawn_in_two_ways():
    there_and_back = np.array([0.0, 1.0, 2.0, 2.0, 2.0, 1.0, 0.5])
    assert ways(there_and_back) == [slice(0, 5), slice(4, 7)]
    assert ways(np.arange(4.0)) == [slice(0, 4)]


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (0.3, None, "Softer than"),
        (0.68, None, "At the soft end of"),
        (3.0, None, "Within"),
        (12.0, None, "At the stiff end of"),
        (20.0, None, "Stiffer than"),
        (0.3, 0.8, "Partly outside of"),
        (0.6, 3.0, "Within"),
        (0.6, 0.9, "At the soft end of"),
    ],
)
def test_a_stiffness_is_set_beside_what_was_published_with_its_source(low, high, said):
    ((_, answer),) = high_or_low("deep", low, high)
    assert answer.startswith(f"{said} what was published for muscle: 0.5 to 15 kPa (Frauziols")


def test_where_nothing_was_published_nothing_is_said_of_high_or_low(subject, both):
    assert high_or_low("fascia", 100.0) == [] and high_or_low("", 1.0) == []
    page = page_of(both)
    assert [q for q, _ in page.headline.answers].count(QUESTION) == 1
    misses = page_of(both[:1])
    assert QUESTION not in dict(misses.headline.answers), "a wrong model's number isn't compared"


def test_a_page_says_its_day_in_words(subject, both):
    page = replace(page_of(both), made=date(2026, 3, 9))
    words = read(rendered(page)).words
    assert words.index("made on 9 March 2026") < words.index(page.headline.sentence)


in_browser = pytest.mark.skipif(browser.browser() is None, reason="no Chromium here")


@in_browser
def test_a_browser_opens_the_page_without_fault_or_request_and_its_controls_work(subject, both, pressed, tmp_path):
    path = tmp_path / "report.html"
    path.write_text(rendered(page_of(both, pressed)), encoding="utf-8")
    seen = browser.seen(path, browser.browser(), browser.axe())
    assert browser.faults(seen) == [] and "inaccessible" in seen
    assert set(seen["off"]) == {False} and set(seen["on"]) == {True}
    assert seen["paths_off"] < seen["paths"]
    assert "displacement (mm)" in seen["cursor"]
    force = f"{pressed.data['force'][-1]:.2f} N"
    assert seen["readings"] == [f"{DEPTH:.1f} mm, {force}", *seen["readings"][1:2], "0.0 mm, 0.00 N"]
    assert seen["spoken"] == seen["readings"][1]
    assert seen["pictures"] == 3, "deep, half, none"
    assert seen["colours"] == [4, 4], "by pressure, movement, stretch and tissue"


@in_browser
def test_a_page_that_errs_or_asks_or_cannot_be_read_aloud_is_found_out(tmp_path):
    path, asked = tmp_path / "bad.html", "http://192.0.2.1/a.png"
    path.write_text(
        f'<!DOCTYPE html><html lang="en"><head><title>bad</title></head><body><main><h1>bad</h1>'
        f'<img src="{asked}"><script>console.error("told"); none.of.this();</script>'
        '<div style="width: 3000px">wide</div></main></body></html>'
    )
    found = browser.faults(browser.seen(path, browser.browser(), browser.axe()))
    wanted = (
        "error: told",
        "error: Uncaught ReferenceError",
        f"request: {asked}",
        "the page is wider",
        "critical: image-alt",
    )
    assert [any(one.startswith(words) for one in found) for words in wanted] == [True] * 5
    with Driven(browser.browser()) as page:
        page.seconds_to_open(path.as_uri())
        told = "\n".join(page.faults)
        assert f"asked {asked}" in told and "told" in told and "none is not defined" in told
        assert [one.split(":")[1] for one in page.inaccessible(browser.axe())] == [" image-alt"]
