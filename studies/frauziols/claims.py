"""The paper's Table 3 and its claims, put to designs of experiments, with their page."""

import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from legfem.common.documents import Cells, markdown_table
from legfem.report import page as web
from legfem.report.render import bullets, fill, markdown_chapters
from legfem.report.words import ORIGINS
from legfem.study.doe.command import DoeOptions
from legfem.study.doe.design import Factor
from legfem.study.doe.figures import RESPONSE
from legfem.study.doe.information import IDENTIFIED, IDENTIFIED_WITHIN
from legfem.study.doe.study import StudyResult
from legfem.study.doe.surface import Anova, CoefficientTest, MetricAnalysis
from legfem.study.doe.tables import UNITS_NOTE, information_blocks, number_chapters

TABLE_2 = (
    Factor("superficial.C10", 1.0, 30.0, "kPa", "linear"),
    Factor("deep.C10", 0.5, 30.0, "kPa", "linear"),
    Factor("deep.C20", 0.5, 30.0, "kPa", "linear"),
    Factor("fascia.C10", 0.1, 10.0, "MPa", "linear"),
    Factor("fascia.thickness", 0.2, 1.0, "mm", "linear"),
)
"""The paper's factors and their ranges."""

MODEL_DOF, ERROR_DOF = 15, 17
"""What 16 coefficients and 33 runs leave."""


@dataclass(frozen=True)
class PrintedRow:
    """One row of the paper's Table 3 as printed; forces per unit thickness."""

    metric: str
    ssr: str
    msr: str
    sse: str
    mse: str
    r_squared: str

    @property
    def label(self) -> str:
        """Metric as people read it."""
        kind, start, end = self.metric.split("_")
        return f"{kind} {start}-{end} mm"


TABLE_3 = (
    PrintedRow("curvature_0_5", "9.40e-5", "6.3e-6", "6.7e-7", "4.0e-8", "0.9929"),
    PrintedRow("curvature_5_20", "3.2e-5", "2.1e-6", "1.2e-7", "6.9e-9", "0.9964"),
    PrintedRow("curvature_20_30", "1.8e-4", "1.7e-5", "3.2e-7", "1.9e-8", "0.9982"),
    PrintedRow("slope_0_5", "2.2e-2", "1.5e-3", "2.1e-4", "1.2e-5", "0.9907"),
    PrintedRow("slope_5_20", "5.7e-2", "3.8e-3", "1.1e-4", "6.7e-6", "0.9980"),
    PrintedRow("slope_20_30", "0.19", "1.3e-2", "1.4e-2", "8.0e-4", "0.9336"),
)

TABLE_3_NOTE = (
    f"{UNITS_NOTE} Paper / legfem. 'Half of it': legfem's curvature is the mean second derivative; the coefficient of "
    "d^2 in the least-squares parabola is half of that, and its sums of squares a quarter. The paper prints no F: its "
    "own is (SSR/15)/(SSE/17)."
)


def table_3_cells(result: StudyResult) -> Cells | None:
    """Analysis beside the paper's Table 3; None where the ranges aren't Table 2's."""
    if set(result.definition.factors) != set(TABLE_2):
        return None
    printed, rows = {row.metric: row for row in TABLE_3}, []
    for a in result.analyses:
        if a.metric.name not in printed:
            continue
        row = printed[a.metric.name]
        paper_f = float(row.ssr) / MODEL_DOF / (float(row.sse) / ERROR_DOF)
        last = [f"{row.r_squared} / {a.anova.r_squared:.4f}", f"{paper_f:.0f} / {a.anova.F:.0f}"]
        rows.append([a.metric.label, *_sums(row, a.anova, 1.0), *last])
        if a.metric.kind == "curvature":
            rows.append(["half of it", *_sums(row, a.anova, 0.25), *last])
    return ["metric: paper / legfem", "SSR", "MSR", "SSE", "MSE", "R2", "F"], rows


def _sums(row: PrintedRow, found: Anova, scale: float) -> list[str]:
    names = ("ssr", "msr", "sse", "mse")
    return [f"{_powers(float(getattr(row, n)))} / {_powers(scale * getattr(found, n))}" for n in names]


def _powers(value: float) -> str:
    """Two digits and the power of ten, as the paper prints numbers."""
    mantissa, _, exponent = f"{value:.1e}".partition("e")
    return f"{mantissa}e{int(exponent)}"


NEGLIGIBLE = 0.1
"""Share of the largest coefficient below which an effect plays no part."""


@dataclass(frozen=True)
class ClaimFinding:
    """Whether one study bears a claim out.

    Attributes
    ----------
    holds : bool, optional
        None where the study can't tell.
    shown_in : str
        Table or figure of the study that shows it.
    only_where : str
        Condition on which it holds.
    """

    holds: bool | None
    evidence: str
    shown_in: str
    only_where: str = ""


