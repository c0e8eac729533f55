"""The page of a leg in its stocking."""

from collections.abc import Mapping

import numpy as np

from legfem.common.errors import doubt_lines
from legfem.common.units import FloatArray, mpa_to_kpa, mpa_to_mmhg
from legfem.report import page as web
from legfem.report.estimates import modulus_rows
from legfem.report.stocking_pressures import (
    ALONG,
    ORIGINS,
    PRESSURES,
    both_units,
    dressed_leg,
    level_blocks,
    low_in_fat,
    place_in_fat,
    pressure_blocks,
    sensor_rows,
    sentence_at_ankle,
    share_of,
    stiffness_interval,
    tension_text,
    vein_interval,
)
from legfem.report.stocking_stiffness import (
    STIFFNESS,
    discrepancy_blocks,
    discrepancy_verdict,
    stiffness_blocks,
    verdict_sentence,
)
from legfem.report.words import moduli_text
from legfem.stockings.document import versions
from legfem.stockings.estimates import model_misses
from legfem.stockings.notices import TISSUES, stocking_notices
from legfem.stockings.pressures import FatPressures
from legfem.stockings.result import StockingResult


def known_of(result: StockingResult) -> list[web.Known]:
    """Return the stiffness, the pressures, and what they rest on."""
    leg = result.leg
    data: web.Provenance = leg.origin
    rows = []
    for known in result.estimates:
        bound = f"; at the {known.at_bound} bound of the search" if known.at_bound else ""
        c10 = mpa_to_kpa(known.value)
        rows.append(
            web.Known(
                f"C10 of the {TISSUES[known.name]}",
                f"{c10:.3g} kPa",
                "estimated",
                "both scans",
                stiffness_interval(known.ci95),
                f"{known.identifiability}{bound}; {moduli_text(c10, c10 * known.relative_half_width / 2)}",
            )
        )
    if leg.known:
        rows += [
            web.Known(
                f"C10 of the {TISSUES[name]}, used for the pressures",
                f"{mpa_to_kpa(value):.3g} kPa",
                "assumed",
                "leg.toml",
            )
            for name, value in result.parameters.items()
        ]
    rows += [*_pressures(result), *_stocking(result)]
    rows += [
        web.Known(f"D1 of the {TISSUES[f'{name}.C10']}", f"{law.D1:g} 1/MPa", "assumed", "leg.toml")
        for name, law in leg.tissues.items()
    ]
    accuracy = leg.accuracy
    if leg.compressed is not None:
        rows.append(
            web.Known(
                "error of a scan's outline",
                f"{accuracy.sd:.2g} mm (sd)",
                "prior",
                "leg.toml, or legfem's usual",
                remark=f"correlated over {accuracy.correlation:g} mm",
            )
        )
    rows.append(
        web.Known(
            "error of the stocking's pressure round the leg",
            f"{100 * accuracy.pressure_sd:g} % (sd)",
            "prior",
            "leg.toml, or legfem's usual",
        )
    )
    if (text := tension_text(result)) is not None:
        rows.append(
            web.Known(
                "tension of the fabric over what was given",
                text,
                "estimated",
                "both scans" + (" and the sensors" if result.sensors else ""),
            )
        )
    rows += [
        web.Known(f"pressure on the skin, sensor {name}", text, data, "leg.toml") for name, text in sensor_rows(result)
    ]
    rows += modulus_rows(leg.elastography, leg.origin)
    if leg.registration is not None:
        rows.append(
            web.Known(
                "bones of both scans, apart after registration",
                f"{leg.registration.residual:.2f} mm (rms)",
                data,
                "both scans",
            )
        )
    rows.append(web.Known("length of leg that was modelled", f"{leg.bare.length:.0f} mm", data, "scan of the bare leg"))
    return rows


def _pressures(result: StockingResult) -> list[web.Known]:
    found = result.pressures
    if found is None:
        return []
    rows = [
        web.Known(
            f"pressure at the {vein.name} vein",
            both_units(pressure),
            "computed",
            "the model in equilibrium with its stocking",
            f"{low:.1f} to {high:.1f} mmHg" if np.isfinite(high) else "",
            f"{100 * pressure / found.mean_interface:.0f} % of the mean on the skin",
        )
        for k, (vein, pressure) in enumerate(zip(result.leg.veins, found.at_veins, strict=True))
        if np.isfinite(pressure)
        for low, high in [vein_interval(result, k)]
    ]
    source = "the model in equilibrium with its stocking"
    return [
        web.Known(
            "pressure on the skin, mean",
            both_units(found.mean_interface),
            "computed",
            "Laplace's law on the dressed leg",
        ),
        *rows,
        web.Known(
            "pressure in the fat, greatest",
            both_units(found.greatest_in_fat),
            "computed",
            source,
            remark=low_in_fat(result),
        ),
        web.Known("pressure in the muscle, mean", both_units(found.mean_in_muscle), "computed", source),
    ]


