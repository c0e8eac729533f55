"""One indentation trial as it was recorded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from legfem.common.units import FloatArray, frozen_array


@dataclass(frozen=True, eq=False)
class Recording:
    """One trial, untouched.

    Parameters
    ----------
    time : (n,) array
        s, strictly increasing; read-only.
    displacement : (n,) array
        mm, growing towards the leg; read-only.
    force : (n,) array
        N, positive in compression; read-only.
    trial : str
        Name of the trial (the file's stem).
    source : Path or None
        File it was read from.
    """

    time: FloatArray
    displacement: FloatArray
    force: FloatArray
    trial: str
    source: Path | None = None

    def __post_init__(self) -> None:
        """Keep read-only copies; raise ValueError if the arrays' shapes differ."""
        for name in ("time", "displacement", "force"):
            object.__setattr__(self, name, frozen_array(getattr(self, name)))
        if not (self.time.ndim == 1 and self.time.shape == self.displacement.shape == self.force.shape):
            raise ValueError("time, displacement and force must be (n,) arrays of one length")

    def __len__(self) -> int:
        """Return the number of samples."""
        return len(self.time)
