"""The study of public recordings: readers, drops, responses; the data itself where it is there."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from making import SHARED

from legfem.common.errors import InputError
from legfem.data import Instrument, Recording, segment_all
from legfem.inverse.observations import observe
from legfem.mechanisms.time_dependence import TIMES_S, TissueRelaxation, spectrum
from legfem.specimens.folder import load_specimen
from studies.recordings.__main__ import full_name, write_specimen_folders
from studies.recordings.curves import DEEPEST, STIFFENING_SHARES, THICKNESSES, ElasticCurves, LayerCurves, layer_curves
from studies.recordings.data import MeatTest, phantom_kinds, read_meat, read_phantoms
from studies.recordings.indentation import Assumed, air_found, study_indentation, try_indentation, with_air
from studies.recordings.motion import (
    ForceDrop,
    SpecimenResponses,
    find_drops,
    held_depth,
    loaded_and_held,
    motion_of,
    without_end_of_hold,
)

DATA = Path(os.environ.get("LEGFEM_DATA", SHARED / "data"))
needs_data = pytest.mark.skipif(not (DATA / "meat_indentation").is_dir(), reason="needs the recordings: LEGFEM_DATA")


def _pressed(lost: float = 0.0, seed: int = 0) -> Recording:
    """1 mm/s for 5 s at 10 Hz, then a hold of 10 s; ``lost`` newtons go at 3 mm."""
    time = np.arange(0.0, 15.0, 0.1)
    d = np.minimum(time, 5.0)
    force = 0.05 * d**1.5 - lost * (d > 3.0)
    force += np.random.default_rng(seed).normal(0, 5e-4, len(time))
    return Recording(time, d, force, "made")


def test_a_drop_is_found_where_it_is_and_nothing_without_one():
    (drop,) = find_drops(_pressed(lost=0.06))
    assert 2.9 <= drop.start_mm < drop.end_mm <= 3.2
    assert drop.size_N == pytest.approx(0.06, rel=0.3)
    assert all(find_drops(_pressed(seed=seed)) == () for seed in range(20))


def test_a_drop_s_mechanism_takes_the_force_off_from_there_on():
    observed = observe(segment_all([_pressed()], Instrument(1e-3, 0.01), True))
    added = ForceDrop(at_mm=3.0).added_force({"size": 0.06}, observed)
    later = (observed.phase == "hold") | (observed.displacement > 3.0)
    np.testing.assert_array_equal(added, np.where(later, -0.06, 0.0))


def test_return_and_recovery_are_cut_off():
    held = _pressed()
    time = np.concatenate([held.time, 15.0 + np.arange(0, 5, 0.1)])
    d = np.concatenate([held.displacement, np.linspace(5, 0, 50)])
    force = np.concatenate([held.force, np.zeros(50)])
    kept = loaded_and_held(Recording(time, d, force, "returned"))
    assert kept.displacement[-1] > 4.9
    assert 14.0 < kept.time[-1] < 15.5


def test_an_absent_folder_is_one_line(tmp_path):
    for read in (read_meat, phantom_kinds):
        with pytest.raises(InputError, match="studies/recordings"):
            read(tmp_path)


def test_one_sample_that_overshoots_costs_no_hold():
    held = _pressed()
    d = held.displacement.copy()
    d[52] += 0.4
    kept = loaded_and_held(Recording(held.time, d, held.force, "overshot"))
    assert held_depth(kept) == pytest.approx(5.0)
    assert kept.time[-1] == pytest.approx(held.time[-1], abs=0.5)


def test_the_end_of_the_hold_is_taken_off():
    kept = without_end_of_hold(_pressed(), 5.0)
    assert kept.time[-1] == pytest.approx(9.9, abs=0.11)


def test_a_name_may_lack_its_day_where_one_test_has_it():
    names = ["one|A", "one|B", "two|B"]
    assert full_name("A", names) == "one|A"
    assert full_name("two|B", names) == "two|B"
    with pytest.raises(InputError, match="name of 2 tests"):
        full_name("B", names)
    with pytest.raises(InputError, match="no test"):
        full_name("C", names)


def test_relaxation_is_that_of_a_standard_solid_on_a_ramp():
    """A linear spring with one branch in closed form, by the hereditary sum over a recording."""
    recording = _pressed()
    observed = observe(segment_all([recording], Instrument(1e-3, 0.01), True))
    motion = motion_of(recording, observed)
    grid = np.linspace(0.1, 6.0, 60)
    curves = ElasticCurves(grid, np.tile(grid, (len(STIFFENING_SHARES), 1)))
    mechanism = TissueRelaxation()
    values = {"ratio": 0.7, "relaxation_time": 4.0, "spread": 1.0, "slow": 0.0}
    responses = SpecimenResponses(curves, motion)
    change = responses.relative_change(mechanism, values, (3e-3, 0.0), observed)
    t = motion.at_stations(observed)
    ramp = np.minimum(t, 5.0)
    expected = sum(
        0.7 * share * tau * (np.exp(-(t - ramp) / tau) - np.exp(-t / tau)) / ramp
        for share, tau in zip(spectrum(4.0, 1.0), TIMES_S, strict=True)
    )
    late = t > 0.5
    np.testing.assert_allclose(change[late], expected[late], rtol=0.02)


def _hertz(reached: float = DEEPEST) -> LayerCurves:
    """Layers that obey Hertz' law down to a share of their thickness."""
    shares = np.linspace(0.0, DEEPEST, 73)[1:]
    forces = np.ones((len(THICKNESSES), len(STIFFENING_SHARES), len(shares)))
    forces[:, 2:, shares > reached] = np.nan
    return LayerCurves(5.0, shares, forces)


