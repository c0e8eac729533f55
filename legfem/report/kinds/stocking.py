"""What is shown of a leg in its stocking: page, document, figures of pressures and contours, and fields."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from matplotlib.figure import Figure
from mpi4py import MPI

from legfem.fem.field_files import write_fields
from legfem.fem.fields import fields_of
from legfem.inverse.document import KindDocument
from legfem.report.curves import curves_figure
from legfem.report.folder import ReportFile
from legfem.report.kinds import ReportKind
from legfem.report.page import PressedSection, WebPage
from legfem.report.stocking_figures import stocking_pressure_figure, stocking_section_figure
from legfem.report.stocking_page import stocking_web_page
from legfem.report.stocking_pressures import PRESSURES, fat_curves
from legfem.report.stocking_stiffness import STIFFNESS, contour_curves
from legfem.report.style import save
from legfem.report.words import capital
from legfem.stockings.assessment import KIND
from legfem.stockings.details import StockingDocument, StockingFit


class StockingReport(ReportKind):
    """What is shown of a leg in its stocking."""

    kind: ClassVar[str] = KIND
    document: ClassVar[KindDocument] = StockingDocument()
    explore: ClassVar[str] = "the leg to turn"
    told: ClassVar[tuple[str, ...]] = (STIFFNESS, PRESSURES)

    def page(
        self, fits: Sequence[StockingFit], pressed: PressedSection | None = None, command: str = "", note: str = ""
    ) -> WebPage:
        """Return the page."""
        return stocking_web_page(fits[0], command)

    def figure(self, fits: Sequence[StockingFit]) -> Figure:
        """Return the pressure of the stocking on the skin, unrolled and on the leg."""
        return stocking_pressure_figure(fits[0].details)

    def files(self, fits: Sequence[StockingFit], folder: Path) -> list[ReportFile]:
        """Write pressures on the skin, in a section and in the fat, and the contours that were compared."""
        details, entries = fits[0].details, []
        if details.section is not None:
            entries = [
                ReportFile(
                    save(stocking_pressure_figure(details), folder, "interface-pressure"),
                    "pressure of the stocking on the skin, unrolled and on the leg (the second paper's Fig. 4)",
                ),
                ReportFile(
                    save(stocking_section_figure(details, details.section), folder, "mid-calf"),
                    "hydrostatic pressure in the section at mid calf, with the veins (Figs. 5 and 6); "
                    "the outlines before and in the stocking",
                ),
            ]
        for name, curves, what in (
            ("fat", fat_curves(details), "fat thickness round the leg, and the pressures over it and in it"),
            ("contours", contour_curves(details), "the contours that were compared: distances of model and bare leg"),
        ):
            if curves:
                figure = curves_figure(curves, capital(what), details.leg.title, details.leg.origin)
                entries.append(ReportFile(save(figure, folder, name), what))
        return entries

    def comm(self, fits: Sequence[StockingFit]) -> MPI.Intracomm:
        """Return the ranks that share the leg's mesh."""
        return fits[0].details.model.compression.comm

    def fields(self, fits: Sequence[StockingFit], folder: Path) -> list[ReportFile]:
        """Write the leg in its stocking for ParaView."""
        details = fits[0].details
        if not details.equilibrium.state.report.complete:
            return []
        details.model.set_state(details.equilibrium.state, details.equilibrium.pressure, details.parameters)
        shows = (
            "the leg in its stocking for ParaView: displacement (mm), hydrostatic pressure and von "
            "Mises stress (kPa), greatest stretch, J, tissue (1 fat, 3 muscle); interface pressure on "
            "the skin (kPa)"
        )
        return [ReportFile(write_fields(fields_of(details.model.compression.system), folder), shows)]
