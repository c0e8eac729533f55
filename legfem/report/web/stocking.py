"""The page of a leg in its stocking."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from legfem.common.doubts import doubt_lines
from legfem.common.units import FloatArray, mpa_to_mmhg
from legfem.report.stocking_mismatch_text import CONTOURS, mismatch_verdict
from legfem.report.stocking_pressure_text import highest_place
from legfem.report.stocking_stiffness_text import verdict_sentence
from legfem.report.stocking_text import ORIGINS
from legfem.report.stocking_words import both_units, place_in_fat, share_of, vein_interval
from legfem.report.web import page as web
from legfem.report.web.bars import Bar, Bars
from legfem.report.web.stocking_leg import dressed_leg
from legfem.report.web.stocking_numbers import known_of
from legfem.report.words import short_probability
from legfem.stocking.document import versions
from legfem.stocking.judgement import judge, model_misses
from legfem.stocking.run import StockingResult
from legfem.stocking.warnings import TISSUES, best_complete, stocking_warnings

_NOT_TESTED = (
    "A fabric whose stiffness or size is wrong: a pressure 10 % higher everywhere makes both "
    "tissues about 10 % stiffer, and raises every pressure here by about as much.",
    "Muscle that is tensed, and a leg that stands or walks: the scans are of a leg at rest.",
    "The veins themselves: pressures are those of tissue without a vein in it.",
)


def stocking_web_page(
    result: StockingResult,
    moved: Mapping[str, FloatArray] | None,
    text: str,
    command: str = "",
) -> web.WebPage:
    """Return the page of a leg in its stocking.

    Parameters
    ----------
    result
        Of a run.
    moved
        Displacement (mm) of skin's and hull's points; None if the worn state was not found.
    text
        Of ``report.txt``.
    command
        That was given; empty where there was none.
    """
    leg, found = result.leg, result.pressures
    chapters = []
    if found is not None and moved is not None:
        chapters.append(web.Chapter("The leg, bare and dressed", [dressed_leg(result, moved)]))
        chapters.append(web.Chapter("Pressures on the skin and inside", _pressures(result)))
    chapters += [
        web.Chapter("Where model and scan differ", _mismatch(result)),
        web.Chapter("What could not be tested", [web.Bullets(_NOT_TESTED)]),
        web.Chapter("What to do next", [web.Bullets(_next(result))]),
        web.Chapter("The full report", [web.Verbatim("report.txt", text)]),
    ]
    return web.WebPage(
        title=f"What does its compression stocking do to leg {leg.id}?",
        subject=leg.title,
        origin=leg.origin,
        headline=_headline(result),
        warnings=[*doubt_lines(leg.doubts), *stocking_warnings(result)],
        known=known_of(result),
        chapters=chapters,
        repeat=web.Repeat(command, versions()),
        data=ORIGINS[leg.origin],
    )


def _headline(result: StockingResult) -> web.Headline:
    return web.Headline(
        _tone(result),
        _sentence(result),
        [
            ("What is wrong", _wrong(result)),
            ("How sure", _sure(result)),
            ("What it means for comfort", _comfort(result)),
            ("What to do", _next(result)[0]),
        ],
        "" if result.pressures is not None else "There is no answer",
    )


def _misses(result: StockingResult) -> bool:
    best = best_complete(result)
    return best is not None and model_misses(best, result.leg.accuracy)


def _tone(result: StockingResult) -> web.Tone:
    verdict = None if result.mismatch is None else result.mismatch.verdict
    if result.pressures is None or verdict == "unexplained" or _misses(result):
        return "wrong"
    best = best_complete(result)
    unsure = best is not None and any(
        known.verdict != "identifiable" for known in judge(best, result.leg.accuracy)
    )
    tested = verdict == "consistent"
    return "sound" if tested and not unsure and result.worn.converged else "caution"


def _sentence(result: StockingResult) -> str:
    found = result.pressures
    if found is None:
        return "The leg in its stocking could not be computed: there are no pressures inside it."
    text = (
        f"The stocking presses on the skin with {mpa_to_mmhg(found.mean_interface):.0f} mmHg on "
        "average"
    )
    at_veins = [p for p in found.at_veins if np.isfinite(p)]
    if not at_veins:
        return f"{text}, {mpa_to_mmhg(found.greatest_interface):.0f} mmHg at most."
    low, high = (f"{mpa_to_mmhg(p):.0f}" for p in (min(at_veins), max(at_veins)))
    span = low if low == high else f"{low} to {high}"
    return (
        f"{text}; at the deep veins the pressure is {span} mmHg "
        f"({share_of(at_veins, found.mean_interface)} of that)."
    )


def _wrong(result: StockingResult) -> str:
    if result.mismatch is None:
        return (
            "Nothing could be tested: the leg was not scanned in its stocking."
            if not result.searches
            else "No state of the leg could be compared with its scan: see the warnings."
        )
    if result.mismatch.verdict == "consistent":
        return (
            "Nothing that shows: model and scan differ by no more than the errors of contours, "
            "registration and pressure."
        )
    return mismatch_verdict(result.mismatch)


def _sure(result: StockingResult) -> str:
    best = best_complete(result)
    parts = [] if best is None else [verdict_sentence(k) for k in judge(best, result.leg.accuracy)]
    if result.leg.known and result.pressures is not None:
        parts.append("The pressures are those of the stiffness that was given.")
    veins = range(len(result.leg.veins)) if result.pressures is not None else ()
    ends = [vein_interval(result, k) for k in veins]
    spreads = [high - low for low, high in ends if np.isfinite(high)]
    if spreads:
        parts.append(
            f"If the model and the fabric are right, pressures at the veins are known within "
            f"{0.5 * max(spreads):.1f} mmHg (95 %)."
        )
    return " ".join(parts) or "Unknown: there is nothing to compare with."


def _comfort(result: StockingResult) -> str:
    found = result.pressures
    if found is None:
        return "Unknown."
    where = place_in_fat(result.leg.bare, found.greatest_in_fat_at)
    return (
        "The greatest pressure in the fat, where the receptors of pain are, is "
        f"{both_units(found.greatest_in_fat)}, {where}."
    )


def _next(result: StockingResult) -> list[str]:
    if result.pressures is None:
        return ["Run it again with a finer mesh (--cells), and look at the warnings."]
    if _misses(result) or (result.mismatch and result.mismatch.verdict == "unexplained"):
        return [
            "Don't use the stiffness. Look at the contours where model and scan differ: at the "
            "segmentation, the registration, and the stocking's size."
        ]
    lines = []
    best = best_complete(result)
    unsure = [] if best is None else [
        TISSUES[k.name] for k in judge(best, result.leg.accuracy) if k.verdict != "identifiable"
    ]  # fmt: skip
    if unsure:
        lines.append(
            f"Don't rely on the stiffness of the {' and the '.join(unsure)}: these scans don't "
            "tell it well enough. The pressures hardly depend on it."
        )
    if not result.searches:
        lines.append("Scan the leg in its stocking, too: then the stiffness can be found.")
    lines.append(
        "Compare the pressure on the skin with the stocking's class, or measure it at one place: "
        "all pressures inside follow it."
    )
    return lines


def _pressures(result: StockingResult) -> list[web.Block]:
    found, leg = result.pressures, result.leg
    assert found is not None
    load = result.worn.load
    bars = [
        Bar("skin, mean", mpa_to_mmhg(found.mean_interface), both_units(found.mean_interface)),
        Bar(f"skin, greatest ({highest_place(result)})", mpa_to_mmhg(found.greatest_interface),
            both_units(found.greatest_interface)),
        Bar("skin, least", mpa_to_mmhg(float(load.pressure.min())),
            both_units(float(load.pressure.min()))),
        Bar("fat, greatest", mpa_to_mmhg(found.greatest_in_fat), both_units(found.greatest_in_fat)),
        Bar("muscle, mean", mpa_to_mmhg(found.mean_in_muscle), both_units(found.mean_in_muscle)),
    ]  # fmt: skip
    for k, (vein, pressure) in enumerate(zip(leg.veins, found.at_veins, strict=True)):
        low, high = vein_interval(result, k)
        known = np.isfinite(high)
        bars.append(
            Bar(
                f"vein, {vein.name}",
                mpa_to_mmhg(pressure) if np.isfinite(pressure) else 0.0,
                both_units(pressure) + (f", {low:.1f} to {high:.1f} mmHg" if known else "")
                if np.isfinite(pressure)
                else "not in the tissues: check the vein's position",
                (low, high) if known else None,
            )
        )
    return [
        Bars(
            "Pressures (mmHg, kPa), on the skin by Laplace's law, inside hydrostatic; ends: 95 %",
            ("where", "pressure"), bars,
        )
    ]  # fmt: skip


def _mismatch(result: StockingResult) -> list[web.Block]:
    found = result.mismatch
    if found is None:
        return [web.Prose(_wrong(result))]
    blocks: list[web.Block] = [web.Prose(mismatch_verdict(found))]
    if found.places:
        blocks.append(
            web.WebTable(
                "Places that differ beyond the errors: the model outside the scan",
                ["contour", "angle from +x to +y (°)", "heights z (mm)", "distance (mm)", "p"],
                [
                    [CONTOURS[p.contour], f"{p.angle_deg:.0f}",
                     f"{p.levels[0]:.0f} to {p.levels[1]:.0f}", f"{p.distance:+.2f}",
                     short_probability(p.p_value)]
                    for p in found.places
                ],
            )
        )  # fmt: skip
    blocks.append(
        web.WebTable(
            "What was tried as a reason (p: family-wise, of a sign as strong by chance)",
            ["mechanism", "what it is", "chi-square", "p"],
            [
                [s.name.replace("-", " "), s.statement,
                 f"{s.statistic:.1f} on {s.degrees}", short_probability(s.p_value)]
                for s in found.scores
            ],
        )
    )  # fmt: skip
    return blocks
