"""What ``legfem study correction`` does and writes: documents, and a page of what P is and depends on."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.common import documents
from legfem.common.progress import progress_on
from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.experiments.leg_3d import IdealisedLegIndentation
from legfem.fem.field_files import write_fields
from legfem.fem.fields import fields_of
from legfem.inverse.correction import DEFINITION
from legfem.report import page as web
from legfem.report.curves import Curves, Dash, Line, curves_figure
from legfem.report.render import brief, rendered
from legfem.report.style import save
from legfem.report.words import NOT_TESTED, TOLD, WORDS, DataKind
from legfem.study.correction import calibration
from legfem.study.correction.cases import CaseOutcome, CorrectionCase

DOCUMENT = "correction.json"
Trend = Mapping[str, Mapping[str, FloatArray]]
"""P by the value of what is varied, by what that is."""
DEPENDS_ON, HOW_SURE = "What it depends on", "How sure"


def run(
    given: calibration.Calibration,
    out: Path,
    jobs: int,
    quiet: bool = False,
    *,
    trends: bool = False,
    legs: bool = False,
    fields: bool = False,
) -> tuple[calibration.Calibrated, dict[str, FloatArray]]:
    """Calibrate, and look at what P depends on; collective over all ranks.

    Parameters
    ----------
    given
        What is calibrated.
    out
        Folder; solved models are kept there.
    jobs
        Processes.
    quiet
        Whether progress isn't told.
    trends
        Whether to look at other lengths, stiffnesses and radii of the leg.
    legs
        Whether to tabulate P over legs of several sizes.
    fields
        Whether to write the reference leg's fields for ParaView, which solves it once more.

    Returns
    -------
    Calibrated
        The correction.
    dict of array
        P of cylinders of other lengths, every half a millimetre.
    """
    comm = MPI.COMM_WORLD
    first, kept = comm.rank == 0, out / "cases"
    with progress_on(quiet=quiet or not first) as progress:
        found = calibration.calibrate(given, kept, jobs, progress, comm)
        if first:
            print(f"correction: {found.correction.write(out / DOCUMENT)}", flush=True)
        if fields:
            written = write_leg_fields(given.reference, out, comm)
            if first:
                print(f"fields: {', '.join(map(str, written))}", flush=True)
        if legs:
            tabulated = calibration.tabulate_legs(calibration.LegTable(given), kept, jobs, progress, comm)
            if first:
                print(f"legs: {tabulated.write(out / 'correction-legs.json')}", flush=True)
        studied = dict[str, dict[str, FloatArray]]()
        for name, cases in _trend_cases(given, trends).items():
            progress.stage(f"P against the {name}", len(cases))
            outcomes = calibration.run_cases(list(cases.values()), kept, jobs, progress, comm)
            studied[name] = dict(zip(cases, map(_as_far_as_it_came, cases.values(), outcomes), strict=True))
    if first:
        _write(found, studied, out, trends)
    return found, studied[LENGTH]


def _as_far_as_it_came(case: CorrectionCase, outcome: CaseOutcome) -> FloatArray:
    """Return P on the case's grid, not-a-number beyond what it reached."""
    curve = np.full(len(case.displacement), np.nan)
    if outcome.reached >= 5:
        there = case.displacement <= outcome.reached + 1e-9
        curve[there] = outcome.P(case.displacement)[there]
    return curve


def _write(found: calibration.Calibrated, studied: Trend, out: Path, trends: bool) -> None:
    page, displacement = correction_web_page(found, studied, web.command_line()), found.correction.displacement
    print(brief(page, (DEPENDS_ON, HOW_SURE) if trends else (HOW_SURE,)))
    documents.write_atomically(out / web.PAGE, rendered(page))
    print(f"page: {out / web.PAGE}")
    if trends:
        curves_of = {name: {k: np.round(v, 5) for k, v in curves.items()} for name, curves in studied.items()}
        document = {"schema": 1, "displacement_mm": displacement, "P": curves_of}
        documents.write_document(out / "trends.json", documents.json_types(document))
        blocks, name = trend_curves(displacement, studied), found.correction.name
        drawn = save(curves_figure(blocks, "What P depends on", name, "simulated"), out, "trends", svg=True)
        print(f"figure: {drawn[0]}")


