"""What the diagnosis said of drawn recordings: in a line, and in a study's folder."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from legfem.common.documents import json_types, write_atomically, write_document


def said_line(task: str, verdict: str, models: Sequence[Sequence[str]], seconds: float) -> str:
    """Return a line for progress: the verdict with its explanations, and the processor's s."""
    said = verdict + "".join(" " + "+".join(names) for names in models)
    return f"{task}: {said} ({seconds:.0f} s)"


def written(out: Path, seed: int, outcomes: Sequence[Any], page: str) -> list[str]:
    """Write outcomes (dataclasses) and their page; return lines for the terminal."""
    path = write_document(
        out / "result.json",
        {
            "schema": 1,
            "origin": "simulated",
            "seed": seed,
            "recordings": [json_types(asdict(outcome)) for outcome in outcomes],
        },
    )
    write_atomically(out / "report.md", page)
    return [page, f"result: {path}"]
