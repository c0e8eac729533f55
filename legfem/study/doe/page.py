"""The page of one study, and that on the paper's claims over several."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from legfem.common.documents import markdown_table
from legfem.common.units import FloatArray
from legfem.report import page as web
from legfem.report.curves import Curves, Line
from legfem.report.page import Bars, LabelledBar, ResponseSurface, SurfaceFactor, SurfaceMetric
from legfem.report.render import bullets, fill, markdown_chapters
from legfem.report.style import DATA_COLOUR, FAINT
from legfem.report.words import ORIGINS
from legfem.study.doe import tables
from legfem.study.doe.claims import Verdict, in_words, not_seen, to_know, to_measure, verdicts
from legfem.study.doe.design import label_of
from legfem.study.doe.figures import RESPONSE
from legfem.study.doe.information import Information
from legfem.study.doe.study import MetricAnalysis, StudyResult
from legfem.study.doe.surface import term_label
from legfem.study.doe.tables import TABLE_3_NOTE, UNITS_NOTE, versions


def number_chapters(result: StudyResult) -> list[web.Chapter]:
    """Return the analysis of variance, the paper's beside it, numerical errors, Sobol indices."""
    chapters = [web.Chapter("Analysis of variance", _variance(result))]
    if beside := tables.table_3_cells(result):
        table = web.WebTable("Paper / legfem", *beside)
        chapters.append(web.Chapter("Beside the paper's Table 3", [table, web.Prose(TABLE_3_NOTE)]))
    if numerics := tables.numerics_cells(result):
        note = (
            "Errors of the default settings, from a mesh 1.5 times finer with steps of at most 0.5 mm, extrapolated as "
            "for first order: at the softest corner, the stiffest and the centre. The bound on a coefficient is the "
            "largest of these relative errors times the mean size of the metric."
        )
        table = web.WebTable("Numerical errors, and how much they can change a coefficient", *numerics)
        chapters.append(web.Chapter("Numerical error of the metrics", [table, web.Prose(note)]))
    if sobol := tables.sobol_cells(result):
        note = (
            "Shares of the variance with the factors uniform in their coded ranges, on an emulator trained on the runs "
            "above and a Latin hypercube. Its error is at simulations that it has not seen."
        )
        table = web.WebTable("First order, total", *sobol)
        chapters.append(web.Chapter("Sobol indices", [table, web.Prose(note)]))
    return chapters


def _variance(result: StudyResult) -> list[web.Block]:
    return [
        web.Bullets(result.run_notes()),
        web.Prose(f"{UNITS_NOTE} R² predicted is that of runs that were not used in the fit. {_counting(result)}"),
        web.WebTable("Analysis of variance of each metric", *tables.anova_cells(result)),
        web.WebTable(
            "Effects without an error estimate (Lenth), curvature at the centre, normality",
            *tables.effects_cells(result),
            folded=True,
        ),
        web.Prose(
            "The runs are deterministic, so the error in the t tests is the surface's lack of fit. Lenth's pseudo "
            "standard error (PSE) is estimated from the small contrasts; a contrast beyond its simultaneous margin "
            "is not due to chance (95 % for all together). 'corners - centre' is 0 for a surface without squared "
            "terms. The column for normality gives the probability in Shapiro and Wilk's test."
        ),
    ]


def _counting(result: StudyResult) -> str:
    if result.counting == "coefficients":
        return (
            "Degrees of freedom: coefficients less 1, and runs less coefficients, as in the "
            "paper's Table 3 (15 and 17), not as in its text; --count factors gives the text's."
        )
    return (
        "Degrees of freedom: factors less 1, and runs less factors, as in the paper's text "
        "(p = 5: 4 and 28). Its Table 3 and statistics use the number of coefficients instead."
    )


