"""report.html of plans, studies, specimens and stockings: what it says, that it is whole and light.

`test_web_page.py` has the pages of identifications and diagnoses.
"""

from __future__ import annotations

import base64
import json
from dataclasses import replace

import browser
import making_pages as pages
import numpy as np
import pytest
from driving import DRAWN, Driven
from making import write_subject
from making_legs_3d import round_leg
from reading_page import read
from typer.testing import CliRunner

import legfem as lf
from legfem.commands.plan import app
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.geometry.motion import inward, stretch_round
from legfem.report.curves import Curves, Line
from legfem.report.estimates import words_of
from legfem.report.kinds import page_of
from legfem.report.kinds.specimens import curves_of, procedure
from legfem.report.leg_3d_view import SkinField, pressed_leg, turned_leg
from legfem.report.page import Bars, LabelledBar, Slider, View
from legfem.report.plan import plan_web_page
from legfem.report.render import PAGE_FILES, embed, rendered
from legfem.report.stocking_pressures import by_height
from legfem.specimens.laws import SpecimenTissue
from legfem.study.correction.command import correction_web_page
from legfem.study.doe.command import study_web_page
from legfem.study.doe.tables import not_seen, to_measure

MOST_BYTES = 700_000
LEGS_IN_3D = ("stocking", "identification-3d")
MOST_SECONDS = 2.0
"""In which a page is drawn whole."""


def checked(page, *said: str):
    """Read a page strictly; look that it says these words, and the verdict before all else."""
    html = rendered(page)
    read_page = read(html)
    assert len(html.encode()) < MOST_BYTES
    for words in (*said, pages.COMMAND, "Simulated data"):
        assert words.lower() in read_page.words.lower(), words
    first = read_page.words.index(page.headline.sentence)
    for warning in page.warnings:
        assert first < read_page.words.index(warning) < read_page.words.index("How to repeat it")
    assert first < read_page.words.index(page.chapters[0].title)
    for one in page.known:
        assert one.name in read_page.words and f'<span class="tag {one.provenance}">' in html
    assert '<span class="tag measured">' not in html, "nothing simulated is called measured"
    return read_page


def test_a_plan_names_the_best_test_and_what_no_test_shows(tmp_path):
    page = pages.planned(tmp_path)
    best = pages.ranked()[0]
    checked(page, "with a chance of 80 % or more: fascia stiffness", "96 %", "40 %")
    assert page.headline.sentence == f"Do this test first: {best.design.name}."
    assert page.warnings == ["No test shows gain with a chance of 20 % or more."]
    assert page.headline.tone == "caution"
    seen = pages.ranked(((0.9, 0.3), (0.4, 0.2)))
    subject = pages.subject_in(tmp_path)
    expected = pages.Expected(0.8e-3, 0.0, 20.0, 0.5)
    assert plan_web_page(seen, subject, expected, (), {}).headline.tone == "sound"
    needs = replace(best, design=replace(best.design, effort="a second person"))
    asked = plan_web_page([needs], subject, expected, (), {})
    assert f"Test 1: {best.design.name}; needed: a second person." in read(rendered(asked)).words
    none = plan_web_page([], subject, expected, (), {})
    assert none.headline.tone == "wrong"


def test_the_command_of_a_plan_writes_its_page(tmp_path, monkeypatch):
    monkeypatch.setattr("legfem.api.diagnosis.plan_before", lambda *_: (pages.ranked(), []))
    leg, out = write_subject(tmp_path / "leg"), tmp_path / "out"
    asked = ["--subject-dir", str(leg), "--depth", "12", "--out", str(out), "--jobs", "1"]
    done = CliRunner().invoke(app, [*asked, "--library", str(tmp_path / "library")])
    assert done.exit_code == 0, done.output
    assert {p.name for p in out.iterdir()} == {"plan.json", *PAGE_FILES}
    assert f"page:   {out / 'report.html'}" in done.output
    words = read((out / "report.html").read_text(encoding="utf-8")).words
    assert "12 mm" in words and (out / "report.txt").read_text()[:20] in words


