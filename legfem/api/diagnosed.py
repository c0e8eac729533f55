"""Where model and recordings differ, of a leg or specimens, and which physics was left out."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from legfem.api.arguments import check_folder, check_names, check_unused, check_whole, in_python_words
from legfem.api.loading import Given, one_of
from legfem.api.results import Result, row
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.legs.subject import SitedLeg, Subject

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from legfem.inverse.verdict import Diagnosis
    from legfem.report.web.page import WebPage
    from legfem.specimens.diagnosis import DiagnosedSpecimen
    from legfem.specimens.folder import SpecimenFolder


@dataclass(frozen=True, eq=False)
class DiagnosedLeg(Result):
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
        from legfem.report.text import plain_page

        return plain_page(self._page(), [])

    def document(self) -> dict[str, Any]:
        """Return what ``diagnosis.json`` holds."""
        from legfem.report.diagnosis_document import document

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
        from legfem.report.web.diagnosis import diagnosis_web_page

        return diagnosis_web_page(self.diagnosis, self.subject)

    def _rows(self) -> Iterator[dict[str, Any]]:
        yield from _before_and_after(self.document())


@dataclass(frozen=True, eq=False)
class DiagnosedFolder(Result):
    """The same of each specimen of a folder."""

    folder: SpecimenFolder
    specimens: tuple[DiagnosedSpecimen, ...]
    """In the folder's order; one that couldn't be diagnosed has a problem instead."""
    seed: int

    def __getitem__(self, name: str) -> DiagnosedSpecimen:
        """Return a specimen's by its name; raises KeyError for one that isn't there."""
        found = {one.id: one for one in self.specimens}
        if name not in found:
            raise KeyError(f"{name!r} is no specimen: there is {', '.join(found)}")
        return found[name]

    @property
    def verdicts(self) -> dict[str, str]:
        """By specimen: ``consistent``, ``named``, ``ambiguous`` or ``unexplained``."""
        return {one.id: one.diagnosis.verdict for one in self.specimens if one.diagnosis}

    def summary(self) -> str:
        """Return the report's text; of several specimens a table of all."""
        from legfem.report.specimen_diagnosis import specimens_page
        from legfem.report.text import plain_page

        if len(self.specimens) == 1 and self.specimens[0].diagnosis is not None:
            return plain_page(self._page(), [])
        return specimens_page(self.specimens, self.folder)

    def document(self) -> dict[str, Any]:
        """Return what ``diagnosis.json`` holds, by specimen."""
        from legfem.report.diagnosis_document import document

        return {
            one.id: document(one.diagnosis, one, self.seed, one.seconds)
            for one in self.specimens
            if one.diagnosis is not None
        }

    def plot(self) -> Figure:
        """Return the first diagnosed specimen's recordings against the model.

        Raises
        ------
        InputError
            If none could be diagnosed.
        """
        from legfem.report.recording_figure import recording_figure

        one, found = self._first
        return recording_figure(found, 0, one.title, one.origin)

    def write(self, folder: Given) -> Path:
        """Write what the command writes; return the report's path."""
        from legfem.report.specimen_diagnosis import write_specimen_diagnoses

        return write_specimen_diagnoses(self.specimens, self.folder, Path(folder), self.seed)[1]

    @property
    def _first(self) -> tuple[DiagnosedSpecimen, Diagnosis]:
        for one in self.specimens:
            if one.diagnosis is not None:
                return one, one.diagnosis
        raise _problem_of(self.specimens)

    def _page(self) -> WebPage:
        """Return that of the first diagnosed specimen; each has one of its own."""
        from legfem.report.web.diagnosis import diagnosis_web_page

        one, found = self._first
        return diagnosis_web_page(found, one)

    def _rows(self) -> Iterator[dict[str, Any]]:
        for name, document in self.document().items():
            for each in _before_and_after(document):
                yield {"specimen": name} | each


def _problem_of(specimens: Sequence[DiagnosedSpecimen]) -> InputError:
    return next(one.problem for one in specimens if one.problem is not None)


def _before_and_after(document: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    for when in ("before", "after"):
        for name, entry in document[f"parameters_{when}"].items():
            yield {"model": f"{when} repair"} | row(name, entry)


@overload
def diagnose(
    leg: Subject | SitedLeg | Given,
    *,
    library: Given | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: bool = False,
    site: str = "",
) -> DiagnosedLeg: ...
@overload
def diagnose(
    leg: SpecimenFolder,
    *,
    library: Given | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: bool = False,
    specimens: Sequence[str] = (),
) -> DiagnosedFolder: ...
@in_python_words()
def diagnose(
    leg: Subject | SitedLeg | SpecimenFolder | Given,
    *,
    library: Given | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: bool = False,
    specimens: Sequence[str] = (),
    site: str = "",
) -> DiagnosedLeg | DiagnosedFolder:
    """Say where model and recordings differ, which physics was left out, and what adding it does.

    The first diagnosis of a leg solves its library of responses, which takes minutes.

    Parameters
    ----------
    leg : Subject, SitedLeg, SpecimenFolder, str or Path
        What `load_subject`, `load_sites` or `load_specimen` returned; or a leg's id or folder.
    library : str or Path, optional
        Folder of the legs' responses; ``~/.cache/legfem/responses`` without it.
    seed : int
        Of the draws behind p-values.
    jobs : int
        Processes. More than one needs the calling script's ``if __name__ == "__main__":``.
    progress : bool
        Whether to print what is being done.
    specimens : sequence of str
        Of a folder of specimens those to diagnose; all without any.
    site : str
        Of a leg with several ``[[site]]`` which: a diagnosis takes one.

    Returns
    -------
    DiagnosedLeg or DiagnosedFolder
        With ``verdict`` (or ``verdicts`` by specimen), ``summary()``, ``plot()``, ``to_frame()``,
        ``document()``, ``write(folder)``.
    """
    from legfem.legs.correction import read_correction
    from legfem.legs.correction_of_leg import REFERENCE
    from legfem.legs.diagnosis import Diagnoser
    from legfem.legs.variants import library_folder
    from legfem.specimens.folder import SpecimenFolder

    check_whole("seed", seed, 0)
    check_whole("jobs", jobs, 1)
    folder = library_folder() if library is None else Path(library)
    check_folder("library", folder)
    if isinstance(leg, SpecimenFolder):
        check_unused("specimens", {"site": site != ""})
        check_names("specimens", specimens)
        from legfem.specimens.diagnosis import diagnose_specimens

        with progress_on(quiet=not progress) as told:
            each = tuple(diagnose_specimens(leg, specimens, folder, jobs, told, seed))
        return DiagnosedFolder(leg, each, seed)
    check_unused("a leg", {"specimens": bool(specimens)})
    subject = one_of(leg, site)
    started = time.perf_counter()
    with progress_on(quiet=not progress) as told:
        found = Diagnoser(folder, read_correction(REFERENCE), jobs).diagnose(subject, told, seed)
    return DiagnosedLeg(subject, found, seed, time.perf_counter() - started)
