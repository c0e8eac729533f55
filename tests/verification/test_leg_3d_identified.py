"""A leg recorded in 3D by other elements is identified by its own solves in 3D."""

from __future__ import annotations

import pytest

from legfem.common.progress import Silent
from legfem.inverse.catalogue import DEEP_C10
from studies.leg3d.__main__ import identified
from studies.leg3d.planted import Planted


@pytest.mark.slow
def test_c10_of_a_leg_pressed_in_3d_by_hexahedra_is_within_its_interval(tmp_path):
    planted = Planted(c10=1.2)
    results = identified(planted, 1, tmp_path, Silent())
    own = results["3d"]
    evidence = own.details.spatial
    assert evidence.converged
    assert evidence.full_solves + evidence.rough_solves <= 8
    low, high = own.estimates[DEEP_C10].ci95
    assert low < 1e-3 * planted.c10 < high
    # The section alone takes the ends' force for stiffness.
    bias = results["2d, no correction"].estimates[DEEP_C10].value / (1e-3 * planted.c10) - 1
    own_bias = own.estimates[DEEP_C10].value / (1e-3 * planted.c10) - 1
    print(bias, own_bias)
    assert abs(own_bias) < 0.5 * abs(bias)
