"""The page of specimens: one tissue's law from all their recordings."""

from collections.abc import Sequence

import numpy as np

from legfem.common.units import FloatArray, percent
from legfem.inverse.catalogue import RATIO, is_ratio, symbol_of
from legfem.inverse.chosen import least_akaike
from legfem.inverse.readings import RELAXATION
from legfem.report import estimates
from legfem.report import page as web
from legfem.report.answers import headline_of
from legfem.report.curves import Curves, Dash, Line
from legfem.report.face_profile import face_profile
from legfem.report.further_channels import drawn
from legfem.report.notices import sentences_of
from legfem.report.page import Bars, LabelledBar
from legfem.report.specimen_sentences import SpecimenFit, followed, origin_text, procedure, tested
from legfem.report.style import DATA_COLOUR, LAW_COLOURS, LAW_NAMES
from legfem.report.words import capital, fit_probability
from legfem.specimens.artefacts import KNOW_THE_RIG
from legfem.specimens.details import SampleFit, compared
from legfem.specimens.sizes import sizes_text

_MOST_CURVES = 6
_DASHES: tuple[Dash, ...] = ("solid", "dashed", "dotdash", "dotted")
_NOT_TESTED = (
    "A constant factor on the force (the load cell's gain, the specimen's size) looks like a "
    "change of stiffness, and changes the result without any sign of it.",
    "Whether the tissue is equally stiff in all directions (or across its fibres, where these are stated), "
    "and whether it is the same in the body.",
)


def specimen_page(results: Sequence[SpecimenFit], command: str = "") -> web.WebPage:
    """Return the page of specimens' fits, one a law, and of the command that was given."""
    best = least_akaike(results)
    return web.WebPage(
        title=f"How stiff is the tissue of specimen {best.details.folder.id}?",
        subject=best.details.folder.title,
        origin=best.details.folder.origin,
        headline=_headline(best),
        warnings=sentences_of((best, *results)),
        known=_known(results),
        chapters=[
            web.Chapter("Recordings and model", _recordings(results)),
            web.Chapter(web.TESTED, [web.Bullets(tested(results))]),
            web.Chapter(
                "What could not be tested",
                [
                    web.Bullets(
                        [
                            *estimates.rests_on(best.estimates, followed(best)),
                            *_NOT_TESTED,
                            *(
                                ()
                                if best.details.folder.returns
                                else ("Unloading, and everything after the first return, was not used.",)
                            ),
                        ]
                    )
                ],
            ),
            web.Chapter("What to do next", [web.Bullets(_next(best))]),
            web.Chapter("How it was done", [web.Prose(procedure(best)), *estimates.how_found(results)]),
        ],
        repeat=web.Repeat(command, best.versions, {"seed": f"{best.log.seed}"}),
        data=origin_text(best),
    )


def _headline(best: SpecimenFit) -> web.Headline:
    values = "; ".join(
        f"{_words(name)}: no value, since the search stopped at its {found.at_bound} bound"
        if found.at_bound and found.parameter.scale == "log"
        else f"{_words(name)} {estimates.value_text(found)} ({estimates.interval_text(found, '95 % ')})"
        for name, found in best.estimates.items()
        if found.parameter.role == "identified"
    )
    agreement = best.details.agreement
    finding = best.details.thickness or (agreement if agreement and agreement.disagree else None)
    return headline_of(
        best.answer,
        [
            (
                "Problems found",
                finding.text
                if finding
                else f"None that these recordings can show.{_unused(best)}"
                if best.goodness.fits
                else f"The recordings show an effect that the law leaves out "
                f"({fit_probability(best.goodness.p_value)}).",
            ),
            ("How stiff", f"{capital(values)}."),
            ("How sure", estimates.how_sure(best.estimates, _words)),
            ("What to do", _next(best)[0]),
        ],
    )


def _unused(best: SpecimenFit) -> str:
    count = len(best.details.left_out)
    if not count:
        return ""
    return f" {count} recording{'s were' if count > 1 else ' was'} not used: the warnings say why."


