"""A law that misses: its stiffness carries what its parts say, and a force that stands at first may be a zero."""

from __future__ import annotations

import numpy as np
import pytest
from making_specimens import BAR, LENGTH, PLANTED, compressed, ramp, record

from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.intervals import NO_DEPARTURE, departure_of
from legfem.specimens.folder import load_specimen
from legfem.specimens.problem import fit_specimens

PARTS = {"the first third of the depth": np.arange(10), "the last third of the depth": np.arange(20, 30)}
FORCE = np.linspace(0.1, 3.0, 30)


def fitted(folder, force, depth=3.0, law="reduced-polynomial"):
    time, d = ramp(depth, 30.0)
    for k, times in enumerate((1.0, 1.02)):
        record(folder, f"bar{k}", time, d, times * force(d))
    (folder / "specimen.toml").write_text(BAR)
    (found,) = fit_specimens(load_specimen(folder), [law])
    return found


def test_a_part_that_asks_for_another_stiffness_departs_by_that_beyond_its_errors():
    measured = np.where(np.arange(30) < 10, 1.5, 1.0) * FORCE
    found = departure_of(PARTS, measured, FORCE, 1e-8 * np.eye(30))
    assert (found.part, found.factor) == ("the first third of the depth", pytest.approx(1.5))
    assert found.by == pytest.approx(np.log(1.5), rel=1e-4)
    assert found.carried(2.0, (1.9, 2.1), (0.1, 10.0)) == pytest.approx((2.0 / 1.5**1.96, 2.0 * 1.5**1.96), rel=1e-3)
    assert found.carried(2.0, (0.5, 5.0), (0.1, 10.0)) == (0.5, 5.0)


def test_what_errors_make_of_a_part_is_no_departure():
    measured = FORCE + np.where(np.arange(30) < 10, 0.05, 0.0)
    assert departure_of(PARTS, measured, FORCE, 1e-2 * np.ones((30, 30))) == NO_DEPARTURE


def test_where_a_part_pulls_no_stiffness_describes_it():
    found = departure_of(PARTS, np.where(np.arange(30) < 10, -1.0, 1.0) * FORCE, FORCE, 1e-8 * np.eye(30))
    assert found.carried(2.0, (1.9, 2.1), (0.1, 10.0)) == (0.1, 10.0)


def test_a_force_that_stands_at_first_doesnt_become_stiffness(tmp_path):
    """A zero that wasn't taken: the bar is the planted one, but it may have been pressed before."""
    peak = compressed(PLANTED, np.array([3.0]))[0]
    found = fitted(tmp_path, lambda d: compressed(PLANTED, d) + 0.07 * peak)
    one = found.estimates[DEEP_C10]
    assert one.ci95[0] < PLANTED.C10 < one.ci95[1]
    assert one.value == pytest.approx(PLANTED.C10, rel=0.05)
    assert one.identifiability == "weakly identifiable"


def test_beside_a_law_that_misses_by_far_a_stiffness_is_as_open_as_its_parts_leave_it(tmp_path):
    """A foam: it yields, then is squeezed solid. At first it is 15 times as stiff as the neo-Hookean fit says."""

    def foam(d):
        return 3.0 * np.tanh(20 * d / LENGTH) + 4.0 * (d / 6.0) ** 8

    one = fitted(tmp_path, foam, 6.0, "neo-hookean").estimates[DEEP_C10]
    assert one.identifiability == "not identifiable"
    assert one.ci95[1] > 4 * one.value
    assert "the first third of the depth by itself gives" in one.departure.text
