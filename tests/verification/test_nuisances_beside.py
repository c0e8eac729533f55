"""What an aim that is off does to a film beside stiff fat, as tabulated and by felupe's leg."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from legfem.channels import Sight
from legfem.channels.kinds.contact import PRESSURE
from legfem.common.units import FloatArray
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.geometry.section import across
from legfem.inverse.library import ChannelTables, Library, NuisanceChanges, Table, pair_strength
from legfem.inverse.mechanism import Solution, TissueMechanism
from legfem.inverse.responses import PLAIN, SolvedResponses
from legfem.legs.finite_element_models import COARSENING, LegVariants, plane_strain_test
from legfem.legs.loading import load_subject
from legfem.legs.nuisances import AIM_SD_MM, errors_of_geometry
from legfem.legs.schema import SUBJECTS
from legfem.mechanisms import mechanism_named
from studies.making.plane_leg import OtherCase, OtherCode

pytestmark = pytest.mark.slow
DEPTH, C10_KPA, FACTOR, FINER = 10.0, 1.0, 2.2, 2.0
SENSELS = Sight(PRESSURE.name, tuple(pairwise(np.arange(-18.0, 19.0, 6.0).tolist())))
NAMES = PRESSURE.courses(len(SENSELS.places))


def by_felupe(factor: float) -> FloatArray:
    """Return what an aim does to the pressures, (sensels,) kPa, beside fat so many times as stiff.

    In the mean of both sides, as an aim may be off to either. On its default mesh, by Gauss points 0.5 mm apart, such a
    difference is noise of 0.3 kPa.
    """
    subject = load_subject(SUBJECTS.find("3"), need_recordings=False)
    indenter, case = subject.indenter, OtherCase(C10_KPA, factors={"superficial": factor})

    def aimed(aside: float) -> FloatArray:
        aim = np.asarray(indenter.aim) + aside * across(indenter.direction)
        leg = replace(subject, indenter=replace(indenter, aim=(float(aim[0]), float(aim[1]))))
        solved = OtherCode(leg, case, finer=FINER, sights=(SENSELS,)).solve(DEPTH, 1.0)
        assert solved.reached
        return np.array([solved.channels[name][-1] for name in NAMES])

    return 0.5 * (aimed(AIM_SD_MM) - aimed(-AIM_SD_MM))


def test_an_aim_does_to_a_film_beside_stiff_fat_what_another_code_says():
    subject = load_subject(SUBJECTS.find("3"), need_recordings=False)
    settings = PlaneStrainSettings()
    settings = replace(settings, mesh=settings.mesh.refined(1 / COARSENING))
    models = LegVariants(
        replace(
            plane_strain_test(subject, settings), sights=(SENSELS,), motions=errors_of_geometry(subject.section.bones)
        )
    )
    solved = SolvedResponses(models, DEPTH, None, {})
    fat = mechanism_named("superficial-stiffness")
    assert isinstance(fat, TissueMechanism)

    def changes(solution: Solution) -> NuisanceChanges:
        found = solved.sensitivities(("aim",), (1e-3 * C10_KPA, 0.0), solution)["aim"]
        return NuisanceChanges(solved.grid, {"aim": {name: found[name] for name in ("force", *NAMES)}}, {})

    plain = changes(PLAIN)
    altered = changes(fat.solution({"factor": pair_strength(fat)})).plus(-1.0, plain)
    rows = [fat.solution({"factor": factor}) for factor in fat.strengths]
    courses = [solved.elastic_change(one, (1e-3 * C10_KPA, 0.0)) for one in rows]
    values = np.array([np.stack([one[name] for name in NAMES], axis=-1).ravel() for one in courses])
    table = Table(np.zeros(1), values[None], strengths=fat.strengths)
    beside = ChannelTables(tuple(NAMES), None, {(fat.name, ""): table})
    middle = 1e-3 * C10_KPA
    library = Library(solved.grid, None, plain, middle, beside=beside, altered={fat.name: altered})  # type: ignore[arg-type]

    def tabulated(of: NuisanceChanges) -> FloatArray:
        return np.array([of.geometric["aim"][name][-1] for name in NAMES])

    theirs = by_felupe(FACTOR)
    ours = tabulated(library.nuisances_beside([(fat, {"factor": FACTOR})]))
    assert np.abs(theirs).max() > 0.3
    assert np.linalg.norm(ours - theirs) < 0.2 * np.linalg.norm(theirs)
    assert np.linalg.norm(tabulated(plain) - theirs) > 2 * np.linalg.norm(ours - theirs)