_RELAXATION_WORDS = {
    "ratio": "part of the stress that relaxes, relative to the part that stays",
    "relaxation_time": "middle of the relaxation times",
    "spread": "spread of the relaxation times (sd of their logarithm)",
    "quickening": "speed-up of relaxation at the largest strain (logarithm)",
}


def _words(name: str) -> str:
    """Return a parameter's full name in words: the specimen is one tissue."""
    term, _, field = name.rpartition(".")
    if term == "deep":
        words = f"{symbol_of(name)} of the tissue"
    elif name in RELAXATION:
        words = _RELAXATION_WORDS[field]
    else:
        words = estimates.words_of(name)
    return words.replace(RATIO, "fibre ratio")


_REMEDIES = estimates.Remedies(
    "strain it further, add rates or holds",
    "how the test was done is not stated, so find out whether the ends stick, and state it ([plates] ends)",
)


def _next(best: SpecimenFit) -> list[str]:
    lines = []
    narrower = estimates.how_to_narrow(best.estimates, _REMEDIES)
    if best.details.ratio_undetermined:
        narrower = [best.details.ratio_undetermined]
    if best.details.thickness:
        lines.append(KNOW_THE_RIG)
    elif best.details.agreement and best.details.agreement.disagree:
        lines.append(best.details.agreement.remedy)
    elif not best.goodness.fits:
        lines.append(
            "Try the other laws (--law yeoh, --law exponential); if none fits, use the numbers "
            "only to compare specimens of this test."
        )
    elif narrower:
        lines += narrower
    else:
        lines.append(
            f"Use these numbers together with the {LAW_NAMES[best.law]} law and within the strains of the test."
        )
    if all(one.fitted for one in best.tests):
        lines.append("Test the law on a recording that it has not seen: --leave-out NAME.")
    return lines


_HELD_BY = "specimen.toml, the command, or the law's default"


def _known(results: Sequence[SpecimenFit]) -> list[web.Known]:
    rows = [
        estimates.estimated(
            f"{_words(name)}, {LAW_NAMES[r.law]} law",
            found,
            sum(one.fitted for one in r.tests),
            not any(map(is_ratio, r.values)),
        )
        for r in results
        for name, found in r.estimates.items()
    ]
    free = {name for r in results for name in r.estimates}
    held = {n: v for r in results for n, v in r.assumed.items() if n not in free}
    rows += [
        web.Known(_words(name), estimates.held_text(name, value), "assumed", _HELD_BY) for name, value in held.items()
    ]
    # A law that misses all recordings alike makes more of how they differ.
    first = least_akaike(results)
    rows.append(
        web.Known(
            "factor by which recordings differ",
            f"{100 * first.details.gain_sd:.3g} % (sd)",
            "estimated",
            "the recordings' forces; the intervals include it",
        )
    )
    rows += [
        web.Known(f"{one.words}, {LAW_NAMES[r.law]} law", percent(one.probability), "estimated", "their curves")
        for r in results
        for one in r.details.alternatives
    ]
    rows += [
        web.Known(
            "sizes", sizes_text(sizes), "assumed", "specimen.toml; the intervals include their errors ([accuracy])"
        )
        for sizes in dict.fromkeys(one.sizes for one in first.details.folder.recordings)
    ]
    return rows


def curves_of(results: Sequence[SpecimenFit]) -> list[Curves]:
    """Recordings beside the laws, over displacement and where one holds over time, those with the poorest fit first."""
    worst = sorted(compared(least_akaike(results)), key=lambda one: one.r_squared)
    # Of each of several tests one at least.
    first = {one.test: one for one in reversed(worst)}.values()
    worst = sorted(worst, key=lambda one: one not in first)[: max(_MOST_CURVES, len(first))]
    blocks = []
    for number, one in enumerate(worst):
        axes = one.axes
        blocks.append(_curves(results, one, number, axes.ways * one.course.displacement, axes.way, axes.way_unit))
        if one.course.holds:
            blocks.append(_curves(results, one, number, one.course.time, "time", "s"))
    return blocks


