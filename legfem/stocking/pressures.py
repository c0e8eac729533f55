"""What a stocking's pressure becomes inside the leg: in the fat, in the muscle, at the veins."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem, geometry
from mpi4py import MPI

from legfem.common.units import FloatArray
from legfem.experiments.compression import Compressed, LegCompression
from legfem.fem.compat import cell_nodes
from legfem.stocking.laplace import StockingLoad
from legfem.stocking.veins import Vein

END_ZONE = 10.0
"""Length (mm) at either end of the segment whose extremes are the ends' doing, and don't count."""


@dataclass(frozen=True, eq=False)
class TissuePressures:
    """Pressures in one compressed state, in MPa, positive in compression."""

    mean_interface: float
    """Of the skin, over its area."""
    greatest_interface: float
    greatest_in_fat: float
    """Hydrostatic; the paper's measure of discomfort."""
    greatest_in_fat_at: FloatArray
    """(3,), mm, of the bare leg."""
    mean_in_muscle: float
    at_veins: tuple[float, ...]
    """Hydrostatic, in the veins' order."""
    at_veins_sd: tuple[float, ...] = ()
    """Standard deviations, from the stiffness and the stocking's pressure; see
    `legfem.stocking.vein_intervals`."""


class PressureProbe:
    """Hydrostatic pressure of a state at points of the bare leg.

    Parameters
    ----------
    compression
        The leg; in the formulation ``"continuous"``, whose unknown pressures are the mean Cauchy
        stresses.
    """

    def __init__(self, compression: LegCompression) -> None:
        spaces = compression.spaces
        self._spaces, self._comm = spaces, spaces.mesh.comm
        self._functions, self._dofs = {}, {}
        for number, region in enumerate(spaces.regions, 1):
            space, dofs = spaces.space.sub(number).collapse()
            self._functions[region] = fem.Function(space)
            self._dofs[region] = np.asarray(dofs).ravel()
        mesh = spaces.mesh
        self._tree = geometry.bb_tree(mesh, mesh.topology.dim)
        self._region_of_cell = np.zeros(len(cell_nodes(mesh)), dtype=np.int32)
        self._region_of_cell[spaces.cell_tags.indices] = spaces.cell_tags.values

    def at(self, points: FloatArray, state: Compressed) -> FloatArray:
        """Return the pressure (MPa) at points (n, 3), NaN outside the tissues."""
        points = np.ascontiguousarray(points, dtype=np.float64)
        mesh = self._spaces.mesh
        candidates = geometry.compute_collisions_points(self._tree, points)
        hits = geometry.compute_colliding_cells(mesh, candidates, points)
        counts = np.diff(hits.offsets)
        here = np.flatnonzero(counts > 0)
        cells = hits.array[hits.offsets[here]]
        found = np.full(len(points), -np.inf)
        for region, tag in self._spaces.regions.items():
            self._functions[region].x.array[:] = -state.unknown[self._dofs[region]]
            chosen = self._region_of_cell[cells] == tag
            if chosen.any():
                values = self._functions[region].eval(points[here[chosen]], cells[chosen])
                found[here[chosen]] = np.asarray(values).reshape(-1)
        everywhere = np.empty_like(found)
        self._comm.Allreduce(found, everywhere, MPI.MAX)
        return np.where(np.isfinite(everywhere), everywhere, np.nan)

    def nodal(self, region: str, state: Compressed) -> tuple[FloatArray, FloatArray]:
        """Return the nodes (n, 3) and pressures (n,) of a region on all ranks, ends left out."""
        space = self._functions[region].function_space
        cells = self._spaces.cell_tags.find(self._spaces.regions[region])
        nodes = np.unique(space.dofmap.list[cells])
        x = space.tabulate_dof_coordinates()[nodes]
        values = -state.unknown[self._dofs[region]][nodes]
        x = np.concatenate(self._comm.allgather(x))
        values = np.concatenate(self._comm.allgather(values))
        inside = (x[:, 2] > x[:, 2].min() + END_ZONE) & (x[:, 2] < x[:, 2].max() - END_ZONE)
        return x[inside], values[inside]


def tissue_pressures(
    probe: PressureProbe, state: Compressed, load: StockingLoad, veins: Sequence[Vein]
) -> TissuePressures:
    """Return the pressures that the paper reports."""
    where, fat = probe.nodal("superficial", state)
    _, muscle = probe.nodal("deep", state)
    highest = int(np.argmax(fat))
    positions = np.array([vein.position for vein in veins]).reshape(-1, 3)
    return TissuePressures(
        load.mean_pressure,
        float(load.pressure.max()),
        float(fat[highest]),
        where[highest],
        float(muscle.mean()),
        tuple(map(float, probe.at(positions, state))) if len(positions) else (),
    )
