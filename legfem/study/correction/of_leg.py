"""P(d) of a subject's own leg in 3D, beside that of the table of idealised legs."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from legfem.common.documents import Cells, column_cells, json_types, versions_of, write_atomically, write_document
from legfem.common.errors import Argument, InputError
from legfem.common.progress import Progress, progress_on
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.correction import DEFINITION, TabulatedCorrection
from legfem.inverse.search import SearchError
from legfem.legs.correction_of_leg import correction_of
from legfem.legs.forward import PlaneStrainForward
from legfem.legs.loading import load_subject
from legfem.legs.model_3d import SOLVES, LegModels
from legfem.legs.solver_3d import LegSolver, SolvedLeg
from legfem.legs.subject import Subject
from legfem.report import page as web
from legfem.report.curves import Curves, Line, curves_figure
from legfem.report.render import rendered, table
from legfem.report.style import save
from legfem.report.words import NOT_TESTED, TOLD, DataKind
from legfem.solve.path import ForceCurve
from legfem.study.correction.command import SHOWN, p_curves

DOCUMENT = "leg.json"
_LEG_COLOUR, _TABLE_COLOUR = "#0072B2", "#D55E00"


@dataclass(frozen=True, eq=False)
class LegAndTable:
    """A leg's own P and the table's at one stiffness (MPa); displacement in mm, all arrays (n,)."""

    subject: Subject
    models: LegModels
    c10: float
    c20: float
    displacement: FloatArray
    plane: ForceCurve
    solved: SolvedLeg
    table: TabulatedCorrection

    @property
    def stiffness(self) -> str:
        """C10 and C20 of the deep tissue in words."""
        return f"C10 {mpa_to_kpa(self.c10):g}, C20 {mpa_to_kpa(self.c20):g} kPa"

    @property
    def sd(self) -> FloatArray:
        """Standard deviation of the leg's P: mesh, length and first contact."""
        return np.sqrt(np.sum(np.square(list(self.solved.errors.values())), axis=0))

    @property
    def table_P(self) -> FloatArray:
        """P of the table of idealised legs."""
        return self.table.correction(self.displacement, np.asarray(self.c10), np.asarray(self.c20))


def run(
    directory: Path,
    stiffness: tuple[float, float],
    depth: float,
    out: Path,
    quiet: bool = False,
    comm: MPI.Intracomm = MPI.COMM_SELF,
) -> None:
    """Solve a subject's leg in 3D and in plane strain, and write how P compares.

    Parameters
    ----------
    directory
        Folder of the subject; its recordings aren't read.
    stiffness
        C10 and C20 of the deep tissue (MPa).
    depth
        mm.
    out
        Folder; solves are kept there.
    quiet
        Whether progress isn't told.
    comm
        Over whose ranks solves in 3D are spread; this is the first, which the others serve.

    Raises
    ------
    InputError
        If the folder is wrong, or a model stops short of the depth.
    """
    subject = load_subject(directory, need_recordings=False, need_instrument=False)
    with progress_on(quiet=quiet) as progress:
        models = LegModels.of_subject(subject, depth, out / SOLVES, progress=progress, comm=comm)
        found = _solved(subject, models, stiffness, progress)
    cells = _cells(found)
    print(f"P(d) of {subject.title}, {found.stiffness}\n{table(*cells)}\n")
    lines = [
        Line("this leg", found.solved.P, None, _LEG_COLOUR),
        Line("the table", found.table_P, None, _TABLE_COLOUR, "dashed"),
    ]
    title, more = "P over the cylinder's displacement", f"; {DEFINITION}. Grey: 95 % of this leg's."
    curves = p_curves("leg", title, more, found.displacement, lines, found.sd)
    drawn = curves_figure([curves], f"P(d), {found.stiffness}", subject.title, "simulated")
    figure = save(drawn, out, "leg", svg=True)
    write_document(out / DOCUMENT, json_types(_document(found)))
    write_atomically(out / web.PAGE, rendered(_page(found, curves, cells)))
    print(f"leg: {out / DOCUMENT}\nfigure: {figure[0]}\npage: {out / web.PAGE}")


def _solved(subject: Subject, models: LegModels, stiffness: tuple[float, float], progress: Progress) -> LegAndTable:
    values = dict(zip((DEEP_C10, DEEP_C20), stiffness, strict=True))
    progress.stage("the section in plane strain")
    plane = PlaneStrainForward.of_subject(subject, models.depth).solve(values, ())
    if not plane.complete:
        raise _too_deep(f"the section stops at {plane.curve.depth:.1f} mm")
    solver = LegSolver(models, progress)
    progress.stage(f"the leg in 3D: {models.leg.source}")
    try:
        solved = solver.at(values, plane.curve)
    except SearchError as failure:
        raise _too_deep(str(failure)) from None
    return LegAndTable(subject, models, *stiffness, solver.grid, plane.curve, solved, correction_of(subject))


