"""Answers and notices in words, for whoever shows a result.

Of an answer the heading and the first sentence of a page; of a notice, by ``resources/notices.toml``, its sentence, and
its kind for tables of many.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from string import Formatter
from typing import Any

from legfem.common.errors import DOUBTFUL, Doubt
from legfem.common.numbers import between, number, percent, share
from legfem.common.resources import resource
from legfem.common.units import mpa_to_kpa, mpa_to_mmhg
from legfem.inverse.answer import Answer, Finding, FitNotice, Notice, Value
from legfem.inverse.catalogue import DEEP_C10, key_of, symbol_of
from legfem.inverse.fit import Fit
from legfem.report import page as web
from legfem.report.estimates import held_text, known_text, words_of
from legfem.report.words import LAW_NAMES, MODULI, WORDS, capital, moduli_text


def headline_of(answer: Answer, answers: Sequence[tuple[str, str]] = ()) -> web.Headline:
    """Return a page's first lines, with further questions and their answers."""
    heading = _of_stocking_heading(answer) if answer.kind == "stocking" else ""
    heading = _HEADINGS[answer.finding](answer) if answer.kind == "diagnosis" else heading
    return web.Headline(answer.tone, _SENTENCES[answer.kind](answer), answers, heading).doubted(answer.doubts)


def _stiffness(tissue: str, known: Value) -> str:
    """Return C10 with its interval, and the moduli at small strain that belong to it, as first words."""
    if known.ci95 is None or known.at_bound:
        return f"{tissue} stiffness C10 is {known_text(known)}"
    moduli = moduli_text(known.value or math.nan, known.standard_error, known.unit)
    return f"{tissue} stiffness C10 = {known_text(known)}, {moduli}"


def _of_leg(answer: Answer) -> str:
    given, several = answer.parameters, answer.parameters["tests"] > 1
    if answer.finding is Finding.TESTS_DISAGREE:
        return "The sites disagree about the stiffness."
    if answer.finding is Finding.MISFIT:
        what = "these sites" if several else "this test"
        return f"The model does not describe {what}, so the stiffness it gives cannot be trusted."
    where = f"all {given['tests']} sites" if several else "this test"
    return f"{_of_muscle(answer)}. The {LAW_NAMES[given['law']]} law describes {where}."


def _of_muscle(answer: Answer) -> str:
    if DEEP_C10 in answer.values:
        return _stiffness(capital(answer.parameters["tissue"]), answer.values[DEEP_C10])
    each = (f"{words_of(name)} {known_text(one, '95 % ')}" for name, one in answer.values.items() if one.asked)
    return f"{'; '.join(each)}, with C10 of the muscle as given, {held_text(DEEP_C10, answer.parameters['C10_given'])}"


def _of_specimens(answer: Answer) -> str:
    given, fits = answer.parameters, answer.finding is Finding.FITS
    together = "the recording" if given["fitted"] == 1 else f"the {given['fitted']} recordings together"
    by = f"{given['rms_percent']:.2g} % of the greatest force"
    misses = f"misses {together} by {by} (rms), more than measurement errors explain"
    layers = {name.removesuffix(".C10"): one for name, one in answer.values.items() if name.endswith(".C10") and fits}
    stiff = (f"{_stiffness('Tissue' if of == 'deep' else capital(of), one)}. " for of, one in layers.items())
    return (
        f"{''.join(stiff)}The {LAW_NAMES[given['law']]} law {f'describes {together} within {by}' if fits else misses}."
    )


def _reported(answer: Answer) -> str:
    """Say what number to write down of a diagnosis, or why none."""
    why = answer.parameters["why_none"]
    if why:
        return str(WORDS["no_number"][why])
    (known,) = answer.values.values()
    first, last = known.ci95 or (math.nan, math.nan)
    first_words = "So far" if answer.finding is Finding.PROVISIONAL else "Report"
    if not known.range_only:
        moduli = moduli_text(known.value or math.nan, known.standard_error)
        return f"{first_words}: C10 = {known_text(known)}, {moduli}."
    value = "" if known.value is None else number(known.value, known.standard_error)
    only = f" ({value} if no hidden effect is present)" if value else ""
    (low, high), spread = between(first, last), (last - first) / 4
    shear, young = (" and ".join(number(times * end, times * spread) for end in (first, last)) for times in MODULI)
    return (
        f"{first_words} a range: C10 between {low} and {high} kPa{only}, shear modulus G between {shear} kPa, Young's "
        f"modulus E between {young} kPa."
    )


