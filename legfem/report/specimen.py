"""The report of specimens: text, figure and numbers in one folder."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.documents import json_types, write_document
from legfem.common.units import readable_unit
from legfem.identify.catalogue import key_of, symbol_of, unit_of, unit_suffix
from legfem.identify.document import estimate_document
from legfem.report.in_place import REPORT, made_in_place
from legfem.report.page import ReportFile, headline, listing
from legfem.report.specimen_figure import specimen_figure
from legfem.report.style import LAW_NAMES, save
from legfem.report.text import ENERGIES, ORIGINS, WIDTH, probability, variables, wrapped
from legfem.specimens.result import ComparedRecording, SpecimenResult

SCHEMA = "legfem.identify-specimen/1"
_SIMULATED = "simulated data (forces computed by a model; no specimen was measured)"


def write_specimen_report(results: Sequence[SpecimenResult], out: Path) -> Path:
    """Write result.json, fit.png, fit.svg and report.txt; return the report's path.

    Parameters
    ----------
    results
        One a law, of one folder.
    out
        Folder; made if missing.
    """
    write_document(out / "result.json", [specimen_document(result) for result in results])
    with made_in_place(out) as folder:
        figure = ReportFile(
            save(specimen_figure(results), folder, "fit", svg=True),
            "every recording beside the model over displacement and time, and their differences",
        )
        (folder / REPORT).write_text(_page(results, [figure]), encoding="utf-8")
    return out / REPORT


def specimen_summary(results: Sequence[SpecimenResult]) -> str:
    """Return a few lines for the terminal: values, fit, what was left out, and warnings."""
    folder = results[0].folder
    lines = [f"Specimen {folder.id} ({folder.title})", f"DATA: {_origin(results[0])}", ""]
    for result in results:
        lines.append(
            f"  {LAW_NAMES[result.law]}: {len(result.fitted)} recordings fitted, rms "
            f"{result.rms_percent:.2g} % of the greatest force, {result.forward_solves} solves, "
            f"{result.wall_s:.1f} s"
        )
        for name, found in result.parameters.items():
            low, high = found.shown.ci95
            lines.append(
                f"    {symbol_of(name):<32} {found.shown.value:<9.4g} [{low:.4g}, {high:.4g}] "
                f"{found.shown.unit}, {found.identifiability}"
            )
        lines += [f"    {line}" for line in _predictions(result)]
    lines.append("  (brackets: 95 % confidence intervals)")
    lines += [
        f"  Not used: {one.name}: {one.reason}."
        for one in dict.fromkeys(one for result in results for one in result.left_out)
    ]
    for result in results:
        lines += [f"  Warning ({LAW_NAMES[result.law]}): {text}" for text in result.warnings]
    return wrapped(lines)


def specimen_document(result: SpecimenResult) -> dict[str, Any]:
    """Return a result as JSON types; every number's unit is in its name or beside it."""
    names = list(result.parameters)
    document = {
        "schema": SCHEMA,
        "specimen": result.folder.id,
        "title": result.folder.title,
        "origin": result.folder.origin,
        "law": result.law,
        "parameters": {
            key_of(name): estimate_document(one) for name, one in result.parameters.items()
        },
        "correlations": {
            key_of(one): dict(zip(map(key_of, names), row, strict=True))
            for one, row in zip(names, result.correlations, strict=True)
        },
        "assumed": dict(_assumed(result)),
        "recordings": [_recording(one) for one in result.recordings],
        "not_used": {one.name: one.reason for one in result.left_out},
        "chi_square": result.chi_square,
        "degrees_of_freedom": result.degrees_of_freedom,
        "p_value": result.p_value,
        "gain_sd_between_recordings": result.gain_sd,
        "converged": result.converged,
        "forward_solves": result.forward_solves,
        "forward_solves_reused": result.reused_solves,
        "failed_solves": result.failed_solves,
        "emulator_error_N": result.emulator_error,
        "warnings": list(result.warnings),
        "seed": result.seed,
        "wall_s": result.wall_s,
        "versions": dict(result.versions),
    }
    plain: dict[str, Any] = json_types(document)
    return plain


def _recording(one: ComparedRecording) -> dict[str, Any]:
    course = one.course
    return {
        "name": one.name,
        "specimen": one.specimen,
        "fitted": one.fitted,
        "rate_mm_per_s": course.rate,
        "depth_mm": course.depth,
        "rmse_N": one.rmse,
        "r_squared": one.r_squared,
        "scale": one.scale,
        "time_s": course.time,
        "displacement_mm": course.displacement,
        "force_N": course.force,
        "predicted_force_N": one.predicted,
    }


