"""Doubtful input: possible but unlikely values, which are named on top of every result that rests on them."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from os import PathLike

from legfem.common.errors import InputError

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Doubt:
    """Something unlikely; the same four words as an `InputError`.

    Parameters
    ----------
    source : str
        File at fault.
    field : str
        Key, column or part at fault.
    problem : str
        What is unlikely.
    remedy : str
        What to check, and how to mend it.
    """

    source: str
    field: str
    problem: str
    remedy: str

    def __str__(self) -> str:
        """Return ``file: field: what is unlikely; remedy`` on one line."""
        return str(self.error())

    def error(self) -> InputError:
        """Return the same as an error, for values that are impossible."""
        return InputError(self.source, self.field, self.problem, self.remedy)


@dataclass(frozen=True)
class PhysicalRange:
    """Where a quantity of a leg or a test lies.

    Parameters
    ----------
    what : str
        The quantity, in words.
    unit : str
        Unit of all the numbers.
    usual : tuple of float
        Beyond which a value is doubted.
    possible : tuple of float
        Beyond which it is refused.
    basis : str
        Where the usual range comes from.
    units : mapping of str to float
        Units that are taken for the right one, and what a value in one has to be multiplied by.
    """

    what: str
    unit: str
    usual: tuple[float, float]
    possible: tuple[float, float]
    basis: str
    units: Mapping[str, float] = field(default_factory=dict)

    def doubts(self, source: str | PathLike[str], name: str, value: float, remedy: str = "") -> Iterator[Doubt]:
        """Yield a doubt if a value is unlikely.

        Raises
        ------
        InputError
            If it can't be.
        """
        for found in self.likely(source, name, value, remedy):
            if not self.possible[0] <= value <= self.possible[1]:
                raise found.error()
            yield found

    def likely(self, source: str | PathLike[str], name: str, value: float, remedy: str = "") -> Iterator[Doubt]:
        """Yield a doubt if a value is unlikely, however impossible it is."""
        low, high = self.usual
        if low <= value <= high:
            return
        unit = f" {self.unit}" if self.unit else ""
        problem = f"{self.what} of {value:.4g}{unit} where {low:g} to {high:g} is usual ({self.basis})"
        mend = [
            f"if the value is in {other}, multiply it by {factor:g}"
            for other, factor in self.units.items()
            if low <= value * factor <= high
        ]
        mended = " or ".join([*mend[:1], remedy] if remedy else mend[:1])
        yield Doubt(str(source), name, problem, mended or _CHECK)


_CHECK = "check value and unit"


def log_doubts(doubts: Iterable[Doubt]) -> None:
    """Log doubts, which the commands show at once."""
    for doubt in doubts:
        _log.warning("warning: %s", doubt)


def doubt_documents(doubts: Iterable[Doubt]) -> list[dict[str, str]]:
    """Return doubts as JSON types."""
    return [asdict(doubt) for doubt in doubts]


def doubt_lines(doubts: Iterable[Doubt]) -> list[str]:
    """Return doubts as lines for the top of a report."""
    return [f"DOUBTFUL INPUT: {doubt}" for doubt in doubts]
