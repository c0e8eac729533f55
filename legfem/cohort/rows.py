"""What was found of each member, as rows of one table from the commands' documents; what a run would still do."""

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.util import find_spec
from operator import itemgetter
from pathlib import Path
from typing import Any, Literal, NamedTuple

import pandas as pd

from legfem.cohort.members import DESIGN, Member, Members, Task
from legfem.common.documents import Contents, literal
from legfem.common.progress import duration
from legfem.common.resources import resource
from legfem.inverse.answer import Notice
from legfem.inverse.catalogue import unit_suffix
from legfem.inverse.comparison import ErrorSource
from legfem.inverse.stored import StoredExplanation, StoredModel
from legfem.jobs.store import Store
from legfem.stockings.levels import WAYS, FabricFor


@dataclass(frozen=True)
class Measure:
    """One number with its 95 % interval; None where there is none."""

    value: float
    low: float | None
    high: float | None
    sd: float | None
    """Standard error, without what an interval allows for few repeats: over many tests its square is the variance."""
    unit: str
    verdict: str = ""
    """``identifiable``, ``weakly identifiable``, ``not identifiable``, or empty."""
    explanations: tuple[tuple[float, float, float | None, float | None], ...] = ()
    """Of a diagnosis: probability, value and interval under each; interval and value are over all."""
    alike: float = 0.0
    """Share of ``sd``**2 that all tests of a leg have alike."""


@dataclass(frozen=True)
class Curve:
    """Measured force of a leg pressed at one site."""

    displacement_mm: tuple[float, ...]
    measured_N: tuple[float | None, ...]


@dataclass(frozen=True)
class ModelResult:
    """Result under one model: a law, or a diagnosis before and after what it adds."""

    measures: Mapping[str, Measure]
    """By key, as in ``result.json``: ``c10_deep``."""
    p_value: float | None = None
    """p-value of the fit."""
    curve: Curve | None = None


@dataclass(frozen=True)
class Judged:
    """What the member's own page says first."""

    tone: str
    """Of `legfem.report.page.Tone`; empty where there is no page."""
    sentence: str
    notices: tuple[Notice, ...] = ()
    preferred: str = ""
    """Key of the model that the recordings ask for."""


@dataclass(frozen=True)
class Shape:
    """What a member's outlines say, beside the fit."""

    fat_mm: float | None = None
    """Under the indenter, or the mean around the leg."""
    girth_mm: float | None = None
    fibula: float | None = None
    """On which side of the tibia it lies, looking along the indenter's travel: positive to the right."""


@dataclass(frozen=True)
class Row:
    """One member's result, or why there is none."""

    member: str
    part: str = ""
    """Of a folder of specimens that are diagnosed one by one, which."""
    problem: str = ""
    """On one line; empty for what was done."""
    judged: Judged = Judged("", "")
    models: Mapping[str, ModelResult] = field(default_factory=dict)
    verdict: str = ""
    """Of a diagnosis."""
    origin: str = ""
    recordings: Mapping[str, str] = field(default_factory=dict)
    """Hash of each recording's numbers, by name."""
    shape: Shape = Shape()
    report: str = ""
    """Its page, as seen from the cohort's folder of results."""
    seconds: float = 0.0
    peak_mb: float = 0.0
    """Most memory of the process that did it."""
    versions: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    fabrics: tuple[FabricFor, ...] = ()
    """That meet classes, on a leg in its stocking."""

    @property
    def name(self) -> str:
        """One of its own in the cohort."""
        return f"{self.member}: {self.part}" if self.part else self.member

    @property
    def done(self) -> bool:
        """Whether there is a result."""
        return not self.problem


_ALIKE: frozenset[ErrorSource] = frozenset({"model", "misfit", "ends", "fibres", "shape", "sizes", "priors"})
"""What all tests of a leg err by alike, whatever the day: its outlines and sizes, its layers' other stiffnesses, the
model."""
NORMAL = 1.96
"""Standard errors in half a 95 % interval."""
_POINTS = 40
"""Of a curve, which is drawn small."""