def _where_effects_hide(answer: Answer) -> str:
    given = answer.parameters
    fits = "The model fits" if given["verdict"] == "consistent" else "The corrected model fits"
    part = ", but not in all parts" if given["missing_in_parts"] else " in part" if given["fits_in_part"] else ""
    return f"{fits}{part}, and C10 may be off by {percent(given['may_be_off'])}."


def _misses(answer: Answer) -> str:
    return f"misses by {share(answer.parameters['misfit'])} of the largest force"


def _of_stocking(answer: Answer) -> str:
    given = answer.parameters
    if answer.finding is Finding.NOT_COMPUTED:
        return "The leg in its stocking could not be computed: there are no pressures inside it."
    ankle = _sentence_at_ankle(given["ankle"]) if given["ankle"] else ""
    text = f"{ankle}The stocking presses on the skin with {mpa_to_mmhg(given['mean']):.0f} mmHg on average"
    if not given["veins"]:
        return f"{text}, {mpa_to_mmhg(given['greatest']):.0f} mmHg at most."
    low, high = (f"{mpa_to_mmhg(end(given['veins'])):.0f}" for end in (min, max))
    span = low if low == high else f"{low} to {high}"
    of_mean = _share_of(given["veins"], given["mean"])
    return f"{text}; at the deep veins the pressure is {span} mmHg ({of_mean} of the mean on the skin)."


def _of_tape(answer: Answer) -> str:
    ankle, (low, high) = answer.parameters["ankle"], answer.parameters["spread"]
    said = _sentence_at_ankle(ankle) if ankle else ""
    return f"{said}Along the leg the stocking's mean pressure is {low:.1f} to {high:.1f} mmHg."


def _of_stocking_heading(answer: Answer) -> str:
    """Return what can be relied on, and what is uncertain."""
    if answer.finding is not Finding.FITS:
        return "There is no answer" if answer.finding is Finding.NOT_COMPUTED else "The model does not fit"
    if unsure := answer.parameters["unsure"]:
        return f"The pressures can be used; the stiffness of the {' and the '.join(unsure)} is uncertain"
    if not answer.parameters["tested"]:
        return "The pressures can be used; the tissues' stiffness was given and not tested"
    return "The model fits"


_SENTENCES: Mapping[str, Callable[[Answer], str]] = {
    "diagnosis": _reported,
    "leg": _of_leg,
    "specimens": _of_specimens,
    "stocking": _of_stocking,
    "tape": _of_tape,
}
_HEADINGS: Mapping[Finding, Callable[[Answer], str]] = {
    Finding.MISFIT: lambda answer: "No.",
    Finding.SMALL_MISFIT: lambda answer: f"Good enough: the model {_misses(answer)}.",
    Finding.UNEXPLAINED: lambda answer: f"The model {_misses(answer)}, and nothing explains it.",
    Finding.HIDDEN_EFFECTS: _where_effects_hide,
    Finding.FITS: lambda answer: "Yes.",
    Finding.FITS_WITHOUT_PART: lambda answer: f"Yes, without {answer.parameters['aside']}.",
    Finding.CORRECTED_IN_PART: lambda answer: (
        f"In part: use the corrected one, which may be off by {percent(answer.parameters['may_be_off'])}."
    ),
    Finding.CORRECTED: lambda answer: "Yes, but use the corrected one.",
    Finding.CAUSES_DIFFER: lambda answer: "Only as a range.",
    Finding.PROVISIONAL: lambda answer: "Provisional: {} of {} effects weighed.".format(*answer.parameters["weighed"]),
}


def _share_of(pressures: Sequence[float], mean: float) -> str:
    """Return the range of pressures over a mean, in per cent."""
    shares = sorted(100 * p / mean for p in pressures if math.isfinite(p))
    if not shares:
        return "an unknown share"
    low, high = f"{shares[0]:.0f}", f"{shares[-1]:.0f}"
    return f"{low} %" if low == high else f"{low} to {high} %"


def span_of(limits: tuple[float, float] | None) -> str:
    """Return limits, of which there may be but one: of a class, mmHg, or of a fabric for it."""
    if limits is None:
        return "–"
    if limits[0] == 0:
        return f"{limits[1]:.3g} or less"
    return f"{limits[0]:.3g} to {limits[1]:.3g}" if math.isfinite(limits[1]) else f"{limits[0]:.3g} or more"


_BESIDE = {"within": "within", "too low": "too low for", "too high": "too high for"}
_UNSURE = "which may or may not be within"


