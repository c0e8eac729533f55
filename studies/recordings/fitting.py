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
from studies.cases.outcomes import Interval


@dataclass(frozen=True)
class Fitted:
    """A folder's fit; stiffness in kPa."""

    folder: str
    law: str
    recordings: int
    used: int
    stiffness: dict[str, Interval]
    """C10 and what else the law has."""
    chi_square: float
    """Over its degrees of freedom."""
    converged: bool

    def row(self) -> list[str]:
        """Return the cells of a table."""
        cells = [f"{self.folder}", self.law, f"{self.used} of {self.recordings}"]
        for name in ("C10", "C20"):
            one = self.stiffness.get(name)
            cells.append("" if one is None else f"{one.value:.3g} ({one.low:.3g} to {one.high:.3g})")
        return [*cells, f"{self.chi_square:.3g}", "yes" if self.converged else "no"]


def fitted(law: LawName, path: Path) -> Fitted:
    """Fit all recordings of a folder by one law, each specimen with a stiffness of its own."""
    folder = load_specimen(path)
    (fit,) = fit_specimens(folder, [law])
    named = {name: fit.estimates.get(f"{ONE}.{name}") for name in ("C10", "C20")}
    return Fitted(
        folder.id,
        law,
        len(folder.recordings) + len(folder.left_out),
        len(fit.tests),
        {name: Interval.of(one) for name, one in named.items() if one is not None},
        fit.goodness.chi_square / fit.goodness.degrees_of_freedom,
        fit.log.converged,
    )


def page(found: Sequence[Fitted]) -> str:
    """Return the table."""
    head = ("folder", "law", "recordings", "C10 (kPa)", "C20 (kPa)", "chi-square over freedom", "search converged")
    return markdown_table(head, [one.row() for one in found]) + "\nMeasured by others; sizes in part assumed.\n"
