"""What recordings are seen as: protocols, rates, and remarks on what can't be told from them."""

from __future__ import annotations

import numpy as np
import pytest
from making_diagnosis import INSTRUMENT, pressed

from legfem.data import Recording, segment_all
from legfem.inverse.correction import read_correction
from legfem.inverse.observations import Observations, observe
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.diagnosis import with_correction
from legfem.mechanisms import mechanisms
from legfem.report.answers import sentence_of
from legfem.solve.protocol import Protocol


def observed(*protocols: Protocol, air: float = -1.0) -> Observations:
    """Return observations of a force of 0.05 d^2 (N), some mm of air before it."""
    recordings = []
    for k, protocol in enumerate(protocols):
        time = np.arange(0.0, protocol.duration + 1e-9, 0.05)
        at = protocol.displacement_at(time)
        force = 0.05 * np.maximum(at - air, 0.0) ** 2 + 0.2 * (at > air)
        recordings.append(Recording(time, at, force, f"trial{k + 1}"))
    return observe(segment_all(recordings, INSTRUMENT, True))


def untestable(found: Observations) -> dict[str, str]:
    """Return the mechanisms that can't be shown, and why."""
    reasons = {m.name: m.untestable(found) for m in with_correction(mechanisms(), read_correction(REFERENCE))}
    return {name: why for name, why in reasons.items() if why is not None}


def joined(*protocols: Protocol) -> Protocol:
    """Return protocols in one file, one after the other."""
    time, displacement = list(protocols[0].time), list(protocols[0].displacement)
    for protocol in protocols[1:]:
        time += [t + time[-1] for t in protocol.time[1:]]
        displacement += list(protocol.displacement[1:])
    return Protocol(tuple(time), tuple(displacement))


def test_one_loading_tells_nothing_of_rate_or_of_repeats():
    found = observed(Protocol.ramp(15.0, 0.5))
    why = untestable(found)
    assert {"viscoelasticity", "poroelastic-drainage", "preconditioning"} <= set(why)
    assert "one loading ramp" in why["viscoelasticity"]
    assert "repeats" in why["preconditioning"]


def test_two_rates_in_one_file_are_both_seen_and_remarked_on():
    times, depths = (0.0, 30.0, 50.0, 76.0, 82.5, 102.5), (0.0, 15.0, 15.0, 2.0, 15.0, 15.0)
    found = observed(Protocol(times, depths))
    np.testing.assert_allclose(found.rates, [0.5, 2.0], rtol=0.02)
    label = found.protocols[0].label
    assert label.startswith("0.5 mm/s to 15 mm, hold, unloading, 2 mm/s to 15 mm, hold")
    assert any("2 loadings in one file" in remark for remark in map(sentence_of, found.notices))
    assert "preconditioning" in untestable(found)


def test_a_loading_whose_speed_changes_is_remarked_on():
    found = observed(Protocol((0.0, 16.0, 19.5), (0.0, 8.0, 15.0)))
    assert any("more than one speed" in remark for remark in map(sentence_of, found.notices))
    assert "viscoelasticity" in untestable(found)


def test_a_file_a_trial_is_not_remarked_on():
    found = observed(*[Protocol.cycle(15.0, rate, 20.0) for rate in (0.5, 0.5, 2.0, 2.0)])
    assert found.notices == ()
    assert [p.label for p in found.protocols] == [
        "0.5 mm/s to 15 mm, hold, unloading",
        "2 mm/s to 15 mm, hold, unloading",
    ]
    assert untestable(found) == {}


def test_a_loading_after_air_is_left_out_and_that_is_said():
    both = joined(Protocol.cycle(15.0, 0.5, 20.0), Protocol.cycle(15.0, 2.0, 20.0))
    found = observed(both, air=3.0)
    assert len(found.rates) == 1
    assert any("pressed in again; that part is left out" in remark for remark in map(sentence_of, found.notices))


@pytest.mark.parametrize("airs", [(0.0, 0.6, 1.3), (3.0, 0.2, 1.5)])
@pytest.mark.parametrize("to_one_depth", [True, False])
def test_trials_with_different_air_are_repeats_of_one_programme(airs, to_one_depth):
    """Driven to one depth of the tissue, or over one travel with more or less air in it."""
    recordings = pressed(airs)
    if not to_one_depth:
        shortest = min(recording.displacement.max() for recording in recordings)
        recordings = [
            Recording(
                *(
                    column[: np.argmax(r.displacement > shortest - 0.05)]
                    for column in (r.time, r.displacement, r.force)
                ),
                r.trial,
            )
            for r in recordings
        ]
    found = observe(segment_all(recordings, INSTRUMENT))
    assert found.repeats == 3
    assert len(found.protocols) == 1
    for contact, air in zip(found.contacts, airs, strict=True):
        assert contact.displacement == pytest.approx(air, abs=0.15)
    deep = [20.0] * 3 if to_one_depth else [20.0 + min(airs) - air for air in airs]
    np.testing.assert_allclose(found.depths, deep, atol=0.3)


def test_other_rates_depths_or_phases_are_other_programmes():
    given = [
        Protocol.ramp(15.0, 0.5),
        Protocol.ramp(15.0, 0.6),
        Protocol.ramp(12.0, 0.5),
        Protocol.cycle(15.0, 0.5, 20.0),
        Protocol.cycle(15.0, 0.5, 30.0),
    ]
    assert len(observed(*given).protocols) == 5


@pytest.mark.parametrize("depths", [(15.0, 15.7, 15.3), (15.0, 15.3, 15.7), (15.3, 15.7, 15.0)])
def test_a_trial_between_two_makes_them_one_programme(depths):
    """Two programmes by their ends alone: with the third they had the same stations twice."""
    found = observed(*(Protocol.cycle(depth, 0.5, 20.0) for depth in depths))
    assert len(found.protocols) == 1 and found.repeats == 3
    apart = observed(*(Protocol.cycle(depth, 0.5, 20.0) for depth in (15.0, 15.7)))
    assert len(apart.protocols) == 2
