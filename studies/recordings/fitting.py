"""One folder of public recordings, fitted as a user would, and what came of it in a row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from legfem.common.documents import markdown_table
from legfem.inverse.catalogue import LawName
from legfem.specimens.folder import load_specimen
from legfem.specimens.laws import ONE
from legfem.specimens.problem import fit_specimens


@dataclass(frozen=True)
class Fitted:
    """A folder's fit; stiffness in kPa."""

    folder: str
    law: str
    recordings: int
    used: int
    values: dict[str, float]
    """C10 and what else the law has."""
    intervals: dict[str, tuple[float, float]]
    chi_square: float
    """Over its degrees of freedom."""
    converged: bool

    def row(self) -> list[str]:
        """Return the cells of a table."""
        cells = [f"{self.folder}", self.law, f"{self.used} of {self.recordings}"]
        for name in ("C10", "C20"):
            low, high = self.intervals.get(name, (0.0, 0.0))
            cells.append(f"{self.values[name]:.3g} ({low:.3g} to {high:.3g})" if name in self.values else "")
        return [*cells, f"{self.chi_square:.3g}", "yes" if self.converged else "no"]


def fitted(law: LawName, path: Path) -> Fitted:
    """Fit all recordings of a folder by one law, each specimen with a stiffness of its own."""
    folder = load_specimen(path)
    (fit,) = fit_specimens(folder, [law])
    named = {name.removeprefix(f"{ONE}."): one.shown for name, one in fit.estimates.items() if name.startswith(ONE)}
    stiff = {name: one for name, one in named.items() if name in ("C10", "C20")}
    return Fitted(
        folder.id,
        law,
        len(folder.recordings) + len(folder.left_out),
        len(fit.tests),
        {name: one.value for name, one in stiff.items()},
        {name: one.ci95 for name, one in stiff.items()},
        fit.goodness.chi_square / fit.goodness.degrees_of_freedom,
        fit.log.converged,
    )


def page(found: Sequence[Fitted]) -> str:
    """Return the table."""
    head = ("folder", "law", "recordings", "C10 (kPa)", "C20 (kPa)", "chi-square over freedom", "search converged")
    return markdown_table(head, [one.row() for one in found]) + "\nMeasured by others; sizes in part assumed.\n"
