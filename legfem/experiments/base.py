"""What every experiment is: values and a protocol in, a curve with its derivatives out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Protocol

from legfem.jobs.key import code_fingerprint, key_of
from legfem.solve.force_curve import ForceCurve
from legfem.solve.path import Path
from legfem.solve.report import SolveReport

ELSEWHERE = ("comm", "meshed")
"""Fields of an experiment that change no result."""


class Reported(Protocol):
    """An outcome that says how far it came."""

    @property
    def report(self) -> SolveReport:
        """``report.complete`` tells whether it got there; giving up is a value."""


class Experiment[Load, Outcome: Reported](Protocol):
    """A test of a body: numbers and a load in, an outcome out.

    The load is a `legfem.solve.protocol.Protocol` where an indenter moves, and a pressure where one
    acts on the skin. An experiment is picklable: its finite-element model is made when it is first
    needed, in whichever process.
    """

    @property
    def parameters(self) -> Mapping[str, float]:
        """Every number of the model by full name, at the value it has unless another is given."""

    def solve(self, values: Mapping[str, float] | None, load: Load, sensitivities: Sequence[str] = (), /) -> Outcome:
        """Solve.

        Parameters
        ----------
        values
            Numbers that differ from `parameters`, by full name.
        load
            What is done to the body.
        sensitivities
            Full names of parameters to differentiate by.
        """

    def fingerprint(self) -> Mapping[str, Any]:
        """Return all that an outcome depends on but what `solve` is given, as JSON types."""


@dataclass(frozen=True, eq=False)
class Solved:
    """The outcome of one simulated test; ``report.complete`` tells whether it got there."""

    parameters: Mapping[str, float]
    """Of the model, by full name (MPa, 1/MPa)."""
    curve: ForceCurve
    """Force (N) on the whole indenter against displacement, in the first loading."""
    path: Path
    """All steps: holds, unloading and reloading too."""
    report: SolveReport


class made_when_needed[T](cached_property[T]):  # noqa: N801
    """A property made on first use, which stays behind when its object goes to another process."""


class Homebound:
    """A dataclass of which what is `made_when_needed` can't leave its process."""

    def __getstate__(self) -> dict[str, Any]:
        """Leave what can be made again."""
        kinds = (vars(kind).items() for kind in type(self).__mro__)
        made = {n for kind in kinds for n, value in kind if isinstance(value, made_when_needed)}
        return {name: value for name, value in self.__dict__.items() if name not in made}

    def fingerprint(self) -> Mapping[str, Any]:
        """Return the hash of all fields that change a result, and that of the code."""
        given: Any = self
        made_from = [f.name for f in fields(given) if f.init and f.name not in ELSEWHERE]
        return {
            "experiment": type(self).__qualname__,
            "given": key_of({name: getattr(self, name) for name in made_from}),
            "code": code_fingerprint(type(self).__module__),
        }
