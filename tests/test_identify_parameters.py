"""Any parameter identified, held or given a prior by name: in closed form, and (slow) by FE."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making import write_subject
from making_identification import DEPTH, AnalyticLeg, curve_of, identify, pressed_leg
from making_results import law_document
from test_inference import by_differential_evolution
from typer.testing import CliRunner

from legfem.commands.identify import app
from legfem.common.errors import InputError
from legfem.data import Recording
from legfem.data.ranges import c10_of
from legfem.inverse import settings as room
from legfem.inverse.catalogue import parameter_of, stiffness_in_words
from legfem.inverse.intervals import ADDS_NOTHING
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.parse_parameters import AskedParameters, read_prior, read_value
from legfem.inverse.population import CALF, population
from legfem.inverse.settings import IdentificationSettings
from legfem.legs.subject import LegAccuracy
from legfem.report.kinds import kind_of, page_of
from legfem.report.render import plain_page

NOMINAL = AnalyticLeg().nominal
POLYNOMIAL = ("reduced-polynomial",)


def free(*names: str, **priors: Prior) -> list[Parameter]:
    """Return parameters of a leg, those with a prior by the term's name."""
    return [replace(parameter_of(name, NOMINAL), prior=priors.get(name.partition(".")[0])) for name in names]


def said_of(found, subject) -> str:
    """Return the report of one law, its lines joined."""
    return " ".join(plain_page(page_of([found]), []).split())


THREE = ("deep.C10", "deep.C20", "superficial.C10")


@pytest.mark.parametrize(
    ("truth", "seed"), [((0.7, 0.8, 2.6), 1), pytest.param((1.6, 0.3, 1.5), 2, marks=pytest.mark.slow)]
)
def test_three_planted_stiffnesses_are_found(tmp_path: Path, truth: tuple[float, ...], seed: int) -> None:
    subject = pressed_leg(tmp_path, *truth[:2], seed=seed, fat=truth[2], noise=0.002)
    (found,) = identify(subject, laws=POLYNOMIAL, parameters=free(*THREE))
    assert found.log.converged and found.log.forward_solves <= 25
    assert list(found.estimates) == list(THREE)
    for value, one in zip(truth, found.estimates.values(), strict=True):
        assert one.shown.ci95[0] <= value <= one.shown.ci95[1]
        assert one.shown.value == pytest.approx(value, rel=0.05)
        assert "superficial.C10" not in one.moves
    assert np.diag(found.correlations) == pytest.approx(1.0)
    document = json.loads(json.dumps(law_document(found), allow_nan=False))
    fat = document["parameters"]["c10_superficial"]
    assert fat["unit"] == "kPa" and fat["value"] == pytest.approx(truth[2], rel=0.05)
    assert document["search"]["solves"][0].keys() >= {"c10_kPa", "c20_kPa", "c10_superficial_kPa"}
    text = said_of(found, subject)
    assert re.search(r"C10 of the superficial tissue \(fat\), reduced polynomial law: \d", text)
    assert "C10 C20 C10 of the fat C10 +1.000" in text and "nan" not in text
    kind_of([found]).figure([found])


def test_a_prior_is_one_more_measurement(tmp_path: Path) -> None:
    """With a narrow prior the fat stands; with a wide one the recordings say where."""
    subject = pressed_leg(tmp_path, 0.7, 0.8, seed=3, fat=2.6)
    subject = replace(subject, starts_at_contact=True, accuracy=LegAccuracy(contact_sd=0.0, rig_sd=0.0))
    names = THREE

    def identified(prior: Prior):
        return identify(subject, laws=POLYNOMIAL, parameters=free(*names, superficial=prior))[0]

    narrow = identified(Prior(2e-3, 2e-6)).estimates
    assert narrow["superficial.C10"].shown.value == pytest.approx(2.0, rel=2e-3)
    assert narrow["superficial.C10"].identifiability == "not identifiable"
    assert narrow["superficial.C10"].error_over_prior > ADDS_NOTHING
    wide = identified(Prior(2e-3, math.log(2.0), "log"))
    assert wide.weighting == "covariance" and "priors" in wide.cost.minimised
    fat = wide.estimates["superficial.C10"]
    assert fat.shown.ci95[0] <= 2.6 <= fat.shown.ci95[1]
    assert fat.error_over_prior < ADDS_NOTHING
    assert fat.standard_error < fat.value * math.log(2.0)
    deep = wide.estimates["deep.C10"].standard_error
    assert deep > 1.05 * narrow["deep.C10"].standard_error
    text = said_of(wide, subject)
    assert "prior 2 x/ 2 kPa (its logarithm is normal)" in text
    assert "C10 of the fascia: 100 kPa; assumed" in text
    assert law_document(wide)["settings"]["priors"]["c10_superficial"]["centre"] == 2.0


