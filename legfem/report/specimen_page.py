"""The page of specimens: one tissue's law from all their recordings."""

from collections.abc import Sequence

import numpy as np

from legfem.common.units import FloatArray, percent
from legfem.inverse.catalogue import RATIO, is_ratio, symbol_of
from legfem.inverse.fit import Fit, least_akaike
from legfem.inverse.readings import RELAXATION
from legfem.report import estimates
from legfem.report import page as web
from legfem.report.curves import Curves, Dash, Line
from legfem.report.face_profile import face_profile
from legfem.report.further_channels import channel_lines, drawn
from legfem.report.page import Bars, LabelledBar
from legfem.report.style import DATA_COLOUR, LAW_COLOURS, LAW_NAMES
from legfem.report.words import ORIGINS, capital, fit_probability
from legfem.specimens.artefacts import KNOW_THE_RIG
from legfem.specimens.comparison import SHAPE_SD_OF_LAYERS
from legfem.specimens.details import SampleFit, SpecimenDetails, compared, rms_percent
from legfem.specimens.sizes import kind_in, sizes_text

type SpecimenFit = Fit[SpecimenDetails]

_SIMULATED = "simulated data (forces computed by a model; no specimen was measured)"


def origin_text(result: SpecimenFit) -> str:
    """Return what kind of data they are, in words."""
    origin = result.details.folder.origin
    return _SIMULATED if origin == "simulated" else ORIGINS[origin]


def procedure(result: SpecimenFit) -> str:
    """Return what was done with the recordings, as a paragraph."""
    every = result.details.folder.recordings
    note, axes = " ".join(dict.fromkeys(filter(None, (kind_in(one.sizes).note for one in every)))), every[0].axes
    timed = [one.recording.timed for one in every]
    untimed = (
        ""
        if all(timed)
        else f"{'Some' if any(timed) else 'They'} are tables of stretch and stress without a time, so nothing is "
        "known of rates; forces are those on a body of the stated size, or on a cube of 10 mm. The errors of the "
        "tables are their differences from a smooth curve. "
    )
    relaxing = (
        "Its stress relaxes with one log-normal spectrum of times: faster at larger strain if recordings at two rates "
        "show that, otherwise quasi-linearly. This is exact where the whole specimen has the same strain, "
        "and an approximation for small strain elsewhere. "
        if result.details.folder.relaxes
        else ""
    )
    own = (
        "Each specimen has its own stiffness, a factor on the law's; the law describes a typical "
        "specimen (the geometric mean), and its interval includes the differences between specimens. "
        if result.details.stiffness
        else ""
    )
    until = (
        "until hardly any force was left, with the returns as they were driven. "
        if result.details.folder.returns
        else "to the first return; recordings after that were not used. "
    )
    fitted = sum(one.fitted for one in result.tests)
    together = (
        f"{fitted} recordings were fitted together by one law, weighted equally relative to their greatest {axes.load},"
        if fitted > 1
        else "1 recording was fitted"
    )
    return (
        f"{together} from first contact {until}{untimed}{relaxing}"
        f"{own}{_of_layers(result)}{_of_fibres(result)}{f'{note} ' if note else ''}"
        "A genetic algorithm (pygad) searched on an emulator of the tests, which full solves "
        "refined and confirmed. The intervals include the errors of the instrument and of the model, and the "
        f"factor by which recordings differ ({100 * result.details.gain_sd:.2g} %)."
    )


def _of_layers(result: SpecimenFit) -> str:
    tissues = result.details.folder.tissues
    if len(tissues) == 1:
        return ""
    stated = [one.name for one in tissues if "C10" in one.stated]
    held = f"the stiffness of {', '.join(stated)} is as stated, and " if stated else ""
    if result.details.folder.relaxes:
        after = " (so a stated stiffness is that after all relaxation)" if stated else ""
        held = f"they are taken to relax alike{after}; {held}"
    return (
        f"The layers are bonded to each other; {held}the shape of a curve is taken to be known to "
        f"{100 * SHAPE_SD_OF_LAYERS:.0f} %, because effects that the law leaves out bend it in the same way as "
        "layers of different stiffness. "
    )


def _of_fibres(result: SpecimenFit) -> str:
    (ratio,) = [name for name in result.values if is_ratio(name)] or [""]
    if not ratio:
        return ""
    sought = ratio in result.estimates
    shape = (
        "the bend of a curve was not used, because fibres that are slack at first can change it by tens of percent"
        if result.details.ratio_undetermined
        else f"the shape of a curve is taken to be known to {100 * SHAPE_SD_OF_LAYERS:.0f} %"
    )
    typical = (
        "Typical specimens of both directions are taken to be equally stiff, and a specimen that was turned to "
        "be the same. "
        if sought and result.details.stiffness and not result.details.ratio_undetermined
        else ""
    )
    return (
        "The tissue is stiffer along its fibres: the ratio of its shear moduli is "
        f"{'estimated' if sought else f'taken to be {result.values[ratio]:.3g}'}, Young's modulus "
        f"along them being four times the modulus along less the modulus across; {shape}. {typical}"
    )


