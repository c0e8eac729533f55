"""A study as pictures: the response surface as in the paper's Fig. 5, effects, normality, and what is beyond."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from scipy.stats import norm

from legfem.report.style import FAINT, new_figure, panel, save, styled, title
from legfem.study.doe.design import Factor, label_of
from legfem.study.doe.information import IDENTIFIED, IDENTIFIED_WITHIN, Information
from legfem.study.doe.study import MetricAnalysis, StudyResult
from legfem.study.doe.surface import Normality, term_label

RESPONSE = "response"
"""Name of the response surface's figure."""
STAGE_COLOURS = ("#56B4E9", "#E69F00", "#009E73", "#CC79A7", "#0072B2", "#D55E00")
TISSUE_COLOURS = {"deep": "#D55E00", "superficial": "#E69F00", "fascia": "#4D4D4D"}


@styled
def draw_response(result: StudyResult, out: Path) -> list[Path]:
    """Draw the paper's Fig. 5: the stages on the curves, and the coefficients by stage."""
    figure = new_figure(14, 8)
    title(figure, f"Response surface: {result.definition.title}", *result.whose)
    grid = figure.add_gridspec(2, 3, height_ratios=[1, 1.5])
    _curves(figure.add_subplot(grid[:, 0]), result)
    for row, interactions in enumerate((False, True)):
        for column, kind in enumerate(("curvature", "slope")):
            axes = figure.add_subplot(grid[row, 1 + column])
            chosen = [a for a in result.analyses if a.metric.kind == kind]
            what = "interactions" if interactions else "main effects"
            panel(axes, "BCDE"[2 * row + column], f"mean {kind}: {what}")
            _bars(axes, chosen, result.definition.factors, interactions)
            if column > 0:  # the terms are those of the panel to the left
                axes.set_yticklabels([])
    figure.supxlabel(
        "Coefficients of the coded factors (-1 to +1) by window of displacement, in the colours of panel A.  s: "
        "significant at 5 % by the paper's t test;  L: beyond Lenth's simultaneous limit.",
        fontsize=9,
    )
    return save(figure, out, RESPONSE, svg=True)


def power_of_ten(exponent: int) -> str:
    """Return what is put before a unit."""
    return f"$10^{{{exponent}}}$"


def _curves(axes: Axes, result: StudyResult) -> None:
    panel(axes, "A", f"all {len(result.records)} runs")
    for k, (start, end) in enumerate(result.definition.windows):
        colour = STAGE_COLOURS[k % len(STAGE_COLOURS)]
        axes.axvspan(start, end, color=colour, alpha=0.35, lw=0, label=f"{start:g} to {end:g} mm")
    for k, record in enumerate(result.records):
        centre = k == len(result.records) - 1
        axes.plot(
            record.displacement,
            record.force_per_length,
            color="#111111" if centre else FAINT,
            lw=2 if centre else 0.6,
            label="centre" if centre else None,
            zorder=3 if centre else 2,
        )
        if not record.complete and record.reached > 0:
            axes.plot(record.reached, record.force_per_length[-1], "x", color="#D55E00")
    axes.set_xlim(0, result.definition.depth)
    axes.set_ylim(0, None)
    axes.set_xlabel("displacement (mm)")
    axes.set_ylabel("force per length (N/mm)")
    axes.legend(loc="upper left")


def _bars(axes: Axes, analyses: list[MetricAnalysis], factors: tuple[Factor, ...], interactions: bool) -> None:
    if not analyses:
        axes.text(0.5, 0.5, "not estimable", ha="center", transform=axes.transAxes)
        return
    chosen = [k for k, t in enumerate(analyses[0].tests) if k > 0 and t.is_interaction == interactions]
    height = 0.8 / len(analyses)
    for stage, analysis in enumerate(analyses):
        colour = STAGE_COLOURS[_stage(analysis, analyses)]
        for row, k in enumerate(chosen):
            test = analysis.tests[k]
            at = row + (stage - (len(analyses) - 1) / 2) * height
            axes.barh(at, test.value, height, color=colour)
            beyond = analysis.lenth is not None and (abs(test.value) > analysis.lenth.simultaneous_margin)
            mark = ("s" if test.significant else "") + ("L" if beyond else "")
            if not mark:
                continue
            right = test.value >= 0
            axes.annotate(
                mark,
                (test.value, at),
                xytext=(3 if right else -3, 0),
                fontsize=7,
                textcoords="offset points",
                va="center",
                ha="left" if right else "right",
            )
    axes.axvline(0, color="#111111", lw=0.8)
    axes.set_yticks(range(len(chosen)), [term_label(analyses[0].tests[k].term, factors) for k in chosen], fontsize=8)
    axes.invert_yaxis()
    axes.margins(x=0.12)
    axes.ticklabel_format(axis="x", scilimits=(-2, 2))
    axes.set_xlabel(f"coefficient ({analyses[0].metric.typeset_unit})")


