"""What runs found, as rows that can be compared, and as a table of numbers for other programs."""

import io
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from legfem.app.runs import Run, read_json
from legfem.common.documents import literal
from legfem.common.errors import InputError
from legfem.common.numbers import is_determined, number
from legfem.inverse.answer import Value
from legfem.inverse.catalogue import called
from legfem.inverse.stored import StoredEstimate, StoredModel, StoredResult, read_result
from legfem.report.answers import first_lines, headline_of
from legfem.report.estimates import known_text

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
    parameters: Mapping[str, StoredEstimate] = field(default_factory=dict)
    """Estimates by key (``c10_deep``)."""
    computed: Mapping[str, StoredEstimate] = field(default_factory=dict)
    """What else was computed with them, likewise."""
    verdict: str = ""

    @property
    def c10_ends(self) -> tuple[float, float, float] | None:
        """C10 and the ends of its interval, kPa; they are C10 itself where it has none. None without C10."""
        known = self.parameters.get("c10_deep")
        if known is None or math.isnan(known.value):
            return None
        low, high = (known.value if math.isnan(end) else end for end in known.ci95)
        return known.value, low, high

    def shown(self, key: str) -> str:
        """Return a parameter with its 95 % interval; empty where it isn't known."""
        known = self.parameters.get(key)
        if known is None or math.isnan(known.value):
            return ""
        low, high = known.ci95
        if math.isnan(low) or math.isnan(high):
            return f"{number(known.value)} {known.unit}"
        ends = known.ci95 if is_determined(known.value, known.ci95) else None
        return known_text(Value(ends, known.unit, known.value, (high - low) / 4))


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
    plain = (run.folder.name, run.asked.about, run.kind, str(run.state))
    try:
        found = read_result(run.results)
    except InputError:
        # It has none yet, or a legfem of other days wrote it.
        plan = read_json(run.results / "plan.json")
        first = next(iter(plan.get("tests", ())), None)
        told = {} if first is None else {"origin": plan["origin"], "verdict": f"most telling: {first['test']}"}
        return [RunResult(*plain, **told)]
    return [
        RunResult(*plain, name, found.origin, law.parameters, law.computed, _verdict(found, law))
        for name, law in found.laws.items()
    ]


def _verdict(found: StoredResult, law: StoredModel) -> str:
    """Return a diagnosis' verdict with its causes, else how well the parameters are known and what was computed."""
    if found.verdict:
        causes = dict.fromkeys(name for one in found.answer.causes for name in one.mechanisms)
        joined = (" or " if found.verdict == "ambiguous" else ", ").join(causes)
        return f"{found.verdict}: {joined}" if causes else found.verdict
    each = [f"{called(key)} {one.identifiability}" for key, one in law.parameters.items() if one.role == "identified"]
    first = [f"{one.name} {number(one.value)} {one.unit}" for one in list(law.computed.values())[:1]]
    return ", ".join([*each, *first])


def sentence_of(run: Run) -> str:
    """Return what a run found, as its page's first lines; empty where there is none yet, or an older legfem's."""
    try:
        return headline_of(read_result(run.results).answer).said
    except InputError:
        plan = read_json(run.results / "plan.json")
        if "tests" in plan:
            return first_lines([one["test"] for one in plan["tests"]]).said
        return str(read_json(run.results / "cohort.json").get("answer", ""))


_HEADER = "run of command state law data verdict parameter value low high unit identifiability"


def numbers_of(answers: Sequence[RunResult]) -> "pd.DataFrame":
    """Return a row for every number of every result; a result without numbers has one row."""
    import pandas as pd

    rows = []
    for one in answers:
        plain = (literal(one.run), literal(one.about), one.kind, one.state, one.law, one.origin, one.verdict)
        every: Mapping[str, StoredEstimate | None] = {**one.parameters, **one.computed} or {"": None}
        for key, known in every.items():
            shown = (None,) * 5 if known is None else (known.value, *known.ci95, known.unit, known.identifiability)
            rows.append((*plain, key, *shown))
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