def models_of(
    laws: Mapping[str, StoredModel],
    base_model: StoredModel | None = None,
    explanations: Sequence[StoredExplanation] = (),
) -> dict[str, ModelResult]:
    """Return what a result holds, by model: by law, or of a diagnosis before and after what it adds.

    Parameters
    ----------
    laws
        Fits by law.
    base_model
        Of a diagnosis.
    explanations
        Of a diagnosis; that nothing was left out isn't one, as in its own interval, where there are others.
    """
    if base_model is None:
        return {
            name: ModelResult(_measures(one), _known(one.goodness.p_value), _curve(one)) for name, one in laws.items()
        }
    (law,) = laws.values()
    after = {}
    for name, measure in _measures(law).items():
        having = [one for one in explanations if name in one.parameters and math.isfinite(one.parameters[name].value)]
        having = [one for one in having if one.mechanisms or one.unknown] or having
        under = ((one.probability, one.parameters[name]) for one in having)
        each = tuple((p, one.value, _known(one.ci95[0]), _known(one.ci95[1])) for p, one in under)
        after[name] = replace(measure, explanations=each)
    before = ModelResult(_measures(base_model), _known(base_model.p_value))
    return {"before repair": before, "after repair": ModelResult(after)}


def _known(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _measures(model: StoredModel) -> dict[str, Measure]:
    found = {}
    for name, one in {**model.parameters, **model.computed}.items():
        low, high = map(_known, one.ci95)
        sd = _known(one.standard_error)
        if sd is None and low is not None and high is not None:
            sd = (high - low) / (2 * NORMAL)
        alike = sum(share for source, share in one.share_of_squared_error.items() if source in _ALIKE)
        if math.isfinite(one.value):
            found[name] = Measure(one.value, low, high, sd, one.unit, one.identifiability, alike=min(alike, 1.0))
    return found


def _curve(model: StoredModel) -> Curve | None:
    if len(model.tests) != 1 or "displacement_mm" not in (curve := model.tests[0].curve):
        return None
    step = max(1, -(-len(curve["displacement_mm"]) // _POINTS))
    return Curve(*(tuple(curve[name][::step]) for name in ("displacement_mm", "measured_force_N")))


def cohort_model(rows: Sequence[Row]) -> str:
    """The model under which a cohort is compared: that which most recordings ask for.

    C10 of one law isn't C10 of another; legs are compared under one.
    """
    preferred = [row.judged.preferred for row in rows if row.done]
    return max(dict.fromkeys(preferred), key=preferred.count, default="")


def measured(rows: Sequence[Row], model: str) -> Iterator[tuple[Row, ModelResult]]:
    """Yield the rows that have a result under a model."""
    for row in rows:
        if row.done and model in row.models:
            yield row, row.models[model]


CSV, UNITS, WORKBOOK, PARQUET = "cohort.csv", "cohort-units.csv", "cohort.xlsx", "cohort.parquet"
STANDARD_ERROR = "standard error, without what the interval allows for few repeats,"
_COLUMNS = resource("people/columns", dict[str, tuple[str, str]])
"""Unit and meaning of those that don't hang on a model."""


def cohort_frame(members: Sequence[Member], rows: Sequence[Row]) -> pd.DataFrame:
    """Return a row a member, in the members' order; empty cells where there is nothing."""
    by_name = {one.name: one for one in members}
    entries = []
    for row in rows:
        member = by_name[row.member]
        entry: dict[str, object] = {"member": row.name, "subject": member.person, **member.given}
        entry |= {"problem": row.problem, "judgement": row.judged.tone, "verdict": row.verdict}
        warnings = len(row.judged.notices) if row.done else None
        entry |= {"model": row.judged.preferred, "warnings": warnings, "origin": row.origin}
        entry |= {"fat_thickness_mm": row.shape.fat_mm, "girth_mm": row.shape.girth_mm}
        entry |= {one.name: one.value for one in _columns(row)}
        entry |= {"seconds": row.seconds or None, "peak_MB": row.peak_mb or None, "report": row.report}
        entries.append(entry)
    frame = pd.DataFrame(entries)
    return frame.drop(columns=[name for name in frame if frame[name].isin(["", None]).all()])


class _Column(NamedTuple):
    """One number of a member, and what its column is called and means."""

    name: str
    value: object
    unit: str
    meaning: str


def _columns(row: Row) -> Iterator[_Column]:
    """Yield the columns of a member's results."""
    for model, found in row.models.items():
        under = f" under {model}" if model else ""
        chance = f"probability of so poor a fit by chance{under}"
        yield _Column(column(model, "fit_p_value"), found.p_value, "1", chance)
        for name, one in found.measures.items():
            of, suffix = f"of {name}{under}", unit_suffix(one.unit)
            for part, value, meaning in (
                ("", one.value, f"{name}{under}"),
                ("low", one.low, f"lower end of the 95 % interval {of}"),
                ("high", one.high, f"upper end of the 95 % interval {of}"),
                ("standard_error", one.sd, f"{STANDARD_ERROR} {of}"),
            ):
                yield _Column(column(model, name, part, suffix), value, one.unit, meaning)
            known = f"how well the recordings determine {name}{under}"
            yield _Column(column(model, name, "identifiability"), one.verdict, "", known)
    for fabric in row.fabrics:
        of = fabric.compression_class
        for name, (word, unit) in WAYS.items():
            for end, value in zip(("least", "greatest"), getattr(fabric, name), strict=True):
                yield _Column(f"class_{of}_{end}_{name}", value, unit, f"{end} {word} ({unit}) for class {of} at B")


def column(model: str, *parts: str) -> str:
    """Return the name of a model's column: ``neo_hookean_c10_deep_low_kPa``."""
    return "_".join(filter(None, [model.replace("-", "_").replace(" ", "_"), *parts]))


def units_frame(frame: pd.DataFrame, rows: Sequence[Row]) -> pd.DataFrame:
    """Return unit and meaning of each of a frame's columns."""
    known = _COLUMNS | {one.name: (one.unit, one.meaning) for row in rows for one in _columns(row)}
    given = {name: ("", "as in the cohort's table") for name in (*frame, *DESIGN)}
    every = given | {name: told for name, told in known.items() if name not in DESIGN}
    return pd.DataFrame([{"column": name, "unit": every[name][0], "meaning": every[name][1]} for name in frame])


def write_tables(frame: pd.DataFrame, units: pd.DataFrame, folder: Path) -> list[Path]:
    """Write the table as CSV and as a workbook, and as Parquet where pyarrow is installed; return the paths."""
    plain = frame.map(literal)
    written = [folder / CSV, folder / UNITS, folder / WORKBOOK]
    plain.to_csv(written[0], index=False)
    units.to_csv(written[1], index=False)
    with pd.ExcelWriter(written[2]) as writer:
        plain.to_excel(writer, sheet_name="cohort", index=False)
        units.to_excel(writer, sheet_name="units", index=False)
    if find_spec("pyarrow"):
        written.append(folder / PARQUET)
        frame.to_parquet(written[-1], index=False)
    return written


_CODE: Mapping[str, tuple[str, ...]] = {
    "identify": ("legfem.legs.identification", "legfem.specimens.problem", "legfem.cohort.rows"),
    "diagnose": ("legfem.legs.diagnosis", "legfem.specimens.diagnosis", "legfem.cohort.rows"),
    "stocking": ("legfem.stockings.identification", "legfem.cohort.rows"),
}
"""Modules that compute a member's numbers: with another code they are computed again."""


@dataclass(frozen=True)
class Options:
    """What is done with every member, and how."""

    task: Task
    given: Mapping[str, Any]
    """Keywords of `legfem.identify`, `legfem.diagnose` or `legfem.stocking`."""
    library: str = ""
    """Folder of responses of a diagnosis; results don't depend on it."""


@dataclass(frozen=True)
class ExpectedRun:
    """What a run would do, and what it would take."""

    members: Members
    states: tuple[Literal["known", "new", "changed", "missing"], ...]
    """Of the members: the result is there; there is none; files, options or code are others; no such folder."""
    workers: int
    seconds_each: float
    """Of one processor."""
    peak_mb: float
    """Of one process."""
    basis: str
    """Where time and memory come from."""

    @property
    def waiting(self) -> int:
        """How many members are to be done."""
        return sum(state in ("new", "changed") for state in self.states)

    def summary(self) -> str:
        """Return a line a member, and time and memory of all."""
        lines = [
            f"{state:8} {one.name}{one.problem and ': '}{one.problem}"
            for state, one in zip(self.states, self.members.every, strict=True)
        ]
        seconds = -(-self.waiting // self.workers) * self.seconds_each
        memory = min(self.workers, self.waiting) * self.peak_mb / 1000
        each = f"{self.seconds_each:.0f} s and {self.peak_mb:.0f} MB each, {self.basis}"
        todo = f"{self.waiting} of {len(self.states)} to do, {self.workers} at once"
        last = f"{todo}: about {duration(seconds)} and {memory:.1f} GB of memory ({each})"
        return "\n".join([*lines, *self.members.notes, last]) + "\n"


_TYPICAL: Mapping[str, tuple[float, float]] = {
    "identify": (25.0, 500.0),
    "diagnose": (200.0, 900.0),
    "stocking": (60.0, 900.0),
}
"""Seconds of a processor and MB of the members that come with legfem (``legfem cohort`` writes both)."""


def _files(member: Member) -> object:
    """All files of a member's folder, and those elsewhere that its TOML names."""
    named: list[str] = []
    for path in sorted(member.folder.glob("*.toml")):
        try:
            named += _texts(tomllib.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError):
            continue
    elsewhere = []
    for text in named:
        path = member.folder / text
        if (
            len(text) < 500
            and "\0" not in text
            and path.is_file()
            and not path.resolve().is_relative_to(member.folder.resolve())
        ):
            elsewhere.append(Contents(path))
    return [Contents(member.folder), elsewhere, member.problem]


def _texts(value: Any) -> list[str]:
    if isinstance(value, str):
        return [value]
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return [text for part in parts for text in _texts(part)]


class KnownRows:
    """Rows that are kept in a folder of results."""

    def __init__(self, out: Path, members: Members, options: Options) -> None:
        self.out, self.members, self.options = out, members, options
        priors = (Path(text.partition("=")[2].strip()) for text in options.given.get("prior", ()))
        depends = [options.task, options.given, [Contents(path) for path in priors if path.suffix == ".json"]]
        self._store = Store(out / "rows", list[Row], depends, _CODE[options.task], named=itemgetter("place"))
        self._asked = {one.name: {"place": one.place.replace("/", "__"), "files": _files(one)} for one in members.every}
        self.rows: dict[str, list[Row]] = {}
        for one in members.every:
            rows = [Row(one.name, problem=one.problem)] if one.problem else self._store.get(self._asked[one.name])
            # A report that was removed is written again.
            if rows is not None and all((out / row.report).is_file() for row in rows if row.report):
                self.rows[one.name] = rows

    def keep(self, name: str, rows: list[Row]) -> None:
        """Keep a member's rows."""
        self._store.put(self._asked[name], rows)

    def expected(self, workers: int) -> ExpectedRun:
        """What a run would do."""
        done = [row for rows in self.rows.values() for row in rows if row.done and row.seconds > 0]
        seconds, peak = _TYPICAL[self.options.task]
        basis = "as of legs that come with legfem"
        if done:
            seconds = sum(row.seconds for row in done) / len(done)
            peak = max(row.peak_mb for row in done)
            basis = f"as of the {len(done)} done here"
        return ExpectedRun(self.members, tuple(map(self._state, self.members.every)), workers, seconds, peak, basis)

    def _state(self, one: Member) -> Literal["known", "new", "changed", "missing"]:
        if one.problem:
            return "missing"
        if one.name in self.rows:
            return "known"
        return "changed" if self._store.path(self._asked[one.name]).is_file() else "new"
