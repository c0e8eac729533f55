"""One leg pressed at several sites: its folder, one fit of all, and what each says by itself."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from making_identification import DEPTH, identify, pressed_leg
from making_sites import SITE_TABLES, SITES, sited_leg, sites_model, write_sites
from typer.testing import CliRunner

from legfem.commands.diagnose import app as diagnose_app
from legfem.commands.identify import app as identify_app
from legfem.common.errors import InputError
from legfem.inverse.catalogue import parameter_of
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.fit import Goodness
from legfem.inverse.parameter import Prior
from legfem.inverse.problem import fit
from legfem.inverse.settings import IdentificationSettings, SearchRequest
from legfem.legs.loading import load_sites, load_subject
from legfem.legs.problem import leg_problem
from legfem.legs.site import measured_curve
from legfem.legs.unknowns import unknown_geometry
from legfem.report.answers import sentences_of
from legfem.report.results import write_report

NEO_HOOKEAN = ("neo-hookean",)
C10 = "deep.C10"


def joint(leg, **options):
    laws, corrections = options.pop("laws", NEO_HOOKEAN), options.pop("corrections", None)
    return fitted(leg, laws, SearchRequest(**options), corrections, sites_model())


def fitted(leg, laws, request, corrections, model):
    return fit(leg_problem(leg, laws, request, corrections, model, unknown_geometry), laws, request)


def width(found):
    low, high = found.estimates[C10].ci95
    return high - low


def test_joint_intervals_are_narrower_than_each_sites_and_cover(tmp_path):
    covered, weighed = 0, IdentificationSettings(weighting="covariance")
    for seed in range(5):
        leg = sited_leg(tmp_path, 1.0, seed=seed, gain_sd=0.0)
        (found,) = joint(leg)
        alone = [
            identify(site, weighed, model, laws=NEO_HOOKEAN)[0]
            for site, model in zip(leg.sites, sites_model().models, strict=True)
        ]
        assert width(found) < min(map(width, alone))
        low, high = found.estimates[C10].ci95
        covered += low <= 1e-3 <= high
        assert found.agreement.p_value > 1e-4
        for site, single in zip(found.tests, alone, strict=True):
            own = site.by_itself[C10]
            assert own.value == pytest.approx(single.estimates[C10].value, rel=1e-3)
            error = single.estimates[C10].standard_error
            assert own.standard_error == pytest.approx(error, rel=0.05)
    assert covered >= 4


def test_a_site_that_is_otherwise_is_told(tmp_path):
    (found,) = joint(sited_leg(tmp_path, (1.0, 1.0, 1.4)))
    assert found.agreement.p_value < 1e-6
    assert found.farthest(C10).name == "low"
    assert found.tests[2].by_itself[C10].value == pytest.approx(1.4e-3, rel=0.02)
    assert any("do not agree on the parameters" in text and "low" in text for text in sentences_of([found]))


@pytest.mark.parametrize(("sites", "least"), [((1.0, 1.0, 1.0), 1.0), ((0.97, 1.0, 1.03), 1.2)])
def test_where_sites_differ_intervals_are_wider_by_the_birge_ratio(sites, least, tmp_path):
    (found,) = joint(sited_leg(tmp_path, sites, gain_sd=0.0))
    (alike,) = joint(sited_leg(tmp_path, 1.0, seed=3, gain_sd=0.0))
    of_degrees = found.agreement.chi_square / found.agreement.degrees_of_freedom
    ratio = found.agreement.birge_ratio
    assert ratio == max(np.sqrt(of_degrees), 1.0) >= least
    wider = ratio / alike.agreement.birge_ratio
    error = alike.estimates[C10].standard_error
    assert found.estimates[C10].standard_error == pytest.approx(wider * error, rel=0.15)
    assert width(found) == pytest.approx(wider * width(alike), rel=0.2)
    assert Goodness(0.0, 0, 1.0).birge_ratio == 1.0, "of one site"


def test_what_is_wrong_alike_is_not_widened(tmp_path):
    leg, table = sited_leg(tmp_path, (1.0, 1.0, 1.2)), correction_known_to(0.3)
    (found,) = joint(leg, corrections=[table] * 3)
    assert found.agreement.birge_ratio > 2
    # The correction may be off by 0.3 all the way, and lean by as much.
    assert found.estimates[C10].standard_error < 1.5 * np.hypot(0.3, 0.3) * 1e-3 * (1 + 1 / 6)


def correction_known_to(sd):
    d = np.linspace(0.0, DEPTH, 5)
    errors = {"length": np.full(5, sd)}
    return TabulatedCorrection("made", d, np.array([1e-3]), np.array([0.0]), np.zeros((1, 1, 5)), errors)


def test_the_corrections_error_does_not_average_out(tmp_path):
    leg, table = sited_leg(tmp_path, 1.0), correction_known_to(0.1)
    (without,) = joint(leg)
    (found,) = joint(leg, corrections=[table] * 3)
    error = found.estimates[C10].standard_error
    # C10 in series with fat follows a factor of 1 on the force by 1 + C10 / 3 fat.
    expected = 0.1 * 1e-3 * (1 + 1 / 6)
    assert error == pytest.approx(np.hypot(expected, without.estimates[C10].standard_error), rel=0.1)
    # Nor does what is wrong alike make sites disagree.
    assert found.agreement.p_value == pytest.approx(without.agreement.p_value, abs=0.1)


def test_a_prior_is_weighed_against_the_corrections_error(tmp_path):
    leg, table = sited_leg(tmp_path, 1.0), correction_known_to(0.2)
    known = replace(parameter_of(C10, sites_model().nominal), prior=Prior(0.8e-3, 0.04e-3, "linear"))
    (without,) = joint(leg, corrections=[table] * 3)
    (found,) = joint(leg, corrections=[table] * 3, parameters=(known,))
    # Of what the recordings say with the correction's error, and of the prior, by their weights.
    from_force = without.estimates[C10]
    weights = np.array([from_force.standard_error, 0.04e-3]) ** -2.0
    expected = weights @ [from_force.value, 0.8e-3] / weights.sum()
    assert found.estimates[C10].value == pytest.approx(expected, rel=0.02)
    assert found.estimates[C10].standard_error == pytest.approx(weights.sum() ** -0.5, rel=0.15)
    # Each site by itself, too.
    for site in found.tests:
        assert site.by_itself[C10].value == pytest.approx(expected, rel=0.03)


def test_instruments_of_sites_err_each_of_their_own(tmp_path):
    leg = sited_leg(tmp_path, 1.0)
    nominal = sites_model().nominal
    gain = replace(parameter_of("instrument.gain", nominal), role="nuisance", prior=Prior(1.0, 0.05, "linear"))
    (without,) = joint(leg)
    (found,) = joint(leg, parameters=(parameter_of(C10, nominal), gain))
    assert set(found.estimates) == {C10}
    own = 0.05 * 1e-3 * (1 + 1 / 6) / np.sqrt(3)
    error = np.hypot(own, without.estimates[C10].standard_error)
    assert found.estimates[C10].standard_error == pytest.approx(error, rel=0.25)


def test_both_laws_are_fitted_and_stiffening_is_found(tmp_path):
    neo, stiffening = joint(sited_leg(tmp_path, 0.6, 1.5), laws=("neo-hookean", "reduced-polynomial"))
    assert neo.goodness.p_value < 1e-6 < stiffening.goodness.p_value
    low, high = stiffening.estimates["deep.C20"].ci95
    assert low < 1.5e-3 < high
    assert stiffening.log.converged


def test_one_site_gives_what_the_leg_by_itself_gives(tmp_path):
    leg = sited_leg(tmp_path, 1.0)
    first = replace(leg, sites=leg.sites[:1])
    model = replace(sites_model(), models=sites_model().models[:1])
    settings = IdentificationSettings(weighting="covariance")
    (found,) = fitted(first, NEO_HOOKEAN, SearchRequest(settings=settings), None, model)
    (alone,) = identify(pressed_leg(tmp_path, 1.0, 0.0), settings, laws=NEO_HOOKEAN)
    assert found.estimates[C10].value == pytest.approx(alone.estimates[C10].value, rel=1e-4)
    assert found.estimates[C10].ci95 == pytest.approx(alone.estimates[C10].ci95, rel=2e-3)
    assert found.goodness.chi_square == pytest.approx(alone.goodness.chi_square, rel=1e-3)


def test_report_has_a_panel_a_site_and_the_numbers(tmp_path):
    results = joint(sited_leg(tmp_path / "leg", 1.0, 0.4), laws=("neo-hookean", "reduced-polynomial"))
    report = write_report(results, tmp_path / "out")
    laws = json.loads((tmp_path / "out" / "result.json").read_text())["laws"]
    assert [[one["name"] for one in law["tests"]] for law in laws.values()] == [list(SITES)] * 2
    page = report.with_name("report.html").read_text()
    text = report.read_text()
    for number, name in enumerate(SITES):
        assert f"site{number}" in page
        assert (report.parent / f"section-{name}.png").exists()
        assert f"{name}: rms" in text
    assert (report.parent / "fit.png").exists()


def test_a_folder_of_sites_is_read(tmp_path):
    folder = write_sites(tmp_path / "leg")
    leg = load_sites(folder)
    assert [site.site for site in leg.sites] == ["back", "medial"]
    back, medial = leg.sites
    assert medial.indenter.direction_deg == 180.0
    assert medial.indenter.radius == back.indenter.radius
    assert medial.tissues["superficial"] == back.tissues["superficial"]
    assert leg.id == back.id.removesuffix("-back")
    assert load_subject(folder, site="back").id == back.id
    assert len(measured_curve(medial).force)


def broken(change):
    return SITE_TABLES.replace(*change)


WRONG = {
    "no such key": (('name = "back"', 'name = "back"\ndepht_mm = 3'), "site.0.depht_mm"),
    "no name": (('name = "back"', ""), "site.0.name"),
    "twice": (('name = "back"', 'name = "medial"'), "site.name"),
    "a path for a name": (('name = "back"', 'name = "../back"'), "site.0.name"),
    "leaves the folder": (('"back"', '"back"\nrecordings = "../other"'), "site.recordings"),
    "same recordings": (('"back"', '"back"\nrecordings = "recordings/medial"'), "site.recordings"),
    "no recordings": (('"back"', '"back"\nrecordings = "elsewhere"'), "site back"),
    "unknown key of the indenter": (("direction_deg", "direction_dge"), "site medial, indenter"),
    "no number": (("180.0", '"left"'), "site medial, indenter.direction_deg"),
    "misses the leg": (("direction_deg = 180.0", "aim_mm = [500.0, 500.0]"), "site medial"),
    "no table": (("[site.indenter]\ndirection_deg = 180.0", "indenter = 3"), "site.1.indenter"),
    "one table": (('[[site]]\nname = "back"\n\n[[site]]', "[site]"), "site"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_with_a_site_is_one_line_with_its_name(tmp_path, wrong):
    change, field = WRONG[wrong]
    assert change[0] in SITE_TABLES
    folder = write_sites(tmp_path / "leg", broken(change))
    done = CliRunner().invoke(identify_app, ["--subject-dir", str(folder), "--out", str(tmp_path / "out")])
    assert done.exit_code == 2
    (line,) = done.output.strip().splitlines()
    assert field in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("seed", range(40))
def test_a_character_that_goes_wrong_in_a_site_ends_in_one_line_or_none(tmp_path, seed):
    generator = np.random.default_rng(seed)
    at = int(generator.integers(len(SITE_TABLES)))
    other = chr(int(generator.integers(32, 127)))
    folder = write_sites(tmp_path / "leg", SITE_TABLES[:at] + other + SITE_TABLES[at + 1 :])
    try:
        load_sites(folder)
    except InputError as error:
        assert "\n" not in str(error)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--model", "3d"], "--model"),
        (["--weighting", "paper"], "--weighting"),
        (["--site", "front"], "is not a site"),
        (["--identify", "instrument.gain"], "--identify"),
        (["--fix", "instrument.zero=0.1 N"], "--fix"),
        (["--prior", "instrument.zero=0.5±0.1 N"], "is not about 0"),
        (["--seed", "-1"], "--seed"),
    ],
)
def test_what_cant_be_had_of_all_sites_is_said(tmp_path, options, said):
    folder = write_sites(tmp_path / "leg")
    out = tmp_path / "out"
    arguments = ["--subject-dir", str(folder), "--out", str(out), *options]
    done = CliRunner().invoke(identify_app, arguments)
    assert done.exit_code == 2
    assert said in done.output.strip().splitlines()[-1]
    assert not out.exists()


def test_a_diagnosis_takes_one_site_and_says_how(tmp_path):
    folder = write_sites(tmp_path / "leg")
    arguments = ["--subject-dir", str(folder), "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(diagnose_app, arguments)
    assert done.exit_code == 2
    (line,) = done.output.strip().splitlines()
    assert "the leg has 2 (back, medial)" in line
    assert "--site back" in line


def test_a_leg_without_sites_has_none(tmp_path):
    folder = write_sites(tmp_path / "leg", "", ["."])
    assert load_sites(folder) is None
    with pytest.raises(InputError, match=r"has no \[\[site\]\]"):
        load_subject(folder, site="back")


@pytest.mark.slow
def test_the_command_fits_two_sites_of_a_folder(tmp_path):
    folder = write_sites(tmp_path / "leg")
    out = tmp_path / "out"
    arguments = ["--subject-dir", str(folder), "--out", str(out), "--law", "neo-hookean", "--depth", "5", "--jobs", "1"]
    done = CliRunner().invoke(identify_app, arguments)
    assert done.exit_code == 0, done.output
    (found,) = json.loads((out / "result.json").read_text())["laws"].values()
    assert [one["name"] for one in found["tests"]] == ["back", "medial"]
    assert found["converged"]
    again = CliRunner().invoke(identify_app, arguments)
    (found,) = json.loads((out / "result.json").read_text())["laws"].values()
    assert found["forward_solves_reused"] > 0, again.output
