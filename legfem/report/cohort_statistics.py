"""A cohort's numbers: the figure of all members, and the chapter of statistics on its page."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import legfem.report.page as web
from legfem.cohort.agreement import ICC_FORM
from legfem.cohort.members import Member, Members
from legfem.cohort.population_model import EXPONENT, LEVELS, PopulationFit
from legfem.cohort.rows import NORMAL, Measure, Row, cohort_model, measured
from legfem.cohort.statistics import LEVEL, POWER, Analysed, Pair, Repeated, Statistics, values_of
from legfem.common.documents import versions_of
from legfem.common.numbers import NOT_DETERMINED, between, is_determined, number, share, short_probability
from legfem.inverse.catalogue import called
from legfem.inverse.population import CohortParameter
from legfem.report.curves import Cell, Curves, Line, SortableTable, shown
from legfem.report.style import DATA_COLOUR, new_figure, styled
from legfem.report.words import LAW_NAMES, TOLD

STATISTICS = "Statistics"
"""A chapter."""
_MOST_POINTS = 400
"""Of a plot."""


GROUP_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6D1F", "#111111")
"""Okabe and Ito's, in an order in which neighbours differ."""


def colours_of(members: Sequence[Member]) -> dict[str, str]:
    """Colours of the groups, in the table's order; one for all where there are no groups."""
    groups = dict.fromkeys(one.group for one in members)
    return {group: GROUP_COLOURS[k % len(GROUP_COLOURS)] for k, group in enumerate(groups)}


@styled
def forest_figure(members: Sequence[Member], rows: Sequence[Row]) -> Figure:
    """Every parameter of all members, sorted, with 95 % intervals, coloured by group."""
    model, colours = cohort_model(rows), colours_of(members)
    group_of = {one.name: one.group for one in members}
    found = [(row, one.measures) for row, one in measured(rows, model)]
    names = list(dict.fromkeys(name for _, measures in found for name in measures))
    figure = new_figure(3.2 * max(len(names), 1), min(1.2 + 0.22 * len(found), 12.0))
    for axes, name in zip(np.atleast_1d(figure.subplots(1, max(len(names), 1))), names, strict=False):
        shown = sorted(((m[name], row) for row, m in found if name in m), key=lambda one: one[0].value)
        for place, (one, row) in enumerate(shown):
            colour = colours.get(group_of[row.member], DATA_COLOUR)
            if one.low is not None and one.high is not None:
                axes.plot([one.low, one.high], [place, place], color=colour, linewidth=1.2)
            axes.plot(one.value, place, "o", color=colour, markersize=4)
        axes.set_yticks(range(len(shown)), [row.name for _, row in shown] if len(shown) <= 40 else [""] * len(shown))
        axes.set_xlabel(f"{called(name)} ({shown[0][0].unit})")
    return figure


def chapter(found: Statistics) -> web.Chapter:
    """Return what the cohort's table permits, parameter by parameter, and what it doesn't."""
    blocks: list[web.Block] = []
    some = found.parameters
    if texts := [called(one.name) for one in some if one.logarithmic]:
        blocks.append(web.Prose(f"Logarithms of {' and '.join(texts)} were compared, so differences are relative (%)."))
    if repeated := [(one, each) for one in some for each in one.repeated]:
        blocks += [*_agreement(repeated), *agreement_curves(some)]
    if any(one.effects for one in some):
        blocks.append(_effects(some))
    if any(one.fitted for one in some):
        blocks.append(_variances(some))
    if needed := [one for one in some if one.needed]:
        caption = TOLD["next_study"].format(power=100 * POWER, level=100 * LEVEL)
        rows = [
            {"to find a difference of": called(one.name), **{f"{100 * size:.0f} %": f"{n}" for size, n in one.needed}}
            for one in needed
        ]
        blocks.append(web.WebTable.of(caption, rows))
    if found.not_done:
        blocks += [web.Prose("Not computed:"), web.Bullets(found.not_done)]
    return web.Chapter(STATISTICS, blocks or [web.Prose("There is nothing to compare.")])


def _difference(one: Analysed, value: float) -> str:
    return f"{'+' if value > 0 else ''}{_spread(one, value)}"


def _spread(one: Analysed, value: float) -> str:
    return share(math.expm1(value)) if one.logarithmic else f"{number(value)} {one.unit}"


def _sd(one: Analysed, sd: float, ends: tuple[float, float]) -> str:
    if not sd > 0 or not is_determined(sd, ends):
        return NOT_DETERMINED if sd > 0 else "none found"
    return f"{_spread(one, sd)} ({_spread(one, ends[0])} to {_spread(one, ends[1])})"


