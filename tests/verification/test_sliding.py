"""Fat slides along the fascia, by any way, and doesn't part from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_derivatives import PRECISE, taylor_orders, worst_error
from making_mechanics import COARSE, fixed_steps, subject_3

from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.fem.sliding import _gap
from legfem.mechanics.terms import SlidingFace
from legfem.meshing.section import OUTER_FASCIA, UNDER_FAT
from legfem.solve.newton import NewtonSolver
from legfem.solve.protocol import Protocol
from legfem.solve.stepping import follow

SETTINGS = PlaneStrainSettings(mesh=COARSE, steps=fixed_steps(1.0), defences=False)
SLIDES, GROWN = {"sliding.shear": 3e-5}, {"sliding.shear": 10.0, "sliding.normal": 10.0}


@pytest.fixture(scope="module")
def sliding() -> PlaneStrainIndentation:
    return PlaneStrainIndentation(*subject_3(), SETTINGS, mechanisms=[SlidingFace()])


@pytest.fixture(scope="module")
def pressed(sliding):
    """The leg pressed by 8 mm."""
    system = sliding.system
    system.set_parameters({**sliding.model.parameters, **SLIDES})
    assert follow(system, NewtonSolver(system, PRECISE), Protocol.ramp(8.0, rate=1.0), fixed_steps(1.0)).complete
    return system


def test_a_gap_from_nodes_on_a_circle_is_that_from_the_circle():
    angles = np.array([0.1, 0.2, 0.33, 0.42])
    nodes = 30.0 * np.column_stack([np.cos(angles), np.sin(angles)])
    steps = np.linalg.norm(np.diff(nodes, axis=0), axis=1)
    at = np.linspace(0.2, 0.33, 7)
    for away in (-0.5, 0.0, 2.0):
        x = (30.0 + away) * np.column_stack([np.cos(at), np.sin(at)])
        many = np.tile(nodes, (7, 1, 1)), np.tile(steps, (7, 1))
        np.testing.assert_allclose(_gap(x, *many)[0], away, atol=1e-3)


def test_a_gap_s_derivatives_are_those_of_differences():
    x, nodes = np.array([[0.3, -0.2]]), np.array([[[-2.0, 0.1], [0.0, 0.2], [1.0, -0.4], [3.0, -0.1]]])
    steps, e = np.array([[2.0, 1.1, 2.0]]), 1e-6
    _, first, second = _gap(x, nodes, steps)
    z = np.concatenate([x, nodes.reshape(1, 8)], axis=1)
    for k, unit in enumerate(np.eye(10)):
        plus, minus = (_gap(y[:, :2], y[:, 2:].reshape(1, 4, 2), steps) for y in (z + e * unit, z - e * unit))
        np.testing.assert_allclose((plus[0] - minus[0]) / (2 * e), first[:, k], atol=1e-8)
        np.testing.assert_allclose((plus[1] - minus[1]) / (2 * e), second[:, k], atol=1e-8)


def test_what_bears_all_along_its_face_is_grown_together():
    """On meshes as fine as usual: fat that is meshed by itself has other elements."""
    settings = replace(SETTINGS, mesh=PlaneStrainSettings().mesh)
    leg = PlaneStrainIndentation(*subject_3(), settings, mechanisms=[SlidingFace()])
    at, ramp = np.arange(1.0, 5.0), Protocol.ramp(4.0, rate=1.0)
    base = PlaneStrainIndentation(*subject_3(), settings).solve(None, ramp).path.force_at(at)
    grown, slides = (leg.solve(values, ramp).path.force_at(at) for values in (GROWN, SLIDES))
    print(grown / base, slides / base)
    np.testing.assert_allclose(grown, base, rtol=3e-3)
    assert (slides < 0.95 * base).all()


def test_the_tangent_is_the_residual_s_derivative(pressed):
    orders = taylor_orders(pressed)
    print(orders)
    np.testing.assert_allclose(orders, 2.0, atol=0.05)


def test_forces_on_the_face_are_in_balance_and_it_stays_closed(pressed):
    """The one's are the other's, no moment is left, and nothing opens as far as it slides."""
    face, unknown = pressed.faces[0], pressed.unknown.x.array
    force = face.residual(unknown)[pressed.spaces.displacement_dofs].reshape(-1, 2)
    places = pressed.spaces.displacement_space.tabulate_dof_coordinates()[:, :2]
    moved = places + unknown[pressed.spaces.displacement_dofs].reshape(-1, 2)
    size = np.abs(force).sum()
    np.testing.assert_allclose(force.sum(axis=0), 0.0, atol=1e-12 * size)
    moment = moved[:, 0] @ force[:, 1] - moved[:, 1] @ force[:, 0]
    # Outlines are rounded beyond the mesh's chords, and what resists sliding acts along the way slid.
    assert abs(moment) < 1e-2 * size
    assert face.slips(unknown).max() > 1.0
    assert face.gaps(unknown).max() < 0.03
    balance = pressed.balance()
    np.testing.assert_allclose(balance.bone_reaction, -balance.contact_force, rtol=1e-6)
    assert balance.internal_work == pytest.approx(balance.contact_work, rel=1e-6)


def test_sensitivities_are_exact(sliding):
    values = {**sliding.model.parameters, **SLIDES}
    names = ["deep.C10", "superficial.C10", "sliding.shear", "sliding.normal"]
    assert worst_error(sliding.system, values, names, Protocol.ramp(3.0, rate=1.0), 0.75) < 1e-4


def test_fat_and_fascia_have_nodes_of_their_own_at_the_same_places(sliding):
    meshed = sliding.section_mesh
    edges = [meshed.facet_tags.find(tag) for tag in (UNDER_FAT, OUTER_FASCIA)]
    assert len(edges[0]) == len(edges[1]) > 20
    assert not set(edges[0].tolist()) & set(edges[1].tolist())


@pytest.mark.slow
def test_another_code_s_sliding_face_gives_the_force():
    """felupe's triangles, outline and Newton's method, with the same stiffness of the face along itself."""
    from legfem.legs.finite_element_models import tissues_of
    from legfem.legs.loading import load_subject
    from legfem.legs.schema import SUBJECTS
    from studies.making.plane_leg import OtherCase, OtherCode

    subject = load_subject(SUBJECTS.find("3"), need_recordings=False)
    other = OtherCode(subject, OtherCase(0.7, 0.8, sliding=0.5)).solve(10.0)
    assert other.reached
    settings = replace(SETTINGS, mesh=PlaneStrainSettings().mesh)
    own = PlaneStrainIndentation(
        subject.section, subject.indenter, tissues_of(subject), settings, mechanisms=[SlidingFace()]
    )
    values = {"deep.C10": 0.7e-3, "deep.C20": 0.8e-3, "sliding.shear": 0.5e-3}
    force = own.solve(values, Protocol.ramp(10.0, rate=1.0)).path.force_at(other.displacement[1:])
    apart = force / other.force[1:] - 1
    print(apart)
    deep = other.displacement[1:] > 2.0
    assert np.abs(apart[deep]).max() < 0.01