def _stocking(result: StockingResult) -> list[web.Known]:
    stocking, load = result.leg.stocking, result.equilibrium.load
    low, high = stocking.unstretched.min(), stocking.unstretched.max()
    rows = [
        web.Known("stiffness of the fabric", f"{stocking.stiffness:g} N/mm per unit of strain", "assumed", "leg.toml"),
        web.Known(
            "girth of the unstretched stocking",
            f"{low:.0f} mm" if high - low < 0.5 else f"{low:.0f} to {high:.0f} mm",
            "assumed",
            "leg.toml, or its class",
        ),
        web.Known(
            "strain of the worn fabric",
            f"{100 * load.strain.min():.0f} to {100 * load.strain.max():.0f} %",
            "computed",
            "the dressed leg's girth",
        ),
    ]
    if result.scan_load is not None:
        rows.append(
            web.Known(
                "pressure on the skin by the scanned shape",
                f"{mpa_to_mmhg(result.scan_load.mean_pressure):.1f} mmHg (mean)",
                result.leg.origin,
                "scan in the stocking, Laplace's law",
            )
        )
    return rows


_NOT_TESTED = (
    "A fabric whose stiffness or size is wrong: a pressure 10 % higher everywhere makes both "
    "tissues about 10 % stiffer, and raises every pressure here by about as much.",
    "Muscle that is tensed, and a leg that stands or walks: the scans are of a leg at rest.",
    "The veins themselves: pressures are those of tissue without a vein in it.",
)


def stocking_web_page(
    result: StockingResult,
    moved: Mapping[str, FloatArray] | None = None,
    fat: FatPressures | None = None,
    command: str = "",
) -> web.WebPage:
    """Return the page of a leg in its stocking.

    Parameters
    ----------
    result
        Of a run.
    moved
        Displacement (mm) of skin's and hull's points; None if the worn state was not found.
    fat
        Pressures in columns of fat, if they were sampled.
    command
        That was given; empty where there was none.
    """
    leg, differ = result.leg, result.discrepancy
    chapters = []
    if result.pressures is not None and moved is not None:
        chapters.append(web.Chapter("The leg, bare and dressed", [dressed_leg(result, moved)]))
    if result.equilibrium.state.report.complete:
        chapters.append(web.Chapter(ALONG, level_blocks(result)))
    chapters += [
        web.Chapter(PRESSURES, pressure_blocks(result, fat)),
        web.Chapter(STIFFNESS, stiffness_blocks(result)),
        web.Chapter(
            "Where model and scan differ", [web.Prose(_wrong(result))] if differ is None else discrepancy_blocks(differ)
        ),
        web.Chapter("What could not be tested", [web.Bullets(_NOT_TESTED)]),
        web.Chapter("What to do next", [web.Bullets(_next(result))]),
        web.Chapter("What was scanned", _scanned(result)),
        web.Chapter("How it was computed", [_computed(result)]),
    ]
    return web.WebPage(
        title=f"What does the compression stocking do to leg {leg.id}?",
        subject=leg.title,
        origin=leg.origin,
        headline=_headline(result),
        warnings=[*doubt_lines(leg.doubts), *stocking_notices(result)],
        known=known_of(result),
        chapters=chapters,
        repeat=web.Repeat(command, versions()),
        data=ORIGINS[leg.origin],
    )


def _headline(result: StockingResult) -> web.Headline:
    return web.Headline(
        _tone(result),
        _sentence(result),
        [
            ("Problems found", _wrong(result)),
            ("How sure", _sure(result)),
            ("What it means for comfort", _comfort(result)),
            ("What to do", _next(result)[0]),
        ],
        _heading(result),
    )


def _heading(result: StockingResult) -> str:
    """Return what can be relied on, and what is uncertain."""
    if result.pressures is None:
        return "There is no answer"
    if _tone(result) == "wrong":
        return "The model does not fit"
    if result.leg.doubts:
        return "Check the doubtful input below before the pressures are used"
    unsure = [TISSUES[known.name] for known in result.estimates if known.identifiability != "identifiable"]
    if unsure:
        return f"The pressures can be used; the stiffness of the {' and the '.join(unsure)} is uncertain"
    if result.discrepancy is None:
        return "The pressures can be used; the tissues' stiffness was given and not tested"
    return "The model fits"


def _misses(result: StockingResult) -> bool:
    best = result.best
    return best is not None and model_misses(best, result.leg.accuracy)


def _tone(result: StockingResult) -> web.Tone:
    verdict = None if result.discrepancy is None else result.discrepancy.verdict
    if result.pressures is None or verdict == "unexplained" or _misses(result):
        return "wrong"
    best = result.best
    unsure = best is not None and any(known.identifiability != "identifiable" for known in result.estimates)
    tested = verdict == "consistent" and not result.leg.doubts
    return "sound" if tested and not unsure and result.equilibrium.converged else "caution"


