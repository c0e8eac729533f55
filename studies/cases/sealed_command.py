"""``python -m studies.cases sealed``: legs with concealed effects, diagnosed by several sets of channels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from legfem.common.command_line import command_context, study_context
from legfem.common.errors import InputError
from legfem.common.progress import Progress, progress_on
from legfem.inverse.correction import read_correction
from legfem.legs.correction_of_leg import REFERENCE
from legfem.legs.finite_element_models import library_folder
from studies.cases.machine import Kind
from studies.cases.sealed import Lab, Said, said_each
from studies.cases.sealed_case import SealedCase
from studies.cases.sealed_draw import SUBSETS, channel_cases
from studies.cases.sealed_page import answers_by_time, cell_of, page
from studies.cases.sealed_picture import COUNTED, counted, draw, read_counted, write_counted
from studies.command_line import DONE_IS_KEPT, Jobs, Library, Out, Seed

MODULES = ("legfem.legs.diagnosis", "legfem.report.diagnosis_headline", "studies.cases.sealed")


def _of_every_case(found: Sequence[Sequence[Said]]) -> str:
    return answers_by_time(found) + page([one for case in found for one in case if one.final])


def _libraries(lab: Lab, waiting: Sequence[SealedCase], progress: Progress) -> None:
    """Build the libraries of a leg, which its cases share."""
    for programme in dict.fromkeys(SUBSETS[name][0] for name in lab.subsets if waiting and not lab.by_time):
        lab.tabulating(waiting[0], programme, progress)


def _line(case: SealedCase, found: list[Said]) -> str:
    if not found:
        return f"{case.name}: LEFT OUT, a solution stopped"
    said = "; ".join(f"{one.subset}: {cell_of(one)} ({one.seconds:.1f} s)" for one in found)
    return f"{case.name} {found[0].concealed}, C10 {found[0].true_c10:.2f}: {said}"


KIND = Kind(
    "sealed cases",
    5,
    channel_cases,
    said_each,
    list[Said],
    _line,
    _of_every_case,
    MODULES,
    batch=lambda case: case.leg,
    prepare=_libraries,
)


def sealed(
    legs: Annotated[int, typer.Option(min=1)] = KIND.number,
    most: Annotated[int, typer.Option(min=1)] = 100,
    channels: list[str] | None = None,
    confirm: Annotated[bool, typer.Option("--confirm")] = False,
    whole: Annotated[bool, typer.Option("--whole")] = False,
    by_time: Annotated[bool, typer.Option("--by-time")] = False,
    seed: Seed = 1,
    library: Library = None,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Diagnose the same sealed recordings by force alone, with further channels, and with holds.

    Example: python -m studies.cases sealed --legs 5 --seed 1

    Parameters
    ----------
    legs
        Legs; each costs a library of responses.
    most
        Cases of each leg, of those that there are.
    channels
        What is diagnosed by, such as "force alone"; may be given again. All by default.
    confirm
        Confirm by full solutions, as `legfem diagnose` does; takes far longer.
    whole
        Solve all beforehand, not what answers rest on.
    by_time
        Record answers by force alone as time goes by, from nothing kept on.
    """
    with study_context("sealed", out, jobs, DONE_IS_KEPT) as (folder, processes), progress_on() as progress:
        if unknown := set(channels or ()) - set(SUBSETS):
            raise InputError("--channels", sorted(unknown)[0], "is not one of them", f"give {', '.join(SUBSETS)}")
        subsets = tuple(name for name in SUBSETS if not channels or name in channels)
        lab = Lab(library or library_folder(), read_correction(REFERENCE), seed, confirm, subsets, whole, by_time)
        every = channel_cases(legs, seed)
        cases = [case for leg in range(legs) for case in [one for one in every if one.leg == leg][:most]]
        found = KIND.count(cases, lab, folder, processes, progress, [seed, confirm, list(subsets), whole, by_time])
        write_counted(folder, counted([one for case in found for one in case if one.final]))


def picture(
    counts: Annotated[Path, typer.Option(help="``counted.json`` of `sealed`.")] = COUNTED,
    out: Annotated[Path, typer.Option(help="The picture, an SVG.")] = Path("docs/static/coverage.svg"),
) -> None:
    """Draw how often C10's interval held, and what was there was said first, by what was concealed.

    Example: python -m studies.cases picture
    """
    with command_context():
        draw(out, read_counted(counts))
        typer.echo(f"picture: {out}")
