"""What is said of specimens in words: ``report.txt``, and a few lines for the terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence

import numpy as np

from legfem.identify.catalogue import symbol_of, with_units
from legfem.report.page import ReportFile, headline, listing
from legfem.report.style import LAW_NAMES
from legfem.report.text import ENERGIES, ORIGINS, WIDTH, probability, variables, wrapped
from legfem.specimens.misfit import SHAPE_SD_OF_LAYERS
from legfem.specimens.result import ComparedRecording, SpecimenResult
from legfem.specimens.sizes import Sizes, opening_of, sizes_text

_SIMULATED = "simulated data (forces computed by a model; no specimen was measured)"


def specimen_summary(results: Sequence[SpecimenResult]) -> str:
    """Return a few lines for the terminal: values, fit, what was left out, and warnings."""
    folder = results[0].folder
    lines = [f"Specimen {folder.id} ({folder.title})", f"DATA: {origin_text(results[0])}", ""]
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
        lines += [f"    {line}" for line in (*_differing(result), *predictions(result))]
    lines.append("  (brackets: 95 % confidence intervals)")
    lines += [
        f"  Not used: {one.name}: {one.reason}."
        for one in dict.fromkeys(one for result in results for one in result.left_out)
    ]
    for result in results:
        lines += [f"  Warning ({LAW_NAMES[result.law]}): {text}" for text in result.warnings]
    return wrapped(lines)


def origin_text(result: SpecimenResult) -> str:
    """Return what kind of data they are, in words."""
    origin = result.folder.origin
    return _SIMULATED if origin == "simulated" else ORIGINS[origin]


def specimen_page(results: Sequence[SpecimenResult], files: Sequence[ReportFile]) -> str:
    """Return the text of ``report.txt``."""
    first = results[0]
    heading = f"Tissue of specimen {first.folder.id} from its recordings"
    blocks = [
        f"{heading}\n{'=' * len(heading)}",
        f"*** {origin_text(first).upper()} ***",
        headline("Summary") + specimen_summary(results).rstrip(),
        headline("What was done") + procedure(first),
        *(headline(f"Result: {LAW_NAMES[r.law]}") + _result(r).rstrip() for r in results),
        headline("Files") + listing(files),
    ]
    return "\n\n".join(blocks) + "\n"


def procedure(result: SpecimenResult) -> str:
    """Return what was done with the recordings, as a paragraph and a list of tests."""
    tests = list(dict.fromkeys(one.sizes for one in result.folder.recordings))
    relaxing = (
        "Its stress relaxes by one log-normal spectrum of times, quasi-linear: exact where all of "
        "the specimen is strained alike, and at small strain elsewhere. "
        if result.folder.relaxes
        else ""
    )
    own = (
        "Each specimen has a stiffness of its own, a factor on all of the law's; the law's is that "
        "of a typical specimen, their geometric mean, and its interval carries how they differ. "
        if result.stiffness
        else ""
    )
    until = (
        "to where hardly any force was left, returns as they were driven. "
        if result.folder.returns
        else "to the first return; what was recorded after that was not used. "
    )
    text = textwrap.fill(
        f"{len(result.fitted)} recordings were fitted together by one law, each counting alike "
        f"and relative to its greatest force, from first contact {until}{relaxing}"
        f"{own}{_of_layers(result)}{_of_a_cup(tests)}A genetic algorithm (pygad) searched on an "
        "emulator of the tests, which full solves refined and confirmed. Intervals carry the "
        "instrument's errors, the model's, and how recordings differ by a factor "
        f"({100 * result.gain_sd:.2g} %).",
        WIDTH,
    )
    shown = [f"  {sizes_text(sizes)}" for sizes in tests[:_MOST_TESTS]]
    more = len(tests) - len(shown)
    return "\n".join([text, "Tests:", *shown, *([f"  and {more} more"] if more else [])])


_MOST_TESTS = 12


def _of_layers(result: SpecimenResult) -> str:
    tissues = result.folder.tissues
    if len(tissues) == 1:
        return ""
    stated = [one.name for one in tissues if "C10" in one.stated]
    held = f"the stiffness of {', '.join(stated)} is as stated, and " if stated else ""
    return (
        f"The layers are bonded to each other; {held}the shape of a curve counts as known to "
        f"{100 * SHAPE_SD_OF_LAYERS:.0f} %, since what the law leaves out bends it as layers of "
        "unlike stiffness do. "
    )


def _of_a_cup(tests: Sequence[Sizes]) -> str:
    if opening_of(tests[0]) is None:
        return ""
    return (
        "Displacement is the dome's height at its middle, force the suction times the area of the "
        "cup's opening; the cup is held where it touches. "
    )


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
        "Specimens": [
            f"{name}: {factor:.3f} times as stiff as a typical one"
            for name, factor in result.stiffness.items()
        ]
        or ["taken to be equally stiff"],
        "Variables": variables(result.parameters),
        "Correlations": _correlations(result) or ["none: there is one parameter"],
        "Assumed": [f"{name} = {value:.4g}" for name, value in with_units(result.assumed).items()],
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


def _differing(result: SpecimenResult) -> list[str]:
    """Return how the specimens' stiffness differs, where each has its own."""
    own = result.stiffness
    if not own:
        return []
    low, high = min(own.values()), max(own.values())
    return [
        f"of a typical specimen: {len(own)} specimens are {low:.2f} to {high:.2f} times as stiff "
        f"(standard deviation of the logarithm {result.stiffness_spread:.2f})"
    ]


def _of_its_own(result: SpecimenResult, one: ComparedRecording) -> str:
    if not result.stiffness:
        return ""
    if one.specimen in result.stiffness:
        return ", by the stiffness that its specimen has in others"
    return f"; were it {one.scale:.2f} times as stiff as a typical one, {one.shape_r_squared:.3f}"


def predictions(result: SpecimenResult) -> list[str]:
    """Return how well what was left out is predicted."""
    return [
        f"left out, {one.name}: predicted with R2 {one.r_squared:.3f}, rmse {one.rmse:.3g} N "
        f"({100 * one.rmse / one.course.peak:.2g} % of {one.course.peak:.3g} N)"
        f"{_of_its_own(result, one)}"
        for one in result.held_out
    ]


def _correlations(result: SpecimenResult) -> list[str]:
    names = list(result.parameters)
    return [
        f"C({symbol_of(names[i])}, {symbol_of(names[j])}) = {result.correlations[i, j]:+.3f}"
        for i, j in zip(*np.triu_indices(len(names), 1), strict=True)
    ]
