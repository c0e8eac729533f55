"""``legfem COMMAND ...``: the same commands as ``python -m legfem.COMMAND``."""

import os
import resource
import sys
import tempfile
from importlib import import_module
from typing import Any

from legfem.common.errors import missing_module

COMMANDS = {
    "identify": "the deep tissue's stiffness from a subject's recordings",
    "study": "design of experiments, 3D correction, reproduction",
    "plan": "which tests of a leg would show which effects",
    "diagnose": "where model and recordings differ, and which physics is missing",
    "live": "whether trials are usable, and what to measure next, while a leg is in the rig",
    "stocking": "pressures inside a leg in a compression stocking, from its scans",
    "cohort": "all of that for a folder of many, with one table and one page",
    "app": "all of this in a browser window, on this machine alone",
    "data": "columns, units, directions and a grade of instruments' files",
    "geometry": "a subject folder from cross-sections",
    "meshing": "a leg's mesh for gmsh, ParaView, Abaqus, CalculiX or FEBio Studio",
}


def command(name: str, module: str = "") -> Any:
    """Return a command's typer application, and run it for the module that Python was started with.

    Where a package is missing, end with a line that says how to get it.
    """
    _complete_surroundings()
    try:
        app = import_module(f"legfem.commands.{name}").app
    except ModuleNotFoundError as error:
        print(f"legfem: {missing_module(error)}", file=sys.stderr)
        sys.exit(1)
    if module == "__main__":
        app(prog_name=f"legfem {name}")
    return app


_LEAST_MEMORY = 1.2e9
"""Bytes of addresses: with fewer, libraries don't load, wait for ever or end the program."""


def _complete_surroundings() -> None:
    """Give libraries the streams and the home that they don't start without; end where there is no memory for them."""
    # A file that takes the place of a closed stream would hold what libraries print.
    while (handle := os.open(os.devnull, os.O_RDWR)) < 3:
        pass
    os.close(handle)
    sys.stdout, sys.stderr = sys.stdout or os.fdopen(1, "w"), sys.stderr or os.fdopen(2, "w")
    memory, _ = resource.getrlimit(resource.RLIMIT_AS)
    if 0 <= memory < _LEAST_MEMORY:
        sys.exit(f"legfem: memory: {memory / 1e6:.0f} MB are allowed (ulimit -v); allow {_LEAST_MEMORY / 1e6:.0f} MB")
    # At SIGHUP UCX, which MPI may use, would begin to trace what it does.
    os.environ.setdefault("UCX_DEBUG_SIGNO", "0")
    home = os.path.expanduser("~")  # noqa: PTH111  (Path's raises an error where nobody knows it)
    os.environ.setdefault("HOME", tempfile.mkdtemp() if home == "~" else home)


def main() -> None:
    """Run the command named by the first argument."""
    name = sys.argv[1] if len(sys.argv) > 1 else "--help"
    if name in ("--help", "-h"):
        print("Usage: legfem COMMAND [OPTIONS]\n\nCommands:")
        for known, text in COMMANDS.items():
            print(f"  {known:10} {text}")
        print("\nExample: legfem identify --subject 3\nlegfem COMMAND --help says more.")
        return
    if name not in COMMANDS:
        print(f"legfem: {name}: unknown command; choose one of {', '.join(COMMANDS)}", file=sys.stderr)
        sys.exit(2)
    # The command's own help then names the command as it was called.
    sys.argv = [f"legfem {name}", *sys.argv[2:]]
    command(name, "__main__")


if __name__ == "__main__":
    main()
