"""Planted legs, identified by both models: one, and many drawn at random."""

from __future__ import annotations

import gc
import shutil
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from legfem.common.progress import Progress
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, LawName
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.fit import Fit
from legfem.inverse.settings import SearchRequest
from legfem.jobs.store import Store
from legfem.legs.correction_of_leg import correction_of
from legfem.legs.details import LegDetails
from legfem.legs.identification import as_leg, fit_leg
from legfem.legs.loading import load_subject
from legfem.legs.model_3d import SOLVES, LegModels
from legfem.legs.problem import section_forward
from studies.cases.outcomes import Interval
from studies.leg3d.planted import Planted


def identified(planted: Planted, seed: int, folder: Path, progress: Progress) -> dict[str, Fit[LegDetails]]:
    """Return what both models find of a planted leg, and the section without a correction.

    Everything solved is kept: the same call goes on where it was stopped.
    """
    place = folder / f"{planted.name}-{seed}"
    shutil.rmtree(place, ignore_errors=True)
    subject = load_subject(planted.written(place, seed, folder / "planted"))
    law: LawName = "reduced-polynomial" if planted.c20 else "neo-hookean"
    solves = folder / "solves" / place.name
    request = SearchRequest(out=solves, progress=progress)
    section = section_forward(as_leg(subject), request)
    leg = LegModels.of_subject(subject, section.models[0].depth, solves / SOLVES, progress=progress)

    def found(table: TabulatedCorrection | None, leg: LegModels | None) -> Fit[LegDetails]:
        (result,) = fit_leg(subject, [law], request, [table], section, leg)
        return result

    table = correction_of(subject)
    return {
        "3d": found(None, leg),
        "2d, the table's nearest leg": found(table, None),
        "2d, no correction": found(None, None),
    }


SOFTEST, STIFFEST = 0.5, 3.0
"""C10, kPa."""
GREATEST_RATIO = 1.0
"""C20 over C10, in every other plant."""


@dataclass(frozen=True)
class PlantResult:
    """What both models found of one plant."""

    c10: dict[str, Interval]
    """By model."""
    c20: dict[str, Interval]
    """Likewise; none of a neo-Hookean plant."""
    full_solves: int
    """In 3D."""
    processor_s: float
    """Of this process, the truth and both models together."""


def drawn(number: int, seed: int) -> Planted:
    """Return a plant by its number, from 0: C10 even in its logarithm, C20 in every other one."""
    generator = np.random.default_rng([seed, number])
    c10 = float(np.exp(generator.uniform(np.log(SOFTEST), np.log(STIFFEST))))
    ratio = float(generator.uniform(0.1, GREATEST_RATIO))
    return Planted(round(c10, 3), round(c10 * ratio, 3) if number % 2 else 0.0)


def plant_result(planted: Planted, seed: int, folder: Path, progress: Progress) -> PlantResult:
    """Return what is found of a plant; it is kept in a folder."""

    def made() -> PlantResult:
        started = time.process_time()
        results = identified(planted, seed, folder, progress)
        evidence = results["3d"].details.spatial
        assert evidence is not None
        c20 = results if planted.c20 else {}
        found = PlantResult(
            {name: Interval.of(one.estimates[DEEP_C10]) for name, one in results.items()},
            {name: Interval.of(one.estimates[DEEP_C20]) for name, one in c20.items()},
            evidence.full_solves,
            time.process_time() - started,
        )
        del results, evidence, c20
        # A gigabyte of factors a leg waits in cycles of references.
        gc.collect()
        return found

    return Store(folder / "plants", PlantResult, modules=(__name__,)).get_or_make((planted, seed), made)


def plant_row(number: int, planted: Planted, result: PlantResult) -> list[str]:
    """Return a row of a table."""
    c10, c20 = result.c10, result.c20
    told = [f"{number}", f"{planted.c10:g}", f"{planted.c20:g}", _told(c10["3d"], planted.c10)]
    told.append(_told(c20["3d"], planted.c20) if c20 else "")
    flat = [one for name, one in c10.items() if name != "3d"]
    told += [f"{100 * (one.value / planted.c10 - 1):+.0f} %" for one in flat]
    return [*told, f"{result.full_solves}", f"{result.processor_s:.0f}"]


_FOUND = ["C10 by `3d`", "C20 by `3d`", "C10 by `2d`, the table", "by `2d`, none"]
HEADER = ["plant", "C10 (kPa)", "C20", *_FOUND, "full 3D solves", "processor s"]


def counted(plants: list[Planted], results: list[PlantResult]) -> str:
    """Return how many truths the intervals of `--model 3d` hold, in words."""
    c10 = sum(r.c10["3d"].covers(p.c10) for p, r in zip(plants, results, strict=True))
    both = [(p, r) for p, r in zip(plants, results, strict=True) if r.c20]
    c20 = sum(r.c20["3d"].covers(p.c20) for p, r in both)
    return f"C10 in its interval in {c10} of {len(plants)}, C20 in {c20} of {len(both)}."


def _told(one: Interval, truth: float) -> str:
    mark = "" if one.covers(truth) else ", missed"
    return f"{one.value:.3f} ({one.low:.3f} to {one.high:.3f}){mark}"
