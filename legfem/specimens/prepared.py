"""What of specimens' recordings can be modelled: every test is solved once, and the rest is left out or shortened."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from legfem.common.errors import Doubt, InputError
from legfem.common.progress import Progress
from legfem.inverse.answer import Notice
from legfem.inverse.outcome import Outcome, solve_test
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, finish
from legfem.specimens.details import SpecimenNotice, cut_short
from legfem.specimens.folder import SpecimenFolder
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.laws import REFERENCE_MPA, begin_at
from legfem.specimens.nuisances import deepest_of
from legfem.specimens.sizes import LeftOut, Sizes, SpecimenRecording, differing_doubts

_BEYOND = 1.02
# Of the depth that was reached: short of where a solution stopped.
_SHORT_OF = 0.97
_LEAST_SHARE = 0.3


@dataclass(frozen=True, eq=False)
class Prepared:
    """Recordings that can be modelled, how deep their tests are solved, and how stiff they seem."""

    recordings: tuple[SpecimenRecording, ...]
    left_out: tuple[LeftOut, ...]
    notices: tuple[Notice, ...]
    depths: Mapping[Sizes, float]
    """mm that each test is solved to."""
    c10: float
    """MPa: the middle of what each recording asks for by itself, neo-Hookean."""
    doubts: tuple[Doubt, ...]
    """About recordings beside others."""


def prepare(
    folder: SpecimenFolder, held: set[SpecimenRecording], out: Path | None, jobs: int, progress: Progress
) -> Prepared:
    """Solve every test once, and leave out or shorten what can't be modelled.

    Raises
    ------
    InputError
        If nothing that is to be fitted is left.
    """
    deepest: dict[Sizes, float] = {}
    for one in folder.recordings:
        deepest[one.sizes] = max(deepest.get(one.sizes, 0.0), _BEYOND * deepest_of(one.course))
    usual = begin_at(folder.tissues, REFERENCE_MPA)
    tissues = tuple(one.of_law("neo-hookean") for one in folder.tissues)
    models = [SpecimenForward(sizes, depth, tissues, usual) for sizes, depth in deepest.items()]
    outcomes = _solved_once(models, out, jobs, progress)
    used, left, notices = list[SpecimenRecording](), list(folder.left_out), [*cut_short(folder.recordings)]
    within = dict[Sizes, float]()
    for one in folder.recordings:
        outcome = outcomes[one.sizes]
        reached = outcome.curve.depth * (1.0 if outcome.complete else _SHORT_OF)
        within[one.sizes] = reached
        if one.course.depth <= reached:
            used.append(one)
        elif reached < _LEAST_SHARE * one.course.depth:
            reason = f"its test can't be solved beyond {reached:.3g} mm: {outcome.reason}"
            left.append(LeftOut(one.name, reason))
        else:
            used.append(one.to(reached))
            told = {"name": one.name, "used": reached, "depth": one.course.depth, "reason": outcome.reason}
            notices.append(Notice.of(SpecimenNotice.USED_IN_PART, **told))
    fitted = [one for one in used if one.name not in {other.name for other in held}]
    if not fitted:
        problem = f"none can be modelled: {left[0].reason}"
        raise InputError(folder.directory, "recordings", problem, "check the sizes, or record less deep")
    depths = dict[Sizes, float]()
    for one in used:
        needed = min(deepest_of(one.course), within[one.sizes])
        depths[one.sizes] = max(depths.get(one.sizes, 0.0), needed, one.course.depth)
    stiffness = dict[SpecimenRecording, float]()
    for one in fitted:
        course = one.course
        unit = outcomes[one.sizes].curve(course.displacement)
        stiffness[one] = usual * float(course.force @ unit / (unit @ unit))
    return Prepared(
        tuple(used),
        tuple(left),
        tuple(notices),
        depths,
        max(float(np.median(list(stiffness.values()))), 1e-9),
        tuple(differing_doubts(stiffness)),
    )


def _solved_once(
    models: Sequence[SpecimenForward], out: Path | None, jobs: int, progress: Progress
) -> dict[Sizes, Outcome]:
    store = None if out is None else Store(out / "solves", Outcome)
    with Workers(solve_test, models, jobs) as workers:
        found = finish(
            workers,
            [(k, one.nominal, ()) for k, one in enumerate(models)],
            store,
            progress,
            "solving every test once; on a machine's first run, compiling",
            lambda task, outcome: f"{type(models[task[0]].sizes).__name__} to {outcome.curve.depth:.3g} mm",
            lambda task: ("once", models[task[0]].fingerprint()),
        )
    return dict(zip((one.sizes for one in models), found, strict=True))
