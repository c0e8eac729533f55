"""Made-up people, from a model and distributions that aren't the study's."""

from __future__ import annotations

import numpy as np

from studies.people.data import Indentations, geometric_means
from studies.people.probe import HIGHEST, LOWEST, STRAINS, Losses, ProbeResponse

MEDIANS = np.log(np.array([[4e-3, 2e-3], [8e-3, 3e-3]]))
"""Superficial and deep C10 (MPa) at two sites."""


def stand_in(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the force's logarithm and the share at `STRAINS` of a simple layered body.

    Layers in a row that stiffen as 1 / (1 - strain), on which the force falls off with depth.
    """
    superficial, deep, ratio = np.exp(np.moveaxis(np.asarray(at), -1, 0))[..., None]
    # Of a layer between two depths: how much it gives under the pressure that spreads with depth.
    top, base = superficial / (1 + superficial), deep / (1 + superficial) / (1 + superficial + deep)
    soft = top / (4 * ratio) + base / 4
    strain = np.broadcast_to(STRAINS, soft.shape[:-1] + STRAINS.shape)
    force = np.pi * strain * (superficial + deep) / soft / (1 - strain)
    share = top / (4 * ratio) / soft * (superficial + deep) / superficial
    return np.log(force), np.broadcast_to(share, strain.shape)


def response(count: int = 9) -> ProbeResponse:
    """Return the stand-in through points of a grid."""
    axes = [np.linspace(low, high, count) for low, high in zip(LOWEST, HIGHEST, strict=True)]
    at = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return ProbeResponse(at, *stand_in(at))


def people(count: int, seed: int, noise: float = 0.2) -> tuple[Indentations, np.ndarray]:
    """Return rows of people at two sites, and the logarithms of C10 (n, 2) they were made with.

    People differ by skewed and heavy-tailed numbers, boundaries are read with uniform errors, and
    the strain is found by bisection in the stand-in itself.
    """
    rng = np.random.default_rng(seed)
    person, site = np.repeat(np.arange(count), 2), np.tile([0, 1], count)
    n = len(person)
    own = 0.25 * (rng.chisquare(4, (count, 2)) - 4) / np.sqrt(8)
    theta = MEDIANS[site] + own[person] + 0.3 * rng.standard_t(6, (n, 2)) / np.sqrt(1.5)
    superficial, deep = rng.uniform(4, 14, n), rng.uniform(15, 55, n)
    area = np.where(site == 0, 360.0, 675.0)
    radius = np.sqrt(area / np.pi)
    force = rng.uniform(4, 12, n)
    at = np.stack([np.log(superficial / radius), np.log(deep / radius), theta[:, 0] - theta[:, 1]], axis=1)
    log_force, share = stand_in(at)
    wanted = np.log(force / radius**2) - theta[:, 1]
    # F / (C10 a^2) = pi k e / (1 - e), so that e = y / (1 + y).
    y = np.exp(wanted - log_force[:, 0]) * STRAINS[0] / (1 - STRAINS[0])
    strain = y / (1 + y)
    total = strain * (superficial + deep)
    sunk = share[:, 0] * strain * superficial
    fascia, bone = noise * np.sqrt(3) * rng.uniform(-1, 1, (2, n))
    made = Indentations(
        tuple(f"{k:03d}" for k in range(count)),
        ("UA_A", "LL_P"),
        person,
        site,
        force,
        area,
        superficial,
        deep,
        sunk + fascia,
        total + bone - sunk - fascia,
        total * area / force,
        geometric_means(np.stack([superficial, deep], axis=1), site, 2),
    )
    return made, theta


def losses(rows: Indentations) -> Losses:
    """Return the stand-in's losses for rows."""
    return Losses.of(rows, response())
