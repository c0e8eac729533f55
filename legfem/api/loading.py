"""What a call is about, by id or by its folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from legfem.common.doubts import say
from legfem.common.errors import InputError
from legfem.subjects.catalogue import Catalogue
from legfem.subjects.loading import SUBJECTS
from legfem.subjects.loading import load_subject as load_subject_folder
from legfem.subjects.plausibility import doubts_about
from legfem.subjects.subject import Subject

if TYPE_CHECKING:
    from legfem.specimens.folder import SpecimenFolder
    from legfem.stocking.leg import StockingLeg

type Given = str | Path
"""Id of a subject that comes with legfem, or the path of a folder."""


def load_subject(subject: Given, site: str = "") -> Subject:
    """Load a leg that was indented.

    Parameters
    ----------
    subject : str or Path
        Id of a subject that comes with legfem (``"1"`` to ``"4"``), or the path of a folder.
    site : str
        Of a leg with several ``[[site]]`` which.

    Raises
    ------
    InputError
        If there is no such subject, or anything in the folder is missing or wrong.
    """
    loaded = load_subject_folder(folder_of(subject, SUBJECTS), need_instrument=False, site=site)
    say(doubts_about(loaded))
    return loaded


def load_specimen(folder: Given) -> SpecimenFolder:
    """Load specimens that were tested in a lab: a ball, a punch, a cup, plates, a bar ...

    Parameters
    ----------
    folder : str or Path
        That holds ``specimen.toml`` and recordings.

    Raises
    ------
    InputError
        If anything in the folder is missing or wrong; a recording that can't be used stands in
        ``left_out``.
    """
    from legfem.specimens.folder import load_specimen as load_specimen_folder

    loaded = load_specimen_folder(Path(folder))
    say(loaded.doubts)
    return loaded


def load_leg(leg: Given) -> StockingLeg:
    """Load a leg that was scanned with and without a stocking.

    Parameters
    ----------
    leg : str or Path
        Id of a leg that comes with legfem (``"1"`` to ``"6"``), or the path of a folder.

    Raises
    ------
    InputError
        If there is no such leg, or anything in the folder is missing or wrong.
    """
    from legfem.stocking.loading import LEGS
    from legfem.stocking.loading import load_leg as load_leg_folder

    loaded = load_leg_folder(folder_of(leg, LEGS))
    say(loaded.doubts)
    return loaded


def folder_of(given: Given, catalogue: Catalogue) -> Path:
    """Return the folder of an id, or the one that is given."""
    if isinstance(given, str) and given in catalogue.names:
        return catalogue.find(given)
    if not Path(given).is_dir():
        known = ", ".join(catalogue.names)
        raise InputError(
            str(given), "subject", "not found", f"give one of {known}, or the path of a folder"
        )
    return Path(given)
