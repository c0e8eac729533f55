"""The front door's specimens: what identify and diagnose do with a folder of them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from legfem.api import loading
from legfem.api.asked import AskedParameters
from legfem.api.results import Identification, Result
from legfem.common.progress import Progress, progress_on
from legfem.inverse.settings import SearchRequest
from legfem.inverse.verdict import Diagnosis
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.diagnosis_curves import recording_figure
from legfem.report.diagnosis_document import document, parameter_rows
from legfem.report.page import WebPage, command_line
from legfem.report.render import plain_page
from legfem.report.specimen_results import specimens_page, write_specimen_diagnoses
from legfem.specimens.diagnosis import DiagnosedSpecimen, diagnose_specimens
from legfem.specimens.folder import SpecimenFolder
from legfem.specimens.laws import ParameterRequest, laws_named, request_of_texts
from legfem.specimens.problem import fit_specimens


def _request(wanted: AskedParameters, folder: SpecimenFolder) -> ParameterRequest:
    """What is free and held in the tissues of specimens."""
    found = request_of_texts(wanted.texts, folder.tissues)
    priors = {name: one.prior for name, one in wanted.given.items() if one.prior is not None}
    bounds = {name: one.bounds for name, one in wanted.given.items()}
    return replace(
        found,
        priors={**priors, **found.priors},
        bounds={**bounds, **found.bounds},
        fixed={**found.fixed, **wanted.numbers},
    )


def identify_specimens(
    folder: SpecimenFolder,
    law: str | None,
    wanted: AskedParameters,
    leave_out: Sequence[str],
    request: SearchRequest,
    progress: bool,
) -> Identification:
    """Return what `legfem.identify` finds in specimens."""
    laws, asked = laws_named(law), _request(wanted, folder)
    with progress_on(quiet=not progress) as told:
        fits = fit_specimens(folder, laws, asked, leave_out, replace(request, progress=told))
    return Identification(folder, tuple(fits))


@dataclass(frozen=True, eq=False)
class DiagnosedFolder(Result):
    """The same of each specimen of a folder."""

    folder: SpecimenFolder
    specimens: tuple[DiagnosedSpecimen, ...]
    """In the folder's order; one that couldn't be diagnosed has a problem instead."""
    seed: int
    _written: Mapping[Path, Path] = field(default_factory=dict)
    """Reports by the folders that they were written into as each diagnosis was made."""

    def __getitem__(self, name: str) -> DiagnosedSpecimen:
        """Return a specimen's by its name; raises KeyError for one that isn't there."""
        found = {one.id: one for one in self.specimens}
        if name not in found:
            raise KeyError(f"{name!r} is not a specimen: there is {', '.join(found)}")
        return found[name]

    @property
    def verdicts(self) -> dict[str, str]:
        """By specimen: ``consistent``, ``named``, ``ambiguous`` or ``unexplained``."""
        return {one.id: one.diagnosis.verdict for one in self.specimens if one.diagnosis}

    def summary(self) -> str:
        """Return the report's text; of several specimens a table of all."""
        if len(self.specimens) == 1 and self.specimens[0].diagnosis is not None:
            return plain_page(self._page(), [])
        return specimens_page(self.specimens, self.folder)

    def document(self) -> dict[str, Any]:
        """Return what ``diagnosis.json`` holds, by specimen."""
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
        one, found = self._first
        return recording_figure(found, 0, one.title, one.origin)

    def write(self, folder: loading.Given) -> Path:
        """Write what the command writes; return the report's path."""
        out = Path(folder)
        if out in self._written:
            return self._written[out]
        return write_specimen_diagnoses(self.specimens, self.folder, out, self.seed, command_line())[1]

    @property
    def _first(self) -> tuple[DiagnosedSpecimen, Diagnosis]:
        for one in self.specimens:
            if one.diagnosis is not None:
                return one, one.diagnosis
        raise next(one.problem for one in self.specimens if one.problem is not None)

    def _page(self) -> WebPage:
        """Return that of the first diagnosed specimen; each has one of its own."""
        one, found = self._first
        return diagnosis_web_page(found, one)

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters of every specimen: a row each, with value, 95 % interval and unit."""
        return pd.DataFrame(
            {"specimen": one.id} | row
            for one in self.specimens
            if one.diagnosis
            for row in parameter_rows(one.diagnosis)
        )


def diagnose_folder(
    folder: SpecimenFolder,
    names: Sequence[str],
    responses: Path,
    jobs: int,
    progress: Progress,
    seed: int,
    out: Path | None,
) -> DiagnosedFolder:
    """Return what `legfem.diagnose` finds in specimens; see there."""
    made: list[DiagnosedSpecimen] = []

    def each() -> Iterator[DiagnosedSpecimen]:
        for one in diagnose_specimens(folder, names, responses, jobs, progress, seed):
            made.append(one)
            yield one

    if out is None:
        return DiagnosedFolder(folder, tuple(each()), seed)
    report = write_specimen_diagnoses(each(), folder, out, seed, command_line())[1]
    return DiagnosedFolder(folder, tuple(made), seed, {out: report})
