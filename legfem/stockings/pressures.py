r"""Hydrostatic pressures inside a leg in its stocking: in fat, muscle, a section, and at the veins.

To first order, in equilibrium with the stocking, the pressure at a vein has the variance

.. math:: \sigma^2 = g^T \Sigma g + \sigma_p^2 \sum_s h_s^2 + (\sigma_m p)^2,

with :math:`g` its derivatives by the logarithms of the stiffnesses, :math:`\Sigma` their
covariance, :math:`h_s` those by the relative pressure of the stocking in each sector of the girth,
:math:`\sigma_p` that pressure's standard deviation (`legfem.stockings.contour_distances.ContourAccuracy`) and
:math:`\sigma_m` the mesh's relative error. All are taken as independent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import mpi4py.MPI  # noqa: F401  # first, see legfem.fem
import numpy as np
import shapely
from dolfinx import fem, geometry
from mpi4py import MPI
from scipy.stats import spearmanr

from legfem.common.units import FloatArray
from legfem.experiments.compression import Compressed, LegCompression
from legfem.fem.compat import cell_nodes
from legfem.geometry.leg_shape import HULL, SKIN, LegShape
from legfem.inverse.intervals import quantile
from legfem.stockings.equilibrium import PARAMETERS, RATE_TOLERANCE, Equilibrium, EquilibriumSolver, LinearisedCoupling
from legfem.stockings.fabric import StockingLoad
from legfem.stockings.leg import Vein
from legfem.stockings.nuisances import sectors

END_ZONE = 10.0
"""Length (mm) at either end of the segment that is left out of extremes and means: end faces disturb it."""


@dataclass(frozen=True, eq=False)
class TissuePressures:
    """Pressures in one compressed state, in MPa, positive in compression."""

    mean_interface: float
    """Pressure on the skin, mean over its area."""
    greatest_interface: float
    greatest_in_fat: float
    """Hydrostatic pressure; the paper's measure of discomfort."""
    greatest_in_fat_at: FloatArray
    """Place of it in the bare leg (3,), mm."""
    mean_in_muscle: float
    at_veins: tuple[float, ...]
    """Hydrostatic pressures in the veins' order; NaN outside the tissues."""
    at_veins_sd: tuple[float, ...] = ()
    """Standard deviations of `at_veins`, from the stiffness and the stocking's pressure; see
    `legfem.stockings.pressures`."""

    def vein_interval(self, vein: int) -> tuple[float, float]:
        """Return the 95 % interval of a vein's pressure, MPa; NaN where it isn't known."""
        half, middle = quantile(0) * self.at_veins_sd[vein], self.at_veins[vein]
        return middle - half, middle + half


