"""Identification of a leg's tissues from all its sites together."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from mpi4py import MPI

from legfem.experiments.leg_3d import SolidLegSettings
from legfem.inverse.fit import fit
from legfem.inverse.laws import LawName
from legfem.inverse.outcome import JointForward
from legfem.inverse.settings import SearchRequest
from legfem.legs.correction import TabulatedCorrection
from legfem.legs.fit_in_3d import fit_in_3d
from legfem.legs.forward import PlaneStrainForward
from legfem.legs.identification import as_leg, identify_leg, searches_in_3d
from legfem.legs.model_3d import LegModels
from legfem.legs.problem import leg_problem, section_forward
from legfem.legs.subject import SitedLeg, Subject
from legfem.sites.result import SitesResult, sites_result

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import PlaneStrainSettings


def identify_sites(
    leg: SitedLeg,
    laws: Sequence[LawName],
    request: SearchRequest | None = None,
    corrections: Sequence[TabulatedCorrection | None] | None = None,
    model: JointForward[PlaneStrainForward] | None = None,
) -> list[SitesResult]:
    """Identify tissues that all sites of a leg share; see `legfem.legs.problem.leg_problem`."""
    request = request or SearchRequest()
    problem = leg_problem(leg, laws, request, corrections, model)
    return [sites_result(one) for one in fit(problem, laws, request)]


def identify_in_3d(
    leg: SitedLeg,
    laws: Sequence[LawName],
    request: SearchRequest | None = None,
    settings: SolidLegSettings | None = None,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    models: Sequence[LegModels] | None = None,
) -> list[SitesResult]:
    """Identify what sites share, from solves in 3D; see `legfem.legs.fit_in_3d`."""
    return [sites_result(one) for one in fit_in_3d(leg, laws, request, settings, comm, models)]


def identify_together(
    leg: SitedLeg,
    laws: Sequence[LawName],
    request: SearchRequest,
    correction: str,
    in_3d: bool,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    settings: PlaneStrainSettings | SolidLegSettings | None = None,
) -> list[SitesResult]:
    """Identify what all sites share; see `legfem.legs.identification.identify_leg`."""
    return [sites_result(one) for one in identify_leg(leg, laws, request, correction, in_3d, comm, settings)]


def joint_leg(given: Subject | SitedLeg, names: Collection[str], in_3d: bool) -> SitedLeg | None:
    """Leg whose sites are to be fitted together; None where one section is."""
    leg = as_leg(given)
    return leg if searches_in_3d(leg, names, in_3d) or len(leg.sites) > 1 else None


def sites_model(
    leg: SitedLeg, depth: float | None = None, settings: PlaneStrainSettings | None = None
) -> JointForward[PlaneStrainForward]:
    """Forward model of a leg's sites, every site pressed as deep as its recordings ask."""
    return section_forward(leg, SearchRequest(depth=depth), settings)
