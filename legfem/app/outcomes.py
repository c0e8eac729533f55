"""What runs found, as rows that can be compared, and as a table of numbers for other programs."""

import io
import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legfem.app.runs import Run
from legfem.common.documents import literal
from legfem.inverse.answer import Answer
from legfem.report.answers import headline_of
from legfem.report.plan import first_lines
from legfem.report.words import number

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class RunResult:
    """One result of one run; a run of two laws has two."""

    run: str
    """Name of the run."""
    about: str
    """Name of the input."""
    kind: str
    """Name of the command."""
    state: str
    law: str = ""
    origin: str = ""
    parameters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """Estimates as documents have them, by key (``c10_deep``)."""
    computed: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """What else was computed with them, likewise."""
    verdict: str = ""

    @property
    def c10(self) -> str:
        """C10 of the muscle, or of a specimen, with its 95 % interval."""
        return self._number("c10_deep")

    @property
    def c20(self) -> str:
        """C20 of the same."""
        return self._number("c20_deep")

    @property
    def fat(self) -> str:
        """C10 of the fat."""
        return self._number("c10_superficial")

    @property
    def c10_ends(self) -> tuple[float, float, float] | None:
        """C10 and the ends of its interval, kPa; they are C10 itself where it has none. None without C10."""
        known = self.parameters.get("c10_deep", {})
        if known.get("value") is None:
            return None
        low, high = known.get("ci95") or (None, None)
        value = float(known["value"])
        return value, value if low is None else float(low), value if high is None else float(high)

    def _number(self, key: str) -> str:
        known = self.parameters.get(key, {})
        if known.get("value") is None:
            return ""
        ends = known.get("ci95") or ()
        if not ends or None in ends:
            return f"{known['value']:.3g} {known['unit']}"
        low, high = ends
        value, low, high = (number(one, (high - low) / 4) for one in (known["value"], low, high))
        return f"{value} ({low} to {high}) {known['unit']}"


def relative_difference(one: tuple[float, float, float], other: tuple[float, float, float]) -> str:
    """Return by how much a number differs from another, with the interval of two independent errors.

    Each is the number and the ends of its 95 % interval, whose logarithm's error is taken to be normal.
    """
    if one == other:
        return "–"
    ratio = one[0] / other[0]
    if min(*one, *other) <= 0:
        return f"{100 * (ratio - 1):+.0f} %"
    half = math.hypot(*(math.log(high / low) / 2 for _, low, high in (one, other)))
    low, high = (100 * (ratio * math.exp(sign * half) - 1) for sign in (-1, 1))
    return f"{100 * (ratio - 1):+.0f} % ({low:+.0f} to {high:+.0f} %)"


def answers_of(run: Run) -> list[RunResult]:
    """Return a run's results; one that says how far it is where it has none."""
    plain = (run.folder.name, run.about, run.kind, str(run.state))
    found = []
    for name, read in _READ.items():
        try:
            content = json.loads((run.results / name).read_text(encoding="utf-8"))
            found += [RunResult(*plain, **read(one)) for one in _by_law(content)]
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            # It has none yet, or a legfem of other days wrote it.
            continue
    return found or [RunResult(*plain)]


def sentence_of(run: Run) -> str:
    """Return what a run found, as its page's first lines; empty where there is none yet, or an older legfem's."""
    for name, said in _SAID.items():
        try:
            return said(json.loads((run.results / name).read_text(encoding="utf-8")))
        except (OSError, ValueError, LookupError, TypeError):
            continue
    return ""


_SAID: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "result.json": lambda document: headline_of(Answer.read(document["answer"])).said,
    "diagnosis.json": lambda document: headline_of(Answer.read(document["answer"])).said,
    "plan.json": lambda document: first_lines([one["test"] for one in document["tests"]]).said,
    "cohort.json": lambda document: document["answer"],
}


def _by_law(content: Mapping[str, Any]) -> Iterator[Mapping[str, Any]]:
    """Yield one law after another, each with what the document says of all; the document itself where it has one."""
    for own in content.get("laws", {"": {}}).values():
        yield {**content, **own}


def _identified(document: Mapping[str, Any]) -> dict[str, Any]:
    known, computed = document["parameters"], document.get("computed", {})
    verdicts = [document.get("identifiability") or known.get("c10_deep", {}).get("identifiability", "")]
    verdicts += [f"{one['name']} {one['value']:.0f} {one['unit']}" for one in list(computed.values())[:1]]
    return {
        "law": document["law"],
        "origin": document["origin"],
        "parameters": known,
        "computed": computed,
        "verdict": ", ".join(filter(None, verdicts)),
    }


def _diagnosed(document: Mapping[str, Any]) -> dict[str, Any]:
    named = [entry["name"] for entry in document["physics"]]
    verdict = document["verdict"]
    if named:
        verdict += ": " + (" or " if verdict == "ambiguous" else ", ").join(dict.fromkeys(named))
    known = document["parameters"]
    return {"law": document["law"], "origin": document["origin"], "parameters": known, "verdict": verdict}


def _planned(document: Mapping[str, Any]) -> dict[str, Any]:
    return {"origin": document["origin"], "verdict": f"most telling: {document['tests'][0]['test']}"}


_READ = {"result.json": _identified, "diagnosis.json": _diagnosed, "plan.json": _planned}


_HEADER = "run of command state law data verdict parameter value low high unit identifiability"


def numbers_of(answers: Sequence[RunResult]) -> "pd.DataFrame":
    """Return a row for every number of every result; a result without numbers has one row."""
    import pandas as pd

    rows = []
    for one in answers:
        plain = (literal(one.run), literal(one.about), one.kind, one.state, one.law, one.origin, one.verdict)
        for key, known in ({**one.parameters, **one.computed} or {"": {}}).items():
            low, high = known.get("ci95") or (None, None)
            rows.append((*plain, key, known.get("value"), low, high, known.get("unit"), known.get("identifiability")))
    return pd.DataFrame(rows, columns=_HEADER.split())


def as_csv(answers: Sequence[RunResult]) -> bytes:
    """Return the numbers as CSV, with a mark by which spreadsheets know its UTF-8."""
    return numbers_of(answers).to_csv(index=False).encode("utf-8-sig")


def as_xlsx(answers: Sequence[RunResult]) -> bytes:
    """Return the numbers as a workbook."""
    content = io.BytesIO()
    numbers_of(answers).to_excel(content, index=False)
    return content.getvalue()


def files_of_results(folder: Path) -> list[Path]:
    """Return the files that people open, pages first; not the kept solutions."""
    there = [path for path in folder.glob("*") if path.is_file() and path.name[0] != "."]
    return sorted(there, key=lambda path: (path.suffix not in (".html", ".txt"), path.name))
