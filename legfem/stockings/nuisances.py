r"""Nuisance parameters of the scan's fit, and the derivatives of the contours by them.

None of these is known exactly; each is a parameter of the fit with a prior, so that the intervals
of the stiffnesses include it. In this order: `RIGID` motions between the scans, the pressure's
error in `SECTORS` of the girth, the modes of the bare outlines' errors (skin, then hull;
`legfem.stockings.contour_distances`) and, where the fabric is uncertain, the relative error of its tension.

The stocking presses on bumps and lets go of hollows, so that it flattens an error of the bare
outline, the more the softer the tissue. A fit that left that out would make the tissue too soft.
With :math:`e` the errors of the bare skin, :math:`L'` the derivative of Laplace's law by the skin's
shape and :math:`S` the derivative of the skin's shape by the pressure, the compressed skin errs by

.. math:: a = (1 - S L')^{-1} e

and the rest of the leg by :math:`S L' a`; errors of the hull stay as they are. :math:`S` is
computed at three stiffnesses of muscle and fat, :math:`m` and :math:`f`, and interpolated by

.. math:: S = S_1 / m + S_2 / f + S_3 / \sqrt{m f},

which is exact where both stiffnesses change by one factor.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.geometry.section import outward_normals
from legfem.geometry.slices import distance_rates
from legfem.stockings.contour_distances import ContourMisfit, amplitudes, error_modes
from legfem.stockings.equilibrium import RATE_TOLERANCE, SURFACES, Equilibrium, EquilibriumSolver
from legfem.stockings.leg import SensorArray

RIGID, SECTORS = 6, 8
"""Numbers of rigid motions between the scans, and of sectors of the girth with a pressure error."""
NEAR, FAR = 10.0, 35.0
"""Distances (mm) from the slices within which errors of the bare outlines count in full, and beyond
which they count nothing, since they hardly move the slices."""
BUMP = 0.01
"""Largest height (mm) of an outline's mode in the finite differences of Laplace's law."""


def sectors(shape: LegShape) -> list[FloatArray]:
    """Return raised cosines round the leg, one a sector, that sum to one; each (n_levels, n_points)."""
    away = [angle_from_sector(shape.contours[SKIN], number) for number in range(SECTORS)]
    # To the middles of the sectors beside it.
    share = np.minimum(np.array(away) / (2 * np.pi / SECTORS), 1.0)
    return list(0.5 * (1 + np.cos(np.pi * share)))


def angle_from_sector(contours: FloatArray, number: int) -> FloatArray:
    """Return the angle (rad) between points and a sector's middle, about their contours' centres.

    Parameters
    ----------
    contours : (n_levels, n_points, 2) array
        mm.
    number : int
        Sector, counted counter-clockwise from +x.
    """
    offset = contours - contours.mean(axis=1, keepdims=True)
    angle = np.arctan2(offset[..., 1], offset[..., 0])
    away: FloatArray = np.abs(np.mod(angle - 2 * np.pi * number / SECTORS + np.pi, 2 * np.pi))
    return np.abs(away - np.pi)


@dataclass(frozen=True, eq=False)
class _Response:
    """Linear response to pressures at fixed outlines: of each mode of the skin, then each sector."""

    parameters: FloatArray
    """C10 of muscle and fat, MPa."""
    skin: FloatArray
    """Skin's movement in amplitudes of its modes, (k, k + SECTORS)."""
    distances: FloatArray
    """Change of the distances to the scan, (n, k + SECTORS)."""
    sensed: FloatArray
    """The pressures themselves, averaged over the sensors' faces, (s, k + SECTORS)."""


