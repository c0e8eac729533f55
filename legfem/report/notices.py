"""Notices in words, which stand in ``resources/notices.toml``: sentences for pages, and kinds for tables of many."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from string import Formatter
from typing import Any

from legfem.common.errors import DOUBTFUL, Doubt
from legfem.common.numbers import number
from legfem.common.resources import resource
from legfem.common.units import mpa_to_kpa, mpa_to_mmhg
from legfem.inverse.answer import FitNotice, Notice
from legfem.inverse.catalogue import key_of, symbol_of
from legfem.inverse.fit import Fit
from legfem.report.words import LAW_NAMES, capital

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


@cache
def words() -> Mapping[str, Mapping[str, Any]]:
    """Return the templates by code."""
    return resource("notices", dict[str, dict[str, Any]])


def _filled(notice: Notice) -> dict[str, Any]:
    """Return a notice's parameters, those that have clauses or names of their own in words."""
    said, given = words()[notice.code], dict(notice.parameters)
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
    said, given = words()[notice.code], _filled(notice)
    text = _Formatter().vformat(said.get("whole") or said["kind"] + said["rest"], (), given)
    where = f"Site {given['site']}: " if given.get("site") else f"{given['trial']}: " if "trial" in given else ""
    return f"{where}{text}"


def kind_of_notice(notice: Notice) -> str:
    """Return what notices of this kind have in common, without numbers."""
    return _Formatter(numbers=False).vformat(words()[notice.code]["kind"], (), _filled(notice))


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
