"""However a trial is driven, its phases and what is simulated of it are those of the drive."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from making import tissue_force
from scipy.signal import lfilter

from legfem.common.errors import InputError
from legfem.data import Instrument, Recording, check_trial, segment, segment_all
from legfem.data.phases import AIR, HOLD, LOADING, UNLOADING
from legfem.inverse.observations import observe

INSTRUMENT = Instrument(force_sd=0.02, displacement_sd=0.02)


def driven(waypoints, rate=100.0, air=0.0, ratio=0.5, tau=2.0, name="trial1") -> Recording:
    """Return a recording with noise of a tissue that relaxes, through (s, mm) from 0."""
    generator = np.random.default_rng(1)
    times, depths = np.array([(0.0, 0.0), *waypoints]).T
    times = np.cumsum(times)
    time = np.arange(0.0, times[-1] + 1e-9, 1 / rate)
    at = np.interp(time, times, depths)
    elastic = tissue_force(at - air)
    decay = np.exp(-1 / rate / tau)
    forgotten = lfilter([0.5 * (1 + decay)], [1.0, -decay], np.diff(elastic, prepend=elastic[0]))
    force = np.maximum((1 - ratio) * elastic + ratio * forgotten, 0.0)
    noise = 0.02 * generator.standard_normal((2, len(time)))
    return Recording(time, at + noise[0], force + noise[1], name)


def phases(recording: Recording) -> list[tuple[str, float]]:
    """Return the phases in order and how long they last, s."""
    labels = segment(recording).labels
    edges = [0, *(np.flatnonzero(labels[1:] != labels[:-1]) + 1), len(labels)]
    step = recording.time[1]
    return [(str(labels[a]), (b - a) * step) for a, b in pairwise(edges)]


def simulated(recording: Recording, starts_at_contact: bool = False) -> list[tuple[float, float]]:
    """Return the waypoints (s since the one before, mm) of what is simulated."""
    check_trial(segment(recording))
    protocol = observe(segment_all([recording], INSTRUMENT, starts_at_contact)).protocols[0].protocol
    spans = np.diff(protocol.time)
    return list(zip(spans.tolist(), protocol.displacement[1:], strict=True))


def assert_driven(found, given, time=0.15, depth=0.15) -> None:
    np.testing.assert_allclose([d for _, d in found], [d for _, d in given], atol=depth)
    np.testing.assert_allclose([t for t, _ in found], [t for t, _ in given], rtol=0.03, atol=time)


@pytest.mark.parametrize("rate", [10.0, 100.0])
@pytest.mark.parametrize("hold", [30.0, 300.0])
def test_a_short_ramp_before_a_long_hold_is_one_phase_and_the_hold_another(rate, hold):
    made = driven([(6.0, 20.0), (hold, 20.0)], rate)
    assert phases(made) == [(LOADING, pytest.approx(6.0, abs=0.15)), (HOLD, pytest.approx(hold, 0.01))]
    assert_driven(simulated(made), [(6.0, 20.0), (hold, 20.0)])


@pytest.mark.parametrize("air", [0.0, 3.0])
@pytest.mark.parametrize("rest", [20.0, 300.0])
def test_a_rest_before_loading_is_none_of_it(air, rest):
    made = driven([(rest, 0.0), (20.0, 20.0), (30.0, 20.0)], 20.0, air)
    moving = [(name, span) for name, span in phases(made) if name == LOADING]
    assert moving == [(LOADING, pytest.approx(20.0 - air, abs=0.5))]
    assert_driven(simulated(made), [(20.0 - air, 20.0 - air), (30.0, 20.0 - air)], 0.5, 0.3)


@pytest.mark.parametrize("rate", [10.0, 100.0])
@pytest.mark.parametrize("air", [0.0, 2.0])
def test_four_cycles_are_simulated_one_after_the_other(rate, air):
    made = driven([(4.0, 20.0), (4.0, 0.0)] * 4, rate, air)
    names = [name for name, _ in phases(made)]
    assert names.count(LOADING) == names.count(UNLOADING) == 4
    found = simulated(made)
    peaks = [d for _, d in found if d > 1.0]
    np.testing.assert_allclose(peaks, 20.0 - air, atol=0.9 if rate == 10.0 else 0.3)
    assert len(found) == 4 * 3 - 1, "loading, unloading, and the time in air between"
    # From peak to peak it takes what it took.
    ends = np.cumsum([t for t, _ in found])[[d > 1.0 for _, d in found]]
    np.testing.assert_allclose(np.diff(ends), 8.0, rtol=0.03)


def test_rests_between_cycles_last_as_long_as_they_did():
    cycle = [(4.0, 20.0), (10.0, 20.0), (4.0, 0.0), (12.0, 0.0)]
    assert_driven(simulated(driven(cycle * 3)), (cycle * 3)[:-1], 0.2)


@pytest.mark.parametrize("ratio", [0.0, 0.5])
@pytest.mark.parametrize("level", [1.8, 7.3])
def test_a_partial_return_is_simulated_as_far_as_it_went(level, ratio):
    """Whether the skin follows all the way (an elastic one does) or is left before."""
    there = [(20.0, 20.0), (30.0, 20.0), (10.0, level)]
    assert_driven(simulated(driven(there, 20.0, ratio=ratio)), there)
    again = [*there, (20.0, level), (10.0, 20.0)]
    assert_driven(simulated(driven(again, 20.0, ratio=ratio)), again, 0.4)


def test_steps_of_loading_keep_their_depths():
    steps = [(8.0, 8.0), (30.0, 8.0), (7.0, 15.0), (10.0, 15.0), (8.0, 7.0), (20.0, 7.0), (13.0, 20)]
    assert_driven(simulated(driven(steps, 20.0)), steps)


def test_a_slow_loading_beside_a_fast_one_is_no_hold():
    fast_first = [(3.33, 10.0), (30.0, 10.0), (100.0, 20.0)]
    assert_driven(simulated(driven(fast_first, 20.0)), fast_first)


def test_returns_to_other_levels_are_other_programmes():
    given = [
        driven([(20.0, 20.0), (20.0, 20.0), (10.0, level), (10.0, level)], 20.0, ratio=0.0) for level in (2.0, 2.0, 8.0)
    ]
    assert observe(segment_all(given, INSTRUMENT, True)).protocol_of == (0, 0, 1)


def test_one_reading_far_off_changes_no_phase():
    made = driven([(20.0, 20.0), (30.0, 20.0)], 20.0)
    displacement = made.displacement.copy()
    displacement[150] += 6.0
    spoilt = Recording(made.time, displacement, made.force, "spoilt")
    assert phases(spoilt) == [(n, pytest.approx(s, abs=0.11)) for n, s in phases(made)]


def test_a_first_loading_of_a_few_samples_is_refused_with_the_cause():
    made = driven([(0.5 if k % 2 else 30.0, 10.0 * ((k + 1) // 2)) for k in range(1, 5)], 10.0)
    with pytest.raises(InputError, match="samples of the first loading are too few"):
        observe(segment_all([made], INSTRUMENT, True))


def test_air_has_no_stations():
    found = observe(segment_all([driven([(4.0, 20.0), (4.0, 0.0)] * 2, air=2.0)], INSTRUMENT))
    stations = found.protocols[0]
    in_air = [k for k, s in enumerate(stations.protocol.segments) if s.first == s.last == 0.0]
    assert in_air and not set(in_air) & set(stations.segment)
    assert AIR not in stations.phase
