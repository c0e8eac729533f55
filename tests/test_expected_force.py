"""The force that a leg can push back with, without solving: beside solutions."""

from __future__ import annotations

import numpy as np
import pytest

from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.loading import load_subject
from legfem.legs.plausible_recordings import SLACK, SOFTEST_KPA, STIFFEST_KPA, force_range
from legfem.legs.schema import SUBJECTS
from legfem.meshing.section import SectionMeshSettings


@pytest.mark.slow
@pytest.mark.parametrize("name", SUBJECTS.names)
def test_a_leg_pushes_back_between_the_envelopes_and_they_are_tight(name):
    leg = load_subject(SUBJECTS.find(name), need_recordings=False)
    settings = PlaneStrainSettings(SectionMeshSettings().refined(0.5), defences=False)
    test = plane_strain_test(leg, settings)
    at = np.array([5.0, 12.0, 20.0])
    low, high = force_range(leg, at)
    soft, stiff = (
        test.solve({"deep.C10": 1e-3 * c10, "deep.C20": 0.0}, 20.0).curve(at) for c10 in (SOFTEST_KPA, STIFFEST_KPA)
    )
    assert (SLACK * soft > low).all() and (soft < 1.6 * low).all()
    assert (stiff < SLACK * high).all() and (stiff > 0.5 * high).all()