@dataclass(frozen=True)
class Verdict:
    """One claim over all studies, with a finding a study."""

    claim: str
    verdict: str
    findings: tuple[ClaimFinding, ...]


def verdicts(results: Sequence[StudyResult]) -> list[Verdict]:
    """Put each claim to all studies."""
    titles = [result.definition.title for result in results]
    found = []
    for claim, judge in CLAIMS.items():
        findings = tuple(
            judge(result) if result.analyses else ClaimFinding(None, "no metric was analysed", "") for result in results
        )
        found.append(Verdict(claim, _in_words(findings, titles), findings))
    return found


def _in_words(findings: tuple[ClaimFinding, ...], titles: list[str]) -> str:
    told = [(f.holds, title) for f, title in zip(findings, titles, strict=True) if f.holds is not None]
    if not told:
        return "cannot be determined"
    if all(holds for holds, _ in told):
        conditions = dict.fromkeys(f.only_where for f in findings if f.only_where)
        return f"holds only where {' and '.join(conditions)}" if conditions else "reproduced"
    if not any(holds for holds, _ in told):
        return "not reproduced"
    return "holds only with " + "; ".join(title for holds, title in told if holds)


def _good_fit(result: StudyResult) -> ClaimFinding:
    r2 = {a.metric.label: a.anova.r_squared for a in result.analyses}
    poor = [f"{name} {value:.4f}" for name, value in r2.items() if value <= 0.99]
    exception = next(row for row in TABLE_3 if float(row.r_squared) <= 0.99)
    text = (
        f"R2 from {min(r2.values()):.4f} to {max(r2.values()):.4f}; not above 0.99: {', '.join(poor) or 'none'} (in "
        f"the paper: {exception.label}, {exception.r_squared})"
    )
    return ClaimFinding(len(poor) <= 1, text, "the table of the analysis of variance")


def _first_order(result: StudyResult) -> ClaimFinding:
    centres = [(a.metric.label, a.centre) for a in result.analyses if a.centre is not None]
    if not centres:
        return ClaimFinding(None, "runs are missing", "")
    bent = [
        f"{name} {centre.relative:+.0%} of the largest coefficient"
        for name, centre in centres
        if centre.p_value <= 0.05
    ]
    text = f"mean of the corners less the centre, beyond Lenth's limit: {', '.join(bent) or 'none'}"
    return ClaimFinding(not bent, text, "the table of effects")


def _deep_dominates(result: StudyResult) -> ClaimFinding:
    first = {}
    for analysis in result.analyses:
        largest = max(analysis.main(), key=lambda test: abs(test.value))
        first[analysis.metric.label] = largest.term.replace("_", ".", 1)
    others = [f"{m}: {name}" for m, name in first.items() if name not in IDENTIFIED]
    where = f"not in {'; '.join(others)}" if others else f"in all {len(first)} metrics"
    text = f"C10 or C20 of the deep tissue has the largest coefficient {where}"
    return ClaimFinding(not others, text, "the response figure, panels B and C")


def _grows_with_depth(result: StudyResult) -> ClaimFinding:
    falls, parts = [], []
    for kind in ("curvature", "slope"):
        sums = [a.anova.ssr for a in result.analyses if a.metric.kind == kind]
        if len(sums) < 2:
            return ClaimFinding(None, "fewer than two windows", "")
        parts.append(f"{kind} " + ", ".join(f"{value:.2g}" for value in sums))
        falls += [kind for value in sums[1:] if value <= sums[0]]
    return ClaimFinding(not falls, f"SSR by window: {'; '.join(parts)}", "the table of the analysis of variance")


def _small_fascia(result: StudyResult) -> ClaimFinding:
    shares = {}
    for analysis in result.analyses:
        tests = analysis.main("fascia")
        if not tests:
            return ClaimFinding(None, "the fascia is not a factor", "")
        shares[analysis.metric.label] = _share(tests, analysis)
    worst = max(shares, key=lambda name: shares[name])
    text = (
        f"its larger coefficient over the metric's largest: {min(shares.values()):.0%} to {shares[worst]:.0%} ({worst})"
    )
    return ClaimFinding(shares[worst] < NEGLIGIBLE, text, "the response figure, panels B and C")


def _share(tests: list[CoefficientTest], analysis: MetricAnalysis) -> float:
    """Return the largest coefficient of some over the metric's largest main effect."""
    largest, whole = (max(abs(test.value) for test in some) for some in (tests, analysis.main()))
    return largest / whole


def _insignificant(
    chosen: Callable[[MetricAnalysis], list[CoefficientTest]], what: str, result: StudyResult
) -> ClaimFinding:
    found, largest = [], 0.0
    for analysis in result.analyses:
        tests = chosen(analysis)
        if not tests:
            return ClaimFinding(None, f"{what} is not a factor", "")
        largest = max(largest, _share(tests, analysis))
        found += [t for t in tests if t.significant]
    count = sum(len(chosen(analysis)) for analysis in result.analyses)
    text = (
        f"{len(found)} of {count} coefficients are significant at 5 %; "
        f"the largest is {largest:.0%} of its metric's largest main effect"
    )
    return ClaimFinding(not found, text, "the response figure, letter s")