def information_blocks(result: StudyResult) -> list[web.Block]:
    """Return what a curve to each depth tells of the parameters; nothing where it isn't known."""
    found, cells = result.information, tables.information_cells(result)
    if found is None or cells is None:
        return []
    depth, instrument = result.definition.depth, result.subject.instrument
    point = ", ".join(f"{label_of(name)} {value:.4g}" for name, value in zip(found.names, found.nominal, strict=True))
    return [
        web.WebTable("Smallest possible 95 % half-widths of the parameters, by depth", *cells),
        web.Prose(
            "The half-widths are relative to the value. No unbiased estimate can have smaller ones at "
            f"{point} (MPa, mm), from one trial with one independent reading a mm and errors of "
            f"{instrument.force_sd:.3g} N and {instrument.displacement_sd:.3g} mm (sd). They do not include the "
            "model's own error. 'Others within their ranges' means that all but C10 and C20 of the deep tissue "
            "are known before the test, with the ranges above as 95 % intervals of their logarithms. A parameter is "
            "called determined when it is known within 50 %."
        ),
        web.Prose(
            "Combinations of parameters at full depth (eigenvectors of the information), the best determined first, "
            "each with its standard deviation:"
        ),
        web.Bullets(_eigenvectors(found, depth)),
        *([web.Bullets(moved)] if (moved := _moved(found, depth)) else []),
    ]


def _eigenvectors(found: Information, depth: float) -> list[str]:
    lines = []
    spread, vectors = found.directions(depth)
    for k, sd in enumerate(spread):
        parts = " ".join(f"{v:+.2f} ln {label_of(name)}" for v, name in zip(vectors[:, k], found.names, strict=True))
        lines.append(f"{100 * sd:.2g} % (sd): {parts}" if sd < 1 else f"not determined: {parts}")
    return lines


def _moved(found: Information, depth: float) -> list[str]:
    return [
        f"If {in_words(assumed)} is assumed 10 % too high, C10 of the deep tissue changes by {10 * first:+.1f} % and "
        f"C20 by {10 * second:+.1f} %."
        for assumed, (first, second) in found.biases(depth).items()
    ]


_NOT_TESTED = (
    "Whether a real leg follows the model: every force here is simulated, in plane strain.",
    "What the tissues do in time, friction, and other physics that the model leaves out: see legfem plan.",
    "Values beyond the ranges below.",
)
_NO_METRIC = "No metric could be analysed."
_POINTS = 121


def study_web_page(result: StudyResult, seed: int, command: str) -> web.WebPage:
    """Return the page of one study.

    Parameters
    ----------
    result
        Of the study.
    seed
        Of the emulator's points.
    command
        That does it again.
    """
    chapters = [
        web.Chapter("What each factor causes", _effects(result)),
        web.Chapter("The forces behind it", [_curves(result)]),
        web.Chapter("The response surface", _surface(result)),
        *number_chapters(result),
        web.Chapter("What to measure", [web.Bullets(to_measure(result)), *information_blocks(result)]),
        web.Chapter("What was tested", _claims(result)),
        web.Chapter("What could not be tested", [web.Bullets(_NOT_TESTED)]),
    ]
    return web.WebPage(
        title="What does a compression test of this leg show?",
        subject=f"{result.subject.title}, section of subject {result.subject.id}; {result.definition.title}",
        origin="simulated",
        headline=_headline(result),
        warnings=_warnings(result),
        known=_known(result),
        chapters=chapters,
        repeat=web.Repeat(command, versions(), {"seed": f"{seed}"}),
        data=f"simulated data (forces of a model; section of the leg: {result.subject.origin})",
    )


def _headline(result: StudyResult) -> web.Headline:
    if not result.analyses:
        return web.Headline(
            "wrong",
            "No metric could be analysed: too few simulations reached their depth.",
            [("What to do", "Look at the warnings, narrow the ranges, and run it again.")],
            "The study gave no answer",
        )
    factor, share, metric = result.largest_share()
    fits = [a.anova.predicted_r_squared for a in result.analyses]
    unseen = not_seen(result)
    return web.Headline(
        "caution" if _warnings(result) else "sound",
        f"The force of a press {result.definition.depth:g} mm deep depends most on {in_words(factor.name)}, which "
        f"causes {100 * share:.0f} % of the variation in the {metric.label} over the ranges.",
        [
            (
                "What it does not show",
                f"It hardly depends on {' and '.join(unseen)}: below 1 % in every window."
                if unseen
                else "Every factor causes 1 % or more somewhere.",
            ),
            (
                "How sure",
                f"The fitted surface predicts {_percents(fits)} of the variance of runs that were not used in the fit "
                "(R²). The runs are a model's, without noise.",
            ),
            ("What must be known before the test", to_know(result)),
            ("What to do", to_measure(result)[0]),
        ],
        "What a test of this leg can show",
    )