def test_failed_solves_among_three_parameters_are_values(tmp_path: Path) -> None:
    """Three of the design's seven solves stop short here."""
    subject = pressed_leg(tmp_path, 1.0, 0.8, seed=1, fat=2.4, noise=0.01)
    prior = Prior(2e-3, math.log(1.5), "log")
    (found,) = identify(
        subject, model=AnalyticLeg(softest=0.6), laws=POLYNOMIAL, parameters=free(*THREE, superficial=prior)
    )
    failed = [solve for solve in found.log.solves if not solve.complete]
    assert len(failed) >= 3 and found.log.converged and found.log.forward_solves <= 20
    for value, one in zip((1.0, 0.8, 2.4), found.estimates.values(), strict=True):
        assert one.shown.ci95[0] <= value <= one.shown.ci95[1]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_the_reduced_polynomial_never_costs_more_with_a_third_parameter(tmp_path: Path, seed: int) -> None:
    subject = pressed_leg(tmp_path, 1.5, 0.0, seed, fat=2.3)
    prior = Prior(2e-3, 1e-3)
    neo_hookean, polynomial = identify(subject, parameters=free(*THREE, superficial=prior))
    assert list(neo_hookean.estimates) == ["deep.C10", "superficial.C10"]
    assert polynomial.cost.minimised_value <= neo_hookean.cost.minimised_value
    assert polynomial.cost.minimised_unit == "1"


@pytest.mark.parametrize(
    ("name", "truth", "unit"), [("instrument.zero", 0.15, "N"), ("instrument.contact_offset", 0.4, "mm")]
)
def test_zero_and_onset_of_the_instrument_are_found_in_closed_form(
    tmp_path: Path, name: str, truth: float, unit: str
) -> None:
    subject = pressed_leg(tmp_path, 0.7, 0.8, noise=0.0)
    curve, times = curve_of(0.7, 0.8), np.arange(0.0, DEPTH / 0.4, 0.1)
    read = {"instrument.zero": 0.0, "instrument.contact_offset": 0.0, name: truth}
    d = 0.4 * times
    force = curve(d - read["instrument.contact_offset"]) + read["instrument.zero"]
    recording = Recording(times, d, force, "trial1")
    subject = replace(subject, recordings=(recording,), starts_at_contact=True)
    deep = ("deep.C10", "deep.C20")
    (found,) = identify(subject, laws=POLYNOMIAL, parameters=free(*deep, name))
    one = found.estimates[name]
    assert one.value == pytest.approx(truth, abs=0.02) and one.unit == unit
    assert one.ci95[0] <= truth <= one.ci95[1]
    assert found.estimates["deep.C10"].shown.value == pytest.approx(0.7, rel=0.02)
    assert name in found.values and name not in found.model_values
    assert law_document(found)["parameters"][f"{name[11:]}_instrument"]["unit"] == unit
    (held,) = identify(subject, laws=POLYNOMIAL, parameters=free(*deep), fixed={name: truth})
    assert held.estimates["deep.C10"].shown.value == pytest.approx(0.7, rel=0.02)
    assert f"{truth:g} {unit}; assumed".replace(" 1;", ";") in said_of(held, subject)


def test_a_gain_without_a_prior_is_not_told_from_stiffness(tmp_path: Path) -> None:
    subject = pressed_leg(tmp_path, 0.7, 0.8, seed=5)
    names = ("deep.C10", "instrument.gain")
    (neo,) = identify(subject, laws=("neo-hookean",), parameters=free(*names, instrument=Prior(1.0, 0.02)))
    gain = neo.estimates["instrument.gain"]
    assert gain.unit == "-" and gain.value == pytest.approx(1.0, abs=0.2)
    (alone,) = identify(
        subject, laws=POLYNOMIAL, parameters=free("instrument.gain"), fixed={"deep.C10": 0.7e-3, "deep.C20": 0.8e-3}
    )
    assert alone.log.forward_solves == 1 and alone.log.converged
    assert alone.estimates["instrument.gain"].value == pytest.approx(1.0, abs=0.02)


