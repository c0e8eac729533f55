"""A tissue's law identified from recordings of specimens."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legfem.api.found import ByLaw
from legfem.api.loading import Given
from legfem.common.progress import progress_on

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from legfem.inverse.parameter import Parameter
    from legfem.inverse.settings import IdentificationSettings
    from legfem.report.web.page import WebPage
    from legfem.specimens.folder import SpecimenFolder
    from legfem.specimens.result import SpecimenResult


@dataclass(frozen=True, eq=False)
class IdentifiedSpecimen(ByLaw["SpecimenResult"]):
    """A tissue's law identified from all recordings of a folder of specimens together."""

    folder: SpecimenFolder
    results: tuple[SpecimenResult, ...]
    """One a law."""

    def summary(self) -> str:
        """Return values, intervals, how well what was left out is predicted, and warnings."""
        from legfem.report.text import brief

        return brief(self._page())

    def _document_of(self, result: SpecimenResult) -> dict[str, Any]:
        from legfem.report.specimen_numbers import specimen_document

        return specimen_document(result)

    def plot(self) -> Figure:
        """Return recordings, model and their difference, for each law."""
        from legfem.report.specimen_figure import specimen_figure

        return specimen_figure(self.results)

    def _page(self) -> WebPage:
        from legfem.report.specimens import specimen_web_page

        return specimen_web_page(self.results)

    def write(self, folder: Given) -> Path:
        """Write result.json, report.txt and the figure; return the report's path."""
        from legfem.report.specimen import write_specimen_report

        return write_specimen_report(self.results, Path(folder))


def identify_folder(
    folder: SpecimenFolder,
    law: str | None,
    leave_out: Sequence[str],
    settings: IdentificationSettings | None,
    out: Given | None,
    jobs: int,
    progress: bool,
    parameters: Sequence[Parameter | str] | None,
    fixed: Mapping[str, float] | None,
) -> IdentifiedSpecimen:
    """Identify a tissue's law from a folder of specimens; see `legfem.identify`."""
    from legfem.specimens.identification import identify_specimen
    from legfem.specimens.laws import Asked, laws_named

    names = tuple(
        one if isinstance(one, str) else one.name
        for one in parameters or ()
        if isinstance(one, str) or one.role == "identified"
    )
    given = [one for one in parameters or () if not isinstance(one, str)]
    asked = Asked(
        names,
        {one.name: one.prior for one in given if one.prior is not None},
        {one.name: one.bounds for one in given},
        fixed or {},
    )
    with progress_on(quiet=not progress) as told:
        results = identify_specimen(
            folder, laws_named(law), asked, leave_out, settings, None if out is None else Path(out), jobs, told
        )
    return IdentifiedSpecimen(folder, tuple(results))
