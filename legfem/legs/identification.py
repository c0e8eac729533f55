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
from legfem.inverse.catalogue import DEEP_RATIO, LawName
from legfem.inverse.fibre_ratio import check_in_plane
from legfem.inverse.fit import Fit, fit
from legfem.inverse.outcome import Forward, JointForward
from legfem.inverse.settings import IdentificationSettings, SearchRequest
from legfem.legs.correction import TabulatedCorrection
from legfem.legs.correction_of_leg import AUTO, NONE, choose_correction
from legfem.legs.details import LegDetails
from legfem.legs.experiments import tissues_of
from legfem.legs.fit_in_3d import fit_in_3d
from legfem.legs.forward import PlaneStrainForward, values_of
from legfem.legs.model_3d import SOLVES, LegModels, check_has_ends, start_of_ratio
from legfem.legs.problem import leg_problem, pressed_depth
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
        Of the only site in 3D: its solves confirm the correction; see `legfem.legs.two_fidelity.TwoFidelities`.

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
        return fit(problem, laws, request)
    (test,) = problem.tests
    assert test.correction is None or isinstance(test.correction, TabulatedCorrection)
    with request.solver(problem.forward, problem.sensitivities) as solver:
        both = TwoFidelities(problem, solver, request.settings, models, request.progress, test.correction)
        return both.fit(laws)