def test_a_plan_is_made_in_python_as_by_the_command(tmp_path, monkeypatch):
    monkeypatch.setattr("legfem.api.diagnosis.plan_before", lambda *_: (pages.ranked(), []))
    leg = write_subject(tmp_path / "leg")
    found = lf.plan(leg, depth=12.0, library=tmp_path / "library")
    frame = found.to_frame()
    assert set(frame.columns) == {"test", "effect", "against", "chance"} and len(frame) > len(found.ranked)
    assert found.write(tmp_path / "out").is_file()
    assert json.loads((tmp_path / "out" / "plan.json").read_text()) == found.document()
    bars = [bar.get_width() for bar in found.plot().axes[0].patches]
    assert bars == [100 * one.chance for one in found.ranked]
    with pytest.raises(lf.InputError, match=r"^depth: inf"):
        lf.plan(leg, depth=float("inf"))
    with pytest.raises(lf.InputError, match=r"^depth: 200 mm: the leg leaves the cylinder \d+ mm; give less$"):
        lf.plan(leg, depth=200.0)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return pages.studied(tmp_path_factory.mktemp("study"))


def test_a_study_says_what_a_press_shows_and_what_to_measure(study):
    page = study_web_page(study, 1, pages.COMMAND)
    checked(page, "C20 of the deep tissue", "Poisson's ratio is", "slope 20-30 mm", "R2 predicted")
    assert not study.failed and len(to_measure(study)) >= 3
    # F/L grows with C20 d^2 before all, and C10 of fat and muscle hardly count.
    assert page.headline.sentence.startswith("The force of a press 30 mm deep depends most on C20 of the deep tissue")
    assert not_seen(study) == [words_of("superficial.C10"), words_of("deep.C10")]


def test_shares_are_those_of_the_variance_that_the_surface_explains(study):
    for analysis in study.analyses:
        main, interactions = analysis.shares()
        assert sum(main.values()) + interactions == pytest.approx(1.0)
        fit = analysis.fit
        corners = np.asarray(fit.model.exog)[:32]
        for test in analysis.main():
            k = list(analysis.fit.params.index).index(test.term)
            explained = np.sum((corners[:, k] * test.value) ** 2)
            assert main[test.term] == pytest.approx(explained / fit.ess, rel=1e-9)


def test_the_map_predicts_what_the_surface_does(study):
    page = study_web_page(study, 1, "")
    (block,) = next(c.blocks for c in page.chapters if c.title == "The response surface")
    data = block.data
    at = np.random.default_rng(1).uniform(-1, 1, 5)
    point = {f.symbol: [x] for f, x in zip(study.definition.factors, at, strict=True)}
    for metric, analysis in zip(data["metrics"], study.analyses, strict=True):
        value = sum(size * np.prod(at[term]) for term, size in metric["terms"])
        assert value == pytest.approx(float(analysis.fit.predict(point).iloc[0]))


def test_a_study_in_which_runs_stopped_warns_on_top(tmp_path):
    found = pages.studied(tmp_path, stops=(("deep.C20", 5e-4, 12.0),))
    page = study_web_page(found, 1, pages.COMMAND)
    assert page.headline.tone == "caution" and "stopped short" in page.warnings[0]
    checked(page)
    none = replace(found, analyses=(), information=None)
    assert checked(study_web_page(none, 1, pages.COMMAND)).words.count("No metric") >= 2


def test_a_correction_says_how_large_it_is_and_in_which_direction():
    found = pages.calibrated()
    page = correction_web_page(found, {"x": {"1": np.full(41, -0.2)}}, pages.COMMAND)
    checked(page, "P is +0.00 ± 0.01 at that depth", "limit")
    table = found.correction
    more = replace(found, correction=replace(table, values=table.values - 0.2))
    page = correction_web_page(more, {"x": {"1": np.full(41, -0.2)}}, pages.COMMAND)
    checked(page, "meets 20 % more force", "C10 would be about 20 % too high")
    less = replace(found, correction=replace(table, values=table.values + 0.1))
    page = correction_web_page(less, {"x": {"1": np.full(41, -0.2)}}, pages.COMMAND)
    checked(page, "meets 10 % less force", "C10 would be about 10 % too low")