class PressureProbe:
    """Evaluation of the hydrostatic pressure of states at points of the bare leg.

    Parameters
    ----------
    compression
        Problem in the formulation ``"continuous"``, whose unknown pressures are the mean Cauchy
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
        here = np.flatnonzero(np.diff(hits.offsets) > 0)
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
        nodes = np.unique(space.dofmap.list[self._spaces.cells(region)])
        x = space.tabulate_dof_coordinates()[nodes]
        values = -state.unknown[self._dofs[region]][nodes]
        x = np.concatenate(self._comm.allgather(x))
        values = np.concatenate(self._comm.allgather(values))
        inside = (x[:, 2] > x[:, 2].min() + END_ZONE) & (x[:, 2] < x[:, 2].max() - END_ZONE)
        return x[inside], values[inside]

    def section(self, shape: LegShape, level: float, equilibrium: Equilibrium) -> "SectionPressures":
        """Evaluate the pressure at a level (mm) of the bare leg; all ranks call."""
        outline = shape.at(SKIN, level)
        ends = zip(outline.min(axis=0) - 1.0, outline.max(axis=0) + 1.0, strict=True)
        x, y = (np.arange(low, high, SPACING) for low, high in ends)
        points = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), level)], axis=-1)
        values = self.at(points.reshape(-1, 3), equilibrium.state).reshape(len(y), len(x))
        return SectionPressures(level, x, y, values)

    def fat(self, shape: LegShape, equilibrium: Equilibrium) -> "FatPressures":
        """Sample the fat's thickness and pressures in an equilibrium; all ranks call."""
        inside = (shape.levels >= shape.levels[0] + END_ZONE) & (shape.levels <= shape.levels[-1] - END_ZONE)
        step = max(1, shape.contours[SKIN].shape[1] // AROUND)
        skin = shape.contours[SKIN][inside, ::step]
        hulls = zip(shape.contours[HULL][inside], skin, strict=True)
        foot = np.stack([_nearest(contour, points) for contour, points in hulls])
        columns = skin[..., None, :] + DEPTHS[:, None] * (foot - skin)[..., None, :]
        z = np.broadcast_to(shape.levels[inside, None, None, None], (*columns.shape[:3], 1))
        points = np.concatenate([columns, z], axis=-1)
        values = self.at(points.reshape(-1, 3), equilibrium.state).reshape(points.shape[:3])
        found = np.ma.masked_invalid(values)
        greatest, mean = found.max(axis=2).filled(np.nan), found.mean(axis=2).filled(np.nan)
        thickness, interface = np.linalg.norm(foot - skin, axis=-1), equilibrium.load.pressure[inside, ::step]
        return FatPressures(shape.levels[inside], skin, thickness, interface, greatest, mean)


def tissue_pressures(
    probe: PressureProbe, state: Compressed, load: StockingLoad, veins: Sequence[Vein]
) -> TissuePressures:
    """Return the pressures that the paper reports."""
    where, fat = probe.nodal("superficial", state)
    _, muscle = probe.nodal("deep", state)
    highest = int(np.argmax(fat))
    positions = np.array([vein.position for vein in veins]).reshape(-1, 3)
    at_veins = tuple(map(float, probe.at(positions, state))) if len(positions) else ()
    on_skin, in_fat = (load.mean_pressure, float(load.pressure.max())), (float(fat[highest]), where[highest])
    return TissuePressures(*on_skin, *in_fat, float(muscle.mean()), at_veins)


SPACING = 0.5
"""Spacing of a section's points (mm)."""


@dataclass(frozen=True, eq=False)
class SectionPressures:
    """Hydrostatic pressure on a grid in one level of the bare leg.

    Parameters
    ----------
    level : float
        Height, mm.
    x, y : (n,) and (m,) array
        Coordinates of the grid, mm.
    pressure : (m, n) array
        MPa; NaN outside the tissues.
    """

    level: float
    x: FloatArray
    y: FloatArray
    pressure: FloatArray


AROUND, DEPTHS = 60, np.linspace(0.06, 0.94, 9)
"""Columns of fat at a level, and the depths in them that are sampled, in shares of the thickness."""

_BY_MESH = ((16_679, 3.661), (61_606, 3.825), (191_506, 4.078), (496_489, 4.223))
"""Tetrahedra, and the greatest pressure in the fat (kPa) of one state of leg 1
(`python -m studies.stockings sizes`)."""


def too_low_by(tetrahedra: int) -> tuple[float, float]:
    """Return by which share the greatest pressure in the fat is too low on a mesh, (least, most).

    The peak lies in a few elements and grows as they shrink. As measured on leg 1: compared with
    the finest mesh, and with the extrapolation of the last two to an edge of length zero.
    """
    edges, pressures = np.array([(count ** (-1 / 3), pressure) for count, pressure in _BY_MESH]).T
    slope = (pressures[-2] - pressures[-1]) / (edges[-2] - edges[-1])
    limit = pressures[-1] - slope * edges[-1]
    # Coarser than all of them counts as the coarsest.
    here = np.interp(tetrahedra ** (-1 / 3), [0.0, *edges[::-1]], [limit, *pressures[::-1]])
    return max(0.0, float(1 - here / pressures[-1])), float(1 - here / limit)


@dataclass(frozen=True, eq=False)
class FatPressures:
    """Pressures in columns of fat, from the skin straight to the hull, all round the leg.

    Parameters
    ----------
    levels : (n_levels,) array
        Heights (mm), the segment's ends left out.
    skin : (n_levels, n_columns, 2) array
        Points of the bare skin at which the columns begin (mm).
    thickness : (n_levels, n_columns) array
        Thickness of the bare leg's fat, horizontally (mm).
    interface : (n_levels, n_columns) array
        Pressure on the skin, MPa.
    greatest, mean : (n_levels, n_columns) array
        Hydrostatic pressure in the column, MPa.
    """

    levels: FloatArray
    skin: FloatArray
    thickness: FloatArray
    interface: FloatArray
    greatest: FloatArray
    mean: FloatArray

    def rank_correlation(self, what: FloatArray, by: FloatArray) -> float:
        """Return Spearman's rank correlation of two arrays over all columns.

        It is NaN where one of them is constant, as on a round leg.
        """
        if np.nanmax(by) == np.nanmin(by) or np.nanmax(what) == np.nanmin(what):
            return np.nan
        return float(spearmanr(by.ravel(), what.ravel(), nan_policy="omit").statistic)


def _nearest(contour: FloatArray, points: FloatArray) -> FloatArray:
    """Return the points of a closed contour nearest to others, (n, 2)."""
    ring = shapely.LinearRing(contour)
    along = shapely.line_locate_point(ring, shapely.points(points))
    return np.asarray(shapely.get_coordinates(shapely.line_interpolate_point(ring, along)))


MESH_ERROR = 0.015
"""Standard deviation of the pressure at a vein by the mesh, relative: on the default mesh it is up
to 3 % from that of 30 times as many tetrahedra (`studies/stockings/README.md`)."""


def vein_pressure_sd(
    solver: EquilibriumSolver,
    near: Equilibrium,
    probe: PressureProbe,
    veins: Sequence[Vein],
    parameters: Mapping[str, float],
    log_covariance: FloatArray,
    pressure_sd: float,
    error: float = 0.0,
) -> FloatArray:
    """Return the standard deviations of the pressures at the veins, (n_veins,), MPa.

    Parameters
    ----------
    solver
        Of the leg.
    near
        Its equilibrium with derivatives by both stiffnesses, in which the model is.
    probe
        Evaluation of pressures on the leg's mesh.
    veins
        Places.
    parameters
        C10 of muscle and fat by name (MPa).
    log_covariance : (2, 2) or (3, 3) array
        Covariance of the stiffnesses' logarithms, and of the error of the fabric's tension; zeros if
        they were given, and count as exact.
    pressure_sd
        Relative standard deviation of the stocking's pressure in a sector of the girth.
    error
        Relative excess of the fabric's tension over what was given.

    Returns
    -------
    ndarray
        NaN where a vein isn't in the tissues.
    """
    if not veins:
        return np.empty(0)
    points = np.array([vein.position for vein in veins])
    coupling, model = LinearisedCoupling(solver, near), solver.model

    def slope(rate: FloatArray) -> FloatArray:
        # The unknown holds pressures, so that evaluating its derivative gives theirs.
        return probe.at(points, replace(near.state, unknown=coupling.rate(rate)))

    bumps = [near.pressure * bump for bump in sectors(model.shape)]
    rates = model.pressure_rates(near.state, bumps, RATE_TOLERANCE)
    by_sector = np.array([slope(rate) for rate in rates])
    variance = pressure_sd**2 * np.sum(by_sector**2, axis=0)
    variance = variance + (MESH_ERROR * probe.at(points, near.state)) ** 2
    stiffnesses = [parameters[name] * slope(near.state.sensitivities[name]) for name in PARAMETERS]
    # Bumps are of the pressure with the error in it.
    slopes = np.array([*stiffnesses, by_sector.sum(axis=0) / (1 + error)])[: len(log_covariance)]
    return np.asarray(np.sqrt(variance + np.einsum("iv,ij,jv->v", slopes, log_covariance, slopes)))
