"""A subject out of the folder that gives it."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

from legfem.common.errors import MISSING, InputError, remedy_for_missing
from legfem.common.input_files import check_distinct, check_printable
from legfem.common.units import kpa_to_mpa
from legfem.data import Instrument, Recording, SourceColumns, check_trial, read_samples, seen_instrument
from legfem.data.channel_reader import is_channel_file, with_channels
from legfem.data.formats import recording_files
from legfem.data.formats.sheet import trial_of
from legfem.data.plausibility import GIVE_COLUMNS, refuse_copies
from legfem.data.reader import trials_in
from legfem.data.recording import HEADER
from legfem.geometry.indenter import Indenter, Site
from legfem.geometry.section import LegSection, first_crossing
from legfem.inverse.accuracy import MeasuredEffect
from legfem.inverse.elastography import ShearModulus, fibre_ratio
from legfem.legs.placement import placed
from legfem.legs.plausibility import doubts_about
from legfem.legs.plausible_recordings import check_channels
from legfem.legs.schema import SUBJECTS, SubjectEntry, SubjectFile, TissueEntry, site_names, subject_entry
from legfem.legs.subject import TYPICAL_ACCURACY, LegAccuracy, SitedLeg, Subject, TissueParameters


def load_sites(directory: Path) -> SitedLeg | None:
    """Load all sites of a leg's folder, or None where it has no ``[[site]]``.

    Raises
    ------
    InputError
        As `load_subject` does.
    """
    directory = Path(directory)
    names = site_names(SUBJECTS.opened(directory))
    if not names:
        return None
    sites = tuple(_site(directory, name) for name in names)
    for k, site in enumerate(sites):
        for recording in site.recordings:
            refuse_copies(recording, [one for before in sites[:k] for one in before.recordings])
    first = sites[0]
    leg_id, title = (
        text.removesuffix(f"{joint}{first.site}") for text, joint in ((first.id, "-"), (first.title, ", "))
    )
    return SitedLeg(leg_id, title, sites, directory)


def _site(directory: Path, name: str) -> Subject:
    try:
        return load_subject(directory, site=name)
    except InputError as error:
        told = f"site {name}, "
        raise error.at(field=error.field if error.field.startswith(told) else told + error.field) from None


def load_subject(
    directory: Path, need_recordings: bool = True, need_instrument: bool = True, site: str = ""
) -> Subject:
    """Load a subject folder: ``subject.toml``, contours or a scan, and ``recordings/*.csv``.

    Parameters
    ----------
    directory : Path
        The folder.
    need_recordings : bool
        False loads the leg alone and reads no recordings.
    need_instrument : bool
        False lets ``[instrument]`` be absent: its errors are then those seen in the recordings.
    site : str
        Of a leg with several ``[[site]]`` which.

    Raises
    ------
    InputError
        If anything in the folder is missing, wrong or impossible; names file, field and remedy.
        What is only unlikely `legfem.legs.plausibility.doubts_about` tells.
    """
    directory = Path(directory)
    toml = SUBJECTS.opened(directory)
    entry = subject_entry(toml, site)
    given = entry.given
    place = placed(directory, toml, given)
    section = place.section
    indenter = Indenter(
        radius=given.indenter.diameter_mm / 2,
        length=given.indenter.own_length,
        aim=place.aim,
        direction_deg=place.direction_deg,
        shape=given.indenter.shape,
        axis_deg=place.axis_deg,
    )
    _check_aim(toml, f"site.{entry.site}" if entry.site else "indenter", section, indenter)
    moduli = tuple(map(ShearModulus.of, given.elastography))
    deep, known = given.tissues.deep, given.accuracy
    assumed = None if known.assumed_sd_percent is None else known.assumed_sd_percent / 100
    subject = Subject(
        id=given.id,
        title=given.title,
        origin=given.origin,
        section=section,
        indenter=indenter,
        tissues=MappingProxyType(_tissues(given, moduli)),
        instrument=_instrument(toml, given, (), needed=False),
        recordings=(),
        directory=directory,
        starts_at_contact=given.recordings.starts_at_contact,
        plane_strain=given.origin != "measured" if (flat := given.recordings.plane_strain) is None else flat,
        plane_strain_stated=flat is not None,
        accuracy=LegAccuracy(
            known.contour_sd_mm,
            known.aim_sd_mm,
            known.direction_sd_deg,
            assumed,
            known.contact_sd_mm,
            known.rig_sd_mm_per_N,
        ),
        confirmed=tuple(given.confirmed),
        cut_from=place.cut_from,
        landmark_residual=place.landmark_residual,
        site=entry.site,
        elastography=moduli,
        fibres=fibre_ratio(moduli, deep.fibre_ratio, deep.fibre_ratio_sd),
        typical_shape="" if given.section.girth_mm is None else given.section.limb,
        measured=tuple(MeasuredEffect(**entry.model_dump()) for entry in given.measured),
    )
    return with_trials(subject, entry, trial_files(directory, entry) if need_recordings else None, need_instrument)


def trial_files(directory: Path, entry: SubjectEntry) -> list[Path]:
    """Return the files among a leg's recordings that may be trials: not what channels beside them are read from."""
    files = recording_files(directory / entry.recordings)
    own = [file for file in files if not is_channel_file(file, entry.given.channels, entry.site)]
    return trials_in(own, entry.given.recordings.channels())


def with_trials(leg: Subject, entry: SubjectEntry, files: Sequence[Path] | None, needed: bool = False) -> Subject:
    """Return a leg with recordings, read and checked, in place of its own; without any for None.

    Parameters
    ----------
    leg, entry
        What its folder gives.
    files
        Of the recordings.
    needed
        Whether the instrument's errors have to be stated.

    Raises
    ------
    InputError
        As `load_subject` does for recordings.
    """
    toml, folder, given = leg.directory / SUBJECTS.file, leg.directory / entry.recordings, entry.given
    read = () if files is None else read_recordings(folder, files, given.recordings.channels())
    read = with_channels(toml, given.channels, read, Site(leg.section, leg.indenter), entry.site)
    subject = replace(leg, recordings=read, instrument=_instrument(toml, given, read, needed))
    outlines = (TYPICAL_ACCURACY if subject.typical_shape else subject.accuracy).contour_sd or 0.0
    for trial in subject.trials:
        check_trial(trial)
        check_channels(trial, subject.section, subject.indenter, outlines)
    doubts_about(subject)
    return subject


def _tissues(given: SubjectFile, moduli: Sequence[ShearModulus]) -> dict[str, TissueParameters]:
    """Return the tissues' laws; what was measured of fat takes the place of what was assumed."""
    measured: dict[str, float] = {one.tissue: one.C10 for one in moduli if one.tissue == "superficial"}
    found = {}
    entry: TissueEntry
    for name, entry in ((name, one) for name, one in given.tissues if one is not None):
        C10, C20 = (None if kPa is None else kpa_to_mpa(kPa) for kPa in (entry.C10_kPa, entry.C20_kPa))
        found[name] = TissueParameters(entry.law, measured.get(name, C10), C20, entry.D1_per_MPa, entry.D2_per_MPa)
    return found


def _instrument(toml: Path, given: SubjectFile, recordings: Sequence[Recording], needed: bool) -> Instrument:
    if given.instrument is not None:
        return given.instrument.instrument()
    if needed:
        raise InputError(toml, "instrument", MISSING, "add force_sd_N and displacement_sd_mm, or accuracies")
    return seen_instrument(recordings)


def read_recordings(folder: Path, there: Sequence[Path], channels: SourceColumns | None) -> tuple[Recording, ...]:
    """Return the recordings of files in a folder; by ``channels`` where they are named, else CSV files alone.

    Raises
    ------
    InputError
        If there are none, two have one name, or one can't be read.
    """
    files = there if channels is not None else [f for f in there if f.suffix.lower() == ".csv"]
    if not files:
        raise InputError(folder, "*.csv", "there are no recordings", _where_recordings_are(folder, there))
    check_printable(*files)
    check_distinct(folder, "trial", map(trial_of, files), "keep one file for each trial, in one format")
    return tuple(read_samples(file, channels) for file in files)


def _where_recordings_are(folder: Path, there: Sequence[Path]) -> str:
    """Return how recordings that were put elsewhere, or come from an instrument, get to their place."""
    if there:
        return GIVE_COLUMNS
    if not folder.is_dir():
        if folder.exists():
            return "it is a file: make it a folder, and put one CSV file for each trial there"
        beside = [path.name for path in recording_files(folder.parent) if _is_own(path)]
        made = f"make {folder.name}, with one CSV file a trial"
        return remedy_for_missing(folder, f"move {beside[0]} into a folder {folder.name}" if beside else made)
    within = sorted(path for path in folder.iterdir() if path.is_dir() and recording_files(path))
    if within:
        return f"move the files out of {within[0].name}"
    return "put one CSV file for each trial there: time_s,displacement_mm,force_N"


def _is_own(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(200).startswith(",".join(HEADER).encode())


def _check_aim(toml: Path, table: str, section: LegSection, indenter: Indenter) -> None:
    skin = section.polygon("skin").exterior
    try:
        first_crossing(skin, indenter.aim, indenter.direction)
    except ValueError:
        problem = "the line of travel through this point misses the leg"
        remedy = "give a point of the leg in the contours' coordinates, and direction_deg from +x"
        raise InputError(toml, f"{table}.aim_mm", problem, remedy) from None
