"""Poroelastic drainage against Terzaghi's series for a column that is loaded at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import pytest
from dolfinx import fem
from making_derivatives import forces, taylor_orders, worst_error
from making_mechanics import COARSE, block, fixed_steps, free_of_contact, one_tissue, pressed_block, subject_3

from legfem.common.errors import InputError
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.fem.spaces import build_spaces
from legfem.fem.system import System
from legfem.mechanics.terms import Drainage
from legfem.meshing.section import SKIN
from legfem.solve.newton import NewtonSolver
from legfem.solve.protocol import Protocol
from legfem.solve.stepping import follow

TISSUES = one_tissue(1e-3, 28.0, C20=0.5e-3)
SMALL = block(np.linspace(-20, 20, 11), np.linspace(-20, 0, 6))
HELD = Protocol.ramp_and_hold(2.0, rate=1.0, hold=20.0)
FELT = {"deep.drainage.permeability": 50.0, "deep.drainage.skeleton": 0.1}


@pytest.fixture(scope="module")
def system() -> System:
    drainage = Drainage("deep", TISSUES.deep)
    return pressed_block("porous", tissues=TISSUES, meshed=SMALL, mechanisms=[drainage])


def test_it_vanishes_at_its_null(system):
    sealed = pressed_block("porous", tissues=TISSUES, meshed=SMALL)
    without = forces(sealed, sealed.model.parameters, HELD, 0.5)
    null = forces(system, system.model.parameters, HELD, 0.5)
    np.testing.assert_allclose(null, without, rtol=1e-10, atol=1e-14)
    held = null[4:]
    np.testing.assert_allclose(held, held[0], rtol=1e-8)


def test_a_skeleton_alone_changes_nothing_but_the_discretisation():
    """The difference falls with the mesh."""
    changes = []
    for n in (1, 2, 4):
        meshed = block(np.linspace(-20, 20, 10 * n + 1), np.linspace(-20, 0, 5 * n + 1))
        drainage = Drainage("deep", TISSUES.deep)
        system = pressed_block("porous", tissues=TISSUES, meshed=meshed, mechanisms=[drainage])
        values, ramp = system.model.parameters, Protocol.ramp(2.0, rate=1.0)
        without = forces(system, values, ramp, 0.5)[-1]
        with_it = forces(system, values | {"deep.drainage.skeleton": 0.1}, ramp, 0.5)[-1]
        changes.append(abs(with_it / without - 1))
    print(changes)
    assert changes[2] < 0.5 * changes[1] < 0.25 * changes[0] and changes[2] < 2e-3


def test_the_force_fades_while_fluid_flows(system):
    fading = forces(system, system.model.parameters | FELT, HELD, 0.5)[3:]
    print(fading / fading[0])
    assert (np.diff(fading) < 0).all() and fading[-1] < 0.97 * fading[0]


def test_the_tangent_is_the_residual_s_derivative(system):
    system.set_parameters(system.model.parameters | FELT)
    ramp = Protocol.ramp(1.5, rate=1.0)
    assert follow(system, NewtonSolver(system), ramp, fixed_steps(0.5)).complete
    system.set_displacement(1.9)
    system.set_time(1.9, 0.4)
    orders = taylor_orders(system)
    print(orders)
    np.testing.assert_allclose(orders, 2.0, atol=0.05)


def test_sensitivities_are_exact(system):
    names = ["deep.C10", "deep.D1", *FELT]
    assert worst_error(system, system.model.parameters | FELT, names, HELD, 0.5) < 1e-5


def test_a_discontinuous_pressure_is_refused():
    with pytest.raises(InputError, match="porous"):
        pressed_block("mixed", meshed=SMALL, mechanisms=[Drainage("deep", TISSUES.deep, 1.0)])


def test_facets_are_drained_in_a_porous_form_alone():
    with pytest.raises(InputError, match="porous"):
        build_spaces(*SMALL, "mixed", drained=[SKIN])


@pytest.mark.slow
def test_a_leg_loses_its_fat_s_fluid_through_a_drained_skin():
    section, indenter, tissues = subject_3()
    drainage = Drainage("superficial", tissues.superficial)
    held = Protocol.ramp_and_hold(6.0, rate=1.0, hold=60.0)
    mixed = PlaneStrainSettings(mesh=COARSE)
    without = PlaneStrainIndentation(section, indenter, tissues, mixed).solve(None, held).curve
    relaxed = []
    for drained in (False, True):
        settings = replace(mixed, formulation="porous", drained_skin=drained)
        leg = PlaneStrainIndentation(section, indenter, tissues, settings, mechanisms=[drainage])
        if not drained:
            assert leg.solve(None, held).curve(6.0) == pytest.approx(float(without(6.0)), rel=0.01)
        path = leg.solve({"superficial.drainage.permeability": 100.0}, held).path
        relaxed.append(path.force[-1] / path.force_at(6.0))
    print(relaxed)
    assert relaxed[1] < relaxed[0] < 0.995


# --- Terzaghi ---

HEIGHT, LOAD, PERMEABILITY = 10.0, 1e-7, 3.0


@dataclass(frozen=True)
class DeadLoad:
    """A pressure on the undeformed skin (MPa)."""

    name: str = "load"
    domain: Literal["skin"] = "skin"

    @property
    def parameters(self) -> dict[str, float]:
        return {"load.pressure": LOAD}

    def history(self, domain: Any) -> dict[str, tuple[int, ...]]:
        return {}

    def residual(self, skin: Any, history: Mapping[str, Any]) -> Any:
        return skin.symbols.scalar("load.pressure", LOAD) * skin.variation[1] * skin.measure

    def updated(self, skin: Any, history: Mapping[str, Any]) -> dict[str, Any]:
        return {}


def _column(skeleton: float) -> System:
    """A column with sealed, smooth sides and base, and a drained top."""
    meshed = block([0.0, 1.0], np.linspace(0, HEIGHT, 41))
    terms = [Drainage("deep", TISSUES.deep, PERMEABILITY, skeleton), DeadLoad()]
    model = free_of_contact(meshed, TISSUES, "porous", terms).model
    spaces = build_spaces(*meshed, "porous", drained=[SKIN])
    sideways = spaces.displacement_dofs.reshape(-1, 2)[:, 0]
    spaces = replace(spaces, pinned=np.union1d(spaces.pinned, sideways))
    return System(spaces, model, np.array([0.0, 1e3]), np.array([0.0, -1.0]))


def _series(y: np.ndarray, time: float, skeleton: float) -> np.ndarray:
    """Return the fluid's pressure over the load."""
    K, mu = TISSUES.deep.bulk_modulus, TISSUES.deep.shear_modulus
    drained, fluid = 4 * mu / 3 + skeleton * K, (1 - skeleton) * K
    consolidation = PERMEABILITY / (1 / drained + 1 / fluid)
    odd = 2 * np.arange(200)[:, None] + 1
    terms = 4 / (odd * np.pi) * np.where(odd % 4 == 1, 1, -1) * np.cos(odd * np.pi * y / 2 / HEIGHT)
    decay = np.exp(-(odd**2) * np.pi**2 * consolidation * time / (4 * HEIGHT**2))
    return fluid / (drained + fluid) * (terms * decay).sum(axis=0)


