"""What a call is about, by id or by its folder."""

from pathlib import Path
from typing import TYPE_CHECKING

from legfem.api.arguments import wrong
from legfem.common.errors import InputError, log_doubts
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
_TAKEN_BY = {
    "subject.toml": "legfem identify takes it",
    "leg.toml": "legfem stocking takes it",
    "specimen.toml": "give it as --specimen-dir",
}


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


def opened(
    given: "Subject | SitedLeg | SpecimenFolder | Given", site: str = ""
) -> "Subject | SitedLeg | SpecimenFolder":
    """Return what is to be identified: a leg, one of its sites, all of them, or specimens.

    Raises
    ------
    InputError
        If there is no such folder or site, or what is given is none of these.
    """
    from legfem.specimens.folder import FILE, SpecimenFolder

    if not isinstance(site, str):
        raise wrong("site", repr(site), "is no name", "give the name of one of the sites")
    if isinstance(given, str | Path):
        if (Path(given) / FILE).is_file() and not (Path(given) / SUBJECTS.file).exists():
            return load_specimen(given)
        several = not site and site_names(SUBJECTS.opened(folder_of(given, SUBJECTS)))
        return load_sites(given) if several else load_subject(given, site)
    if isinstance(given, SpecimenFolder):
        return given
    if not isinstance(given, Subject | SitedLeg):
        raise InputError(
            "leg",
            type(given).__name__,
            "is no leg that was indented",
            "give an id, a folder, or what load_subject or load_sites returned",
        )
    if not site:
        return given
    sites = given.sites if isinstance(given, SitedLeg) else (given,)
    for one in sites:
        if one.site == site:
            return one
    names = ", ".join(one.site for one in sites if one.site)
    remedy = f"give one of {names}" if names else "leave it out: the leg has none"
    raise wrong("site", site, "is no site of the leg", remedy)


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
        problem = f"the leg has {len(found.sites)} ({names}), and here one is taken"
        raise wrong("site", "missing", problem, f"give --site {found.sites[0].site}")
    assert isinstance(found, Subject)
    return found


def load_specimen(folder: Given) -> "SpecimenFolder":
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


def load_leg(leg: Given) -> "StockingLeg":
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
    for file, remedy in _TAKEN_BY.items():
        if (folder / file).exists() and not (folder / wanted).exists():
            raise InputError(folder, file, f"is there, and no {wanted}", remedy)
