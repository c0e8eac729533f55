"""Identification results as text, in the manner of lmfit's ``fit_report``."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence

from scipy.stats import chi2

from legfem.common.doubts import doubt_lines
from legfem.common.units import readable_unit
from legfem.identify.catalogue import DEEP_C10, DEEP_C20, symbol_of, unit_of
from legfem.identify.result import Estimate, IdentificationResult
from legfem.inference.parameter import Parameter
from legfem.report.correction_text import correction_lines
from legfem.report.style import LAW_NAMES

ORIGINS = {
    "measured": "measured data",
    "reconstructed": "reconstructed data (made to resemble a published study; no leg was measured)",
    "simulated": "simulated data (forces computed by a model; no leg was measured)",
}
ENERGIES = {
    "neo-hookean": "U = C10 (I1 - 3) + (J - 1)^2 / D1",
    "reduced-polynomial": ("U = C10 (I1 - 3) + C20 (I1 - 3)^2 + (J - 1)^2 / D1 + (J - 1)^4 / D2"),
    "yeoh": "U = C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3 + (J - 1)^2 / D1",
    "exponential": "U = C10 (I1 - 3) + A / b (exp(b (I1 - 3)) - 1 - b (I1 - 3)) + (J - 1)^2 / D1",
}
WIDTH = 100
# Parameters that stand side by side within the width.
_COLUMNS = 2
# Below this, chance doesn't explain what was left unexplained.
_SIGNIFICANT = 0.01


def fit_report(result: IdentificationResult) -> str:
    """Return all of one result that a person wants to read; stresses in kPa."""
    sections: dict[str, Iterable[str]] = {
        "Model": _model(result),
        "Fit Statistics": _statistics(result),
        "Variables": variables(result.parameters),
    }
    if len(result.parameters) > 1:
        sections["Correlations"] = _correlations(result)
    sections["Assumed"] = _assumed(result)
    sections["Warnings"] = result.warnings or ["none"]
    lines = [
        f"DATA: {ORIGINS.get(result.subject_origin, result.subject_origin)}",
        *doubt_lines(result.doubts),
    ]
    for name, body in sections.items():
        lines += [f"[[{name}]]", *(f"    {line}" for line in body)]
    return wrapped(lines)


def summary(results: Sequence[IdentificationResult]) -> str:
    """Return a few lines for the terminal: both laws, and which fits better by how much.

    Parameters
    ----------
    results
        One a law, of one subject.
    """
    first = results[0]
    names = list(dict.fromkeys(name for result in results for name in result.parameters))
    if set(names) <= {DEEP_C10, DEEP_C20}:
        names = [DEEP_C10, DEEP_C20]
    lines = [
        f"Subject {first.subject_id} ({first.subject_title})",
        f"DATA: {ORIGINS.get(first.subject_origin, first.subject_origin)}",
        *doubt_lines(dict.fromkeys(doubt for result in results for doubt in result.doubts)),
        "",
        *(_table(results, names) if len(names) <= _COLUMNS else _list(results)),
    ]
    lines += ["  (brackets: 95 % confidence intervals)", ""]
    lines += [f"  {line}" for line in comparison(results)]
    for result in results:
        for name, found in result.parameters.items():
            if found.identifiability != "identifiable":
                lines.append(
                    f"  {symbol_of(name)} of the {LAW_NAMES[result.law]} law is "
                    f"{found.identifiability}: {found.why}."
                )
    lines += [f"  Warning: {warning}" for warning in _distinct(results)]
    return wrapped(lines)


def _table(results: Sequence[IdentificationResult], names: Sequence[str]) -> list[str]:
    """Return a row a law, a column a parameter."""
    heads = [f"{symbol_of(name)} ({readable_unit(unit_of(name))[0]})" for name in names]
    lines = [
        f"  {'deep tissue':<18} {''.join(f'{head:<22}' for head in heads)}"
        f"{'cost (N2)':>9} {'rms (N)':>8} {'solves':>6} {'time (s)':>8}"
    ]
    for result in results:
        cells = "".join(f"{_short(result.parameters.get(name)):<22}" for name in names)
        lines.append(
            f"  {LAW_NAMES[result.law]:<18} {cells}"
            f"{result.cost.value:>9.3g} {result.cost.rms:>8.3g} "
            f"{result.forward_solves:>6d} {result.wall_s:>8.1f}"
        )
    return lines


def _list(results: Sequence[IdentificationResult]) -> list[str]:
    """Return a paragraph a law, a line a parameter."""
    lines = []
    for result in results:
        lines.append(
            f"  {LAW_NAMES[result.law]}: cost {result.cost.value:.3g} N2, rms "
            f"{result.cost.rms:.3g} N, {result.forward_solves} solves, {result.wall_s:.1f} s"
        )
        lines += [
            f"    {name:<26} {_short(found)} {found.shown.unit}"
            for name, found in result.parameters.items()
        ]
    return lines


def comparison(results: Sequence[IdentificationResult]) -> list[str]:
    """Return sentences on how well each law fits, and which is better by how much."""
    lines = [_goodness(result) for result in results]
    if len(results) < 2:
        return lines
    better, worse = sorted(results, key=lambda result: result.cost.value)[:2]
    if better.neo_hookean_limit or worse.cost.value <= better.cost.value * (1 + 1e-9):
        return [
            *lines,
            "Both laws fit alike: the best reduced polynomial is neo-Hookean (C20 = 0).",
        ]
    ratio = _number(worse.cost.value / max(better.cost.value, 1e-300))
    costs = (
        f"cost is {ratio} times smaller ({better.cost.value:.3g} against "
        f"{worse.cost.value:.3g} N2, rms {better.cost.rms:.3g} against {worse.cost.rms:.3g} N)"
    )
    name = LAW_NAMES[better.law]
    if len(better.parameters) <= len(worse.parameters):
        return [*lines, f"The {name} law fits better: its {costs}."]
    gain, chance = _gain(better, worse)
    if chance < _SIGNIFICANT:
        return [
            *lines,
            f"The {name} law fits better: its {costs}.",
            "The data ask for its further parameter: chi-square falls by "
            f"{_number(gain)} ({probability(chance)}).",
        ]
    return [
        *lines,
        f"The {name} law's {costs}, but the data do not ask for its further parameter: chi-square "
        f"changes by {-gain:+.2g} ({probability(chance)}), no more than noise would give.",
    ]


def preferred(results: Sequence[IdentificationResult]) -> IdentificationResult:
    """Return the law that the data ask for: the better fit, unless chance explains that it is."""
    better, *others = sorted(results, key=lambda result: result.cost.value)
    if not others:
        return better
    fewer = len(better.parameters) > len(others[0].parameters)
    by_chance = fewer and _gain(better, others[0])[1] >= _SIGNIFICANT
    return others[0] if by_chance or better.neo_hookean_limit else better


def _gain(better: IdentificationResult, worse: IdentificationResult) -> tuple[float, float]:
    """Return by how much chi-square falls with further parameters, and the chance of that."""
    gain = worse.cost.chi_square - better.cost.chi_square
    extra = len(better.parameters) - len(worse.parameters)
    return gain, float(chi2.sf(gain, extra)) if gain > 0 else 1.0


def fits(result: IdentificationResult) -> bool:
    """Return whether a law describes the recordings within the noise."""
    return not result.cost.p_value < _SIGNIFICANT


def _model(result: IdentificationResult) -> list[str]:
    measured = result.measured
    return [
        f"subject            {result.subject_title}",
        f"deep tissue        {LAW_NAMES[result.law]}: {ENERGIES[result.law]}",
        f"recordings         {measured.n_trials} trial{'s' * (measured.n_trials > 1)}, loading to "
        f"{measured.displacement[-1]:.2f} mm after first contact",
        f"noise of a reading {measured.noise.force_sd:.3g} N (from {measured.noise.source}), "
        f"correlated over {measured.noise.correlation_length:.2g} mm",
        *correction_lines(result),
        f"weighting          {_WEIGHTINGS[result.weighting]}",
    ]


_WEIGHTINGS = {
    "paper": "none: every point of the curve counts alike, as in the paper",
    "covariance": "by the inverse of the curve's covariance",
}


def _statistics(result: IdentificationResult) -> list[str]:
    cost, solves = result.cost, result.search.solves
    failed = sum(not solve.complete for solve in solves)
    grid = result.measured.displacement
    rows = [
        ("data points", f"{cost.points}, every {grid[1] - grid[0]:.3g} mm to {grid[-1]:.4g} mm"),
        ("variables", f"{len(result.parameters)}"),
        ("cost E", f"{cost.value:.6g} N2"),
        ("  E per length", f"{cost.per_length:.6g} (N/mm)2"),
        ("  mean of squares", f"{cost.mean_square:.6g} N2"),
        ("  definition", cost.definition),
        ("minimised", f"{cost.minimised}; {cost.minimised_value:.6g} at the optimum"),
        ("rms difference", f"{cost.rms:.4g} N"),
        ("R-squared", f"{cost.r_squared:.6f}"),
        (
            "chi-square",
            f"{cost.chi_square:.5g} on {cost.degrees_of_freedom} degrees of freedom; "
            f"{probability(cost.p_value)}",
        ),
        (
            "full forward solves",
            f"{result.forward_solves} ({failed} failed, {result.reused_solves} from an earlier "
            f"run), {result.factorisations} factorisations",
        ),
        ("emulator's error", _emulator_error(result.emulator_error)),
        ("wall time", f"{result.wall_s:.1f} s"),
        ("converged", f"{'yes' if result.converged else 'NO'} (seed {result.seed})"),
    ]
    return [f"{name:<20} = {value}" for name, value in rows]


def variables(parameters: Mapping[str, Estimate]) -> list[str]:
    """Return two lines a parameter: value and interval, and how well it is known."""
    lines = []
    for name, found in parameters.items():
        bound = f", at the search's {found.at_bound} bound" if found.at_bound else ""
        term, _, symbol = name.rpartition(".")
        role = ", nuisance" if found.parameter.role == "nuisance" else ""
        shown = found.shown
        low, high = shown.ci95
        lines += [
            f"{symbol} ({term}{role}): {shown.value:.6g} +/- {shown.standard_error:.3g} "
            f"{shown.unit} ({_percent(found)})   "
            f"95 % interval {low:.5g} to {high:.5g} {shown.unit}{bound}",
            f"    {found.identifiability}: {found.why}",
        ]
    return lines


def _correlations(result: IdentificationResult) -> list[str]:
    names = list(result.parameters)
    pairs = [(one, other) for k, one in enumerate(names) for other in names[k + 1 :]]
    return [
        f"C({symbol_of(one)}, {symbol_of(other)}) = " + _correlation(result.correlation(one, other))
        for one, other in pairs
    ]


def _assumed(result: IdentificationResult) -> list[str]:
    """Return what was known beforehand: priors, and what was held."""
    lines = []
    for name, found in result.parameters.items():
        if found.parameter.prior is not None:
            lines.append(f"{name:<19}{prior_text(found.parameter)}")
    for name, value in result.assumed.items():
        unit, factor = readable_unit(unit_of(name))
        lines.append(f"{name:<19}{factor * value:.4g} {unit}, held")
    return lines


def prior_text(parameter: Parameter) -> str:
    """Return a parameter's prior in words, in the unit in which people read it."""
    prior = parameter.prior
    assert prior is not None
    unit, factor = readable_unit(parameter.unit)
    if prior.scale == "log":
        width = f"x/ {math.exp(prior.sd):.4g} {unit} (its logarithm is normal)"
    else:
        width = f"± {factor * prior.sd:.4g} {unit} (normal)"
    source = f", from {prior.source}" if prior.source else ""
    return f"prior {factor * prior.centre:.4g} {width}{source}"


