"""Identification of a leg: which model its sites and what is asked for need, and the fit by that model.

A section in plane strain with a tabulated correction; the same confirmed by solves of the leg in 3D; or a search on
solves in 3D alone: of several sites, and of one where fibres are asked for, or where what presses doesn't lie along
the leg, so that there is no section to go on.

The search goes on the model in plane strain times a correction. The leg is solved in 3D at the
optimum, the correction is made anew from that (`legfem.inverse.correction`), and the search is
repeated, until neither the force that the correction predicted nor the optimum moves. What is left
is the correction's error, which the intervals carry: that of its last prediction, of the mesh, of
how much of the leg is modelled, and of first contact.

In 3D alone the search goes on full solves of every site with their exact derivatives: an emulator
that is drawn through them leads from one to the next (`legfem.inverse.search`), some four to eight
of them. Once, near the optimum, every site is solved by larger elements and of a shorter leg; what
that changes is an error that the weights and the intervals carry, the mesh's of each site by itself
and the length's alike at all.
"""

import time
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from legfem.common.errors import Argument, InputError, Remedy
from legfem.common.progress import Progress
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.experiments.leg_3d import SolidLegSettings
from legfem.inverse.catalogue import DEEP_C10, DEEP_RATIO, LawName, deep_stiffness
from legfem.inverse.correction import FIRST_RATIO, TabulatedCorrection, confirmed_correction
from legfem.inverse.fibre_ratio import check_in_plane
from legfem.inverse.fit import Fit, preferred
from legfem.inverse.outcome import Forward, FullSolver, JointForward
from legfem.inverse.problem import fit, fit_with
from legfem.inverse.searches import Searches
from legfem.inverse.settings import IdentificationSettings, SearchRequest
from legfem.legs.correction_of_leg import AUTO, NONE, choose_correction
from legfem.legs.details import CLOSE, Confirmation, LegDetails, PressedLeg, SpatialEvidence
from legfem.legs.finite_element_models import tissues_of
from legfem.legs.forward import PlaneStrainForward, laws_of, values_of
from legfem.legs.model_3d import SOLVES, LegModels, check_has_ends, leg_models, start_of_ratio
from legfem.legs.notices import of_two_fidelities
from legfem.legs.problem import LegProblem, leg_problem, pressed_depth, split_instrument
from legfem.legs.site import measured_curve, site_test
from legfem.legs.solver_3d import FIBRE_ERRORS, LegSolver, model_errors
from legfem.legs.subject import SitedLeg, Subject
from legfem.legs.unknowns import unknown_geometry

MOST_SOLVES = 8
"""In 3D, of all laws together, those that measure the errors among them."""


