"""What an identification is asked for, and how it is to be done."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from legfem.common.progress import Progress, Silent
from legfem.identify.catalogue import Values
from legfem.identify.forward import ForwardOutcome, PreparedModel
from legfem.identify.laws import IdentifiedLaw, LawName
from legfem.identify.settings import IdentificationSettings
from legfem.identify.solver import FullSolver
from legfem.inference.parameter import Parameter
from legfem.jobs.store import Store

_ALWAYS_BY = ("deep.C10", "deep.C20", "superficial.C10", "fascia.C10")
"""What every solve differentiates the force by: the back-substitutions cost next to nothing."""


@dataclass(frozen=True)
class SearchRequest:
    """What is to be identified, and with what means.

    Parameters
    ----------
    parameters : sequence of Parameter, optional
        What to identify, or with the role "nuisance" only to let err, in the model's units; of
        these a law takes what it has. C10 and C20 of the deep tissue without them;
        `legfem.identify.catalogue.parameter_of` makes one with bounds that suit legs.
    fixed : Mapping[str, float]
        Values that are held, in place of those that the folder gives.
    depth : float, optional
        Greatest displacement to use, mm.
    settings : IdentificationSettings
        Of the search.
    out : Path, optional
        Folder in whose ``solves`` every full solve is kept; none is without it.
    jobs : int
        Processes.
    progress : Progress
        Told of every full solve.
    """

    parameters: Sequence[Parameter] | None = None
    fixed: Values = field(default_factory=dict)
    depth: float | None = None
    settings: IdentificationSettings = field(default_factory=IdentificationSettings)
    out: Path | None = None
    jobs: int = 1
    progress: Progress = field(default_factory=Silent)

    def solver(self, model: PreparedModel, laws: Mapping[LawName, IdentifiedLaw]) -> FullSolver:
        """Return what solves a model, to be entered; the model is meshed and compiled here.

        That compiles once for all processes, and finds what can't be meshed before files are made.
        """
        solver = FullSolver(model, None, self.jobs, self.progress, sensitivities_of(laws))
        kept = None if self.out is None else self.out / "solves"
        if kept is None or not kept.exists():
            solver.start(_prepare, most=len(laws) - 1)
        self.progress.stage("meshing; on a machine's first run, compiling forms (some 20 s)")
        try:
            model.prepare()
        except BaseException:
            solver.__exit__(*sys.exc_info())
            raise
        if kept is not None:
            solver.store = Store(kept, ForwardOutcome, model.fingerprint())
        return solver


def _prepare(model: PreparedModel) -> None:
    model.prepare()


def sensitivities_of(laws: Mapping[LawName, IdentifiedLaw]) -> tuple[str, ...]:
    """Return the model's parameters that solves differentiate the force by."""
    free = (law.names[k] for law in laws.values() for k in law.of_model)
    return tuple(dict.fromkeys((*_ALWAYS_BY, *free)))