def followed(result: SpecimenFit) -> str:
    """Return how stiffness follows the size of what presses or is pressed, as a clause."""
    tables = "a stress of twice the true value, by its unit or measure, doubles the stiffness"
    every = result.details.folder.recordings
    return "; ".join(dict.fromkeys(kind_in(one.sizes).followed if one.recording.timed else tables for one in every))


def differing(result: SpecimenFit) -> list[str]:
    """Return how the specimens' stiffness differs, where each has its own."""
    own = result.details.stiffness
    if not own:
        return []
    low, high = min(own.values()), max(own.values())
    return [
        f"of a typical specimen: {len(own)} specimens are {low:.2f} to {high:.2f} times as stiff "
        f"(standard deviation of the logarithm {result.details.stiffness_spread:.2f})"
    ]


def _of_its_own(result: SpecimenFit, one: SampleFit) -> str:
    if not result.details.stiffness:
        return ""
    if one.specimen in result.details.stiffness:
        return ", with the stiffness of its specimen in the other recordings"
    return f"; with {one.scale:.2f} times the stiffness of a typical specimen, {one.shape_r_squared:.3f}"


def predictions(result: SpecimenFit) -> list[str]:
    """Return how well what was left out is predicted."""
    return [
        f"left out, {one.name}: predicted with R² {one.r_squared:.3f}, rmse {one.axes.load_text(one.rmse)} "
        f"({100 * one.rmse / one.course.peak:.2g} % of {one.axes.load_text(one.course.peak)}){_of_its_own(result, one)}"
        for one in compared(result)
        if not one.fitted
    ]


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
    left = dict.fromkeys(one for result in results for one in result.details.left_out)
    warnings = [*(f"Not used: {one.name}: {one.reason}." for one in left), *estimates.warnings_of(best, results)]
    return web.WebPage(
        title=f"How stiff is the tissue of specimen {best.details.folder.id}?",
        subject=best.details.folder.title,
        origin=best.details.folder.origin,
        headline=_headline(best).doubted(len(best.doubts)),
        warnings=warnings,
        known=_known(results),
        chapters=[
            web.Chapter("Recordings and model", _recordings(results)),
            web.Chapter(web.TESTED, [web.Bullets(_tested(results))]),
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
    law = LAW_NAMES[best.law]
    values = "; ".join(
        f"{_words(name)}: no value, since the search stopped at its {found.at_bound} bound"
        if found.at_bound and found.parameter.scale == "log"
        else f"{_words(name)} {estimates.value_text(found)} ({estimates.interval_text(found, '95 % ')})"
        for name, found in best.estimates.items()
        if found.parameter.role == "identified"
    )
    unsure = estimates.unknown_among(best.estimates)
    thickness = best.details.thickness
    agreement = best.details.agreement
    finding = thickness or (agreement if agreement and agreement.disagree else None)
    doubtful = unsure or best.details.left_out or finding
    tone: web.Tone = "wrong" if not best.goodness.fits else "caution" if doubtful else "sound"
    fitted = sum(one.fitted for one in best.tests)
    together = "the recording" if fitted == 1 else f"the {fitted} recordings together"
    by = f"{rms_percent(best):.2g} % of the greatest force"
    does = (
        f"describes {together} within {by}"
        if best.goodness.fits
        else f"misses {together} by {by} (rms), more than measurement errors explain"
    )
    return web.Headline(
        tone,
        f"{_stiffness(best)}The {law} law {does}.",
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


def _stiffness(best: SpecimenFit) -> str:
    """The asked numbers as sentences; nothing where no C10 was free, or the law doesn't fit."""
    if not best.goodness.fits:
        return ""
    found = {name.removesuffix(".C10"): one for name, one in best.estimates.items() if name.endswith(".C10")}
    return "".join(
        f"{estimates.stiffness_sentence(one, 'Tissue' if layer == 'deep' else capital(layer))}. "
        for layer, one in found.items()
    )


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


def _tested(results: Sequence[SpecimenFit]) -> list[str]:
    return [
        line
        for result in results
        for line in (
            f"The {LAW_NAMES[result.law]} law differs from the recordings by {rms_percent(result):.2g} % (rms), "
            f"chi-square {result.goodness.chi_square:.4g} on {result.goodness.degrees_of_freedom} degrees of freedom "
            f"({fit_probability(result.goodness.p_value)}).",
            *channel_lines(result),
            *estimates.why_identifiable(result.estimates, result.law),
            *(one.text for one in (result.details.agreement,) if one is not None and not one.disagree),
            *(f"{text}." for text in (*differing(result), *predictions(result))),
        )
    ]
