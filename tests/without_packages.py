"""``python tests/without_packages.py PACKAGES COMMAND ...``: run commands of legfem's where packages aren't installed.

PACKAGES are separated by commas; a command is one argument, as after ``legfem``. Prints a line a command: how it ended,
what it wrote to stderr, and which modules of legfem's were loaded, as JSON.
"""

from __future__ import annotations

import contextlib
import io
import json
import shlex
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec


class Missing:
    """Finder before all others that finds no module of some names, nor within them."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = names

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        if any(f"{name}.".startswith(f"{missing}.") for missing in self.names):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return None


if __name__ == "__main__":
    from legfem.__main__ import main

    sys.meta_path.insert(0, Missing(sys.argv[1].split(",")))
    for command in sys.argv[2:]:
        sys.argv = ["legfem", *shlex.split(command)]
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as said:
            try:
                main()
                status: object = 0
            except SystemExit as end:
                status = end.code
        loaded = sorted(name for name in sys.modules if name.startswith("legfem."))
        print(json.dumps({"status": status, "said": said.getvalue(), "loaded": loaded}))
