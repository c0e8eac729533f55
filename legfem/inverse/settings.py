"""What an identification is asked for, and how it is to be done."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from legfem.common.progress import Progress, Silent
from legfem.inverse.catalogue import Values
from legfem.inverse.laws import IdentifiedLaw, LawName
from legfem.inverse.minimiser import Genetic, Minimiser
from legfem.inverse.outcome import Forward, FullSolver, Outcome
from legfem.inverse.parameter import Parameter
from legfem.jobs.store import Store

Weighting = Literal["paper", "covariance"]


@dataclass(frozen=True)
class IdentificationSettings:
    """Of one identification.

    Parameters
    ----------
    weighting : {"paper", "covariance"}, optional
        What is minimised: the plain sum of squares (Eq. 12), or the sum weighted with the inverse
        covariance of the measured curve, against which alone a prior can be weighed. Without it
        the latter where there is a prior, else the former.
    seed : int
        Of the search.
    emulator : bool
        False lets the search call the forward model at every evaluation.
    most_solves : int
        Full solves after which a search with an emulator ends unconverged.
    minimiser, plain_minimiser : Minimiser
        The search, with and without an emulator; see `legfem.inverse.minimiser`.
    """

    weighting: Weighting | None = None
    seed: int = 1
    emulator: bool = True
    most_solves: int = 25
    minimiser: Minimiser = field(default_factory=Genetic)
    plain_minimiser: Minimiser = field(default_factory=lambda: Genetic(population=12, generations=25))


@dataclass(frozen=True)
class SearchRequest:
    """What is to be identified, and with what means.

    Parameters
    ----------
    parameters : sequence of Parameter, optional
        What to identify, or with the role "nuisance" only to let err, in the model's units; of
        these a law takes what it has. C10 and C20 of the deep tissue without them;
        `legfem.inverse.catalogue.parameter_of` makes one with bounds that suit legs.
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

    def solver(self, model: Forward, sensitivities: tuple[str, ...], laws: int = 1) -> FullSolver:
        """Make what solves a model, to be entered; the model is meshed and compiled here.

        That compiles once for all processes, and finds what can't be meshed before files are made.

        Parameters
        ----------
        model
            Of all tests.
        sensitivities
            Full names of the model's parameters that solves are differentiated by.
        laws
            Number of laws that are searched for side by side.
        """
        solver = FullSolver(model, None, self.jobs, self.progress, sensitivities)
        kept = None if self.out is None else self.out / "solves"
        if kept is None or not kept.exists():
            solver.start(_prepare, most=laws - 1)
        self.progress.stage("meshing; on a machine's first run, compiling forms (some 20 s)")
        try:
            model.prepare()
        except BaseException:
            solver.__exit__(*sys.exc_info())
            raise
        if kept is not None:
            solver.store = Store(kept, Outcome, model.fingerprint())
        return solver


def _prepare(model: Forward) -> None:
    model.prepare()


def free_of_model(laws: Mapping[LawName, IdentifiedLaw]) -> tuple[str, ...]:
    """Full names of the model's parameters, not the instrument's, that are free in any of the laws."""
    return tuple(dict.fromkeys(law.names[k] for law in laws.values() for k in law.of_model))
