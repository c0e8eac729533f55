r"""How stiff fat and muscle are, and how much people differ: a hierarchical fit.

With :math:`\theta_{ij} = (\ln C_{10}^{sup}, \ln C_{10}^{deep})` of person i at site j,

.. math:: \theta_{ij} \sim N(\mu_j + z_{ij} B_j + p_i, \Omega),\quad p_i \sim N(0, P),\quad
    \mu_j \sim N(M, S),\quad B_j \sim N(\bar B, \beta^2),

where z are the logarithms of both thicknesses over the site's own: stiffness may go with thickness,
because tissues do or because limbs aren't flat layers, which such data can't tell apart. And the
thickness lost by the superficial layer, and by both, are each seen with an error of
`BOUNDARY_SD_MM`: the two share the fascia's line in the image.

Gibbs' sampler draws M, :math:`\mu`, B, p and the covariances from their conditional distributions,
which are normal and inverse Wishart (A. Gelman et al., Bayesian Data Analysis, 3rd ed., 2013, ch.
15), and Metropolis' steps draw every :math:`\theta_{ij}`, all rows at once. There are twice as many
of these as rows, far too many for an ensemble's walkers (emcee), and the model is a table, of which
no derivative is to be had (NumPyro, PyMC).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from studies.people.data import Indentations
from studies.people.probe import Losses, allowed

BOUNDARY_SD_MM = 0.2
"""Of a boundary's motion in the images: two observers' changes of a layer's thickness, which has
two boundaries, differ by 0.19 to 0.32 mm (the data's page)."""
_DOF = 4
"""Of the covariances' prior, the least with a mean."""
_SPREAD = 0.3
"""Of people and sites, about which that prior lies (logarithms)."""
_WITHIN = 2.0
"""Standard deviation of M's prior about `_CENTRE`: hardly any."""
_CENTRE = float(np.log(5e-3))
_SLOPE_SD, _SITE_SLOPE_SD = 0.5, 0.3
"""Of the exponents with which C10 goes with thickness: of their mean about nothing, and of a site's
about that mean. A factor of two in thickness then changes C10 by a factor of up to two."""
_ADAPTED = 25


@dataclass(frozen=True, eq=False)
class State:
    """One draw."""

    theta: FloatArray
    """(n, 2): logarithms of C10 (MPa), superficial and deep, by row."""
    person: FloatArray
    """(people, 2): p."""
    site: FloatArray
    """(sites, 2): mu."""
    slope: FloatArray
    """(sites, 2, 2): B, by thickness and tissue."""
    mean_slope: FloatArray
    """(2, 2): the sites' mean of it."""
    mean: FloatArray
    """(2,): M."""
    between_sites: FloatArray
    """(2, 2): S."""
    between_people: FloatArray
    """(2, 2): P."""
    within: FloatArray
    """(2, 2): Omega."""

    @property
    def spread(self) -> FloatArray:
        """Covariance (2, 2) of people at one site."""
        return self.between_people + self.within

    def centre(self, rows: Indentations) -> FloatArray:
        """Return what rows' logarithms of C10 (n, 2) scatter about, but for the persons' own."""
        of_thickness = np.einsum("nz,nzk->nk", rows.relative_thickness, self.slope[rows.site])
        return np.asarray(self.site[rows.site] + of_thickness)


@dataclass(frozen=True, eq=False)
class Drawn:
    """Draws of a population, stacked: a `State`'s fields with the draws first."""

    states: Sequence[State]

    def __getitem__(self, name: str) -> FloatArray:
        return np.array([getattr(state, name) for state in self.states])


def draw_population(
    losses: Losses,
    kept: int,
    burn_in: int,
    rng: Generator,
    start: State | None = None,
    thin: int = 1,
    boundary_sd: float = BOUNDARY_SD_MM,
    with_thickness: bool = True,
) -> Drawn:
    """Draw from the posterior distribution.

    Parameters
    ----------
    losses
        Of the rows that count.
    kept, burn_in, thin
        Draws to keep, sweeps before, and sweeps between those kept.
    rng
        Source of randomness.
    start
        Of the chain; what its numbers of rows, people and sites were doesn't matter.
    boundary_sd
        Of the error of a boundary's motion, mm.
    with_thickness
        Whether stiffness may go with thickness; B is nothing otherwise.
    """
    rows = losses.rows
    state = _start(rows) if start is None else _fitted_to(start, rows)
    chain = _Chain(losses, boundary_sd, rng, with_thickness)
    step = np.full((len(rows), 2), 0.3)
    states = []
    for sweep in range(burn_in + kept * thin):
        theta, accepted = chain.rows_given(state, step)
        if sweep < burn_in:
            # Robbins and Monro's steps to an acceptance of 0.44, the best in one dimension.
            step = np.clip(step * np.exp((accepted - 0.44) / (1 + sweep / _ADAPTED)), 0.01, 3.0)
        state = chain.population_given(replace(state, theta=theta))
        if sweep >= burn_in and (sweep - burn_in) % thin == 0:
            states.append(state)
    return Drawn(states)


def _start(rows: Indentations) -> State:
    spread = _SPREAD**2 * np.eye(2)
    return State(
        np.full((len(rows), 2), _CENTRE),
        np.zeros((len(rows.people), 2)),
        np.full((len(rows.sites), 2), _CENTRE),
        np.zeros((len(rows.sites), 2, 2)),
        np.zeros((2, 2)),
        np.full(2, _CENTRE),
        spread,
        spread,
        spread,
    )


def _fitted_to(start: State, rows: Indentations) -> State:
    if len(start.theta) == len(rows):
        return start
    return replace(start, theta=start.centre(rows) + start.person[rows.person])


@dataclass(frozen=True, eq=False)
class _Chain:
    losses: Losses
    boundary_sd: float
    rng: Generator
    with_thickness: bool

    def log_likelihood(self, theta: FloatArray) -> FloatArray:
        """Return that of every row (n,)."""
        rows = self.losses.rows
        superficial, total = self.losses(theta)
        off = (rows.superficial_loss - superficial) ** 2 + (rows.superficial_loss + rows.deep_loss - total) ** 2
        return np.where(allowed(theta), -0.5 * off / self.boundary_sd**2, -np.inf)

    def rows_given(self, state: State, step: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return new logarithms of C10 (n, 2), and which steps were accepted (n, 2)."""
        rows, rng = self.losses.rows, self.rng
        centre = state.centre(rows) + state.person[rows.person]
        precision = np.linalg.inv(state.within)
        theta = state.theta
        likelihood = self.log_likelihood(theta)

        def prior(at: FloatArray) -> FloatArray:
            off = at - centre
            return -0.5 * ((off @ precision) * off).sum(axis=1)

        accepted = np.zeros(theta.shape)
        for k in range(2):
            trial = theta.copy()
            trial[:, k] += step[:, k] * rng.standard_normal(len(theta))
            new = self.log_likelihood(trial)
            better = new + prior(trial) - likelihood - prior(theta)
            taken = np.log(rng.random(len(theta))) < better
            theta = np.where(taken[:, None], trial, theta)
            likelihood = np.where(taken, new, likelihood)
            accepted[:, k] = taken
        # A row that tells little of its fat: a step to anywhere in the population.
        within = state.within
        slope = within[0, 1] / within[1, 1]
        sd = np.sqrt(within[0, 0] - slope * within[0, 1])
        trial = theta.copy()
        trial[:, 0] = centre[:, 0] + slope * (theta[:, 1] - centre[:, 1]) + sd * rng.standard_normal(len(theta))
        new = self.log_likelihood(trial)
        taken = np.log(rng.random(len(theta))) < new - likelihood
        return np.where(taken[:, None], trial, theta), accepted

    def population_given(self, state: State) -> State:
        """Return the state with all but the rows' own numbers drawn anew."""
        rows, rng = self.losses.rows, self.rng
        theta = state.theta
        inside = np.linalg.inv(state.within)
        of_thickness = state.centre(rows) - state.site[rows.site]
        left = theta - state.centre(rows)
        person = self._effects(left, rows.person, inside, state.between_people, np.zeros((len(rows.people), 2)))
        left, means = theta - of_thickness - person[rows.person], np.tile(state.mean, (len(rows.sites), 1))
        site = self._effects(left, rows.site, inside, state.between_sites, means)
        slope, mean_slope = state.slope, state.mean_slope
        if self.with_thickness:
            slope, mean_slope = self._slopes(theta - site[rows.site] - person[rows.person], inside, mean_slope)
        sites = np.linalg.inv(state.between_sites)
        whole = len(site) * sites + np.eye(2) / _WITHIN**2
        pull = sites @ site.sum(axis=0) + np.full(2, _CENTRE) / _WITHIN**2
        mean = rng.multivariate_normal(np.linalg.solve(whole, pull), np.linalg.inv(whole))
        # People without a row, as one who was left out, tell nothing of how people differ.
        seen = np.unique(rows.person)
        made = replace(state, person=person, site=site, slope=slope, mean_slope=mean_slope, mean=mean)
        return replace(
            made,
            between_sites=self._covariance(site - mean),
            between_people=self._covariance(person[seen]),
            within=self._covariance(theta - made.centre(rows) - person[rows.person]),
        )

    def _slopes(self, left: FloatArray, inside: FloatArray, mean_slope: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Draw B (sites, 2, 2) and its mean, of what of the rows (n, 2) is left for it."""
        rows, rng = self.losses.rows, self.rng
        z, count = rows.relative_thickness, len(rows.sites)
        squares, sums = np.zeros((count, 2, 2)), np.zeros((count, 2, 2))
        np.add.at(squares, rows.site, z[:, :, None] * z[:, None, :])
        np.add.at(sums, rows.site, z[:, :, None] * (left @ inside)[:, None, :])
        # The entries of B in a row, tissues last.
        held = np.eye(4) / _SITE_SLOPE_SD**2
        whole = np.einsum("jab,cd->jacbd", squares, inside).reshape(count, 4, 4) + held
        pull = (sums + mean_slope / _SITE_SLOPE_SD**2).reshape(count, 4)
        covariance = np.linalg.inv(whole)
        drawn = np.einsum("jab,jb->ja", covariance, pull) + np.einsum(
            "jab,jb->ja", np.linalg.cholesky(covariance), rng.standard_normal((count, 4))
        )
        slope = drawn.reshape(count, 2, 2)
        precision = count / _SITE_SLOPE_SD**2 + 1 / _SLOPE_SD**2
        middle = slope.sum(axis=0) / _SITE_SLOPE_SD**2 / precision
        return slope, middle + rng.standard_normal((2, 2)) / np.sqrt(precision)

    def _effects(
        self, left: FloatArray, group: NDArray[np.int64], inside: FloatArray, between: FloatArray, centres: FloatArray
    ) -> FloatArray:
        """Draw the means (count, 2) of groups of rows about centres, given the inverse of rows' covariance."""
        sums, count, outside = np.zeros(centres.shape), len(centres), np.linalg.inv(between)
        np.add.at(sums, group, left)
        members = np.bincount(group, minlength=count)
        whole = outside + members[:, None, None] * inside
        covariance = np.linalg.inv(whole)
        mean = np.einsum("gij,gj->gi", covariance, sums @ inside + centres @ outside)
        root = np.linalg.cholesky(covariance)
        return mean + np.einsum("gij,gj->gi", root, self.rng.standard_normal((count, 2)))

    def _covariance(self, off: FloatArray) -> FloatArray:
        """Draw a covariance (2, 2) of departures (m, 2): the inverse of a Wishart matrix."""
        scale = (_DOF - 3) * _SPREAD**2 * np.eye(2) + off.T @ off
        root = np.linalg.cholesky(np.linalg.inv(scale))
        made = self.rng.standard_normal((_DOF + len(off), 2)) @ root.T
        return np.linalg.inv(made.T @ made)