def test_a_search_of_the_users_own_finds_the_same(tmp_path: Path) -> None:
    subject = pressed_leg(tmp_path, 0.7, 0.8)
    own = IdentificationSettings(minimiser=by_differential_evolution)
    (found,), (usual,) = (identify(subject, s, laws=POLYNOMIAL) for s in (own, None))
    assert found.log.converged
    for name, one in found.estimates.items():
        error = usual.estimates[name].standard_error
        assert abs(one.value - usual.estimates[name].value) < 0.02 * error
    named = law_document(found)["settings"]["genetic"]["minimiser"]
    assert named == "by_differential_evolution"


def test_the_documented_example_of_an_own_search_is_the_one_that_is_tested() -> None:
    """The seam's docstring and the page hold the same lines, and they run."""
    source = Path(room.__file__).read_text(encoding="utf-8")
    lines = [line[4:] for line in source.splitlines() if line.startswith((">>>", "..."))]
    space: dict[str, object] = {}
    exec("\n".join(lines), space)
    settings = space["settings"]
    assert isinstance(settings, IdentificationSettings)
    aim = np.array([0.2, 0.7])
    found = settings.minimiser(lambda genes: np.sum((genes - aim) ** 2, axis=-1), np.full((1, 2), 0.5), 0)
    assert found.best == pytest.approx(aim, abs=0.01)
    page = Path(__file__).resolve().parents[1] / "docs" / "extending.md"
    assert "\n".join(lines) in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("text", "centre", "sd", "scale"),
    [
        ("superficial.C10=2±1 kPa", 2e-3, 1e-3, "linear"),
        ("superficial.C10 = 2 +- 1 kPa", 2e-3, 1e-3, "linear"),
        ("superficial.C10=2∓1kPa", 2e-3, 1e-3, "linear"),
        ("superficial.C10=0.002 +/- .001 MPa", 2e-3, 1e-3, "linear"),
        ("superficial.C10=2 x/ 1.5 kPa", 2e-3, math.log(1.5), "log"),
        ("superficial.C10=2×/1.5 kPa", 2e-3, math.log(1.5), "log"),
        ("deep.D1=28 x/ 2 1/MPa", 28.0, math.log(2), "log"),
        ("instrument.gain=1±0.01", 1.0, 0.01, "linear"),
        ("instrument.gain=1±0.01 -", 1.0, 0.01, "linear"),
        ("instrument.zero=-0.1±2e-2 N", -0.1, 0.02, "linear"),
        ("instrument.contact_offset=0±0.5 mm", 0.0, 0.5, "linear"),
    ],
)
def test_priors_are_read_as_people_write_them(text: str, centre: float, sd: float, scale: str) -> None:
    name, prior = read_prior(text, NOMINAL)
    assert name == text.partition("=")[0].strip()
    assert (prior.centre, prior.sd) == (pytest.approx(centre), pytest.approx(sd))
    assert prior.scale == scale


def test_a_population_is_a_prior_with_its_source() -> None:
    table = population().sites[CALF]
    for name, tissue in (("superficial.C10", table.superficial), ("deep.C10", table.deep)):
        read, prior = read_prior(f"{name} = population", NOMINAL)
        assert (read, prior.scale) == (name, "log") and "MULTIS" in prior.source
        assert prior.centre == pytest.approx(1e-3 * tissue.C10_median_kPa)
        assert prior.sd == tissue.log_sd > tissue.log_sd_of_the_median
        # Such as nobody would doubt in a folder, up to two standard deviations.
        inside = c10_of(name.partition(".")[0]).usual
        assert inside[0] < 1e3 * prior.value_at(-2) < 1e3 * prior.value_at(2) < inside[1]


