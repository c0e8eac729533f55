"""Where model and scan of a leg in its stocking differ, in words."""

from __future__ import annotations

from legfem.common.units import mpa_to_kpa
from legfem.report.lines import fill
from legfem.stocking.mismatch import Mismatch
from legfem.stocking.run import StockingResult

CONTOURS = {"outer": "skin", "inner": "hull of the muscle"}


def mismatch_section(result: StockingResult) -> str:
    """Return the section, empty where nothing was identified."""
    found = result.mismatch
    if found is None:
        return ""
    return "\n\n".join([fill(mismatch_verdict(found)), *_places(found), _table(found)])


def mismatch_verdict(found: Mismatch) -> str:
    """Return in words whether model and scan differ, and why."""
    if found.verdict == "consistent":
        return (
            "Consistent: nothing of what the fit leaves is beyond the errors of contours, "
            "registration and pressure."
        )
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


def _places(found: Mismatch) -> list[str]:
    lines = [
        f"- {CONTOURS[place.contour]}, {place.angle_deg:.0f} degrees from +x towards +y, z = "
        f"{place.levels[0]:.0f} to {place.levels[1]:.0f} mm: the model is {place.distance:+.2f} mm "
        f"outside the scan (p = {place.p_value:.2g})"
        for place in found.places[:6]
    ]
    return ["Where:\n" + "\n".join(lines)] if lines else []


def _table(found: Mismatch) -> str:
    rows = [
        f"{score.name:20} {score.statistic:8.1f} on {score.degrees:2}   {score.p_value:.2g}"
        for score in found.scores
    ]
    return "\n".join([f"{'mechanism':20} {'chi-square':>14}   p, family-wise", *rows])
