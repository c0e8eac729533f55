"""What is shown of specimens: page, document, and the figure of their recordings beside the laws."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from matplotlib.figure import Figure

from legfem.inverse.document import KindDocument
from legfem.inverse.fit import Fit
from legfem.report.curves import curves_figure
from legfem.report.folder import ReportFile
from legfem.report.further_channels import SHOWS, channels_figure, drawn
from legfem.report.kinds import ReportKind
from legfem.report.page import PressedSection, WebPage
from legfem.report.specimen_page import curves_of, specimen_page
from legfem.report.style import save
from legfem.specimens.details import SpecimenDetails, SpecimenDocument, compared

type SpecimenFits = Sequence[Fit[SpecimenDetails]]


class SpecimenReport(ReportKind):
    """What is shown of specimens."""

    kind: ClassVar[str] = "specimens"
    document: ClassVar[KindDocument] = SpecimenDocument()

    def page(
        self, fits: SpecimenFits, pressed: PressedSection | None = None, command: str = "", note: str = ""
    ) -> WebPage:
        """Return the page."""
        return specimen_page(fits, command)

    def figure(self, fits: SpecimenFits) -> Figure:
        """Return recordings beside the laws, those with the poorest fit."""
        folder = fits[0].details.folder
        what = f"Measured and simulated {compared(fits[0])[0].axes.load}"
        return curves_figure(curves_of(fits), what, folder.title, folder.origin)

    def files(self, fits: SpecimenFits, folder: Path) -> list[ReportFile]:
        """Write the figure."""
        shows = "recordings beside the model over displacement and time, and their differences"
        found = [ReportFile(save(self.figure(fits), folder, "fit", svg=True), shows)]
        if drawn(fits):
            found.append(ReportFile(save(channels_figure(fits), folder, "channels", svg=True), SHOWS))
        return found