def _assumed(result: SpecimenResult) -> Iterable[tuple[str, float]]:
    for name, value in result.assumed.items():
        unit, factor = readable_unit(unit_of(name))
        yield f"{name.replace('.', '_')}_{unit_suffix(unit)}", factor * value


def _origin(result: SpecimenResult) -> str:
    origin = result.folder.origin
    return _SIMULATED if origin == "simulated" else ORIGINS[origin]


def _page(results: Sequence[SpecimenResult], files: Sequence[ReportFile]) -> str:
    first = results[0]
    heading = f"Tissue of specimen {first.folder.id} from its recordings"
    blocks = [
        f"{heading}\n{'=' * len(heading)}",
        f"*** {_origin(first).upper()} ***",
        headline("Summary") + specimen_summary(results).rstrip(),
        headline("What was done") + _procedure(first),
        *(headline(f"Result: {LAW_NAMES[r.law]}") + _result(r).rstrip() for r in results),
        headline("Files") + listing(files),
    ]
    return "\n\n".join(blocks) + "\n"


def _procedure(result: SpecimenResult) -> str:
    tests = list(dict.fromkeys(one.sizes for one in result.folder.recordings))
    relaxing = (
        "Its stress relaxes by one log-normal spectrum of times, quasi-linear: exact where all of "
        "the specimen is strained alike, and at small strain elsewhere. "
        if result.folder.relaxes
        else ""
    )
    text = textwrap.fill(
        f"{len(result.fitted)} recordings were fitted together by one law, each counting alike "
        "and relative to its greatest force, from first contact to the first return; what was "
        f"recorded after that was not used. {relaxing}A genetic algorithm (pygad) searched on an "
        "emulator of the tests, which full solves refined and confirmed. Intervals carry the "
        "instrument's errors, the model's, and how recordings differ by a factor "
        f"({100 * result.gain_sd:.2g} %).",
        WIDTH,
    )
    shown = [f"  {sizes}" for sizes in tests[:_MOST_TESTS]]
    more = len(tests) - len(shown)
    return "\n".join([text, "Tests (mm):", *shown, *([f"  and {more} more"] if more else [])])


_MOST_TESTS = 12


def _result(result: SpecimenResult) -> str:
    sections: dict[str, Iterable[str]] = {
        "Model": [ENERGIES[result.law]],
        "Fit Statistics": [
            f"rms difference       = {result.rms_percent:.3g} % of each greatest force",
            f"chi-square           = {result.chi_square:.5g} on {result.degrees_of_freedom} "
            f"degrees of freedom; {probability(result.p_value)}",
            f"full forward solves  = {result.forward_solves} ({result.failed_solves} failed, "
            f"{result.reused_solves} from an earlier run)",
            f"converged            = {'yes' if result.converged else 'NO'} (seed {result.seed})",
        ],
        "Recordings": _table(result),
        "Variables": variables(result.parameters),
        "Correlations": _correlations(result) or ["none: there is one parameter"],
        "Assumed": [f"{name} = {value:.4g}" for name, value in _assumed(result)],
        "Warnings": result.warnings or ["none"],
    }
    lines = []
    for name, body in sections.items():
        lines += [f"[[{name}]]", *(f"    {line}" for line in body)]
    return wrapped(lines)


def _table(result: SpecimenResult) -> list[str]:
    width = max(9, *(len(one.name) for one in result.recordings))
    head = f"{'recording':<{width}}  mm/s      mm     peak N   rmse N    R2      own/joint"
    return [head, *(
        f"{one.name:<{width}}  {one.course.rate:<8.3g}  {one.course.depth:<6.3g} "
        f"{one.course.peak:<8.4g} {one.rmse:<9.3g} {one.r_squared:<7.4f} {one.scale:.3f}"
        f"{'' if one.fitted else '  left out'}"
        for one in result.recordings
    )]  # fmt: skip


def _predictions(result: SpecimenResult) -> list[str]:
    return [
        f"left out, {one.name}: predicted with R2 {one.r_squared:.3f}, rmse {one.rmse:.3g} N "
        f"({100 * one.rmse / one.course.peak:.2g} % of {one.course.peak:.3g} N)"
        for one in result.held_out
    ]


def _correlations(result: SpecimenResult) -> list[str]:
    names = list(result.parameters)
    return [
        f"C({symbol_of(names[i])}, {symbol_of(names[j])}) = {result.correlations[i, j]:+.3f}"
        for i, j in zip(*np.triu_indices(len(names), 1), strict=True)
    ]
