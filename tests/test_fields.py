"""Fields of uniform states against closed forms, and the files of them."""

from __future__ import annotations

from xml.etree import ElementTree

import dolfinx.mesh
import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from legfem.fem.field_files import write_fields
from legfem.fem.fields import fields_of, greatest_stretch, hydrostatic_pressure, von_mises_stress
from legfem.fem.spaces import build_spaces
from legfem.fem.system import System
from legfem.mechanics.contact import StiffPressure
from legfem.mechanics.indenters import RigidCylinder
from legfem.mechanics.materials import ReducedPolynomial
from legfem.mechanics.model import LegModel, Term
from legfem.mechanics.terms import Excess, NormalContact, Tissue, Viscoelasticity
from legfem.meshing.section import BONE, DEEP, SKIN

LAW = ReducedPolynomial(C10=2e-3, D1=28.0, C20=1e-3, D2=10.0)
STRETCH = np.array([1.1, 0.85])
RADIUS, STIFFNESS, OVERLAP = 1e4, 0.02, 0.1


def block(formulation: str, *mechanisms: Term) -> System:
    """A unit square of deep tissue; an almost flat indenter overlaps its stretched top."""
    mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    cells = np.arange(8, dtype=np.int32)
    tags = dolfinx.mesh.meshtags(mesh, 2, cells, np.full(8, DEEP, dtype=np.int32))
    ends = [dolfinx.mesh.locate_entities_boundary(mesh, 1, lambda x, y=y: np.isclose(x[1], y)) for y in (0.0, 1.0)]
    facets = np.concatenate(ends)
    marks = np.repeat(np.array([BONE, SKIN], dtype=np.int32), [len(end) for end in ends])
    order = np.argsort(facets)
    facet_tags = dolfinx.mesh.meshtags(mesh, 1, facets[order], marks[order])
    model = LegModel(
        (Tissue("deep", LAW), NormalContact(RigidCylinder(RADIUS), StiffPressure(STIFFNESS, 0.001)), *mechanisms),
        formulation,
    )
    spaces = build_spaces(mesh, tags, facet_tags, formulation)
    centre = np.array([0.5 * STRETCH[0], STRETCH[1] - OVERLAP + RADIUS])
    system = System(spaces, model, centre, np.array([0.0, -1.0]))
    system.set_parameters(model.parameters)
    space, part = spaces.space, slice(None)
    if formulation == "mixed":
        space, part = space.sub(0).collapse()
        part = np.ravel(part)  # in a list from DOLFINx 0.11 on
        J = STRETCH.prod()
        system.unknown.sub(1).interpolate(lambda x: np.full(x.shape[1], 2 * (J - 1) / LAW.D1))
    moved = fem.Function(space)
    moved.interpolate(lambda x: (STRETCH - 1)[:, None] * x[:2])
    system.unknown.x.array[part] = moved.x.array
    return system


@pytest.fixture(scope="module", params=["displacement", "mixed"])
def fields(request):
    return fields_of(block(request.param))


def test_uniform_state_has_the_closed_form_pressure(fields):
    J = STRETCH.prod()
    tension = 2 * (J - 1) / LAW.D1 + 4 * (J - 1) ** 3 / LAW.D2
    np.testing.assert_allclose(fields.volume_ratio.x.array, J, rtol=1e-10)
    np.testing.assert_allclose(fields.pressure.x.array, -1e3 * tension, rtol=1e-9)
    assert fields.pressure.x.array.min() > 0, "compression is positive"


def test_uniform_state_has_the_closed_form_von_mises_stress(fields):
    J = STRETCH.prod()
    b = np.diag([*STRETCH**2, 1.0]) * J ** (-2 / 3)
    deviator = b - np.trace(b) / 3 * np.eye(3)
    modulus = 2 / J * (LAW.C10 + 2 * LAW.C20 * (np.trace(b) - 3))
    expected = 1e3 * modulus * np.sqrt(1.5 * np.sum(deviator**2))
    np.testing.assert_allclose(fields.von_mises.x.array, expected, rtol=1e-9)
    np.testing.assert_allclose(fields.stretch.x.array, 1.1, rtol=1e-10)


@pytest.mark.parametrize("formulation", ["displacement", "mixed"])
def test_a_mechanism_s_stress_counts(formulation):
    """A part of a tissue that is twice as stiff has twice its stress."""
    tense = block(formulation, Excess("deep", "deep", LAW, excess=1.0))
    relaxed = fields_of(block(formulation))
    found = fields_of(tense)
    b = np.diag([*STRETCH**2, 1.0]) * STRETCH.prod() ** (-2 / 3)
    modulus = LAW.C10 + 2 * LAW.C20 * (np.trace(b) - 3)
    more = 2 * modulus / STRETCH.prod() * (b - np.trace(b) / 3 * np.eye(3))
    expected = relaxed.von_mises.x.array + 1e3 * von_mises_stress(more)
    np.testing.assert_allclose(found.von_mises.x.array, expected, rtol=1e-9)
    np.testing.assert_allclose(found.pressure.x.array, relaxed.pressure.x.array, rtol=1e-9)
    assert (found.pressure.name, found.von_mises.name) == ("pressure", "von_mises")


def test_fields_say_which_stress_they_are_without(tmp_path):
    found = fields_of(block("displacement", Viscoelasticity("deep", LAW, ratio=0.5)))
    assert found.von_mises.name == "von_mises_without_deep.viscoelasticity"
    write_fields(found, tmp_path)
    text = (tmp_path / "fields.xdmf").read_text()
    assert "pressure_without_deep.viscoelasticity" in text


def test_contact_pressure_is_per_deformed_area(fields):
    # A chord of 1.1 mm leaves a disk of 10 m by 1.5e-5 mm.
    expected = 1e3 * STIFFNESS * OVERLAP / STRETCH[0]
    np.testing.assert_allclose(fields.skin_pressure.x.array, expected, rtol=1e-3)


def test_displacement_and_region_are_those_of_the_model(fields):
    space = fields.displacement.function_space
    there = space.tabulate_dof_coordinates()[:, :2]
    moved = fields.displacement.x.array.reshape(-1, 2)
    np.testing.assert_allclose(moved, (STRETCH - 1) * there, atol=1e-12)
    assert set(fields.region.x.array) == {DEEP}


def test_measures_of_stress_and_strain():
    uniaxial = np.diag([3.0, 0.0, 0.0])
    assert hydrostatic_pressure(uniaxial) == pytest.approx(-1.0)
    assert von_mises_stress(uniaxial) == pytest.approx(3.0)
    assert von_mises_stress(-5 * np.eye(3)) == pytest.approx(0.0)
    shear = np.eye(3)
    shear[0, 1] = 1.5
    assert greatest_stretch(shear) == pytest.approx(2.0)
    assert greatest_stretch(np.stack([shear, np.eye(3)])) == pytest.approx([2.0, 1.0])


def test_files_for_paraview_hold_all_fields_on_one_grid(fields, tmp_path):
    written = write_fields(fields, tmp_path, displacement=20.0)
    assert all(path.exists() for path in written)
    (grid,) = ElementTree.parse(tmp_path / "fields.xdmf").findall("Domain/Grid")
    names = [attribute.get("Name") for attribute in grid.findall("Attribute")]
    assert names == ["displacement", "pressure", "von_mises", "stretch", "volume_ratio", "region"]
    assert float(grid.find("Time").get("Value")) == 20.0
