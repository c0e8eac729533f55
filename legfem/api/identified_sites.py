"""Stiffness identified from several sites of a leg together, or from a leg in 3D."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legfem.api.called import IdentifyCall
from legfem.api.checking import wrong_mesh
from legfem.api.found import ByLaw
from legfem.api.identified_leg import plane_settings
from legfem.api.loading import Given
from legfem.common.progress import progress_on

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from legfem.api.called import Mesh
    from legfem.experiments.leg_3d import SolidLegSettings
    from legfem.legs.subject import SitedLeg
    from legfem.report.web.page import WebPage
    from legfem.sites.result import SitesResult


@dataclass(frozen=True, eq=False)
class IdentifiedSites(ByLaw["SitesResult"]):
    """What all sites of a leg share, identified from all of them together.

    Of one site, too, where the leg is solved in 3D alone: where its fibres' ratio is asked for, or
    it is pressed by a turned cylinder, a ball or a punch.
    """

    leg: SitedLeg
    results: tuple[SitesResult, ...]
    """One a law; each says in ``sites`` what every site by itself asks for."""

    def summary(self) -> str:
        """Return values, intervals, whether the sites agree, and warnings."""
        from legfem.report.text import brief

        return brief(self._page())

    def _document_of(self, result: SitesResult) -> dict[str, Any]:
        from legfem.report.sites_numbers import sites_document

        return sites_document(result)

    def plot(self) -> Figure:
        """Return every site beside the law that fits better, and their differences."""
        from legfem.report.sites_figure import sites_figure
        from legfem.report.web.sites import best_law

        return sites_figure(best_law(self.results))

    def _page(self) -> WebPage:
        from legfem.report.web.sites import sites_web_page

        return sites_web_page(self.results)

    def write(self, folder: Given) -> Path:
        """Write result.json, report.txt, report.html and figures; return the report's path."""
        from legfem.report.sites import write_sites_report

        return write_sites_report(self.results, Path(folder))[1]


def identify_together(leg: SitedLeg, asked: IdentifyCall) -> IdentifiedSites:
    """Identify what all sites of a leg share; see `legfem.identify`."""
    from legfem.legs.identification import check_joint, nominal_of
    from legfem.sites.identification import identify_together as together

    in_3d = asked.in_3d
    check_joint(leg, asked.request.settings, asked.correction, in_3d)
    nominal = nominal_of(leg, in_3d)
    request = asked.request_of(nominal)
    laws = asked.laws(request, nominal, leg.sites[0])
    numbers = _solid_settings(asked.mesh) if in_3d else plane_settings(asked.mesh)
    with progress_on(quiet=not asked.progress) as told:
        request = replace(request, progress=told)
        results = together(leg, laws, request, asked.correction, in_3d, settings=numbers)
    return IdentifiedSites(leg, tuple(results))


def _solid_settings(mesh: Mesh | None) -> SolidLegSettings | None:
    from legfem.experiments.leg_3d import SolidLegSettings

    if mesh is None or isinstance(mesh, SolidLegSettings):
        return mesh
    raise wrong_mesh(mesh, "is a section's", "leave it out, or give SolidLegSettings")
