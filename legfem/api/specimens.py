"""The front door's specimens: what diagnose does with a folder of them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib.figure import Figure

from legfem.api import loading
from legfem.api.results import DIAGNOSIS, Diagnosed, Result
from legfem.common.documents import write_document
from legfem.report.diagnosis_document import parameter_rows
from legfem.report.folder import REPORT, made_in_place
from legfem.report.page import WebPage
from legfem.report.specimen_results import specimens_document, specimens_page
from legfem.specimens.diagnosis import DiagnosedSpecimen, SpecimenDiagnoser, said_together
from legfem.specimens.folder import SpecimenFolder


@dataclass(frozen=True, eq=False)
class DiagnosedFolder(Result):
    """The same of each specimen of a folder."""

    folder: SpecimenFolder
    specimens: tuple[DiagnosedSpecimen, ...]
    """In the folder's order; one that couldn't be diagnosed has a problem instead."""
    _written: Path | None = None
    """The folder into which they were written as each diagnosis was made."""

    def __getitem__(self, name: str) -> Diagnosed:
        """Return a specimen's by its name; raises KeyError for one that isn't there, InputError for its problem."""
        found = {one.id: one for one in self.specimens}
        if name not in found:
            raise KeyError(f"{name!r} is not a specimen: there is {', '.join(found)}")
        return _of_specimen(self.folder, found[name])

    @property
    def _each(self) -> list[Diagnosed]:
        """Those that could be diagnosed."""
        return [_of_specimen(self.folder, one) for one in self.specimens if one.diagnosis is not None]

    @property
    def _first(self) -> Diagnosed:
        """The first of them; raises the first specimen's problem where there are none."""
        return next(iter(self._each), None) or _of_specimen(self.folder, self.specimens[0])

    @property
    def verdicts(self) -> dict[str, str]:
        """By specimen: ``consistent``, ``named``, ``ambiguous`` or ``unexplained``."""
        return {one.subject.id: one.verdict for one in self._each}

    def summary(self) -> str:
        """Return the report's text; of several specimens a table of all."""
        if len(self.specimens) == 1 and self.specimens[0].diagnosis is not None:
            return self._each[0].summary()
        return specimens_page(self.specimens, self.folder)

    def document(self) -> dict[str, Any]:
        """Return what ``diagnosis.json`` holds, by specimen."""
        return {one.subject.id: one.document() for one in self._each}

    def plot(self) -> Figure:
        """Return the first diagnosed specimen's recordings against the model.

        Raises
        ------
        InputError
            If none could be diagnosed.
        """
        return self._first.plot()

    def write(self, folder: loading.Given) -> Path:
        """Write what the command writes; return the report's path.

        Of one specimen that is a leg's; of several each has a folder of its name, and beside them stands a table of
        all.
        """
        out = Path(folder)
        if out == self._written:
            return out / REPORT
        for one in self._each:
            one.write(_place(self.folder, one.subject.id, out))
        return self._write_all(out)

    def _write_all(self, out: Path) -> Path:
        # Nothing is written where none could be diagnosed: asking for the first raises why.
        if self._first and len(self.folder.specimens) > 1:
            write_document(out / DIAGNOSIS, specimens_document(self.specimens, self.folder))
            with made_in_place(out) as hidden:
                (hidden / REPORT).write_text(specimens_page(self.specimens, self.folder), encoding="utf-8")
        return out / REPORT

    def _page(self) -> WebPage:
        """Return that of the first diagnosed specimen; each has one of its own."""
        return self._first._page()

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters of every specimen: a row each, with value, 95 % interval and unit."""
        return pd.DataFrame(
            {"specimen": one.subject.id} | row for one in self._each for row in parameter_rows(one.diagnosis)
        )


def _of_specimen(folder: SpecimenFolder, one: DiagnosedSpecimen) -> Diagnosed:
    if one.diagnosis is None:
        assert one.problem is not None
        raise one.problem
    left = one.left_out if len(folder.specimens) > 1 else (*folder.left_out, *one.left_out)
    return Diagnosed(one.diagnosis.subject, one.diagnosis, one.seconds, left_out=left)


def _place(folder: SpecimenFolder, name: str, out: Path) -> Path:
    """Return where a specimen's results go."""
    return out if len(folder.specimens) == 1 else out / name.replace(" ", "_").replace("/", "_")


def diagnose_folder(
    diagnoser: SpecimenDiagnoser, folder: SpecimenFolder, names: Sequence[str], out: Path | None
) -> DiagnosedFolder:
    """Return what `legfem.diagnose` finds in specimens; see there."""
    made: list[DiagnosedSpecimen] = []
    for one in diagnoser.diagnosed(folder, names):
        made.append(one)
        if out is not None and one.diagnosis is not None:
            _of_specimen(folder, one).write(_place(folder, one.id, out))
    told = said_together(made)
    for place, one in enumerate(made if told else ()):
        if one.diagnosis is not None:
            made[place] = replace(one, diagnosis=one.diagnosis.told(told))
            if out is not None:
                _of_specimen(folder, made[place]).write(_place(folder, one.id, out))
    found = DiagnosedFolder(folder, tuple(made), out)
    if out is not None:
        found._write_all(out)
    return found