@dataclass(eq=False)
class TwoFidelities:
    """Fits laws to one site by two models.

    Parameters
    ----------
    problem : LegProblem
        Of one site in plane strain; its correction, if it has one, is where the search starts and how the correction
        changes with the stiffness.
    solver : FullSolver
        Of the section in plane strain.
    settings : IdentificationSettings
        Of the searches.
    models : LegModels
        Of the leg in 3D.
    progress : Progress
        Shown every solve.
    table : TabulatedCorrection, optional
        Of idealised legs.
    """

    problem: LegProblem
    solver: FullSolver
    settings: IdentificationSettings
    models: LegModels
    progress: Progress
    table: TabulatedCorrection | None
    _last: TabulatedCorrection | None = None
    _seen: PressedLeg | None = None

    def __post_init__(self) -> None:
        """Lay out the solver of the leg."""
        self._leg = LegSolver(self.models, self.progress)

    def fit(self, names: Sequence[LawName]) -> list[Fit[LegDetails]]:
        """Fit laws, in their order.

        Raises
        ------
        SearchError
            If a solve in 3D stops short of the depth, or too few of the others reach it.
        """
        return [self._fit(name) for name in names]

    def _fit(self, name: LawName) -> Fit[LegDetails]:
        started = time.perf_counter()
        correction = self._last or self.table
        result = self._on_section(name, correction)
        confirmations: list[Confirmation] = []
        while True:
            done = self._leg.full_solves + self._leg.rough_solves
            if done + self._leg.next_solves > MOST_SOLVES:
                break
            found, correction = self._confirmed(result, correction)
            before, result = result, self._on_section(name, correction)
            found = replace(found, moved=_moved(before, result))
            confirmations.append(found)
            self.progress.advance(
                f"3D differs by {100 * found.error:.2f} % of the force from what was predicted, "
                f"C10 moves by {100 * found.moved:.2f} %"
            )
            if found.error < CLOSE and found.moved < CLOSE:
                break
        return self._with_evidence(result, confirmations, time.perf_counter() - started)

    def _on_section(self, name: LawName, correction: TabulatedCorrection | None) -> Fit[LegDetails]:
        (result,) = fit_with(self.problem.corrected([correction]), [name], self.solver, self.settings)
        return result

    def _confirmed(
        self, result: Fit[LegDetails], predicted: TabulatedCorrection | None
    ) -> tuple[Confirmation, TabulatedCorrection]:
        """Solve the leg at an optimum; return what that says of the correction, and the correction made anew."""
        values, grid = result.model_values, self._leg.grid
        c10, c20 = stiffness = deep_stiffness(values)
        where = "C10 {:.3g} kPa, C20 {:.3g} kPa".format(*map(mpa_to_kpa, stiffness))
        self.progress.stage(f"the leg in 3D at {where}")
        (section,) = self.solver.solve([values])
        solved = self._leg.at(values, section.curve)
        before: FloatArray = np.zeros(len(grid))
        if predicted is not None:
            before = predicted.correction(grid, np.asarray(c10), np.asarray(c20))
        missed, flat = before - solved.P, section.curve(grid)
        share = float(np.max(np.abs(missed * flat)) / np.max(np.abs((1 - solved.P) * flat)))
        # What the table or plane strain missed isn't what a solve nearby will.
        near = self._leg.full_solves > 1 or share < CLOSE
        prediction = missed if near else 0 * missed
        self._last = confirmed_correction(
            f"this leg's own, solved in 3D at {where}",
            self.table,
            stiffness,
            grid,
            solved.P,
            {"prediction": prediction, **solved.errors},
            {name: "fibres" for name in FIBRE_ERRORS if name in solved.errors},
        )
        outcome = solved.outcome
        self._seen = self.models.pressed(outcome)
        return Confirmation(c10, c20, outcome.seconds, outcome.factorisations, share), self._last

    def _with_evidence(
        self, result: Fit[LegDetails], confirmations: Sequence[Confirmation], seconds: float
    ) -> Fit[LegDetails]:
        grid, leg = result.tests[0].force.channel.station, self.models.leg
        c10, c20 = deep_stiffness(result.values)
        assert self._last is not None
        table = None
        if self.table is not None:
            table = self.table.correction(grid, np.asarray(c10), np.asarray(c20))
        errors = {
            name: float(np.abs(np.interp(grid, self._leg.grid, mode))[grid >= FIRST_RATIO].max())
            for name, mode in self._last.errors.items()
        }
        evidence = SpatialEvidence(
            leg.source,
            leg.extruded,
            leg.shape.length,
            tuple(confirmations),
            self._leg.full_solves,
            self._leg.rough_solves,
            errors,
            table,
            self._seen,
        )
        return replace(
            result,
            details=replace(result.details, spatial=evidence),
            log=replace(result.log, wall_s=seconds),
            notices=(*result.notices, *of_two_fidelities(evidence, MOST_SOLVES)),
        )


def _moved(before: Fit[LegDetails], after: Fit[LegDetails]) -> float:
    """Relative change of C10, or without it of what else was identified."""
    names = [DEEP_C10] if DEEP_C10 in after.estimates else list(after.estimates)
    moves = (
        abs(after.estimates[name].value / before.estimates[name].value - 1)
        for name in names
        if before.estimates[name].value != 0
    )
    return max(moves, default=0.0)


MOST_SOLVES_OF_SITES = 12
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
    curves = tuple(measured_curve(site, request.depth) for site in leg.sites)
    tests = tuple(site_test(site, request.depth, model="3d") for site in leg.sites)
    models = models or leg_models(leg, [float(test.grid[-1]) for test in tests], request, settings, comm)
    forward = JointForward(tuple(one.full for one in models))
    jobs = min(request.jobs, len(models)) if comm.size == 1 else 1
    unknowns = laws_of(leg.sites[0], laws, forward.nominal, parameters, request.fixed)
    problem = LegProblem(leg, tests, curves, forward, unknowns, unknown_geometry, "covariance", own_errors)
    with replace(request, jobs=jobs).solver(forward, problem.sensitivities, folder=SOLVES) as solver:
        few = replace(request.settings, most_solves=FIRST_SOLVES)
        start = Searches(problem, solver, few, refines=False).nearest(laws)
        corrections, spatial = model_errors(leg, models, start, request.progress, jobs)
        problem = replace(problem, spatial=spatial).corrected(corrections)
        settled = replace(request.settings, most_solves=MOST_SOLVES_OF_SITES)
        return fit_with(problem, laws, solver, settled, start)


def as_leg(given: Subject | SitedLeg) -> SitedLeg:
    """A leg with its sites: a subject pressed in one way is a leg of one site."""
    return given if isinstance(given, SitedLeg) else SitedLeg(given.id, given.title, (given,), given.directory)


