"""A cohort on one page: which results can be used, what was found of all, what is odd, and how it was done."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import legfem.report.page as web
from legfem.cohort.anomalies import Suspicion, listed, missing, suspicions
from legfem.cohort.members import Member, Members
from legfem.cohort.population_model import PopulationFit
from legfem.cohort.rows import ModelResult, Row, cohort_model, measured
from legfem.cohort.statistics import Statistics, statistics
from legfem.common.documents import versions_of
from legfem.common.numbers import short_probability
from legfem.inverse.answer import Tone
from legfem.inverse.catalogue import called
from legfem.inverse.claims import check
from legfem.report import cohort_statistics
from legfem.report.answers import kind_of_notice, span_of
from legfem.report.curves import Bundle, Cell, Forest, ForestMetric, Grouped, SortableTable
from legfem.report.render import plain_page, rendered
from legfem.report.words import BEYOND_A_FIT, LAW_NAMES, TOLD, WORDS, DataKind, capital
from legfem.stockings.levels import WAYS, fewest

type Found = Mapping[str, ModelResult]
"""Members' results, by their names."""
type Judgements = Mapping[str, Sequence[str]]
"""How each tone is called: as a cell, of one member and of several."""


def methods(members: Members, rows: Sequence[Row], task: str, model: str) -> list[str]:
    """Return paragraphs on what was done, with settings and versions.

    Parameters
    ----------
    members
        Who is in the cohort.
    rows
        What was found of each.
    task
        What was done.
    model
        Under which members are compared.
    """
    done = [row for row in rows if row.done]
    used: dict[str, set[str]] = {}
    for row in done:
        for name, version in row.versions.items():
            used.setdefault(name, set()).add(version)
    versions = {name: " and ".join(sorted(each)) for name, each in used.items()} or versions_of("legfem", "dolfinx")
    what = f"{_size(rows)} of {_people(members.every)}"
    stands = ", ".join(f"{name} {version}" for name, version in versions.items() if name != "legfem")
    first = WORDS["done"][task].format(what=what, legfem=versions.get("legfem", "unknown")) + f" ({stands})."
    texts = [first + (f" Results are compared under one law ({LAW_NAMES.get(model, model)})." if model else "")]
    settings = [row.settings for row in done if row.settings]
    if settings:
        names = WORDS["settings"].items()
        shown = ((words, _shown([one[key] for one in settings if key in one])) for key, words in names)
        texts.append(f"Settings: {'; '.join(f'{words}: {one}' for words, one in shown if one)}.")
    if len(rows) > len(done):
        texts.append(f"{len(rows) - len(done)} of {_size(rows)} gave no result and are left out of all else.")
    return texts


def _shown(values: Sequence[Any]) -> str:
    """One value, or from where to where they go."""
    flat = [one for value in values for one in (value if isinstance(value, list) else [value])]
    if not flat:
        return ""
    if all(isinstance(one, int | float) for one in flat):
        low, high = min(flat), max(flat)
        return f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return " or ".join(text for text, _ in Counter(map(str, flat)).most_common(3))


ODD = "Unusual findings, and what is missing"
"""A chapter."""
PAGE, TEXT = "cohort.html", "cohort.txt"
_MOST_KINDS = 12
"""Kinds of warnings that have a column of their own."""
_STATIONS = 25
"""Of a curve that is drawn."""


def _size(rows: Sequence[Row]) -> str:
    return f"{len(rows)} member{'s' * (len(rows) != 1)}"


def _people(members: Sequence[Member]) -> str:
    count = len({one.person for one in members})
    return f"{count} {'person' if count == 1 else 'people'}"


