"""The study of public recordings: readers, drops, responses; the data itself where it is there."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from making import SHARED

from legfem.diagnose.observations import observe
from legfem.errors import InputError
from legfem.recording import Instrument, Recording
from legfem.study.recordings.data import phantom_kinds, read_meat, read_phantoms
from legfem.study.recordings.drop import ForceDrop, find_drops
from legfem.study.recordings.indentation import (
    Assumed,
    loaded_and_held,
    predict_next,
    study_indentation,
)
from legfem.study.recordings.responses import Relaxation, TwoRelaxations, ball_responses

DATA = Path(os.environ.get("LEGFEM_DATA", SHARED / "data"))
needs_data = pytest.mark.skipif(
    not (DATA / "meat_indentation").is_dir(), reason="needs the recordings: LEGFEM_DATA"
)


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
    observed = observe([_pressed()], Instrument(1e-3, 0.01), starts_at_contact=True)
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
        with pytest.raises(InputError, match="studies/recordings/README"):
            read(tmp_path)


def test_the_force_scales_with_c10_and_branches_add_up():
    responses = ball_responses(12.0, 3.0, ball_radius=5.0, layer_radius=20.0)
    soft, stiff = responses.curve(2.0, 0.0), responses.curve(6.0, 0.0)
    np.testing.assert_allclose(stiff, 3 * soft, rtol=1e-12)
    # The spline through the first steps, of up to 0.1 mm, can't tell a strain's stiffening.
    beyond = responses.grid > 0.5
    assert (responses.curve(2.0, 0.5) > soft)[beyond].all()
    observed = observe([_pressed()], Instrument(1e-3, 0.01), starts_at_contact=True)
    one = {"ratio": 0.5, "relaxation_time": 2.0}
    none = {"ratio_2": 0.0, "relaxation_time_2": 5.0}
    single = responses.relative_change(Relaxation(), one, 5.0, 0.0, observed)
    double = responses.relative_change(TwoRelaxations(), {**one, **none}, 5.0, 0.0, observed)
    np.testing.assert_allclose(double, single)
    held = observed.phase == "hold"
    assert (np.diff(single[held]) < 0).all() and (single > 0).all()


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
    assert list(with_drop) == ["RDG1 1A"]
    assert 2.4 < with_drop["RDG1 1A"][0].start_mm < 2.8


@needs_data
def test_air_is_found():
    meat = read_meat(DATA)
    found = study_indentation(meat["230403-FF1A"], Assumed())
    assert found.air == pytest.approx(3.7, abs=0.15)
    assert "viscoelasticity" in found.repair.names


@needs_data
def test_beef_relaxes_much_and_silicone_little():
    meat = read_meat(DATA)
    beef = study_indentation(meat["RDG1 1A"], Assumed())
    assert beef.repair.gains[0][0].startswith("viscoelasticity")
    assert "force-drop" in beef.repair.names
    assert beef.held_out_rmse[2] < 0.5 * min(beef.held_out_rmse[:2])
    first = study_indentation(meat["230515-P002-9"], Assumed())
    second = study_indentation(meat["230515-P002-10"], Assumed())
    assert beef.relaxed < 0.5 < 0.8 < first.relaxed
    elastic, repaired = predict_next(first, second)
    assert repaired < 0.5 * elastic
