"""Options that the studies' commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Jobs = Annotated[int | None, typer.Option(min=1, help="Processes; all cores by default.")]
Out = Annotated[Path | None, typer.Option(help="Folder for results; results/STUDY by default.")]
Library = Annotated[Path | None, typer.Option(help="Folder of responses; ~/.cache/legfem/responses by default.")]