def write_leg_fields(case: CorrectionCase, out: Path, comm: MPI.Intracomm = MPI.COMM_SELF) -> list[Path]:
    """Solve a case's 3D model and write its fields at the depth it reached; collective."""
    experiment = IdealisedLegIndentation(case.leg, case.cylinder, case.material.laws, 3, case.settings, comm)
    solved = experiment.solve(depth=case.depth)
    return write_fields(fields_of(experiment.system), out, solved.report.reached)


LENGTH = "cylinder's length (mm)"


def _trend_cases(given: calibration.Calibration, all_of_them: bool) -> dict[str, dict[str, CorrectionCase]]:
    """Return what is varied: the cylinder's length, and what else P may depend on."""
    # The coarse mesh doesn't carry the longest cylinder to 25 mm.
    between, coarse = (calibration.coarsened(given.reference, factor) for factor in (given.between, given.coarse))
    fitting = [length for length in (30.0, 50.0, 70.0) if length < between.leg.length]
    cylinders = {f"{one:g}": replace(between, cylinder=replace(between.cylinder, length=one)) for one in fitting}
    if not all_of_them:
        return {LENGTH: cylinders}
    leg, material = coarse.leg, coarse.material
    legs = {f"{length:g}": replace(leg, length=length) for length in (60.0, 80.0, 100.0, 120.0, 150.0, 200.0)}
    legs |= {f"{length:g} held": replace(leg, length=length, ends="held") for length in (80, 200)}
    c10s, ratios = (0.2, 0.5, 2.0, 5.0), (0.0, 1.0, 3.0)
    stiffnesses = {f"{c10:g}": replace(material, C10_kPa=c10) for c10 in c10s}
    stiffenings = {f"{ratio:g}": replace(material, C20_kPa=ratio * material.C10_kPa) for ratio in ratios}
    radii = {f"{radius:g}": replace(leg, radius=radius) for radius in (50.0, 57.0, 64.0)}
    return {
        LENGTH: cylinders,
        "leg's length (mm)": {name: replace(coarse, leg=one) for name, one in legs.items()},
        "C10 (kPa)": {name: replace(coarse, material=one) for name, one in stiffnesses.items()},
        "C20/C10": {name: replace(coarse, material=one) for name, one in stiffenings.items()},
        "leg's radius (mm)": {name: replace(coarse, leg=one) for name, one in radii.items()},
    }


SHOWN = np.array([2.5, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0])
"""Depths of the tables, mm."""


def correction_cells(found: calibration.Calibrated) -> documents.Cells:
    """Forces, P and its errors, a row a depth."""
    correction, reference = found.correction, found.reference
    depths = SHOWN[SHOWN <= correction.displacement[-1]]
    modes = {name: np.interp(depths, correction.displacement, mode) for name, mode in correction.errors.items()}
    return documents.column_cells(
        {
            "d (mm)": ("g", depths),
            "RF3D (N)": (".3f", reference.spatial(depths)),
            "L RF2D (N)": (".3f", reference.plane(depths)),
            "P": ("+.4f", reference.P(depths)),
            **{name: ("+.4f", mode) for name, mode in modes.items()},
            "sd": (".4f", correction.standard_deviation(depths)),
        }
    )


