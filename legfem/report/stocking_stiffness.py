"""Stiffness of muscle and fat on a stocking's page, and where model and scan differ."""

from collections.abc import Iterator

import numpy as np

from legfem.common.numbers import short_probability
from legfem.geometry.slices import CONTOURS
from legfem.report.curves import Curves, Line
from legfem.report.estimates import held_text, how_found, words_of
from legfem.report.page import Block, Prose, WebTable
from legfem.report.style import FAINT
from legfem.report.words import ROUND, TOLD, Directions, capital, round_leg, unwrapped
from legfem.stockings.contour_distances import CONTOUR_NAMES
from legfem.stockings.details import StockingDetails, StockingFit
from legfem.stockings.discrepancy import ModelDiscrepancy
from legfem.stockings.scan_fit import ScanFit

STIFFNESS = "Stiffness of muscle and fat"
"""Title of the chapter."""


def stiffness_blocks(fit: StockingFit) -> list[Block]:
    """Return how well the values are known, how well they fit, and how they were searched for."""
    details, leg = fit.details, fit.details.leg
    given = ", ".join(f"{words_of(name)} {held_text(name, value)}" for name, value in details.parameters.items())
    best = details.best
    if best is None:
        why = details.problem or "the leg was not scanned in its stocking"
        return [Prose(f"Not identified: {why}. Given: {given}.")]
    fabric = TOLD["fabric_left_out"]
    if known := 100 * leg.accuracy.tension_sd:
        by = " and the sensors" if details.sensors else ""
        fabric = f"They include an error of {known:g} % (sd) of the fabric's tension, which the scans{by} narrow."
    errors = TOLD["errors_of_stocking"].format(fabric=fabric)
    used = f"The pressures below are not of these values but of those given: {given}."
    return [Prose(errors), Prose(_goodness(details, best)), *how_found([fit]), *([Prose(used)] if leg.known else [])]


def _goodness(details: StockingDetails, best: ScanFit) -> str:
    leg, misfit = details.leg, best.misfit
    bare, expected = float(np.sqrt(np.mean(misfit.distances(leg.bare) ** 2))), leg.accuracy.expected_rms
    shift = ", ".join(f"{value:.2f}" for value in best.rigid[:3])
    turn = ", ".join(f"{value:.2f}" for value in np.degrees(best.rigid[3:]))
    sizes = {"met": best.rms, "expected": expected, "bare": bare, "weighted": best.weighted_misfit}
    return TOLD["contours_met"].format(slices=len(misfit.target.levels), shift=shift, turn=turn, **sizes)


_SLICE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")


def contour_curves(details: StockingDetails) -> Iterator[Curves]:
    """Distances of the best fit from the scan by slice, skin and hull apart; nothing where there is no fit."""
    found, leg = details.best, details.leg
    if found is None:
        return
    misfit = found.misfit
    shapes = [misfit.target.contours(name).shape[:2] for name in CONTOURS]
    fitted, bare = (
        np.split(misfit.distances(misfit.moved(shape, found.rigid)), [shapes[0][0] * shapes[0][1]])
        for shape in (found.shape, leg.bare)
    )
    for name, of_fit, of_bare, shape in zip(CONTOURS, fitted, bare, shapes, strict=True):
        lines = [Line("scan in the stocking", np.zeros(len(ROUND)), None, FAINT)]
        rows = zip(unwrapped(misfit.target.contours(name)), of_fit.reshape(shape), of_bare.reshape(shape), strict=True)
        for (angles, *both), level, colour in zip(rows, misfit.target.levels, _SLICE_COLOURS, strict=True):
            model, before = (round_leg(angles, distances) for distances in both)
            lines += [
                Line(f"model, z = {level:.0f} mm", model, None, colour),
                Line("bare", before, None, colour, "dotted", faint=True, tabled=False),
            ]
        yield Curves(
            f"contour-{name}",
            capital(CONTOUR_NAMES[name]),
            TOLD["contour"],
            ROUND,
            Directions.of(leg.bare).axis(),
            "distance outside the scan (mm)",
            lines,
            np.full(len(ROUND), 1.96 * leg.accuracy.expected_rms),
            "errors of the contours, 95 %",
        )


def discrepancy_blocks(found: ModelDiscrepancy) -> list[Block]:
    """Return the verdict, the places that differ, and what was tried as a reason."""
    blocks: list[Block] = [Prose(discrepancy_verdict(found))]
    places = [
        {
            "contour": CONTOUR_NAMES[p.contour],
            "angle from +x to +y (°)": f"{p.angle_deg:.0f}",
            "heights z (mm)": f"{p.levels[0]:.0f} to {p.levels[1]:.0f}",
            "distance (mm)": f"{p.distance:+.2f}",
            "p": short_probability(p.p_value),
        }
        for p in found.places
    ]
    if places:
        blocks.append(WebTable.of("Places that differ beyond the errors: the model outside the scan", places))
    tried = [
        [s.name.replace("-", " "), s.statement, f"{s.statistic:.1f} on {s.degrees}", short_probability(s.p_value)]
        for s in found.scores
    ]
    caption = "What was tried as a reason (p: family-wise, of a sign as strong by chance)"
    return [*blocks, WebTable(caption, ["mechanism", "what it is", "chi-square", "p"], tried)]


def discrepancy_verdict(found: ModelDiscrepancy) -> str:
    """Return in words whether model and scan differ, and why."""
    if found.verdict == "consistent":
        return TOLD["consistent_contours"]
    if found.verdict == "unexplained":
        return TOLD["unexplained_contours"]
    statements = {score.name: score.statement for score in found.scores}
    named = " or ".join(f"{name} ({statements[name]})" for name in found.named)
    text = f"{'Named' if found.verdict == 'named' else 'Ambiguous'}: {named}."
    if found.rms_after_mm is not None and found.c10_after_kPa is not None:
        muscle, fat = found.c10_after_kPa
        met = {"after": found.rms_after_mm, "before": found.rms_before_mm, "muscle": muscle, "fat": fat}
        text += TOLD["contours_with"].format(cause=found.named[0], **met)
    return text