class NuisanceSlopes:
    """Derivatives of distances and sensors' pressures by the nuisances, at any stiffness.

    `sample` has to be called at least at three stiffnesses before `at` or `of_sensors`.

    Parameters
    ----------
    solver, misfit
        The leg, and the contours of its scan.
    sensors
        Sensors under its stocking; none by default.

    Attributes
    ----------
    modes : dict of str to array
        Modes of the errors of the bare skin and hull near the slices, see `error_modes`.
    """

    def __init__(self, solver: EquilibriumSolver, misfit: ContourMisfit, sensors: SensorArray | None = None) -> None:
        shape = solver.model.shape
        self._solver, self._misfit = solver, misfit
        self._sensors = SensorArray.on(shape, ()) if sensors is None else sensors
        near = _near(shape.levels, misfit.target.levels)
        self.modes = {part: error_modes(misfit.accuracy, shape.contours[part], shape.levels, near) for part in SURFACES}
        self._samples: list[_Response] = []
        self._rigid: FloatArray = np.empty((0, RIGID))
        self._direct: FloatArray = np.empty((0, 0))

    @property
    def sd(self) -> FloatArray:
        """Standard deviations of the priors: mm, rad, relative pressures, 1 a mode, relative tension."""
        accuracy = self._misfit.accuracy
        modes = sum(one.shape[-1] for one in self.modes.values())
        rigid, tension = (*accuracy.shift_sd, *accuracy.turn_sd), [accuracy.tension_sd] if self.of_tension else []
        return np.concatenate([rigid, np.full(SECTORS, accuracy.pressure_sd), np.ones(modes), tension])

    @property
    def of_tension(self) -> bool:
        """Whether the fabric's tension is uncertain: then it is the last of the nuisances."""
        return self._misfit.accuracy.tension_sd > 0

    @property
    def samples(self) -> int:
        """Number of stiffnesses sampled."""
        return len(self._samples)

    def sample(self, parameters: FloatArray, equilibrium: Equilibrium) -> None:
        """Compute the leg's responses at C10 of muscle and fat (MPa), in the last equilibrium found."""
        model, shape = self._solver.model, equilibrium.shape
        bumps = [equilibrium.pressure * bump for bump in sectors(model.shape)]
        changes = [*self._pressures_of_modes(equilibrium), *bumps]
        rates = model.pressure_rates(equilibrium.state, changes, RATE_TOLERANCE)
        moved = {part: np.stack([model.displacement(part, rate) for rate in rates], axis=-1) for part in SURFACES}
        outwards = np.einsum("lpd,lpdm->lpm", outward_normals(shape.contours[SKIN]), moved[SKIN][:, :, :2])
        if not self._samples:
            self._rigid = self._misfit.rigid_slopes(shape)
            self._direct = self._uncoupled(shape)
        sensed = np.array([self._sensors.averages(change) for change in changes]).T
        skin, distances = amplitudes(self.modes[SKIN], outwards), distance_rates(self._misfit.target, shape, moved)
        self._samples.append(_Response(np.array(parameters), skin, distances, sensed))

    def at(self, parameters: FloatArray) -> FloatArray:
        """Return the distances' derivatives (n, len(sd)) at C10 of muscle and fat (MPa).

        Raises
        ------
        ValueError
            If no stiffness was sampled.
        """
        weights, skin = self._skin_response(parameters)
        distances = np.tensordot(weights, [sample.distances for sample in self._samples], axes=1)
        return self._coupled(distances, skin, self._rigid, self._direct)

    def mapped(self, linear: Callable[[FloatArray], FloatArray]) -> "NuisanceSlopes":
        """Return the same for a linear map of the distances, (n, k) to (m, k)."""
        other = copy(self)
        other._rigid, other._direct = linear(self._rigid), linear(self._direct)
        other._samples = [replace(sample, distances=linear(sample.distances)) for sample in self._samples]
        return other

    def without_sensors(self) -> "NuisanceSlopes":
        """Return the same where nothing was measured under the stocking."""
        other = copy(self)
        other._samples = [replace(sample, sensed=sample.sensed[:0]) for sample in self._samples]
        return other

    def of_sensors(self, parameters: FloatArray) -> FloatArray:
        """Return the derivatives (s, len(sd)) of the pressures at the sensors, MPa.

        The change of Laplace's pressure with the shape doesn't depend on the stiffness; how far the
        shape moves does.
        """
        _, skin = self._skin_response(parameters)
        sensed = np.mean([sample.sensed for sample in self._samples], axis=0)
        nothing = np.zeros((len(sensed), RIGID)), np.zeros((len(sensed), self._direct.shape[1]))
        return self._coupled(sensed, skin, *nothing)

    def _skin_response(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the samples' weights in the interpolation at a stiffness, and the skin's response."""
        if not self._samples:
            raise ValueError("the leg's responses were not sampled at any stiffness")
        basis = _compliances(np.array([sample.parameters for sample in self._samples]))
        weights = np.linalg.lstsq(basis.T, _compliances(parameters[None])[0], rcond=None)[0]
        return weights, np.tensordot(weights, [sample.skin for sample in self._samples], axes=1)

    def _coupled(self, response: FloatArray, skin: FloatArray, rigid: FloatArray, direct: FloatArray) -> FloatArray:
        """Return derivatives in equilibrium by rigid motions, sectors' pressures, outlines' modes, and the tension.

        Parameters
        ----------
        response : (n, k + SECTORS) array
            To pressures at a fixed skin.
        skin : (k, k + SECTORS) array
            The skin's own response, see `_Response`.
        rigid, direct : (n, RIGID), (n, modes) array
            By rigid motions, and by the outlines' modes as if the pressure didn't respond.
        """
        count, outlines = len(skin), direct.copy()
        by_modes = np.linalg.solve(np.eye(count) - skin[:, :count].T, response[:, :count].T).T
        outlines[:, :count] += by_modes
        by_pressure = response[:, count:] + by_modes @ skin[:, count:]
        # The fabric's tension acts as the sectors' sum, since these sum to one.
        by_tension = [by_pressure.sum(axis=1)] if self.of_tension else []
        return np.column_stack([rigid, by_pressure, outlines, *by_tension])

    def _pressures_of_modes(self, equilibrium: Equilibrium) -> list[FloatArray]:
        """Differentiate Laplace's pressure (MPa) by the modes of the skin's errors."""
        changes, shape = [], equilibrium.shape
        contours = shape.contours[SKIN]
        normals = outward_normals(contours)
        for mode in np.moveaxis(self.modes[SKIN], -1, 0):
            step = BUMP / float(np.abs(mode).max())
            bumped = {**shape.contours, SKIN: contours + step * mode[..., None] * normals}
            ahead = self._solver.load(LegShape(shape.levels, bumped))
            changes.append((ahead.pressure - equilibrium.load.pressure) / step)
        return changes

    def _uncoupled(self, shape: LegShape) -> FloatArray:
        """Differentiate the distances by the outlines' modes as if the pressure didn't respond."""
        slopes = []
        for part in SURFACES:
            modes = self.modes[part]
            rates = {p: np.zeros((*shape.contours[p].shape[:2], 3, modes.shape[-1])) for p in SURFACES}
            rates[part][:, :, :2] = outward_normals(shape.contours[part])[..., None] * modes[:, :, None]
            slopes.append(distance_rates(self._misfit.target, shape, rates))
        return np.hstack(slopes)


def _near(levels: FloatArray, slices: FloatArray) -> FloatArray:
    """Return 1 at levels near the slices, 0 far from them, (n_levels,)."""
    off = np.maximum(slices.min() - levels, levels - slices.max())
    share = np.clip((off - NEAR) / (FAR - NEAR), 0.0, 1.0)
    return np.asarray(0.5 * (1 + np.cos(np.pi * share)))


def _compliances(parameters: FloatArray) -> FloatArray:
    """Return the three functions of C10 (m, 2) that S is interpolated by, relative to 1 kPa, (m, 3)."""
    muscle, fat = parameters.T
    return np.stack([1 / muscle, 1 / fat, 1 / np.sqrt(muscle * fat)], axis=1) * 1e-3