def meshes_cells(found: calibration.Calibrated) -> documents.Cells:
    """P on the meshes, a row a mesh, and the finest one's error by Richardson's estimate."""
    displacement = found.correction.displacement
    depths = SHOWN[SHOWN <= displacement[-1]]
    meshes = found.outcomes[:3]
    values = [outcome.P(depths) for outcome in meshes]
    limit = values[0] + np.interp(depths, displacement, found.correction.errors["mesh"])
    rows = [
        {
            "unknowns": f"{one.unknowns}",
            **_at(depths, P),
            "tangents": f"{one.factorisations}",
            "time (s)": f"{one.seconds:.0f}",
        }
        for one, P in reversed(list(zip(meshes, values, strict=True)))
    ]
    return documents.row_cells([*rows, {"unknowns": "limit", **_at(depths, limit), "tangents": "", "time (s)": ""}])


def trend_cells(name: str, displacement: FloatArray, curves: Mapping[str, FloatArray]) -> documents.Cells:
    """P, a row a value of what is varied."""
    depths = SHOWN[SHOWN <= displacement[-1]]
    return documents.row_cells(
        {name: value, **_at(depths, np.interp(depths, displacement, curve))} for value, curve in curves.items()
    )


def _at(depths: FloatArray, P: FloatArray) -> dict[str, str]:
    return {f"{d:g} mm": "-" if np.isnan(p) else f"{p:+.4f}" for d, p in zip(depths, P, strict=True)}


COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#111111", "#8C8C8C")


_DASHES: tuple[Dash, ...] = ("dashed", "dotted", "dotdash", "solid")


def correction_web_page(found: calibration.Calibrated, trends: Trend, command: str) -> web.WebPage:
    """Return the page of a calibration.

    Parameters
    ----------
    found
        The correction.
    trends
        P on a coarser mesh against what it depends on.
    command
        That was given; empty where there was none.
    """
    grid = found.correction.displacement
    tables = [
        web.WebTable(f"P against the {name}", *trend_cells(name, grid, curves), folded=True)
        for name, curves in trends.items()
    ]
    return web.WebPage(
        title="How much do a cylinder's ends change the force on a leg?",
        subject=found.correction.name,
        origin="simulated",
        headline=_headline(found),
        warnings=_warnings(found),
        known=_known(found),
        chapters=[
            web.Chapter("The correction", [_correction(found)]),
            web.Chapter(DEPENDS_ON, [*trend_curves(grid, trends), *tables]),
            web.Chapter(
                HOW_SURE,
                [
                    web.Prose(TOLD["three_parts"]),
                    web.WebTable("Forces, P and its errors by depth", *correction_cells(found)),
                    web.WebTable("P on three meshes, and in the limit", *meshes_cells(found)),
                ],
            ),
            web.Chapter("What could not be tested", [web.Bullets(NOT_TESTED["correction"])]),
            web.Chapter("What to do next", [web.Bullets(WORDS["after_correction"])]),
        ],
        repeat=web.Repeat(command, documents.versions_of("dolfinx", "python")),
        data=DataKind("simulated data", "an idealised leg; no leg was measured"),
    )


def _at_end(found: calibration.Calibrated) -> tuple[float, float, float]:
    """Return depth (mm), P and its standard deviation there, of the reference material."""
    x = found.correction.displacement
    return float(x[-1]), float(found.P_of_reference()[-1]), float(found.correction.standard_deviation(x)[-1])


def _headline(found: calibration.Calibrated) -> web.Headline:
    depth, P, sd = _at_end(found)
    length, share = found.given.reference.cylinder.length, f"{100 * abs(P):.0f} %"
    beside, without = "the force that", "Hardly anything"
    if share != "0 %":
        beside = f"{share} {'more' if P < 0 else 'less'} force than"
        without = f"Without this correction, C10 would be about {share} too {'high' if P < 0 else 'low'}"
    return web.Headline(
        "caution" if _warnings(found) or 1.96 * sd > abs(P) else "sound",
        f"At a depth of {depth:g} mm, a cylinder {length:g} mm long meets {beside} plane strain predicts.",
        [
            (
                "How sure",
                f"P is {P:+.2f} ± {sd:.2f} at that depth (one standard deviation, from the mesh, the leg's length and "
                "first contact).",
            ),
            ("What it does to C10", f"{without}; legfem identify applies it."),
            ("What to do", WORDS["after_correction"][0]),
        ],
        "What plane strain leaves out",
    )


