"""Folders of several tests of one material: closed forms and felupe's cylinder, with errors that nobody assumes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path

import felupe as fem
import numpy as np
from scipy.interpolate import CubicSpline

C10, LENGTH, AREA = 5e-3, 20.0, 200.0
HEAD = 'id = "{name}"\ntitle = "Made for a test"\norigin = "measured"\n'
AT_TOUCH = "[accuracy]\ncontact_sd_mm = 0.0\n"
"""They are strained by nothing before they begin."""
RADIUS, HEIGHT = 12.0, 12.0
TABLES: Mapping[str, str] = {
    "tension": f'[uniaxial]\ndirection = "tension"\nlength_mm = {LENGTH}\narea_mm2 = {AREA}\n',
    "compression": f'[uniaxial]\ndirection = "compression"\nlength_mm = {LENGTH}\narea_mm2 = {AREA}\n',
    "shear": f"[simple_shear]\nheight_mm = {LENGTH}\narea_mm2 = {AREA}\n",
    "plates": f"[plates]\ndiameter_mm = {2 * RADIUS}\nheight_mm = {HEIGHT}\n",
}
DEEPEST: Mapping[str, float] = {"tension": 0.5, "compression": 0.35, "shear": 0.4}
"""Strains."""


def stress(test: str, strain: np.ndarray, c10: float, c20: float) -> np.ndarray:
    """Nominal stress (MPa) of an incompressible reduced polynomial, in the test's direction."""
    if test == "shear":
        return 2 * (c10 + 2 * c20 * strain**2) * strain
    stretch = 1 + strain if test == "tension" else 1 - strain
    slope = c10 + 2 * c20 * (stretch**2 + 2 / stretch - 3)
    return np.abs(2 * slope * (stretch - stretch**-2))


@cache
def pressed_by_felupe(cells: int = 24) -> tuple[np.ndarray, np.ndarray]:
    """Displacements (mm) and forces (N) of half a cylinder that sticks to its plate, at a C10 of 1 MPa."""
    mesh = fem.Rectangle(a=(0, 0), b=(HEIGHT / 2, RADIUS), n=(cells + 1, 2 * cells + 1))
    field = fem.FieldsMixed(fem.RegionQuad(mesh), n=3, axisymmetric=True)
    held = {
        "middle": fem.Boundary(field[0], fx=0, skip=(0, 1)),
        "axis": fem.Boundary(field[0], fy=0, skip=(1, 0)),
        "sticks": fem.Boundary(field[0], fx=HEIGHT / 2, skip=(1, 0)),
        "plate": fem.Boundary(field[0], fx=HEIGHT / 2, skip=(0, 1)),
    }
    fixed, free = fem.dof.partition(field, held)
    solid = fem.SolidBody(fem.ThreeFieldVariation(fem.NeoHooke(mu=2.0, bulk=2000.0)), field)
    depths, forces = np.linspace(0.0, 2.4, 9), [0.0]
    for depth in depths[1:]:
        held["plate"].value = -depth / 2
        to = fem.dof.apply(field, held, fixed)
        fem.newtonraphson(items=[solid], dof0=fixed, dof1=free, ext0=to, verbose=0)
        left = solid.assemble.vector(field).toarray()[: 2 * mesh.npoints].reshape(-1, 2)
        forces.append(-float(left[held["plate"].points, 0].sum()))
    return depths, np.array(forces)


def described(folder: Path, tests: Sequence[str]) -> Path:
    """Write the file that names the tests' folders."""
    folder.mkdir(parents=True, exist_ok=True)
    names = ", ".join(f'"{name}"' for name in tests)
    (folder / "specimen.toml").write_text(f"{HEAD.format(name='gel')}tests = [{names}]\n")
    return folder


def write_tests(
    folder: Path,
    tests: Sequence[str] = ("tension", "compression", "shear"),
    c10: float | Callable[[str], float] = C10,
    c20: float = 0.0,
    compliance: float = 0.0,
    seed: int = 1,
) -> Path:
    """Write tests of one material.

    Sizes are off by 1 %, gains by heavy-tailed 0.4 %; forces drift, have heavy-tailed noise, and come in steps. What
    presses the bar yields by ``compliance`` (mm/N).
    """
    drawn, n = np.random.default_rng(seed), 150
    for name in tests:
        stiffness = c10 if isinstance(c10, float) else c10(name)
        length, area = np.array([LENGTH, AREA]) * (1 + 0.01 * drawn.normal(size=2))
        if name == "plates":
            at, force = pressed_by_felupe()
            d = np.linspace(0.0, at[-1], n)
            force = stiffness * CubicSpline(at, force)(d)
        else:
            d = np.linspace(0.0, DEEPEST[name] * length, n)
            force = area * stress(name, d / length, stiffness, c20)
        if name == "compression":
            driven = d + compliance * force
            d = np.linspace(0.0, driven[-1], n)
            force = np.interp(d, driven, force)
        drift = np.sin(np.linspace(0.0, 6.0, n) + drawn.uniform(0, 6))
        errors = 2e-3 * force.max() * (drawn.standard_t(4, n) + drift)
        force = np.round(force * (1 + 0.004 * drawn.standard_t(4)) + errors, 4)
        (folder / name / "recordings").mkdir(parents=True, exist_ok=True)
        columns = np.column_stack([d / 0.2, d, force])
        header = "time_s,displacement_mm,force_N"
        path = folder / name / "recordings" / "a.csv"
        np.savetxt(path, columns, "%.7g", ",", header=header, comments="")
        text = f"{HEAD.format(name=name)}{TABLES[name]}[recordings]\nstarts_at_contact = true\n{AT_TOUCH}"
        (folder / name / "specimen.toml").write_text(text)
    return described(folder, tests)
