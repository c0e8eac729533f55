"""What is wrong with a call of the front door is one line that names the argument."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from making import write_subject

import legfem as lf
from legfem.inverse.settings import IdentificationSettings

LEG = {
    "a word for a depth": ({"depth": "deep"}, "depth: 'deep': is not a depth; give a number of mm"),
    "an endless depth": ({"depth": math.inf}, "depth: inf: is not a depth"),
    "a word for jobs": ({"jobs": "2"}, "jobs: '2': is of another kind; give a whole number from 1"),
    "half a process": ({"jobs": 1.5}, "jobs: 1.5: is of another kind"),
    "a name for names": ({"identify": "deep.C10"}, "identify: 'deep.C10': is of another kind"),
    "no names": ({"identify": []}, "nothing is left to identify; name a parameter"),
    "a number for a name": ({"identify": [3]}, "identify: [3]: is of another kind; give a list"),
    "twice": ({"identify": ["deep.C10", "deep.C10"]}, "identify: deep.C10: is there twice"),
    "free and held": (
        {"identify": ["deep.C10"], "fix": {"deep.C10": 1e-3}},
        "fix: deep.C10: is to be identified as well; leave one of them out",
    ),
    "a unit in a value": ({"fix": {"deep.D1": "28 1/MPa"}}, "fix: {'deep.D1': '28 1/MPa'}: is of another kind"),
    "no number": ({"fix": {"deep.D1": math.nan}}, "fix: deep.D1: nan is not a value"),
    "endless": ({"fix": {"deep.D1": math.inf}}, "fix: deep.D1: inf is not a value"),
    "negative": ({"fix": {"deep.D1": -28}}, "fix: deep.D1=-28: is negative or nothing"),
    "names for values": ({"fix": ["deep.D1"]}, "fix: deep.D1: can't be read; write 'deep.D1=28 1/MPa'"),
    "a number for values": ({"fix": 28.0}, "fix: 28.0: is of another kind; give values by full name"),
    "a prior without its unit": ({"prior": ["deep.C10=1±1"]}, "prior: deep.C10: has no unit"),
    "a text for priors": ({"prior": "deep.C10=1±1 kPa"}, "prior: 'deep.C10=1±1 kPa': is of another kind"),
    "bounds the wrong way round": ({"c10_bounds": (3.0, 1.0)}, "c10_bounds: 3 1: is not a range of stiffnesses"),
    "no correction": ({"correction": None}, "correction: None: is not a correction; give own, none"),
    "a dictionary of settings": ({"settings": {"seed": 1}}, "settings: {'seed': 1}: is of another"),
    "no such weights": (
        {"settings": IdentificationSettings(weighting="x")},
        "weighting: 'x': unknown weighting; give one of paper, covariance",
    ),
    "a negative seed": ({"settings": IdentificationSettings(seed=-1)}, "seed: -1"),
    "a seed that no generator takes": (
        {"settings": IdentificationSettings(seed=2**32)},
        "seed: 4294967296: is not possible here; give a whole number from 0 to 4294967295",
    ),
    "a number for a law": ({"law": 3}, "law: 3: unknown law; give neo-hookean"),
    "texts for bounds": ({"c10_bounds": ("1", "3")}, "c10_bounds: ('1', '3'): is of another kind; give two numbers"),
    "a number for a correction": ({"correction": 0.2}, "correction: 0.2: is not a correction; give own, none"),
    "no folder": ({"out": 3}, "out: 3: is of another kind; give a folder's path"),
    "no such mesh": ({"mesh": "fine"}, "mesh: 'fine': unknown mesh; give coarse"),
    "a site of a leg without": ({"site": "back"}, "is not a site of the leg; leave it out"),
    "a number for a site": ({"site": 3}, "site: 3: is of another kind; give a text"),
    "a specimen's": ({"leave_out": ["trial1"]}, "leave_out: given: has no effect for a leg"),
}
SPECIMENS = {
    "a depth": ({"depth": 3.0}, "depth: given: has no effect for specimens; leave it out"),
    "a model": ({"model": "3d"}, "model: given: has no effect for specimens"),
    "a correction": ({"correction": "none"}, "correction: given: has no effect for specimens"),
    "a name for names": ({"leave_out": "fast"}, "leave_out: 'fast': is of another kind"),
    "no such parameter": ({"identify": ["deep.C11"]}, "identify: deep.C11: is not a parameter"),
    "held and negative": ({"fix": {"deep.D1": -1.0}}, "fix: deep.D1=-1: is negative"),
    "no processes": ({"jobs": 0}, "jobs: 0: is not possible here"),
}


@pytest.fixture(scope="module")
def leg(tmp_path_factory):
    return lf.load_subject(write_subject(tmp_path_factory.mktemp("made") / "leg"))


def line_of(call, *given, **options) -> str:
    with pytest.raises(lf.InputError) as told:
        call(*given, **options)
    line = str(told.value)
    assert "\n" not in line and "--" not in line
    return line


@pytest.mark.parametrize("wrong", LEG)
def test_what_is_wrong_with_an_identification_of_a_leg_is_told(leg, wrong) -> None:
    options, said = LEG[wrong]
    assert said in line_of(lf.identify, leg, **options)


@pytest.mark.parametrize("wrong", SPECIMENS)
def test_what_is_wrong_with_an_identification_of_specimens_is_told(bars, wrong) -> None:
    options, said = SPECIMENS[wrong]
    assert said in line_of(lf.identify, lf.load_specimen(bars), "neo-hookean", **options)


def test_a_file_in_the_way_of_results_is_told(leg, tmp_path) -> None:
    (tmp_path / "file").touch()
    for call, name in ((lf.identify, "out"), (lf.diagnose, "library")):
        line = line_of(call, leg, **{name: tmp_path / "file"})
        assert line.startswith(f"{name}: ") and line.endswith("is a file; give a folder")


def test_none_is_as_good_as_no_list(leg) -> None:
    assert line_of(lf.identify, leg, prior=None, leave_out=None, jobs=0).startswith("jobs: 0")
    assert line_of(lf.diagnose, leg, prior=None, specimens=None, jobs=0).startswith("jobs: 0")


def test_what_is_wrong_with_a_diagnosis_is_told(leg, bars) -> None:
    assert line_of(lf.diagnose, leg, seed=-1).startswith("seed: -1: is not possible here")
    assert line_of(lf.diagnose, leg, jobs=0).startswith("jobs: 0: is not possible here")
    assert line_of(lf.diagnose, leg, specimens=["a"]).startswith("specimens: given: has no effect")
    specimens = lf.load_specimen(bars)
    assert line_of(lf.diagnose, specimens, site="back").startswith("site: given: has no effect")
    assert "is not a specimen of the folder" in line_of(lf.diagnose, specimens, specimens=["a"])


@pytest.mark.parametrize(
    ("asked", "line"),
    [
        ({"c10": 0.0}, "c10: 0.0: is not possible here; give 0.05 to 50 kPa"),
        ({"c20": -1.0}, "c20: -1.0: is not possible here; give 0 to 50 kPa"),
        ({"depth": -3.0}, "depth: -3.0: is not possible here; give 5 to 200 mm"),
        ({"depth": np.float64(300.0)}, "depth: np.float64(300.0): is not possible here; give 5 to 200 mm"),
        ({"rate": None}, "rate: None: is of another kind; give 0.01 to 50 mm/s"),
    ],
)
def test_what_is_wrong_with_a_planned_test_is_told(leg, asked, line) -> None:
    assert line_of(lf.plan, leg, **asked) == line


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc")
def test_a_folder_that_only_seems_to_take_results_is_told_at_once(leg) -> None:
    assert line_of(lf.identify, leg, out="/proc/results").endswith(
        "/proc can't be written to; give a folder of your own"
    )


def test_a_folder_of_another_kind_is_told_with_what_loads_it(leg, bars) -> None:
    assert line_of(lf.diagnose, bars).endswith("load the folder with lf.load_specimen")
    assert line_of(lf.load_specimen, leg.directory).endswith("load the folder with lf.load_subject")
    assert line_of(lf.stocking, leg.directory).endswith("load the folder with lf.load_subject")
    for load in (lf.load_subject, lf.load_sites, lf.load_leg, lf.load_specimen):
        assert line_of(load, None).startswith("folder: NoneType: is not a path")


def test_what_a_plan_and_a_cohort_cannot_be_without_is_told(leg, tmp_path) -> None:
    with pytest.raises(lf.InputError, match="c20: None: is of another kind; give 0 to 50 kPa"):
        lf.plan(leg, c20=None)
    with pytest.raises(lf.InputError, match=r"folder: 1\.5: is of another kind; give a folder's path"):
        lf.cohort(1.5, out=tmp_path / "out")
    with pytest.raises(lf.InputError, match="folder: members: missing; give the path of the folder that holds"):
        lf.cohort(out=tmp_path / "out")


def test_a_pressed_leg_is_none_in_a_stocking(leg, scanned) -> None:
    assert line_of(lf.stocking, leg).startswith("leg: Subject: is not a leg that was scanned")
    assert line_of(lf.stocking, scanned, cells=-5).startswith("cells: -5: is not possible here")


def test_a_law_that_was_not_identified_is_told(bars) -> None:
    found = lf.identify(bars, "neo-hookean")
    assert found.fits[0].kind == "specimens", "a folder says by itself what it is"
    with pytest.raises(KeyError, match="'yeoh' was not identified: there is neo-hookean"):
        found["yeoh"]
