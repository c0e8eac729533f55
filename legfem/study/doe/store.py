"""Simulations kept on disk, each as soon as it is done, so that a rerun goes on from there."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from legfem.documents import write_atomically
from legfem.study.doe.simulator import Record, Request, request_key


@dataclass(frozen=True)
class RunStore:
    """A folder of records, one JSON file each, named by all that the simulation depends on."""

    folder: Path
    fingerprint: Mapping[str, Any]

    def load(self, request: Request) -> Record | None:
        """Return a kept record, to the last bit; None if there is none that can be read."""
        try:
            return _record(json.loads(self._path(request).read_text()))
        except (OSError, ValueError, KeyError, TypeError):
            return None

    def keep(self, request: Request, record: Record) -> None:
        """Write a record; it is there whole or not at all."""
        self.folder.mkdir(parents=True, exist_ok=True)
        write_atomically(self._path(request), json.dumps(_document(request, record)))

    def _path(self, request: Request) -> Path:
        return self.folder / f"{request_key(self.fingerprint, request)}.json"


def _document(request: Request, record: Record) -> dict[str, Any]:
    return {
        "stage": request.stage,
        "parameters_MPa_mm": dict(request.values),
        "displacement_mm": record.displacement.tolist(),
        "force_per_length_N_per_mm": record.force_per_length.tolist(),
        "complete": record.complete,
        "reason": record.reason,
        "seconds": record.seconds,
        "factorisations": record.factorisations,
        "contact_stiffness_factor": record.contact_stiffness_factor,
        "unknowns": record.unknowns,
        "sensitivities": {name: list(values) for name, values in record.sensitivities.items()},
    }


def _record(document: Mapping[str, Any]) -> Record:
    return Record(
        np.array(document["displacement_mm"]),
        np.array(document["force_per_length_N_per_mm"]),
        document["complete"],
        document["reason"],
        document["seconds"],
        document["factorisations"],
        document["contact_stiffness_factor"],
        document["unknowns"],
        {name: np.array(values) for name, values in document["sensitivities"].items()},
    )
