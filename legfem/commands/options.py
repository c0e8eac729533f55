"""Options that commands on a leg share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Subject = Annotated[str | None, typer.Option(help="Id of a subject that comes with legfem.")]
SubjectDir = Annotated[Path | None, typer.Option(help="Folder of a subject of your own, instead.")]
Site = Annotated[str | None, typer.Option(help="Of a leg with several [[site]] the one to take.", show_default=False)]
SpecimenDir = Annotated[Path | None, typer.Option(help="Folder of specimens in a lab's test, in place of a leg.")]
Jobs = Annotated[int | None, typer.Option(help="Processes; all cores by default.")]
