"""Figure of a leg's sites: each beside the law that is fitted to all of them."""

from __future__ import annotations

from matplotlib.figure import Figure

from legfem.report.fit_figure import draw_fit, draw_residual, estimate_lines, label_axes
from legfem.report.style import LAW_NAMES, new_figure, panel, styled, title
from legfem.sites.result import SitesResult


@styled
def sites_figure(result: SitesResult) -> Figure:
    """Return measured and simulated force, a column a site, and their difference beneath."""
    count = len(result.sites)
    figure = new_figure(4.6 * count + 0.6, 6.4)
    of_all = " of all sites together" if count > 1 else ""
    what = f"Measured and simulated force, {LAW_NAMES[result.law]} law{of_all}"
    title(figure, what, result.leg.title, result.leg.origin)
    grid = figure.subplots(2, count, squeeze=False, height_ratios=(2.2, 1))
    for column, site in enumerate(result.sites):
        above, below = grid[:, column]
        lines = [f"rms {site.rms:.3g} N"]
        if column == 0:
            lines = [*estimate_lines(result.parameters), *lines]
        draw_fit(above, site.measured, site.predicted, result.law, lines)
        above.set_ylim(bottom=0)
        panel(above, chr(ord("A") + column), site.name)
        draw_residual(below, site.measured, site.predicted, result.law)
        below.set_xlim(*above.get_xlim())
    label_axes(grid)
    return figure