def _warnings(found: calibration.Calibrated) -> list[str]:
    softened = sum(outcome.softened for outcome in found.outcomes)
    return [f"{softened} of {len(found.outcomes)} models needed a softer contact to go on."] if softened else []


def _known(found: calibration.Calibrated) -> list[web.Known]:
    case, (depth, P, sd) = found.given.reference, _at_end(found)
    leg, cylinder, material = case.leg, case.cylinder, case.material
    option = "option, or legfem's usual"
    return [
        web.Known(
            f"P at {depth:g} mm",
            f"{P:+.4f}",
            "computed",
            "both models of one leg",
            f"{P - 1.96 * sd:+.3f} to {P + 1.96 * sd:+.3f}",
        ),
        web.Known("leg", f"radius {leg.radius:g} mm, {leg.length:g} mm long, ends {leg.ends}", "assumed", option),
        web.Known("bone", f"radius {leg.bone_radius:g} mm, {leg.depth_to_bone:g} mm deep", "assumed", option),
        web.Known(
            "cylinder",
            f"{2 * cylinder.radius:g} mm across, {cylinder.length:g} mm long, "
            f"edges rounded by {cylinder.edge_radius:g} mm",
            "assumed",
            option,
        ),
        web.Known("C10 of the deep tissue, reference", f"{material.C10_kPa:g} kPa", "assumed", option),
        web.Known(
            "C10 of fat and fascia",
            f"{material.superficial_C10_kPa:g} and {material.fascia_C10_kPa:g} kPa",
            "assumed",
            "the paper",
        ),
        web.Known("error of the leg's length", f"{100 * found.given.spread:g} %", "prior", "legfem's usual"),
        web.Known(
            "error of the balance of forces", f"{found.reference.balance:.1e} of the force", "computed", "the 3D model"
        ),
    ]


def _correction(found: calibration.Calibrated) -> Curves:
    correction, reference = found.correction, found.given.reference.material.C10_kPa
    x = correction.displacement
    lines = [Line(f"C10 {reference:g} kPa, the reference", found.P_of_reference(), None)]
    for k, c10 in enumerate(c10 for c10 in found.given.c10_kPa if c10 != reference):
        at = correction.correction(x, kpa_to_mpa(np.array(c10)), np.array(0.0))
        lines.append(Line(f"C10 {c10:g} kPa", at, None, COLOURS[k % 7], _DASHES[k % 4]))
    title, more = "P over the cylinder's displacement, by the deep tissue's C10", "95 % of the reference's"
    sd = correction.standard_deviation(x)
    return p_curves("correction", title, f"; {DEFINITION}. Grey: {more}.", x, lines, sd)


def p_curves(
    name: str, title: str, more: str, displacement: FloatArray, lines: list[Line], sd: FloatArray | None = None
) -> Curves:
    """Return P over the displacement, with the 95 % about the first line where its standard deviation is given."""
    band, band_name = (None, "") if sd is None else (1.96 * sd, "95 %")
    return Curves(name, title, more, displacement, "displacement (mm)", "P", lines, band, band_name)


def trend_curves(displacement: FloatArray, trends: Trend) -> list[Curves]:
    """P against all that it depends on."""
    blocks, more = [], "; lines end where a model stopped."
    for number, (name, curves) in enumerate(trends.items()):
        lines = [
            Line(f"{name}: {value}", curve, None, COLOURS[k % 7], _DASHES[k % 4])
            for k, (value, curve) in enumerate(curves.items())
        ]
        title = f"P against the {name}, on a coarser mesh"
        blocks.append(p_curves(f"trend{number}", title, more, displacement, lines))
    return blocks
