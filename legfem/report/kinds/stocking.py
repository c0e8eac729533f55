"""What is shown of a leg in its stocking: page, figures of pressures and contours, and fields."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure
from mpi4py import MPI

from legfem.common.numbers import number
from legfem.common.units import mpa_to_mmhg
from legfem.fem.field_files import write_fields
from legfem.fem.fields import fields_of
from legfem.geometry.leg_shape import perimeter
from legfem.inverse.answer import Finding
from legfem.report import estimates, stocking_pressures, stocking_stiffness
from legfem.report import page as web
from legfem.report.curves import curves_figure
from legfem.report.estimates import held_text, modulus_rows, words_of
from legfem.report.folder import ReportFile
from legfem.report.kinds import ReportKind
from legfem.report.stocking_figures import stocking_pressure_figure, stocking_section_figure
from legfem.report.style import picture
from legfem.report.words import NOT_TESTED, TOLD, WORDS, DataKind, capital
from legfem.stockings.details import StockingDetails, StockingFit
from legfem.stockings.identification import KIND, TAPE
from legfem.stockings.tape import TapeDetails, TapeFit


class StockingReport(ReportKind):
    """What is shown of a leg in its stocking."""

    kind: ClassVar[str] = KIND
    explore: ClassVar[str] = "the leg to turn"
    told: ClassVar[tuple[str, ...]] = (stocking_stiffness.STIFFNESS, stocking_pressures.PRESSURES)
    seeded: ClassVar[bool] = False
    simulated = DataKind("simulated data", "the scans were computed by a model; no leg was scanned")

    def question(self, chosen: StockingFit) -> str:
        """Return the title."""
        return f"What does the compression stocking do to leg {chosen.subject.id}?"

    def answers(self, chosen: StockingFit) -> list[tuple[str, str]]:
        """Return what is wrong, how sure it is, what it means and what to do."""
        details, found = chosen.details, chosen.details.pressures
        parts = [estimates.how_sure(chosen.estimates, words_of)] if chosen.estimates else []
        comfort = "Unknown."
        if found is not None:
            parts += ["The pressures are those of the stiffness that was given."] if details.leg.known else []
            ends = map(found.vein_interval, range(len(details.leg.veins)))
            if spreads := [mpa_to_mmhg(high) - mpa_to_mmhg(low) for low, high in ends if np.isfinite(high)]:
                parts.append(TOLD["at_veins"].format(half=0.5 * max(spreads)))
            where = stocking_pressures.place_in_fat(details.leg.bare, found.greatest_in_fat_at)
            greatest = stocking_pressures.greatest_in_fat(details, found)
            comfort = TOLD["in_fat"].format(greatest=greatest, where=where)
        return [
            ("Problems found", _wrong(details)),
            ("How sure", " ".join(parts) or "Unknown: there is nothing to compare with."),
            ("What it means for comfort", comfort),
            ("What to do", next(_next(chosen))),
        ]

    def known(self, fits: Sequence[StockingFit]) -> list[web.Known]:
        """Return the stiffness, the pressures, and what they rest on."""
        fit, details = fits[0], fits[0].details
        given = details.parameters if details.leg.known else {}
        return [
            *(estimates.estimated(words_of(name), one, "both scans", True) for name, one in fit.estimates.items()),
            *(
                web.Known(f"{words_of(name)}, used for the pressures", held_text(name, value), "assumed", "leg.toml")
                for name, value in given.items()
            ),
            *(
                web.Known(
                    one.name,
                    f"{number(one.value, one.standard_error)} {one.unit}",
                    "computed",
                    "the model in equilibrium with its stocking",
                    " to ".join(number(end, one.standard_error) for end in one.ci95 if np.isfinite(end)),
                )
                for one in fit.computed.values()
                if np.isfinite(one.value)
            ),
            *_fabric(details),
            *_given(details),
        ]

    def chapters(
        self, fits: Sequence[StockingFit], pressed: web.PressedSection | None, note: str
    ) -> Iterator[web.Chapter]:
        """Yield the leg to turn, pressures, stiffness, where model and scan differ, and how it was computed."""
        (fit,) = fits
        details, differ = fit.details, fit.details.discrepancy
        if details.pressures is not None and details.moved is not None:
            dressed = stocking_pressures.dressed_leg(details, details.moved)
            yield web.Chapter("The leg, bare and dressed", [dressed])
        if details.equilibrium.state.report.complete:
            yield web.Chapter(stocking_pressures.ALONG, stocking_pressures.level_blocks(details))
        where = [web.Prose(_wrong(details))] if differ is None else stocking_stiffness.discrepancy_blocks(differ)
        yield web.Chapter(stocking_pressures.PRESSURES, stocking_pressures.pressure_blocks(details))
        yield web.Chapter(stocking_stiffness.STIFFNESS, stocking_stiffness.stiffness_blocks(fit))
        yield web.Chapter("Where model and scan differ", [*where, *stocking_stiffness.contour_curves(details)])
        yield web.Chapter("What could not be tested", [web.Bullets(NOT_TESTED["stocking"])])
        yield web.Chapter("What to do next", [web.Bullets(list(_next(fit)))])
        yield web.Chapter("What was scanned", _scanned(details))
        yield web.Chapter("How it was computed", [_computed(fit)])

    def figure(self, fits: Sequence[StockingFit]) -> Figure:
        """Return the pressure of the stocking on the skin, unrolled and on the leg."""
        return stocking_pressure_figure(fits[0].details)

    def files(self, fits: Sequence[StockingFit], folder: Path) -> list[ReportFile]:
        """Write pressures on the skin, in a section and in the fat, and the contours that were compared."""
        details, leg = fits[0].details, fits[0].details.leg
        drawn: list[tuple[str, Figure, str]] = []
        if details.section is not None:
            shows = "pressure of the stocking on the skin, unrolled and on the leg (the second paper's Fig. 4)"
            drawn.append(("interface-pressure", self.figure(fits), shows))
            shows = "hydrostatic pressure in the section at mid calf, with the veins (Figs. 5 and 6); "
            shows += "the outlines before and in the stocking"
            drawn.append(("mid-calf", stocking_section_figure(details, details.section), shows))
        if curves := stocking_pressures.fat_curves(details):
            shows = "fat thickness round the leg, and the pressures over it and in it"
            drawn.append(("fat", curves_figure(curves, capital(shows), leg.title, leg.origin), shows))
        if curves := list(stocking_stiffness.contour_curves(details)):
            shows = "the contours that were compared: distances of model and bare leg"
            drawn.append(("contours", curves_figure(curves, capital(shows), leg.title, leg.origin), shows))
        return [picture(figure, folder, name, shows) for name, figure, shows in drawn]

    def comm(self, fits: Sequence[StockingFit]) -> MPI.Intracomm:
        """Return the ranks that share the leg's mesh."""
        return fits[0].details.model.compression.comm

    def fields(self, fits: Sequence[StockingFit], folder: Path) -> list[ReportFile]:
        """Write the leg in its stocking for ParaView."""
        details = fits[0].details
        if not details.equilibrium.state.report.complete:
            return []
        details.model.set_state(details.equilibrium.state, details.equilibrium.pressure, details.parameters)
        written = write_fields(fields_of(details.model.compression.system), folder)
        return [ReportFile(written, TOLD["stocking_fields"])]


