"""The chapters of a study's page that hold its numbers."""

from __future__ import annotations

from legfem.report import page as web
from legfem.study.doe import tables
from legfem.study.doe.factors import label_of
from legfem.study.doe.information import IDENTIFIED, Information
from legfem.study.doe.remarks import run_notes
from legfem.study.doe.study import StudyResult

UNITS_NOTE = "Sums of squares in (N/mm²)² for slopes and (N/mm³)² for curvatures."
TABLE_3_NOTE = (
    f"{UNITS_NOTE} Paper / legfem. 'Half of it': legfem's "
    "curvature is the mean second derivative; the coefficient of d^2 in the least-squares parabola "
    "is half of that, and its sums of squares a quarter. The paper prints no F: its own is "
    "(SSR/15)/(SSE/17)."
)


def number_chapters(result: StudyResult) -> list[web.Chapter]:
    """Return the analysis of variance, the paper's beside it, numerical errors, Sobol indices."""
    chapters = [web.Chapter("Analysis of variance", _variance(result))]
    if beside := tables.table_3_cells(result):
        table = web.WebTable("Paper / legfem", *beside)
        chapters.append(web.Chapter("Beside the paper's Table 3", [table, web.Prose(TABLE_3_NOTE)]))
    if numerics := tables.numerics_cells(result):
        note = (
            "Errors of the default settings, from a mesh 1.5 times finer with steps of at most "
            "0.5 mm, extrapolated as for first order: at the softest corner, the stiffest and "
            "the centre. The bound on a coefficient is the largest of these relative errors "
            "times the mean size of the metric."
        )
        table = web.WebTable("Errors, and what they can make of a coefficient", *numerics)
        chapters.append(web.Chapter("Numerical error of the metrics", [table, web.Prose(note)]))
    if sobol := tables.sobol_cells(result):
        note = (
            "Shares of the variance with the factors uniform in their coded ranges, on an "
            "emulator trained on the runs above and a Latin hypercube. Its error is at "
            "simulations that it has not seen."
        )
        table = web.WebTable("First order, total", *sobol)
        chapters.append(web.Chapter("Sobol indices", [table, web.Prose(note)]))
    return chapters


def _variance(result: StudyResult) -> list[web.Block]:
    return [
        web.Bullets(run_notes(result)),
        web.Prose(f"{UNITS_NOTE} R² predicted is that of runs which the surface hasn't seen. {_counting(result)}"),
        web.WebTable("Sums of squares and what they say, a row a metric", *tables.anova_cells(result)),
        web.WebTable(
            "Effects without an error estimate (Lenth), curvature at the centre, normality",
            *tables.effects_cells(result),
            folded=True,
        ),
        web.Prose(
            "The runs are deterministic: what the t tests take for error is the surface's lack of "
            "fit. Lenth's pseudo standard error (PSE) is that of the small contrasts among all; "
            "beyond its simultaneous margin a contrast is no chance (95 % for all together). "
            "'corners - centre' is 0 for a surface without squares. Normality: probabilities of "
            "Shapiro and Wilk's test."
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
        web.WebTable("95 % half-widths of the parameters by depth, the least that a test can have", *cells),
        web.Prose(
            "Relative to the value: the least that any unbiased estimate can have, at "
            f"{point} (MPa, mm), for one trial with one independent reading a mm, "
            f"{instrument.force_sd:.3g} N and {instrument.displacement_sd:.3g} mm (sd). A "
            "curve's model error isn't in them. 'Others within their ranges': what isn't deep C10 "
            "or C20 is known beforehand, its range above being a 95 % interval of its logarithm. "
            "Told: within 50 %."
        ),
        web.Prose("Eigenvectors of the information at full depth, best determined first:"),
        web.Bullets(_eigenvectors(found, depth)),
        *([web.Bullets(moved)] if (moved := _biases(found, depth)) else []),
    ]


def _eigenvectors(found: Information, depth: float) -> list[str]:
    lines = []
    spread, vectors = found.directions(depth)
    for k, sd in enumerate(spread):
        parts = " ".join(f"{v:+.2f} ln {label_of(name)}" for v, name in zip(vectors[:, k], found.names, strict=True))
        lines.append(f"sd {sd:.2%}: {parts}" if sd < 100 else f"not determined: {parts}")
    return lines


def _biases(found: Information, depth: float) -> list[str]:
    if not set(IDENTIFIED) <= set(found.names):
        return []
    lines = []
    for assumed in (name for name in found.names if name not in IDENTIFIED):
        first, second = found.bias(depth, IDENTIFIED, assumed)
        lines.append(
            f"assumed {label_of(assumed)} 10 % too high: deep C10 {0.1 * first:+.1%}, deep C20 {0.1 * second:+.1%}"
        )
    return lines
