"""A leg in its compression stocking: stiffness and pressures."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from mpi4py import MPI

from legfem.api.arguments import check_folder, check_whole, wrong
from legfem.api.loading import Given, load_leg
from legfem.api.results import Result, row
from legfem.common.errors import InputError
from legfem.common.progress import progress_on
from legfem.report.page import WebPage, command_line
from legfem.report.render.text import brief
from legfem.report.stocking import moved_surfaces, write_stocking_report
from legfem.report.stocking_figures import stocking_pressure_figure
from legfem.report.stocking_page import stocking_web_page
from legfem.report.stocking_pressures import PRESSURES
from legfem.report.stocking_stiffness import STIFFNESS
from legfem.stockings.document import stocking_document
from legfem.stockings.identification import StockingSettings, run_leg
from legfem.stockings.leg import StockingLeg
from legfem.stockings.result import StockingResult


@dataclass(frozen=True, eq=False)
class LegInStocking(Result):
    """Stiffness and pressures of a leg in a compression stocking."""

    result: StockingResult

    def summary(self) -> str:
        """Return what was found, in words."""
        return brief(stocking_web_page(self.result), (STIFFNESS, PRESSURES))

    def document(self) -> dict[str, Any]:
        """Return what ``result.json`` holds."""
        return stocking_document(self.result)

    def plot(self) -> Figure:
        """Return the pressure of the stocking on the skin, unrolled and on the leg."""
        return stocking_pressure_figure(self.result)

    def write(self, folder: Given) -> Path:
        """Write result.json, report.txt, figures and fields; return the report's path."""
        return write_stocking_report(self.result, Path(folder), command_line())

    def _page(self) -> WebPage:
        return stocking_web_page(self.result, moved_surfaces(self.result))

    def _rows(self) -> Iterator[dict[str, Any]]:
        for name, entry in self.document()["stiffness"].items():
            yield row(name, entry["identified"] or entry["used_for_pressures"])


def stocking(
    leg: StockingLeg | Given,
    *,
    cells: int = 15_000,
    nelder_mead: bool = False,
    out: Given | None = None,
    progress: bool = False,
    comm: MPI.Intracomm | None = None,
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
    out : str or Path, optional
        Folder in whose ``equilibria`` every equilibrium is kept, so that the same call goes on where it was stopped;
        nothing is written without it.
    progress : bool
        Whether to print what is being done.
    comm : MPI.Intracomm, optional
        Ranks over which every equilibrium is spread, all of which call this; this process alone without it.

    Returns
    -------
    LegInStocking
        With ``summary()``, ``plot()``, ``to_frame()``, ``document()``, ``write(folder)``.

    Raises
    ------
    InputError
        If there is no such leg, or its scans can't be used.
    """
    known = load_leg(leg) if isinstance(leg, str | Path) else leg
    if not isinstance(known, StockingLeg):
        raise InputError(
            "leg",
            type(known).__name__,
            "is no leg that was scanned in a stocking",
            "give an id, a folder, or what load_leg returned",
        )
    check_whole("cells", cells, 1)
    if not 2_000 <= cells <= 5_000_000:
        raise wrong("cells", cells, "is out of range", "give 2000 to 5000000")
    if out is not None:
        check_folder("out", out)
    kept = None if out is None else Path(out) / "equilibria"
    ranks = comm or MPI.COMM_SELF
    with progress_on(quiet=not progress or ranks.rank > 0) as told:
        return LegInStocking(run_leg(known, StockingSettings(cells, nelder_mead), told, ranks, folder=kept))
