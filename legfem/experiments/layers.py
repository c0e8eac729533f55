"""Tissues in layers, bonded to each other: fat on muscle on bone under a probe, a ball, a cup."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from legfem.common.units import FloatArray
from legfem.experiments.axisymmetric import AxisymmetricTest
from legfem.solve.report import SolveReport


@dataclass(frozen=True)
class Compressed:
    """Thickness that layers lose at the axis, and the force, by steps."""

    force: FloatArray
    """(n,), N."""
    lost: Mapping[str, FloatArray]
    """By the layer's name, from the base up; (n,), mm."""
    report: SolveReport

    @property
    def total(self) -> FloatArray:
        """Of all layers (n,), mm."""
        return np.asarray(sum(self.lost.values()))


def compress[Sizes](
    test: AxisymmetricTest[Sizes], depth: float, values: Mapping[str, float] | None = None
) -> Compressed:
    """Press to a depth, and tell how much each layer's thickness falls at the axis.

    Parameters
    ----------
    test
        On layers.
    depth
        Of what presses (mm).
    values
        Numbers that differ from the model's own, by full name.

    Returns
    -------
    Compressed
        As far as the solution came, from zero.
    """
    spaces = test.system.spaces
    nodes = spaces.displacement_space.tabulate_dof_coordinates()
    # The second component, along the axis, of the nodes on it at the layers' tops.
    dofs = [
        spaces.displacement_dofs[2 * int(np.argmin(np.hypot(nodes[:, 0], nodes[:, 1] - z))) + 1]
        for z in (*test.interfaces, test.arrangement.height)
    ]
    # Every attempt at the solution begins anew at small displacements.
    attempts: list[dict[float, FloatArray]] = []

    def look(at: float) -> None:
        if not attempts or at <= max(attempts[-1]):
            attempts.append({})
        unknown: fem.Function = test.system.unknown
        attempts[-1][at] = -np.asarray(unknown.x.array[dofs])

    solved = test.solve(values, depth=depth, on_step=look)
    steps = solved.path.displacement[1:].tolist()
    seen = next((one for one in attempts if list(one) == steps), {})
    sunk = np.array([np.zeros(len(dofs)), *seen.values()])
    lost = np.diff(sunk, axis=1, prepend=0.0).T
    return Compressed(solved.path.force[: len(sunk)], dict(zip(test.laws, lost, strict=True)), solved.report)
