"""The study's leg pressed along and across: its folder, and the cylinder that lies across."""

from __future__ import annotations

import numpy as np
import ufl

from legfem.legs.loading import load_sites
from legfem.solve.path import ForceCurve
from studies.cases.outcomes import Interval
from studies.leg3d import orientations
from studies.leg3d.fibres import Told
from studies.leg3d.planted import CYLINDER, Planted


def test_a_planted_leg_has_a_site_a_way_and_states_no_ratio(tmp_path, monkeypatch):
    d = np.linspace(0.0, 7.0, 15)
    forces = {orientations.PRESSED["along"]: 0.4 * d, orientations.PRESSED["across"]: 0.3 * d}
    monkeypatch.setattr(orientations, "true_curve", lambda _, kept, cylinder: ForceCurve(d, forces[cylinder], {}))
    planted = Planted(fibres=3.0)
    folder = orientations.sited_folder(planted, ("along", "across"), tmp_path / "leg", 1, tmp_path)
    along, across = load_sites(folder).sites
    assert (along.indenter.axis_deg, across.indenter.axis_deg) == (0.0, 90.0)
    assert along.fibres is None and not along.plane_strain
    tops = [max(trial.force.max() for trial in site.recordings) for site in (along, across)]
    np.testing.assert_allclose(tops, (2.8, 2.1), rtol=0.1)


def test_the_hexahedra_s_cylinder_across_is_the_one_along_turned_about_its_travel():
    along, across = CYLINDER.shape(3), orientations.Across(length=CYLINDER.length).shape(3)
    for x, y, z in np.random.default_rng(1).uniform(-25, 25, (20, 3)):
        there, turned = ufl.as_vector([float(z), float(y), float(x)]), ufl.as_vector([float(x), float(y), float(z)])
        assert abs(float(across.gap(turned)) - float(along.gap(there))) < 1e-9


def test_a_row_says_whether_the_interval_holds_the_truth():
    told = Told(Interval(1.5, 1.0, 2.0), "weakly identifiable")
    assert told.row(1.9)[1] == "yes" and told.row(2.1)[1] == "no"
