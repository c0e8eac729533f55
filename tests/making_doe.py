"""A leg in closed form for the tests of the design of experiments: fast, with known effects."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
from making import write_subject
from mpi4py import MPI

from legfem.inverse.outcome import Outcome
from legfem.solve.path import ForceCurve
from legfem.study.doe.command import DoeOptions, run
from legfem.study.doe.design import PAPER, Definition, factorial_design, read_definition
from legfem.study.doe.runs import Request

TOML = PAPER.read_text().replace("training = 80", "training = 30").replace("= 20", "= 8")


@dataclass
class SpringLeg:
    """F/L = (deep C10 + fat C10 / 2) d + deep C20 d^2 (1 + fascia C10 t), in odd units."""

    calls: Path | None = None
    """A folder where every simulation leaves a file."""
    stops: tuple[tuple[str, float, float], ...] = ()
    """(parameter, value in the model's units, depth at which such a run stops)."""
    killed_after: int = 10**9

    def fingerprint(self) -> Mapping[str, Any]:
        return {"leg": "spring"}

    def solve(self, request: Request) -> Outcome:
        if self.calls is not None:
            done = len(list(self.calls.iterdir()))
            if done >= self.killed_after:
                raise KeyboardInterrupt
            name = f"{request.stage}-{request.number}-{os.getpid()}-{MPI.COMM_WORLD.rank}"
            (self.calls / name).touch()
        p = dict(request.values)
        depth, reason = request.depth, "the target is reached"
        stops = [end for name, value, end in self.stops if np.isclose(p[name], value)]
        if len(stops) == len(self.stops) and stops:
            depth, reason = min(stops), "no step above 0.001 mm converges"
        d = np.linspace(0.0, depth, int(2 * depth) + 1)
        per = {
            "deep.C10": d,
            "superficial.C10": d / 2,
            "deep.C20": d**2 * (1 + p["fascia.C10"] * p["fascia.thickness"]),
            "fascia.C10": d**2 * p["deep.C20"] * p["fascia.thickness"],
        }
        force = sum(p[name] * per[name] for name in ("deep.C10", "superficial.C10", "deep.C20"))
        exact = {name: per[name] for name in request.sensitivities}
        return Outcome(p, (ForceCurve(d, force, exact),), depth == request.depth, reason, 0, 0.0)


def definition(folder: Path, text: str = TOML) -> Path:
    path = folder / "design.toml"
    path.write_text(text)
    return path


def options(folder: Path, out: str = "out", jobs: int = 1, **more: Any) -> DoeOptions:
    """Options for a subject and a definition made in a folder."""
    if not (folder / "leg").exists():
        write_subject(folder / "leg")
        definition(folder)
    given = dict(beyond=True, seed=1) | more
    paths = given.pop("definitions", (folder / "design.toml",))
    return DoeOptions(paths, folder / "leg", folder / out, jobs, **given)


def planted_table(noise: float, seed: int = 0) -> tuple[Definition, pd.DataFrame, dict[str, float]]:
    """A table of runs whose first metric is a polynomial of 16 terms with noise."""
    rng = np.random.default_rng(seed)
    given = read_definition(PAPER)
    symbols = [f.symbol for f in given.factors]
    coded = factorial_design(5)
    terms = {"Intercept": np.ones(33)} | {s: coded[:, k] for k, s in enumerate(symbols)}
    for i in range(5):
        for j in range(i + 1, 5):
            terms[f"{symbols[i]}:{symbols[j]}"] = coded[:, i] * coded[:, j]
    truth = {name: float(value) for name, value in zip(terms, rng.normal(size=16), strict=True)}
    response = sum(truth[name] * column for name, column in terms.items())
    table = pd.DataFrame(coded, columns=pd.Index(symbols))
    table.insert(0, "run", np.arange(1, 34))
    for kind in ("curvature", "slope"):
        for window in ("0_5", "5_20", "20_30"):
            table[f"{kind}_{window}"] = response + noise * rng.standard_normal(33)
    return given, table, truth


@contextmanager
def fewer_samples() -> Iterator[None]:
    """Draw 256 samples of the emulator, in every process of a study alike."""
    with patch("legfem.study.doe.study._BASE_SAMPLES", 256):
        yield


if __name__ == "__main__":  # under mpirun
    home = Path(sys.argv[1])
    with fewer_samples():
        run(options(home, sys.argv[2]), MPI.COMM_WORLD, SpringLeg(home / "calls"))