def _between(one: Analysed, ends: tuple[float, float]) -> str:
    return f"{_difference(one, ends[0])} to {_difference(one, ends[1])}"


def _agreement(repeated: Sequence[tuple[Analysed, Repeated]]) -> list[web.WebTable]:
    """Return how well repeated tests agree, and between which limits they differ."""
    rows = [
        {
            "what": f"{called(one.name)}, {each.by}s",
            "compared": str(each.agreement.targets),
            "tests each": str(each.agreement.levels),
            "ICC (95 %)": "{:.2f} ({:.2f} to {:.2f})".format(each.agreement.icc, *each.agreement.icc95),
            "SEM": _spread(one, each.agreement.sem),
            "part from the tests' own errors": _spread(one, each.own),
            "minimal detectable change": _spread(one, each.agreement.detectable),
        }
        for one, each in repeated
    ]
    caption = f"Agreement of repeated tests: {ICC_FORM}; {TOLD['agreement']}"
    differ = [
        {
            "what": f"{called(one.name)}, {each.by} {pair.levels[1]} minus {each.by} {pair.levels[0]}",
            "compared": str(len(pair.difference)),
            "bias (95 %)": f"{_difference(one, pair.limits.bias)} ({_between(one, pair.limits.bias95)})",
            "lower limit (95 %)": f"{_difference(one, pair.limits.low)} ({_between(one, pair.limits.low95)})",
            "upper limit (95 %)": f"{_difference(one, pair.limits.high)} ({_between(one, pair.limits.high95)})",
            "p, by own errors": "–" if math.isnan(pair.p_value) else short_probability(pair.p_value),
        }
        for one, each in repeated
        for pair in each.pairs
    ]
    limits = "Bland and Altman's limits of agreement, between which 95 % of differences lie; p by own errors alone"
    return [web.WebTable.of(caption, rows), web.WebTable.of(limits, differ)]


def agreement_curves(some: Sequence[Analysed]) -> list[Curves]:
    """Return Bland and Altman's plots: of the first two comparisons, each of its first two levels."""
    repeated = [(one, each) for one in some for each in one.repeated]
    first = [(one, each.by, pair) for one, each in repeated[:2] for pair in each.pairs[:1]]
    return [_plot(one, by, pair) for one, by, pair in first if len(pair.mean) <= _MOST_POINTS]


def _plot(one: Analysed, by: str, pair: Pair) -> Curves:
    order = np.argsort(pair.mean)
    x = np.exp(pair.mean[order]) if one.logarithmic else pair.mean[order]
    y = 100 * np.expm1(pair.difference[order]) if one.logarithmic else pair.difference[order]

    def level(value: float) -> np.ndarray:
        return np.full(len(x), 100 * math.expm1(value) if one.logarithmic else value)

    lines = [
        Line("difference", y, None, points=True),
        Line("bias", level(pair.limits.bias), None, colour="#0072B2"),
        Line("lower limit", level(pair.limits.low), None, colour="#D55E00", dash="dashed"),
        Line("upper limit", level(pair.limits.high), None, colour="#D55E00", dash="dashed"),
    ]
    unit = "%" if one.logarithmic else one.unit
    more = f": {by} {pair.levels[1]} minus {by} {pair.levels[0]} over their mean, leg by leg."
    name, mean, difference = f"agreement-{one.name}-{by}", f"mean ({one.unit})", f"difference ({unit})"
    return Curves(name, called(one.name), more, x, mean, difference, lines)


def _effects(some: Sequence[Analysed]) -> web.WebTable:
    rows = [
        {
            "what": f"{called(one.name)}: {effect.name}",
            "difference": _difference(one, effect.value),
            "95 % interval": _between(one, (effect.low, effect.high)),
            "p": short_probability(effect.p_value),
            "p, Holm": short_probability(effect.adjusted) if effect.of_group else "–",
        }
        for one in some
        for effect in one.effects
    ]
    return web.WebTable.of(TOLD["mixed_model"], rows)


def _variances(some: Sequence[Analysed]) -> web.WebTable:
    rows = []
    for one in some:
        if one.fitted is None:
            continue
        cells = [_sd(one, sd, ends) for sd, ends in zip(one.fitted.sd, one.fitted.sd95, strict=True)]
        rows.append([called(one.name), f"{one.count} of {one.people}", *cells, _spread(one, one.own)])
    header = ["what", "members, of people", "people", "legs of a person", "tests of a leg", "own error"]
    return web.WebTable(TOLD["deviations"], header, rows)


