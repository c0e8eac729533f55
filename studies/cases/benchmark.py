"""``python -m studies.cases benchmark``: cases of the sealed study as folders that any method can be tried on."""

from __future__ import annotations

import secrets
import shutil
from pathlib import Path
from typing import Annotated, Any

import typer

from legfem.common.command_line import study_context
from legfem.common.documents import write_document
from legfem.common.progress import progress_on
from legfem.inverse.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.folder import write_subject_folder
from studies.cases import score
from studies.cases.peers import OUTSIDE
from studies.cases.sealed import Lab
from studies.cases.sealed_case import SealedCase
from studies.cases.sealed_draw import LATERAL, RISES, THICKNESSES, channel_cases, subsets_of, truths_of
from studies.command_line import DONE_IS_KEPT, Out, Seed
from studies.making.recording import INSTRUMENT

PAGE = Path(__file__).parent / "benchmark.md"


def write_case(lab: Lab, case: SealedCase, folder: Path) -> bool:
    """Write a case as a lab would hand it over; nothing, and false, where its solution stopped."""
    programme = "holds" if case.number % 2 and "force, holds" in subsets_of(case) else "loading"
    leg = lab.subject(case, programme, (*LATERAL, *THICKNESSES, *RISES))
    if leg is None:
        return False
    given = leg.section, folder, f"case {case.number}", leg.indenter.aim, leg.indenter.direction_deg, "simulated"
    write_subject_folder(
        *given,
        leg.recordings,
        starts_at_contact=programme == "holds",
        plane_strain=True,
        instrument=INSTRUMENT,
        deep_law=case.law,
    )
    return True


def truth_of(case: SealedCase) -> dict[str, Any]:
    """Return what is true of a case, as `studies.cases.score` and the peers read it."""
    effects = list(truths_of(case)) if case.kind != "outside" else [OUTSIDE]
    own = {"effects": effects, "kind": case.kind, "code": case.code, "detail": [*case.effects, *case.outside]}
    return {**own, "true_C10_kPa": case.c10_kpa, "true_C20_kPa": case.c20_kpa}


def benchmark(
    legs: Annotated[int, typer.Option("--legs", min=1, help="Of some 21 cases each.")] = 6,
    hidden: Annotated[
        Path | None, typer.Option("--hidden", help="File for truths; the cases have their digests.")
    ] = None,
    seed: Seed = 1,
    out: Out = None,
) -> None:
    """Write cases in plain files: a folder each with CSV and TOML, their truth, a data sheet and what scores answers.

    Example: python -m studies.cases benchmark --legs 3 --out cases
    """
    with study_context("benchmark", out, 1, DONE_IS_KEPT) as (folder, _), progress_on() as progress:
        lab, truths = Lab(folder / "solves", read_correction(REFERENCE), seed), dict[str, dict[str, Any]]()
        cases = channel_cases(legs, seed)
        progress.stage("cases", len(cases))
        for case in cases:
            name = f"case-{case.number:03d}"
            if (folder / name).is_dir() or write_case(lab, case, folder / name):
                truths[name] = truth_of(case)
            progress.advance(f"{name}{'' if name in truths else ': LEFT OUT, a solution stopped'}")
        if hidden is not None:
            truths = {name: {**one, "salt": secrets.token_hex(16)} for name, one in truths.items()}
            write_document(hidden, {"cases": truths})
            truths = {name: {"sha256": score.digest(one)} for name, one in truths.items()}
        write_document(folder / "truth.json", {"cases": truths})
        for file in (Path(score.__file__), PAGE):
            shutil.copy(file, folder)
