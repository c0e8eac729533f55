"""A flat punch pressed into two layers, fat on muscle, on bone: what an ultrasound probe does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from dolfinx import fem

from legfem.common.checks import check_positive
from legfem.common.units import FloatArray
from legfem.experiments.axisymmetric import Arrangement, AxisymmetricTest, Faces
from legfem.experiments.flat_punch import PunchOnLayer, punch_arrangement
from legfem.mechanics.materials import Hyperelastic, NeoHookean
from legfem.solve.report import SolveReport


@dataclass(frozen=True)
class PunchOnLayers:
    """A rigid flat punch above a superficial layer that is bonded to a deep one on a rigid base.

    Parameters
    ----------
    superficial, deep : float
        Thicknesses (mm).
    radius : float
        Of the punch, the rounding of its edge included (mm).
    edge : float
        Radius of the rounding (mm).
    layer_radius : float
        Of the layers, whose side is free (mm).
    punch : {"frictionless", "rough"}
        Whether what touches the punch slides, as under gel, or sticks.
    base : {"bonded", "sliding"}
        Whether the deep layer sticks to its base; it doesn't lift off in either case.
    """

    superficial: float
    deep: float
    radius: float = 15.0
    edge: float = 2.0
    layer_radius: float = 75.0
    punch: Faces = "frictionless"
    base: Literal["bonded", "sliding"] = "bonded"

    def __post_init__(self) -> None:
        """Check the sizes."""
        check_positive(self, "superficial", "deep")
        _ = self.whole  # which checks the rest

    @property
    def whole(self) -> PunchOnLayer:
        """The same test on one layer as thick as both."""
        return PunchOnLayer(
            self.thickness, self.radius, self.edge, self.layer_radius, self.punch, self.base
        )

    @property
    def thickness(self) -> float:
        """Of both layers (mm)."""
        return self.superficial + self.deep


@dataclass(frozen=True)
class Compressed:
    """Thickness that the layers lose under the punch's middle, and the force, by steps."""

    force: FloatArray
    """(n,), N."""
    superficial: FloatArray
    """(n,), mm."""
    deep: FloatArray
    """(n,), mm."""
    report: SolveReport

    @property
    def total(self) -> FloatArray:
        """Of both layers (n,), mm."""
        return self.superficial + self.deep


@dataclass(frozen=True, eq=False)
class LayeredPunch(AxisymmetricTest[PunchOnLayers]):
    """The punch's test on two layers; ``law`` is the deep one's.

    Parameters
    ----------
    superficial_law
        Of the superficial layer, whose parameters are named ``superficial.C10`` and so on; the fat
        of Frauziols et al. (2015), Table 1, without it.
    """

    superficial_law: Hyperelastic = field(default_factory=lambda: NeoHookean(2e-3, 22.5))

    @property
    def laws(self) -> Mapping[str, Hyperelastic]:
        """Laws of both layers."""
        return {"superficial": self.superficial_law, "deep": self.law}

    @property
    def arrangement(self) -> Arrangement:
        """A punch above the layers."""
        return punch_arrangement(self.test.whole, self.settings, self.test.deep)

    def compress(self, depth: float, values: Mapping[str, float] | None = None) -> Compressed:
        """Press to a depth (mm), and tell how much each layer's thickness falls at the axis.

        Parameters
        ----------
        depth
            Of the punch (mm).
        values
            Numbers that differ from the model's own, by full name.

        Returns
        -------
        Compressed
            As far as the solution came, from zero.
        """
        spaces = self.system.spaces
        nodes = spaces.displacement_space.tabulate_dof_coordinates()
        heights = (self.test.thickness, self.test.deep)
        # The second component, along the axis, of the nodes on it.
        upper, lower = (
            spaces.displacement_dofs[2 * int(np.argmin(np.hypot(nodes[:, 0], nodes[:, 1] - z))) + 1]
            for z in heights
        )
        # Every attempt at the solution begins anew at small displacements.
        attempts: list[dict[float, tuple[float, float]]] = []

        def look(at: float) -> None:
            if not attempts or at <= max(attempts[-1]):
                attempts.append({})
            unknown: fem.Function = self.system.unknown
            attempts[-1][at] = -float(unknown.x.array[upper]), -float(unknown.x.array[lower])

        solved = self.solve(values, depth=depth, on_step=look)
        steps = solved.path.displacement[1:].tolist()
        seen = next((one for one in attempts if list(one) == steps), {})
        sunk = np.array([(0.0, 0.0), *seen.values()])
        force = solved.path.force[: len(sunk)]
        return Compressed(force, sunk[:, 0] - sunk[:, 1], sunk[:, 1], solved.report)
