"""The page on a leg in its stocking that a person reads first."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from legfem.common.doubts import doubt_lines
from legfem.common.units import mpa_to_kpa, mpa_to_mmhg
from legfem.report.lines import bullets, fill
from legfem.report.page import ReportFile
from legfem.report.stocking_mismatch_text import mismatch_section
from legfem.report.stocking_pressure_text import inside_section, interface_section
from legfem.report.stocking_stiffness_text import stiffness_section
from legfem.report.stocking_words import (
    both_units,
    interval,
    place_in_fat,
    share_of,
    stiffness_values,
    table,
)
from legfem.report.text import WIDTH
from legfem.stocking.fat_pressures import FatPressures
from legfem.stocking.judgement import judge
from legfem.stocking.run import StockingResult
from legfem.stocking.warnings import TISSUES, best_complete, stocking_warnings

ORIGINS = {
    "measured": "measured data",
    "simulated": "simulated data (the scans were computed by a model; no leg was scanned)",
}


def stocking_page(
    result: StockingResult, fat: FatPressures | None, files: Sequence[ReportFile]
) -> str:
    """Return the text of ``report.txt``; pressures in the fat if the worn state was found."""
    leg = result.leg
    heading = f"Leg {leg.id} ({leg.title}) in its compression stocking"
    what, _, explanation = ORIGINS[leg.origin].partition(" (")
    sections = {
        "Summary": _summary(result),
        "What was scanned": _scanned(result),
        "Stiffness of muscle and fat": stiffness_section(result),
        "Where model and scan differ": mismatch_section(result),
        "Pressure of the stocking on the skin": interface_section(result),
        "Pressure inside the leg": inside_section(result, fat),
        "Warnings": bullets(stocking_warnings(result)) or "None.",
        "How it was computed": _computed(result),
        "Files": _listing(files),
    }
    blocks = [
        f"{heading}\n{'=' * min(len(heading), WIDTH)}",
        f"*** {what.upper()} ***" + (f" ({explanation}" if explanation else ""),
        *map(fill, doubt_lines(leg.doubts)),
        *(f"{name}\n{'-' * len(name)}\n{body}" for name, body in sections.items() if body),
    ]
    return "\n\n".join(blocks) + "\n"


def _summary(result: StockingResult) -> str:
    lines = []
    best = best_complete(result)
    if best is not None:
        lines.append(
            " ".join(
                f"{TISSUES[k.name].capitalize()} C10 = {mpa_to_kpa(k.value):.3g} kPa "
                f"({interval(k)}; {k.verdict})."
                for k in judge(best, result.leg.accuracy)
            )
        )
    elif result.searches:
        lines.append("The stiffness could not be identified: see Warnings.")
    if result.leg.known:
        lines.append(f"Given, and used for the pressures: {stiffness_values(result.parameters)}.")
    found = result.pressures
    if found is None:
        lines.append("The leg in its stocking could not be computed: see Warnings.")
        return bullets(lines)
    lines.append(
        f"The stocking presses on the skin with {both_units(found.mean_interface)} on average, "
        f"{both_units(found.greatest_interface)} at most."
    )
    if found.at_veins:
        lines.append(
            "At the deep veins the pressure is "
            + ", ".join(
                f"{mpa_to_mmhg(p):.1f} mmHg ({vein.name})"
                for vein, p in zip(result.leg.veins, found.at_veins, strict=True)
            )
            + f": {share_of(found.at_veins, found.mean_interface)} of the mean on the skin."
        )
    where = place_in_fat(result.leg.bare, found.greatest_in_fat_at)
    lines.append(
        "Comfort: the greatest hydrostatic pressure in the fat is "
        f"{both_units(found.greatest_in_fat)}, {where}."
    )
    warned = len(stocking_warnings(result))
    if warned:
        lines.append(f"Read the {warned} warning{'s' * (warned > 1)} below.")
    return bullets(lines)


def _scanned(result: StockingResult) -> str:
    leg = result.leg
    made = "Simulated scans" if leg.origin == "simulated" else "Scans"
    which = "without" if leg.compressed is None else "without and with"
    lines = [
        f"{made} of {leg.bare.length:.0f} mm of the leg, z = {leg.bare.levels[0]:.0f} to "
        f"{leg.bare.levels[-1]:.0f} mm, {which} the stocking. Bones: "
        f"{', '.join(leg.bare.bones)}. Coordinates are taken as DICOM's: x to the patient's left, "
        "y to the back, z upwards."
    ]
    registration = leg.registration
    if registration is not None:
        error = registration.standard_error
        lines.append(
            f"The scan in the stocking was laid on the bare one by the bones: what is left between "
            f"them is {registration.residual:.3f} mm (root mean square of {registration.pairs} "
            f"patches, {registration.left_out} left out); standard error of the shift "
            f"{error[0]:.3f}, {error[1]:.3f} and {error[2]:.3f} mm in x, y and z."
        )
    elif leg.compressed is not None:
        lines.append("The two were given in one system of coordinates: nothing was registered.")
    accuracy = leg.accuracy
    if leg.compressed is not None:
        lines.append(
            f"Each scan's segmentation is taken to be {accuracy.sd:.2g} mm off (standard "
            f"deviation, alike over {accuracy.correlation:g} mm), which leaves "
            f"{accuracy.smoothed_sd:.2g} mm in its contours, and the stocking's pressure to be "
            f"{100 * accuracy.pressure_sd:g} % off over an eighth of the girth; the intervals of "
            "the stiffness rest on that."
        )
    return "\n\n".join(map(fill, lines))


def _computed(result: StockingResult) -> str:
    spaces, solves = result.model.compression.spaces, sum(s.solves for s in result.searches)
    cells = spaces.mesh.topology.index_map(spaces.mesh.topology.dim).size_global
    settings = result.model.compression.settings
    rows = [
        ("mesh", f"{cells} tetrahedra, {spaces.unknowns} unknowns"),
        ("elements", f"displacements of degree {settings.degree}, "
         + ("pressures of their own" if settings.formulation == "continuous" else "no pressures")),
        ("load", "follows the deformed skin" if settings.follower else "dead load"),
        ("ends of the segment", "held in their planes" if settings.ends == "held" else "free"),
        ("bones", "rigid and fixed"),
        ("solved states", f"{result.states}, {solves} of them to identify"),
        ("wall time", f"{result.wall_s:.0f} s"),
    ]  # fmt: skip
    return table(rows)


def _listing(files: Sequence[ReportFile]) -> str:
    rows = []
    for entry in files:
        rows.append(", ".join(path.name for path in entry.paths))
        rows.append(
            textwrap.fill(entry.shows, WIDTH, initial_indent=" " * 4, subsequent_indent=" " * 4)
        )
    return "\n".join(rows)
