"""What is shown of specimens: page, document, and the figure of their recordings beside the laws."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from legfem.inverse.document import KindDocument
from legfem.inverse.fit import Fit
from legfem.report.folder import ReportFile
from legfem.report.further_channels import SHOWS, channels_figure, drawn
from legfem.report.kinds import ReportKind
from legfem.report.page import PressedSection, WebPage
from legfem.report.specimen_page import specimen_page
from legfem.report.style import FAINT, LAW_NAMES, new_figure, panel, save, styled, title
from legfem.specimens.details import SpecimenDetails, SpecimenDocument, compared

type SpecimenFits = Sequence[Fit[SpecimenDetails]]

_NAMED = 6
_COLOURS = "viridis"


@styled
def specimen_figure(results: SpecimenFits) -> Figure:
    """Return force over displacement, over time where a recording holds, and the differences.

    Parameters
    ----------
    results
        One a law, of one folder; a column each.
    """
    first = results[0]
    rows = 3 if any(one.course.holds for one in compared(first)) else 2
    figure = new_figure(5.4 * len(results) + 0.6, 3.2 * rows)
    title(
        figure,
        f"Measured and simulated {compared(first)[0].axes.load}",
        first.details.folder.title,
        first.details.folder.origin,
    )
    grid = figure.subplots(rows, len(results), squeeze=False, sharey="row")
    for column, result in enumerate(results):
        axes = grid[:, column]
        panel(axes[0], "ABCDEFGH"[column], LAW_NAMES[result.law])
        _over_displacement(axes[0], result, names=column == 0)
        if rows == 3:
            _over_time(axes[1], result)
        _differences(axes[-1], result)
    shown = compared(first)[0].axes
    for row in grid[:-1]:
        row[0].set_ylabel(f"{shown.load} ({shown.load_unit})")
    grid[-1, 0].set_ylabel(f"simulated − measured\n(% of the greatest {shown.load})")
    return figure


def _colours(result: Fit[SpecimenDetails]) -> np.ndarray:
    shades = matplotlib.colormaps[_COLOURS](np.linspace(0.0, 0.85, len(compared(result))))
    return np.asarray(shades)


def _over_displacement(axes: Axes, result: Fit[SpecimenDetails], names: bool) -> None:
    for one, colour in zip(compared(result), _colours(result), strict=True):
        loading = one.course.time <= one.course.arrival
        d, loads = one.axes.ways * one.course.displacement[loading], one.axes.loads
        dots = "o" if one.fitted else "x"
        label = f"{one.name}{'' if one.fitted else ' (left out)'}: $R^2$ {one.r_squared:.3f}"
        axes.plot(d, loads * one.course.force[loading], dots, color=colour, markersize=3, fillstyle="none", label=label)
        line = "-" if one.fitted else "--"
        axes.plot(np.append(0.0, d), np.append(0.0, loads * one.predicted[loading]), line, color=colour)
    shown = compared(result)[0].axes
    plain = "displacement after first contact, loading (mm)"
    axes.set_xlabel(plain if shown.way == "displacement" else f"{shown.way}, loading ({shown.way_unit})")
    if len(compared(result)) <= _NAMED:
        axes.legend(loc="upper left", fontsize=8)
    elif names:
        axes.text(
            0.02, 0.95, f"{len(compared(result))} recordings; x, dashed: left out", transform=axes.transAxes, va="top"
        )


def _over_time(axes: Axes, result: Fit[SpecimenDetails]) -> None:
    for one, colour in zip(compared(result), _colours(result), strict=True):
        dots, line = ("o", "-") if one.fitted else ("x", "--")
        time = one.course.time
        axes.plot(time, one.axes.loads * one.course.force, dots, color=colour, markersize=3, fillstyle="none")
        axes.plot(time, one.axes.loads * one.predicted, line, color=colour)
    axes.set_xscale("log")
    axes.set_xlabel("time after first contact (s)")


def _differences(axes: Axes, result: Fit[SpecimenDetails]) -> None:
    axes.axhline(0.0, color=FAINT, linewidth=0.6)
    for one, colour in zip(compared(result), _colours(result), strict=True):
        share = 100 * (one.predicted - one.course.force) / one.course.peak
        line = "-" if one.fitted else "--"
        axes.plot(one.course.time / one.course.arrival, share, line, color=colour)
    if any(one.course.holds for one in compared(result)):
        axes.set_xscale("log")
    timed = all(one.course.samples.timed for one in compared(result))
    axes.set_xlabel(f"{'time' if timed else 'way'} over the loading's")


class SpecimenReport(ReportKind):
    """What is shown of specimens."""

    kind: ClassVar[str] = "specimens"
    document: ClassVar[KindDocument] = SpecimenDocument()

    def page(
        self, fits: SpecimenFits, pressed: PressedSection | None = None, command: str = "", note: str = ""
    ) -> WebPage:
        """Return the page."""
        return specimen_page(fits, command)

    def figure(self, fits: SpecimenFits) -> Figure:
        """Return every recording beside the laws."""
        return specimen_figure(fits)

    def files(self, fits: SpecimenFits, folder: Path) -> list[ReportFile]:
        """Write the figure."""
        shows = "every recording beside the model over displacement and time, and their differences"
        found = [ReportFile(save(specimen_figure(fits), folder, "fit", svg=True), shows)]
        if drawn(fits):
            found.append(ReportFile(save(channels_figure(fits), folder, "channels", svg=True), SHOWS))
        return found
