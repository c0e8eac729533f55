"""Full solves kept on disk, each as soon as it is done, so that a rerun goes on from there."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from legfem.curve import ForceCurve
from legfem.documents import write_atomically
from legfem.identify.forward import DeepTissue, ForwardOutcome, finite_or_none, solve_key


class SolveStore:
    """A folder of solves, one JSON file each, named by all that the solve depends on.

    Parameters
    ----------
    folder : Path
        Made when the first solve is kept.
    fingerprint : Mapping
        Of the forward model.
    """

    def __init__(self, folder: Path, fingerprint: Mapping[str, Any]) -> None:
        self.folder, self.fingerprint = folder, fingerprint

    def path(self, deep: DeepTissue) -> Path:
        """Return the file of a solve, there or not."""
        return self.folder / f"{solve_key(self.fingerprint, deep)}.json"

    def load(self, deep: DeepTissue) -> ForwardOutcome | None:
        """Return a kept solve, to the last bit; None if there is none that can be read."""
        try:
            return _outcome(json.loads(self.path(deep).read_text()))
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def keep(self, outcome: ForwardOutcome) -> None:
        """Write a solve; it is there whole or not at all."""
        self.folder.mkdir(parents=True, exist_ok=True)
        write_atomically(self.path(outcome.deep), json.dumps(_document(outcome)))


def _document(outcome: ForwardOutcome) -> dict[str, Any]:
    curve, deep = outcome.curve, outcome.deep
    return {
        "deep": {"C10_kPa": deep.C10, "C20_kPa": deep.C20, "D2_per_MPa": finite_or_none(deep.D2)},
        "displacement_mm": curve.displacement.tolist(),
        "force_N": curve.force.tolist(),
        "sensitivities_N_per_MPa": {
            name: values.tolist() for name, values in curve.sensitivities.items()
        },
        "complete": outcome.complete,
        "reason": outcome.reason,
        "factorisations": outcome.factorisations,
        "seconds": outcome.seconds,
    }


def _outcome(document: Mapping[str, Any]) -> ForwardOutcome:
    deep = document["deep"]
    second = deep["D2_per_MPa"]
    return ForwardOutcome(
        DeepTissue(deep["C10_kPa"], deep["C20_kPa"], math.inf if second is None else second),
        ForceCurve(
            np.array(document["displacement_mm"]),
            np.array(document["force_N"]),
            {k: np.array(v) for k, v in document["sensitivities_N_per_MPa"].items()},
        ),
        document["complete"],
        document["reason"],
        document["factorisations"],
        document["seconds"],
    )