def _stage(analysis: MetricAnalysis, analyses: list[MetricAnalysis]) -> int:
    starts = sorted({(a.metric.start, a.metric.end) for a in analyses})
    return starts.index((analysis.metric.start, analysis.metric.end)) % len(STAGE_COLOURS)


@styled
def draw_half_normal(result: StudyResult, out: Path) -> list[Path]:
    """Draw all contrasts against half-normal quantiles, with Lenth's limits."""
    analyses = [a for a in result.analyses if a.lenth is not None]
    if not analyses:
        return []
    columns = (len(analyses) + 1) // 2
    figure = new_figure(4.6 * columns, 8)
    title(figure, f"Effects: {result.definition.title}", *result.whose)
    for k, (axes, analysis) in enumerate(zip(figure.subplots(2, columns, squeeze=False).flat, analyses, strict=False)):
        found = analysis.lenth
        assert found is not None
        quantiles, sizes, terms = found.half_normal
        panel(axes, "ABCDEFGHIJKL"[k % 12], analysis.metric.label)
        inside = set(analysis.surface.coefficients.index)
        for quantile, size, term in zip(quantiles, sizes, terms, strict=True):
            mark, face = ("o", _colour(term)) if term in inside else ("^", "white")
            axes.plot(quantile, size, mark, ms=5, color=_colour(term), mfc=face)
        line = np.array([0, quantiles[-1]])
        axes.plot(line, found.pseudo_standard_error * line, color=FAINT, lw=0.8)
        axes.axhline(found.margin, color=FAINT, ls=":", lw=1)
        axes.axhline(found.simultaneous_margin, color=FAINT, ls="--", lw=1)
        _name_largest(axes, quantiles, sizes, terms, found.simultaneous_margin)
        if analysis.centre is not None:
            axes.plot(
                [],
                [],
                " ",
                label=f"corners - centre: {analysis.centre.relative:+.0%}\n"
                f"of the largest (p = {analysis.centre.p_value:.1g})",
            )
            axes.legend(loc="upper left", fontsize=8, handlelength=0, handletextpad=0)
        axes.set_xlim(0, quantiles[-1] * 1.08)
        axes.ticklabel_format(axis="y", scilimits=(-2, 2))
        axes.set_xlabel("half-normal quantile")
        axes.set_ylabel(f"|coefficient| ({analysis.metric.typeset_unit})")
    names = ", ".join(f"{_letter(f.symbol)}: {f.label}" for f in result.definition.factors)
    figure.supxlabel(
        "filled: in the surface; open: higher interactions; dotted: Lenth's margin of error, "
        f"dashed: simultaneous; line: as if all were noise\n{names}; blue: several tissues",
        fontsize=9,
    )
    return save(figure, out, "half-normal")


_SHORT = {
    "deep_C10": "d",
    "deep_C20": "D",
    "superficial_C10": "s",
    "fascia_C10": "f",
    "fascia_thickness": "t",
    "indenter_diameter": "i",
}
_NAMED = 7


def _letter(symbol: str) -> str:
    return _SHORT.get(symbol, f" {symbol} ")


