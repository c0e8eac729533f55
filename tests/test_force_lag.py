"""A force that is recorded behind the displacement: named where the drive turns, and one with a later contact else."""

from __future__ import annotations

import pytest
from making_diagnosed import BASE, diagnosed_of
from making_diagnosis import _blank, force_at, noisy, observations, ramps, two_rates

from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.mechanisms import mechanism_named
from legfem.solve.protocol import Protocol

LAG = mechanism_named("force-lag")


def cycles(rate: float = 0.4, hold: float = 0.0):
    """Return observations of nothing: three loadings with their unloadings."""
    return observations([_blank(Protocol.cycle(20.0, rate, hold=hold), f"trial{k + 1}") for k in range(3)])[0]


def test_the_tissue_was_pressed_as_the_drive_stood_a_lag_before() -> None:
    observed = cycles()
    lost = LAG.displacement_loss({"lag": 2.0}, observed, observed.force)
    loading, before = observed.phase == "loading", observed.displacement - lost
    far = observed.displacement > 0.8
    assert lost[loading & far] == pytest.approx(0.8, abs=1e-6)
    turned = ~loading & (observed.displacement > 20.0 - 0.8)
    assert (before[turned] <= 20.0).all() and (before >= -1e-9).all()
    later = ~loading & (observed.displacement < 20.0 - 0.8)
    assert lost[later] == pytest.approx(-0.8, abs=1e-6)


def test_it_shows_where_the_drive_turns_or_at_two_rates_alone() -> None:
    assert "later contact" in (LAG.untestable(observations(ramps())[0]) or "")
    for observed in (cycles(), observations(two_rates())[0]):
        assert LAG.untestable(observed) is None


@pytest.mark.parametrize("lag", [-1.0, 1.5, 4.0])
def test_a_force_behind_the_displacement_is_named_with_its_lag_and_C10_is_found(lag: float) -> None:
    """Forces of a closed form, delayed sample by sample; C10 without it is far off where the lag is long."""
    observed = cycles()
    (protocol,) = (one.protocol for one in observed.protocols)
    at = protocol.displacement_at(observed.time - lag)
    found = diagnosed_of(noisy(observed, force_at(BASE[DEEP_C10], BASE[DEEP_C20], at), 3))
    assert found.verdict in ("named", "ambiguous") and found.models[0].names == ("force-lag",)
    assert found.models[0].value("force-lag.lag") == pytest.approx(lag, abs=0.2)
    low, high = found.intervals[DEEP_C10]
    assert low < BASE[DEEP_C10] < high
