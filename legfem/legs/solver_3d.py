"""Full solves of a leg in 3D: what they say of P(d) and its errors, and which errors are left in them.

How stiff fibres are in tension is known to a factor of 2, alike at all sites. Their ratio is told from C10 by ways of
pressing that bend fibres unlike: a cylinder along the leg and one across, a punch, a ball. Pressed in one way alone,
only the bend of the curve could tell, and real fibres bend it otherwise than the model has it: a mode of
`legfem.inverse.fibre_ratio.SHAPE_SD_OF_FIBRES` says so.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from legfem.common.progress import Progress, Silent
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import DEEP_RATIO, IdentifiedLaw, Values
from legfem.inverse.correction import (
    FIBRES,
    FIRST_RATIO,
    TabulatedCorrection,
    first_contact_error,
    mesh_error,
    smooth_ratio,
)
from legfem.inverse.elastography import FibreRatio
from legfem.inverse.fibre_ratio import SHAPE_SD_OF_FIBRES
from legfem.inverse.joint_comparison import JointComparison
from legfem.inverse.outcome import Forward, FullSolver, Outcome
from legfem.inverse.search import SearchError
from legfem.inverse.searches import Found
from legfem.jobs.pool import Workers
from legfem.legs.details import SpatialSites
from legfem.legs.model_3d import ROUGHER, LegModels
from legfem.legs.subject import SitedLeg
from legfem.mechanics.terms import Fibres
from legfem.solve.path import ForceCurve

ROUGH_SOLVES = 2
"""That measure errors."""
_GRID = 0.5


@dataclass(frozen=True, eq=False)
class SolvedLeg:
    """The leg in 3D at one stiffness."""

    outcome: Outcome
    P: FloatArray
    """On the solver's grid, (n,)."""
    errors: dict[str, FloatArray]
    """Modes of P's error, (n,) each: of first contact, the mesh and the leg's length."""


