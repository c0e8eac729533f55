"""Phantoms pressed ten times each, of unknown ends: whether one test's interval holds the mean of ten."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from legfem.common.progress import Progress
from legfem.inverse.catalogue import DEEP_C10, LawName
from legfem.inverse.fit import Fit
from legfem.inverse.settings import SearchRequest
from legfem.jobs.store import Store
from legfem.specimens.details import SpecimenDetails
from legfem.specimens.folder import load_specimen
from legfem.specimens.problem import fit_specimens
from studies.recordings.curves import each_in_turn
from studies.recordings.data import Phantom, phantom_kinds, read_phantoms
from studies.recordings.folders import write_phantom


@dataclass(frozen=True)
class Repeat:
    """One test by itself; C10 in kPa."""

    kind: str
    test: str
    law: LawName
    c10: float
    ci95: tuple[float, float]
    preferred: str
    """Alternative of the ends that is most probable ..."""
    bonded: float
    """... and the probability of bonded ones."""
    chi_square: float
    """Over its degrees of freedom."""


def study_repeats(
    data: Path, folders: Path, laws: Sequence[LawName], out: Path, jobs: int, progress: Progress
) -> list[Repeat]:
    """Fit every phantom's test by itself, with laws.

    Parameters
    ----------
    data
        With the public recordings.
    folders
        Into which folders of specimens are written.
    laws
        Names.
    out
        For solves that are kept.
    jobs
        Processes.
    progress
        Advanced by every test.
    """
    store = Store(out / "tests", list[Repeat], laws, ["studies.recordings.repeats"])
    phantoms = [(kind, one) for kind in phantom_kinds(data) for one in read_phantoms(data, kind)]
    progress.stage("phantoms, each by itself", len(phantoms))
    work = partial(_studied, folders=folders, laws=laws, out=out, store=store)
    found = list[Repeat]()
    for rows in each_in_turn(work, phantoms, jobs):
        found += rows
        progress.advance(rows[0].test)
    return found


def _studied(
    given: tuple[str, Phantom], folders: Path, laws: Sequence[LawName], out: Path, store: Store[list[Repeat]]
) -> list[Repeat]:
    kind, phantom = given
    name = phantom.recording.trial

    def fitted() -> list[Repeat]:
        folder = load_specimen(write_phantom([phantom], folders / name, "unknown"))
        return [_row(kind, name, fit) for fit in fit_specimens(folder, laws, request=SearchRequest(out=out / name))]

    return store.get_or_make(name, fitted)


def _row(kind: str, name: str, fit: Fit[SpecimenDetails]) -> Repeat:
    c10, every = fit.estimates[DEEP_C10].shown, fit.details.alternatives
    bonded = sum(one.probability for one in every if one.name == "bonded")
    chi_square = fit.goodness.chi_square / fit.goodness.degrees_of_freedom
    return Repeat(kind, name, fit.law, c10.value, c10.ci95, every[0].name, bonded, chi_square)


def repeats_table(rows: Sequence[Repeat]) -> list[str]:
    """Return a line a kind and law, and one of all."""
    lines = []
    groups = dict.fromkeys((row.law, row.kind) for row in rows)
    held = dict.fromkeys((law for law, _ in groups), 0)
    for law, kind in groups:
        own = [row for row in rows if (row.law, row.kind) == (law, kind)]
        c10 = np.array([row.c10 for row in own])
        inside = sum(row.ci95[0] <= c10.mean() <= row.ci95[1] for row in own)
        held[law] += inside
        half = np.median([0.5 * (row.ci95[1] - row.ci95[0]) / row.c10 for row in own])
        bonded = np.array([row.bonded for row in own])
        lines.append(
            f"{law}, {kind}: C10 {c10.mean():.4g} kPa, sd {100 * np.std(c10, ddof=1) / c10.mean():.2g} %, half an "
            f"interval {100 * half:.2g} %, {inside} of {len(own)} hold the mean; bonded preferred in "
            f"{sum(row.preferred == 'bonded' for row in own)}, probability {np.median(bonded):.3f} (least "
            f"{bonded.min():.3f}); chi-square over degrees of freedom {np.median([row.chi_square for row in own]):.3g}"
        )
    for law, number in held.items():
        whole = sum(row.law == law for row in rows)
        lines.append(f"{law}: {number} of {whole} intervals hold the mean of their kind")
    return lines
