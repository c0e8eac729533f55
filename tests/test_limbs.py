"""Sections of other limbs than the calf: any number of bones by any names, from outlines to a verdict."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from making import circle, leg, write_contours
from making_limbs import forearm, pressed, thigh, write_limb

import legfem as lf
from legfem.common.errors import InputError
from legfem.geometry.contours import read_contours
from legfem.geometry.section import LegSection
from legfem.legs.correction_of_leg import correction_of
from legfem.legs.details import AppliedCorrection
from legfem.legs.loading import load_subject
from legfem.legs.notices import LegNotice, of_ends
from legfem.legs.plausibility import doubts_about
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject
from legfem.mechanisms.rig import SupportCompliance
from legfem.meshing.section import MeshMotion
from legfem.report.preview import preview_of
from studies.making.plane_leg import OtherCase

C10_KPA = 1.5
OF_A_CALF = re.compile(r"\b(calf|calves|tibia|fibula|shin)\b", re.IGNORECASE)
REGION = '\n[regions.{}]\nkind = "{}"\n'


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    """A forearm with two recordings by another code, on its own mesh and without pressures."""
    folder = write_limb(tmp_path_factory.mktemp("arm") / "forearm", forearm())
    return pressed(folder, OtherCase(C10_KPA), 5.0, finer=0.6)


def refusal(folder: Path) -> InputError:
    with pytest.raises(InputError) as caught:
        load_subject(folder, need_recordings=False)
    assert "\n" not in str(caught.value) and caught.value.remedy
    return caught.value


def test_bones_stand_in_the_order_of_the_limb_whatever_that_of_the_file(tmp_path: Path):
    parts = leg()
    mixed = {name: parts[name] for name in ("fibula", "fascia", "tibia", "skin")}
    section = read_contours(write_contours(tmp_path / "c.csv", mixed), 0.6)
    assert (*section.bones,) == ("tibia", "fibula")
    assert section.limb == "calf"
    assert LegSection.of_parts({**parts, "implant": circle(0, 0, 5)}, 0.6).limb == ""


def test_an_outline_of_any_name_is_a_bone_where_the_folder_says_so(tmp_path: Path):
    parts = {**thigh(), "Nail": circle(-20, 0, 6)}
    assert "[regions.nail]" in refusal(write_limb(tmp_path / "unsaid", parts)).remedy
    section = load_subject(write_limb(tmp_path / "said", parts, REGION.format("Nail", "bone")), False).section
    assert (*section.bones,) == ("femur", "nail")


@pytest.mark.parametrize(
    ("change", "more", "field", "words"),
    [
        ({"femur": circle(6, 70, 14)}, "", "femur", "crosses or touches the fascia"),
        ({"femur": circle(6, 200, 14)}, "", "femur", "lies outside the skin"),
        ({"humerus": circle(25, 12, 10)}, "", "humerus", "touches or crosses the femur: 49 mm² lie in both"),
        ({"femurr": circle(40, 12, 10)}, "", "part, line 490", "did you mean 'femur'?"),
        ({}, REGION.format("nail", "bone"), "nail", "the part is missing"),
        ({"nail": circle(40, 12, 10)}, REGION.format("nail", "stone"), "regions.nail.kind", "'bone'"),
        ({}, '\n[regions.nail]\nknd = "bone"\n', "regions.nail.knd", "did you mean 'kind'?"),
    ],
    ids=["outside the fascia", "outside the skin", "two overlap", "misspelt", "not drawn", "no kind", "misspelt key"],
)
def test_a_wrong_region_gets_one_line(tmp_path: Path, change, more: str, field: str, words: str):
    error = refusal(write_limb(tmp_path / "leg", {**thigh(), **change}, more))
    assert error.field == field
    assert words in str(error)


def test_a_section_without_a_bone_is_refused_since_nothing_holds_it(tmp_path: Path):
    parts = thigh()
    del parts["femur"]
    assert "nothing says what else holds the limb" in str(refusal(write_limb(tmp_path / "leg", parts)))


def test_a_bone_that_another_runs_beside_is_missed(tmp_path: Path):
    parts = leg()
    del parts["fibula"]
    (doubt,) = doubts_about(load_subject(write_limb(tmp_path / "leg", parts), need_recordings=False))
    assert "there is no fibula, which a calf has" in str(doubt)


def test_each_limb_is_compared_with_people_at_its_own_kind_of_place(tmp_path: Path):
    people = {
        name: load_subject(write_limb(tmp_path / name, parts), need_recordings=False).people
        for name, parts in (("calf", leg()), ("thigh", thigh()))
    }
    assert people == {"calf": "LL_P", "thigh": "all sites"}


def test_a_lone_bone_moves_in_the_mesh_and_what_surrounds_it_stays():
    section = LegSection.of_parts(thigh(), 0.6)
    points = np.vstack([section.bones["femur"], section.fascia, section.skin])
    moved = MeshMotion("femur", size=0.8).displacement(points, section, np.array([0.0, -102.5]), np.array([0.0, 1.0]))
    np.testing.assert_allclose(moved[:48], [[0.0, 0.8]] * 48, atol=1e-9)
    np.testing.assert_allclose(moved[48:], 0.0, atol=1e-9)


def test_a_limbs_bones_are_on_springs_that_yield_together_as_much():
    springs = SupportCompliance(("femur",)).solution({"compliance": 0.2, "at_bones": 1.0}).parameters
    assert springs == {"femur.springs.x": 5.0, "femur.springs.y": 5.0}
    both = SupportCompliance(("radius", "ulna")).solution({"compliance": 0.2, "at_bones": 1.0}).parameters
    assert set(both.values()) == {2.5} and len(both) == 4


def test_a_correction_beyond_its_table_is_said_to_be(tmp_path: Path):
    leg_of = load_subject(write_limb(tmp_path / "thigh", thigh(), origin="measured"), need_recordings=False)
    correction = correction_of(leg_of)
    assert correction.beyond["girth"] == pytest.approx(550, abs=1)
    applied = AppliedCorrection(correction.name, np.zeros(1), np.zeros(1), beyond=correction.beyond)
    assert LegNotice.CORRECTION_BEYOND in {notice.code for notice in of_ends(leg_of, applied)}
    assert not correction_of(load_subject(SUBJECTS.find("3"), need_recordings=False)).beyond


@pytest.fixture(scope="module")
def found(arm: Subject) -> lf.Identification:
    return lf.identify(arm.directory, law="neo-hookean", progress=False)


def test_another_codes_forearm_is_found_as_stiff_as_it_is(found: lf.Identification):
    fit = found["neo-hookean"]
    one = fit.estimates["deep.C10"]
    assert one.value == pytest.approx(C10_KPA * 1e-3, rel=0.03)
    low, high = one.ci95
    assert low < C10_KPA * 1e-3 < high
    assert fit.goodness.fits


def test_what_is_shown_of_a_forearm_speaks_of_no_calf(arm: Subject, found: lf.Identification, tmp_path: Path):
    report = found.write(tmp_path / "identified").read_text("utf-8")
    page = (tmp_path / "identified" / "report.txt").read_text("utf-8")
    seen = repr(preview_of(arm.directory, tmp_path))
    assert "THE MODEL FITS" in page
    assert (tmp_path / "section.png").is_file()
    assert not [text for text in (report, page, seen) if OF_A_CALF.search(text)]


@pytest.mark.slow
def test_a_thigh_comes_to_a_verdict(tmp_path: Path):
    leg_of = pressed(write_limb(tmp_path / "thigh", thigh()), OtherCase(C10_KPA), 12.0, finer=0.6)
    found = lf.diagnose(leg_of.directory, progress=False)
    low, high = found.diagnosis.intervals["deep.C10"]
    assert low < C10_KPA * 1e-3 < high
    assert found.diagnosis.verdict in ("consistent", "ambiguous")
