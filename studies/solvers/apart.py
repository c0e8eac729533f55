"""A command in processes of its own, mpirun for example, which end with the one that started it."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence

_APART = "LEGFEM_APART"


def run_apart(command: Sequence[str], environment: Mapping[str, str]) -> int:
    """Run a command to its end and return its exit status; Ctrl-C and errors end it.

    The command reads from a pipe that this process alone holds, however it ends. In its first rank
    `end_with_starter` sees when the pipe is closed.
    """
    process = subprocess.Popen(command, env={**environment, _APART: "1"}, stdin=subprocess.PIPE, text=True)
    try:
        return process.wait()
    except BaseException:
        process.terminate()
        process.wait()
        raise
    finally:
        if process.stdin is not None:
            process.stdin.close()


def end_with_starter() -> None:
    """Let this process end once the one whose `run_apart` started it has; mpirun ends the rest."""
    if os.environ.get(_APART) and not os.environ.get("OMPI_COMM_WORLD_RANK", "0").strip("0"):
        threading.Thread(target=_end_at_close, daemon=True).start()


def _end_at_close() -> None:
    sys.stdin.buffer.read()
    os._exit(1)
