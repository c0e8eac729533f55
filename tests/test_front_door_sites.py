"""``lf.identify`` of a leg with several sites, and of a leg in 3D alone: as the command does it."""

from __future__ import annotations

import inspect
import json
import shutil
from pathlib import Path

import pytest
from making import write_subject
from making_sites import sited_leg, sites_model, write_sites
from making_sites_in_3d import TRUE_C10, TRUE_RATIO, leg_of, models_as_deep_as_asked, models_of
from typer.testing import CliRunner

import legfem as lf
from legfem.api import identification
from legfem.commands.identify import app as identify_app
from legfem.experiments.leg_3d import SolidLegSettings
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.inverse.settings import IdentificationSettings
from legfem.legs import identification as leg_identification
from legfem.report.words import LAW_NAMES

RATIO = ("deep.C10", "deep.fibre_ratio")
IN_SPACE = "\n[recordings]\nplane_strain = false\n"


@pytest.fixture
def closed_form(monkeypatch):
    """Sections of sites in closed form; returns the numbers that they would be solved with."""
    asked = []

    def model(leg, request, settings=None):
        asked.append(settings)
        return sites_model()

    monkeypatch.setattr(identification, "section_forward", model)
    return asked


def in_space(folder: Path) -> Path:
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text() + IN_SPACE)
    return folder


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    patch = pytest.MonkeyPatch()
    patch.setattr(identification, "section_forward", lambda *_: sites_model())
    found = lf.identify(sited_leg(tmp_path_factory.mktemp("leg"), 0.6, 1.5))
    patch.undo()
    return found


def test_sites_are_fitted_together_and_can_be_read_drawn_and_written(both, tmp_path) -> None:
    assert isinstance(both, lf.Identification)
    assert [one.law for one in both.fits] == ["neo-hookean", "reduced-polynomial"]
    low, high = both["reduced-polynomial"].estimates["deep.C20"].ci95
    assert low < 1.5e-3 < high
    assert "3 sites together" in both.summary()
    frame = both.to_frame()
    assert list(frame["parameter"]) == ["c10_deep", "c10_deep", "c20_deep"]
    assert (frame["low"] < frame["value"]).all() and set(frame["unit"]) == {"kPa"}
    assert both.write(tmp_path / "out") == tmp_path / "out" / "report.txt"
    assert both.document() == json.loads((tmp_path / "out" / "result.json").read_text())
    page = both._repr_html_()
    assert page.count("<iframe") == 1 and "c20_deep" in page


def test_the_figure_has_a_panel_a_site_with_all_laws(both) -> None:
    assert both.best.law == "reduced-polynomial"
    figure = both.plot()
    for number, one in enumerate(both.best.tests):
        above = figure.axes[number]
        assert one.name in above.get_title(loc="left")
        named = [text.get_text() for text in above.get_legend().get_texts()]
        assert all(f"model, {LAW_NAMES[fit.law]}" in named for fit in both.fits)


@pytest.mark.slow
def test_an_instrument_known_by_a_prior_and_names_alone_are_taken(tmp_path, closed_form) -> None:
    found = lf.identify(sited_leg(tmp_path, 1.0), identify=["deep.C10"], mesh="coarse")
    assert [one.law for one in found.fits] == ["neo-hookean"], "names tell which law"
    assert found["neo-hookean"].estimates["deep.C10"].value == pytest.approx(1e-3, rel=0.05)
    assert isinstance(closed_form[0], PlaneStrainSettings)


def test_a_folder_with_sites_is_a_leg_of_sites_and_one_of_them_a_leg(tmp_path) -> None:
    folder = write_sites(tmp_path / "leg")
    leg = lf.load_sites(folder)
    assert [one.site for one in leg.sites] == ["back", "medial"]
    assert lf.load_subject(folder, site="medial").id == leg.sites[1].id
    with pytest.raises(lf.InputError, match=r'site="back"; lf.identify\(folder\)'):
        lf.load_subject(folder)
    with pytest.raises(lf.InputError, match=r"the leg has none; load it with load_subject"):
        lf.load_sites(write_subject(tmp_path / "other"))


@pytest.mark.parametrize("loaded", [False, True])
def test_one_site_by_itself_is_identified_as_a_leg(tmp_path, monkeypatch, loaded) -> None:
    """Nothing is solved here: the forward model tells which leg it would solve."""
    from legfem.legs.forward import PlaneStrainForward

    folder, asked = write_sites(tmp_path / "leg"), []

    def of_subject(given, *_):
        asked.append(given.site)
        raise RuntimeError("enough")

    monkeypatch.setattr(PlaneStrainForward, "of_subject", of_subject)
    with pytest.raises(RuntimeError, match="enough"):
        lf.identify(lf.load_sites(folder) if loaded else folder, site="medial")
    assert asked == ["medial"]


@pytest.mark.parametrize(("sites", "model"), [(("along", "across"), None), (("along",), "can't be told")])
def test_fibres_are_identified_in_3d(tmp_path, monkeypatch, sites, model) -> None:
    leg = leg_of(tmp_path, sites)
    monkeypatch.setattr(leg_identification, "leg_models", lambda *_: models_of(leg))
    given = leg if len(sites) > 1 else leg.sites[0]
    found = lf.identify(given, model="3d", identify=RATIO)
    assert isinstance(found, lf.Identification) and len(found.fits) == 1
    for name, truth in zip(RATIO, (TRUE_C10, TRUE_RATIO), strict=True):
        low, high = found["neo-hookean"].estimates[name].ci95
        assert low < truth < high
    assert (found["neo-hookean"].details.spatial.untold != "") == (model is not None)
    assert found.document()["laws"]["neo-hookean"]["model"] == "3d"


