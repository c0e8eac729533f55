"""``python -m studies.cases KIND``: the table of kinds, each a command."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from legfem.common.command_line import CheckedCommand
from studies.cases import bars, benchmark, layers, limbs, peers, reach, sealed_command, sites
from studies.cases.machine import Kind, command_of
from studies.command_line import new_app

KINDS: dict[str, Kind[Path, Any, Any]] = {
    "layers": layers.KIND,
    "calf-layers": layers.CALVES,
    "sites": sites.KIND,
    "bars": bars.KIND,
    "limbs": limbs.KIND,
    "reach": reach.KIND,
}
app = new_app()
for name, kind in KINDS.items():
    app.command(name)(command_of(name, kind))
app.command("sealed", cls=CheckedCommand)(sealed_command.sealed)
app.command("benchmark")(benchmark.benchmark)
app.command("peers")(peers.peers)
app.command("picture")(sealed_command.picture)


@app.callback(no_args_is_help=True)
def cases() -> None:
    """Draw cases whose truth is known, run them as a user would, and count what came of them.

    Example: python -m studies.cases sites --n 10
    """


if __name__ == "__main__":
    app(prog_name="python -m studies.cases")
