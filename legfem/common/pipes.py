"""Writes to a reader that has left, as ``| head`` does: an error, as Python has it."""

from __future__ import annotations

import os
import signal
import threading

_OPTION = "-no_signal_handler"


def let_pipes_break() -> None:
    """Keep PETSc from ending the program where a reader has left, loaded or yet to be."""
    if threading.current_thread() is threading.main_thread() and hasattr(signal, "SIGPIPE"):
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)
    # PETSc takes the signals as it is loaded, but for this.
    given = os.environ.get("PETSC_OPTIONS", "")
    if _OPTION not in given.split():
        os.environ["PETSC_OPTIONS"] = f"{given} {_OPTION}".strip()
