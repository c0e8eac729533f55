"""Where model and recordings of a leg differ, and which physics was left out."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legfem.api.found import Found, row
from legfem.api.loading import Given, load_subject
from legfem.common.progress import progress_on
from legfem.subjects.subject import Subject

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from legfem.diagnose.diagnosis import Diagnosis
    from legfem.report.web.page import WebPage


@dataclass(frozen=True, eq=False)
class DiagnosedLeg(Found):
    """Where model and recordings differ, and which physics was left out."""

    subject: Subject
    diagnosis: Diagnosis
    seed: int
    seconds: float

    @property
    def verdict(self) -> str:
        """Return ``consistent``, ``named``, ``ambiguous`` or ``unexplained``."""
        return self.diagnosis.verdict

    def summary(self) -> str:
        """Return the report's text."""
        from legfem.report.diagnosis_text import diagnosis_page

        return diagnosis_page(self.diagnosis, self.subject, [])

    def document(self) -> dict[str, Any]:
        """Return what ``diagnosis.json`` holds."""
        from legfem.diagnose.document import document

        return document(self.diagnosis, self.subject, self.seed, self.seconds)

    def plot(self) -> Figure:
        """Return the recordings against the model, what it misses, and where."""
        from legfem.report.recording_figure import recording_figure

        return recording_figure(self.diagnosis, 0, self.subject.title, self.subject.origin)

    def write(self, folder: Given) -> Path:
        """Write diagnosis.json, report.txt and the figures; return the report's path."""
        from legfem.common.documents import write_document
        from legfem.report.diagnosis import write_diagnosis_report

        write_document(Path(folder) / "diagnosis.json", self.document())
        return write_diagnosis_report(self.diagnosis, self.subject, Path(folder))

    def _page(self) -> WebPage:
        from legfem.diagnose.document import versions
        from legfem.report.web.diagnosis import diagnosis_web_page

        return diagnosis_web_page(self.diagnosis, self.subject, self.summary(), (), versions())

    def _rows(self) -> Iterator[dict[str, Any]]:
        document = self.document()
        for when in ("before", "after"):
            for name, entry in document[f"parameters_{when}"].items():
                yield {"model": f"{when} repair"} | row(name, entry)


def diagnose(
    leg: Subject | Given,
    *,
    library: Given | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: bool = False,
) -> DiagnosedLeg:
    """Say where model and recordings differ, which physics was left out, and what adding it does.

    The first diagnosis of a leg solves its library of responses, which takes minutes.

    Parameters
    ----------
    leg : Subject, str or Path
        The leg, or what `load_subject` takes.
    library : str or Path, optional
        Folder of the legs' responses; ``~/.cache/legfem/responses`` without it.
    seed : int
        Of the draws behind p-values.
    jobs : int
        Processes. More than one needs the calling script's ``if __name__ == "__main__":``.
    progress : bool
        Whether to print what is being done.

    Returns
    -------
    DiagnosedLeg
        With ``verdict``, ``summary()``, ``plot()``, ``to_frame()``, ``document()``,
        ``write(folder)``.
    """
    from legfem.correction.choice import REFERENCE
    from legfem.correction.tabulated import read_correction
    from legfem.diagnose.leg import library_folder
    from legfem.diagnose.run import Diagnoser

    subject = leg if isinstance(leg, Subject) else load_subject(leg)
    folder = library_folder() if library is None else Path(library)
    started = time.perf_counter()
    with progress_on(quiet=not progress) as told:
        found = Diagnoser(folder, read_correction(REFERENCE), jobs).diagnose(subject, told, seed)
    return DiagnosedLeg(subject, found, seed, time.perf_counter() - started)
