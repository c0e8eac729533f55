"""Notices in words: a sentence for pages, and the kind of notice for tables of many results."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from string import Formatter
from typing import Any

from legfem.common.errors import DOUBTFUL, Doubt
from legfem.common.units import mpa_to_kpa, mpa_to_mmhg
from legfem.inverse.catalogue import key_of, symbol_of
from legfem.inverse.fit import Fit
from legfem.inverse.notice import FitNotice, Notice
from legfem.report.style import LAW_NAMES
from legfem.report.words import capital


@dataclass(frozen=True)
class Words:
    """Templates of a notice's sentences.

    Fields are the notice's parameters. Conversions: ``!y`` a parameter's symbol, ``!n`` its key in documents, ``!k`` a
    stress in kPa, ``!m`` in mmHg, ``!c`` with a capital; of a tuple each, with commas between. ``!a`` joins names.
    """

    kind: str
    """The first words, which are of this kind of notice: a table of many results shows them without numbers."""
    rest: str = ""
    """What follows them in a sentence."""
    more: Callable[[Mapping[str, Any]], str] | None = None
    """What follows, where that depends on the parameters."""
    whole: str | Callable[[Mapping[str, Any]], str] = ""
    """In place of all these, where a sentence doesn't begin with its kind."""


_CONVERSIONS: Mapping[str, Callable[[Any], Any]] = {
    "y": symbol_of,
    "n": key_of,
    "k": mpa_to_kpa,
    "m": mpa_to_mmhg,
    "c": capital,
}


class _Formatter(Formatter):
    """A formatter with our conversions, which takes tuples."""

    def convert_field(self, value: Any, conversion: Any) -> Any:
        """Return a value under a conversion."""
        if conversion is None:
            return value
        if conversion == "a":
            return " and ".join(value).replace("_", " ")
        convert = _CONVERSIONS[conversion]
        return tuple(map(convert, value)) if isinstance(value, tuple | list) else convert(value)

    def format_field(self, value: Any, format_spec: str) -> str:
        """Return a value's text."""
        if isinstance(value, tuple | list):
            return ", ".join(format(one, format_spec) for one in value)
        return format(value, format_spec)


class _Numberless(_Formatter):
    """The same, with a dash of dots for each number."""

    def format_field(self, value: Any, format_spec: str) -> str:
        """Return a name's text, or dots."""
        each = value if isinstance(value, tuple | list) else (value,)
        return "…" if any(isinstance(one, int | float) for one in each) else super().format_field(value, format_spec)


def _of_stopped(given: Mapping[str, Any]) -> str:
    reach = "" if given["reach"] is None else f" of {given['reach']:g} mm"
    at = ", ".join(f"{mpa_to_kpa(one):.3g}" for one in given["C10"])
    where = "; ".join(filter(None, [f"C10 {at} kPa" if at else "", given["reason"]]))
    return f"{reach}; the search kept away from them{f' ({where})' if where else ''}."


_GENERAL: Mapping[str, Words] = {
    FitNotice.DOUBTFUL: Words("doubtful input: {field}"),
    FitNotice.UNCONVERGED: Words(
        "The search ended before it converged",
        ": the optimum may lie elsewhere. Rerun with another --seed or narrower bounds.",
    ),
    FitNotice.SOLVES_STOPPED: Words("{stopped} of {solves} full solves stopped short", more=_of_stopped),
    FitNotice.COMPROMISE: Words(
        "The model of the best fit went on only with {by}",
        ": its force may be off by some percent, over very soft fat by more. Use less of the recordings' depth, and "
        "see whether C10 stays.",
    ),
    FitNotice.AT_BOUND: Words("{name!y} stands at the {bound} bound of the search", "."),
    FitNotice.NEO_HOOKEAN_LIMIT: Words(
        "The reduced polynomial's optimum is its neo-Hookean limit",
        " (C20 = 0): these recordings show no stiffening of the deep tissue beyond it.",
    ),
    FitNotice.FAR_FROM_PRIOR: Words(
        "The recordings put {name!y} {departure:.1f} standard deviations from the centre of its prior",
        ": one of the two is wrong, or the model is.",
    ),
    FitNotice.ELASTOGRAPHY_DISAGREES: Words(
        "{higher!c} finds a higher {name!n} than {lower} does, by {departure:.1f} standard deviations",
        " ({source}: C10 {centre!k:.3g} ± {sd!k:.2g} kPa). Shear waves of 100 Hz and more meet a stiffer tissue than a "
        "slow test does: a wider sd_kPa should cover the difference, or one of the two is wrong.",
    ),
}


@cache
def _words() -> Mapping[str, Words]:
    from legfem.report.leg_notices import LEG
    from legfem.report.specimen_notices import SPECIMENS
    from legfem.report.stocking_notices import STOCKING

    return {**_GENERAL, **LEG, **SPECIMENS, **STOCKING}


def sentence_of(notice: Notice) -> str:
    """Return a notice as a page says it."""
    given, words = notice.parameters, _words()[notice.code]
    if notice.code == FitNotice.DOUBTFUL:
        return f"{DOUBTFUL}{Doubt(**given)}"
    if callable(words.whole):
        return words.whole(given)
    text = _Formatter().vformat(words.whole or words.kind + words.rest, (), given)
    site = f"Site {given['site']}: " if given.get("site") else ""
    return f"{site}{text}{words.more(given) if words.more else ''}"


def kind_of_notice(notice: Notice) -> str:
    """Return what notices of this kind have in common, without numbers."""
    return _Numberless().vformat(_words()[notice.code].kind, (), notice.parameters)


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
