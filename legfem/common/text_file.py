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
            text = path.read_text(encoding="utf-8-sig")
            if "\0" not in text:
                return text
            raise InputError(path, "file", "holds bytes that are no text (NUL)", remedy)
    except FileNotFoundError:
        raise InputError(path, "file", "not found", missing) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(path, "file", f"can't be read ({error})", remedy) from None
    raise InputError(path, "file", "can't be read (it is a pipe or a device)", remedy)


def check_shown(*paths: Path) -> None:
    """Check that files' names can be shown and written.

    Raises
    ------
    InputError
        For a line's end, another control character, or bytes that are no UTF-8.
    """
    for path in paths:
        if not path.name.isprintable():
            raise InputError(path, "name", f"{path.name!a} can't be shown", "rename it: letters and digits")