def cohort_web_page(
    members: Members, rows: Sequence[Row], task: str, command: str = "", population: Sequence[PopulationFit] = ()
) -> web.WebPage:
    """Return the page of a cohort.

    Parameters
    ----------
    members
        Who is in it.
    rows
        What was found of each.
    task
        What was done.
    command
        That was given.
    population
        What people are like, where that was fitted.
    """
    every, model = members.every, cohort_model(rows)
    odd = suspicions(every, rows)
    found, numbers = {row.name: one for row, one in measured(rows, model)}, statistics(every, rows)
    _check(found, numbers)
    judged = WORDS["judged"] | (WORDS["judged_by_fit"] if task == "identify" else {})
    chapters = [
        web.Chapter("Which results can be used", _believed(every, rows, task, judged)),
        web.Chapter("What was found", _numbers(every, rows, model, found)),
        *_fabrics(rows),
        *cohort_statistics.side_chapters(members, rows, population),
        *([web.Chapter("Curves of all", [bundle])] if (bundle := _bundle(every, rows, found)) else []),
        cohort_statistics.chapter(numbers),
        *([cohort_statistics.population_chapter(population)] if population else []),
        web.Chapter(
            ODD,
            [
                web.Prose(TOLD["looked_for"]),
                web.Bullets([one.sentence for one in odd]) if odd else web.Prose("Nothing was found."),
                *([web.Bullets(lacking)] if (lacking := missing(every, rows)) else []),
            ],
        ),
        web.Chapter("Methods", [web.Prose(text) for text in methods(members, rows, task, model)]),
    ]
    origins = Counter(row.origin for row in rows if row.done)
    several = ", ".join(f"{count} {name}" for name, count in origins.items())
    kinds = [DataKind("no data that could be used"), None, DataKind(f"data of several kinds: {several}")]
    return web.WebPage(
        f"Cohort {members.folder.resolve().name}: {_size(rows)}",
        f"legfem {task}, {_size(rows)}, {members.folder}",
        # The least that can be said of where the data come from.
        next((name for name in ("simulated", "reconstructed", "measured") if origins[name]), "measured"),
        _headline(every, rows, odd, model, judged, found),
        [one.sentence for one in odd if len(one.members) != 1] + list(members.notes),
        (),
        chapters,
        web.Repeat(command, versions_of("legfem", "dolfinx", "numpy", "scipy", "python")),
        data=kinds[min(len(origins), 2)],
    )


def _check(found: Found, numbers: Statistics) -> None:
    """Check all that is claimed of a cohort; raises ContradictionError."""
    for member, one in found.items():
        for name, known in one.measures.items():
            if known.low is not None and known.high is not None:
                check(f"{called(name)} of {member}", (known.value, (known.low, known.high)))
    for each in numbers.parameters:
        for effect in each.effects:
            check(f"{called(each.name)}, {effect.name}", (effect.value, (effect.low, effect.high)))


