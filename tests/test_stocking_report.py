"""The report of a leg in its stocking: what it says, its numbers, its pictures and fields."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making_legs_3d import round_leg
from matplotlib.image import imread
from reading_page import read

from legfem.api import Identification
from legfem.common.errors import Doubt
from legfem.common.progress import Silent
from legfem.common.units import mmhg_to_mpa, mpa_to_kpa, mpa_to_mmhg
from legfem.fem.fields import fields_of
from legfem.geometry.leg_shape import SKIN
from legfem.geometry.motion import RigidTransform
from legfem.geometry.slices import calf_levels
from legfem.imaging.registration import Registration
from legfem.inverse.answer import Notice
from legfem.inverse.document import SCHEMA, fit_document
from legfem.inverse.elastography import ShearModulus
from legfem.inverse.fit import Identity
from legfem.inverse.intervals import ADDS_NOTHING, quantile
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.report.answers import sentence_of, sentences_of
from legfem.report.estimates import interval_text, value_text
from legfem.report.kinds import page_of
from legfem.report.render import estimates_frame, plain_page, rendered
from legfem.report.results import write_report
from legfem.report.words import Directions, angle_round, unwrapped
from legfem.stockings import identification
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.equilibrium import EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import Stocking, fitted_stocking, stocking_load
from legfem.stockings.identification import assessed, compared, identify_in_stocking, noticed
from legfem.stockings.leg import Posture, StockingLeg, default_veins
from legfem.stockings.pressures import too_low_by
from legfem.stockings.scan_fit import stiffness_priors
from studies.making.shapes import parametric_leg, read_legs

LEGS = Path(__file__).resolve().parents[1] / "studies" / "stockings" / "legs.toml"
MESH = SolidMeshSettings(skin_size=16, inside_size=20, bone_size=13, layer_elements=0.35, turn_elements=8)
ACCURACY = ContourAccuracy(correlation=16.0, around=90.0, along=120.0)
"""Alike over a longer way than by default: fewer modes to learn the leg's answers to."""


@pytest.fixture(scope="module")
def searched():
    """50 mm of the first leg, its scan in the stocking made by the model itself; and what its fit is made of."""
    bare = parametric_leg(read_legs(LEGS)["1"], n_points=90).at_levels(np.linspace(50.0, 100.0, 11))
    stocking = fitted_stocking(bare, "2")
    true = {"deep": NeoHookean(2.6e-3, 2.0), "superficial": NeoHookean(6e-3, 2.0)}
    made = EquilibriumSolver(LegModel3D(bare, true, MESH), stocking).solve()
    registration = Registration(
        RigidTransform(), 0.11, 2000, 120, np.array([0.012, 0.011, 0.05]), np.array([0.03, 0.02, 0.09]), 23, True
    )
    slices = calf_levels(bare)
    leg = StockingLeg(
        "s1",
        "leg of the tests",
        "simulated",
        bare,
        bare,
        made.shape,
        registration,
        stocking,
        ACCURACY,
        {name: NeoHookean(3e-3, 2.0) for name in true},
        False,
        "held",
        slices,
        default_veins(bare, float(np.median(slices))),
    )
    made_of = []

    def recorded(*given):
        made_of.append(given)
        return compared(*given)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(identification, "compared", recorded)
        return identify_in_stocking(leg, Silent(), mesh=MESH), made_of[0]


@pytest.fixture(scope="module")
def result(searched):
    return searched[0]


