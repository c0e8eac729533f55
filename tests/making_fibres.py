"""Folders of bars cut along their fibres and across, from closed forms of incompressible tissue."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from making_specimens import AREA, BAR, LENGTH, ramp, record
from scipy.optimize import brentq

from legfem.experiments.bodies import BallOnLayer, CylinderBetweenPlates, CylinderOnBlock
from legfem.inverse.fibre_ratio import ratio_of
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.laws import SpecimenTissue
from legfem.specimens.sizes import Sizes

C10, C20 = 5e-3, 2e-3
PULLED = BAR.replace('"compression"', '"tension"')
BLOCK = CylinderOnBlock(20.0, 60.0, 40.0, 8.0)
BALL = BallOnLayer(12.0, 5.0, 40.0)
PLATES = CylinderBetweenPlates(10.0, 10.0)
TISSUE = SpecimenTissue(law="neo-hookean", fibrous=True)
SOFT = 4e-3
"""MPa: above it a bulk modulus follows C10."""
RATIO = ratio_of("deep")


def forward(sizes: Sizes, depth: float, tissue: SpecimenTissue = TISSUE) -> SpecimenForward:
    return SpecimenForward(sizes, depth, (tissue,), SOFT)


def pulled(ratio: float, direction: str, displacement: np.ndarray, c20: float = 0.0) -> np.ndarray:
    """Return the force (N) on an incompressible bar, its width across in equilibrium."""
    extension = 8 * C10 * (ratio - 1)

    def slope(*stretches: float) -> float:
        return C10 + 2 * c20 * (np.sum(np.square(stretches)) - 3)

    def nominal(along: float) -> float:
        if direction == "load":
            thin = along**-0.5
            isotropic = 2 * slope(along, thin, thin) * (along - along**-2)
            return isotropic + extension / 2 * (along**2 - 1) * along

        def left(fibre: float) -> float:
            other = 1 / (along * fibre)
            free = 2 * slope(along, fibre, other) * (fibre - other**2 / fibre)
            return free + extension / 2 * (fibre**2 - 1) * fibre

        fibre = brentq(left, 0.2, 3.0, xtol=1e-14)
        other = 1 / (along * fibre)
        return 2 * slope(along, fibre, other) * (along - other**2 / along)

    return AREA * np.array([nominal(1 + d / LENGTH) for d in displacement])


def write_fibrous(
    folder: Path,
    ratio: float,
    specimens: Sequence[tuple[str, float]],
    table: str = "[fibres]\n",
    tissue: str = "[tissue]\none_stiffness = true\n",
    names: Sequence[str] = (),
) -> Path:
    """Write a folder of bars of directions, each with its factor on the stiffness."""
    entries = ""
    for k, (direction, factor) in enumerate(specimens):
        time, d = ramp(2.5, 10.0)
        record(folder, f"bar{k}", time, d, factor * pulled(ratio, direction, d))
        own = names[k] if names else f"bar{k}"
        entries += f'[[specimen]]\nname = "{own}"\nfibres = "{direction}"\n'
        entries += f'recordings = ["recordings/bar{k}.csv"]\n'
    (folder / "specimen.toml").write_text(PULLED + table + tissue + entries)
    return folder
