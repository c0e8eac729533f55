"""What a diagnosis of a leg or a specimen returns."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from matplotlib.figure import Figure

from legfem.api.loading import Given
from legfem.api.results import Result
from legfem.common.documents import json_types, write_document
from legfem.inverse.fit import Fit, KindDetails
from legfem.inverse.plan import DesignValue
from legfem.inverse.verdict import Diagnosis
from legfem.report.diagnosis import diagnosis_web_page
from legfem.report.diagnosis_curves import recording_figure
from legfem.report.diagnosis_document import Recorded, document, parameter_rows
from legfem.report.folder import keep_another
from legfem.report.page import WebPage, command_line
from legfem.report.plan import plan_document
from legfem.report.render import plain_page
from legfem.report.results import write_diagnosis_report

if TYPE_CHECKING:
    from legfem.specimens.sizes import LeftOut

DIAGNOSIS = "diagnosis.json"


@dataclass(frozen=True, eq=False)
class Diagnosed(Result):
    """Where model and recordings of a leg or a specimen differ, and which physics was left out."""

    subject: Recorded
    diagnosis: Diagnosis
    seconds: float
    next_tests: tuple[DesignValue, ...] = ()
    """Tests that would tell what an ambiguous verdict leaves open, the most telling first."""
    left_out: "tuple[LeftOut, ...] | None" = None
    """Recordings of specimens that weren't used."""

    @property
    def verdict(self) -> str:
        """Return ``consistent``, ``named``, ``ambiguous`` or ``unexplained``."""
        return self.diagnosis.verdict

    @property
    def base(self) -> Fit[KindDetails]:
        """Return the base model's fit to all recordings, as an identification's, each recording a test."""
        return self.diagnosis.base

    def summary(self) -> str:
        """Return the report's text."""
        return plain_page(self._page(), [])

    def document(self) -> dict[str, Any]:
        """Return what ``diagnosis.json`` holds."""
        content = document(self.diagnosis, self.subject, self.seconds)
        if self.left_out is not None:
            content["recordings_not_used"] = json_types(self.left_out)
        if self.next_tests:
            content["next_experiment_ranked"] = plan_document(self.next_tests, self.subject.id)["tests"]
        return content

    def plot(self) -> Figure:
        """Return the recordings against the model, what it misses, and where."""
        return recording_figure(self.diagnosis, 0, self.subject.title, self.subject.origin)

    def write(self, folder: Given) -> Path:
        """Write diagnosis.json, report.txt, report.html and the figures; return report.txt's path."""
        keep_another(Path(folder), command_line(), DIAGNOSIS)
        write_document(Path(folder) / DIAGNOSIS, self.document())
        return write_diagnosis_report(self.diagnosis, self.subject, Path(folder), self.next_tests, command_line())

    def _page(self) -> WebPage:
        return diagnosis_web_page(self.diagnosis, self.subject, self.next_tests)

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters: a row each, with value, 95 % interval and unit."""
        return pd.DataFrame(list(parameter_rows(self.diagnosis)))
