"""Equilibria of a leg and its stocking on disk: a run that was stopped goes on from there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.common.units import FloatArray
from legfem.experiments.compression import Compressed
from legfem.jobs.store import Store
from legfem.solve.report import SolveReport
from legfem.stocking.leg_model import LegModel3D

_LARGEST = 2_000_000
"""Numbers of a state on a rank, beyond which it isn't kept: a file would have some 40 MB."""


@dataclass(frozen=True)
class AskedEquilibrium:
    """What an equilibrium depends on beside the leg, the stocking and their settings."""

    parameters: Mapping[str, float]
    sensitivities: Sequence[str]
    error: FloatArray | float


@dataclass(frozen=True, eq=False)
class KeptEquilibrium:
    """A state, the pressure it was found with, and the changes on the way there."""

    state: Compressed
    pressure: FloatArray
    changes: tuple[float, ...]
    converged: bool


class KeptEquilibria:
    """Equilibria by what was asked for; every rank keeps its part.

    Parameters
    ----------
    folder
        Where they are kept.
    model
        The leg.
    depends_on
        What they depend on beside the leg.
    """

    def __init__(self, folder: Path, model: LegModel3D, depends_on: object) -> None:
        self._comm = model.comm
        leg = (model.shape, model.tissues, model.mesh, model.settings)
        part = (self._comm.rank, self._comm.size)
        self._store = Store(folder, dict[str, FloatArray], (leg, part, depends_on), ("legfem.stocking.worn",))

    def get(self, asked: AskedEquilibrium) -> KeptEquilibrium | None:
        """Return an equilibrium; None where a rank has no part of it. All ranks call."""
        kept = self._store.get(asked)
        if not self._comm.allreduce(kept is not None, MPI.LAND):
            return None
        assert kept is not None
        report = SolveReport(1.0, 1.0, True, "kept from before", unknowns=len(kept["unknown"]))
        rates = {name: np.array(kept[name]) for name in asked.sensitivities}
        state = Compressed(report, np.array(kept["unknown"]), rates)
        changes = tuple(map(float, kept["changes"]))
        return KeptEquilibrium(state, np.array(kept["pressure"]), changes, bool(kept["converged"][0]))

    def put(self, asked: AskedEquilibrium, found: KeptEquilibrium) -> None:
        """Keep a rank's part of an equilibrium; a very large one isn't."""
        state = found.state
        if len(state.unknown) * (1 + len(state.sensitivities)) > _LARGEST:
            return
        self._store.put(
            asked,
            {
                "unknown": state.unknown,
                "pressure": found.pressure,
                "changes": np.array(found.changes),
                "converged": np.array([float(found.converged)]),
                **state.sensitivities,
            },
        )
