r"""Nuisance parameters of the scan's fit, and the derivatives of the contours by them.

None of these is known exactly; each is a parameter of the fit with a prior, so that the intervals
of the stiffnesses include it. In this order: `RIGID` motions between the scans, the pressure's
error in `SECTORS` of the girth, the modes of the bare outlines' errors (skin, then hull;
`legfem.stockings.misfit`) and, where the fabric is uncertain, the relative error of its tension.

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

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from legfem.common.units import FloatArray
from legfem.geometry.curve import outward_normals
from legfem.geometry.leg_shape import SKIN, LegShape
from legfem.geometry.slices import distance_rates
from legfem.stockings.equilibrium import RATE_TOLERANCE, Worn, WornLeg
from legfem.stockings.leg_model import SURFACES
from legfem.stockings.misfit import ContourMisfit, outline_errors
from legfem.stockings.sensors import Sensing

RIGID, SECTORS = 6, 8
"""Motions of a scan; parts of the leg's girth in which the pressure errs alike."""


def nuisance_sd(misfit: ContourMisfit) -> FloatArray:
    """Return the standard deviations of motions (mm, rad) and pressure, (RIGID + SECTORS,)."""
    return np.concatenate([misfit.rigid_sd, np.full(SECTORS, misfit.accuracy.pressure_sd)])


def sectors(shape: LegShape) -> list[FloatArray]:
    """Return bumps round the leg that sum to one, each (n_levels, n_points)."""
    width = 2 * np.pi / SECTORS
    bumps = []
    for number in range(SECTORS):
        away = from_sector(shape.contours[SKIN], number)
        bumps.append(np.where(away < width, 0.5 * (1 + np.cos(np.pi * away / width)), 0.0))
    return bumps


def from_sector(contours: FloatArray, number: int) -> FloatArray:
    """Return the angle (rad) of points from a sector's middle, about their contours' middle.

    Parameters
    ----------
    contours : (n_levels, n_points, 2) array
        mm.
    number : int
        Of the sector, counter-clockwise from +x.
    """
    offset = contours - contours.mean(axis=1, keepdims=True)
    angle = np.arctan2(offset[..., 1], offset[..., 0])
    away: FloatArray = np.abs(np.mod(angle - 2 * np.pi * number / SECTORS + np.pi, 2 * np.pi))
    return np.abs(away - np.pi)


NEAR, FAR = 10.0, 35.0
"""Distance (mm) from the slices up to which errors of the bare outlines count in full, from which
not at all: what is wrong with the leg farther off hardly moves the slices."""
BUMP = 0.01
"""Greatest height (mm) of a mode, for a difference of pressures."""


@dataclass(frozen=True, eq=False)
class _Answer:
    """To changes of the pressure at fixed outlines, first the skin's modes', then the sectors'."""

    parameters: FloatArray
    """C10 of muscle and fat, MPa."""
    skin: FloatArray
    """In shares of its modes, (k, m)."""
    distances: FloatArray
    """(n, m)."""
    felt: FloatArray
    """By sensors, of the changes of the pressure; (s, m)."""