def _recordings(results: Sequence[SpecimenFit]) -> list[web.Block]:
    first = least_akaike(results)
    blocks: list[web.Block] = []
    if len(compared(first)) > _MOST_CURVES:
        blocks.append(
            web.Prose(f"The {_MOST_CURVES} of {len(compared(first))} recordings with the poorest fit are drawn.")
        )
    blocks += curves_of(results)
    blocks.append(
        Bars(
            f"How much of each recording the {LAW_NAMES[first.law]} law explains (R²)",
            ("recording", "R², error"),
            [
                LabelledBar(
                    f"{one.name}{'' if one.fitted else ' (left out, predicted)'}",
                    max(one.r_squared, 0.0),
                    f"{one.r_squared:.4f}, {one.axes.load_text(one.rmse)} of {one.axes.load_text(one.course.peak)}",
                )
                for one in compared(first)
            ],
            greatest=1.0,
        )
    )
    blocks += [*drawn(results), *face_profile(results)]
    return [*blocks, *(block for result in results for block in _in_numbers(result))]


def _in_numbers(result: SpecimenFit) -> list[web.Block]:
    law = LAW_NAMES[result.law]
    tests = dict.fromkeys(one.test for one in compared(result))
    blocks: list[web.Block] = [
        _test_in_numbers([one for one in compared(result) if one.test == test], law, test) for test in tests
    ]
    if result.details.stiffness:
        rows = [[name, f"{factor:.3f}"] for name, factor in result.details.stiffness.items()]
        caption = f"Stiffness of each specimen relative to a typical one, {law} law"
        blocks.append(web.WebTable(caption, ["specimen", "times as stiff"], rows, folded=True))
    return blocks


def _test_in_numbers(samples: Sequence[SampleFit], law: str, test: str) -> web.WebTable:
    axes = samples[0].axes
    of_load = [f"{which} {axes.load_unit}" for which in ("peak", "rmse")]
    return web.WebTable(
        f"Recordings{f' of {test}' if test else ''} and the {law} law; own/joint: the factor by which the law's force "
        "fits that one best",
        ["recording", f"{axes.way_unit}/s", axes.way_unit, *of_load, "R²", "own/joint", ""],
        [
            [
                one.name,
                f"{axes.ways * one.course.rate:.3g}" if one.course.samples.timed else "no time",
                f"{axes.ways * one.course.depth:.3g}",
                f"{axes.loads * one.course.peak:.4g}",
                f"{axes.loads * one.rmse:.3g}",
                f"{one.r_squared:.4f}",
                f"{one.scale:.3f}",
                "" if one.fitted else "left out",
            ]
            for one in samples
        ],
        folded=True,
    )


def _curves(
    results: Sequence[SpecimenFit], one: SampleFit, number: int, x: FloatArray, along: str, unit: str
) -> Curves:
    axes, when = one.axes, one.course.begun + one.course.time
    lines = [Line("recorded", axes.loads * one.course.force, None, DATA_COLOUR, points=True)]
    for k, result in enumerate(results):
        same = next((r for r in compared(result) if r.name == one.name), None)
        if same is not None:
            # Each law has first contact, and so stations, of its own.
            own, differs = same.course.begun + same.course.time, same.predicted - same.course.force
            lines.append(
                Line(
                    f"model, {LAW_NAMES[result.law]}",
                    axes.loads * np.interp(when, own, same.predicted),
                    axes.loads * np.interp(when, own, differs),
                    LAW_COLOURS[result.law],
                    _DASHES[k % 4],
                )
            )
    after = " after first contact" if one.course.samples.timed else ""
    return Curves(
        f"{along.split()[0]}{number}",
        f"{one.name}{'' if one.fitted else ' (left out, predicted)'}: {axes.load} over {along}{after}, recorded and of "
        "the model; beneath, the model less the recording.",
        x,
        f"{along} ({unit})" if unit != "-" else along,
        f"{axes.load} ({axes.load_unit})",
        f"model − recorded ({axes.load_unit})",
        lines,
    )
