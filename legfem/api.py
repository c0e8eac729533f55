"""The front door: ``import legfem as lf``, and a leg's folder becomes a result in one call.

Thin on the rooms: every function loads what it is given by id or path, runs what the command of its
name runs, and wraps what that found. What is found says more than the wrapper does; it stands in
its attributes.
"""

from __future__ import annotations

import base64
import html
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, overload

from legfem.common.doubts import say
from legfem.common.errors import InputError
from legfem.common.progress import Progress, Silent, progress_on
from legfem.identify.laws import LawName
from legfem.subjects.catalogue import Catalogue
from legfem.subjects.plausibility import doubts_about
from legfem.subjects.subject import SUBJECTS, Subject
from legfem.subjects.subject import load_subject as load_subject_folder

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from legfem.diagnose.diagnosis import Diagnosis
    from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
    from legfem.identify.result import IdentificationResult
    from legfem.identify.settings import IdentificationSettings
    from legfem.inference.parameter import Parameter
    from legfem.specimens.folder import SpecimenFolder
    from legfem.specimens.result import SpecimenResult
    from legfem.stocking.leg import StockingLeg
    from legfem.stocking.run import StockingResult

COARSENING = 2.0
"""Of the elements, for a quick look."""

type Given = str | Path
"""Id of a subject that comes with legfem, or the path of a folder."""


def load_subject(subject: Given) -> Subject:
    """Load a leg that was indented.

    Parameters
    ----------
    subject : str or Path
        Id of a subject that comes with legfem (``"1"`` to ``"4"``), or the path of a folder.

    Raises
    ------
    InputError
        If there is no such subject, or anything in the folder is missing or wrong.
    """
    loaded = load_subject_folder(_folder(subject, SUBJECTS), need_instrument=False)
    say(doubts_about(loaded))
    return loaded


def load_specimen(folder: Given) -> SpecimenFolder:
    """Load specimens that were tested in a lab: a ball, a punch, plates, a cylinder, a bar.

    Parameters
    ----------
    folder : str or Path
        That holds ``specimen.toml`` and recordings.

    Raises
    ------
    InputError
        If anything in the folder is missing or wrong; a recording that can't be used stands in
        ``left_out``.
    """
    from legfem.specimens.folder import load_specimen as load_specimen_folder

    return load_specimen_folder(Path(folder))


def load_leg(leg: Given) -> StockingLeg:
    """Load a leg that was scanned with and without a stocking.

    Parameters
    ----------
    leg : str or Path
        Id of a leg that comes with legfem (``"1"`` to ``"6"``), or the path of a folder.

    Raises
    ------
    InputError
        If there is no such leg, or anything in the folder is missing or wrong.
    """
    from legfem.stocking.leg import LEGS
    from legfem.stocking.leg import load_leg as load_leg_folder

    loaded = load_leg_folder(_folder(leg, LEGS))
    say(loaded.doubts)
    return loaded


class Found(ABC):
    """What was found in a leg: the same five ways to look at it for all that is found."""

    @abstractmethod
    def summary(self) -> str:
        """Return what a person reads first."""

    @abstractmethod
    def document(self) -> Any:
        """Return everything as JSON types, every number with its unit."""

    @abstractmethod
    def plot(self) -> Figure:
        """Return the figure that shows most."""

    @abstractmethod
    def write(self, folder: Given) -> Path:
        """Write report, figures and numbers into a folder; return the report's path."""

    @abstractmethod
    def _rows(self) -> Iterator[dict[str, Any]]:
        """Yield a row a parameter."""

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters: a row each, with value, 95 % interval and unit."""
        import pandas as pd

        return pd.DataFrame(list(self._rows()))

    def _repr_html_(self) -> str:
        """Return the summary, the parameters and the figure for a notebook."""
        from legfem.report.style import png

        encoded = base64.b64encode(png(self.plot())).decode()
        table = self.to_frame().to_html(index=False, na_rep="", float_format="{:.4g}".format)
        return (
            f"<pre>{html.escape(self.summary())}</pre>{table}"
            f'<img alt="{type(self).__name__}" src="data:image/png;base64,{encoded}">'
        )


# --- stiffness from indentation ---


class OfLaw(Protocol):
    """What belongs to one law."""

    @property
    def law(self) -> str:
        """Its name."""


class ByLaw[Result: OfLaw](Found):
    """Results of one identification, one a law."""

    results: tuple[Result, ...]

    def __getitem__(self, law: LawName) -> Result:
        """Return a law's result."""
        return next(result for result in self.results if result.law == law)

    def _rows(self) -> Iterator[dict[str, Any]]:
        for found in self.document():
            for name, entry in found["parameters"].items():
                yield {"law": found["law"]} | _row(name, entry)