def _error(skeleton: float, steps: int) -> float:
    """Return the largest error of the pressure, over the load, from 1/10 of the duration on."""
    system = _column(skeleton)
    solver = NewtonSolver(system)
    system.reset()
    K, mu = TISSUES.deep.bulk_modulus, TISSUES.deep.shear_modulus
    drained = 4 * mu / 3 + skeleton * K
    duration = 0.6 * HEIGHT**2 / PERMEABILITY * (1 / drained + 1 / ((1 - skeleton) * K))
    space, dofs = system.spaces.space.sub(1).collapse()
    place = fem.Function(space)
    place.interpolate(lambda x: x[1])
    worst, now = 0.0, 0.0
    for share in np.linspace(0, 1, steps + 1)[1:] ** 2:
        system.set_time(share * duration, share * duration - now)
        now = share * duration
        assert solver.solve().converged
        system.advance()
        if share > 0.1:
            pressure = -system.unknown.x.array[dofs] / LOAD
            expected = _series(place.x.array, now, skeleton)
            worst = max(worst, float(np.abs(pressure - expected).max()))
    return worst


@pytest.mark.parametrize("skeleton", [0.0, 0.3])
def test_consolidation_follows_terzaghi_s_series(skeleton):
    """At first order in the step."""
    errors = [_error(skeleton, steps) for steps in (50, 100, 200)]
    print(errors)
    assert errors[-1] < 5e-3
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 1.0, atol=0.15)
