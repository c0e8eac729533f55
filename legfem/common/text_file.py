"""Text that users hand over, read whole."""

from __future__ import annotations

import stat
from pathlib import Path

from legfem.common.errors import InputError


def text_of(path: Path, missing: str, remedy: str) -> str:
    """Return a file's text, without a byte order mark.

    Parameters
    ----------
    path : Path
        The file; what never ends (a pipe, a device) isn't opened.
    missing : str
        What to do if it isn't there.
    remedy : str
        What to do if it can't be read.

    Raises
    ------
    InputError
        If it is missing, no plain file, or no UTF-8.
    """
    try:
        if stat.S_IFMT(path.stat().st_mode) in (stat.S_IFREG, stat.S_IFDIR):
            return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(path, "file", "not found", missing) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, "file", f"can't be read ({error})", remedy) from None
    raise InputError(path, "file", "can't be read (it is a pipe or a device)", remedy)
