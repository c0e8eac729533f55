"""Identification of a tissue's law from all recordings of a specimen folder together."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from legfem.common.progress import Progress, Silent
from legfem.inverse.laws import LawName
from legfem.inverse.settings import IdentificationSettings, SearchRequest
from legfem.specimens.folder import SpecimenFolder
from legfem.specimens.laws import Asked
from legfem.specimens.problem import fit_specimens
from legfem.specimens.result import SpecimenResult, specimen_result


def identify_specimen(
    folder: SpecimenFolder,
    laws: Sequence[LawName],
    asked: Asked | None = None,
    leave_out: Sequence[str] = (),
    settings: IdentificationSettings | None = None,
    out: Path | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> list[SpecimenResult]:
    """Identify laws from all recordings of a folder together; see `legfem.specimens.problem.fit_specimens`."""
    request = SearchRequest(
        settings=settings or IdentificationSettings(), out=out, jobs=jobs, progress=progress or Silent()
    )
    return [specimen_result(one) for one in fit_specimens(folder, laws, asked, leave_out, request)]
