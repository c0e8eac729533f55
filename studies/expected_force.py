"""Envelopes of the force of random legs, by which the units of recordings are judged.

    python -m studies.expected_force --legs 73 --seed 11

prints two rows of coefficients as those in `legfem.legs.plausible_recordings`, which a first run of
the same legs gave.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated

import numpy as np
import typer
from scipy.optimize import linprog

from legfem.common.command_line import command_context
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings, Tissues
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection, depth_to_bone
from legfem.legs.loading import load_subject
from legfem.legs.placement import Calf, calf_section
from legfem.legs.plausible_recordings import SOFTEST_KPA, STIFFEST_C20_KPA, STIFFEST_KPA, features
from legfem.legs.schema import SUBJECTS
from legfem.mechanics.materials import NeoHookean, ReducedPolynomial
from legfem.meshing.section import SectionMeshSettings
from studies.command_line import new_app

app = new_app()
SLACK = 0.05
"""Of the logarithm, that a leg may lie beyond an envelope."""
type Leg = tuple[LegSection, Indenter, float, float, float, float]
"""Section, cylinder, C10 of fat and fascia (kPa), D1 (1/MPa), depth (mm)."""


@app.command()
def envelopes(
    legs: Annotated[int, typer.Option(min=20, help="Random legs.")] = 73,
    seed: Annotated[int, typer.Option(min=0, help="Of the legs.")] = 11,
) -> None:
    """Solve random legs, and print the envelopes of their forces.

    Example: python -m studies.expected_force --legs 73 --seed 11
    """
    with command_context():
        every = [*random_legs(legs, seed), *shipped_legs()]
        shipped = len(SUBJECTS.names)
        weights = [1.0] * legs + [legs / shipped] * shipped
        extremes = ((SOFTEST_KPA, 0.0, 1), (STIFFEST_KPA, STIFFEST_C20_KPA, -1))
        for c10, c20, sign in extremes:
            rows = [_curve(leg, c10, c20) for leg in every]
            weight = np.concatenate([np.full(len(f), w) for (_, f), w in zip(rows, weights, strict=True)])
            about = np.concatenate([a for a, _ in rows])
            force = np.concatenate([f for _, f in rows])
            found = linprog(-sign * (weight @ about), sign * about, sign * force + SLACK, bounds=(-20, 20))
            print(", ".join(f"{value:.3f}" for value in found.x))


def random_legs(number: int, seed: int) -> Iterator[Leg]:
    """Yield legs of all girths, fats and fasciae, pressed from anywhere."""
    rng = np.random.default_rng(seed)

    def between(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    made = 0
    while made < number:
        fat = between(1.2, 25)
        calf = Calf(
            fascia_thickness_mm=rng.uniform(0.2, min(1.5, 0.5 * fat)), girth_mm=rng.uniform(250, 450), fat_mm=fat
        )
        try:
            section = calf_section(calf)
        except InputError:  # the bones have no room
            continue
        angle, radius = rng.uniform(0, 360), between(9, 26)
        indenter = Indenter(radius, 50.0, rng.uniform(-5, 5, 2), angle)
        tissues = between(0.5, 20), between(10, 10_000), rng.uniform(5, 60)
        depth = min(30.0, 0.8 * depth_to_bone(section, indenter.aim, indenter.direction))
        if depth >= 6:
            made += 1
            yield section, indenter, *tissues, depth


def shipped_legs() -> Iterator[Leg]:
    """Yield the subjects that come with legfem."""
    for name in SUBJECTS.names:
        leg = load_subject(SUBJECTS.find(name), need_recordings=False)
        yield leg.section, leg.indenter, 2.0, 100.0, 22.5, 24.0


def _curve(leg: Leg, c10: float, c20: float) -> tuple[FloatArray, FloatArray]:
    """Return features, and logarithms of the force per length, at five depths."""
    section, indenter, fat, fascia, d1, depth = leg
    deep = ReducedPolynomial(1e-3 * c10, d1, 1e-3 * c20, math.inf)
    tissues = Tissues(deep, NeoHookean(1e-3 * fat, d1), NeoHookean(1e-3 * fascia, d1))
    settings = PlaneStrainSettings(SectionMeshSettings().refined(0.5), defences=False)
    curve = PlaneStrainIndentation(section, indenter, tissues, settings).solve(depth=depth).curve
    at = np.linspace(5.0, max(5.0, float(curve.displacement[-1])), 5)
    about = features(section, indenter, fat, fascia, d1, at)
    return about, np.log(np.maximum(curve(at), 1e-12) / indenter.length)


if __name__ == "__main__":
    app(prog_name="python -m studies.expected_force")
