"""What a call is about, by id or by its folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from legfem.api.wording import in_calls_words
from legfem.common.doubts import log_doubts
from legfem.common.errors import InputError
from legfem.data.folder import Catalogue
from legfem.legs.loading import load_sites as load_sites_folder
from legfem.legs.loading import load_subject as load_subject_folder
from legfem.legs.plausibility import doubts_about
from legfem.legs.schema import SUBJECTS, site_names
from legfem.legs.subject import SitedLeg, Subject

if TYPE_CHECKING:
    from legfem.specimens.folder import SpecimenFolder
    from legfem.stockings.leg import StockingLeg

type Given = str | Path
"""Id of a subject that comes with legfem, or the path of a folder."""
_LOADED_BY = {"subject.toml": "load_subject", "leg.toml": "load_leg", "specimen.toml": "load_specimen"}


@in_calls_words()
def load_subject(subject: Given, site: str = "") -> Subject:
    """Load a leg that was indented.

    Parameters
    ----------
    subject : str or Path
        Id of a subject that comes with legfem (``"1"`` to ``"4"``), or the path of a folder.
    site : str
        Of a leg with several ``[[site]]`` which; `load_sites` loads all.

    Raises
    ------
    InputError
        If there is no such subject, or anything in the folder is missing or wrong.
    """
    loaded = load_subject_folder(folder_of(subject, SUBJECTS), need_instrument=False, site=site)
    log_doubts(doubts_about(loaded))
    return loaded


@in_calls_words()
def load_sites(leg: Given) -> SitedLeg:
    """Load all sites of a leg that was indented at several, to be identified together.

    Parameters
    ----------
    leg : str or Path
        The path of a folder whose ``subject.toml`` has ``[[site]]``.

    Raises
    ------
    InputError
        If the leg has no ``[[site]]``, or anything in the folder is missing or wrong.
    """
    folder = folder_of(leg, SUBJECTS)
    loaded = load_sites_folder(folder)
    if loaded is None:
        raise InputError(folder / SUBJECTS.file, "site", "the leg has none", "load it with load_subject")
    for site in loaded.sites:
        log_doubts(doubts_about(site))
    return loaded


def opened(leg: Subject | SitedLeg | Given, site: str = "") -> Subject | SitedLeg:
    """Return a leg, or all sites of one that has several, of which a name takes one.

    Raises
    ------
    InputError
        If there is no leg, no such site, or what is given is no leg that was indented.
    """
    if not isinstance(site, str):
        raise InputError("site", repr(site), "is no name", "give the name of one of the sites")
    if isinstance(leg, str | Path):
        several = not site and site_names(SUBJECTS.opened(folder_of(leg, SUBJECTS)))
        return load_sites(leg) if several else load_subject(leg, site)
    if not isinstance(leg, Subject | SitedLeg):
        raise InputError(
            "leg",
            type(leg).__name__,
            "is no leg that was indented",
            "give an id, a folder, or what load_subject or load_sites returned",
        )
    if not site:
        return leg
    sites = leg.sites if isinstance(leg, SitedLeg) else (leg,)
    for one in sites:
        if one.site == site:
            return one
    names = ", ".join(one.site for one in sites if one.site)
    remedy = f"give one of {names}" if names else "leave it out: the leg has none"
    raise InputError("site", site, "is no site of the leg", remedy)


def one_of(leg: Subject | SitedLeg | Given, site: str = "") -> Subject:
    """Return a leg that was indented at one place, or one of its sites.

    Raises
    ------
    InputError
        As `opened` does, and if there are several sites and none is named.
    """
    if isinstance(leg, str | Path):
        return load_subject(leg, site)
    found = opened(leg, site)
    if isinstance(found, SitedLeg):
        names = ", ".join(each.site for each in found.sites)
        raise InputError(
            "site",
            "missing",
            f"the leg has {len(found.sites)} ({names}), and here one is taken",
            f'give site="{found.sites[0].site}"',
        )
    return found


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

    _check_path(folder)
    _check_kind(Path(folder), "specimen.toml")
    loaded = load_specimen_folder(Path(folder))
    log_doubts(loaded.doubts)
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
    from legfem.stockings.loading import LEGS
    from legfem.stockings.loading import load_leg as load_leg_folder

    loaded = load_leg_folder(folder_of(leg, LEGS))
    log_doubts(loaded.doubts)
    return loaded


def folder_of(given: Given, catalogue: Catalogue) -> Path:
    """Return the folder of an id, or the one that is given.

    Raises
    ------
    InputError
        If there is none, or it is one of another kind.
    """
    _check_path(given)
    if isinstance(given, str) and given in catalogue.names:
        return catalogue.find(given)
    if not Path(given).is_dir():
        known = ", ".join(catalogue.names)
        raise InputError(str(given), "subject", "not found", f"give one of {known}, or the path of a folder")
    folder = Path(given)
    _check_kind(folder, catalogue.file)
    return folder


def _check_path(given: object) -> None:
    if not isinstance(given, str | Path):
        raise InputError("folder", type(given).__name__, "is no path", "give an id, or the path of a folder")


def _check_kind(folder: Path, wanted: str) -> None:
    for file, load in _LOADED_BY.items():
        if (folder / file).exists() and not (folder / wanted).exists():
            raise InputError(folder, file, f"is there, and no {wanted}", f"load the folder with lf.{load}")
