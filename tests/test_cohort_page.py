"""What a cohort's page says of all: who can be believed, what is odd, what is missing; and that it stays light."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from datetime import date
from pathlib import Path

import browser
import numpy as np
import pytest
from driving import Driven
from making_cohort import Truth, fabricated
from reading_page import read

import legfem as lf
from legfem.cohort.anomalies import largest_step, missing, suspicions
from legfem.cohort.rows import Options, Row, Shape
from legfem.common.errors import PhysicalRange
from legfem.inverse.answer import FitNotice, Notice, doubted
from legfem.legs.notices import LegNotice
from legfem.report.answers import kind_of_notice
from legfem.report.cohort import cohort_web_page
from legfem.report.render import markdown_page, plain_page, rendered

GRAVE = "subject.toml: indenter.diametre_mm: unknown key; did you mean 'diameter_mm'?"


def sentences(members, rows) -> list[str]:
    return [one.sentence for one in suspicions(members.every, rows)]


def test_two_folders_with_the_same_recordings_are_pointed_out():
    members, rows = fabricated(6)
    rows[5] = replace(rows[5], recordings=rows[9].recordings)
    (said,) = sentences(members, rows)
    assert said == (
        f"{rows[5].name} and {rows[9].name} contain a recording with the same numbers: was a folder copied or named "
        "twice?"
    )


@pytest.mark.parametrize("mirrored", [1.0, -1.0])
def test_exchanged_sides_are_pointed_out_however_sections_are_drawn(mirrored: float):
    members, rows = fabricated(10)
    rows = [replace(row, shape=Shape(fibula=mirrored * row.shape.fibula)) for row in rows]
    assert not sentences(members, rows)
    for k in (8, 10):
        rows[k] = replace(rows[k], shape=Shape(fibula=-rows[k].shape.fibula))
    (said,) = sentences(members, rows)
    assert said.startswith(f"{rows[8].name} and {rows[10].name}: the fibula lies on the side where 38 of 40 legs")
    one_way = [replace(row, shape=Shape(fibula=20.0)) for row in rows]
    assert not sentences(members, one_way), "sections that are all drawn as right legs say nothing"


def test_a_rig_that_drifts_is_found_at_its_date_and_size_and_a_steady_one_is_not():
    truth = Truth(sessions=0.03, error=0.03, drift=0.03)
    (said,) = (one for one in sentences(*fabricated(60, truth=truth)) if "C10 changes by" in one)
    size = float(said.split("changes by ")[1].split(" %")[0])
    low, high = (float(end) for end in said.split("(")[1].split(" %")[0].split(" to "))
    assert low < 3.05 < high and 1.5 < size < 4.5
    found = date.fromisoformat(said.split("in the same people between ")[1][:10])
    assert abs((found - date(2026, 4, 5)).days) < 14
    steady = Truth(sessions=0.03, error=0.03)
    assert not [one for one in sentences(*fabricated(60, truth=steady)) if "C10 changes by" in one]


def test_chance_alone_makes_a_step_as_often_as_its_probability_says():
    """Whoever comes twice has errors alike within a visit; 0.1 is passed in 3 to 20 of 100 draws."""
    people = np.repeat(np.arange(20), 2).astype(str)
    days = np.tile([0.0, 60.0], 20) + np.repeat(np.arange(20), 2) * 3.0
    draws = (np.random.default_rng(seed).normal(size=40) for seed in range(100))
    found = [largest_step(days, people, people, values) for values in draws]
    assert 3 <= sum(one.p_value <= 0.1 for one in found) <= 20


def test_an_outlier_is_one_of_its_group():
    members, rows = fabricated(20, truth=Truth(group=1.5, people=0.1))
    assert not [one for one in sentences(members, rows) if "robust" in one]
    measures = dict(rows[0].models["reduced-polynomial"].measures)
    measures["c10_deep"] = replace(measures["c10_deep"], value=12.0)
    found = replace(rows[0].models["reduced-polynomial"], measures=measures)
    rows[0] = replace(rows[0], models={"reduced-polynomial": found})
    (said,) = (one for one in sentences(members, rows) if "robust" in one)
    assert said.startswith(f"{rows[0].name}: C10 of the muscle lies") and said.endswith(
        "above the median of group control."
    )


def test_what_is_missing_is_listed():
    members, rows = fabricated(3)
    given = dict(members.every[0].given)
    del given["age"]
    every = (replace(members.every[0], given=given), *members.every[1:-1])
    rows = [*rows[:3], Row(rows[3].member, problem=GRAVE), *rows[4:-1]]
    assert missing(every, rows) == [f"No result: {rows[3].name}.", f"The table says no age of {rows[0].name}."]
    assert missing(every[:-1], rows[:-1])[-1] == "side right is missing of P0002."


def test_the_page_says_who_can_be_believed_and_links_to_each():
    members, rows = fabricated(6)
    rows[3] = Row(rows[3].member, problem=GRAVE)
    page = cohort_web_page(members, rows, "identify", "legfem cohort study")
    html, text, notes = rendered(page), plain_page(page, []), markdown_page(page)
    words = read(html).words
    counts = [sum(row.judged.tone == tone for row in rows) for tone in ("sound", "caution")]
    assert f"Of 24 members, {counts[0]} fit the model, {counts[1]} need caution, 1 has no result." in words
    assert re.search(r"C10 of the muscle: [\d.]+ kPa in the median of 2[0-3] members \([\d.]+ to [\d.]+\), ", words)
    assert "does not rule out a hard region in the muscle" in words and "reliable" not in words
    diagnosed = plain_page(cohort_web_page(members, rows, "diagnose"), [])
    assert f"{counts[0]} are reliable" in diagnosed and "does not rule out" not in diagnosed
    assert "23 of 24 can be used" in words and "A: " in words
    for said in (html, text, notes):
        assert "diametre" in said
    data = json.loads(html.split('<script type="application/json">')[1].split("</script>")[0])
    assert data["rows"][0][0] == rows[3].name and data["links"][1].endswith("report.html")
    assert "greatest displacement (mm): 20" in words and "dolfinx 0.9.0" in words


def test_the_document_has_the_statistics_and_what_is_odd():
    members, rows = fabricated(10)
    rows[5] = replace(rows[5], recordings=rows[9].recordings)
    said = lf.Cohort(members, Options("identify", {}), tuple(rows)).document()
    assert json.loads(json.dumps(said, allow_nan=False)) == said
    c10 = next(one for one in said["statistics"]["parameters"] if one["name"] == "c10_deep")
    assert c10["logarithmic"] and 0 < c10["repeated"][0]["agreement"]["icc"] < 1 and len(c10["fitted"]["sd"]) == 3
    assert said["suspicions"][0]["members"] == [rows[5].name, rows[9].name]


def test_warnings_are_of_a_kind_that_leaves_numbers_out_and_names_in():
    (doubtful,) = doubted(PhysicalRange("girth", "mm", (250, 500), (1, 1000), "x").likely("a/b.toml", "section", 200))
    kinds = {
        Notice.of(LegNotice.UNCORRECTED_PLANE_STRAIN): "No 3D correction is applied",
        Notice.of(FitNotice.UNCONVERGED): "The search ended before it converged",
        Notice.of(LegNotice.NEGATIVE_POISSON_RATIO, tissue="fascia", ratio=-0.14): (
            "The fascia's Poisson's ratio is … with its C10 and D1 as given"
        ),
        doubtful: "doubtful input: section: girth of … mm where … to … is usual",
    }
    assert {one: kind_of_notice(one) for one in kinds} == kinds


def test_a_cohort_without_any_result_is_not_called_measured():
    members, rows = fabricated(1, sides=1)
    page = cohort_web_page(members, [Row(one.member, problem=GRAVE) for one in rows], "identify")
    assert str(page.data) == "no data that could be used" and page.headline.tone == "wrong"


def test_a_cohort_of_one_is_written_as_one():
    members, rows = fabricated(1, sides=1)
    one = replace(members, every=members.every[:1])
    text = plain_page(cohort_web_page(one, rows[:1], "identify"), [])
    assert ": 1 member\n" in text and "The only member fits the model." in text
    assert "1 members" not in text and "in the median" not in text
    assert "The only member has no result." in plain_page(
        cohort_web_page(one, [Row(rows[0].member, problem=GRAVE)], "identify"), []
    )


@pytest.mark.slow
@pytest.mark.skipif(browser.browser() is None, reason="no Chromium here")
def test_ten_thousand_rows_are_drawn_and_sorted_as_few(tmp_path: Path):
    """Only rows in view are elements of the page, before and after sorting."""
    members, rows = fabricated(2500)
    path = tmp_path / "cohort.html"
    path.write_text(rendered(cohort_web_page(members, rows, "identify")), encoding="utf-8")
    c10 = {row.name: row.models["reduced-polynomial"].measures["c10_deep"].value for row in rows}
    count = "document.querySelectorAll('*').length"
    table = "document.querySelector('#sortable-numbers')"
    first, last = (f"[...{table}.querySelectorAll('tbody th')].at({place}).textContent" for place in (0, -1))
    sort = f"[...{table}.querySelectorAll('button')].find((one) => one.textContent.startsWith('C10')).click()"
    with Driven(browser.browser()) as page:
        page.open(path.as_uri())
        page.until("document.querySelectorAll('.sortable tbody tr').length > 10")
        page.until(f"{count} < 3000")
        for end, other in ((min, max), (max, min)):
            page.value(sort)
            assert page.value(first) == end(c10, key=c10.get)
            page.value(f"{table}.querySelector('.view').scrollTop = 1e9")
            page.until(f"{last} === '{other(c10, key=c10.get)}'")
        assert page.value(count) < 3000
