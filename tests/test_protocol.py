"""Protocols of the indenter, and the path that a test takes along one."""

from __future__ import annotations

import numpy as np
import pytest

from legfem.common.errors import InputError
from legfem.solve.path import Path
from legfem.solve.protocol import Protocol


def test_a_cycle_loads_holds_and_unloads():
    protocol = Protocol.cycle(10.0, rate=2.0, hold=60.0, unloading_rate=5.0)
    assert protocol.time == (0.0, 5.0, 65.0, 67.0)
    assert protocol.displacement == (0.0, 10.0, 10.0, 0.0)
    phases = [(one.phase, one.start, one.end) for one in protocol.segments]
    assert phases == [("loading", 0.0, 5.0), ("hold", 5.0, 65.0), ("unloading", 65.0, 67.0)]
    np.testing.assert_allclose(protocol.displacement_at([2.5, 30.0, 66.0, 99.0]), [5, 10, 5, 0])
    assert (protocol.depth, protocol.duration) == (10.0, 67.0)
    assert Protocol.cycle(10.0, rate=2.0).time == (0.0, 5.0, 10.0)


def test_segments_have_a_phase_and_a_rate():
    protocol = Protocol((0, 1, 3, 4), (-1, 0, 4, 2))
    assert [segment.phase for segment in protocol.segments] == ["loading", "loading", "unloading"]
    assert [segment.rate for segment in protocol.segments] == [1.0, 2.0, -2.0]


def test_a_path_through_displacements_has_one_speed():
    protocol = Protocol.through([3.0, 3.0, 1.0], rate=0.5)
    assert protocol == Protocol((0.0, 6.0, 10.0), (0.0, 3.0, 1.0))


@pytest.mark.parametrize(
    ("time", "displacement", "told"),
    [
        ((0.0,), (0.0,), "two or more"),
        ((0.0, 1.0), (0.0, 1.0, 2.0), "as many"),
        ((0.0, 1.0, 1.0), (0.0, 1.0, 2.0), "waypoint 3"),
        ((0.0, np.nan), (0.0, 1.0), "finite"),
        ((0.0, 1.0), (0.5, 1.0), "first touch"),
    ],
)
def test_impossible_waypoints_are_refused(time, displacement, told):
    with pytest.raises(InputError, match=told):
        Protocol(time, displacement)


@pytest.mark.parametrize("wrong", [{"depth": -1.0}, {"rate": 0.0}, {"hold": -2.0}])
def test_impossible_numbers_are_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        Protocol.cycle(**{"depth": 10.0, "rate": 1.0, "hold": 5.0, **wrong})


def test_a_path_is_read_at_any_time_without_swings_at_its_corners():
    """Each part is interpolated apart: a corner in the force doesn't spread."""
    protocol = Protocol.cycle(8.0, rate=1.0, hold=20.0)
    hold = 8.0 + 20 * np.geomspace(0.01, 1, 13)
    time = np.concatenate([np.linspace(0, 8, 9), hold, np.linspace(28, 36, 9)[1:]])
    at = protocol.displacement_at(time)

    def force(t):
        relaxed = 1 + np.exp(-np.clip(t - 8, 0, 20) / 6)
        return protocol.displacement_at(t) ** 2 * relaxed

    path = Path(time, at, force(time), {"deep.C10": 2 * force(time)})
    fine = np.linspace(0, 36, 300)
    np.testing.assert_allclose(path.force_at(fine), force(fine), atol=0.3)
    moving = fine[(fine < 8) | (fine > 28)]
    np.testing.assert_allclose(path.force_at(moving), force(moving), atol=1e-9)
    np.testing.assert_allclose(path.sensitivity_at("deep.C10", fine), 2 * path.force_at(fine), rtol=1e-12, atol=1e-12)
    assert path.loading.depth == 8.0 and len(path.loading.displacement) == 9
