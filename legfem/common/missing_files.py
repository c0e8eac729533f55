"""A file or folder that isn't there, and the one in its place that is perhaps meant."""

import unicodedata
from pathlib import Path

_OTHER_KINDS = (".xlsx", ".xls", ".ods", ".numbers", ".rtf", ".docx", ".json", ".yaml", ".yml")


def remedy_for_missing(path: Path, otherwise: str) -> str:
    """Return what to do about a missing file, where one beside its place has nearly its name.

    A name in other capitals, of a copy (``subject (1).toml``), or with another ending or one more
    (``subject.toml.txt``).

    Parameters
    ----------
    path : Path
        Of what is missing.
    otherwise : str
        What to do where there is no such file.
    """
    if not path.parent.is_dir():
        return otherwise
    wanted, stem = _plain(path.name), _plain(path.stem)
    begins = tuple(stem + mark for mark in ". _-(")
    names = sorted(one.name for one in path.parent.iterdir() if one.name.isprintable())
    found = next((n for n in names if _plain(n) == wanted), None) or next(
        (n for n in names if _plain(n).startswith(begins) and not (path.parent / n).is_dir()), None
    )
    if found is None:
        return otherwise
    if _composed(found) == _composed(path.name):
        return f"name {found!r} anew: its accents are encoded in another way"
    if Path(found).suffix.lower() in _OTHER_KINDS:
        return f"save {found!r} as {path.name}"
    return f"rename {found!r} to {path.name}"


def _composed(name: str) -> str:
    return unicodedata.normalize("NFC", name)


def _plain(name: str) -> str:
    return _composed(name).casefold()