@pytest.fixture(scope="module")
def folder(result, tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    assert write_report([result], folder) == folder / "report.txt"
    return folder


def words_on(result) -> str:
    """What the report says, in one line."""
    return " ".join(plain_page(page_of([result]), []).split())


def changed(result, **details):
    """The fit of a run with other details."""
    leg = details.get("leg", result.details.leg)
    subject = Identity(leg.id, leg.title, leg.origin)
    return noticed(replace(result, subject=subject, details=replace(result.details, **details)))


def document(result) -> dict:
    """What result.json says of the law."""
    return fit_document([result])["laws"]["neo-hookean"]


def missing(result):
    """Its best fit, twice as far from the scan as errors explain."""
    best = result.details.best
    return replace(best, distances=np.full_like(best.distances, 2 * result.details.leg.accuracy.expected_rms))


def test_what_the_veins_hold_stands_beside_the_tissues_pressure(result):
    posture = Posture(1250.0, lying=mmhg_to_mpa(10.0))
    standing = changed(result, leg=replace(result.details.leg, posture=posture))
    assert "when standing still" not in words_on(result)
    assert "when standing still" in words_on(standing)
    veins = document(standing)["pressures"]["veins"]
    for vein, tissue in zip(veins, result.details.pressures.at_veins, strict=True):
        borne = vein["inside_minus_tissue_kPa"]
        assert borne["lying"] == pytest.approx(1e3 * (mmhg_to_mpa(10.0) - tissue))
        column = 1060 * 9.80665 * 1e-6 * (1250.0 - vein["position_mm"][2])
        assert borne["standing"] == pytest.approx(column - 1e3 * tissue, rel=1e-6)


def widened(searched, half_width: float, **others):
    """The result with other intervals, as wide as is said (over the value), and what else its fit is made of."""
    fit, best, found, _ = searched[1]
    best, found = others.get("best", best), others.get("found", found)
    half = math.asinh(half_width)
    return compared(fit, best, found, [(value * math.exp(-half), value * math.exp(half)) for value in found.best.point])


def test_a_scan_made_by_the_model_itself_is_met(result):
    """With the stiffness it was made with: no more than the linear solver's error is left."""
    np.testing.assert_allclose(list(result.details.best.stiffness.values()), [2.6e-3, 6e-3], rtol=0.02)
    assert result.details.best.rms < 0.01
    assert result.details.discrepancy is not None and result.details.discrepancy.verdict == "consistent"


def test_the_web_page_is_whole_and_shows_the_leg(result, folder):
    html = (folder / "report.html").read_text(encoding="utf-8")
    page = read(html)
    assert len(html.encode()) < 5_000_000
    assert "mmHg on average; at the deep veins the pressure is" in page.words
    assert "simulated data (the scans were computed" in page.words
    for known in result.estimates.values():
        assert value_text(known) in page.words
    for k, vein in enumerate(result.details.leg.veins):
        low, high = map(mpa_to_mmhg, result.details.pressures.vein_interval(k))
        assert f"pressure at the {vein.name} vein" in page.words
        assert low < mpa_to_mmhg(result.details.pressures.at_veins[k]) < high
        assert f"{low:.1f} to {high:.1f} mmHg" in page.words
    assert page.words.index("end faces are held") < page.words.index("The leg, bare and dressed")
    for tag in ("estimated", "computed", "assumed", "prior", "simulated"):
        assert f'<span class="tag {tag}">' in html
    assert '<span class="tag measured">' not in html


def test_a_page_of_a_state_that_was_not_found_or_a_scan_that_is_missed_says_so(result):
    report = replace(result.details.equilibrium.state.report, complete=False, reason="step too small")
    state = replace(result.details.equilibrium.state, report=report)
    lost = changed(result, equilibrium=replace(result.details.equilibrium, state=state), pressures=None)
    page = page_of([lost])
    assert page.headline.tone == "wrong" and "could not be computed" in page.headline.sentence
    read(rendered(page))
    page = page_of([changed(result, best=missing(result))])
    assert page.headline.tone == "wrong"
    assert page.headline.answers[-1][1].startswith("Don't use the stiffness")


def test_a_page_of_doubtful_input_does_not_say_that_its_pressures_can_be_used(result):
    doubt = Doubt("leg.toml", "bare", "40 mm of the leg are modelled", "give 100 mm or more")
    page = page_of([changed(result, leg=replace(result.details.leg, doubts=(doubt,)))])
    assert page.headline.tone == "caution" and page.headline.heading.startswith("Check the doubtful input")


def test_page_says_who_what_and_that_it_is_simulated(result, folder):
    text = (folder / "report.txt").read_text()
    assert text.startswith("What does the compression stocking do to leg s1?")
    assert "leg of the tests" in text
    assert "*** SIMULATED DATA *** (the scans were computed by a model" in text
    assert "0.110 mm (root mean square of 2000 patches, 120 left out)" in " ".join(text.split())
    measured = changed(result, leg=replace(result.details.leg, origin="measured"))
    assert "*** MEASURED DATA ***" in (page := words_on(measured))
    assert "imulated" not in page
    assert max(map(len, text.splitlines())) <= 100


def test_page_gives_stiffness_with_intervals_and_how_it_was_searched_for(result, folder):
    text = " ".join((folder / "report.txt").read_text().split())
    for known, tissue in zip(
        result.estimates.values(), ("deep tissue (muscle)", "superficial tissue (fat)"), strict=True
    ):
        interval = "" if known.undetermined else f" (95 % {interval_text(known)})"
        shown = f"{value_text(known)}{interval}; estimated, both scans; {known.identifiability}"
        assert f"C10 of the {tissue}: {shown}" in text
    assert f"full solves: {result.log.forward_solves}" in text
    assert f"Errors of the contours alone would cause {result.details.leg.accuracy.expected_rms:.3f} mm" in text


def test_a_summary_tells_stiffness_and_pressures(result):
    said = " ".join(Identification(result.details.leg, (result,)).summary().split())
    assert "C10 of the deep tissue (muscle)" in said and "Hydrostatic pressure" in said
    assert said.count("full solves") == 1 and "legfem 0" not in said


def test_page_gives_pressures_in_both_units(result, folder):
    text = (folder / "report.txt").read_text()
    found = result.details.pressures
    for pressure in (found.mean_interface, found.greatest_interface, found.greatest_in_fat):
        assert f"{mpa_to_mmhg(pressure):.1f} mmHg ({mpa_to_kpa(pressure):.2f} kPa)" in text
    for vein, pressure in zip(result.details.leg.veins, found.at_veins, strict=True):
        share = 100 * pressure / found.mean_interface
        assert f"{vein.name}" in text and f"{share:.0f} % of the mean on the skin" in text
    assert "nan" not in text


@pytest.mark.parametrize(
    "half_width, verdict", [(0.05, "identifiable"), (0.3, "weakly identifiable"), (0.8, "not identifiable")]
)
def test_verdict_follows_the_interval(searched, half_width, verdict):
    other = widened(searched, half_width)
    for known in other.estimates.values():
        assert known.relative_half_width == pytest.approx(half_width)
        assert known.identifiability == verdict
    assert f"both scans; {verdict}" in words_on(other)


def test_an_open_interval_is_said_in_words_and_null(searched):
    other = compared(*searched[1][:3], [(2e-3, 4e-3), (1.5e-3, np.inf)])
    assert "(95 % at least 1.5); estimated, both scans; not identifiable" in words_on(other)
    assert "C10 of the superficial tissue (fat) cannot be determined" in words_on(other)
    found = document(other)["parameters"]["c10_superficial"]
    assert found["ci95"] == [pytest.approx(1.5), None]


def test_intervals_are_the_profile_s(result):
    """A scan by the model itself: the profile is nearly as its curvature at the least."""
    for known in result.estimates.values():
        assert known.ci95[0] < known.value < known.ci95[1]
    low, high = result.estimates["deep.C10"].ci95
    curved = 2 * quantile(0) * np.sqrt(result.details.best.log_covariance[0, 0])
    assert np.log(high / low) == pytest.approx(curved, rel=0.2)


def test_a_fit_that_misses_the_scan_is_weak_at_best_and_warned_of(searched):
    result, missed = searched[0], missing(searched[0])
    other = changed(widened(searched, 0.05, best=missed), best=missed)
    assert {known.identifiability for known in other.estimates.values()} == {"weakly identifiable"}
    assert any("The model misses the scan" in text for text in sentences_of([other]))
    assert not any("misses the scan" in text for text in sentences_of([result]))


def test_a_stiffness_at_a_bound_is_not_known(searched):
    found = searched[1][2]
    at_bound = replace(found, best=replace(found.best, point=np.array([found.best.point[0], 0.1])))
    muscle, fat = widened(searched, 0.05, found=at_bound).estimates.values()
    assert (muscle.identifiability, fat.identifiability, fat.at_bound) == ("identifiable", "not identifiable", "upper")


def test_scans_that_add_nothing_to_what_was_known_do_not_identify(searched):
    shear = ShearModulus("superficial", "across", 12e-3, 2e-4, "an article")
    fit, best, found, _ = searched[1]
    law = replace(found.search.law, parameters=stiffness_priors((shear,)).parameters)
    known = compared(fit, best, replace(found, search=replace(found.search, law=law)), []).estimates
    fat = known["superficial.C10"]
    assert fat.error_over_prior > ADDS_NOTHING and fat.identifiability == "not identifiable"
    assert known["deep.C10"].error_over_prior == 0.0


def test_what_did_not_settle_or_was_not_found_is_warned_of(result):
    unsettled = changed(result, equilibrium=replace(result.details.equilibrium, converged=False, changes=(0.1, 0.04)))
    assert "still changed by 4 %" in " ".join(sentences_of([unsettled]))
    report = replace(result.details.equilibrium.state.report, complete=False, reason="step too small")
    state = replace(result.details.equilibrium.state, report=report)
    lost = changed(result, equilibrium=replace(result.details.equilibrium, state=state), pressures=None)
    assert "could not be computed (step too small)" in sentences_of([lost])[0]
    page = words_on(lost)
    assert "Hydrostatic pressure" not in page and "nan" not in page
    assert document(lost)["pressures"] is None
    met = assessed(replace(result.details, best=None, discrepancy=None, problem="step too small"), result.log, {})
    assert any("could be compared with its scan: step too small" in text for text in sentences_of([met]))
    assert not met.estimates and "Not identified: step too small" in words_on(met)


def test_slack_heights_and_spanned_hollows_are_warned_of(result):
    bare = result.details.leg.bare
    spans = stocking_load(bare, result.details.leg.stocking).perimeter
    wide = Stocking(0.3, bare.levels, np.where(bare.levels < 70.0, 1.1, 0.9) * spans)
    worn = replace(result.details.equilibrium, load=stocking_load(bare, wide))
    texts = " ".join(sentences_of([changed(result, equilibrium=worn)]))
    assert "slack, and presses on nothing, at 4 of 11 heights, between 50 and 65 mm" in texts
    assert (worn.load.unloaded_skin[:4] == 0).all(), "slack is no hollow"
    assert "as if the leg continued unchanged" in texts
    free = changed(result, leg=replace(result.details.leg, ends="free"))
    assert not any("continued unchanged" in text for text in sentences_of([free]))


def test_document_has_every_number_with_its_unit(result):
    whole = json.loads(json.dumps(fit_document([result]), allow_nan=False))
    assert whole["schema"] == SCHEMA and whole["kind"] == "stocking" and whole["origin"] == "simulated"
    read = whole["laws"]["neo-hookean"]
    found = read["parameters"]["c10_superficial"]
    assert found["unit"] == "kPa" and found["ci95"][0] < found["value"] < found["ci95"][1]
    assert found["value"] == pytest.approx(1e3 * result.details.best.stiffness["superficial.C10"])
    assert read["solves"] == {"equilibria_to_identify": len(result.log.solves), "states": result.details.states}
    assert [s["cost_mm2"] for s in read["search"]["solves"]][-1] > 0 and len(result.log.solves) <= 9
    assert read["registration"]["residual_rms_mm"] == 0.11
    pressures = read["pressures"]
    assert pressures["mean_interface_kPa"] == pytest.approx(1e3 * result.details.pressures.mean_interface)
    assert [vein["name"] for vein in pressures["veins"]] == [v.name for v in result.details.leg.veins]
    told = [sentence_of(Notice(**one)) for one in read["notices"]]
    assert told == sentences_of([result])
    assert {"legfem", "dolfinx", "python"} <= set(whole["versions"])
    (scans,) = read["tests"]
    contours = [scans["curve"]["measured_skin_displacement_mm"], scans["channels"]["muscle_displacement"]["measured"]]
    assert [len(scans["points_mm"][name]["x"]) for name in scans["points_mm"]] == list(map(len, contours))
    assert np.mean(contours[0]) < 0.0, "the stocking presses the skin in"
    assert read["cost"]["unit"] == "mm2" and read["cost"]["rms_mm"] == pytest.approx(result.details.best.rms)
    assert read["cost"]["r_squared"] > 0.99 and read["goodness"]["p_value"] > 0.05
    skin = read["computed"]["pressure_on_skin"]
    assert skin["unit"] == "mmHg" and skin["value"] == pytest.approx(
        mpa_to_mmhg(result.details.pressures.mean_interface)
    )
    vein = read["computed"]["pressure_at_fibular_vein"]
    assert vein["ci95"][0] < vein["value"] < vein["ci95"][1]
    rows = estimates_frame([result]).set_index("parameter")
    assert rows.loc["pressure_on_skin", "value"] == skin["value"] and rows.loc["c10_deep", "unit"] == "kPa"


def test_a_leg_without_a_scan_in_its_stocking_is_reported(result):
    leg = replace(result.details.leg, compressed=None, registration=None, known=True)
    given = assessed(replace(result.details, leg=leg, best=None, scan_load=None), result.log, {})
    page = words_on(given)
    assert "Not identified: the leg was not scanned in its stocking" in page
    read = document(given)
    assert not read["parameters"] and not read["tests"] and read["goodness"]["p_value"] is None
    assert read["stiffness_of_the_pressures"]["given"] and read["assumed"]["deep_C10_kPa"] == pytest.approx(
        1e3 * result.details.parameters["deep.C10"]
    )
    assert read["contours"] is None and read["registration"] is None


def test_pictures_and_fields_are_written_and_nothing_else_is_left(folder):
    for name in ("interface-pressure", "mid-calf", "contours", "fat"):
        image = imread(folder / f"{name}.png")
        assert image.shape[0] > 800 and image[..., :3].std() > 0.05
    text = (folder / "report.txt").read_text()
    there = {path.name for path in folder.iterdir()}
    assert {"report.txt", "result.json", "fields.xdmf", "fields.h5"} <= there
    assert not any(name.startswith(".") for name in there)
    assert all(name in text for name in there - {"report.txt"})


def test_fields_hold_the_stocking_s_pressure(result):
    result.details.model.set_state(
        result.details.equilibrium.state, result.details.equilibrium.pressure, result.details.parameters
    )
    fields = fields_of(result.details.model.compression.system)
    assert fields.skin_pressure.name == "interface_pressure"
    highest = 1e3 * result.details.equilibrium.load.pressure.max()
    assert fields.skin_pressure.x.array.max() == pytest.approx(highest, rel=0.1)
    skin = fields.skin_pressure.x.array.mean()
    assert skin == pytest.approx(1e3 * result.details.pressures.mean_interface, rel=0.1)


def test_pressure_in_columns_of_fat_is_the_probe_s(result):
    bare, fat = result.details.leg.bare, result.details.fat
    assert fat.levels.min() >= bare.levels[0] + 10.0
    assert np.isfinite(fat.greatest).all()
    assert (fat.greatest >= fat.mean).all()
    # The extreme over the nodes isn't below that over the columns, which lie between them.
    assert fat.greatest.max() <= 1.05 * result.details.pressures.greatest_in_fat
    assert 2.0 < fat.thickness.min() < fat.thickness.max() < 14.0


def test_the_greatest_pressure_in_fat_is_given_with_what_the_mesh_takes_off_it(result):
    least, most = too_low_by(16_679)
    assert least == pytest.approx(1 - 3.661 / 4.223) and 0.2 < most < 0.25
    assert too_low_by(100) == (least, most), "coarser than was measured"
    assert too_low_by(496_489)[0] == 0.0 and too_low_by(5_000_000)[1] < 0.05
    said = document(result)["pressures"]["greatest_in_fat_too_low_by"]
    assert said == list(too_low_by(result.details.tetrahedra))
    ends = [
        mpa_to_mmhg(result.details.pressures.greatest_in_fat / (1 - by)) for by in too_low_by(result.details.tetrahedra)
    ]
    assert f"{ends[0]:.1f} to {ends[1]:.1f} mmHg (by finer meshes of a leg that comes with legfem" in words_on(result)


def test_directions_round_the_leg():
    bare = parametric_leg(read_legs(LEGS)["1"])
    directions = Directions.of(bare)
    # A right leg: the fibula is at the patient's right, x < 0.
    assert [directions.at(a) for a in (0, 90, 180, -90)] == ["anterior", "medial", "posterior", "lateral"]
    assert directions.at(-130) == "posterior-lateral"
    assert directions.at(40) == "anterior-medial"
    assert Directions.of(round_leg()).at(91) == "left"
    sides = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    np.testing.assert_allclose(angle_round(sides, np.zeros(2)), [0.0, 90.0, 180.0])
    assert (np.diff(unwrapped(bare.contours[SKIN]), axis=1) > 0).all()
