"""Left beside right, and each among people of the same age, on a cohort's page: right values, words and a signature."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making_cohort import Truth, fabricated

from legfem.cohort.members import Members, find_members
from legfem.cohort.population_model import population_document, sampled
from legfem.cohort.rows import Judged, Measure, Row
from legfem.common.errors import InputError
from legfem.inverse.population import AGE, CohortParameter, CohortPopulation, read_cohort_population
from legfem.report.cohort import cohort_web_page
from legfem.report.cohort_statistics import ratio_of, side_chapters
from legfem.report.page import Bullets, Chapter, Prose, WebTable
from legfem.report.render import plain_page

NORM = CohortParameter(
    median=0.8,
    log_sd=0.25,
    people=200,
    law="reduced-polynomial",
    source="a survey",
    log_effects={AGE: {"value": -0.2, "ci95": [-0.3, -0.1]}},
    log_ages=(math.log(45.0), 0.35, math.log(20.0), math.log(80.0)),
)


def measure(value: float, low: float | None, high: float | None) -> Measure:
    return Measure(value, low, high, None, "kPa")


def test_the_interval_of_a_ratio_of_normal_logarithms_is_theirs_and_of_lopsided_ones_what_draws_say() -> None:
    """For symmetrical intervals that is exact; else as near as drawn halves of normals have it."""
    one, other = (measure(v, v * math.exp(-1.96 * s), v * math.exp(1.96 * s)) for v, s in ((1.2, 0.1), (0.8, 0.05)))
    exceeds, low, high = ratio_of(one, other)
    assert exceeds == pytest.approx(0.5)
    half = 1.96 * math.hypot(0.1, 0.05)
    assert (low, high) == pytest.approx((1.5 * math.exp(-half) - 1, 1.5 * math.exp(half) - 1))
    generator = np.random.default_rng(4)

    def draws(value: float, below: float, above: float) -> np.ndarray:
        z = generator.normal(size=400_000)
        return math.log(value) + np.where(z < 0, below, above) * z

    drawn = draws(1.2, 0.05, 0.2) - draws(0.8, 0.1, 0.04)
    ends = [(v, v * math.exp(-1.96 * b), v * math.exp(1.96 * a)) for v, b, a in ((1.2, 0.05, 0.2), (0.8, 0.1, 0.04))]
    _, low, high = ratio_of(*(measure(*three) for three in ends))
    assert np.log1p([low, high]) == pytest.approx(np.quantile(drawn, (0.025, 0.975)), abs=0.035)
    for end in (None, 0.0):
        assert math.isnan(ratio_of(measure(1.2, end, 2.0), other)[1]), "an open end leaves the ratio open"


def pair(left: float, right: float, error: float = 0.04, age: float | None = 54.0) -> tuple[Members, list[Row]]:
    """One person's legs, C10 known to an error."""
    members, rows = fabricated(1, sessions=1)
    given = [
        {k: v for k, v in one.given.items() if k != "age"} | ({"age": age} if age else {}) for one in members.every
    ]
    every = tuple(replace(one, given=own) for one, own in zip(members.every, given, strict=True))
    made = []
    for row, value in zip(rows, (left, right), strict=True):
        model = row.models["reduced-polynomial"]
        found = Measure(value, value * math.exp(-1.96 * error), value * math.exp(1.96 * error), value * error, "kPa")
        one = replace(model, measures={"c10_deep": found})
        made.append(replace(row, models={"reduced-polynomial": one}, judged=replace(row.judged, tone="sound")))
    return replace(members, every=every), made


def chapters(members: Members, rows: list[Row]) -> dict[str, Chapter]:
    return {one.title: one for one in side_chapters(members, rows, ())}


@pytest.mark.parametrize(
    ("left", "right", "said", "difference"),
    [
        (0.70, 0.72, "no difference beyond the errors", "+3 %"),
        (0.70, 0.95, "right is greater", "+36 %"),
        (0.95, 0.70, "left is greater", "-26 %"),
    ],
)
def test_both_legs_stand_side_by_side_with_what_the_errors_leave_and_lines_to_sign(
    left: float, right: float, said: str, difference: str
) -> None:
    table, signed = chapters(*pair(left, right))["Left beside right"].blocks
    assert isinstance(table, WebTable) and isinstance(signed, WebTable)
    (row,) = [dict(zip(table.header, one, strict=True)) for one in table.rows]
    assert row["in words"] == said and row["right against left (95 %)"].startswith(difference)
    assert row["left (95 %)"].startswith(f"{left:.2f} (") and row["left (95 %)"].endswith(") kPa")
    assert list(signed.header) == ["name", "date", "signature"]


