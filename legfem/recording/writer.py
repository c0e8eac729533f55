"""Writing a recording as the reader wants it."""

from __future__ import annotations

from pathlib import Path

from legfem.recording.trial import Recording


def write_recording(recording: Recording, path: Path) -> None:
    """Write ``time_s,displacement_mm,force_N``, to 0.1 um and 0.1 mN."""
    import pandas as pd

    table = pd.DataFrame(
        {
            "time_s": recording.time.round(4),
            "displacement_mm": recording.displacement.round(4),
            "force_N": recording.force.round(4),
        }
    )
    table.to_csv(path, index=False)