class TapeReport(ReportKind):
    """What is shown of a leg by tape in its stocking."""

    kind: ClassVar[str] = TAPE
    told: ClassVar[tuple[str, ...]] = (stocking_pressures.ALONG,)
    seeded: ClassVar[bool] = False

    def question(self, chosen: TapeFit) -> str:
        """Return the title."""
        return f"With which pressure does the compression stocking press on leg {chosen.subject.id}?"

    def answers(self, chosen: TapeFit) -> list[tuple[str, str]]:
        """Return what it rests on, and what to do."""
        return list(WORDS["by_tape"].items())

    def known(self, fits: Sequence[TapeFit]) -> list[web.Known]:
        """Return girths and fabric."""
        leg, around = fits[0].details.leg, perimeter(fits[0].details.leg.bare)
        girths = ", ".join(f"{a:.0f} mm (z = {z:.0f} mm)" for z, a in zip(leg.bare.levels, around, strict=True))
        return [web.Known("girths by tape", girths, leg.origin, "leg.toml"), *_fabric(fits[0].details)]

    def chapters(self, fits: Sequence[TapeFit], pressed: web.PressedSection | None, note: str) -> Iterator[web.Chapter]:
        """Yield the pressures, and what a tape can't tell."""
        yield web.Chapter(stocking_pressures.ALONG, stocking_pressures.level_blocks(fits[0].details))
        yield web.Chapter("What could not be tested", [web.Bullets(NOT_TESTED[TAPE])])

    def figure(self, fits: Sequence[TapeFit]) -> Figure:
        """Return the pressure along the leg."""
        curve, leg = stocking_pressures.along_curves(fits[0].details), fits[0].details.leg
        return curves_figure([curve], stocking_pressures.ALONG, leg.title, leg.origin)

    def files(self, fits: Sequence[TapeFit], folder: Path) -> list[ReportFile]:
        """Write that figure."""
        return [picture(self.figure(fits), folder, "along", "the stocking's pressure along the leg")]