def test_a_leg_whose_model_does_not_fit_and_one_leg_alone_have_no_other_side() -> None:
    members, rows = pair(0.7, 0.9)
    wrong = [rows[0], replace(rows[1], judged=Judged("wrong", "does not fit"))]
    assert "Left beside right" not in chapters(members, wrong)
    assert "Left beside right" not in chapters(replace(members, every=members.every[:1]), rows[:1])


def test_a_person_is_placed_among_people_of_her_age_by_the_file_s_own_numbers_and_drawn_over_their_band() -> None:
    members, rows = pair(0.5, 0.95)
    members = replace(members, norms={"c10_deep": NORM})
    said, band = chapters(members, rows)["C10 of the muscle by age"].blocks
    assert isinstance(said, Bullets)
    # Of people aged 54: median 0.8 (54 / 45)^-0.2, sd of 0.25 without what ages alone make.
    median, sd = 0.8 * (54 / 45) ** -0.2, math.sqrt(0.25**2 - (0.2 * 0.35) ** 2)
    for text, value, where in zip(said.items, (0.5, 0.95), ("within", "within"), strict=True):
        below = 0.5 * math.erfc(-math.log(value / median) / sd / math.sqrt(2))
        assert f"more than in {100 * below:.2g} % of people of this age (median {median:.2g})" in text
        assert f"{where} what 95 of 100" in text
    names = [line.name for line in band.lines]
    at = int(np.flatnonzero(band.x == 54.0)[0])
    ends = [line.above[at] for line in band.lines]
    assert names == ["median", "2.5 % have less", "2.5 % have more", "members"]
    assert ends == pytest.approx([median, median * math.exp(-1.96 * sd), median * math.exp(1.96 * sd), 0.725])
    assert band.x.min() > 20 and band.x.max() < 80, "nothing is drawn where nobody was"
    (text, _) = chapters(*_with(pair(1.5, 0.7)))["C10 of the muscle by age"].blocks[0].items
    assert "outside what 95 of 100" in text


def _with(found: tuple[Members, list[Row]]) -> tuple[Members, list[Row]]:
    return replace(found[0], norms={"c10_deep": NORM}), found[1]


@pytest.mark.parametrize("age", [None, 19.0, 85.0])
def test_nothing_is_said_of_an_age_that_is_not_given_or_that_nobody_in_the_file_has(age: float | None) -> None:
    assert list(chapters(*_with(pair(0.7, 0.7, age=age)))) == ["Left beside right"]


def test_a_cohort_s_population_has_norms_by_age_and_so_has_its_file_beside_a_table(tmp_path: Path) -> None:
    members, rows = fabricated(40, truth=Truth(people=0.25), seed=3)
    fit = sampled(members.every, rows, "c10_deep", 1)
    (tmp_path / "population.json").write_text(json.dumps(population_document([fit], members, rows)))
    norm = read_cohort_population(tmp_path / "population.json").parameters["c10_deep"]
    ages = {row.name: one.given["age"] for row, one in zip(rows, members.every, strict=True)}
    median, sd = norm.at(41.0)
    assert 0.6 < median < 1.0 and 0.2 < sd <= norm.log_sd
    assert norm.log_ages is not None
    assert norm.log_ages[2:] == pytest.approx([math.log(min(ages.values())), math.log(max(ages.values()))])
    leg = tmp_path / "A"
    leg.mkdir()
    (leg / "subject.toml").write_text("")
    (tmp_path / "cohort.csv").write_text("folder,subject,side,age\nA,P1,left,41\n")
    assert find_members(tmp_path, "identify").norms["c10_deep"] == norm
    page = plain_page(cohort_web_page(members, rows, "identify", population=[fit]), [])
    assert "C10 of the muscle by age" in page and "of people of this age" in page
    (tmp_path / "population.json").write_text("{}")
    with pytest.raises(InputError, match="contains no population"):
        find_members(tmp_path, "identify")


def test_norms_of_another_law_are_no_norms_and_the_page_says_so() -> None:
    members, rows = pair(0.7, 0.7)
    other = replace(members, norms={"c10_deep": NORM.model_copy(update={"law": "neo-hookean"})})
    (said,) = chapters(other, rows)["C10 of the muscle by age"].blocks
    assert isinstance(said, Prose) and "another law (neo-Hookean)" in said.text


def test_a_population_file_from_before_ages_were_kept_is_read_and_has_no_norms() -> None:
    old = {"median": 0.8, "log_sd": 0.3, "people": 9, "law": "neo-hookean", "source": "old"}
    found = CohortPopulation.model_validate({"schema_version": 1, "parameters": {"c10_deep": old}})
    assert all(math.isnan(one) for one in found.parameters["c10_deep"].at(50.0))
