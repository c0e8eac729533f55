"""A leg's own 3D model with fibres: their force, and its derivative by their ratio."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_legs_3d import cone_folder
from test_leg_film import COARSE

from legfem.common.progress import Silent
from legfem.inverse.catalogue import DEEP_RATIO
from legfem.inverse.correction import FIBRES
from legfem.inverse.elastography import FibreRatio
from legfem.inverse.outcome import FullSolver, JointForward
from legfem.legs.loading import load_subject
from legfem.legs.model_3d import LegModels
from legfem.legs.solver_3d import fibre_errors
from legfem.mechanics.terms import Fibres

pytestmark = pytest.mark.slow
DEPTH, C10, RATIO = 5.0, {"deep.C10": 1.2e-3}, 2.5


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """Solve the same leg without fibres, and at three ratios about one."""
    folder = tmp_path_factory.mktemp("cone")
    cone_folder(folder, level=100.0, more="length_mm = 110.0", slope=0.0)
    subject = load_subject(folder, need_recordings=False)

    def curve(ratio: float | None, by: tuple[str, ...] = ()):
        fibres = None if ratio is None else FibreRatio(ratio, 0.3, "measured", "shear waves")
        fibrous = replace(subject, fibres=fibres)
        outcome = LegModels.of_subject(fibrous, DEPTH, None, COARSE).full.solve(C10, by)
        assert outcome.complete
        return outcome.curve

    ratios = {ratio: curve(ratio) for ratio in (None, 1.0, RATIO - 0.02, RATIO + 0.02)}
    return ratios, curve(RATIO, tuple(Fibres("deep").parameters))


def test_fibres_of_a_ratio_of_one_do_nothing_and_stiffer_ones_press_back(solved):
    ratios, fibrous = solved
    at = np.array([2.5, 5.0])
    np.testing.assert_allclose(ratios[1.0](at), ratios[None](at), rtol=1e-9)
    rise = fibrous(at) / ratios[None](at)
    assert np.all((rise > 1.04) & (rise < 1.25)), "as on the table's leg, 1.11 and 1.14"


def test_the_error_by_the_ratio_is_that_of_solves_beside_it(solved):
    ratios, fibrous = solved
    known = FibreRatio(RATIO, 0.3, "measured", "shear waves")
    at = np.array([3.0, 5.0])
    found = fibre_errors(fibrous, known, {"deep": C10["deep.C10"]}, at)[f"{FIBRES}ratio"]
    slope = (ratios[RATIO + 0.02](at) - ratios[RATIO - 0.02](at)) / 0.04 / fibrous(at)
    np.testing.assert_allclose(found, 0.3 * slope, rtol=0.01)


@pytest.mark.parametrize("name", ["deep.C10", DEEP_RATIO, "fascia.C10"])
def test_derivatives_under_a_cylinder_across_the_leg_are_those_of_solves_beside(across, name):
    model, values, curve = across
    at, step = np.array([2.0, 3.0]), 0.01 * values[name]
    up, down = (model.solve({**values, name: values[name] + side * step}) for side in (1, -1))
    assert up.complete and down.complete
    slope = (up.curve(at) - down.curve(at)) / (2 * step)
    np.testing.assert_allclose(curve.sensitivity(name, at), slope, rtol=0.01)


def test_two_processes_solve_two_sites_as_one_does(across):
    model, values, curve = across
    deeper = replace(model, depth=4.0)
    with FullSolver(JointForward((model, deeper)), None, 2, Silent(), tuple(values)) as solver:
        (both,) = solver.solve([values])
    shallow, deep = both.curves
    np.testing.assert_allclose(shallow(curve.displacement), curve.force, rtol=1e-9)
    assert deep.depth == 4.0 and set(deep.sensitivities) == set(values)


@pytest.fixture(scope="module")
def across(tmp_path_factory):
    """Press a cylinder that lies across a leg whose fibres' ratio is open, with derivatives."""
    folder = tmp_path_factory.mktemp("across")
    cone_folder(folder, level=100.0, more="length_mm = 60.0", slope=0.0)
    subject = load_subject(folder, need_recordings=False)
    lying = replace(subject, indenter=replace(subject.indenter, axis_deg=90.0))
    settings = replace(COARSE, contact_size=6.0)
    model = LegModels.of_subject(lying, 3.0, None, settings, open_ratio=True).full
    values = {"deep.C10": 1.2e-3, DEEP_RATIO: RATIO, "fascia.C10": 0.1}
    solved = model.solve(values, tuple(values))
    assert solved.complete
    return model, values, solved.curve