def _given(details: StockingDetails) -> list[web.Known]:
    """Return what was given of the tissues, the scans and the instruments, and how far the fit moved it."""
    leg, accuracy = details.leg, details.leg.accuracy
    data: web.Provenance = leg.origin
    usual, both = "leg.toml, or legfem's usual", "both scans"
    rows = [
        web.Known(words_of(f"{name}.D1"), held_text(f"{name}.D1", law.D1), "assumed", "leg.toml")
        for name, law in leg.tissues.items()
    ]
    if leg.compressed is not None:
        error, over = f"{accuracy.sd:.2g} mm (sd)", f"correlated over {accuracy.correlation:g} mm; "
        over += f"smoothing leaves {accuracy.smoothed_sd:.2g} mm"
        rows.append(web.Known("error of a scan's outline", error, "prior", usual, remark=over))
    error = f"{100 * accuracy.pressure_sd:g} % (sd)"
    rows.append(web.Known("error of the stocking's pressure round the leg", error, "prior", usual))
    if (text := stocking_pressures.tension_text(details)) is not None:
        source = both + (" and the sensors" if details.sensors else "")
        rows.append(web.Known("tension of the fabric, relative to what was given", text, "estimated", source))
    rows += stocking_pressures.sensor_rows(details)
    rows += modulus_rows(leg.elastography, leg.origin)
    if details.scan_load is not None:
        mean, source = f"{mpa_to_mmhg(details.scan_load.mean_pressure):.1f} mmHg (mean)", "scan in the stocking, "
        name = "pressure on the skin by the scanned shape"
        rows.append(web.Known(name, mean, details.leg.origin, f"{source}Laplace's law"))
    rows.append(web.Known("length of leg that was modelled", f"{leg.bare.length:.0f} mm", data, "scan of the bare leg"))
    return rows


def _fabric(details: TapeDetails) -> list[web.Known]:
    stocking, load = details.leg.stocking, details.load
    low, high = stocking.unstretched.min(), stocking.unstretched.max()
    girths = f"{low:.0f} mm" if high - low < 0.5 else f"{low:.0f} to {high:.0f} mm"
    strain = f"{100 * load.strain.min():.0f} to {100 * load.strain.max():.0f} %"
    tension = f"{load.tension.min():.3g} to {load.tension.max():.3g} N/mm"
    return [
        web.Known("stiffness of the fabric", f"{stocking.stiffness:g} N/mm per unit of strain", "assumed", "leg.toml"),
        web.Known("girth of the unstretched stocking", girths, "assumed", "leg.toml, or its class"),
        web.Known("strain of the worn fabric", strain, "computed", "the dressed leg's girth"),
        web.Known("tension of the worn fabric", tension, "computed", "its strain"),
    ]


def _wrong(details: StockingDetails) -> str:
    if details.discrepancy is not None:
        if details.discrepancy.verdict == "consistent":
            return "None: model and scan differ by no more than the errors of contours, registration and pressure."
        return stocking_stiffness.discrepancy_verdict(details.discrepancy)
    if details.problem:
        return "No state of the leg could be compared with its scan: see the warnings."
    return "Nothing could be tested: the leg was not scanned in its stocking."


def _next(fit: StockingFit) -> Iterator[str]:
    details = fit.details
    if fit.answer.finding is Finding.NOT_COMPUTED:
        yield "Run it again with a finer mesh (--cells), and look at the warnings."
        return
    if fit.answer.finding is Finding.MISFIT:
        yield TOLD["look_at_contours"]
        return
    if unsure := fit.answer.parameters["unsure"]:
        yield TOLD["unsure_stiffness"].format(tissues=" and the ".join(unsure))
    if details.leg.compressed is None:
        yield "Scan the leg in its stocking, too: then the stiffness can be found."
    yield TOLD["compare_pressure"]


def _scanned(details: StockingDetails) -> list[web.Block]:
    leg = details.leg
    made = "Simulated scans" if leg.origin == "simulated" else "Scans"
    which = "without" if leg.compressed is None else "without and with"
    part = {"length": leg.bare.length, "low": leg.bare.levels[0], "high": leg.bare.levels[-1]}
    lines = [TOLD["scanned"].format(made=made, which=which, bones=", ".join(leg.bare.bones), **part)]
    if (found := leg.registration) is not None:
        lines.append(TOLD["registered"].format(found=found, **dict(zip("xyz", found.standard_error, strict=True))))
    elif leg.compressed is not None:
        lines.append("The two were given in one system of coordinates: nothing was registered.")
    return [web.Prose(line) for line in lines]


def _computed(fit: StockingFit) -> web.WebTable:
    details = fit.details
    spaces, solves = details.model.compression.spaces, fit.log.forward_solves
    settings = details.model.compression.settings
    pressures = "pressures of their own" if settings.formulation == "continuous" else "no pressures"
    rows = [
        ("mesh", f"{details.tetrahedra} tetrahedra, {spaces.unknowns} unknowns"),
        ("elements", f"displacements of degree {settings.degree}, {pressures}"),
        ("load", "follows the deformed skin"),
        ("ends of the segment", "held in their planes" if settings.ends == "held" else "free"),
        ("bones", "rigid and fixed"),
        ("solved states", f"{details.states}, for {solves} equilibria to identify and one in the end"),
        ("wall time", f"{fit.log.wall_s:.0f} s"),
    ]
    return web.WebTable("Model and run", ["what", "how"], rows)
