"""Score what a method says of cases whose truth is known: ``python score.py answers.json truth.json``.

It needs NumPy and nothing of legfem. Answers have a member a case, kPa and seconds of the processor; causes are names
of `truth.json`, ``unknown`` what no name fits; ``C10_alone_kPa``, with no cause in the model, may be left out::

    {"case-000": {"C10_kPa": 0.71, "low_kPa": 0.6, "high_kPa": 0.8, "causes": [], "seconds": 80, "C10_alone_kPa": 0.9}}
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np


def digest(truth: Mapping[str, Any]) -> str:
    """Return what tells a truth that isn't given yet; its ``salt`` keeps it from being guessed."""
    return hashlib.sha256(json.dumps(truth, sort_keys=True).encode()).hexdigest()


def score(answers: Mapping[str, Mapping[str, Any]], truths: Mapping[str, Mapping[str, Any]]) -> dict[str, float]:
    """Return what answers are worth, over the cases of which the truth is given."""
    names = [name for name in answers if "true_C10_kPa" in truths.get(name, {})]
    if not names:
        return {"cases": 0}
    true = np.array([truths[name]["true_C10_kPa"] for name in names])

    def column(key: str) -> np.ndarray:
        return np.array([answers[name].get(key, np.nan) for name in names], dtype=float)

    low, high = column("low_kPa"), column("high_kPa")
    said, there = ([set(one[name][key]) for name in names] for one, key in ((answers, "causes"), (truths, "effects")))
    right = sum(len(a & b) for a, b in zip(said, there, strict=True))
    all_said, all_there = sum(map(len, said)), sum(map(len, there))
    clean = [not a for a, b in zip(said, there, strict=True) if not b]
    known = np.isfinite(column("C10_alone_kPa"))
    return {
        "cases": len(names),
        "intervals that hold C10": float(np.mean((low <= true) & (true <= high))),
        "half-width of the interval, median": float(np.median(0.5 * (high - low) / true)),
        "C10 off, median": float(np.median(np.abs(column("C10_kPa") / true - 1))),
        "bias of C10": float(np.mean(column("C10_kPa") / true - 1)),
        "bias without a cause": float(np.mean((column("C10_alone_kPa") / true - 1)[known])) if known.any() else np.nan,
        "F1 of causes": 2 * right / (all_said + all_there) if all_said + all_there else 1.0,
        "false discoveries": 1 - right / all_said if all_said else 0.0,
        "nothing said where nothing is": float(np.mean(clean)) if clean else np.nan,
        "processor (s), median": float(np.median(column("seconds"))),
    }


if __name__ == "__main__":
    given, known = (json.loads(Path(file).read_text()) for file in sys.argv[1:3])
    for what, value in score(given, known["cases"]).items():
        print(f"{what:40s} {value:.3g}")