def _percents(shares: Sequence[float]) -> str:
    low, high = (f"{100 * max(share, 0.0):.0f}" for share in (min(shares), max(shares)))
    return f"{low} %" if low == high else f"{low} to {high} %"


def _warnings(result: StudyResult) -> list[str]:
    short = result.stopped_short()
    lines = [f"{short}."] if short else []
    lines += [f"{metric.label} isn't analysed: {why}." for metric, why in result.not_analysed]
    note = result.fascia_note()
    return [*lines, note] if note else lines


def _known(result: StudyResult) -> list[web.Known]:
    source = result.definition.source.name
    rows = [
        web.Known(
            f.label,
            f"{f.low:g} to {f.high:g} {f.unit_text}",
            "assumed",
            source,
            remark=f"range of the design, {f.coding}; its centre {f.value(0.0):.4g}",
        )
        for f in result.definition.factors
    ]
    rows.append(web.Known("depth of the press", f"{result.definition.depth:g} mm", "assumed", source))
    found = result.information
    if found is not None:
        instrument = result.subject.instrument
        rows += [
            web.Known(
                "error of a force reading", f"{instrument.force_sd:.3g} N (sd)", "prior", "subject.toml, or usual"
            ),
            web.Known(
                "error of a displacement reading",
                f"{instrument.displacement_sd:.3g} mm (sd)",
                "prior",
                "subject.toml, or usual",
            ),
        ]
    return rows


def _effects(result: StudyResult) -> list[web.Block]:
    if not result.analyses:
        return [web.Prose(_NO_METRIC)]
    blocks: list[web.Block] = [
        web.Prose(
            "Shares of how a metric varies when every factor goes from its low to its high value: "
            "squares of the coefficients over their sum. Slopes say how hard the leg is to press "
            "in a window of depth, curvatures how fast that grows."
        )
    ]
    factors = result.definition.factors
    every = [(analysis.metric.label, *analysis.shares()) for analysis in result.analyses]
    deepest, main, interactions = every[-1]
    bars = [LabelledBar(f.label, 100 * main[f.symbol], f"{100 * main[f.symbol]:.1f} %") for f in factors]
    bars.append(LabelledBar("all interactions", 100 * interactions, f"{100 * interactions:.1f} %"))
    rows = [[f.label, *(f"{100 * one[f.symbol]:.1f} %" for _, one, _ in every)] for f in factors]
    rows.append(["all interactions", *(f"{100 * rest:.1f} %" for _, _, rest in every)])
    return [
        *blocks,
        Bars(f"Shares of the {deepest}", ("factor", "share"), bars, greatest=100.0),
        web.WebTable("Shares of every metric", ["factor", *(name for name, _, _ in every)], rows),
    ]


def _curves(result: StudyResult) -> Curves:
    depth = result.definition.depth
    grid = np.linspace(0.0, depth, _POINTS)
    every = np.array([_on(grid, r.displacement, r.force_per_length) for r in result.records])
    centre, corners = every[-1], every[:-1]
    lines = [Line("centre of the ranges", centre, None, DATA_COLOUR)]
    if result.analyses:
        factor, _, _ = result.largest_share()
        k = result.definition.factors.index(factor)
        for level, word, colour in ((-1, "low", "#E69F00"), (1, "high", "#0072B2")):
            chosen = corners[result.coded[: len(corners), k] == level]
            lines.append(Line(f"mean with {factor.label} {word}", chosen.mean(axis=0), None, colour, "dashed"))
    if np.isfinite(corners).any(axis=1).any():
        lines += [
            Line("least of all runs", corners.min(axis=0), None, FAINT, "dotted"),
            Line("greatest of all runs", corners.max(axis=0), None, FAINT, "dotdash"),
        ]
    return Curves(
        "runs",
        f"Force per length of the cylinder over its displacement, of {len(result.records)} "
        "simulations; where one stopped short, the lines over all end.",
        grid,
        "displacement (mm)",
        "force per length (N/mm)",
        "",
        lines,
    )


def _on(grid: FloatArray, at: FloatArray, values: FloatArray) -> FloatArray:
    if len(at) == 0:
        return np.full(len(grid), np.nan)
    return np.interp(grid, at, values, right=np.nan)


