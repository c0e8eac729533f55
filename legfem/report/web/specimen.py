"""The page of specimens: one tissue's law from all their recordings."""

from __future__ import annotations

from collections.abc import Sequence

from legfem.common.units import FloatArray
from legfem.inverse.catalogue import RATIO, symbol_of
from legfem.inverse.fit import LEAST_CHANCE
from legfem.inverse.instrument import RELAXATION
from legfem.report.specimen_text import differing, followed, origin_text, predictions, procedure
from legfem.report.style import DATA_COLOUR, LAW_COLOURS, LAW_NAMES
from legfem.report.web import estimates
from legfem.report.web import page as web
from legfem.report.web.bars import Bar, Bars
from legfem.report.web.curves import Curves, Dash, Line
from legfem.report.words import fit_probability
from legfem.specimens.result import ComparedRecording, SpecimenResult
from legfem.specimens.sizes import sizes_text

_MOST_CURVES = 6
_DASHES: tuple[Dash, ...] = ("solid", "dashed", "dotdash", "dotted")
_RETURNS = "Unloading and everything after the first return: it was not used."
_NOT_TESTED = (
    "A constant factor on the force (the load cell's gain, the specimen's size) looks like a "
    "change of stiffness, and would sit in it unseen.",
    "Whether the tissue is alike in all directions, or across its fibres where they are stated, "
    "and whether it is the same in the body.",
)


def specimen_web_page(results: Sequence[SpecimenResult], command: str = "") -> web.WebPage:
    """Return the page of specimens.

    Parameters
    ----------
    results
        One a law, of one folder.
    command
        That was given; empty where there was none.
    """
    best = _best(results)
    left = dict.fromkeys(one for result in results for one in result.left_out)
    warnings = [
        *(f"Not used: {one.name}: {one.reason}." for one in left),
        *(f"{LAW_NAMES[r.law]} law: {line}" for r in results for line in r.warnings),
    ]
    return web.WebPage(
        title=f"How stiff is the tissue of specimen {best.folder.id}?",
        subject=best.folder.title,
        origin=best.folder.origin,
        headline=_headline(best),
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
                            *estimates.rests_on(best.parameters, followed(best)),
                            *_NOT_TESTED,
                            *(() if best.folder.returns else (_RETURNS,)),
                        ]
                    )
                ],
            ),
            web.Chapter("What to do next", [web.Bullets(_next(best))]),
            web.Chapter("How it was done", [web.Prose(procedure(best)), *estimates.how_found(results)]),
        ],
        repeat=web.Repeat(command, best.versions, {"seed": f"{best.seed}"}),
        data=origin_text(best),
    )


def _best(results: Sequence[SpecimenResult]) -> SpecimenResult:
    return estimates.least_akaike(results, lambda r: r.chi_square)


def _fits(result: SpecimenResult) -> bool:
    return not result.p_value < LEAST_CHANCE


def _headline(best: SpecimenResult) -> web.Headline:
    law = LAW_NAMES[best.law]
    values = "; ".join(
        f"{_words(name)} {estimates.value_text(found)} (95 % {estimates.interval_text(found)})"
        for name, found in best.parameters.items()
        if found.parameter.role == "identified"
    )
    unsure = estimates.unknown_among(best.parameters)
    tone: web.Tone = "wrong" if not _fits(best) else "caution" if unsure or best.left_out else "sound"
    fitted = len(best.fitted)
    describes = "describes" if _fits(best) else "does not describe"
    return web.Headline(
        tone,
        f"The {law} law {describes} {_together(fitted)} within {best.rms_percent:.2g} % of the "
        f"greatest force{'' if _fits(best) else ', which is more than their errors'}.",
        [
            (
                "What is wrong",
                "Nothing that these recordings could show."
                if _fits(best)
                else f"Something that the law leaves out shows ({fit_probability(best.p_value)}).",
            ),
            ("How stiff", f"{values}."),
            ("How sure", estimates.how_sure(best.parameters)),
            ("What to do", _next(best)[0]),
        ],
    )


def _together(count: int) -> str:
    return "the recording" if count == 1 else f"the {count} recordings together"


def _words(name: str) -> str:
    """Return a parameter's full name in words: the specimen is one tissue."""
    term, _, field = name.rpartition(".")
    if term == "deep":
        words = f"{symbol_of(name)} of the tissue"
    elif name in RELAXATION:
        words = f"{field.replace('_', ' ')} of the viscoelasticity"
    else:
        words = estimates.words_of(name)
    return words.replace(RATIO, "fibre ratio")


_REMEDIES = estimates.Remedies("strain it further, add rates or holds")


def _next(best: SpecimenResult) -> list[str]:
    lines = []
    narrower = estimates.how_to_narrow(best.parameters, _REMEDIES)
    if best.untold:
        narrower = [best.untold]
    if not _fits(best):
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
    if not best.held_out:
        lines.append("Have one recording predicted from the others: --leave-out NAME.")
    return lines