def write_cohort_page(page: web.WebPage, folder: Path) -> Path:
    """Write cohort.html and cohort.txt; return the latter's path."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / PAGE).write_text(rendered(page), encoding="utf-8")
    (folder / TEXT).write_text(plain_page(page, []), encoding="utf-8")
    return folder / TEXT


def _answer(members: Sequence[Member], rows: Sequence[Row], found: Found) -> str:
    """What members have in the median and from the least to the greatest, by group; empty without a number."""
    trusted = [row for row in rows if row.name in found and row.judged.tone != "wrong"]
    names = list(dict.fromkeys(name for row in trusted for name in found[row.name].measures))
    if not names:
        return ""
    name, group = names[0], {one.name: one.group for one in members}
    values: dict[str, list[float]] = {}
    unit = ""
    for row in trusted:
        if (one := found[row.name].measures.get(name)) is not None:
            values.setdefault(group[row.member], []).append(one.value)
            unit = one.unit
    every = [value for own in values.values() for value in own]
    text = f"{capital(called(name))}: {np.median(every):.2g} {unit}"
    text += f" in the median of {len(every)} members ({min(every):.2g} to {max(every):.2g})" if len(every) > 1 else ""
    if len(values) > 1:
        each = (f"{np.median(own):.2g} of {who or 'members without a group'}" for who, own in sorted(values.items()))
        text += f", {' and '.join(each)}" if len(values) == 2 else f", {', '.join(each)}"
    return f"{text}. "


def _headline(
    members: Sequence[Member],
    rows: Sequence[Row],
    odd: Sequence[Suspicion],
    model: str,
    judged: Judgements,
    found: Found,
) -> web.Headline:
    counts = Counter(row.judged.tone for row in rows)
    said = ", ".join(
        f"{f'{counts[tone]} ' * (len(rows) > 1)}{several if counts[tone] > 1 else one}"
        for tone, (_, one, several) in reversed(list(judged.items()))
        if counts[tone]
    )
    good = counts["sound"] + counts["caution"]
    tone: Tone = "sound" if counts["sound"] == len(rows) and not odd else "caution" if good else "wrong"
    failed = [row.name for row in rows if not row.done]
    answers = [
        ("Members", f"{len(rows)}, of {_people(members)}."),
        ("Members without a result", listed(failed) if failed else "None."),
        ("Unusual findings", f"{len(odd)} to look into; they are listed below." if odd else "None."),
        *([("Law used for the comparison", f"The {LAW_NAMES.get(model, model)} law.")] if model else []),
    ]
    of = f"Of {len(rows)} members," if len(rows) > 1 else "The only member"
    sentence = f"{_answer(members, rows, found)}{of} {said}."
    return web.Headline(tone, sentence, answers, f"{good} of {len(rows)} can be used")


def _believed(members: Sequence[Member], rows: Sequence[Row], task: str, judged: Judgements) -> list[web.Block]:
    """A matrix of verdicts and warnings, the gravest first."""
    kinds = {row.name: set(map(kind_of_notice, row.judged.notices)) for row in rows}
    counts = Counter(kind for found in kinds.values() for kind in found)
    named = [kind for kind, _ in counts.most_common(_MOST_KINDS)]
    letters = {kind: chr(ord("A") + k) for k, kind in enumerate(named)}
    group, ranks = {one.name: one.group for one in members}, list(judged)
    verdict = ["verdict"] if any(row.verdict for row in rows) else []

    def line(row: Row) -> list[Cell]:
        warned, tone = kinds[row.name], row.judged.tone
        others = len(warned - set(named))
        marks: list[Cell] = ["●" if kind in warned else "" for kind in named]
        first: list[Cell] = [row.name, group[row.member], (float(ranks.index(tone)), judged[tone][0])]
        first += [row.verdict] if verdict else []
        return [*first, *marks, float(others) if others else "", row.problem or row.judged.sentence]

    ordered = sorted(rows, key=lambda row: ranks.index(row.judged.tone))
    header = ["member", "group", "judgement", *verdict, *letters.values(), "others", "why"]
    legend = [f"{letters[kind]}: {kind} ({counts[kind]})" for kind in named]
    beyond = f" {BEYOND_A_FIT}" if task == "identify" and any(row.judged.tone == "sound" for row in rows) else ""
    return [
        web.Prose(TOLD["judgement"].format(sound=judged["sound"][0], beyond=beyond)),
        SortableTable(
            "believed",
            "Judgements and warnings, the most serious first; a dot marks a warning of the kind listed below.",
            header,
            [line(row) for row in ordered],
            [row.report for row in ordered],
        ),
        *([web.Bullets(legend)] if legend else []),
    ]


def _numbers(members: Sequence[Member], rows: Sequence[Row], model: str, found: Found) -> list[web.Block]:
    known = {one.name: one for one in members}
    names = list(dict.fromkeys(name for one in found.values() for name in one.measures))
    units = {name: next(one.measures[name].unit for one in found.values() if name in one.measures) for name in names}
    given = list(dict.fromkeys(name for one in members for name in one.given))
    thick = any(row.shape.fat_mm is not None for row in rows)
    header = ["member", *given]
    for name in names:
        header += [f"{called(name)} ({units[name]})", "95 % interval"]
    header += ["fit p", *(["fat (mm)", "girth (mm)"] if thick else []), "time (s)"]

    def line(row: Row) -> list[Cell]:
        one, person = found.get(row.name, ModelResult({})), known[row.member]
        cells: list[Cell] = [row.name, *(person.given.get(name) for name in given)]
        for name in names:
            cells += cohort_statistics.cells_of(one.measures.get(name))
        cells.append(None if one.p_value is None else (one.p_value, short_probability(one.p_value)))
        cells += [row.shape.fat_mm, row.shape.girth_mm] if thick else []
        return [*cells, row.seconds or None]

    blocks: list[web.Block] = [_forest(members, rows, found, units)] if names else []
    if model:
        others = [row.name for row in rows if row.done and row.judged.preferred != model]
        name = LAW_NAMES.get(model, model)
        text = f"Members are compared under one law ({name}), the one that most of them need."
        if len({key for row in rows for key in row.models}) == 1:
            text = f"All members were fitted with one law ({name})."
        elif others:
            text += f" {len(others)} need another: {listed(others)}. The table in cohort.csv has both."
        blocks.append(web.Prose(text))
    caption = "All members; click a column to sort, a member for its own report."
    table = SortableTable("numbers", caption, header, list(map(line, rows)), [row.report for row in rows])
    return [*blocks, table]


def _fabrics(rows: Sequence[Row]) -> Iterator[web.Chapter]:
    """Yield which fabric meets each class on each leg in a stocking, and the fewest that serve all."""
    spans: dict[str, dict[str, tuple[float, float]]] = {}
    for leg, one in ((row.name, one) for row in rows for one in row.fabrics):
        for name, (word, unit) in WAYS.items():
            of = f"class {one.compression_class} ({span_of(one.limits_mmHg)} mmHg), {word} ({unit})"
            spans.setdefault(of, {})[leg] = getattr(one, name)
    if spans:
        lines = [[row.name, *(span_of(by.get(row.name)) for by in spans.values())] for row in rows if row.fabrics]
        fewer = [
            f"{name}: " + ", ".join(f"{at:.3g} (on {legs} of {len(by)})" for at, legs in fewest([*by.values()]))
            for name, by in spans.items()
        ]
        table = SortableTable("fabrics", _FABRICS, ["member", *spans], lines)
        yield web.Chapter("Which fabric meets a class", [table, web.Prose(_FEWEST), web.Bullets(fewer)])


_FABRICS = "Fabric under which the mean pressure at B is within a class, if the rest of it is as each folder states"
_FEWEST = "The fewest fabrics of which one meets the class on each leg:"


def _grouped(members: Sequence[Member], rows: Sequence[Row]) -> Grouped:
    """Return the members of rows, by group."""
    colours = cohort_statistics.colours_of(members)
    places = {name: k for k, name in enumerate(colours)}
    group = {one.name: one.group for one in members}
    shown = [(name or ("no group" if len(colours) > 1 else "all"), colour) for name, colour in colours.items()]
    return Grouped([row.name for row in rows], shown, [places[group[row.member]] for row in rows])


def _forest(members: Sequence[Member], rows: Sequence[Row], found: Found, units: Mapping[str, str]) -> Forest:
    def digits(value: float | None) -> float | None:
        return None if value is None else float(f"{value:.5g}")

    def metric(name: str, unit: str) -> ForestMetric:
        each = [found[row.name].measures.get(name) if row.name in found else None for row in rows]
        ends = [(None, None, None) if one is None else (one.value, one.low, one.high) for one in each]
        return ForestMetric(called(name), unit, *([digits(one[k]) for one in ends] for k in range(3)))

    caption = "Values of all members with their 95 % intervals, smallest first, coloured by group."
    return Forest(caption, _grouped(members, rows), list(map(metric, units, units.values())))


def _bundle(members: Sequence[Member], rows: Sequence[Row], found: Found) -> Bundle | None:
    drawn = [(row, one) for row in rows if row.name in found and (one := found[row.name].curve) is not None]
    if not drawn:
        return None
    x = np.linspace(0.0, max(one.displacement_mm[-1] for _, one in drawn), _STATIONS)
    values = []
    for _, one in drawn:
        force = np.array([np.nan if value is None else value for value in one.measured_N])
        values.append(np.interp(x, one.displacement_mm, force, left=np.nan, right=np.nan))
    caption = "Measured force of all members over displacement from first contact, coloured by group."
    shown = _grouped(members, [row for row, _ in drawn])
    return Bundle(caption, shown, x, "displacement (mm)", "force (N)", np.array(values))