def _surface(result: StudyResult) -> list[web.Block]:
    if not result.analyses:
        return [web.Prose(_NO_METRIC)]
    factors = result.definition.factors
    numbers = {f.symbol: k for k, f in enumerate(factors)}
    main, _ = result.analyses[-1].shares()
    first, second, *_ = sorted(numbers, key=lambda symbol: -main[symbol])
    return [
        ResponseSurface(
            "Map of the fitted surface over two factors. The other factors are where their sliders stand, and the "
            "cross marks the sliders of these two. Dark is high, light is low.",
            [
                SurfaceFactor(
                    f.label,
                    (*(f"{f.value(at):.3g} {f.unit_text}" for at in (-1.0, 0.0, 1.0)),),  # type: ignore[arg-type]
                )
                for f in factors
            ],
            [
                SurfaceMetric(
                    a.metric.label,
                    a.metric.typeset_unit,
                    {tuple(numbers[s] for s in t.term.split(":") if s in numbers): t.value for t in a.tests},
                )
                for a in result.analyses
            ],
            ["coefficient of the coded factors", *(a.metric.label for a in result.analyses)],
            [
                [term_label(test.term, factors), *(_coefficient(a, k) for a in result.analyses)]
                for k, test in enumerate(result.analyses[0].tests)
            ],
            (numbers[first], numbers[second]),
        )
    ]


def _coefficient(analysis: MetricAnalysis, number: int) -> str:
    test = analysis.tests[number]
    return f"{test.value:+.2e} (t {test.t:+.1f}){'*' if test.significant else ''}"


def _claims(result: StudyResult) -> list[web.Block]:
    rows = [[v.claim, v.verdict, "; ".join(f.evidence for f in v.findings)] for v in verdicts([result])]
    return [web.WebTable("The paper's claims, put to this study", ["claim", "verdict", "why"], rows)]


def claims_page(results: Sequence[StudyResult], found: Sequence[Verdict], command: str) -> str:
    """Write the page on the claims over all studies of one command.

    Parameters
    ----------
    results
        Of the studies.
    found
        The verdicts on all studies.
    command
        What wrote the page.
    """
    subject = results[0].subject
    titles = [result.definition.title for result in results]
    blocks = [
        "# The paper's design of experiments: its claims",
        f"Written by `{command}`.",
        fill(
            f"Subject {subject.id}, {ORIGINS[subject.origin]}. Forces are simulated in plane "
            "strain, in N per mm of the cylinder's length. Each claim is put to the studies "
            f"below: {'; '.join(titles)}. Their own reports have all figures."
        ),
        markdown_table(["claim", "verdict"], [[v.claim, v.verdict] for v in found], aligned=True),
        *(f"![Response surface: {result.definition.title}]({shown(result)})" for result in results),
        f"## What shows it\n\n{_evidence(found, titles)}",
    ]
    for result, title in zip(results, titles, strict=True):
        told = web.Chapter("What a curve tells of the parameters", information_blocks(result))
        blocks += [f"# In numbers: {title}", *markdown_chapters([*number_chapters(result), told])]
    return "\n\n".join(block.rstrip() for block in blocks) + "\n"


def shown(result: StudyResult) -> str:
    """Place, in the page's folder, of a study's figure of the response surface."""
    return f"figures/{result.definition.source.stem}-{RESPONSE}.svg"


def gather_figures(results: Sequence[StudyResult], folders: Sequence[Path], out: Path) -> None:
    """Copy the studies' figures to where the page, in ``out``, finds them."""
    for result, folder in zip(results, folders, strict=True):
        if (drawn := folder / f"{RESPONSE}.svg").exists():
            (out / shown(result)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(drawn, out / shown(result))


def _evidence(found: Sequence[Verdict], titles: Sequence[str]) -> str:
    """Claims, what became of each, and what shows it."""
    blocks = []
    for verdict in found:
        lines = [f"**{verdict.claim}**: {verdict.verdict}.", ""]
        for title, finding in zip(titles, verdict.findings, strict=True):
            where = f" ({finding.shown_in})" if finding.shown_in else ""
            text = f"{title + ': ' if len(titles) > 1 else ''}{finding.evidence}{where}"
            lines.append(bullets([text]))
        blocks.append("\n".join(lines))
    return "\n\n".join(blocks) + "\n"