def test_specimens_say_how_stiff_what_was_left_out_and_when_not_to_trust(tmp_path):
    page = page_of(pages.specimens(tmp_path), command=pages.COMMAND)
    checked(
        page,
        "C10 of the tissue 5.00 kPa",
        "95 % 4.80 to 5.20",
        "torn: it <never> touched",
        "left out, predicted",
        "a bar: length 10 mm, area 100 mm²",
    )
    assert page.headline.tone == "caution", "a recording was left out"
    wrong = page_of(pages.specimens(tmp_path, p_value=1e-9))
    assert wrong.headline.tone == "wrong" and " law misses the " in wrong.headline.sentence
    (fit, *_) = pages.specimens(tmp_path)
    tissues = SpecimenTissue("muscle", None, 0.49), SpecimenTissue("fat", "neo-hookean", 0.49, {"C10": 2e-3})
    held = replace(fit.details.folder, tissues=tissues, relaxes=True)
    assert "a stated stiffness is that after all relaxation" in procedure(
        replace(fit, details=replace(fit.details, folder=held))
    )
    own = {name.replace("deep.C10", "viscoelasticity.ratio"): one for name, one in fit.estimates.items()}
    relaxing = replace(fit, estimates=own)
    sure = dict(page_of([relaxing]).headline.answers)["How sure"]
    assert "relative to the part that stays is known to within" in sure and "viscoelasticity" not in sure


def test_laws_that_have_first_contact_elsewhere_are_drawn_at_one_recording_s_stations(tmp_path):
    (first,) = pages.specimens(tmp_path)
    tests = []
    for one in first.tests:
        course = one.recording.course
        kept = course.displacement > 0.3 * course.depth
        ahead = float(course.time[kept][0])
        own = {name: getattr(course, name)[kept] for name in ("displacement", "force", "count")}
        later = replace(course, begun=course.begun + ahead, time=course.time[kept] - ahead, **own)
        moved = replace(one.recording, course=later)
        force = replace(one.channels[0], channel=moved.data.channels[0], predicted=1.02 * later.force)
        tests.append(replace(one, recording=moved, channels=(force,)))
    other = replace(first, law="reduced-polynomial", tests=tuple(tests))
    for block in curves_of([first, other]):
        recorded, _, line = block.lines
        same = np.isclose(line.above / recorded.above, 1.02)
        assert len(line.above) == len(line.below) == len(block.x) and 0.3 < same.mean() < 1.0
        np.testing.assert_allclose(line.below[same], 0.02 * recorded.above[same], rtol=1e-6)


@pytest.fixture(scope="module")
def shrunk():
    """A round leg that shrinks by 2 % of its radius, and what it was moved by."""
    bare = round_leg()
    moved = {part: np.zeros_like(bare.points(part)) for part in (SKIN, HULL)}
    centre = bare.contours[SKIN].mean(axis=1, keepdims=True)
    moved[SKIN][..., :2] = -0.02 * (bare.contours[SKIN] - centre)
    return bare, moved


def test_a_leg_that_shrinks_moves_inwards_and_its_skin_shortens(shrunk):
    bare, moved = shrunk
    radius = np.linalg.norm(bare.contours[SKIN] - bare.contours[SKIN].mean(axis=1)[:, None], axis=2)
    np.testing.assert_allclose(inward(bare, moved[SKIN]), 0.02 * radius, rtol=1e-3)
    np.testing.assert_allclose(stretch_round(bare, moved[SKIN]), -2.0, rtol=1e-9)


def unpacked(text, kind):
    return np.frombuffer(base64.b64decode(text), kind)