def _too_deep(why: str) -> InputError:
    return InputError("correction", Argument("depth"), why, "press less deep, or a stiffer tissue")


def _cells(found: LegAndTable) -> Cells:
    at = SHOWN[SHOWN <= found.displacement[-1]]

    def there(values: FloatArray) -> tuple[str, FloatArray]:
        return "+.3f", np.interp(at, found.displacement, values)

    return column_cells(
        {
            "d (mm)": ("g", at),
            "RF3D (N)": (".3f", found.solved.outcome.curve(at)),
            "L RF2D (N)": (".3f", found.plane(at)),
            "P": there(found.solved.P),
            **{name: there(mode) for name, mode in found.solved.errors.items()},
            "sd": (".3f", there(found.sd)[1]),
            "table P": there(found.table_P),
            "table sd": (".3f", found.table.standard_deviation(at)),
        }
    )


def _document(found: LegAndTable) -> dict[str, Any]:
    outcome = found.solved.outcome
    return {
        "schema": 1,
        "subject": found.subject.id,
        "shape": found.models.leg.source,
        "extruded": found.models.leg.extruded,
        "definition": DEFINITION,
        "c10_kPa": round(mpa_to_kpa(found.c10), 9),
        "c20_kPa": round(mpa_to_kpa(found.c20), 9),
        "displacement_mm": found.displacement,
        "force_3d_N": outcome.curve(found.displacement),
        "force_2d_N": found.plane(found.displacement),
        "P": found.solved.P,
        "errors": found.solved.errors,
        "table": found.table.name,
        "table_P": found.table_P,
        "table_P_sd": found.table.standard_deviation(found.displacement),
        "factorisations": outcome.factorisations,
        "seconds": outcome.seconds,
        "versions": versions_of("dolfinx", "python"),
    }


def _page(found: LegAndTable, curves: Curves, cells: Cells) -> web.WebPage:
    P, table, sd = (float(v[-1]) for v in (found.solved.P, found.table_P, found.sd))
    depth, leg = float(found.displacement[-1]), found.models.leg
    outcome = found.solved.outcome
    around = f"{P - 1.96 * sd:+.3f} to {P + 1.96 * sd:+.3f}"
    work = f"{outcome.factorisations} factorisations"
    return web.WebPage(
        title="How much do the cylinder's ends change the force on this leg?",
        subject=found.subject.title,
        origin="simulated",
        headline=web.Headline(
            "caution" if leg.extruded or 1.96 * sd > abs(P) else "sound",
            f"On this leg the cylinder bears {100 * abs(P):.0f} % {'more' if P < 0 else 'less'} force than plane "
            f"strain says, {depth:g} mm deep.",
            [
                (
                    "How sure",
                    f"P is {P:+.3f} ± {sd:.3f} there (standard deviation: mesh, length of "
                    "the leg modelled, first contact).",
                ),
                ("What the table says", f"P {table:+.3f}, for idealised legs of this size."),
                ("What to do", "Identify with the leg itself: legfem identify --model 3d"),
            ],
            "What plane strain leaves out",
        ),
        warnings=[f"The leg is taken to be {leg.source}."] if leg.extruded else [],
        known=[
            web.Known(f"P at {depth:g} mm", f"{P:+.4f}", "computed", "this leg in 3D and in plane strain", around),
            web.Known("leg", f"{leg.shape.length:.4g} mm long", "assumed" if leg.extruded else "measured", leg.source),
            web.Known("stiffness of the deep tissue", found.stiffness, "assumed", "option, or legfem's usual"),
            web.Known("fat, fascia and cylinder", "as the folder says", "assumed", "subject.toml"),
            web.Known("work of the solve in 3D", work, "computed", f"{outcome.seconds:.0f} s"),
        ],
        chapters=[
            web.Chapter("This leg and the table", [curves, web.WebTable("Forces, P and its errors by depth", *cells)]),
            web.Chapter("How sure", [web.Prose(TOLD["leg_errors"])]),
            web.Chapter("What could not be tested", [web.Bullets(NOT_TESTED["correction_of_leg"])]),
        ],
        repeat=web.Repeat(web.command_line(), versions_of("dolfinx", "python")),
        data=DataKind("simulated data", "this leg's shape; nothing was pressed"),
    )
