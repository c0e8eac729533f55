"""Errors that are left in the forces of a leg's sites in 3D: of mesh, length and fibres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from legfem.common.progress import Progress, Silent
from legfem.common.units import FloatArray
from legfem.correction.fibres import FIBRES
from legfem.correction.tabulated import FIRST_RATIO, TabulatedCorrection
from legfem.inverse.catalogue import DEEP_RATIO, Values
from legfem.inverse.comparison import JointComparison
from legfem.inverse.laws import IdentifiedLaw
from legfem.inverse.searches import Found
from legfem.jobs.pool import Workers
from legfem.legs.details import SpatialSites
from legfem.legs.elastography import FibreRatio
from legfem.legs.fibre_ratio import SHAPE_SD_OF_FIBRES
from legfem.legs.model_3d import LegModels
from legfem.legs.site_test import OF_MODEL
from legfem.legs.solver_3d import LegSolver
from legfem.legs.subject import SitedLeg
from legfem.solve.force_curve import ForceCurve

_UNLIKE_DEG = 30.0
"""By which cylinders have to lie otherwise to bend fibres otherwise."""


def ways_of_pressing(leg: SitedLeg) -> int:
    """Return how many ways a leg is pressed in, by which its fibres are bent otherwise."""
    shapes = {site.indenter.shape for site in leg.sites}
    turns = sorted(
        {abs((site.indenter.axis_deg + 90.0) % 180.0 - 90.0) for site in leg.sites if site.indenter.shape == "cylinder"}
    )
    unlike = len(turns) > 1 and turns[-1] - turns[0] >= _UNLIKE_DEG
    return len(shapes) + unlike


def why_fibres_undetermined(leg: SitedLeg) -> str:
    """Return why the fibres' ratio can't be told from C10; empty where it can."""
    if ways_of_pressing(leg) > 1:
        return ""
    how = leg.sites[0].indenter
    where = "all sites are" if len(leg.sites) > 1 else "the leg is"
    return (
        f"The fibres' ratio can't be told from C10: {where} pressed in one way (by a {how}), and "
        "more of the one looks like more of the other. Press in another way too (a cylinder across "
        "the leg: axis_deg = 90; a punch, a ball), or state the ratio (fibre_ratio, "
        "[[elastography]])."
    )


@dataclass(frozen=True, eq=False)
class ModelErrors:
    """What errors are left in a leg's force in 3D.

    Parameters
    ----------
    leg
        With its sites.
    modes
        Corrections of every site that change nothing, with errors as shares of its force.
    shapes, extruded, rough_solves
        As in `legfem.legs.details.SpatialSites`.
    """

    leg: SitedLeg
    modes: tuple[TabulatedCorrection, ...]
    shapes: tuple[str, ...]
    extruded: bool
    rough_solves: int

    def summary(self, found: Found[JointComparison]) -> SpatialSites:
        """Greatest errors by cause, with the solves of a law's search."""
        errors: dict[str, float] = {}
        for one in self.modes:
            for name, mode in one.errors.items():
                greatest = float(np.abs(mode[one.displacement >= FIRST_RATIO]).max(initial=0.0))
                errors[name] = max(errors.get(name, 0.0), greatest)
        solves = len(found.outcomes) * len(self.modes)
        untold = why_fibres_undetermined(self.leg) if DEEP_RATIO in found.search.law.names else ""
        return SpatialSites(self.shapes, self.extruded, solves, self.rough_solves, errors, untold)


def model_errors(
    leg: SitedLeg, models: Sequence[LegModels], found: Found[JointComparison], progress: Progress, jobs: int = 1
) -> ModelErrors:
    """Solve every site by larger elements and of a shorter leg, near an optimum.

    Parameters
    ----------
    leg, models
        The sites.
    found
        The search that came near.
    progress
        Told of solves, by this process.
    jobs
        Processes.

    Raises
    ------
    SearchError
        If a solve stops short of the depth.
    """
    law, best = found.search.law, found.best
    tasks = [
        _Near(_at_ratio(one, law, best.outcome.values), dict(best.outcome.values), curve)
        for one, curve in zip(models, best.outcome.curves, strict=True)
    ]
    told = progress
    if jobs > 1:
        told = Silent()
        progress.stage("all sites by larger elements, and shorter: what errors are left")
    with Workers(_left_at, told, jobs, along=True) as workers:
        every = list(workers.in_order(tasks))
    corrections = []
    for site, one, (grid, share, _) in zip(leg.sites, models, every, strict=True):
        errors = {
            f"{OF_MODEL}mesh at {site.site or 'leg'}": share["mesh"],
            f"{OF_MODEL}leg's length": share["leg's length"],
            **{name: mode for name, mode in share.items() if name.startswith(FIBRES)},
        }
        if DEEP_RATIO in law.names and why_fibres_undetermined(leg):
            errors[f"{FIBRES}bend of the curve"] = SHAPE_SD_OF_FIBRES * grid / one.depth
        corrections.append(
            TabulatedCorrection(
                "none: the leg itself is solved in 3D",
                grid,
                np.array([1.0]),
                np.array([0.0]),
                np.zeros((1, 1, len(grid))),
                errors,
            )
        )
    legs = [one.leg for one in models]
    return ModelErrors(
        leg,
        tuple(corrections),
        tuple(one.source for one in legs),
        any(one.extruded for one in legs),
        sum(rough for _, _, rough in every),
    )


@dataclass(frozen=True, eq=False)
class _Near:
    """A site near the optimum."""

    models: LegModels
    values: Values
    curve: ForceCurve


def _at_ratio(models: LegModels, law: IdentifiedLaw, values: Values) -> LegModels:
    """Return a site's models with the fibres' ratio as it is near the optimum, if they have one."""
    every = {**law.nominal, **values}
    if DEEP_RATIO not in every:
        return models
    fibres = FibreRatio(every[DEEP_RATIO], 0.0, "assumed", "near the optimum")
    return replace(models, fibres=fibres)


def _left_at(progress: Progress, near: _Near) -> tuple[FloatArray, dict[str, FloatArray], int]:
    """Return a site's grid (mm), the modes that are left there, and how many solves that took."""
    solver = LegSolver(near.models, progress)
    share = solver.lasting(near.values, near.curve, np.zeros(len(solver.grid)))
    return solver.grid, share, solver.rough_solves