def test_the_turned_leg_holds_what_was_computed(shrunk):
    bare, moved = shrunk
    half = {part: np.stack([0 * by, 0.5 * by, by]) for part, by in moved.items()}
    values = np.stack([0.0 * bare.points(SKIN)[..., 0], *(inward(bare, half[SKIN][k]) for k in (1, 2))])
    made = turned_leg(
        bare,
        half,
        [SkinField("inward", "mm", values)],
        Slider("Shrink", (0.0, 40.0, 100.0), " %"),
        View("abcdefgh"),
        ["a"],
        [["1"]],
        "A leg",
        [("a vein", np.array([1.0, 2.0, 3.0]))],
    )
    data = made.data
    assert data["stops"] == [0.0, 40.0, 100.0]
    skin = next(part for part in data["parts"] if part["name"] == SKIN)
    rows, columns = skin["shape"]
    step = bare.contours[SKIN].shape[1] // columns
    place, move = data["mm_a_count"]
    at = unpacked(skin["at"], "<i2").reshape(rows, columns, 3) * place
    back = bare.points(SKIN)[:, ::step]
    np.testing.assert_allclose(at - at[0, 0], back - back[0, 0], atol=2 * place)
    by = unpacked(skin["moves"], "<i2").reshape(3, rows, columns, 3) * move
    np.testing.assert_allclose(by, half[SKIN][:, :, ::step], atol=move)
    (field,) = skin["fields"]
    low, high = field["range"]
    shown = low + (high - low) * data["share_a_count"] * unpacked(field["values"], "<u2")
    np.testing.assert_allclose(shown.reshape(3, rows, columns), values[:, :, ::step], atol=1e-3)


def test_the_table_of_a_dressed_leg_has_its_girths():
    bare = round_leg()
    moved = np.zeros_like(bare.points(SKIN))
    moved[..., :2] = -0.02 * bare.contours[SKIN]
    first = by_height(bare, moved, [inward(bare, moved)])[0]
    assert float(first[2]) == pytest.approx(0.98 * float(first[1]), abs=0.1)


def test_a_leg_pressed_in_3d_is_turned_so_that_the_cylinder_is_in_front():
    pressed = pages.pressed_in_3d()
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    pose = pressed.pose
    sideways = replace(
        pressed,
        shape=LegShape(
            pressed.shape.levels, {part: xy @ turn[:2, :2].T for part, xy in pressed.shape.contours.items()}
        ),
        touch=turn @ pressed.touch,
        pose=replace(pose, direction_deg=pose.direction_deg + 90.0),
        states=tuple(replace(one, skin=one.skin @ turn.T, hull=one.hull @ turn.T) for one in pressed.states),
    )
    first, second = (pressed_leg(one, "").data for one in (pressed, sideways))
    for one, other in zip(first["parts"], second["parts"], strict=True):
        for key in ("at", "moves"):
            if one[key] is not None:
                counts, others = (unpacked(part[key], "<i2").astype(int) for part in (one, other))
                assert np.abs(counts - others).max() <= 1
    tool = first["parts"][-1]
    place, move = first["mm_a_count"]
    rows, columns = tool["shape"]
    at = place * unpacked(tool["at"], "<i2").reshape(rows, columns, 3)
    skin = place * unpacked(first["parts"][0]["at"], "<i2").reshape(-1, 3)
    assert at[..., 1].mean() < skin[:, 1].min(), "before contact the axis is in front of the leg"
    assert np.ptp(at[..., 2]) == pytest.approx(pressed.indenter.length, abs=2 * place)
    by = move * unpacked(tool["moves"], "<i2").reshape(4, -1, 3)
    np.testing.assert_allclose(by[:, 0], [[0, d, 0] for d in (0, 2, 5, 8)], atol=move)
    rows = pressed_leg(pressed, "").rows
    assert rows[0][:2] == ["0.0", "0.00"] and rows[-1][:2] == ["8.0", "6.40"]


def test_a_solve_whose_states_were_not_kept_shows_the_section_alone(tmp_path):
    page = pages.identified_in_3d(tmp_path)
    kinds = [block.kind for c in page.chapters for block in c.blocks if c.title == "The leg, pressed"]
    assert kinds == ["turned", "still"]
    words = read(rendered(page)).words
    assert "The leg in 3D (the section, extruded) with the reduced polynomial law at C10 0.8" in words
    assert (
        "The leg itself was solved in 3D (1 full solve; 2 more" in words and "gives the force per length" not in words
    )
    # Wide tables are stacked on a phone, where each number has its column's name beside it.
    assert '<td role="cell" data-label="D1 (1/MPa)">28</td>' in rendered(page)
    found = pages.result(
        "reduced-polynomial", pages.measured_curve(depth=pages.DEPTH), pages.subject_in(tmp_path / "other")
    )
    plain = page_of([found])
    assert not any(b.kind == "turned" for c in plain.chapters for b in c.blocks)


