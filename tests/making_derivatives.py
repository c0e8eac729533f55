"""Derivatives against differences: of the residual, and of the force along a protocol."""

from __future__ import annotations

import numpy as np
from making_mechanics import fixed_steps

from legfem.fem.system import System
from legfem.solve.newton import NewtonSolver
from legfem.solve.protocol import Protocol
from legfem.solve.sensitivity import SensitivityTracker
from legfem.solve.settings import NewtonSettings
from legfem.solve.stepping import follow

PRECISE = NewtonSettings(relative_tolerance=1e-12, mixing=0)


def taylor_orders(system: System, largest: float = 4e-5) -> np.ndarray:
    """Return the orders in e of |R(u + e v) - R(u) - e K v| for a random v; they tend to 2."""
    sizes = largest / 2.0 ** np.arange(4)
    state = system.unknown.x.array.copy()
    v = np.random.default_rng(7).uniform(-1, 1, len(state))
    v[system.spaces.pinned] = 0.0
    if system.spaces.formulation != "displacement":
        pressure = system.spaces.space.sub(1).collapse()[1]
        v[pressure] *= 1e-3  # MPa
    K = system.assemble_tangent()
    right, product = K.createVecs()
    right.setArray(v)
    K.mult(right, product)
    base = system.assemble_residual().x.array.copy()
    remainders = []
    for size in sizes:
        system.unknown.x.array[:] = state + size * v
        moved = system.assemble_residual().x.array
        remainders.append(np.linalg.norm(moved - base - size * product.getArray()))
    system.unknown.x.array[:] = state
    return np.log2(np.array(remainders)[:-1] / remainders[1:])


def forces(system: System, values: dict[str, float], protocol: Protocol, size: float) -> np.ndarray:
    """Return the force after every step of a size (mm)."""
    system.set_parameters(values)
    found = []
    solver = NewtonSolver(system, PRECISE)
    report = follow(system, solver, protocol, fixed_steps(size), lambda *_: found.append(system.force()))
    assert report.complete, report
    return np.array(found)


def sensitivities(system: System, names, protocol: Protocol, size: float) -> np.ndarray:
    """Return the force's derivatives after every step (n, names)."""
    tracker, rows = SensitivityTracker(system, names), []
    solver = NewtonSolver(system, PRECISE)
    report = follow(system, solver, protocol, fixed_steps(size), lambda *_: rows.append(tracker.step(solver)))
    assert report.complete, report
    return np.array(rows)


def worst_error(system: System, values: dict[str, float], names, protocol: Protocol, size, change=1e-4) -> float:
    """Return the largest error relative to each parameter's largest derivative on the path.

    Differences are central, over ``change`` times a parameter, or ``change`` itself at zero.
    """
    system.set_parameters(values)
    exact = sensitivities(system, names, protocol, size)
    worst = 0.0
    for column, name in enumerate(names):
        by = change * (values[name] or 1.0)
        ahead = forces(system, {**values, name: values[name] + by}, protocol, size)
        behind = forces(system, {**values, name: values[name] - by}, protocol, size)
        difference = (ahead - behind) / (2 * by)
        error = np.abs(exact[:, column] - difference).max() / np.abs(difference).max()
        print(name, f"{error:.1e}")
        worst = max(worst, error)
    return worst