@dataclass(eq=False)
class LegSolver:
    """Solves a leg in 3D; solves are kept where its models say.

    The errors of mesh and length are measured once, at the first stiffness: they change little
    with it.
    """

    models: LegModels
    progress: Progress
    full_solves: int = 0
    rough_solves: int = 0
    _lasting: dict[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Lay out the solvers."""
        models = self.models
        self._full, self._shorter = self._solver(models.full), self._solver(models.shorter)
        # A solve with derivatives keeps no states to go on from: the quicker one has them.
        fibres = () if models.fibres is None else models.muscle
        self._rough = self._solver(models.rough, tuple(name for one in fibres for name in Fibres(one).parameters))
        self.grid = np.linspace(0.0, models.depth, 1 + max(2, round(models.depth / _GRID)))

    @property
    def next_solves(self) -> int:
        """How many solves the next stiffness takes."""
        return 1 if self._lasting else 1 + ROUGH_SOLVES

    def at(self, values: Values, flat: ForceCurve) -> SolvedLeg:
        """Return the leg at values of the model in plane strain, whose force is ``flat``.

        Raises
        ------
        SearchError
            If a solve stops short of the depth.
        """
        outcome = self._solve(self._full, values)
        self.full_solves += 1
        P = smooth_ratio(outcome.curve, flat, self.grid)
        contact = first_contact_error(outcome.curve, flat, self.grid, P)
        return SolvedLeg(outcome, P, {"first contact": contact, **self.lasting(values, flat, P)})

    def lasting(self, values: Values, flat: ForceCurve, P: FloatArray) -> dict[str, FloatArray]:
        """Return modes of the error of P (n,) that are measured once: of mesh, length and fibres.

        Raises
        ------
        SearchError
            If a solve stops short of the depth.
        """
        if self._lasting:
            return self._lasting
        self.progress.stage("the same by larger elements, and shorter: what errors are left")
        curves = [self._solve(one, values).curve for one in (self._rough, self._shorter)]
        rough, shorter = (smooth_ratio(curve, flat, self.grid) for curve in curves)
        self.rough_solves = ROUGH_SOLVES
        self._lasting = {"mesh": mesh_error(P, rough, 1 / ROUGHER), "leg's length": shorter - rough}
        if self.models.fibres is not None:
            c10 = {one: values[f"{one}.C10"] for one in self.models.muscle}
            errors = fibre_errors(curves[0], self.models.fibres, c10, self.grid)
            self._lasting |= {name: (P - 1) * share for name, share in errors.items()}
        return self._lasting

    def _solve(self, solver: FullSolver, values: Values) -> Outcome:
        (outcome,) = solver.solve([values])
        if not outcome.complete:
            raise SearchError(
                f"the leg in 3D stops at {outcome.curve.depth:.1f} mm of "
                f"{self.models.depth:g} mm ({outcome.reason}); use less of the recordings' depth"
            )
        return outcome

    def _solver(self, model: Forward, sensitivities: tuple[str, ...] = ()) -> FullSolver:
        return FullSolver(model, self.models.kept, 1, self.progress, sensitivities)


FIBRE_ERRORS = (f"{FIBRES}ratio", f"{FIBRES}stiffness in tension")


def fibre_errors(
    curve: ForceCurve, fibres: FibreRatio, c10: Mapping[str, float], displacement: FloatArray
) -> dict[str, FloatArray]:
    """Return errors (n,) as shares of a leg's force: of the ratio, and of fibres in tension.

    How stiff fibres are in tension isn't known: a standard deviation is a factor of 2.

    Parameters
    ----------
    curve
        With the derivatives by the parameters of `legfem.mechanics.terms.Fibres` of these regions.
    fibres
        The ratio and its error.
    c10
        Across the fibres, MPa, of every region that has them.
    displacement
        (n,), mm. Before `legfem.inverse.correction.FIRST_RATIO` it is level.
    """
    at = np.maximum(displacement, min(FIRST_RATIO, curve.depth))
    at_two = [Fibres.of_ratio(region, value, 2.0) for region, value in c10.items()]
    by = {name: curve.sensitivity(name, at) for one in at_two for name in one.parameters}
    # In the ratio both moduli are linear, so that those at two are the derivatives.
    by_ratio = sum(value * by[name] for one in at_two for name, value in one.parameters.items())
    by_extension = sum(one.extension * by[f"{one.name}.extension"] for one in at_two)
    in_tension = by_extension * (fibres.value - 1) * np.log(2.0)
    return dict(zip(FIBRE_ERRORS, (by_ratio * fibres.sd / curve(at), in_tension / curve(at)), strict=True))


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
    """Return why the fibres' ratio cannot be distinguished from C10; empty where it can."""
    if ways_of_pressing(leg) > 1:
        return ""
    how = leg.sites[0].indenter
    where = "all sites are" if len(leg.sites) > 1 else "the leg is"
    return (
        f"The fibres' ratio cannot be distinguished from C10: {where} pressed in one way (by a {how}), and "
        "more of the one looks like more of the other. Press in another way too (a cylinder across "
        "the leg: axis_deg = 90; a punch, a ball), or state the ratio (fibre_ratio, "
        "[[elastography]])."
    )


def of_search(sites: SpatialSites, leg: SitedLeg, found: Found[JointComparison]) -> SpatialSites:
    """Return what is known of a leg's solves in 3D, with those of a law's finished search."""
    # Forces beside that along the travel are another way in which fibres show.
    alone = DEEP_RATIO in found.search.law.names and not found.search.misfit.channels
    untold = why_fibres_undetermined(leg) if alone else ""
    return replace(sites, full_solves=len(found.outcomes) * len(leg.sites), untold=untold)


def model_errors(
    leg: SitedLeg, models: Sequence[LegModels], found: Found[JointComparison], progress: Progress, jobs: int = 1
) -> tuple[tuple[TabulatedCorrection, ...], SpatialSites]:
    """Solve every site by larger elements and of a shorter leg, near an optimum.

    Returns corrections of every site that change nothing, with errors as shares of its force; and what the solves were
    of, and the greatest errors by cause.

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
        (_at_ratio(one, law, best.outcome.values), dict(best.outcome.values), curve)
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
        of_fibres = dict(share)
        of_model = {
            f"in 3D: mesh at {site.site or 'leg'}": of_fibres.pop("mesh"),
            "in 3D: leg's length": of_fibres.pop("leg's length"),
        }
        if DEEP_RATIO in law.names and why_fibres_undetermined(leg):
            of_fibres[f"{FIBRES}bend of the curve"] = SHAPE_SD_OF_FIBRES * grid / one.depth
        corrections.append(
            TabulatedCorrection(
                "none: the leg itself is solved in 3D",
                grid,
                np.array([1.0]),
                np.array([0.0]),
                np.zeros((1, 1, len(grid))),
                of_model | of_fibres,
                sources={**dict.fromkeys(of_model, "model"), **dict.fromkeys(of_fibres, "fibres")},
            )
        )
    legs = [one.leg for one in models]
    shapes, extruded = tuple(one.source for one in legs), any(one.extruded for one in legs)
    rough = sum(rough for _, _, rough in every)
    return tuple(corrections), SpatialSites(shapes, extruded, 0, rough, _greatest(corrections), "")


def _greatest(corrections: Sequence[TabulatedCorrection]) -> dict[str, float]:
    """Return the greatest share of a site's force by cause."""
    each = [(name, mode[one.displacement >= FIRST_RATIO]) for one in corrections for name, mode in one.errors.items()]
    return {name: max(float(np.abs(m).max(initial=0.0)) for n, m in each if n == name) for name, _ in each}


type _NearOptimum = tuple[LegModels, Values, ForceCurve]
"""A site's models, values and section near the optimum."""


def _at_ratio(models: LegModels, law: IdentifiedLaw, values: Values) -> LegModels:
    """Return a site's models with the fibres' ratio as it is near the optimum, if they have one."""
    every = {**law.nominal, **values}
    if DEEP_RATIO not in every:
        return models
    fibres = FibreRatio(every[DEEP_RATIO], 0.0, "assumed", "near the optimum")
    return replace(models, fibres=fibres)


def _left_at(progress: Progress, near: _NearOptimum) -> tuple[FloatArray, dict[str, FloatArray], int]:
    """Return a site's grid (mm), the modes that are left there, and how many solves that took."""
    models, values, curve = near
    solver = LegSolver(models, progress)
    share = solver.lasting(values, curve, np.zeros(len(solver.grid)))
    return solver.grid, share, solver.rough_solves
