"""A leg's responses for the diagnosis of its recordings: where they are kept, and their key."""

from __future__ import annotations

import os
from pathlib import Path

from legfem.correction.tabulated import TabulatedCorrection
from legfem.diagnose.observations import Observations
from legfem.diagnose.solved import SolvedResponses
from legfem.diagnose.variants import Variants
from legfem.subjects.subject import Subject

_DEPTH_STEP_MM = 1.0
COARSENING = 1.7
"""Of the mesh on which relative changes are tabulated."""


def library_folder() -> Path:
    """Return the folder that keeps all legs' responses."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "legfem" / "responses"


def solved_responses(
    subject: Subject,
    observed: Observations,
    folder: Path | None,
    correction: TabulatedCorrection | None = None,
) -> tuple[SolvedResponses, SolvedResponses]:
    """Return a leg's responses by full solutions, on the default mesh and on a coarser one.

    Elastic curves go to the next mm beyond the recordings, so that recordings of one leg share
    them whatever their depths.
    """
    from legfem.experiments.plane_strain import (
        PlaneStrainIndentation,
        PlaneStrainSettings,
    )
    from legfem.experiments.tissues import tissues_of

    depth = _DEPTH_STEP_MM * -(-(observed.depth + 0.3) // _DEPTH_STEP_MM)
    settings = PlaneStrainSettings()
    coarse = PlaneStrainSettings(mesh=settings.mesh.refined(1 / COARSENING))
    tissues = tissues_of(subject)
    return tuple(  # type: ignore[return-value]
        SolvedResponses(
            Variants(subject.section, subject.indenter, tissues, own),
            depth,
            folder,
            {
                **PlaneStrainIndentation.of_subject(subject, own).fingerprint(),
                "model": "plane strain with mechanisms",
                "depth_mm": depth,
            },
            correction,
        )
        for own in (settings, coarse)
    )