def population_chapter(found: Sequence[PopulationFit]) -> web.Chapter:
    """Return what people are like: a prior for new legs."""
    words = {"person": "people", "leg": "legs of a person", "visit": "visits", "test": "what is left"}
    levels = [level for level in LEVELS if any(level in one.draws.sd for one in found)]

    def drawn(values: np.ndarray, unit: str = "") -> str:
        low, middle, high = map(float, np.quantile(values, (0.025, 0.5, 0.975)))
        if not is_determined(middle, (low, high)):
            return NOT_DETERMINED
        return f"{number(middle, (high - low) / 4)}{unit} ({' to '.join(between(low, high))}{unit})"

    def relative(values: np.ndarray) -> str:
        return drawn(100 * np.expm1(values), " %")

    rows = []
    for one in found:
        low, middle, high = (math.exp(one.log_median + k * one.log_sd) for k in (-NORMAL, 0.0, NORMAL))
        sds = [relative(one.draws.sd[level]) if level in one.draws.sd else "" for level in levels]
        rows.append([called(one.key), f"{middle:.3g} kPa", f"{low:.3g} to {high:.3g} kPa", *sds])
    header = ["what", "median of people", "95 % of people", *(words.get(level, f"{level}s") for level in levels)]
    caption = "The population, and its standard deviations by source, without each test's own errors (95 %)"
    blocks: list[web.Block] = [web.Prose(TOLD["population"]), web.WebTable(caption, header, rows)]
    effects = [
        [f"{called(one.key)}: {name}", (drawn if name.endswith(EXPONENT) else relative)(values)]
        for one in found
        for name, values in zip(one.given.names, one.draws.effects.T, strict=True)
    ]
    if effects:
        blocks.append(web.WebTable("Differences, exponents of covariates and steps of rigs", ["what", "95 %"], effects))
    if doubtful := [called(one.key) for one in found if not one.converged]:
        blocks.append(web.Prose(f"The draws of {', '.join(doubtful)} have not settled: do not rely on them."))
    return web.Chapter("What people are like", blocks)


def ratio_of(right: Measure, left: Measure) -> tuple[float, float, float]:
    r"""Return by which share one exceeds another, and the ends of its 95 % interval; NaN where one isn't positive.

    Of two logarithms with 95 % intervals, :math:`r_0 < r < r_1` and :math:`l_0 < l < l_1`, whose errors are
    independent, the interval of the difference is

    .. math:: d - \sqrt{(r - r_0)^2 + (l_1 - l)^2} \quad \text{to} \quad d + \sqrt{(r_1 - r)^2 + (l - l_0)^2}

    with :math:`d = r - l` (Zou and Donner, Statistics in Medicine 27, 2008, 1693-1702).
    """
    ends = (end for of in (right, left) for end in (of.value, of.low, of.high))
    r, r0, r1, l, l0, l1 = (math.log(end) if end and end > 0 else math.nan for end in ends)  # noqa: E741
    ratios = r - l, r - l - math.hypot(r - r0, l1 - l), r - l + math.hypot(r1 - r, l - l0)
    return math.expm1(ratios[0]), math.expm1(ratios[1]), math.expm1(ratios[2])


def cells_of(one: Measure | None) -> list[Cell]:
    """Return a constant's value and its interval as a table shows them."""
    if one is None:
        return [None, None]
    shown = number(one.value, one.sd if one.sd is not None else float("nan"))
    if one.low is None or one.high is None:
        return [(one.value, shown), None]
    ends = " to ".join(between(one.low, one.high)) if is_determined(one.value, (one.low, one.high)) else NOT_DETERMINED
    return [(one.value, shown), (one.high - one.low, ends)]


def _text(one: Measure) -> str:
    value, ends = map(shown, cells_of(one))
    return f"{value} ({ends}) {one.unit}"


def _pairs(name: str, table: pd.DataFrame) -> Iterator[dict[str, str]]:
    """Yield both legs of each person at a visit."""
    visits = table.assign(visit=table["session"].fillna(table["date"]).fillna("–").astype(str))
    by = ["person", "visit"]
    for (person, visit), own in visits.drop_duplicates([*by, "side"]).groupby(by, sort=False):
        legs = dict(zip(own["side"], own["measure"], strict=True))
        if not {"left", "right"} <= legs.keys():
            continue
        exceeds, low, high = (100 * one for one in ratio_of(legs["right"], legs["left"]))
        said = "right is greater" if low > 0 else "left is greater" if high < 0 else "no difference beyond the errors"
        difference = f"{round(exceeds) + 0:+d} % ({number(low)} to {number(high)} %)"
        if not math.isfinite(low + high):
            difference = said = NOT_DETERMINED
        row = {"person": person, "visit": visit, "what": called(name)}
        row |= {f"{side} (95 %)": _text(legs[side]) for side in ("left", "right")}
        yield row | {"right against left (95 %)": difference, "in words": said}