def _name_largest(axes: Axes, quantiles: np.ndarray, sizes: np.ndarray, terms: list[str], limit: float) -> None:
    largest = reversed(list(zip(quantiles, sizes, terms, strict=True))[-_NAMED:])
    span = 1.05 * float(sizes[-1])
    taken: list[tuple[float, float]] = []
    for quantile, size, term in largest:
        if size <= limit:
            continue
        # A name goes up until it is clear of those to its right (in points, of a panel's size).
        x, y = 105 * quantile, 200 * size / span
        raised = 2.0
        while any(abs(x - other) < 24 and abs(y + raised - at) < 9 for other, at in taken):
            raised += 3.0
        taken.append((x, y + raised))
        name = "".join(_letter(part) for part in term.split(":"))
        leader = {"arrowstyle": "-", "lw": 0.5, "color": FAINT, "shrinkA": 0} if raised > 8 else None
        axes.annotate(
            name,
            (quantile, size),
            xytext=(-5, raised),
            fontsize=8,
            ha="right",
            textcoords="offset points",
            arrowprops=leader,
        )


def _colour(term: str) -> str:
    parts = {symbol.partition("_")[0] for symbol in term.split(":")}
    return TISSUE_COLOURS.get(parts.pop(), FAINT) if len(parts) == 1 else "#0072B2"


@styled
def draw_normality(result: StudyResult, out: Path) -> list[Path]:
    """Draw outputs (as the paper checked) and residuals (as one should) by normal quantiles."""
    if not result.analyses:
        return []
    figure = new_figure(2.6 * len(result.analyses) + 0.6, 6)
    title(figure, f"Normality: {result.definition.title}", *result.whose)
    axes = figure.subplots(2, len(result.analyses), squeeze=False)
    for column, analysis in enumerate(result.analyses):
        metric = analysis.metric
        outputs, residuals = analysis.surface.response, analysis.surface.residuals
        _quantiles(axes[0, column], outputs, metric.typeset_unit)
        _quantiles(axes[1, column], residuals, metric.typeset_unit)
        axes[0, column].set_title(f"{metric.label}\n{_probabilities(analysis.outputs)}", fontsize=9)
        axes[1, column].set_title(_probabilities(analysis.residuals), fontsize=9)
    axes[0, 0].set_ylabel(f"outputs\n{axes[0, 0].get_ylabel()}")
    axes[1, 0].set_ylabel(f"residuals\n{axes[1, 0].get_ylabel()}")
    figure.supxlabel(
        "normal quantile.  On the line: normal.  Probabilities of samples as far from normal, were "
        "they normal: SW, Shapiro and Wilk; L, Lilliefors.  Open: the centre.",
        fontsize=9,
    )
    return save(figure, out, "normality")


def _probabilities(found: Normality) -> str:
    return f"p: SW {found.shapiro:.1g}, L {found.lilliefors:.1g}"


def _quantiles(axes: Axes, values: np.ndarray, unit: str) -> None:
    power = int(np.floor(np.log10(np.abs(values).max())))
    values = values / 10.0**power
    order = np.argsort(values)
    quantiles = norm.ppf((np.arange(len(values)) + 0.5) / len(values))
    centre = order == len(values) - 1
    axes.plot(quantiles, values[order], "o", ms=3.5, color="#0072B2")
    axes.plot(quantiles[centre], values[order][centre], "o", ms=6, color="#0072B2", mfc="white")
    axes.plot(quantiles, values.mean() + values.std(ddof=1) * quantiles, color=FAINT, lw=0.8)
    axes.set_ylabel(f"{power_of_ten(power)} {unit}", fontsize=9)


_COLOURS = ("#E69F00", "#D55E00", "#0072B2", "#4D4D4D", "#CC79A7", "#009E73", "#56B4E9", "#8C8C8C")


@styled
def draw_sobol(result: StudyResult, out: Path) -> list[Path]:
    """Draw the indices by metric, and the emulator against simulations it hasn't seen."""
    found = result.sobol
    if not found:
        return []
    figure = new_figure(13, 8)
    title(figure, f"Sobol indices: {result.definition.title}", *result.whose)
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
    title(figure, f"What a curve tells: {result.definition.title}", *result.whose)
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
        "determined within 50 %",
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
    panel(axes, "D", f"eigenvectors of the information at {depth:g} mm, best determined first")
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
        return "not determined"
    return f"sd {percent:.0f} %" if percent >= 10 else f"sd {percent:.2g} %"
