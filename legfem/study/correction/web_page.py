"""``report.html`` of a calibrated 3D correction: how large it is, how sure, what it rests on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from legfem.common.units import FloatArray
from legfem.legs.correction import DEFINITION
from legfem.report import page as web
from legfem.report.page import Curves, Dash, Line
from legfem.study.correction import tables
from legfem.study.correction.calibration import Calibrated, Calibration, versions

Trend = Mapping[str, Mapping[str, FloatArray]]
"""P by the value of what is varied, by what that is."""
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C8C8C")
_DASHES: tuple[Dash, ...] = ("dashed", "dotted", "dotdash", "solid")
_NOT_TESTED = (
    "A real leg's shape: the leg here is a straight cylinder with one bone. --legs tabulates other "
    "girths and depths of the bone.",
    "A cylinder that isn't pressed square on, or slips.",
    "Stiffness beyond the table: there P is taken as at its edge.",
)


def correction_web_page(given: Calibration, found: Calibrated, trends: Trend, command: str) -> web.WebPage:
    """Return the page of a calibration.

    Parameters
    ----------
    given
        What was calibrated.
    found
        The correction.
    trends
        P on a coarser mesh against what it depends on.
    command
        That was given; empty where there was none.
    """
    return web.WebPage(
        title="How much do a cylinder's ends change the force on a leg?",
        subject=found.correction.name,
        origin="simulated",
        headline=_headline(given, found),
        warnings=_warnings(found),
        known=_known(given, found),
        chapters=[
            web.Chapter("The correction", [_correction(given, found)]),
            web.Chapter("What it depends on", _dependence(trends)),
            web.Chapter("How sure", _sure(found)),
            web.Chapter("What could not be tested", [web.Bullets(_NOT_TESTED)]),
            web.Chapter("What to do next", [web.Bullets(_next())]),
        ],
        repeat=web.Repeat(command, versions()),
        data="simulated data (an idealised leg; no leg was measured)",
    )


def _at_end(given: Calibration, found: Calibrated) -> tuple[float, float, float]:
    """Return depth (mm), P and its standard deviation there, of the reference material."""
    correction, material = found.correction, given.reference.material
    depth = correction.displacement[-1:]
    P = correction.correction(depth, np.array(material.C10_kPa), np.array(material.C20_kPa))
    return float(depth[0]), float(P[0]), float(correction.standard_deviation(depth)[0])


def _headline(given: Calibration, found: Calibrated) -> web.Headline:
    depth, P, sd = _at_end(given, found)
    more = "more" if P < 0 else "less"
    length = given.reference.cylinder.length
    share = f"{100 * abs(P):.0f} %"
    return web.Headline(
        "caution" if _warnings(found) or 1.96 * sd > abs(P) else "sound",
        f"A cylinder of {length:g} mm bears "
        + ("the force that plane strain says" if share == "0 %" else f"{share} {more} force than plane strain says")
        + f", {depth:g} mm deep.",
        [
            (
                "How sure",
                f"P is {P:+.3f} ± {sd:.3f} there (standard deviation: mesh, the leg's length, first contact).",
            ),
            (
                "Effect on C10",
                (
                    "Next to nothing"
                    if share == "0 %"
                    else f"Left out, it makes C10 about {share} too {'high' if P < 0 else 'low'}"
                )
                + ": legfem's identification applies it.",
            ),
            ("What to do", _next()[0]),
        ],
        "What plane strain leaves out",
    )


def _warnings(found: Calibrated) -> list[str]:
    softened = sum(outcome.softened for outcome in found.outcomes)
    if not softened:
        return []
    return [f"{softened} of {len(found.outcomes)} models needed a softer contact to go on."]


def _next() -> list[str]:
    return [
        "Give it to an identification: python -m legfem.identify --subject 3 --correction correction.json",
        "For a leg of another girth or depth to the bone, calibrate with --legs.",
    ]


def _known(given: Calibration, found: Calibrated) -> list[web.Known]:
    leg, cylinder, material = (given.reference.leg, given.reference.cylinder, given.reference.material)
    depth, P, sd = _at_end(given, found)
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
        web.Known("error of the leg's length", f"{100 * given.spread:g} %", "prior", "legfem's usual"),
        web.Known(
            "error of the balance of forces", f"{found.reference.balance:.1e} of the force", "computed", "the 3D model"
        ),
    ]


def _correction(given: Calibration, found: Calibrated) -> Curves:
    correction, material = found.correction, given.reference.material
    x = correction.displacement
    C10, C20 = np.array(material.C10_kPa), np.array(material.C20_kPa)
    P = correction.correction(x, C10, C20)
    lines = [Line(f"C10 {material.C10_kPa:g} kPa", P, None)]
    for k, c10 in enumerate(given.c10_kPa):
        at = correction.correction(x, np.array(c10), np.array(0.0))
        lines.append(Line(f"C10 {c10:g} kPa", at, None, _COLOURS[k % 7], _DASHES[k % 4]))
    return Curves(
        "correction",
        f"P over the cylinder's displacement, by the deep tissue's C10; {DEFINITION}. Grey: 95 % of the reference's.",
        x,
        "displacement (mm)",
        "P",
        "",
        lines,
        1.96 * correction.standard_deviation(x),
        "95 %",
    )


def _dependence(trends: Trend) -> list[web.Block]:
    return [
        Curves(
            f"trend{number}",
            f"P against the {name}, on a coarser mesh; lines end where a model stopped.",
            tables.grid_of(curves),
            "displacement (mm)",
            "P",
            "",
            [
                Line(f"{name}: {value}", curve, None, _COLOURS[k % 7], _DASHES[k % 4])
                for k, (value, curve) in enumerate(curves.items())
            ],
        )
        for number, (name, curves) in enumerate(trends.items())
    ]


def _sure(found: Calibrated) -> list[web.Block]:
    return [
        web.Prose(
            "Errors of P are modes over the displacement: of the mesh by Richardson's estimate, "
            "of a leg shorter or longer, and of the first contact."
        ),
        web.WebTable("Forces, P and its errors by depth", *tables.correction_cells(found)),
        web.WebTable("P on three meshes, and in the limit", *tables.meshes_cells(found)),
    ]