def _among(name: str, norm: CohortParameter, table: pd.DataFrame) -> list[web.Block]:
    """Return where tests stand among people of their age, in words and over the band; nothing where no age is known."""
    said = []
    for test in table.to_dict("records"):
        median, sd = norm.at(test["age"] or math.nan)
        if math.isfinite(median) and test["value"] > 0:
            z = math.log(test["value"] / median) / sd
            of = f"{test['row']}: {_text(test['measure'])} at {test['age']:g} years, more than in"
            below = f"{share(min(max(NormalDist().cdf(z), 0.01), 0.99))} of people of this age (median"
            where = f"{'outside' if abs(z) > NORMAL else 'within'} what 95 of 100 of them have"
            said.append(f"{of} {below} {number(median)}), {where}.")
    if norm.log_ages is None or not said:
        return []
    ages = np.sort([*np.exp(np.linspace(*norm.log_ages[2:], 40)[1:-1]), *table["age"].dropna()])
    medians, sds = np.array([norm.at(float(age)) for age in ages]).T
    names = {"median": 0.0, "2.5 % have less": -NORMAL, "2.5 % have more": NORMAL}
    lines = [Line(text, medians * np.exp(k * sds), None, dash="dashed" if k else "solid") for text, k in names.items()]
    own = np.array([table["value"][table["age"] == age].mean() for age in ages])
    lines.append(Line("members", own, None, GROUP_COLOURS[1], points=True))
    more = f": members, and what 95 of 100 people of an age have, by {norm.source}."
    axes = "age (years)", f"{called(name)} (kPa)"
    return [web.Bullets(said), Curves(f"age-{name}", called(name), more, ages, *axes, lines)]


_MOST_PAIRS = 200
"""That are printed whole; of more those in view are drawn."""


def side_chapters(members: Members, rows: Sequence[Row], population: Sequence[PopulationFit]) -> Iterator[web.Chapter]:
    """Yield chapters on legs whose model fits: left beside right, to be signed, and each among people of its age."""
    kept = [row for row in rows if row.judged.tone != "wrong"]
    model = cohort_model(kept)
    names = dict.fromkeys(name for _, one in measured(kept, model) for name in one.measures)
    tables = {name: values_of(members.every, kept, name)[0] for name in names}
    if pairs := [pair for name, table in tables.items() for pair in _pairs(name, table)]:
        caption = "Both legs at one visit; legs whose model does not fit are left out"
        signed = web.WebTable("Checked by", ["name", "date", "signature"], [["_" * 15] * 3])
        table: web.Block = web.WebTable.of(caption, pairs)
        if len(pairs) > _MOST_PAIRS:
            table = SortableTable("sides", caption, list(pairs[0]), [list(pair.values()) for pair in pairs])
        yield web.Chapter("Left beside right", [table, signed])
    own = {one.key: CohortParameter(**one.document(len(one.tests), model, "these people")) for one in population}
    for name, norm in {**own, **members.norms}.items():
        other = f"population.json is of another law ({LAW_NAMES.get(norm.law, norm.law)}): nothing is compared with it."
        if blocks := [web.Prose(other)] if norm.law != model else _among(name, norm, tables.get(name, pd.DataFrame())):
            yield web.Chapter(f"{called(name)} by age", blocks)


def readings_page(path: Path, found: Statistics, command: str) -> web.WebPage:
    """Return the page of a plain table of readings, and of the command that was given."""
    said = [
        f"Between {each.by}s, {called(one.name)} has an ICC of {each.agreement.icc:.2f}, and only differences above "
        f"{_spread(one, each.agreement.detectable)} exceed the errors of two readings."
        for one in found.parameters
        for each in one.repeated
    ]
    answers = [("Readings", f"{one.count}, of {one.people} members.") for one in found.parameters[:1]]
    sentence = " ".join(said) or "No agreement could be computed; the page says why."
    return web.WebPage(
        f"Agreement of readings: {path.name}",
        f"legfem cohort, {path}",
        "measured",
        web.Headline("open", sentence, answers, "Agreement of readings"),
        [],
        (),
        [chapter(found)],
        web.Repeat(command, versions_of("legfem", "numpy", "scipy", "python")),
    )
