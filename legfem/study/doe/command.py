"""``legfem study doe``: simulates every definition and writes a folder each, with its page."""

import json
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from legfem.common.documents import json_types, write_atomically, write_document
from legfem.common.progress import progress_on
from legfem.inverse.outcome import Outcome
from legfem.jobs.pool import Workers, leading
from legfem.jobs.store import Store
from legfem.legs.loading import load_subject
from legfem.legs.subject import Subject
from legfem.report import page as web
from legfem.report.curves import Curves, Line
from legfem.report.folder import REPORT, RESULT, ReportFile
from legfem.report.plan import errors_of_readings
from legfem.report.render import write_page
from legfem.report.style import DATA_COLOUR, FAINT
from legfem.report.words import NOT_TESTED, TOLD, DataKind
from legfem.study.doe import tables
from legfem.study.doe.design import Definition, in_words, read_definition
from legfem.study.doe.figures import draw_response
from legfem.study.doe.runs import Outlook, PlaneStrainSimulator, Workshop, as_csv
from legfem.study.doe.study import StudyResult, simulations_of, study
from legfem.study.doe.surface import term_label


@dataclass(frozen=True)
class DoeOptions:
    """What a user chose."""

    definitions: tuple[Path, ...]
    subject: Path
    """Its folder."""
    out: Path
    jobs: int
    seed: int
    beyond: bool
    quiet: bool = False

    def folder_of(self, definition: Definition) -> Path:
        """Folder for one study's results."""
        return self.out if len(self.definitions) == 1 else self.out / definition.source.stem


def run(options: DoeOptions, comm: Any, simulator: PlaneStrainSimulator | None = None) -> list[StudyResult]:
    """Study every definition and write a folder each; under MPI only the first rank writes.

    Parameters
    ----------
    comm
        Communicator over whose ranks the simulations are spread.
    simulator
        What simulates; the subject's plane-strain test by default.

    Returns
    -------
    list of StudyResult
        One a definition; empty on other ranks.
    """
    with leading(comm) as first:
        if not first:
            return []
        definitions = [read_definition(path) for path in options.definitions]
        subject = load_subject(options.subject, need_recordings=False)
        given = simulator or PlaneStrainSimulator.of_subject(subject)
        planned = Outlook(sum(simulations_of(definition, options.beyond) for definition in definitions))
        with (
            Workers(type(given).solve, given, options.jobs, comm) as workers,
            progress_on(quiet=options.quiet) as progress,
        ):
            # All studies share the simulations: the same point isn't done twice.
            store = Store(options.out / "runs", Outcome, given.fingerprint())
            workshop = Workshop(workers, store, progress, planned)
            results = [_study(options, definition, subject, workshop) for definition in definitions]
    if len(results) > 1:
        folders = map(options.folder_of, definitions)
        studies = [json.loads((folder / "result.json").read_text(encoding="utf-8")) for folder in folders]
        write_document(options.out / "result.json", {"schema": 1, "studies": studies})
    return results


def _study(options: DoeOptions, definition: Definition, subject: Subject, workshop: Workshop) -> StudyResult:
    began, out = time.perf_counter(), options.folder_of(definition)

    def keep(table: pd.DataFrame) -> None:
        out.mkdir(parents=True, exist_ok=True)
        write_atomically(out / "runs.csv", as_csv(definition, table))

    result = study(definition, subject, workshop, options.seed, options.beyond, keep)
    if note := result.fascia_note():
        print(note, file=sys.stderr)
    if short := result.stopped_short():
        print(f"warning: {short}", file=sys.stderr)
    page = study_web_page(result, options.seed, web.command_line())
    entries = [
        ReportFile(draw_response(result, out), "the response surface (as the paper's Fig. 5)"),
        ReportFile([Path("runs.csv"), Path("runs")], "every simulation: a table, and a file each"),
        RESULT,
    ]
    write_page(page, out, "curves and the response surface", entries)
    wall = time.perf_counter() - began
    write_document(out / "result.json", json_types(tables.study_document(result, options.seed, wall)))
    print(
        f"{definition.title}: {len(result.outcomes)} runs, {result.seconds:.0f} s; "
        f"report: {out / REPORT}\npage:   {out / web.PAGE}"
    )
    return result


_NO_METRIC = "No metric could be analysed."


_POINTS = 121


