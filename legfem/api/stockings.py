"""Stiffness found from scans of a leg in its stocking, and the pressures inside it."""

from pathlib import Path
from typing import Annotated

from mpi4py import MPI
from pydantic import Field

from legfem.api import loading
from legfem.api.results import Identification
from legfem.common.progress import progress_on
from legfem.stockings.identification import CELLS, by_tape, identify_in_stocking
from legfem.stockings.leg import StockingLeg

type Cells = Annotated[int, Field(ge=2_000, le=5_000_000), loading.Wanted("give 2000 to 5000000")]


@loading.checked
def stocking(
    leg: "StockingLeg | loading.Given",
    *,
    cells: Cells = CELLS,
    out: loading.Folder | None = None,
    progress: bool = False,
    comm: MPI.Intracomm | None = None,
) -> Identification:
    """Find the stiffness of a leg's tissues from its scans, and the pressures inside it; of one by tape, those on it.

    Parameters
    ----------
    leg : StockingLeg, str or Path
        The leg, or what `load_leg` takes.
    cells : int
        About how many tetrahedra.
    out : str or Path, optional
        Folder in whose ``equilibria`` every equilibrium is kept, so that the same call goes on where it was stopped;
        nothing is written without it.
    progress : bool
        Whether to print what is being done.
    comm : MPI.Intracomm, optional
        Ranks over which every equilibrium is spread, all of which call this; this process alone without it.

    Returns
    -------
    Identification
        With ``summary()``, ``plot()``, ``to_frame()``, ``document()``, ``write(folder)``; its ``best`` is a
        `legfem.inverse.fit.Fit`, whose details are `legfem.stockings.details.StockingDetails`.

    Raises
    ------
    InputError
        If there is no such leg, or its scans can't be used.

    Examples
    --------
    >>> import legfem as lf
    >>> worn = lf.stocking("1", cells=12_000)
    >>> print(worn.summary())
    >>> worn.best.computed["pressure_on_skin"].value
    """
    known = loading.load_leg(leg, cells) if isinstance(leg, str | Path) else leg
    if not isinstance(known, StockingLeg):
        raise loading.not_a_leg(known, "was scanned in a stocking", "load_leg")
    loading.check_folder("out", out)
    kept = None if out is None else Path(out) / "equilibria"
    ranks = comm or MPI.COMM_SELF
    with progress_on(quiet=not progress or ranks.rank > 0) as told:
        fit = by_tape(known) if known.girth_sd else identify_in_stocking(known, told, cells, ranks, folder=kept)
    return Identification(known, (fit,))
