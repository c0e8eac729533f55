"""Curves of FEBio 4.11: three-field hexahedra and sticky node-to-facet contact."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from making import CROSSCHECK

from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.loading import load_subject

# kPa to MPa; the other code has no (J - 1)^4 / D2 term.
PARAMETERS = {
    "neo-hookean": {"deep.C10": 1.50e-3, "deep.C20": 0.0},
    "reduced-polynomial": {"deep.C10": 0.72e-3, "deep.C20": 0.85e-3, "deep.D2": np.inf},
}


@pytest.mark.parametrize("case", list(PARAMETERS))
def test_the_curve_is_met_within_a_percent(case):
    folder = CROSSCHECK / case
    other = pd.read_csv(folder / "clean.csv")
    at, force = other["displacement_mm"].to_numpy(), other["force_N"].to_numpy()
    compared = (at >= 2.0) & (at <= 20.0)
    test = plane_strain_test(load_subject(folder))
    solved = test.solve(PARAMETERS[case], depth=min(20.0, at.max()))
    assert solved.report.complete
    error = solved.curve(at[compared]) / force[compared] - 1
    print(case, f"{len(error)} points, {error.min():+.2%} to {error.max():+.2%}", solved.report)
    assert np.abs(error).max() < 0.01