class NuisanceSlopes:
    """Slopes of the distances between a worn leg and its scan, by the tissues' stiffness.

    In the order of `legfem.stockings.nuisances`.

    Parameters
    ----------
    leg, misfit
        The leg and its scanned contours.
    sensing
        Its sensors.

    Attributes
    ----------
    errors : dict of str to OutlineErrors
        Of the bare skin and hull near the slices.
    """

    def __init__(self, leg: WornLeg, misfit: ContourMisfit, sensing: Sensing | None = None) -> None:
        self._leg, self._misfit, self._sensing = leg, misfit, sensing
        shape = leg.model.shape
        near = _near(shape.levels, misfit.target.levels)
        self.errors = {
            part: outline_errors(misfit.accuracy, shape.contours[part], shape.levels, near) for part in SURFACES
        }
        self._known: list[_Answer] = []
        self._rigid: FloatArray = np.empty((0, RIGID))
        self._direct: FloatArray = np.empty((0, 0))

    @property
    def sd(self) -> FloatArray:
        """Standard deviations of the priors, (RIGID + SECTORS + k,), and of the tension's."""
        outlines = sum(errors.count for errors in self.errors.values())
        tension = [self._misfit.accuracy.tension_sd] if self.of_tension else []
        return np.concatenate([nuisance_sd(self._misfit), np.ones(outlines), tension])

    @property
    def of_tension(self) -> bool:
        """Whether the fabric's tension may err all over, which is the last of the nuisances."""
        return self._misfit.accuracy.tension_sd > 0

    @property
    def learnt(self) -> int:
        """At how many stiffnesses the leg's answers were taken."""
        return len(self._known)

    def learn(self, parameters: FloatArray, worn: Worn) -> None:
        """Take the answers at a stiffness of muscle and fat (MPa), in the state found last."""
        model, shape = self._leg.model, worn.shape
        bumps = [worn.pressure * bump for bump in sectors(model.shape)]
        changes = [*self._pressures(worn), *bumps]
        rates = model.pressure_rates(worn.state, changes, RATE_TOLERANCE)
        moved = {part: np.stack([model.displacement(part, rate) for rate in rates], axis=-1) for part in SURFACES}
        outwards = np.einsum("lpd,lpdm->lpm", outward_normals(shape.contours[SKIN]), moved[SKIN][:, :, :2])
        if not self._known:
            self._rigid = self._misfit.rigid_slopes(shape)
            self._direct = self._as_they_are(shape)
        self._known.append(
            _Answer(
                np.array(parameters),
                self.errors[SKIN].shares(outwards),
                distance_rates(self._misfit.target, shape, moved),
                np.array([self._felt(change) for change in changes]).T,
            )
        )

    def at(self, parameters: FloatArray) -> FloatArray:
        """Return the slopes at a stiffness of muscle and fat (MPa), (n, RIGID + SECTORS + k).

        One more, of the fabric's tension, where that may err.

        Raises
        ------
        ValueError
            If none was learnt.
        """
        weights, skin = self._skin(parameters)
        distances = np.tensordot(weights, [answer.distances for answer in self._known], axes=1)
        count = self.errors[SKIN].count
        feedback = np.linalg.solve(np.eye(count) - skin[:, :count].T, distances[:, :count].T).T
        outlines = self._direct.copy()
        outlines[:, :count] += feedback
        pressure = distances[:, count:] + feedback @ skin[:, count:]
        return self._with_tension(np.hstack([self._rigid, pressure, outlines]))

    def of(self, reading: Callable[[FloatArray], FloatArray]) -> NuisanceSlopes:
        """Return the slopes of what is read off the distances (n, k), linearly, (m, k)."""
        other = copy(self)
        other._rigid, other._direct = reading(self._rigid), reading(self._direct)
        other._known = [replace(answer, distances=reading(answer.distances)) for answer in self._known]
        return other

    def felt(self, parameters: FloatArray) -> FloatArray:
        """Return the slopes of what sensors feel, MPa, (s, ...) as of `at`.

        What a shape changes of the pressure doesn't depend on the stiffness; what moves the shape
        does.
        """
        _, skin = self._skin(parameters)
        count = self.errors[SKIN].count
        felt = np.mean([answer.felt for answer in self._known], axis=0)
        feedback = np.linalg.solve(np.eye(count) - skin[:, :count].T, felt[:, :count].T).T
        pressure = felt[:, count:] + feedback @ skin[:, count:]
        outlines = np.zeros((len(felt), self._direct.shape[1]))
        outlines[:, :count] = feedback
        rigid = np.zeros((len(felt), RIGID))
        return self._with_tension(np.hstack([rigid, pressure, outlines]))

    def _skin(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return weights of what is known for a stiffness, and the skin's answers there."""
        if not self._known:
            raise ValueError("the leg's answers were not learnt at any stiffness")
        basis = _compliances(np.array([answer.parameters for answer in self._known]))
        weights = np.linalg.lstsq(basis.T, _compliances(parameters[None])[0], rcond=None)[0]
        return weights, np.tensordot(weights, [answer.skin for answer in self._known], axes=1)

    def _with_tension(self, slopes: FloatArray) -> FloatArray:
        """Add the slopes by a pressure that is wrong all round: the sectors' sum to one."""
        if not self.of_tension:
            return slopes
        return np.column_stack([slopes, slopes[:, RIGID : RIGID + SECTORS].sum(axis=1)])

    def _felt(self, pressure: FloatArray) -> FloatArray:
        return np.zeros(0) if self._sensing is None else self._sensing.felt(pressure)

    def _pressures(self, worn: Worn) -> list[FloatArray]:
        """Return the changes of Laplace's pressure by the skin's modes (MPa)."""
        errors, changes = self.errors[SKIN], []
        contours = worn.shape.contours[SKIN]
        normals = outward_normals(contours)
        for number in range(errors.count):
            mode = errors.modes[..., number]
            step = BUMP / float(np.abs(mode).max())
            bumped = {**worn.shape.contours, SKIN: contours + step * mode[..., None] * normals}
            ahead = self._leg.load(LegShape(worn.shape.levels, bumped))
            changes.append((ahead.pressure - worn.load.pressure) / step)
        return changes

    def _as_they_are(self, shape: LegShape) -> FloatArray:
        """Return the distances' slopes by errors of the outlines that nothing answers to."""
        slopes = []
        for part in SURFACES:
            modes = self.errors[part].modes
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
    """Return the compliances of the formula's three terms, relative to 1 kPa, (m, 3)."""
    muscle, fat = parameters.T
    return np.stack([1 / muscle, 1 / fat, 1 / np.sqrt(muscle * fat)], axis=1) * 1e-3
