"""The preview of an input: a run of ``legfem.data preview``, made once for what the input holds."""

from __future__ import annotations

import json
import shutil
from typing import Any

from legfem.app.runs import Run, RunState
from legfem.app.workspace import Workspace


def looked_at(workspace: Workspace, name: str) -> Run:
    """Return the run that looks at an input as it is now, begun if there is none."""
    folder = workspace.preview(name)
    run = Run(folder)
    if run.there:
        if run.state is RunState.LOST:
            run.resume()
        return run
    for older in folder.parent.iterdir():
        if older != folder and not Run(older).alive:
            shutil.rmtree(older, ignore_errors=True)
    options = ["preview", str(workspace.input(name)), "--out", str(run.results)]
    return Run.begun(folder, "legfem.data", options, name)


def seen(run: Run) -> dict[str, Any] | None:
    """Return what a preview wrote; None where it wrote nothing."""
    try:
        found: dict[str, Any] = json.loads((run.results / "preview.json").read_text("utf-8"))
    except (OSError, ValueError):
        return None
    return found
