"""A planted leg, identified by both models."""

from __future__ import annotations

import shutil
from pathlib import Path

from legfem.common.progress import Progress
from legfem.inverse.fit import Fit
from legfem.inverse.laws import LawName
from legfem.inverse.settings import SearchRequest
from legfem.legs.correction import TabulatedCorrection
from legfem.legs.correction_of_leg import correction_of
from legfem.legs.details import LegDetails
from legfem.legs.identification import as_leg, fit_leg
from legfem.legs.loading import load_subject
from legfem.legs.model_3d import SOLVES, LegModels
from legfem.legs.problem import section_forward
from studies.leg3d.planted import Planted
from studies.leg3d.real import PlantedInLeg


def identified(
    planted: Planted | PlantedInLeg, seed: int, folder: Path, progress: Progress
) -> dict[str, Fit[LegDetails]]:
    """Return what both models find of a planted leg, and the section without a correction.

    Everything solved is kept: the same call goes on where it was stopped.
    """
    place = folder / f"{planted.name}-{seed}"
    shutil.rmtree(place, ignore_errors=True)
    subject = load_subject(planted.written(place, seed, folder / "planted"))
    law: LawName = "reduced-polynomial" if planted.c20 else "neo-hookean"
    solves = folder / "solves" / place.name
    request = SearchRequest(out=solves, progress=progress)
    section = section_forward(as_leg(subject), request)
    leg = LegModels.of_subject(subject, section.models[0].depth, solves / SOLVES, progress=progress)

    def found(table: TabulatedCorrection | None, leg: LegModels | None) -> Fit[LegDetails]:
        (result,) = fit_leg(subject, [law], request, [table], section, leg)
        return result

    table = correction_of(subject)
    return {
        "3d": found(None, leg),
        "2d, the table's nearest leg": found(table, None),
        "2d, no correction": found(None, None),
    }