def study_web_page(result: StudyResult, seed: int, command: str) -> web.WebPage:
    """Return the page of one study.

    Parameters
    ----------
    result
        What the study found.
    seed
        Seed of the emulator's points.
    command
        That does it again.
    """
    chapters = [
        web.Chapter("What each factor causes", _effects(result)),
        web.Chapter("The forces behind it", [_curves(result)]),
        web.Chapter("The response surface", _surface(result)),
        *tables.number_chapters(result),
        web.Chapter("What to measure", [web.Bullets(tables.to_measure(result)), *tables.information_blocks(result)]),
        web.Chapter("What could not be tested", [web.Bullets(NOT_TESTED["design"])]),
    ]
    return web.WebPage(
        title="What does a compression test of this leg show?",
        subject=f"{result.subject.title}, section of subject {result.subject.id}; {result.definition.title}",
        origin="simulated",
        headline=_headline(result),
        warnings=_warnings(result),
        known=_known(result),
        chapters=chapters,
        repeat=web.Repeat(command, tables.versions(), {"seed": f"{seed}"}),
        data=DataKind("simulated data", f"forces of a model; section of the leg: {result.subject.origin}"),
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
    hides = "Every factor causes 1 % or more somewhere."
    if unseen := tables.not_seen(result):
        hides = f"It hardly depends on {' and '.join(unseen)}: below 1 % in every window."
    return web.Headline(
        "caution" if _warnings(result) else "sound",
        f"The force of a press {result.definition.depth:g} mm deep depends most on {in_words(factor.name)}, which "
        f"causes {100 * share:.0f} % of the variation in the {metric.label} over the ranges.",
        [
            ("What it does not show", hides),
            (
                "How sure",
                f"The fitted surface predicts {_percents(fits)} of the variance of runs that were not used in the fit "
                "(R²). The runs are a model's, without noise.",
            ),
            ("What must be known before the test", tables.to_know(result)),
            ("What to do", tables.to_measure(result)[0]),
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
    return rows if result.information is None else rows + errors_of_readings(result.subject.instrument)


def _effects(result: StudyResult) -> list[web.Block]:
    if not result.analyses:
        return [web.Prose(_NO_METRIC)]
    metrics = [analysis.metric.label for analysis in result.analyses]
    main, interactions = zip(*(analysis.shares() for analysis in result.analyses), strict=True)
    shares = {f.label: [100 * one[f.symbol] for one in main] for f in result.definition.factors}
    shares["all interactions"] = [100 * rest for rest in interactions]
    bars = [web.LabelledBar(name, each[-1], f"{each[-1]:.1f} %") for name, each in shares.items()]
    rows = [[name, *(f"{share:.1f} %" for share in each)] for name, each in shares.items()]
    return [
        web.Prose(TOLD["shares"]),
        web.Bars(f"Shares of the {metrics[-1]}", ("factor", "share"), bars, greatest=100.0),
        web.WebTable("Shares of every metric", ["factor", *metrics], rows),
    ]


def _curves(result: StudyResult) -> Curves:
    grid = np.linspace(0.0, result.definition.depth, _POINTS)
    every = np.full((len(result.outcomes), _POINTS), np.nan)
    for row, found in zip(every, result.outcomes, strict=True):
        for curve in found.curves:
            row[:] = np.interp(grid, curve.displacement, curve.force, right=np.nan)
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
        f"Force per length of the cylinder over its displacement, of {len(result.outcomes)} simulations",
        "; where one stopped short, the lines over all end.",
        grid,
        "displacement (mm)",
        "force per length (N/mm)",
        lines,
    )


def _surface(result: StudyResult) -> list[web.Block]:
    if not result.analyses:
        return [web.Prose(_NO_METRIC)]
    factors = result.definition.factors
    numbers = {f.symbol: k for k, f in enumerate(factors)}
    main, _ = result.analyses[-1].shares()
    first, second, *_ = sorted(numbers, key=lambda symbol: -main[symbol])
    return [
        web.ResponseSurface(
            TOLD["surface"],
            [
                web.SurfaceFactor(
                    f.label,
                    (*(f"{f.value(at):.3g} {f.unit_text}" for at in (-1.0, 0.0, 1.0)),),  # type: ignore[arg-type]
                )
                for f in factors
            ],
            [
                web.SurfaceMetric(
                    a.metric.label,
                    a.metric.typeset_unit,
                    [([numbers[s] for s in t.term.split(":") if s in numbers], t.value) for t in a.tests],
                )
                for a in result.analyses
            ],
            ["coefficient of the coded factors", *(a.metric.label for a in result.analyses)],
            [
                [
                    term_label(tests[0].term, factors),
                    *(f"{test.value:+.2e} (t {test.t:+.1f}){'*' if test.significant else ''}" for test in tests),
                ]
                for tests in zip(*(analysis.tests for analysis in result.analyses), strict=True)
            ],
            (numbers[first], numbers[second]),
        )
    ]
