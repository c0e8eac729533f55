"""States of a solution in memory: the pictures of them are those of another solution."""

from __future__ import annotations

import numpy as np
from making_mechanics import subject_3

from legfem.channels import Sight
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.legs.forward import PlaneStrainForward
from legfem.meshing.section import SectionMeshSettings
from legfem.report.pressed_section import filmed

DEPTH = 4.0


def test_a_solution_is_looked_at_without_solving_again_and_looks_the_same() -> None:
    settings = PlaneStrainSettings(mesh=SectionMeshSettings(contact_size=4.0, far_size=14.0))
    made = PlaneStrainForward(PlaneStrainIndentation(*subject_3(), settings), DEPTH)
    soft, stiff = {"deep.C10": 0.5e-3}, {"deep.C10": 2e-3}
    for values in (soft, stiff):
        made.solve(values, ("deep.C10",))
    replays = made.experiment.replays
    assert replays.find(soft, 2 * DEPTH) is None and replays.find({}, DEPTH) is None
    kept = filmed(made.experiment, soft, DEPTH)
    known = replays.find(soft, DEPTH)
    assert known is not None and kept.solved is known.solved

    again = filmed(PlaneStrainIndentation(*subject_3(), settings), soft, DEPTH)
    assert kept.is_final and again.is_final
    assert kept.fields.pressure.x.array.max() > 0
    for name, unit in (("displacement", 1e-9), ("pressure", 1e-6), ("skin_pressure", 1e-6)):
        one, other = (getattr(shot.fields, name).x.array for shot in (kept, again))
        assert np.allclose(one, other, atol=unit)
    shown, solved = kept.section("it"), again.section("it")
    assert shown is not None and solved is not None and len(shown.rows) > 4
    assert shown.rows == solved.rows
    stiffer = filmed(made.experiment, stiff, DEPTH).section("it")
    assert stiffer is not None and float(stiffer.rows[-1][1]) > 1.2 * float(shown.rows[-1][1])


def test_a_kept_solve_is_of_the_places_at_which_channels_are_read() -> None:
    plain = PlaneStrainIndentation(*subject_3())
    seen = PlaneStrainIndentation(*subject_3(), sights=(Sight("section_displacement", ((0.0, 20.0),)),))
    assert PlaneStrainForward(plain, DEPTH).fingerprint() != PlaneStrainForward(seen, DEPTH).fingerprint()