def searches_in_3d(leg: SitedLeg, names: Collection[str], in_3d: bool) -> bool:
    """Whether the search has to go on solves of the leg in 3D alone.

    Parameters
    ----------
    leg
        With its sites.
    names
        Full names of what is asked for, held or given a prior.
    in_3d
        Whether the leg itself is to be solved.

    Raises
    ------
    InputError
        If fibres are among the names, and the leg isn't solved in 3D.
    """
    if not in_3d:
        check_in_plane(names)
        return False
    if lacks := leg.sites[0].section.lacks:
        raise InputError(Argument("model"), "3d", f"the limb has no {' and no '.join(lacks)}", "leave it out")
    return len(leg.sites) > 1 or DEEP_RATIO in names or not leg.sites[0].indenter.lies_along


def check_joint(leg: SitedLeg, settings: IdentificationSettings, correction: str, in_3d: bool) -> None:
    """Check that what is asked for can be had of all sites together, or of a leg in 3D.

    Raises
    ------
    InputError
        If it can't.
    """
    name = leg.sites[0].site
    by_itself = (", or identify one of the sites: ", Argument("site", name)) if name else ()
    what = f"{len(leg.sites)} sites" if name else "the leg in 3D"
    if settings.weighting == "paper":
        why = "paper weighs no site's errors against another's"
        raise InputError(Argument("weighting"), what, why, Remedy("leave it out", *by_itself))
    if not in_3d:
        return
    if correction not in (AUTO, NONE):
        raise InputError(Argument("correction"), correction, "nothing is left to correct in 3D", "leave it out")
    for site in leg.sites:
        check_has_ends(site)


def nominal_of(leg: SitedLeg, in_3d: bool) -> dict[str, float]:
    """Return all values of a leg's tissues as assumed; in 3D with its fibres' ratio."""
    nominal = values_of(tissues_of(leg.sites[0]))
    return nominal | ({DEEP_RATIO: start_of_ratio(leg.sites[0])} if in_3d else {})


def identify_leg(
    leg: SitedLeg,
    laws: Sequence[LawName],
    request: SearchRequest,
    correction: str = AUTO,
    in_3d: bool = False,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    settings: SolidLegSettings | None = None,
    forward: JointForward[PlaneStrainForward] | None = None,
) -> list[Fit[LegDetails]]:
    """Identify what all sites of a leg share, in plane strain or in 3D.

    Parameters
    ----------
    leg
        With recordings at every site; checked by `check_joint` where `searches_in_3d` or where it has several.
    laws
        Of the deep tissue: ``neo-hookean``, ``reduced-polynomial``.
    request
        What to identify, and with what means.
    correction
        Name or file, see `legfem.legs.correction_of_leg.choose_correction`; of a search in 3D there is none.
    in_3d
        Whether to solve the leg itself.
    comm
        Over which a solve in 3D is spread.
    settings
        Numerical, of a leg in 3D.
    forward
        Of the sites in plane strain, see `legfem.legs.problem.section_forward`, which makes it otherwise.

    Raises
    ------
    InputError
        If a site can't be meshed or its recordings can't be used, or there is no parameter of a
        name.
    SearchError
        If too few full solves reach the measured depths.
    """
    names = {one.name for one in request.parameters or ()} | set(request.fixed)
    if searches_in_3d(leg, names, in_3d):
        return fit_in_3d(leg, laws, request, settings, comm)
    corrections = [choose_correction(correction, site) for site in leg.sites]
    models = None
    if in_3d:
        (site,) = leg.sites
        kept = None if request.out is None else request.out / SOLVES
        models = LegModels.of_subject(site, pressed_depth(site, request), kept, settings, request.progress, comm)
    return fit_leg(leg, laws, request, corrections, forward, models)


def fit_leg(
    given: Subject | SitedLeg,
    laws: Sequence[LawName],
    request: SearchRequest | None = None,
    corrections: Sequence[TabulatedCorrection | None] | None = None,
    forward: Forward | None = None,
    models: LegModels | None = None,
) -> list[Fit[LegDetails]]:
    """Fit laws to sections in plane strain.

    Parameters
    ----------
    given, laws, request, corrections, forward
        See `legfem.legs.problem.leg_problem`.
    models
        Of the only site in 3D: its solves confirm the correction; see `legfem.legs.identification.TwoFidelities`.

    Raises
    ------
    InputError
        If a site can't be meshed or its recordings can't be used, or there is no parameter of a name.
    SearchError
        If too few full solves reach the measured depths.
    """
    request = request or SearchRequest()
    problem = leg_problem(as_leg(given), laws, request, corrections, forward)
    if models is None:
        fits = fit(problem, laws, request)
        if request.as_field:
            from legfem.legs.stiffness_field import stiffness_map

            best = preferred(fits)
            mapped = replace(best, details=replace(best.details, field=stiffness_map(problem, best, request)))
            fits = [mapped if one is best else one for one in fits]
        return fits
    (test,) = problem.tests
    with request.solver(problem.forward, problem.sensitivities) as solver:
        both = TwoFidelities(problem, solver, request.settings, models, request.progress, test.correction)
        return both.fit(laws)