def test_curves_of_a_layer_scale_and_end_where_solutions_did():
    curves = _hertz(0.3).of(15.0, 6.0)
    assert len(curves.forces) == 2
    hertz = 5.0**0.5 * curves.grid**1.5
    np.testing.assert_allclose(curves.at(2.0, 0.0), 2.0 * hertz)
    np.testing.assert_allclose(curves.at(1.0, 0.05), 1.05 * hertz)


def test_a_test_that_can_t_be_solved_costs_itself_only():
    layers = LayerCurves(5.0, np.linspace(0.0, 0.6, 73)[1:], np.full((6, 5, 72), np.nan))
    row = try_indentation(MeatTest(_pressed(), "beef_FF", 15.0), layers)
    assert "no layer" in row.problem


def test_air_that_is_put_in_is_found_in_a_clean_recording():
    test = MeatTest(_pressed(), "beef_FF", 15.0)
    assert with_air(test.recording, 1.5).displacement[-1] == pytest.approx(6.5)
    wrong = air_found(test)
    assert wrong is not None and abs(wrong) < 0.3


@needs_data
def test_the_data_are_read():
    meat = read_meat(DATA)
    assert len(meat) == 98
    assert sum(test.is_beef for test in meat.values()) == 78
    phantom = read_phantoms(DATA, "EF10_75T")[0]
    assert (phantom.radius, phantom.height) == (25.0, 30.0)
    assert phantom.recording.displacement[-1] == pytest.approx(20.0, abs=0.01)


@needs_data
def test_the_drop_is_told_and_no_other_beef_has_one():
    meat = read_meat(DATA)
    with_drop = {
        name: drops
        for name, test in meat.items()
        if test.is_beef and (drops := find_drops(loaded_and_held(test.recording)))
    }
    assert list(with_drop) == ["230331|RDG1 1A"]
    assert 2.4 < with_drop["230331|RDG1 1A"][0].start_mm < 2.8


@needs_data
def test_air_is_found():
    """To be seen in the file: a sample every 0.15 mm, 0.0082 to 0.0110 N in the last 0.8 mm of air, then a rise."""
    recording = loaded_and_held(read_meat(DATA)["230403|230403-FF1A"].recording)
    last_in_air = np.flatnonzero(recording.force < 0.0115)[-1]
    first_touching = recording.displacement[last_in_air + 1]
    assert recording.force[last_in_air + 1] > 0.02
    contact = observe(segment_all([recording], Instrument(2e-3, 0.01))).contacts[0]
    assert recording.displacement[last_in_air] < contact.displacement < first_touching
    assert contact.displacement_error < 0.15


@pytest.mark.slow
@needs_data
def test_relaxation_is_named_first_where_much_is_unknown_beside_it(tmp_path):
    """Beef whose relaxation the spectrum describes in part: strengths are integrated out there."""
    meat, layers = read_meat(DATA), layer_curves(5.0, 40.0, tmp_path, 2, lambda _: None)
    for name in ("230331|RDG1 1A", "230331|RDG1 2C", "230331|RDG2 1F", "230331|RDG2 2F"):
        found = study_indentation(meat[name], layers)
        assert found.best.strength_integrated and found.best.in_part
        assert found.named_first == "viscoelasticity"


@needs_data
@pytest.mark.slow
def test_every_public_recording_stands_in_a_folder_of_specimens(tmp_path):
    folders = [load_specimen(f) for f in write_specimen_folders(DATA, tmp_path, Assumed())]
    assert sum(len(folder.recordings) for folder in folders) == 138
    assert not any(folder.left_out for folder in folders)
    beef = next(folder for folder in folders if folder.id == "beef_RDG")
    assert beef.relaxes and len({one.sizes for one in beef.recordings}) > 30
