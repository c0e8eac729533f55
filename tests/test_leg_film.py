"""States of a leg's solve in 3D, kept to be looked at."""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from making_legs_3d import cone_folder

from legfem.experiments.leg_3d import SolidLegSettings
from legfem.fem.fields import FieldReader
from legfem.geometry.leg_shape import SKIN
from legfem.legs.details import LegFilm, LegState, seen
from legfem.legs.loading import load_subject
from legfem.legs.model_3d import LegModels
from legfem.meshing.leg_sizes import SolidMeshSettings

DEPTH = 4.0
COARSE = SolidLegSettings(
    mesh=SolidMeshSettings(skin_size=30.0, inside_size=40.0, bone_size=20.0, layer_elements=0.2, turn_elements=3.0),
    contact_size=4.5,
)


@pytest.fixture(scope="module")
def filmed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cone")
    cone_folder(folder, level=100.0, more="length_mm = 60.0", slope=0.0)
    subject = load_subject(folder, need_recordings=False)
    model = LegModels.of_subject(subject, DEPTH, folder, COARSE).full
    outcome = model.solve({"deep.C10": 1.2e-3})
    assert outcome.complete
    return model, outcome, subject


def test_a_solve_s_states_show_the_cylinder_s_imprint(filmed):
    model, outcome, _ = filmed
    pressed = model.pressed(outcome)
    at = [state.displacement for state in pressed.states]
    assert at == sorted(at) and at[-1] == pytest.approx(DEPTH) and len(at) >= 2
    last, skin = pressed.states[-1], pressed.shape.points(SKIN)
    cylinder, direction = pressed.indenter, pressed.pose.direction
    under = np.abs(skin - (pressed.touch + cylinder.radius * direction)).sum(axis=2)
    level, point = np.unravel_index(np.argmin(under), under.shape)
    inward = last.skin[level, point] @ direction
    assert inward == pytest.approx(DEPTH, rel=0.15), "the skin goes with the cylinder"
    where = skin[np.unravel_index(np.argmax(last.pressure), last.pressure.shape)]
    assert where @ direction < 0, "on the cylinder's side"
    assert abs(where[2]) < 0.6 * cylinder.length
    assert np.abs(last.skin[[0, -1], :, 2]).max() < 1e-3, "end faces stay in their planes"
    # Over the skin it sums up to what it does on the mesh, which is in the last state.
    around = np.roll(skin, -1, axis=1) - skin
    area = np.linalg.norm(np.cross(around, np.gradient(skin, axis=0)), axis=2)
    field, _ = FieldReader(model.experiment.system).on_skin()
    facets = field.function_space.dofmap.list
    a, b, c = np.moveaxis(field.function_space.tabulate_dof_coordinates()[facets], 1, 0)
    there = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    total = float(there @ field.x.array[facets].mean(axis=1))
    assert float((last.pressure * area).sum()) == pytest.approx(total, rel=0.05)
    assert 1e-3 * total == pytest.approx(outcome.curve.force[-1], rel=0.5), "kPa and mm2 give N"


def test_the_solves_that_make_the_correction_are_filmed_and_rough_ones_not(filmed, tmp_path):
    model, outcome, subject = filmed
    models = LegModels.of_subject(subject, DEPTH, tmp_path, COARSE)
    assert models.rough.film is None and models.shorter.film is None
    assert models.full.fingerprint() == model.fingerprint()
    assert models.pressed(outcome) is None, "solved, but not filmed in this folder"
    shutil.copytree(model.film.folder, tmp_path / "film")
    again = LegModels.of_subject(subject, DEPTH, tmp_path, COARSE).pressed(outcome)
    assert len(again.states) == len(model.pressed(outcome).states)


def test_states_are_found_again_under_their_solve_s_key_only(filmed):
    model, _, _ = filmed
    again = LegFilm(model.film.folder)
    (name,) = [path.stem for path in model.film.folder.iterdir()]
    kept = model.film.states(name)
    for one, other in zip(kept, again.states(name), strict=True):
        assert one.displacement == other.displacement
        np.testing.assert_allclose(one.skin, other.skin, atol=1e-5)
        np.testing.assert_allclose(one.pressure, other.pressure, rtol=1e-5)
    assert again.states("of another solve") == []


def test_an_attempt_that_was_given_up_leaves_no_states_and_a_broken_file_none(tmp_path):
    film, nothing = LegFilm(tmp_path), np.zeros((2, 8, 3))
    for at in (1.0, 2.0, 0.5, 1.5):
        film.add("key", LegState(at, nothing, nothing, nothing[..., 0]))
    assert [state.displacement for state in film.states("key")] == [0.5, 1.5]
    assert [state.displacement for state in LegFilm(tmp_path).states("key")] == [0.5, 1.5]
    (tmp_path / "key.npz").write_bytes(b"cut short")
    assert LegFilm(tmp_path).states("key") == []


def test_a_leg_is_looked_at_finely_along_and_no_finer_than_needed_round(filmed):
    shape = seen(filmed[0].experiment.shape)
    assert len(shape.levels) == 41
    assert all(xy.shape[1] <= 120 for xy in shape.contours.values())
