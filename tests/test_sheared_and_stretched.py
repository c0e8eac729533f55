"""Simple shear and equibiaxial tension: closed forms, derivatives, and the whole way from a table to a diagnosis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import ufl
from making_stress_tables import TRELOAR_BIAXIAL, TRELOAR_BIAXIAL_STRETCH, described, line_in, write_table
from scipy.optimize import brentq
from typer.testing import CliRunner
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives

import legfem as lf
from legfem.commands.identify import app
from legfem.common.errors import InputError
from legfem.experiments.homogeneous import HomogeneousTest
from legfem.mechanics.materials import ExponentialStiffening, NeoHookean, ReducedPolynomial, Yeoh
from legfem.specimens.kinds.equibiaxial import StretchedSheet
from legfem.specimens.kinds.simple_shear import ShearedBlock

C10 = 4e-3
SHEAR = 'table = { strain = "gamma", stress = "tau", unit = "kPa" }'
BIAXIAL = 'table = { stretch = "stretch", stress = "stress", unit = "kPa", measure = "nominal" }'
BLOCK, SHEET = ShearedBlock(10.0, 100.0), StretchedSheet(10.0, 100.0)
LAWS = [
    NeoHookean(C10, 80.0),
    ReducedPolynomial(C10, 80.0, C20=3e-3),
    Yeoh(C10, 80.0, C20=1e-3, C30=2e-3),
    ExponentialStiffening(C10, 80.0, C20=1e-3, stiffening=2e-3, exponent=1.5),
]


@pytest.mark.parametrize("body", [BLOCK, SHEET])
def test_a_neo_hookean_body_has_the_stress_of_the_closed_form(body) -> None:
    curve = HomogeneousTest(body, NeoHookean(C10, 1e-5)).solve(depth=6.0).curve
    strain = curve.displacement / 10.0
    stretch = 1 + strain
    exact = 2 * C10 * (strain if body is BLOCK else stretch - stretch**-5)
    assert np.abs(curve.force / 100.0 - exact).max() < 1e-6 * exact.max()


@pytest.mark.parametrize("body", [BLOCK, SHEET])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_the_stress_is_the_derivative_of_the_law_s_own_energy(body, law) -> None:
    """UFL differentiates the energy that finite elements use, at the body's deformation gradient."""
    test = HomogeneousTest(body, law)
    force = float(test.solve(depth=5.0).curve.force[-1])
    row, column = body.component
    free = _free_stretch(body, law)
    gradient = body.gradient(np.array([0.5]), np.full((len(body.free), 1), free))[0].real
    stress = _by_ufl(law, gradient)
    assert force / 100.0 == pytest.approx(stress[row, column], rel=1e-9)
    for axis in body.free:
        assert abs(stress[axis, axis]) < 1e-9 * force / 100.0


def _free_stretch(body, law) -> float:
    """Stretch at which UFL's stress across vanishes."""
    if not body.free:
        return 1.0

    def across(stretch: float) -> float:
        return _by_ufl(law, body.gradient(np.array([0.5]), np.array([[stretch]]))[0].real)[2, 2]

    return float(brentq(across, 0.2, 1.2, xtol=1e-15))


def _by_ufl(law, gradient: np.ndarray) -> np.ndarray:
    F = ufl.variable(ufl.as_matrix(gradient.tolist()))
    derivative = apply_derivatives(apply_algebra_lowering(ufl.diff(law.strain_energy(F), F)))
    return np.array([[float(derivative[i, j](())) for j in range(3)] for i in range(3)])


@pytest.mark.parametrize("body", [BLOCK, SHEET])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: type(law).__name__)
def test_derivatives_are_those_of_finite_differences(body, law) -> None:
    test = HomogeneousTest(body, law)
    names = [name for name, value in test.parameters.items() if np.isfinite(value)]
    curve = test.solve(None, 5.0, names).curve
    for name in names:
        step = 1e-5 * test.parameters[name]
        up, down = (test.solve({name: test.parameters[name] + sign * step}, 5.0).curve for sign in (1, -1))
        exact = curve.sensitivities[name]
        assert np.abs((up.force - down.force) / (2 * step) - exact).max() <= 1e-6 * np.abs(exact).max() + 1e-9, name


def sheared(folder: Path, noise: float = 0.0) -> Path:
    gamma = np.linspace(-0.02, -0.5, 30)  # of either sign, as rheometers write it
    tau = 2e3 * C10 * gamma * (1 + noise * np.random.default_rng(1).normal(size=30))
    return described(write_table(folder, "gamma,tau (kPa)", gamma, tau), "[simple_shear]", SHEAR)


def stretched(folder: Path) -> Path:
    stretch = np.linspace(1.0, 1.5, 30)
    stress = 2e3 * C10 * (stretch - stretch**-5)
    return described(write_table(folder, "stretch,stress (kPa)", stretch, stress), "[equibiaxial]", BIAXIAL)


@pytest.mark.parametrize("made", [sheared, stretched])
def test_a_table_gives_the_stiffness_that_it_was_made_with(tmp_path: Path, made) -> None:
    found = lf.identify(lf.load_specimen(made(tmp_path)), "neo-hookean")
    estimate = found["neo-hookean"].estimates["deep.C10"]
    assert estimate.value == pytest.approx(C10, rel=3e-3)
    assert estimate.ci95[0] < C10 < estimate.ci95[1]
    assert found["neo-hookean"].details.folder.recordings[0].sizes.body in (BLOCK, SHEET)


def test_a_table_of_shear_is_asked_about_with_the_line_that_reads_it(tmp_path: Path) -> None:
    described(sheared(tmp_path), "[simple_shear]")
    with pytest.raises(InputError) as error:
        lf.load_specimen(tmp_path)
    described(tmp_path, "[simple_shear]", line_in(error.value))
    assert len(lf.load_specimen(tmp_path).recordings) == 1


def test_fibres_that_would_shear_are_refused(tmp_path: Path) -> None:
    toml = sheared(tmp_path) / "specimen.toml"
    toml.write_text(toml.read_text() + '[fibres]\ndirection = "load"\n')
    with pytest.raises(InputError, match="breaks the symmetry of a block in simple shear; remove"):
        lf.load_specimen(tmp_path)


def test_rubber_of_1944_is_as_stiff_in_two_directions_as_others_find_it(tmp_path: Path) -> None:
    line = BIAXIAL.replace("kPa", "MPa")
    described(write_table(tmp_path, "stretch,stress", TRELOAR_BIAXIAL_STRETCH, TRELOAR_BIAXIAL), "[equibiaxial]", line)
    estimate = lf.identify(lf.load_specimen(tmp_path), "neo-hookean")["neo-hookean"].estimates["deep.C10"]
    assert 0.16 < estimate.value < 0.22


def test_the_command_writes_page_and_document_and_a_diagnosis_is_made(tmp_path: Path) -> None:
    folder = sheared(tmp_path / "block", 2e-3)
    done = CliRunner().invoke(app, ["--specimen-dir", str(folder), "--out", str(tmp_path / "out"), "--jobs", "1"])
    assert done.exit_code == 0, done.output
    page = (tmp_path / "out" / "report.html").read_text()
    assert "amount of shear" in page and "nominal stress (kPa)" in page
    diagnosis = lf.diagnose(lf.load_specimen(folder))
    assert diagnosis.verdicts == {"table": "consistent"}
    assert "no time" in diagnosis["table"].diagnosis.untested["viscoelasticity"]
