"""Counts and times of what legfem's solvers do within a piece of work."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from functools import wraps
from typing import Any
from unittest.mock import patch

from petsc4py import PETSc

from legfem.fem.system import System

EVENTS = {"factorisations": "MatLUFactorNum", "iterations": "SNESJacobianEval", "substitutions": "MatSolve"}
"""Of PETSc's log; SNES asks for a tangent once an iteration, whether or not it is assembled anew."""
METHODS = {"residuals": "assemble_residual", "tangents": "assemble_tangent", "solves": "reset"}
"""Of `System`; each solution along a path begins with a reset."""


@dataclass(frozen=True)
class Work:
    """What something took."""

    counts: dict[str, int]
    seconds: float
    """Of the processor."""
    shares: dict[str, float]
    """Of the time by the clock, by what is counted."""
    peak_MiB: int = 0
    factorisation_seconds: float | None = None
    """Of the processor, for one of subject 3's tangent."""


def counted[Made](job: Callable[[], Made]) -> tuple[Made, Work]:
    """Do a job and return its result and what it took; its solutions have to be done in this process."""
    PETSc.Log.begin()
    events = {name: PETSc.Log.Event(event) for name, event in EVENTS.items()}
    counts, times = dict.fromkeys(METHODS, 0), dict.fromkeys(METHODS, 0.0)

    def watched(name: str) -> Any:
        method = getattr(System, METHODS[name])

        @wraps(method)
        def call(*given: Any, **named: Any) -> Any:
            begun = time.perf_counter()
            made = method(*given, **named)
            counts[name] += 1
            times[name] += time.perf_counter() - begun
            return made

        return call

    before = {name: event.getPerfInfo() for name, event in events.items()}
    with ExitStack() as stack:
        for name, method in METHODS.items():
            stack.enter_context(patch.object(System, method, watched(name)))
        processor, clock = time.process_time(), time.perf_counter()
        made = job()
        seconds, elapsed = time.process_time() - processor, time.perf_counter() - clock
    after = {name: event.getPerfInfo() for name, event in events.items()}
    counts |= {name: after[name]["count"] - before[name]["count"] for name in events}
    times |= {name: after[name]["time"] - before[name]["time"] for name in ("factorisations", "substitutions")}
    return made, Work(counts, seconds, {name: spent / elapsed for name, spent in times.items() if name != "solves"})
