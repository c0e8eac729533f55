"""A leg's responses for the diagnosis of its recordings: where they are kept, and their key."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

from legfem.diagnose.observations import Observations
from legfem.diagnose.solved import SolvedResponses
from legfem.diagnose.variants import Variants
from legfem.legs.subject import Subject

_DEPTH_STEP_MM = 1.0
COARSENING, COARSER = 1.7, 2.4
"""Of the mesh on which relative changes are tabulated, and those by errors of the geometry: the
latter's effects are as near to the default mesh's on either."""
TOLERANCE = 1e-6
"""Of Newton's method, over the contact's forces: the force is then exact to 1e-6 of it, and a curve
takes a fifth fewer iterations than with the default."""
CREEPING = 1e-2
"""Of damped steps, by which a body creeps to another equilibrium: that one alone is kept, and is as
exact as all others."""


def library_folder() -> Path:
    """Return the folder that keeps all legs' responses."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "legfem" / "responses"


def solved_responses(
    subject: Subject, observed: Observations, folder: Path | None
) -> tuple[SolvedResponses, SolvedResponses]:
    """Return a leg's responses by full solutions, on the default mesh and on coarser ones.

    Elastic curves go to the next mm beyond the recordings, so that recordings of one leg share
    them whatever their depths.
    """
    from legfem.experiments.plane_strain import PlaneStrainSettings
    from legfem.legs.experiments import plane_strain_test, tissues_of

    depth = _DEPTH_STEP_MM * -(-(observed.depth + 0.3) // _DEPTH_STEP_MM)
    default = PlaneStrainSettings()
    newton = replace(default.newton, relative_tolerance=TOLERANCE, damped_tolerance=CREEPING)
    settings = replace(default, newton=newton)
    tissues = tissues_of(subject)

    def on_mesh(coarsening: float, rougher: SolvedResponses | None = None) -> SolvedResponses:
        own = replace(settings, mesh=settings.mesh.refined(1 / coarsening))
        return SolvedResponses(
            Variants(subject.section, subject.indenter, tissues, own),
            depth,
            folder,
            {
                **plane_strain_test(subject, own).fingerprint(),
                "model": "plane strain with mechanisms",
                "depth_mm": depth,
            },
            rougher=rougher,
        )

    return on_mesh(1.0), on_mesh(COARSENING, on_mesh(COARSER))
