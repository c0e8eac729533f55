"""The page of a leg in its stocking."""

import numpy as np

from legfem.common.units import mpa_to_kpa, mpa_to_mmhg
from legfem.report import page as web
from legfem.report import stocking_pressures, stocking_stiffness
from legfem.report.answers import headline_of
from legfem.report.dressed_leg import dressed_leg
from legfem.report.estimates import modulus_rows
from legfem.report.notices import sentences_of
from legfem.report.words import moduli_text
from legfem.stockings.assessment import TISSUES
from legfem.stockings.details import StockingDetails, StockingFit
from legfem.stockings.estimates import model_misses


def known_of(fit: StockingFit) -> list[web.Known]:
    """Return the stiffness, the pressures, and what they rest on."""
    details, leg = fit.details, fit.details.leg
    data: web.Provenance = leg.origin
    rows = []
    for name, known in fit.estimates.items():
        bound = f"; at the {known.at_bound} bound of the search" if known.at_bound else ""
        c10 = mpa_to_kpa(known.value)
        rows.append(
            web.Known(
                f"C10 of the {TISSUES[name]}",
                f"{c10:.3g} kPa",
                "estimated",
                "both scans",
                stocking_stiffness.stiffness_interval(known.ci95),
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
            for name, value in details.parameters.items()
        ]
    rows += [*_pressures(details), *_stocking(details)]
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
    if (text := stocking_pressures.tension_text(details)) is not None:
        rows.append(
            web.Known(
                "tension of the fabric, relative to what was given",
                text,
                "estimated",
                "both scans" + (" and the sensors" if details.sensors else ""),
            )
        )
    rows += [
        web.Known(f"pressure on the skin at the sensor {name!r}", text, data, "leg.toml")
        for name, text in stocking_pressures.sensor_rows(details)
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


def _pressures(details: StockingDetails) -> list[web.Known]:
    found = details.pressures
    if found is None:
        return []
    rows = [
        web.Known(
            f"pressure at the {vein.name} vein",
            stocking_pressures.both_units(pressure),
            "computed",
            "the model in equilibrium with its stocking",
            f"{low:.1f} to {high:.1f} mmHg" if np.isfinite(high) else "",
            f"{100 * pressure / found.mean_interface:.0f} % of the mean on the skin",
        )
        for k, (vein, pressure) in enumerate(zip(details.leg.veins, found.at_veins, strict=True))
        if np.isfinite(pressure)
        for low, high in [stocking_pressures.vein_interval(details, k)]
    ]
    source = "the model in equilibrium with its stocking"
    return [
        web.Known(
            "pressure on the skin, mean",
            stocking_pressures.both_units(found.mean_interface),
            "computed",
            "Laplace's law on the dressed leg",
        ),
        *rows,
        web.Known(
            "pressure in the fat, greatest",
            stocking_pressures.both_units(found.greatest_in_fat),
            "computed",
            source,
            remark=stocking_pressures.low_in_fat(details),
        ),
        web.Known(
            "pressure in the muscle, mean", stocking_pressures.both_units(found.mean_in_muscle), "computed", source
        ),
    ]


def _stocking(details: StockingDetails) -> list[web.Known]:
    stocking, load = details.leg.stocking, details.equilibrium.load
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
    if details.scan_load is not None:
        rows.append(
            web.Known(
                "pressure on the skin by the scanned shape",
                f"{mpa_to_mmhg(details.scan_load.mean_pressure):.1f} mmHg (mean)",
                details.leg.origin,
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


def stocking_web_page(fit: StockingFit, command: str = "") -> web.WebPage:
    """Return the page of a leg in its stocking.

    Parameters
    ----------
    fit
        Of the leg.
    command
        That was given; empty where there was none.
    """
    details, leg = fit.details, fit.details.leg
    differ = details.discrepancy
    chapters = []
    if details.pressures is not None and details.moved is not None:
        chapters.append(web.Chapter("The leg, bare and dressed", [dressed_leg(details, details.moved)]))
    if details.equilibrium.state.report.complete:
        chapters.append(web.Chapter(stocking_pressures.ALONG, stocking_pressures.level_blocks(details)))
    chapters += [
        web.Chapter(stocking_pressures.PRESSURES, stocking_pressures.pressure_blocks(details)),
        web.Chapter(stocking_stiffness.STIFFNESS, stocking_stiffness.stiffness_blocks(fit)),
        web.Chapter(
            "Where model and scan differ",
            [
                *([web.Prose(_wrong(details))] if differ is None else stocking_stiffness.discrepancy_blocks(differ)),
                *stocking_stiffness.contour_curves(details),
            ],
        ),
        web.Chapter("What could not be tested", [web.Bullets(_NOT_TESTED)]),
        web.Chapter("What to do next", [web.Bullets(_next(fit))]),
        web.Chapter("What was scanned", _scanned(details)),
        web.Chapter("How it was computed", [_computed(fit)]),
    ]
    return web.WebPage(
        title=f"What does the compression stocking do to leg {leg.id}?",
        subject=leg.title,
        origin=leg.origin,
        headline=_headline(fit),
        warnings=sentences_of([fit]),
        known=known_of(fit),
        chapters=chapters,
        repeat=web.Repeat(command, fit.versions),
        data=stocking_pressures.ORIGINS[leg.origin],
    )


def _headline(fit: StockingFit) -> web.Headline:
    details = fit.details
    return headline_of(
        fit.answer,
        [
            ("Problems found", _wrong(details)),
            ("How sure", _sure(fit)),
            ("What it means for comfort", _comfort(details)),
            ("What to do", _next(fit)[0]),
        ],
    )


def _misses(details: StockingDetails) -> bool:
    best = details.best
    return best is not None and model_misses(best, details.leg.accuracy)


def _wrong(details: StockingDetails) -> str:
    if details.discrepancy is None:
        return (
            "Nothing could be tested: the leg was not scanned in its stocking."
            if not details.problem
            else "No state of the leg could be compared with its scan: see the warnings."
        )
    if details.discrepancy.verdict == "consistent":
        return "None: model and scan differ by no more than the errors of contours, registration and pressure."
    return stocking_stiffness.discrepancy_verdict(details.discrepancy)


def _sure(fit: StockingFit) -> str:
    details = fit.details
    parts = [stocking_stiffness.verdict_sentence(known) for known in fit.estimates.values()]
    if details.leg.known and details.pressures is not None:
        parts.append("The pressures are those of the stiffness that was given.")
    veins = range(len(details.leg.veins)) if details.pressures is not None else ()
    ends = [stocking_pressures.vein_interval(details, k) for k in veins]
    spreads = [high - low for low, high in ends if np.isfinite(high)]
    if spreads:
        parts.append(
            f"If the model and the fabric are right, pressures at the veins are known within "
            f"{0.5 * max(spreads):.1f} mmHg (95 %)."
        )
    return " ".join(parts) or "Unknown: there is nothing to compare with."


def _comfort(details: StockingDetails) -> str:
    found = details.pressures
    if found is None:
        return "Unknown."
    where = stocking_pressures.place_in_fat(details.leg.bare, found.greatest_in_fat_at)
    return (
        "The greatest pressure in the fat, where the pain receptors are, is "
        f"{stocking_pressures.both_units(found.greatest_in_fat)}, {where}. "
        f"It is {stocking_pressures.low_in_fat(details)}."
    )


def _next(fit: StockingFit) -> list[str]:
    details = fit.details
    if details.pressures is None:
        return ["Run it again with a finer mesh (--cells), and look at the warnings."]
    if _misses(details) or (details.discrepancy and details.discrepancy.verdict == "unexplained"):
        return [
            "Don't use the stiffness. Look at the contours where model and scan differ: at the "
            "segmentation, the registration, and the stocking's size."
        ]
    lines = []
    unsure = [TISSUES[name] for name in fit.answer.parameters["unsure"]]
    if unsure:
        lines.append(
            f"Do not rely on the stiffness of the {' and the '.join(unsure)}: these scans do not "
            "determine it well enough. The pressures hardly depend on it."
        )
    if details.leg.compressed is None:
        lines.append("Scan the leg in its stocking, too: then the stiffness can be found.")
    lines.append(
        "Compare the pressure on the skin with the stocking's class, or measure it at one place: "
        "all pressures inside follow it."
    )
    return lines


def _scanned(details: StockingDetails) -> list[web.Block]:
    leg = details.leg
    made = "Simulated scans" if leg.origin == "simulated" else "Scans"
    which = "without" if leg.compressed is None else "without and with"
    lines = [
        f"{made} of {leg.bare.length:.0f} mm of the leg, z = {leg.bare.levels[0]:.0f} to {leg.bare.levels[-1]:.0f} mm, "
        f"{which} the stocking. Bones: {', '.join(leg.bare.bones)}. Coordinates are taken as DICOM's: x to the "
        "patient's left, y to the back, z upwards."
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
            f"Each scan's segmentation is taken to be {accuracy.sd:.2g} mm off (standard deviation, correlated over "
            f"{accuracy.correlation:g} mm), which leaves {accuracy.smoothed_sd:.2g} mm in its contours, and the "
            f"stocking's pressure to be {100 * accuracy.pressure_sd:g} % off over an eighth of the girth; the "
            "intervals of the stiffness rest on that."
        )
    return [web.Prose(line) for line in lines]


def _computed(fit: StockingFit) -> web.WebTable:
    details = fit.details
    spaces, solves = details.model.compression.spaces, fit.log.forward_solves
    settings = details.model.compression.settings
    rows = [
        ("mesh", f"{details.tetrahedra} tetrahedra, {spaces.unknowns} unknowns"),
        (
            "elements",
            f"displacements of degree {settings.degree}, "
            + ("pressures of their own" if settings.formulation == "continuous" else "no pressures"),
        ),
        ("load", "follows the deformed skin" if settings.follower else "dead load"),
        ("ends of the segment", "held in their planes" if settings.ends == "held" else "free"),
        ("bones", "rigid and fixed"),
        ("solved states", f"{details.states}, for {solves} equilibria to identify and one in the end"),
        ("wall time", f"{fit.log.wall_s:.0f} s"),
    ]
    return web.WebTable("Model and run", ["what", "how"], rows)