@dataclass(frozen=True, eq=False)
class IdentifiedLeg(ByLaw["IdentificationResult"]):
    """Stiffness identified from a leg's recordings."""

    subject: Subject
    results: tuple[IdentificationResult, ...]
    """One a law."""
    _experiment: PlaneStrainIndentation | None = None

    def summary(self) -> str:
        """Return values, intervals, which law fits better, and warnings."""
        from legfem.report.text import summary

        return summary(self.results)

    def document(self) -> list[dict[str, Any]]:
        """Return what ``result.json`` holds, one a law."""
        from legfem.identify.document import result_document

        return [result_document(result) for result in self.results]

    def plot(self) -> Figure:
        """Return recordings, model and their difference, for each law."""
        from legfem.report.fit_figure import fit_figure

        return fit_figure(self.results)

    def write(self, folder: Given) -> Path:
        """Write result.json, report.txt, the figures and the fields; return the report's path."""
        from legfem.identify.run import write_results
        from legfem.report.identification import write_identification_report

        write_results(self.results, Path(folder), as_list=len(self.results) > 1)
        return write_identification_report(
            self.results, self.subject, self._experiment, Path(folder)
        )


@dataclass(frozen=True, eq=False)
class IdentifiedSpecimen(ByLaw["SpecimenResult"]):
    """A tissue's law identified from all recordings of a folder of specimens together."""

    folder: SpecimenFolder
    results: tuple[SpecimenResult, ...]
    """One a law."""

    def summary(self) -> str:
        """Return values, intervals, how well what was left out is predicted, and warnings."""
        from legfem.report.specimen import specimen_summary

        return specimen_summary(self.results)

    def document(self) -> list[dict[str, Any]]:
        """Return what ``result.json`` holds, one a law."""
        from legfem.report.specimen import specimen_document

        return [specimen_document(result) for result in self.results]

    def plot(self) -> Figure:
        """Return recordings, model and their difference, for each law."""
        from legfem.report.specimen_figure import specimen_figure

        return specimen_figure(self.results)

    def write(self, folder: Given) -> Path:
        """Write result.json, report.txt and the figure; return the report's path."""
        from legfem.report.specimen import write_specimen_report

        return write_specimen_report(self.results, Path(folder))


