r"""Identification of a leg in 3D from one or several of its sites, each as it was pressed.

The search goes on full solves of every site in 3D with their exact derivatives: an emulator that is
drawn through them leads from one to the next (`legfem.inverse.search`), some four to eight
of them. Once, near the optimum, every site is solved by larger elements and of a shorter leg; what
that changes is an error that the weights and the intervals carry, the mesh's of each site by itself
and the length's alike at all.

**Fibres.** Their ratio is told from C10 by ways of pressing that bend fibres unlike: a cylinder
along the leg and one across, a punch, a ball. Pressed in one way alone, only the bend of the curve
could tell, and real fibres bend it otherwise than the model has it: a mode of
`legfem.inverse.fibre_ratio.SHAPE_SD_OF_FIBRES` says so. How stiff fibres are in tension is known
to a factor of 2, alike at all sites.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from legfem.common.progress import Progress, Silent
from legfem.common.units import FloatArray
from legfem.data import LoadingCurve
from legfem.experiments.leg_3d import SolidLegSettings
from legfem.inverse.catalogue import DEEP_RATIO, IdentifiedLaw, LawName, Values
from legfem.inverse.comparison import JointComparison
from legfem.inverse.fibre_ratio import SHAPE_SD_OF_FIBRES
from legfem.inverse.fit import Fit
from legfem.inverse.outcome import ForwardModel, JointForward, Outcome, solve_test
from legfem.inverse.searches import Found, Searches
from legfem.inverse.settings import SearchRequest
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store
from legfem.legs.correction import FIRST_RATIO, TabulatedCorrection
from legfem.legs.correction_of_leg import FIBRES
from legfem.legs.details import LegDetails, SpatialSites
from legfem.legs.elastography import FibreRatio
from legfem.legs.laws import laws_of
from legfem.legs.model_3d import SOLVES, LegModels, SpatialForward
from legfem.legs.problem import LegProblem, split_instrument
from legfem.legs.site_channels import site_channels
from legfem.legs.site_test import OF_MODEL, SiteTest, measured_curve, with_instrument_errors
from legfem.legs.solver_3d import LegSolver
from legfem.legs.subject import SitedLeg, Subject
from legfem.solve.path import ForceCurve

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
        # Forces beside that along the travel are another way in which fibres show.
        alone = DEEP_RATIO in found.search.law.names and not found.search.misfit.channels
        untold = why_fibres_undetermined(self.leg) if alone else ""
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


MOST_SOLVES = 12
"""Of all sites together, with a law."""
FIRST_SOLVES = 3
"""After which errors are measured, near enough to the optimum."""


def fit_in_3d(
    leg: SitedLeg,
    laws: Sequence[LawName],
    request: SearchRequest | None = None,
    settings: SolidLegSettings | None = None,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    models: Sequence[LegModels] | None = None,
) -> list[Fit[LegDetails]]:
    """Fit tissues, and the ratio of muscle's fibres, that all sites of a leg share.

    Parameters
    ----------
    leg : SitedLeg
        With recordings at every site; one site does.
    laws : sequence of str
        Of the deep tissue: ``neo-hookean``, ``reduced-polynomial``.
    request : SearchRequest, optional
        As for `legfem.legs.problem.leg_problem`; ``deep.fibre_ratio`` can be among its
        parameters. So many of its sites as it has jobs are solved side by side.
    settings : SolidLegSettings, optional
        Numerical.
    comm : MPI.Intracomm
        Over which every solve is spread, one after another if it has several ranks.
    models : sequence of LegModels, optional
        One a site, see `leg_models`.

    Raises
    ------
    InputError
        If a site's shape can't be had or meshed, its recordings can't be used, or there is no
        parameter of a name.
    SearchError
        If too few full solves reach the measured depths.
    """
    request = request or SearchRequest()
    parameters, own_errors = split_instrument(request.parameters, request.fixed)
    curves = [with_instrument_errors(measured_curve(site, request.depth), own_errors) for site in leg.sites]
    models = models or leg_models(leg, curves, request, settings, comm)
    kept = tuple(_kept(one) for one in models)
    jobs = min(request.jobs, len(models)) if comm.size == 1 else 1
    unknowns = laws_of(leg.sites[0], laws, kept[0].nominal, parameters, request.fixed)
    tests = tuple(
        SiteTest(site, curve, beside=site_channels(site, curve, "3d"))
        for site, curve in zip(leg.sites, curves, strict=True)
    )
    problem = LegProblem(leg, tests, JointForward(kept), unknowns, "covariance", own_errors)
    with (
        Workers(solve_test, kept, jobs, along=True) as workers,
        replace(request, jobs=1).solver(JointForward(kept, workers), problem.sensitivities) as solver,
    ):
        free = JointComparison(tests)
        few = replace(request.settings, most_solves=FIRST_SOLVES)
        most = max(laws, key=lambda name: len(unknowns[name].parameters))
        (start,) = Searches(unknowns, solver, few, lambda law: free).find([most])
        errors = model_errors(leg, models, start, request.progress, jobs)
        problem = replace(problem, spatial=errors.summary).corrected(errors.modes)
        near = problem.comparison(start.search.law, (start.best.values, start.linear.prediction.values))
        settled = replace(request.settings, most_solves=MOST_SOLVES)
        searches = Searches(unknowns, solver, settled, lambda law: near, {most: start.search})
        found = searches.find(laws)
    return [problem.assessed(one) for one in found]


@dataclass(eq=False)
class KeptForward:
    """A model of one site whose every solve is kept, so that a killed run loses only one.

    Parameters
    ----------
    model
        Of the site.
    store
        Where; nowhere without it.
    """

    model: ForwardModel
    store: Store[Outcome] | None

    @property
    def nominal(self) -> Values:
        """All values of the model as assumed."""
        return self.model.nominal

    def prepare(self) -> None:
        """Mesh and compile now."""
        if isinstance(self.model, SpatialForward):
            self.model.prepare()

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Solve in full, or return what was kept."""

        def made() -> Outcome:
            return self.model.solve(values, sensitivities)

        if self.store is None:
            return made()
        return self.store.get_or_make((values, sensitivities), made)

    def fingerprint(self) -> Mapping[str, Any]:
        """Return what a solve depends on."""
        return self.model.fingerprint()


def leg_models(
    leg: SitedLeg,
    curves: Sequence[LoadingCurve],
    request: SearchRequest,
    settings: SolidLegSettings | None = None,
    comm: MPI.Intracomm = MPI.COMM_SELF,
) -> list[LegModels]:
    """Return the models in 3D of a leg's sites, each pressed as deep as its curve goes.

    Raises
    ------
    InputError
        If a site's shape can't be had.
    """
    kept = None if request.out is None else request.out / SOLVES
    ratio = seeks_ratio(leg.sites[0], request)
    return [
        LegModels.of_subject(site, float(curve.displacement[-1]), kept, settings, request.progress, comm, ratio)
        for site, curve in zip(leg.sites, curves, strict=True)
    ]


def seeks_ratio(subject: Subject, request: SearchRequest) -> bool:
    """Return whether the ratio of the muscle's fibres is among what is free, or held by request."""
    named = {one.name for one in request.parameters or ()} | set(request.fixed)
    return DEEP_RATIO in named or (subject.fibres is not None and subject.fibres.sd > 0)


def _kept(models: LegModels) -> KeptForward:
    model = models.full
    store = None
    if models.kept is not None:
        store = Store(models.kept, Outcome, model.fingerprint())
    return KeptForward(model, store)