def test_what_does_not_lie_along_a_leg_is_identified_in_3d_as_by_the_command(tmp_path, monkeypatch) -> None:
    folder = in_space(write_subject(tmp_path / "leg"))
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text().replace("[indenter]\n", "[indenter]\naxis_deg = 90.0\n"))
    monkeypatch.setattr(leg_identification, "leg_models", models_as_deep_as_asked())
    found = lf.identify(folder, "neo-hookean", model="3d", out=tmp_path / "door")
    assert isinstance(found, lf.Identification)
    report = found.write(tmp_path / "door")
    assert (report.parent / "section.png").exists()
    options = ["--subject-dir", str(folder), "--model", "3d", "--law", "neo-hookean", "--quiet"]
    ran = CliRunner().invoke(identify_app, [*options, "--out", str(tmp_path / "command")])
    assert ran.exit_code == 0, ran.output
    ours, theirs = (json.loads((tmp_path / by / "result.json").read_text()) for by in ("door", "command"))
    assert ours["laws"]["neo-hookean"]["parameters"] == theirs["laws"]["neo-hookean"]["parameters"]
    with pytest.raises(lf.InputError, match=r'lf\.identify\(leg, model="3d"\)'):
        lf.identify(folder)


WRONG = {
    "no such site": ({"site": "front"}, "site: front: is not a site of the leg; give one of back"),
    "no such law": ({"law": "Ogden"}, "law: 'Ogden': unknown law"),
    "no such model": ({"model": "4d"}, "model: '4d': unknown model; give one of 2d, 3d"),
    "no processes": ({"jobs": 0}, "jobs: 0: is not possible here"),
    "a correction in 3D": ({"model": "3d", "correction": "own"}, "correction: own: nothing is left to correct in 3D"),
    "a section's mesh in 3D": ({"model": "3d", "mesh": "coarse"}, "mesh: coarse: is a section's"),
    "a leg's mesh in a plane": ({"mesh": SolidLegSettings()}, "mesh: SolidLegSettings: is no"),
    "no weights": ({"settings": IdentificationSettings(weighting="paper")}, "weighting: 2 sites"),
    "fibres in a plane": ({"identify": RATIO}, 'plane strain; solve the leg in 3D: model="3d"'),
    "no such parameter": ({"identify": ["deep.C11"]}, "identify: deep.C11: is not a parameter"),
    "an instrument's": ({"identify": ["instrument.gain"]}, "identify: instrument.gain"),
    "held of all": ({"fix": {"instrument.zero": 0.1}}, "fix: instrument.zero"),
    "no file": ({"correction": "nowhere.json"}, "nowhere.json"),
    "no depth": ({"depth": -1.0}, "depth"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_cant_be_had_is_one_line_in_a_call_s_words(tmp_path, wrong) -> None:
    options, said = WRONG[wrong]
    folder = in_space(write_sites(tmp_path / "leg"))
    with pytest.raises(lf.InputError) as told:
        lf.identify(folder, **options)
    assert said in str(told.value) and "--" not in str(told.value)


def test_recordings_of_one_site_that_are_not_there_are_told_with_its_name(tmp_path) -> None:
    folder = write_sites(tmp_path / "leg")
    shutil.rmtree(folder / "recordings" / "medial")
    with pytest.raises(lf.InputError, match=r"site medial.*there are no recordings"):
        lf.identify(folder)


def test_an_instrument_that_is_not_stated_is_told_with_its_site(tmp_path) -> None:
    folder = write_sites(tmp_path / "leg")
    toml = folder / "subject.toml"
    text = toml.read_text()
    at = text.index("[instrument]")
    toml.write_text(text[:at] + text[text.index("\n[", at) + 1 :])
    with pytest.raises(lf.InputError, match=r"instrument: missing"):
        lf.identify(folder)


def test_recordings_simulated_in_plane_strain_have_no_ends_in_3d(tmp_path) -> None:
    folder = write_sites(tmp_path / "leg")
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text() + "\n[recordings]\nplane_strain = true\n")
    with pytest.raises(lf.InputError, match=r"^model: 3d: the recordings are simulated"):
        lf.identify(folder, model="3d")


def test_a_diagnosis_takes_one_site(tmp_path) -> None:
    folder = write_sites(tmp_path / "leg")
    for given in (folder, lf.load_sites(folder)):
        with pytest.raises(lf.InputError, match=r'the leg has 2 \(back, medial\).*site="back"'):
            lf.diagnose(given)


@pytest.mark.parametrize("call", [lf.identify, lf.diagnose])
def test_what_is_no_leg_is_told_so(call, scanned) -> None:
    with pytest.raises(lf.InputError, match=r"leg: float: is not a leg that was indented; give an id"):
        call(3.5)
    with pytest.raises(lf.InputError, match=r"leg: StockingLeg: is not a leg that was indented"):
        call(lf.load_leg(scanned))


def test_one_site_is_named_to_a_call_as_to_the_command() -> None:
    for call in (lf.identify, lf.diagnose, lf.load_subject):
        assert inspect.signature(call).parameters["site"].default == ""
