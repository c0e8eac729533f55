"""What runs found, as rows that can be compared."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from legfem.app.runs import Run
from legfem.common.units import kpa_to_mpa, mpa_to_mmhg
from legfem.report.words import number


@dataclass(frozen=True)
class Found:
    """One result of one run; a run of two laws has two."""

    run: str
    """Its name."""
    about: str
    """What was looked at."""
    kind: str
    """The command."""
    state: str
    law: str = ""
    origin: str = ""
    c10: str = ""
    """Of the muscle, or a specimen, with its 95 % interval."""
    c20: str = ""
    fat: str = ""
    """C10 of the fat."""
    verdict: str = ""


def found_by(run: Run) -> list[Found]:
    """Return a run's results; one row that says how far it is where it has none."""
    plain = (run.folder.name, run.about, run.kind, str(run.state))
    rows = []
    for name, rows_of in _ROWS.items():
        try:
            content = json.loads((run.results / name).read_text(encoding="utf-8"))
            rows += [Found(*plain, **row) for row in rows_of(content)]
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            # It has none yet, or a legfem of other days wrote it.
            continue
    return rows or [Found(*plain)]


def sentence_of(run: Run) -> str:
    """Return what a run found in a sentence; empty where it found nothing yet."""
    found = [one for one in found_by(run) if one.verdict]
    return "; ".join(
        ", ".join(part for part in (one.law, f"C10 {one.c10}" if one.c10 else "", one.verdict) if part) for one in found
    )


def _identified(document: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    if "stiffness" in document:
        yield from _in_stocking(document)
        return
    for law, found in document["laws"].items():
        known = found["parameters"]
        yield {
            "law": law,
            "origin": document["origin"],
            "c10": _number(known.get("c10_deep")),
            "c20": _number(known.get("c20_deep")),
            "fat": _number(known.get("c10_superficial")),
            "verdict": found["identifiability"],
        }


def _in_stocking(document: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    stiffness = document["stiffness"]
    found = {name: entry["identified"] or {} for name, entry in stiffness.items()}
    verdicts = sorted({one["identifiability"] for one in found.values() if one})
    pressures = document["pressures"]
    if pressures is not None:
        mean = mpa_to_mmhg(kpa_to_mpa(pressures["mean_interface_kPa"]))
        verdicts.append(f"pressure on the skin {mean:.0f} mmHg on average")
    deep = next((one for name, one in found.items() if "deep" in name), {})
    fat = next((one for name, one in found.items() if "superficial" in name), {})
    yield {"origin": document["origin"], "c10": _number(deep), "fat": _number(fat), "verdict": ", ".join(verdicts)}


def _diagnosed(document: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    known = document["parameters_after"]
    named = [entry["name"] for entry in document["physics"]]
    verdict = document["verdict"]
    if named:
        verdict += ": " + (" or " if verdict == "ambiguous" else ", ").join(dict.fromkeys(named))
    yield {
        "law": document["law"],
        "origin": document["origin"],
        "c10": _number(known.get("c10_deep")),
        "c20": _number(known.get("c20_deep")),
        "verdict": verdict,
    }


def _planned(document: Mapping[str, Any]) -> Iterator[dict[str, str]]:
    best = document["tests"][0]
    yield {"origin": document["origin"], "verdict": f"most telling: {best['test']}"}


_ROWS = {"result.json": _identified, "diagnosis.json": _diagnosed, "plan.json": _planned}


def _number(known: Mapping[str, Any] | None) -> str:
    if not known or known.get("value") is None:
        return ""
    ends = known.get("ci95") or ()
    if not ends or None in ends:
        return f"{known['value']:.3g} {known['unit']}"
    low, high = ends
    value, low, high = (number(one, (high - low) / 4) for one in (known["value"], low, high))
    return f"{value} ({low} to {high}) {known['unit']}"


def files_of_results(folder: Path) -> list[Path]:
    """Return the files that people open, pages first; not the kept solutions."""
    there = [path for path in folder.glob("*") if path.is_file() and path.name[0] != "."]
    return sorted(there, key=lambda path: (path.suffix not in (".html", ".txt"), path.name))
