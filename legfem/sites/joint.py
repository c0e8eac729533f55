"""Which identifications are of all of a leg's sites together, and what they can be asked for.

Those of a leg with several sites are. So is that of one site in 3D where fibres are asked for, or
where what presses doesn't lie along the leg: there is no section in plane strain to go on.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.correction.choice import AUTO, NONE, choose_correction
from legfem.experiments.leg_3d import SolidLegSettings
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.identify.fibre_ratio import check_in_plane
from legfem.identify.spatial import check_has_ends, start_of_ratio
from legfem.inverse.catalogue import DEEP_RATIO
from legfem.inverse.laws import LawName
from legfem.inverse.settings import IdentificationSettings, SearchRequest
from legfem.legs.experiments import tissues_of
from legfem.legs.forward import values_of
from legfem.legs.subject import SitedLeg, Subject
from legfem.sites.identification import identify_sites, sites_model
from legfem.sites.result import SitesResult
from legfem.sites.spatial import identify_in_3d


def joint_leg(given: Subject | SitedLeg, names: Collection[str], in_3d: bool) -> SitedLeg | None:
    """Return the leg whose sites are to be fitted together; None where one section is.

    Parameters
    ----------
    given
        One site, or all of them.
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
    if isinstance(given, SitedLeg):
        return given
    if in_3d and (DEEP_RATIO in names or not given.indenter.lies_along):
        return SitedLeg(given.id, given.title, (given,), given.directory)
    return None


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
) -> list[SitesResult]:
    """Identify what all sites share, in plane strain or in 3D.

    Parameters
    ----------
    leg, laws, request
        As for `legfem.sites.identification.identify_sites`, checked by `check_joint`.
    correction
        Name or file, see `legfem.correction.choice.choose_correction`; in 3D there is none.
    in_3d
        Whether to solve the leg itself, as `legfem.sites.spatial.identify_in_3d` does.
    comm
        Over which a solve in 3D is spread.
    settings
        Numerical: of a section in plane strain, or of a leg in 3D.

    Raises
    ------
    InputError
        If a site can't be meshed or its recordings can't be used, or there is no parameter of a
        name.
    SearchError
        If too few full solves reach the measured depths.
    """
    if in_3d:
        solid = settings if isinstance(settings, SolidLegSettings) else None
        return identify_in_3d(leg, laws, request, solid, comm)
    section = settings if isinstance(settings, PlaneStrainSettings) else None
    corrections = [choose_correction(correction, site) for site in leg.sites]
    model = sites_model(leg, request.depth, section)
    return identify_sites(leg, laws, request, corrections, model)
