"""``legfem COMMAND ...``: the same commands as ``python -m legfem.COMMAND``."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.util import find_spec

COMMANDS = {
    "identify": "the deep tissue's stiffness from a subject's recordings",
    "study": "design of experiments, 3D correction, convergence, reproduction",
    "plan": "which tests of a leg would show which effects",
    "diagnose": "where model and recordings differ, and which physics is missing",
    "stocking": "pressures inside a leg in a compression stocking, from its scans",
    "app": "all of this in a browser window, on this machine alone",
    "data": "columns, units, directions and a grade of instruments' files",
    "geometry": "a subject folder from cross-sections",
    "meshing": "a leg's mesh for gmsh, ParaView, Abaqus, CalculiX or FEBio Studio",
}


def main() -> None:
    """Run the command named by the first argument."""
    there = {name: text for name, text in COMMANDS.items() if _module(name)}
    name = sys.argv[1] if len(sys.argv) > 1 else "--help"
    if name in ("--help", "-h"):
        print("Usage: legfem COMMAND [OPTIONS]\n\nCommands:")
        for known, text in there.items():
            print(f"  {known:10} {text}")
        print("\nExample: legfem identify --subject 3\nlegfem COMMAND --help says more.")
        return
    if name not in there:
        print(f"legfem: {name}: unknown command; choose one of {', '.join(there)}", file=sys.stderr)
        sys.exit(2)
    # The command's own help then names the command as it was called.
    sys.argv = [f"legfem {name}", *sys.argv[2:]]
    import_module(f"legfem.{name}.__main__").app(prog_name=f"legfem {name}")


def _module(name: str) -> bool:
    try:
        return find_spec(f"legfem.{name}.__main__") is not None
    except ModuleNotFoundError:
        return False


if __name__ == "__main__":
    main()