def test_bars_are_in_proportion_and_ends_stay_within():
    bars = Bars("c", ("a", "b"), [LabelledBar("x", 5.0, "5", (4.0, 10.0)), LabelledBar("y", 0.0, "0")])
    half, none = bars.drawn
    assert half.value == 50.0 and half.interval == (40.0, 100.0) and none.value == 0.0
    (over,) = replace(bars, bars=[LabelledBar("x", 120.0, "")], greatest=100.0).drawn
    assert over.value == 100.0
    assert Bars("c", ("a", "b"), []).drawn == []


def test_files_that_were_looked_at_say_their_grades_and_how_they_were_read(tmp_path):
    page = pages.looked(tmp_path)
    html = rendered(page)
    words = read(html).words
    assert len(html.encode()) < MOST_BYTES
    assert page.headline.tone == "wrong"
    assert page.headline.sentence == ("Of 2 recordings, 1 has grade A (good), 1 has grade D (not to be used).")
    (warning,) = page.warnings
    assert warning.startswith("saturated.csv: ") and "saturated" in warning
    assert words.index(page.headline.sentence) < words.index(warning) < words.index("How to repeat it")
    for said in (
        "displacement from 'displacement' (mm)",
        "good.csv",
        "after a part without load",
        "[recordings.force]",
        pages.COMMAND,
    ):
        assert said in words, said


def test_curves_of_one_panel_and_of_names_with_signs_are_drawn():
    x = np.linspace(0.0, 1.0, 5)
    lines = [Line("a@b <$c>", np.where(x < 0.6, x, np.nan), None)]
    one = Curves("one", "caption", "", x, "mm", "N", lines, band=np.full(5, 0.1))
    assert one.rows[-1] == ["1.00", "–"]
    drawn = json.loads(embed(one.data))
    assert drawn["lines"][0]["name"] == "a@b <$c>" and "<" not in embed(one.data)
    assert drawn["lines"][0]["values"] == [[0.0, 0.25, 0.5, None, None], None]
    assert drawn["band"] == [[list(x), [-0.1, 0.15, 0.4, None, None], [0.1, 0.35, 0.6, None, None]]]


CURVES = frozenset({"off", "cursor"})
CONTROLS = {
    "identification": CURVES | {"pictures"},
    "identification-3d": CURVES | {"views"},
    "diagnosis": CURVES | {"pictures"},
    "doe": CURVES | {"surface"},
    "stocking": {"views"},
}
"""What a page must have, besides that whatever it has must work."""


@pytest.mark.slow
@pytest.mark.skipif(browser.browser() is None, reason="no Chromium here")
@pytest.mark.parametrize("name", pages.PAGES)
def test_a_browser_finds_no_fault_no_request_and_nothing_inaccessible(name, tmp_path):
    path = tmp_path / f"{name}.html"
    path.write_text(rendered(pages.PAGES[name](tmp_path)), encoding="utf-8")
    assert path.stat().st_size < MOST_BYTES
    script = browser.axe()
    assert script, "axe-core is among what tests need"
    with Driven(browser.browser()) as page:
        # What else the machine does only adds to it.
        opened = min(page.seconds_to_open(path.as_uri()) for _ in range(3))
        assert opened < MOST_SECONDS
        page.resize(390, 844)
        page.open(path.as_uri())
        page.until(DRAWN)
        beyond = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
        assert page.value(beyond) == 0, "nothing is wider than a phone"
        assert page.faults == []
    for width in (1000, 500):
        seen = browser.seen(path, browser.browser(), script, width)
        assert browser.faults(seen) == []
        assert browser.idle(seen) == []
        assert "inaccessible" in seen and CONTROLS.get(name, set()) <= seen.keys()
