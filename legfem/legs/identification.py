"""Identification of a leg: which model its sites and what is asked for need, and the fit by that model.

A section in plane strain with a tabulated correction; the same confirmed by solves of the leg in 3D; or a search on
solves in 3D alone: of several sites, and of one where fibres are asked for, or where what presses doesn't lie along
the leg, so that there is no section to go on.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.experiments.leg_3d import SolidLegSettings
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.inverse.catalogue import DEEP_RATIO
from legfem.inverse.fibre_ratio import check_in_plane
from legfem.inverse.fit import Fit, fit
from legfem.inverse.laws import LawName
from legfem.inverse.outcome import Forward
from legfem.inverse.settings import IdentificationSettings, SearchRequest
from legfem.legs.correction import TabulatedCorrection
from legfem.legs.correction_of_leg import AUTO, NONE, choose_correction
from legfem.legs.details import LegDetails
from legfem.legs.experiments import tissues_of
from legfem.legs.fit_in_3d import fit_in_3d
from legfem.legs.forward import values_of
from legfem.legs.model_3d import SOLVES, LegModels, check_has_ends, start_of_ratio
from legfem.legs.problem import LegProblem, leg_problem, pressed_depth
from legfem.legs.subject import SitedLeg, Subject
from legfem.legs.two_fidelity import TwoFidelities


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
    return len(leg.sites) > 1 or DEEP_RATIO in names or not leg.sites[0].indenter.lies_along


def check_joint(leg: SitedLeg, settings: IdentificationSettings, correction: str, in_3d: bool) -> None:
    """Check that what is asked for can be had of all sites together, or of a leg in 3D.

    Raises
    ------
    InputError
        If it can't.
    """
    name = leg.sites[0].site
    one = "leave it out" + (f", or identify one of the sites: --site {name}" if name else "")
    what = f"{len(leg.sites)} sites" if name else "the leg in 3D"
    for option, given, why in (
        ("--no-emulator", not settings.emulator, "is for one site in plane strain"),
        ("--weighting", settings.weighting == "paper", "paper weighs no site's errors against another's"),
    ):
        if given:
            raise InputError(option, what, why, one)
    if not in_3d:
        return
    if correction not in (AUTO, NONE):
        raise InputError("--correction", correction, "nothing is left to correct in 3D", "leave it out")
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
    settings: PlaneStrainSettings | SolidLegSettings | None = None,
    forward: Forward | None = None,
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
        Numerical: of a section in plane strain, or of a leg in 3D.
    forward
        Sections in plane strain, see `legfem.legs.problem.section_forward`; made without them where they are needed.

    Raises
    ------
    InputError
        If a site can't be meshed or its recordings can't be used, or there is no parameter of a
        name.
    SearchError
        If too few full solves reach the measured depths.
    """
    names = {one.name for one in request.parameters or ()} | set(request.fixed)
    solid = settings if isinstance(settings, SolidLegSettings) else None
    section = settings if isinstance(settings, PlaneStrainSettings) else None
    if searches_in_3d(leg, names, in_3d):
        return fit_in_3d(leg, laws, request, solid, comm)
    corrections = [choose_correction(correction, site) for site in leg.sites]
    problem = leg_problem(leg, laws, request, corrections, forward, section)
    if not in_3d:
        return fit(problem, laws, request)
    (site,) = leg.sites
    kept = None if request.out is None else request.out / SOLVES
    models = LegModels.of_subject(site, pressed_depth(site, request), kept, solid, request.progress, comm)
    return confirmed_in_3d(problem, laws, request, models)


def confirmed_in_3d(
    problem: LegProblem, laws: Sequence[LawName], request: SearchRequest, models: LegModels
) -> list[Fit[LegDetails]]:
    """Fit one site's section, its correction confirmed by solves of the leg in 3D; see `TwoFidelities`."""
    (test,) = problem.tests
    assert test.correction is None or isinstance(test.correction, TabulatedCorrection)
    with request.solver(problem.forward, problem.sensitivities) as solver:
        both = TwoFidelities(problem, solver, request.settings, models, request.progress, test.correction)
        return both.fit(laws)
