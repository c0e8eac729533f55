"""The page that a person reads first."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

from legfem.mechanics.materials import Hyperelastic
from legfem.report.text import ORIGINS, WIDTH
from legfem.study.doe import tables
from legfem.study.doe.factors import PARAMETERS, UNITS, Factor, label_of
from legfem.study.doe.information import IDENTIFIED
from legfem.study.doe.page import TABLE_3_NOTE
from legfem.study.doe.study import StudyResult
from legfem.study.doe.verdict import verdicts


def report_page(result: StudyResult, files: Sequence[Path]) -> str:
    """Return the text of ``report.md`` for one study."""
    definition, subject = result.definition, result.subject
    blocks = [
        f"# Design of experiments: {definition.title}",
        f"Subject {subject.id}, {ORIGINS[subject.origin]}. Forces are simulated, in N per mm of "
        f"the cylinder's length, without a 3D correction; {definition.depth:g} mm deep.",
        _factors(result),
        f"## Runs\n\n{_runs(result)}",
        f"## Analysis of variance\n\n{tables.anova_table(result)}\n{_counting(result)}",
        _beside_table_3(result),
        f"## Coefficients of the coded factors\n\n{tables.coefficient_table(result)}",
        f"## Effects without an error estimate\n\n{tables.effects_table(result)}\n"
        + _fill(
            "The runs are deterministic: what the t tests take for error is the surface's lack of "
            "fit. Lenth's pseudo standard error (PSE) is that of the small contrasts among all; "
            "beyond its simultaneous margin a contrast is no chance (95 % for all together). "
            "'corners - centre' is 0 for a surface without squares. Normality: probabilities of "
            "Shapiro and Wilk's test."
        ),
    ]
    if result.numerics is not None:
        blocks.append(
            f"## Numerical error of the metrics\n\n{tables.numerics_table(result)}\n"
            + _fill(
                "Errors of the default settings, from a mesh 1.5 times finer with steps of at most "
                "0.5 mm, extrapolated as for first order: at the softest corner, the stiffest and "
                "the centre. The bound on a coefficient is the largest of these relative errors "
                "times the mean size of the metric."
            )
        )
    if result.sobol:
        blocks.append(
            f"## Sobol indices: first order, total\n\n{tables.sobol_table(result)}\n"
            + _fill(
                "Shares of the variance with the factors uniform in their coded ranges, on an "
                "emulator trained on the runs above and a Latin hypercube. Its error is at "
                "simulations that it has not seen."
            )
        )
    if result.information is not None:
        blocks.append(f"## Information by depth\n\n{_information(result)}")
    claims = tables.verdict_page(verdicts([result]), [definition.title])
    blocks.append(f"## The paper's claims\n\n{claims}")
    listed = "\n".join(f"- {path.name}" for path in files)
    blocks.append(f"## Files\n\n{listed}\n- runs.csv\n- result.json\n- runs/ (every simulation)")
    return "\n\n".join(block.rstrip() for block in blocks if block) + "\n"


def _beside_table_3(result: StudyResult) -> str:
    table = tables.beside_table_3(result)
    return f"## Beside the paper's Table 3\n\n{table}\n{_fill(TABLE_3_NOTE)}" if table else ""


def _factors(result: StudyResult) -> str:
    rows = [
        [f.label, f"{f.low:g}", f"{f.value(0.0):.4g}", f"{f.high:g}", f.unit_text, f.coding]
        for f in result.definition.factors
    ]
    text = tables.markdown(["factor", "-1", "0", "+1", "unit", "coding"], rows)
    note = fascia_note(result)
    return f"{text}\n{_fill(note)}" if note else text


def fascia_note(result: StudyResult) -> str:
    """Return a remark where the fascia's Poisson's ratio is negative, else nothing."""
    given = result.subject.tissues["fascia"]
    levels = _levels(result.definition.factors, "fascia.C10") or [
        result.definition.fixed.get("fascia.C10", given.C10 or 0.0)
    ]
    ratios = [Hyperelastic(level, given.D1).poisson_ratio for level in levels]
    if min(ratios) >= 0:
        return ""
    span = f"{min(ratios):.2f}" if len(ratios) == 1 else f"{max(ratios):.2f} to {min(ratios):.2f}"
    return (
        f"The fascia's Poisson's ratio is {span}: it follows from the C10 and the D1 of "
        f"{given.D1:g}/MPa that the paper gives, which make its bulk modulus the smaller one."
    )


def _levels(factors: Sequence[Factor], name: str) -> list[float]:
    return [
        value * UNITS[PARAMETERS[name]][f.unit]
        for f in factors
        if f.name == name
        for value in (f.low, f.high)
    ]


def _runs(result: StudyResult) -> str:
    total, failed = len(result.records), result.failed
    lines = [f"{total - len(failed)} of {total} runs reach {result.definition.depth:g} mm."]
    for number in failed:
        record = result.records[number - 1]
        lines.append(f"Run {number} stops at {record.reached:.2f} mm: {record.reason}.")
    for analysis in result.analyses:
        if analysis.surface.missing:
            runs = ", ".join(map(str, analysis.surface.missing))
            lines.append(
                f"{analysis.metric.label} is analysed without run {runs}: fewer degrees of "
                "freedom, and the coefficients are no longer independent of each other."
            )
    lines += [f"{metric.label} isn't analysed: {why}." for metric, why in result.not_analysed]
    soft = sum(record.contact_stiffness_factor < 1 for record in result.records)
    if soft:
        lines.append(f"{soft} runs needed a softer contact law to go on.")
    return "\n".join(map(_fill, lines))


def _counting(result: StudyResult) -> str:
    text = (
        "Units: N/mm2 for slopes, N/mm3 for curvatures, squared in the sums. Degrees of freedom: "
    )
    if result.counting == "coefficients":
        return _fill(
            text + "coefficients less 1, and runs less coefficients, as in the paper's Table 3 "
            "(15 and 17), not as in its text; --count factors gives the text's."
        )
    return _fill(
        text + "factors less 1, and runs less factors, as in the paper's text (p = 5: 4 and 28). "
        "Its Table 3 and statistics use the number of coefficients instead."
    )


def _information(result: StudyResult) -> str:
    found = result.information
    assert found is not None
    depth = result.definition.depth
    lines = [tables.information_table(result)]
    spread, vectors = found.directions(depth)
    lines.append("Eigenvectors of the information at full depth, best determined first:\n")
    for k, sd in enumerate(spread):
        parts = " ".join(
            f"{v:+.2f} ln {label_of(name)}"
            for v, name in zip(vectors[:, k], found.names, strict=True)
        )
        lines.append(f"- sd {sd:.2%}: {parts}" if sd < 100 else f"- not determined: {parts}")
    pair = [name for name in IDENTIFIED if name in found.names]
    for assumed in (name for name in found.names if name not in pair and len(pair) == 2):
        first, second = found.bias(depth, pair, assumed)
        lines.append(
            f"- assumed {label_of(assumed)} 10 % too high: deep C10 {0.1 * first:+.1%}, "
            f"deep C20 {0.1 * second:+.1%}"
        )
    point = ", ".join(
        f"{label_of(name)} {value:.4g}"
        for name, value in zip(found.names, found.nominal, strict=True)
    )
    instrument = result.subject.instrument
    lines.append("")
    lines.append(
        _fill(
            f"95 % half-widths relative to the value, the least that any unbiased estimate can "
            f"have, at {point} (MPa, mm), for one trial with one independent reading a mm, "
            f"{instrument.force_sd:.3g} N and {instrument.displacement_sd:.3g} mm (sd). A "
            "curve's model error isn't in them. 'Others within their ranges': what isn't deep C10 "
            "or C20 is known beforehand, its range above being a 95 % interval of its logarithm. "
            "Told: within 50 %."
        )
    )
    return "\n".join(lines)


def _fill(text: str) -> str:
    return textwrap.fill(text, WIDTH)