def _sentence_at_ankle(ankle: Mapping[str, Any]) -> str:
    """Return the pressure at B beside the class, of a `legfem.stockings.details.StockingDetails.answer`."""
    of_class = f"class {ankle['class']} ({span_of(ankle['limits'])} mmHg)"
    beside = "" if ankle["limits"] is None else f", {_BESIDE.get(ankle['verdict'], _UNSURE)} {of_class}"
    low, high = ankle["ci95"]
    return f"At the ankle (B) the stocking presses with {ankle['mean']:.1f} ({low:.1f} to {high:.1f}) mmHg{beside}. "


def first_lines(tests: Sequence[str]) -> web.Headline:
    """Return a plan's heading and sentence, of the tests' names, the most informative first."""
    if tests:
        return web.Headline("sound", f"Do this test first: {tests[0]}.", [], _HEADING)
    sentence = "No test could be weighed: the leg's responses don't reach the depth."
    return web.Headline("wrong", sentence, [("What to do", "Plan a less deep test (--depth).")], _HEADING)


_HEADING = "What to test"


_CONVERSIONS: Mapping[str, Callable[[Any], Any]] = {
    "y": symbol_of,
    "n": key_of,
    "k": mpa_to_kpa,
    "m": mpa_to_mmhg,
    "c": capital,
}
_OF_ALL: Mapping[str, Callable[[Any], str]] = {
    "a": lambda names: " and ".join(names).replace("_", " "),
    "p": lambda names: " + ".join([names] if isinstance(names, str) else names).replace("-", " ").replace(".", ", "),
    "v": lambda pair: number(*pair),
}
"""Of several values together."""


class _Formatter(Formatter):
    """A formatter with the conversions of ``notices.toml``, which takes several values; numbers may be dots."""

    def __init__(self, numbers: bool = True) -> None:
        self.numbers = numbers

    def convert_field(self, value: Any, conversion: Any) -> Any:
        """Return a value under a conversion."""
        if conversion in _OF_ALL:
            return _OF_ALL[conversion](value)
        convert = _CONVERSIONS.get(conversion, lambda same: same)
        return tuple(map(convert, value)) if isinstance(value, tuple | list) else convert(value)

    def format_field(self, value: Any, format_spec: str) -> str:
        """Return a value's text."""
        each = value if isinstance(value, tuple | list) else (value,)
        if not self.numbers and any(isinstance(one, int | float) for one in each):
            return "…"
        return ", ".join(format(one, format_spec) for one in each)


NOTICES = resource("notices", dict[str, dict[str, Any]])
"""The templates by code."""


def _filled(notice: Notice) -> dict[str, Any]:
    """Return a notice's parameters, those that have clauses or names of their own in words."""
    said, given = NOTICES[notice.code], dict(notice.parameters)
    for name, values in said.get("named", {}).items():
        given[name] = values[given[name]]
    for name, template in said.get("clauses", {}).items():
        value = given[name]
        if not value:
            given[name] = said.get("without", {}).get(name, "")
        elif isinstance(value, tuple | list) and isinstance(value[0], tuple | list):
            given[name] = "; ".join(_Formatter().vformat(template, one, {}) for one in value)
        else:
            given[name] = _Formatter().vformat(template, (), {name: value})
    return given


def sentence_of(notice: Notice) -> str:
    """Return a notice as a page says it."""
    if notice.code == FitNotice.DOUBTFUL:
        return f"{DOUBTFUL}{Doubt(**notice.parameters)}"
    said, given = NOTICES[notice.code], _filled(notice)
    text = _Formatter().vformat(said.get("whole") or said["kind"] + said["rest"], (), given)
    where = f"Site {given['site']}: " if given.get("site") else f"{given['trial']}: " if "trial" in given else ""
    return f"{where}{text}"


def kind_of_notice(notice: Notice) -> str:
    """Return what notices of this kind have in common, without numbers."""
    return _Formatter(numbers=False).vformat(NOTICES[notice.code]["kind"], (), _filled(notice))


def sentences_of(fits: Sequence[Fit[Any]]) -> list[str]:
    """Return the notices of all laws' fits in words, doubts and those of the first fit before others.

    One that not all laws have is named after its law.
    """
    shared = set.intersection(*(set(one.notices) for one in fits))
    lines = [
        sentence_of(notice) if notice in shared else f"{LAW_NAMES[one.law]} law: {sentence_of(notice)}"
        for doubtful in (True, False)
        for one in fits
        for notice in one.notices
        if (notice.code == FitNotice.DOUBTFUL) == doubtful
    ]
    return list(dict.fromkeys(lines))