def _known(results: Sequence[SpecimenResult]) -> list[web.Known]:
    rows = [
        estimates.estimated(f"{_words(name)}, {LAW_NAMES[r.law]} law", found, len(r.fitted))
        for r in results
        for name, found in r.parameters.items()
    ]
    free = {name for r in results for name in r.parameters}
    held = {n: v for r in results for n, v in r.assumed.items() if n not in free}
    rows += [
        web.Known(
            _words(name), estimates.held_text(name, value), "assumed", "specimen.toml, the command, or the law's own"
        )
        for name, value in held.items()
    ]
    first = results[0]
    rows.append(
        web.Known(
            "factor by which recordings differ",
            f"{100 * first.gain_sd:.2g} % (sd)",
            "estimated",
            "their forces; the intervals carry it",
        )
    )
    rows += [
        web.Known("sizes", sizes_text(sizes), "assumed", "specimen.toml")
        for sizes in dict.fromkeys(one.sizes for one in first.folder.recordings)
    ]
    return rows


def _recordings(results: Sequence[SpecimenResult]) -> list[web.Block]:
    first = _best(results)
    worst = sorted(first.recordings, key=lambda one: one.r_squared)[:_MOST_CURVES]
    blocks: list[web.Block] = []
    if len(first.recordings) > _MOST_CURVES:
        blocks.append(
            web.Prose(
                f"The {_MOST_CURVES} of {len(first.recordings)} recordings that fit least are drawn; fit.png has all."
            )
        )
    for number, one in enumerate(worst):
        blocks.append(_curves(results, one, number, one.course.displacement, "displacement (mm)"))
        if one.course.holds:
            blocks.append(_curves(results, one, number, one.course.time, "time (s)"))
    blocks.append(
        Bars(
            f"How much of each recording the {LAW_NAMES[first.law]} law explains (R²)",
            ("recording", "R², error"),
            [
                Bar(
                    f"{one.name}{'' if one.fitted else ' (left out, predicted)'}",
                    max(one.r_squared, 0.0),
                    f"{one.r_squared:.4f}, {one.rmse:.3g} N of {one.course.peak:.3g} N",
                )
                for one in first.recordings
            ],
            greatest=1.0,
        )
    )
    return [*blocks, *(block for result in results for block in _in_numbers(result))]


def _in_numbers(result: SpecimenResult) -> list[web.Block]:
    law = LAW_NAMES[result.law]
    blocks: list[web.Block] = [
        web.WebTable(
            f"Recordings beside the {law} law; own over joint: the factor that would fit each best",
            ["recording", "mm/s", "mm", "peak N", "rmse N", "R²", "own/joint", ""],
            [
                [
                    one.name,
                    f"{one.course.rate:.3g}",
                    f"{one.course.depth:.3g}",
                    f"{one.course.peak:.4g}",
                    f"{one.rmse:.3g}",
                    f"{one.r_squared:.4f}",
                    f"{one.scale:.3f}",
                    "" if one.fitted else "left out",
                ]
                for one in result.recordings
            ],
            folded=True,
        )
    ]
    if result.stiffness:
        rows = [[name, f"{factor:.3f}"] for name, factor in result.stiffness.items()]
        caption = f"Stiffness of each specimen over a typical one, {law} law"
        blocks.append(web.WebTable(caption, ["specimen", "times as stiff"], rows, folded=True))
    return blocks


def _curves(
    results: Sequence[SpecimenResult], one: ComparedRecording, number: int, x: FloatArray, label: str
) -> Curves:
    lines = [Line("recorded", one.course.force, None, DATA_COLOUR, points=True)]
    for k, result in enumerate(results):
        same = next((r for r in result.recordings if r.name == one.name), None)
        if same is not None:
            lines.append(
                Line(
                    f"model, {LAW_NAMES[result.law]}",
                    same.predicted,
                    same.predicted - same.course.force,
                    LAW_COLOURS[result.law],
                    _DASHES[k % 4],
                )
            )
    what = label.split(" ")[0]
    return Curves(
        f"{what}{number}",
        f"{one.name}{'' if one.fitted else ' (left out, predicted)'}: force over {what} after "
        "first contact, recorded and of the model; beneath, the model less the recording.",
        x,
        label,
        "force (N)",
        "model − recorded (N)",
        lines,
    )


def _tested(results: Sequence[SpecimenResult]) -> list[str]:
    return [
        line
        for result in results
        for line in (
            f"The {LAW_NAMES[result.law]} law leaves {result.rms_percent:.2g} % (rms), chi-square "
            f"{result.chi_square:.4g} on {result.degrees_of_freedom} degrees of freedom "
            f"({fit_probability(result.p_value)}).",
            *estimates.why_identifiable(result.parameters, result.law),
            *(f"{text}." for text in (*differing(result), *predictions(result))),
        )
    ]
