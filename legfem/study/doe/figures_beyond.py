"""Pictures beyond the factorial: Sobol indices, the emulator's error, information by depth."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from legfem.report.style import FAINT, new_figure, panel, save, styled, title
from legfem.study.doe.factors import label_of
from legfem.study.doe.figures import power_of_ten
from legfem.study.doe.information import IDENTIFIED, IDENTIFIED_WITHIN, Information
from legfem.study.doe.study import StudyResult

_COLOURS = ("#E69F00", "#D55E00", "#0072B2", "#4D4D4D", "#CC79A7", "#009E73", "#56B4E9", "#8C8C8C")


@styled
def draw_sobol(result: StudyResult, out: Path) -> list[Path]:
    """Draw the indices by metric, and the emulator against simulations it hasn't seen."""
    found = result.sobol
    if not found:
        return []
    figure = new_figure(13, 8)
    whose = f"section of subject {result.subject.id} ({result.subject.origin})"
    title(figure, f"Sobol indices: {result.definition.title}", whose, "simulated")
    grid = figure.add_gridspec(2, len(found), height_ratios=[1.3, 1])
    axes = figure.add_subplot(grid[0, :])
    panel(axes, "A", "full bars: a factor alone; light: with all its interactions (95 % interval)")
    axes.set_ylabel("share of the variance")
    factors = result.definition.factors
    width = 0.8 / len(factors)
    for k, factor in enumerate(factors):
        at = np.arange(len(found)) + (k - (len(factors) - 1) / 2) * width
        colour = _COLOURS[k % len(_COLOURS)]
        total = [s.total[k] for s in found]
        axes.bar(at, total, width * 0.92, color=colour, alpha=0.35)
        axes.bar(at, [s.first[k] for s in found], width * 0.92, color=colour, label=factor.label)
        axes.errorbar(
            at, total, [s.total_ci95[k] for s in found], fmt="none", ecolor="#111111", elinewidth=0.8, capsize=2
        )
    axes.set_xticks(range(len(found)), [s.metric.label for s in found])
    axes.set_ylim(0, 1.15)
    axes.legend(ncols=len(factors), loc="upper right")
    for k, s in enumerate(found):
        below = figure.add_subplot(grid[1, k])
        power = int(np.floor(np.log10(np.abs(s.simulated).max())))
        simulated, predicted = s.simulated / 10.0**power, s.predicted / 10.0**power
        both = [min(simulated.min(), predicted.min()), max(simulated.max(), predicted.max())]
        below.plot(both, both, color=FAINT, lw=0.8)
        below.plot(simulated, predicted, "o", ms=3.5, color="#0072B2")
        letter = "$\\bf{B}$  " if k == 0 else ""
        error = f"rms error {s.error.relative:.1%} of sd"
        below.set_title(f"{letter}{s.metric.label}\n{error}", fontsize=9)
        below.tick_params(labelsize=8)
        unit = f"{power_of_ten(power)} {s.metric.typeset_unit}"
        below.set_xlabel(f"simulated ({unit})", fontsize=8)
        if k == 0:
            below.set_ylabel("emulated (same unit)", fontsize=8)
    figure.supxlabel("B: the emulator behind A against simulations that it hasn't seen", fontsize=9)
    return save(figure, out, "sobol")


@styled
def draw_information(result: StudyResult, out: Path) -> list[Path]:
    """Draw which parameters are told from which depth, and the information's eigenvectors."""
    found = result.information
    if found is None:
        return []
    figure = new_figure(14, 8.5)
    whose = f"section of subject {result.subject.id} ({result.subject.origin})"
    title(figure, f"What a curve tells: {result.definition.title}", whose, "simulated")
    axes = figure.subplots(2, 2)
    panel(axes[0, 0], "A", "change of the force (%) for 1 % of a parameter")
    elasticity = found.sensitivity / found.force[:, None]
    for k, name in enumerate(found.names):
        axes[0, 0].plot(found.displacement, elasticity[:, k], color=_COLOURS[k % 8], label=label_of(name))
    noise = found.noise_sd / found.force
    axes[0, 0].plot(found.displacement, noise, ":", color="#111111", label="noise of the instruments: sd / F")
    axes[0, 0].set_ylim(min(0.0, float(elasticity.min())), 1.15 * float(elasticity.max()))
    axes[0, 0].set_xlabel("displacement (mm)")
    axes[0, 0].set_ylabel("d ln F / d ln parameter")
    axes[0, 0].legend(fontsize=8)
    pair = [name for name in IDENTIFIED if name in found.names]
    _half_widths(axes[0, 1], found, None, "B", "fat and fascia known within their ranges")
    if pair:
        _half_widths(axes[1, 0], found, pair, "C", "fat and fascia known exactly")
    else:
        axes[1, 0].axis("off")
    _eigenvectors(axes[1, 1], found, result.definition.depth)
    return save(figure, out, "information")


def _half_widths(axes: Axes, found: Information, unknown: Sequence[str] | None, letter: str, name: str) -> None:
    panel(axes, letter, f"least 95 % half-width; {name}")
    names = list(found.names) if unknown is None else unknown
    within = unknown is None
    widths = np.array([1.96 * found.relative_sd(float(d), names, within) for d in found.displacement])
    for k, parameter in enumerate(names):
        colour = _COLOURS[found.names.index(parameter) % 8]
        axes.semilogy(found.displacement, 100 * widths[:, k], color=colour, label=label_of(parameter))
    axes.axhline(100 * IDENTIFIED_WITHIN, color=FAINT, ls="--", lw=1)
    axes.text(
        found.displacement[-1],
        90 * IDENTIFIED_WITHIN,
        "told within 50 %",
        ha="right",
        va="top",
        color=FAINT,
        fontsize=8,
    )
    axes.set_ylim(0.5, 1e4)
    axes.set_xlim(0, found.displacement[-1])
    axes.set_xlabel("depth of the recorded curve (mm)")
    axes.set_ylabel("% of the parameter")
    axes.legend(fontsize=8)


def _eigenvectors(axes: Axes, found: Information, depth: float) -> None:
    panel(axes, "D", f"eigenvectors of the information at {depth:g} mm, best told first")
    spread, vectors = found.directions(depth)
    size = len(spread)
    axes.imshow(vectors, cmap="RdBu_r", vmin=-1, vmax=1, aspect="auto")
    for row in range(size):
        for column in range(size):
            value = vectors[row, column]
            axes.text(
                column,
                row,
                f"{value:+.2f}",
                ha="center",
                va="center",
                fontsize=9,
                color="white" if abs(value) > 0.6 else "#111111",
            )
    axes.set_xticks(range(size), [_sd(percent) for percent in 100 * spread])
    axes.set_yticks(range(size), [f"ln {label_of(name)}" for name in found.names])
    axes.set_xlabel("combinations of the parameters (columns), each with its least relative sd")
    axes.spines[:].set_visible(False)
    axes.tick_params(length=0)


def _sd(percent: float) -> str:
    if not percent < 1e5:
        return "not told"
    return f"sd {percent:.0f} %" if percent >= 10 else f"sd {percent:.2g} %"
