"""What a stocking's page says of where model and scan differ."""

from __future__ import annotations

from legfem.common.units import mpa_to_kpa
from legfem.report.web import page as web
from legfem.report.words import short_probability
from legfem.stockings.discrepancy import Mismatch

CONTOURS = {"outer": "skin", "inner": "hull of the muscle"}


def mismatch_blocks(found: Mismatch) -> list[web.Block]:
    """Return the verdict, the places that differ, and what was tried as a reason."""
    blocks: list[web.Block] = [web.Prose(mismatch_verdict(found))]
    if found.places:
        blocks.append(
            web.WebTable(
                "Places that differ beyond the errors: the model outside the scan",
                ["contour", "angle from +x to +y (°)", "heights z (mm)", "distance (mm)", "p"],
                [
                    [
                        CONTOURS[p.contour],
                        f"{p.angle_deg:.0f}",
                        f"{p.levels[0]:.0f} to {p.levels[1]:.0f}",
                        f"{p.distance:+.2f}",
                        short_probability(p.p_value),
                    ]
                    for p in found.places
                ],
            )
        )
    blocks.append(
        web.WebTable(
            "What was tried as a reason (p: family-wise, of a sign as strong by chance)",
            ["mechanism", "what it is", "chi-square", "p"],
            [
                [
                    s.name.replace("-", " "),
                    s.statement,
                    f"{s.statistic:.1f} on {s.degrees}",
                    short_probability(s.p_value),
                ]
                for s in found.scores
            ],
        )
    )
    return blocks


def mismatch_verdict(found: Mismatch) -> str:
    """Return in words whether model and scan differ, and why."""
    if found.verdict == "consistent":
        return "Consistent: nothing of what the fit leaves is beyond the errors of contours, registration and pressure."
    if found.verdict == "unexplained":
        return (
            "Unexplained: the contours differ beyond their errors, and none of the mechanisms "
            "below describes it. Don't rely on the stiffness."
        )
    statements = {score.name: score.statement for score in found.scores}
    named = " or ".join(f"{name} ({statements[name]})" for name in found.named)
    text = f"{'Named' if found.verdict == 'named' else 'Ambiguous'}: {named}."
    if found.rms_after is not None and found.parameters_after is not None:
        muscle, fat = mpa_to_kpa(found.parameters_after)
        text += (
            f" With {found.named[0]} in the model, solved anew, the contours are met to "
            f"{found.rms_after:.3f} mm instead of {found.rms_before:.3f} mm, and C10 is "
            f"{muscle:.3g} kPa for muscle and {fat:.3g} kPa for fat."
        )
    return text