@overload
def identify(
    leg: Subject | Given,
    law: LawName | Literal["both"] = "both",
    *,
    correction: str = "auto",
    depth: float | None = None,
    settings: IdentificationSettings | None = None,
    mesh: PlaneStrainSettings | Literal["coarse"] | None = None,
    out: Given | None = None,
    jobs: int = 1,
    progress: bool = False,
    parameters: Sequence[Parameter] | None = None,
    fixed: Mapping[str, float] | None = None,
) -> IdentifiedLeg: ...
@overload
def identify(
    leg: SpecimenFolder,
    law: LawName | Literal["both"] = "both",
    *,
    settings: IdentificationSettings | None = None,
    out: Given | None = None,
    jobs: int = 1,
    progress: bool = False,
    parameters: Sequence[Parameter] | None = None,
    fixed: Mapping[str, float] | None = None,
    leave_out: Sequence[str] = (),
) -> IdentifiedSpecimen: ...
def identify(
    leg: Subject | SpecimenFolder | Given,
    law: LawName | Literal["both"] = "both",
    *,
    correction: str = "auto",
    depth: float | None = None,
    settings: IdentificationSettings | None = None,
    mesh: PlaneStrainSettings | Literal["coarse"] | None = None,
    out: Given | None = None,
    jobs: int = 1,
    progress: bool = False,
    parameters: Sequence[Parameter] | None = None,
    fixed: Mapping[str, float] | None = None,
    leave_out: Sequence[str] = (),
) -> IdentifiedLeg | IdentifiedSpecimen:
    """Identify the stiffness of a leg's tissues, or of specimens, from recordings.

    Parameters
    ----------
    leg : Subject, SpecimenFolder, str or Path
        The leg, or what `load_subject` takes; or what `load_specimen` returned.
    law : str
        ``"neo-hookean"``, ``"reduced-polynomial"`` or ``"both"``; ``"yeoh"`` and ``"exponential"``
        of specimens.
    correction : str
        Of the cylinder's ends: ``"own"``, ``"none"``, a file, or ``"auto"``: the leg's own where
        it is due.
    depth : float, optional
        Greatest displacement to use, mm.
    settings : IdentificationSettings, optional
        Of the search: weighting, seed, minimiser.
    mesh : PlaneStrainSettings or "coarse", optional
        Of the finite elements; ``"coarse"`` is for a quick look, and no result to rely on.
    out : str or Path, optional
        Folder that keeps every full solve, so that the same call goes on where it was stopped;
        nothing is written without it.
    jobs : int
        Processes. More than one needs the calling script's ``if __name__ == "__main__":``.
    progress : bool
        Whether to print what is being done.
    parameters : sequence of Parameter, optional
        What to identify, with bounds and priors; C10 and C20 of the deep tissue without them. See
        `legfem.identify.run.identify_subject`.
    fixed : Mapping[str, float], optional
        Values that are held in place of the folder's, by full name, in MPa, 1/MPa, N or mm.
    leave_out : sequence of str
        Recordings or specimens of a folder of specimens that are predicted, and not fitted. Of
        specimens there are no correction, depth and mesh to choose.

    Returns
    -------
    IdentifiedLeg or IdentifiedSpecimen
        With ``summary()``, ``plot()``, ``to_frame()``, ``document()``, ``write(folder)``.

    Raises
    ------
    InputError
        If the leg can't be meshed or its recordings can't be used.
    SearchError
        If too few full solves reach the measured depth.
    """
    from legfem.correction.choice import choose_correction
    from legfem.identify.laws import LAWS
    from legfem.identify.run import forward_model, identify_subject

    if not isinstance(leg, Subject | str | Path):
        return _identify_specimen(
            leg, law, leave_out, settings, out, jobs, progress, parameters, fixed
        )
    if law not in (*LAWS, "both"):
        raise InputError("law", repr(law), "unknown law", f"give one of {', '.join(LAWS)}, both")
    subject = leg if isinstance(leg, Subject) else load_subject(leg)
    if not subject.instrument.stated:
        raise InputError(
            subject.directory / SUBJECTS.file, "instrument", "missing",
            "add force_sd_N and displacement_sd_mm, or accuracies",
        )  # fmt: skip
    model = forward_model(subject, depth, parameters, fixed, _meshed(mesh))
    with _told(progress) as told:
        results = identify_subject(
            subject, [name for name in LAWS if law in ("both", name)], settings,
            choose_correction(correction, subject), None if out is None else Path(out), jobs,
            depth, told, model, parameters, fixed,
        )  # fmt: skip
    return IdentifiedLeg(subject, tuple(results), model.experiment)


def _identify_specimen(
    folder: SpecimenFolder,
    law: str,
    leave_out: Sequence[str],
    settings: IdentificationSettings | None,
    out: Given | None,
    jobs: int,
    progress: bool,
    parameters: Sequence[Parameter] | None,
    fixed: Mapping[str, float] | None,
) -> IdentifiedSpecimen:
    from legfem.specimens.identification import identify_specimen
    from legfem.specimens.laws import Asked, laws_named

    given = parameters or ()
    asked = Asked(
        tuple(one.name for one in given if one.role == "identified"),
        {one.name: one.prior for one in given if one.prior is not None},
        {one.name: one.bounds for one in given},
        fixed or {},
    )
    with _told(progress) as told:
        results = identify_specimen(
            folder, laws_named(law), asked, leave_out, settings,
            None if out is None else Path(out), jobs, told,
        )  # fmt: skip
    return IdentifiedSpecimen(folder, tuple(results))


