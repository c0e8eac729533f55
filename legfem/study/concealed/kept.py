"""Outcomes of emulated recordings, kept as they are found, so that a stopped count goes on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from legfem.diagnose.library import Library
from legfem.identify.forward import code_fingerprint

_CODE = ("diagnose", "diagnose/mechanisms", "recording", "study/concealed")


class Kept:
    """Outcomes by their names, a line each in a file.

    Parameters
    ----------
    folder
        Where the file is.
    name
        What is counted.
    libraries
        The responses that recordings are emulated with. They and the code of the diagnosis decide
        the file's name: after a change of either all is counted anew.
    """

    def __init__(self, folder: Path, name: str, libraries: Sequence[Library]) -> None:
        digest = hashlib.sha256(code_fingerprint(_CODE).encode())
        for library in libraries:
            digest.update(_bytes(library))
        self.path = folder / f"{name}-{digest.hexdigest()[:16]}.jsonl"
        self._known: dict[str, Any] = {}
        if self.path.is_file():
            for line in self.path.read_text().splitlines():
                self._recall(line)

    def __contains__(self, name: str) -> bool:
        """Return whether an outcome is known."""
        return name in self._known

    def __getitem__(self, name: str) -> Any:
        """Return an outcome, JSON types."""
        return self._known[name]

    def add(self, name: str, outcome: Any) -> None:
        """Keep an outcome."""
        self._known[name] = outcome
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a") as file:
            # A line that a kill cut short stands alone.
            file.write(f"\n{json.dumps([name, outcome])}")

    def _recall(self, line: str) -> None:
        try:
            name, outcome = json.loads(line)
        except ValueError:
            return
        self._known[name] = outcome


def _bytes(library: Library) -> bytes:
    arrays = [library.grid, library.curve(0.7, 0.6)]
    arrays += [table.values for _, table in sorted(library.changes.items())]
    return b"".join(np.ascontiguousarray(values).tobytes() for values in arrays)