def _normal_outputs(result: StudyResult) -> ClaimFinding:
    probabilities = {a.metric.label: a.outputs.shapiro for a in result.analyses}
    far = [f"{name} (p = {p:.1g})" for name, p in probabilities.items() if p <= 0.05]
    text = f"Shapiro and Wilk reject for {', '.join(far) or 'none'}"
    return ClaimFinding(not far, text, "the table of effects")


def _identifies_deep(result: StudyResult) -> ClaimFinding:
    information = result.information
    if information is None or not set(IDENTIFIED) <= set(information.names):
        return ClaimFinding(None, "no information was computed", "")
    depth = result.definition.depth
    at = [information.names.index(name) for name in IDENTIFIED]
    within = 1.96 * information.relative_sd(depth, within_ranges=True)[at]
    exactly = 1.96 * information.relative_sd(depth, IDENTIFIED)
    nothing = 1.96 * information.relative_sd(depth)[at]
    halves = [f"{_percent(first)} and {_percent(second)}" for first, second in (within, exactly, nothing)]
    text = (
        f"95 % half-widths of C10 and C20 at {depth:g} mm: {halves[0]} with fat and fascia known "
        f"within their ranges, {halves[1]} with them known exactly, {halves[2]} with them unknown"
    )
    free, given = (bool(half.max() <= IDENTIFIED_WITHIN) for half in (nothing, within))
    where = "fat and fascia are known within their ranges" if given and not free else ""
    return ClaimFinding(given, text, "the table of half-widths", where)


def _not_before_5_mm(result: StudyResult) -> ClaimFinding:
    information = result.information
    if information is None or not set(IDENTIFIED) <= set(information.names):
        return ClaimFinding(None, "no information was computed", "")
    shallow, deep = (1.96 * information.relative_sd(d, IDENTIFIED) for d in (5.0, result.definition.depth))
    depths = [information.told_from(name, IDENTIFIED) for name in IDENTIFIED]
    at = ["never" if d is None else f"{d:g} mm" for d in depths]
    text = (
        f"with the other tissues known, C10 and C20 are determined within 50 % from {at[0]} and {at[1]}; "
        f"half-widths at 5 mm {_percent(shallow[0])} and {_percent(shallow[1])}, at full depth "
        f"{_percent(deep[0])} and {_percent(deep[1])}"
    )
    return ClaimFinding(bool(np.all(deep < shallow)), text, "the table of half-widths")


def _percent(share: float) -> str:
    return f"{share:.1%}" if share < 10 else "over 1000 %"


CLAIMS: dict[str, Callable[[StudyResult], ClaimFinding]] = {
    "R2 is above 0.99 for all metrics but one": _good_fit,
    "a first-order surface with interactions is enough": _first_order,
    "the deep tissue dominates every metric": _deep_dominates,
    "SSR is higher in the 2nd and 3rd window for all metrics": _grows_with_depth,
    "identification is more relevant as compression progresses": _not_before_5_mm,
    "the fascia (stiffness, thickness) is not significant (t test)": partial(
        _insignificant, lambda a: a.main("fascia"), "the fascia"
    ),
    "the fascia plays no part: its effects are below a tenth of the largest": _small_fascia,
    "interactions are not significant (t test)": partial(_insignificant, MetricAnalysis.interactions, "an interaction"),
    "the outputs follow a normal law": _normal_outputs,
    "the test permits identifying the deep tissue": _identifies_deep,
}


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
        variance, *others = number_chapters(result)
        told = web.Chapter("What a curve tells of the parameters", information_blocks(result))
        chapters = [variance, *_beside_table_3(result), *others, told]
        blocks += [f"# In numbers: {title}", markdown_chapters(chapters)]
    return "\n\n".join(block.rstrip() for block in blocks) + "\n"


def _beside_table_3(result: StudyResult) -> list[web.Chapter]:
    cells = table_3_cells(result)
    if cells is None:
        return []
    return [
        web.Chapter("Beside the paper's Table 3", [web.WebTable("Paper / legfem", *cells), web.Prose(TABLE_3_NOTE)])
    ]


def shown(result: StudyResult) -> str:
    """Place, in the page's folder, of a study's figure of the response surface."""
    return f"figures/{result.definition.source.stem}-{RESPONSE}.svg"


def gather_figures(results: Sequence[StudyResult], options: DoeOptions) -> None:
    """Copy the studies' figures to where the page finds them."""
    for result in results:
        if (drawn := options.folder_of(result.definition) / f"{RESPONSE}.svg").exists():
            (options.out / shown(result)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(drawn, options.out / shown(result))


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