def _meshed(mesh: PlaneStrainSettings | Literal["coarse"] | None) -> PlaneStrainSettings | None:
    if mesh != "coarse":
        return mesh
    from legfem.experiments.plane_strain import PlaneStrainSettings
    from legfem.meshing.section import SectionMeshSettings

    return PlaneStrainSettings(SectionMeshSettings().refined(1 / COARSENING))


# --- which physics was left out ---


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

    def _rows(self) -> Iterator[dict[str, Any]]:
        document = self.document()
        for when in ("before", "after"):
            for name, entry in document[f"parameters_{when}"].items():
                yield {"model": f"{when} repair"} | _row(name, entry)


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
    with _told(progress) as told:
        found = Diagnoser(folder, read_correction(REFERENCE), jobs).diagnose(subject, told, seed)
    return DiagnosedLeg(subject, found, seed, time.perf_counter() - started)


# --- a leg in its stocking ---


@dataclass(frozen=True, eq=False)
class LegInStocking(Found):
    """Stiffness and pressures of a leg in a compression stocking."""

    result: StockingResult

    def summary(self) -> str:
        """Return the report's text."""
        from legfem.report.stocking_text import stocking_page

        return stocking_page(self.result, None, [])

    def document(self) -> dict[str, Any]:
        """Return what ``result.json`` holds."""
        from legfem.stocking.document import stocking_document

        return stocking_document(self.result)

    def plot(self) -> Figure:
        """Return the pressure of the stocking on the skin, unrolled and on the leg."""
        from legfem.report.stocking_pressure_figure import stocking_pressure_figure

        return stocking_pressure_figure(self.result)

    def write(self, folder: Given) -> Path:
        """Write result.json, report.txt, figures and fields; return the report's path."""
        from legfem.report.stocking import write_stocking_report

        return write_stocking_report(self.result, Path(folder))

    def _rows(self) -> Iterator[dict[str, Any]]:
        for name, entry in self.document()["stiffness"].items():
            yield _row(name, entry["identified"] or entry["used_for_pressures"])


def stocking(
    leg: StockingLeg | Given,
    *,
    cells: int = 15_000,
    nelder_mead: bool = False,
    progress: bool = False,
) -> LegInStocking:
    """Find the stiffness of a leg's tissues from its scans, and the pressures inside it.

    Parameters
    ----------
    leg : StockingLeg, str or Path
        The leg, or what `load_leg` takes.
    cells : int
        About how many tetrahedra.
    nelder_mead : bool
        Whether to search as the paper does, too; it takes some 50 equilibria.
    progress : bool
        Whether to print what is being done.

    Returns
    -------
    LegInStocking
        With ``summary()``, ``plot()``, ``to_frame()``, ``document()``, ``write(folder)``.
    """
    from legfem.stocking.run import StockingSettings, run_leg

    known = load_leg(leg) if isinstance(leg, str | Path) else leg
    with _told(progress) as told:
        return LegInStocking(run_leg(known, StockingSettings(cells, nelder_mead), told))


# --- what they share ---


def _folder(given: Given, catalogue: Catalogue) -> Path:
    """Return the folder of an id, or the one that is given."""
    if isinstance(given, str) and given in catalogue.names:
        return catalogue.find(given)
    if not Path(given).is_dir():
        known = ", ".join(catalogue.names)
        raise InputError(
            str(given), "subject", "not found", f"give one of {known}, or the path of a folder"
        )
    return Path(given)


@contextmanager
def _told(progress: bool) -> Iterator[Progress]:
    if not progress:
        yield Silent()
        return
    with progress_on() as told:
        yield told


def _row(name: str, entry: Mapping[str, Any]) -> dict[str, Any]:
    low, high = entry.get("ci95") or (None, None)
    return {
        "parameter": name,
        "value": entry["value"],
        "low": low,
        "high": high,
        "unit": entry["unit"],
        "identifiability": entry.get("identifiability"),
    }