def _sentence(result: StockingResult) -> str:
    found = result.pressures
    if found is None:
        return "The leg in its stocking could not be computed: there are no pressures inside it."
    ankle = sentence_at_ankle(result)
    text = f"{ankle} " if ankle else ""
    text += f"The stocking presses on the skin with {mpa_to_mmhg(found.mean_interface):.0f} mmHg on average"
    at_veins = [p for p in found.at_veins if np.isfinite(p)]
    if not at_veins:
        return f"{text}, {mpa_to_mmhg(found.greatest_interface):.0f} mmHg at most."
    low, high = (f"{mpa_to_mmhg(p):.0f}" for p in (min(at_veins), max(at_veins)))
    span = low if low == high else f"{low} to {high}"
    return (
        f"{text}; at the deep veins the pressure is {span} mmHg "
        f"({share_of(at_veins, found.mean_interface)} of the mean on the skin)."
    )


def _wrong(result: StockingResult) -> str:
    if result.discrepancy is None:
        return (
            "Nothing could be tested: the leg was not scanned in its stocking."
            if not result.searches
            else "No state of the leg could be compared with its scan: see the warnings."
        )
    if result.discrepancy.verdict == "consistent":
        return "None: model and scan differ by no more than the errors of contours, registration and pressure."
    return discrepancy_verdict(result.discrepancy)


def _sure(result: StockingResult) -> str:
    parts = [verdict_sentence(known) for known in result.estimates]
    if result.leg.known and result.pressures is not None:
        parts.append("The pressures are those of the stiffness that was given.")
    veins = range(len(result.leg.veins)) if result.pressures is not None else ()
    ends = [vein_interval(result, k) for k in veins]
    spreads = [high - low for low, high in ends if np.isfinite(high)]
    if spreads:
        parts.append(
            f"If the model and the fabric are right, pressures at the veins are known within "
            f"{0.5 * max(spreads):.1f} mmHg (95 %)."
        )
    return " ".join(parts) or "Unknown: there is nothing to compare with."


def _comfort(result: StockingResult) -> str:
    found = result.pressures
    if found is None:
        return "Unknown."
    where = place_in_fat(result.leg.bare, found.greatest_in_fat_at)
    return (
        "The greatest pressure in the fat, which holds the pain receptors, is "
        f"{both_units(found.greatest_in_fat)}, {where}. It is {low_in_fat(result)}."
    )


def _next(result: StockingResult) -> list[str]:
    if result.pressures is None:
        return ["Run it again with a finer mesh (--cells), and look at the warnings."]
    if _misses(result) or (result.discrepancy and result.discrepancy.verdict == "unexplained"):
        return [
            "Don't use the stiffness. Look at the contours where model and scan differ: at the "
            "segmentation, the registration, and the stocking's size."
        ]
    lines = []
    unsure = [TISSUES[known.name] for known in result.estimates if known.identifiability != "identifiable"]
    if unsure:
        lines.append(
            f"Do not rely on the stiffness of the {' and the '.join(unsure)}: these scans do not "
            "determine it well enough. The pressures hardly depend on it."
        )
    if not result.searches:
        lines.append("Scan the leg in its stocking, too: then the stiffness can be found.")
    lines.append(
        "Compare the pressure on the skin with the stocking's class, or measure it at one place: "
        "all pressures inside follow it."
    )
    return lines


def _scanned(result: StockingResult) -> list[web.Block]:
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
            f"deviation, correlated over {accuracy.correlation:g} mm), which leaves "
            f"{accuracy.smoothed_sd:.2g} mm in its contours, and the stocking's pressure to be "
            f"{100 * accuracy.pressure_sd:g} % off over an eighth of the girth; the intervals of "
            "the stiffness rest on that."
        )
    return [web.Prose(line) for line in lines]


def _computed(result: StockingResult) -> web.WebTable:
    spaces, solves = result.model.compression.spaces, sum(s.solves for s in result.searches)
    settings = result.model.compression.settings
    rows = [
        ("mesh", f"{result.tetrahedra} tetrahedra, {spaces.unknowns} unknowns"),
        (
            "elements",
            f"displacements of degree {settings.degree}, "
            + ("pressures of their own" if settings.formulation == "continuous" else "no pressures"),
        ),
        ("load", "follows the deformed skin" if settings.follower else "dead load"),
        ("ends of the segment", "held in their planes" if settings.ends == "held" else "free"),
        ("bones", "rigid and fixed"),
        ("solved states", f"{result.states}, {solves} of them to identify"),
        ("wall time", f"{result.wall_s:.0f} s"),
    ]
    return web.WebTable("Model and run", ["what", "how"], rows)
