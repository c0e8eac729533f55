"""Three rates with holds of 300 s by memories that aren't fitted: the third from two."""

from __future__ import annotations

from pathlib import Path

import pytest
from making_rates import MEMORIES, write_rates
from making_specimens import left_out

import legfem as lf

pytestmark = pytest.mark.slow
LEAST = 0.94


@pytest.mark.parametrize("memory", MEMORIES)
def test_the_middle_rate_is_predicted_from_the_others(tmp_path: Path, memory: str) -> None:
    folder = lf.load_specimen(write_rates(tmp_path, MEMORIES[memory]))
    law = "reduced-polynomial"
    (predicted,) = left_out(lf.identify(folder, law, leave_out=["middle"])[law])
    print(memory, predicted.force.r_squared, predicted.shape_r_squared)
    assert predicted.force.r_squared >= LEAST


def test_a_rate_ten_times_slower_is_predicted(tmp_path: Path) -> None:
    folder = lf.load_specimen(write_rates(tmp_path, MEMORIES["strain-dependent"]))
    law = "reduced-polynomial"
    (predicted,) = left_out(lf.identify(folder, law, leave_out=["slow"])[law])
    assert predicted.force.r_squared >= LEAST