def test_what_has_only_a_prior_is_a_nuisance_and_what_is_held_is_in_the_models_unit() -> None:
    written = AskedParameters(priors=["superficial.C10=2±1 kPa", "deep.C10=1 x/ 2 kPa"])
    roles = {one.name: one.role for one in written.parameters(NOMINAL)}
    assert roles == {"deep.C10": "identified", "deep.C20": "identified", "superficial.C10": "nuisance"}
    assert read_value("deep.D1=28 1/MPa", NOMINAL) == ("deep.D1", 28.0)
    assert read_value("fascia.C10=50 kPa", NOMINAL) == ("fascia.C10", pytest.approx(0.05))
    with pytest.raises(InputError, match="to be identified as well"):
        AskedParameters(["deep.C10"], fixed=["deep.C10=1 kPa"]).held(NOMINAL)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--identify", "superfical.C10"], "did you mean superficial.C10?"),
        (["--identify", "deep.c10"], "did you mean deep.C10?"),
        (["--identify", "superficial.C20"], "is not a parameter of this model"),
        (["--prior", "superficial.C10=2"], "can't be read"),
        (["--prior", "fascia.C10=population"], "is not in the population's table"),
        (["--prior", "superficial.C10=2±1"], "has no unit"),
        (["--prior", "superficial.C10=2±1 mm"], "has the unit 'mm'; give it in MPa or kPa"),
        (["--prior", "superficial.C10=2±0 kPa"], "has no width"),
        (["--prior", "superficial.C10=2 x/ 0.5 kPa"], "is not a factor"),
        (["--prior", "deep.C10=900±1 kPa"], "outside the bounds"),
        (["--prior", "superficial.C10=2±1 kPa", "--weighting", "paper"], "--weighting"),
        (["--fix", "deep.D1=28"], "has no unit"),
        (["--fix", "deep.D1=-3 1/MPa"], "is negative"),
        (["--fix", "deep.C10=1 kPa", "--identify", "deep.C10"], "to be identified as well"),
        (["--identify", "deep.C20"], "deep.C10: is neither identified nor given"),
        (["--identify", "deep.C10", "--law", "reduced-polynomial"], "deep.C20: is neither"),
        (["--identify", "deep.C20", "--law", "neo-hookean"], "nothing is left to identify"),
    ],
)
def test_what_can_not_be_identified_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], words: str
) -> None:
    write_subject(tmp_path / "leg")
    monkeypatch.chdir(tmp_path)
    run = CliRunner().invoke(app, ["--subject-dir", "leg", *options])
    assert run.exit_code == 2, run.output
    assert len(run.output.strip().splitlines()) == 1 and words in run.output
    assert [path.name for path in tmp_path.iterdir()] == ["leg"]


@pytest.mark.slow
def test_fat_is_identified_beside_muscle_from_the_command(tmp_path: Path) -> None:
    options = ["--identify", "deep.C10", "--identify", "deep.C20", "--identify", "superficial.C10"]
    prior = ["--prior", "superficial.C10=2.2±0.4 kPa"]
    command = ["--subject", "3", *options, *prior, "--law", "reduced-polynomial", "--jobs", "1"]
    run = CliRunner().invoke(app, [*command, "--out", str(tmp_path)])
    assert run.exit_code == 0, run.output
    (document,) = json.loads((tmp_path / "result.json").read_text())["laws"].values()
    found = document["parameters"]
    # What subject 3's recordings were simulated with (kPa).
    for name, truth in {"c10_deep": 0.70, "c20_deep": 0.80, "c10_superficial": 2.0}.items():
        low, high = found[name]["ci95"]
        assert low <= truth <= high
    assert document["converged"] and document["forward_solves"] <= 25
    fat = found["c10_superficial"]
    assert fat["standard_error"] < 0.4 and fat["role"] == "identified"
    report = (tmp_path / "report.txt").read_text()
    assert "prior 2.2 ± 0.4 kPa" in report and "C10 of the superficial tissue (fat)" in report


def test_progress_tells_stiffnesses_in_kpa_and_the_fibres_ratio():
    values = {"deep.C10": 1.2e-3, "fascia.C10": 0.1, "deep.fibre_ratio": 2.5, "deep.D1": 28.0}
    assert stiffness_in_words(values) == "C10 1.2 kPa, C10 of the fascia 100 kPa, fibres 2.5"
    # As the exponential law's.
    assert stiffness_in_words(values | {"deep.C20": 0.0}) == stiffness_in_words(values)


def test_a_standard_error_along_a_curved_valley_is_that_of_the_profile(tmp_path):
    """Layers in series: of the fat no more is known than before, and the muscle's C10 follows it out of line."""
    fat = Parameter("superficial.C10", "MPa", (1e-5, 1.0), Prior(2e-3, 1.0, "log"), role="nuisance", scale="log")
    deep = Parameter("deep.C10", "MPa", (1e-5, 0.1), scale="log")
    model = AnalyticLeg(depth=DEPTH, early=0.0)
    subject = pressed_leg(tmp_path, 0.9, 0.0, noise=0.01)
    (fit,) = identify(subject, laws=("neo-hookean",), parameters=(deep, fat), model=model)
    muscle, other = fit.estimates["deep.C10"], fit.estimates["superficial.C10"]
    assert other.standard_error == pytest.approx(1.0 * other.value, rel=0.02)
    low, high = muscle.ci95
    times = fit.settings["t_quantile"]
    assert muscle.standard_error / muscle.value == pytest.approx(np.log(high / low) / (2 * times), rel=1e-6)
    tangent = abs(fit.correlations[0, 1]) * muscle.value**2 / (3 * other.value)
    assert muscle.standard_error > 1.5 * tangent
