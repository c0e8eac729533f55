"""Hertz' line contact: half-width and greatest pressure under a cylinder on a half-plane.

With the force P per length, E* = E / (1 - nu^2) and the radius R, a^2 = 4 P R / (pi E*) and
p0 = 2 P / (pi a), whatever the depth of the block: its approach depends on that, they don't.
"""

from __future__ import annotations

import numpy as np
import pytest
from making_mechanics import at_skin, block, contact_pressure, one_tissue, press, pressed_block

from legfem.fem.system import System
from legfem.mechanics.contact import ContactSettings
from legfem.solve.newton import NewtonSolver
from legfem.solve.settings import StepSettings

RADIUS = 400.0
C10, D1 = 1e-3, 200.0  # nu = 0.41
HALF_WIDTH = 1.0


def _plane_modulus() -> float:
    mu, K = 2 * C10, 2 / D1
    nu = (3 * K - 2 * mu) / (2 * (3 * K + mu))
    return 2 * mu * (1 + nu) / (1 - nu**2)


def _graded(finest: float, uniform: float, far: float, ratio: float = 1.6) -> np.ndarray:
    """Return coordinates from 0 to ``far``: equal up to ``uniform``, then growing."""
    points = list(np.arange(0, uniform + 1e-9, finest))
    step = finest
    while points[-1] < far:
        step *= ratio
        points.append(points[-1] + step)
    return np.array(points)


def _pressed(depth: float, finest: float, penetration: float) -> System:
    """Press the cylinder by ``depth``; the penalty gives the stated penetration under p0."""
    side, down = _graded(finest, 1.4 * HALF_WIDTH, 80.0), _graded(finest, 0.7 * HALF_WIDTH, 80.0)
    x, y = np.concatenate([-side[:0:-1], side]), -down[::-1]
    peak = _plane_modulus() * HALF_WIDTH / (2 * RADIUS)
    system = pressed_block(
        "mixed",
        ContactSettings(tangential="frictionless", onset=0.5 * penetration),
        one_tissue(C10, D1),
        RADIUS,
        penalty=peak / penetration,
        meshed=block(x, y),
    )
    report = press(system, NewtonSolver(system), [depth], StepSettings(first=depth / 8, largest=depth / 8))
    assert report.complete, report
    return system


def _half_width_and_peak(system: System) -> tuple[float, float]:
    """Fit p^2 = p0^2 (1 - x^2 / a^2) to the pressures at the skin's quadrature points."""
    pressure = contact_pressure(system)
    x = at_skin(system, system.skin.domain.relative_position)[:, 0]
    inside = pressure > 0.3 * pressure.max()
    slope, peak = np.polyfit(x[inside] ** 2, pressure[inside] ** 2, 1)
    return float(np.sqrt(-peak / slope)), float(np.sqrt(peak))


def _against_hertz(system: System) -> dict[str, float]:
    """Return relative errors, and the half-width itself (mm)."""
    P = system.force()
    a = np.sqrt(4 * P * RADIUS / (np.pi * _plane_modulus()))
    width, peak = _half_width_and_peak(system)
    pressure = contact_pressure(system)
    x = at_skin(system, system.skin.domain.relative_position)[:, 0]
    touching = np.abs(x[pressure > 0.02 * pressure.max()]).max()
    return {
        "a": a,
        "half-width": width / a - 1,
        "edge": touching / a - 1,
        "peak": peak / (2 * P / (np.pi * a)) - 1,
        "greatest": pressure.max() / (2 * P / (np.pi * a)) - 1,
    }


def test_half_width_and_peak_pressure():
    error = _against_hertz(_pressed(depth=0.006, finest=0.125, penetration=2e-5))
    assert 0.9 * HALF_WIDTH < error["a"] < 1.1 * HALF_WIDTH
    assert abs(error["half-width"]) < 0.01
    assert abs(error["peak"]) < 0.01
    assert abs(error["greatest"]) < 0.01
    assert abs(error["edge"]) < 0.02


@pytest.mark.slow
def test_errors_fall_with_mesh_and_penetration():
    coarse = _against_hertz(_pressed(depth=0.006, finest=0.1, penetration=2e-5))
    fine = _against_hertz(_pressed(depth=0.006, finest=0.05, penetration=1e-5))
    print(coarse, fine)
    for name in ("half-width", "peak"):
        assert abs(fine[name]) < 0.7 * abs(coarse[name])
        assert abs(fine[name]) < 0.004