def _goodness(result: IdentificationResult) -> str:
    name, chance = LAW_NAMES[result.law], result.cost.p_value
    if math.isnan(chance):
        return f"The {name} law fits with rms {result.cost.rms:.3g} N."
    if not fits(result):
        return (
            f"The {name} law does not fit within the noise ({probability(chance)}): "
            "physics that it leaves out shows."
        )
    return f"The {name} law fits within the noise ({probability(chance)})."


def wrapped(lines: Iterable[str]) -> str:
    """Return lines broken at the page's width, further ones indented under the first."""
    broken: list[str] = []
    for line in lines:
        indent = " " * (len(line) - len(line.lstrip()) + 4)
        broken += textwrap.wrap(
            line, WIDTH, subsequent_indent=indent, replace_whitespace=False,
            drop_whitespace=True, break_on_hyphens=False,
        ) or [""]  # fmt: skip
    return "\n".join(broken) + "\n"


def _number(value: float) -> str:
    """Return three digits without an exponent, where it stays readable."""
    rounded = float(f"{value:.3g}")
    return f"{rounded:,.0f}" if 1000 <= rounded < 1e7 else f"{rounded:g}"


def _short(found: Estimate | None) -> str:
    if found is None:
        return "-"
    shown = found.shown
    return f"{shown.value:.3f} [{shown.ci95[0]:.3f}, {shown.ci95[1]:.3f}]"


def _correlation(value: float) -> str:
    return "not known" if math.isnan(value) else f"{value:+.4f}"


def _percent(found: Estimate) -> str:
    if found.value <= 0:
        return "- %"
    return f"{100 * found.standard_error / found.value:.2f} %"


def probability(chance: float) -> str:
    """Return a probability in words."""
    if math.isnan(chance):
        return "p unknown"
    return "p < 0.0001" if chance < 1e-4 else f"p = {chance:.2g}"


def _emulator_error(error: float) -> str:
    if math.isnan(error):
        return "no emulator"
    return f"{error:.3g} N at most, against the last full solve"


def _distinct(results: Sequence[IdentificationResult]) -> list[str]:
    return list(dict.fromkeys(warning for result in results for warning in result.warnings))
