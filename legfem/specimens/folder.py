"""A specimen folder: ``specimen.toml`` and the recordings of one kind of test of one tissue."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from legfem.channels.kinds.face_strain import FACE_STRAIN, not_of_the_face
from legfem.channels.kinds.lateral_stretch import LATERAL_STRETCH, not_a_stretch
from legfem.channels.kinds.layer_thickness import refused
from legfem.common.drawing import Pictured
from legfem.common.errors import Argument, Doubt, InputError
from legfem.common.input_files import FileTable, check_distinct, check_printable
from legfem.common.units import kpa_to_mpa
from legfem.data import Instrument, Segmentation, among_repeats
from legfem.data.channel_reader import is_channel_file, with_channels
from legfem.data.formats import is_litter, read_sheets, recording_files
from legfem.data.formats.sheet import file_of, trial_of
from legfem.data.instrument_faults import repeat_doubts
from legfem.data.plausibility import GIVE_COLUMNS, refuse_copies, trial_doubts, unread_doubts
from legfem.data.ranges import RANGES
from legfem.data.reader import trials_in
from legfem.data.recording import Origin, SourceColumns
from legfem.data.stress_tables import refuse_untimed, stretch_and_stress
from legfem.specimens.course import course_of
from legfem.specimens.laws import SpecimenTissue, tissues_of
from legfem.specimens.schema import SIZES, BaseLaw, SeveralTests, SpecimenFile, parse_specimen_file
from legfem.specimens.sizes import (
    LeftOut,
    Sizes,
    SpecimenRecording,
    heading_doubts,
    size_doubts,
    sizes_of,
    stiffness_doubts,
)

FILE = "specimen.toml"


@dataclass(frozen=True, eq=False, repr=False)
class SpecimenFolder(Pictured):
    """Everything given about specimens of one tissue; see `load_specimen`."""

    id: str
    title: str
    origin: Origin
    recordings: tuple[SpecimenRecording, ...]
    left_out: tuple[LeftOut, ...]
    """Recordings that can't be used: they cost themselves alone."""
    relaxes: bool
    directory: Path
    instrument: Instrument | None = None
    """As stated; seen in the recordings without it."""
    one_stiffness: bool = False
    """Whether all specimens are said to be equally stiff."""
    returns: bool = False
    """Whether what follows the first return is fitted too."""
    base_law: BaseLaw = "neo-hookean"
    """That `legfem.diagnose` asks what it leaves out."""
    tissues: tuple[SpecimenTissue, ...] = (SpecimenTissue(),)
    """One, or layers from the base up."""
    doubts: tuple[Doubt, ...] = ()
    """What can be, but is unlikely."""
    confirmed: tuple[str, ...] = ()
    """Fields whose unusual values are right."""
    alternatives: tuple[str, ...] = ()
    """What isn't known of the test, such as whether its ends stick; recordings have the first."""
    size_sd: Mapping[str, float] = field(default_factory=dict)
    """Standard deviations of the specimens' sizes by key of ``specimen.toml``, mm or mm²."""
    sizes_sd: float = 0.0
    """The same of other sizes, relative."""
    rig_sd: float | None = None
    """Standard deviation of what the rig yields, mm/N; as rigs usually do without it."""
    contact_sd: float | None = None
    """Standard deviation (mm) of how far specimens were strained before the start, where it may be stated there."""
    tests: Mapping[str, "SpecimenFolder"] = field(default_factory=dict)
    """Folders of the tests by name, where there are several of one material."""

    rig: float = 0.0
    """What the rig yields, mm/N, taken off the recordings' displacements."""

    def on_rig(self, compliance: float) -> "SpecimenFolder":
        """Return the folder with what a rig yields (mm/N) taken off the displacements."""
        left = tuple(one.on_rig(compliance, self.returns) for one in self.recordings)
        return replace(self, recordings=left, rig=compliance)

    def pictures(self) -> str:
        """Its recordings."""
        return "".join(one.recording.pictures() for one in self.recordings)

    def test_of(self, one: SpecimenRecording) -> "SpecimenFolder":
        """Return the folder of a recording's own test."""
        return self.tests.get(one.test, self)

    def under(self, alternative: str) -> "SpecimenFolder":
        """Return the folder with one of its alternatives taken to be so."""
        recordings = tuple(replace(one, sizes=one.sizes.under(alternative)) for one in self.recordings)
        return replace(self, recordings=recordings, alternatives=())

    @property
    def equally_stiff(self) -> bool:
        """Whether specimens count as equally stiff: as said, or where a layer's is stated."""
        return self.one_stiffness or any("C10" in one.stated for one in self.tissues)

    @property
    def longest(self) -> float:
        """Longest time (s) within which stress is seen to relax; 0 where it doesn't relax."""
        return max(float(one.course.time[-1]) for one in self.recordings) if self.relaxes else 0.0

    @property
    def specimens(self) -> dict[str, tuple[SpecimenRecording, ...]]:
        """Recordings by the specimen's name."""
        names = dict.fromkeys(one.specimen for one in self.recordings)
        return {name: tuple(one for one in self.recordings if one.specimen == name) for name in names}

    def named(self, name: str) -> tuple[SpecimenRecording, ...]:
        """Return the recordings that are of a name, or of a specimen of that name.

        Raises
        ------
        InputError
            If there are none, or no others.
        """
        found = tuple(one for one in self.recordings if name in (one.name, one.specimen, one.test))
        if not found:
            known = sorted({text for one in self.recordings for text in (one.name, one.specimen, one.test) if text})
            problem = "is neither a recording nor a specimen of the folder"
            raise InputError(Argument("leave_out"), name, problem, f"give one of {', '.join(known)}")
        if len(found) == len(self.recordings):
            raise InputError(Argument("leave_out"), name, "leaves nothing to fit", "name fewer")
        return found


def load_specimen(directory: Path) -> SpecimenFolder:
    """Load a specimen folder.

    Parameters
    ----------
    directory : Path
        The folder.

    Raises
    ------
    InputError
        If ``specimen.toml`` is missing or wrong, names collide, or no recording can be used; a
        recording that can't is told in `SpecimenFolder.left_out`.
    """
    directory = Path(directory)
    toml = directory / FILE
    if not directory.is_dir():
        raise InputError(directory, "specimen folder", "not found", f"give one that contains {FILE}")
    given = parse_specimen_file(toml)
    if isinstance(given, SeveralTests):
        return _together(toml, given)
    named = named_recordings(directory, toml, given)
    _ask_for_tables(given, [path for _, _, path in named])
    doubts = _doubts_about_bodies(toml, given)
    sizes = {entry: _sizes(toml, given, entry) for entry in {entry for _, entry, _ in named}}
    doubts += [doubt for body in sizes.values() for doubt in body.shape_doubts(toml)]
    errors = None if given.instrument is None else given.instrument.instrument()
    kind = given.kind
    doubts += unread_files(directory, given, [path for _, _, path in named])
    used, left = list[SpecimenRecording](), list[LeftOut]()
    for name, entry, path in named:
        try:
            own = sizes[entry]
            trial = kind.read(path, given.recordings, own.body, errors, name)
            doubts += kind.doubts(trial.recording, own.body)
            course = course_of(trial, given.tissue.returns)
            doubts += own.course_doubts(trial.source, course)
            doubts += heading_doubts(trial.source, own, trial.recording.sizes)
            doubts += trial_doubts([trial])
            refuse_copies(trial.recording, [one.recording for one in used])
        except InputError as error:
            left.append(LeftOut(name, str(error)))
        else:
            specimen = given.id if entry is None else given.specimen[entry].name
            used.append(SpecimenRecording(name, specimen, own, course, trial))
    if not used:
        raise InputError(directory / "recordings", left[0].name, "no recording can be used", left[0].reason)
    used, apart = _agreeing(_with_channels(toml, given, used))
    doubts += [*apart, *_unused(used)]
    return SpecimenFolder(
        given.id,
        given.title,
        given.origin,
        tuple(used),
        tuple(left),
        any(one.course.holds for one in used) if given.tissue.relaxes is None else given.tissue.relaxes,
        directory,
        errors,
        given.tissue.one_stiffness,
        given.tissue.returns,
        given.tissue.law,
        tissues_of(given),
        tuple(doubt for doubt in dict.fromkeys(doubts) if doubt.field not in given.confirmed),
        tuple(given.confirmed),
        kind.alternatives(given.test),
        {key: sd for key in SIZES if (sd := getattr(given.accuracy, key)) is not None},
        _sizes_sd(given),
        given.accuracy.rig_sd_mm_per_N,
        given.accuracy.contact_sd_mm,
    )


def _together(toml: Path, given: SeveralTests) -> SpecimenFolder:
    """Return several tests of one material as one folder."""
    tests, used, left = dict[str, SpecimenFolder](), list[SpecimenRecording](), list[LeftOut]()
    check_distinct(toml, "tests", given.tests, "name every folder once")
    for name in given.tests:
        one = load_specimen(toml.parent / name)
        _check_of_one_material(toml, given, name, one, tests)
        tests[name] = one
        for recording in one.recordings:
            refuse_copies(recording.recording, [other.recording for other in used if other.test != name])
            specimen = name if len(one.specimens) == 1 else f"{name}/{recording.specimen}"
            used.append(replace(recording, name=f"{name}/{recording.name}", specimen=specimen, test=name))
        left += [replace(other, name=f"{name}/{other.name}") for other in one.left_out]
    first, *_ = tests.values()
    relaxes = any(one.relaxes for one in tests.values())
    untimed = next((one.name for one in used if not one.recording.timed), None)
    if relaxes and untimed:
        problem = f"{untimed} is a table without a time, and other recordings show relaxation"
        remedy = "give [tissue] relaxes = false with every test, or leave the table out"
        raise InputError(toml, "tests", problem, remedy)
    return replace(
        first,
        id=given.id,
        title=given.title,
        origin=given.origin,
        recordings=tuple(used),
        left_out=tuple(left),
        relaxes=relaxes,
        directory=toml.parent,
        doubts=tuple(doubt for one in tests.values() for doubt in one.doubts),
        confirmed=tuple(field for one in tests.values() for field in one.confirmed),
        alternatives=tuple(dict.fromkeys(name for one in tests.values() for name in one.alternatives)),
        tests=tests,
    )


def _check_of_one_material(
    toml: Path, given: SeveralTests, name: str, one: SpecimenFolder, others: Mapping[str, SpecimenFolder]
) -> None:
    """Refuse a test that can't be fitted together with others."""
    own, file = toml.parent / name / FILE, f"{name}/{FILE}"
    if one.tests:
        raise InputError(toml, "tests", f"{file} names tests itself", "name the folders of its tests here")
    if any(tissue.fibrous for tissue in one.tissues):
        raise InputError(own, "fibres", "are not fitted by several tests together", "identify this folder by itself")
    if one.origin != given.origin:
        raise InputError(own, "origin", f'"{one.origin}", where {FILE} above says "{given.origin}"', "correct one")
    for before, other in others.items():
        for key, what in _OF_MATERIAL.items():
            if getattr(one, key) != getattr(other, key):
                problem = f"states {what} otherwise than {before}/{FILE}, and both are of one material"
                raise InputError(own, what, problem, "state it alike in all tests")


_OF_MATERIAL = {
    "tissues": "[tissue] poisson_ratio, or [[layers]],",
    "base_law": "[tissue] law",
    "returns": "[tissue] returns",
    "one_stiffness": "[tissue] one_stiffness",
}
"""What tests of one material have alike, by field."""


def _agreeing(used: Sequence[SpecimenRecording]) -> tuple[list[SpecimenRecording], list[Doubt]]:
    """Return recordings whose contacts are known as well as those of the same specimen agree, and what else differs."""
    found, apart = list(used), list[Doubt]()
    for group in dict.fromkeys((one.specimen, one.sizes) for one in used):
        places = [k for k, one in enumerate(used) if (one.specimen, one.sizes) == group]
        trials = among_repeats([used[k].trial for k in places])
        apart += repeat_doubts(trials)
        for k, trial in zip(places, trials, strict=True):
            found[k] = replace(used[k], trial=trial, course=replace(used[k].course, contact=trial.contact))
    return found, apart


def _sizes_sd(given: SpecimenFile) -> float:
    stated = given.accuracy.sizes_percent
    if given.recordings.table is not None:
        return 0.0  # a table's stress is of any size
    return (1.0 if given.origin == "measured" else 0.1) / 100 if stated is None else stated / 100


def doubts_of(folder: SpecimenFolder, c10: float, others: Sequence[Doubt] = ()) -> tuple[Doubt, ...]:
    """Return a folder's doubts with others, and with what is unlikely in how stiff (C10, MPa) its recordings are."""
    names = [folder.id, folder.title]
    if len(folder.tissues) > 1:
        names = [one.name for one in folder.tissues if "C10" not in one.stated]
    field = folder.recordings[0].sizes.kind.load_field
    told = {one.source for one in folder.doubts if one.kind == "trials that differ"}
    new = (one for one in others if one.source not in told)
    more = (*new, *stiffness_doubts(folder.directory / "recordings", c10, names, field))
    return (*folder.doubts, *(one for one in more if one.field not in folder.confirmed))


def _ask_for_tables(given: SpecimenFile, paths: Sequence[Path]) -> None:
    """Check that no file is a table of stretch and stress that the folder doesn't say how to read."""
    if not given.kind.cube or given.recordings.table is not None or given.recordings.channels() is not None:
        return
    for path in paths:
        try:
            sheets = read_sheets(path)
        except InputError:
            continue  # said where it is read
        table = next((sheet for sheet in sheets if stretch_and_stress(sheet)), None)
        if table is not None:
            raise refuse_untimed(path, table)


def _doubts_about_bodies(toml: Path, given: SpecimenFile) -> list[Doubt]:
    bodies: list[tuple[str, FileTable]] = [(given.kind.table, given.test)]
    bodies += [(f"specimen {one.name}", one) for one in given.specimen]
    found = [doubt for table, body in bodies for doubt in size_doubts(toml, table, body)]
    thin = [(f"specimen {one.name}.layers_mm", mm) for one in given.specimen for mm in one.layers_mm or ()]
    thin += [(f"layers.{one.name}.thickness_mm", one.thickness_mm) for one in given.layers if one.thickness_mm]
    found += [doubt for field, mm in thin for doubt in RANGES["layer"].doubts(toml, field, mm)]
    for layer in given.layers:
        if layer.C10_kPa is not None:
            c10, field = kpa_to_mpa(layer.C10_kPa), f"layers.{layer.name}.C10_kPa"
            found += stiffness_doubts(toml, c10, [layer.name], field)
    return found


def _with_channels(toml: Path, given: SpecimenFile, used: Sequence[SpecimenRecording]) -> list[SpecimenRecording]:
    """Return recordings with the channels that the folder's file names, as accurate as it states."""
    found = []
    faces = [face for one in used if (face := given.kind.face(one.sizes.body)) is not None]
    if getattr(given.channels, FACE_STRAIN.name) is not None and not faces:
        what, remedy = f"no model of [{given.kind.table}] gives it", "leave it out"
        raise InputError(toml, f"channels.{FACE_STRAIN.name}", what, remedy)
    recordings = with_channels(toml, given.channels, [one.recording for one in used], faces)
    for one, recording in zip(used, recordings, strict=True):
        same = recording is one.recording
        found.append(one if same else replace(one, trial=replace(one.trial, recording=recording)))
        _check_channels(found[-1].trial, one.sizes, _sizes_sd(given))
    return found


def _unused(used: Sequence[SpecimenRecording]) -> Iterator[Doubt]:
    """Yield doubts about columns that no model of the test gives."""
    for one in used:
        layers, kind = one.sizes.layers, one.sizes.kind
        known = {*one.sizes.thicknesses, *kind.beside}
        for name in (channel.name for channel in one.trial.recording.channels if channel.name not in known):
            what = f"[{kind.table}] of {'layers' if layers else 'one tissue'}"
            yield Doubt(one.trial.source, name, f"is not used: no model of {what} gives it", "leave it out")


def _check_channels(trial: Segmentation, sizes: Sizes, relative_sd: float) -> None:
    """Refuse thicknesses that aren't those of a specimen's layers, and what is neither a stretch nor its face's."""
    kind, body, between = sizes.kind, sizes.body, sizes.thicknesses
    for one in trial.recording.channels:
        found = not_a_stretch(one.values) if one.name == LATERAL_STRETCH.name else None
        depths = trial.loading_depths(one.time)
        if one.name == FACE_STRAIN.name:
            way = (-1.0 if kind.presses(body) else 1.0) / (kind.extent(body) or 1.0)
            found = not_of_the_face(one.values, one.place, way * depths)
        if one.name in between:
            low, high = between[one.name]
            found = refused(one.kind, high - low, depths, one.values, one.accuracy, relative_sd * (high - low))
        if found is not None:
            raise InputError(trial.source, one.name, found.what, found.remedy)


def _sizes(toml: Path, given: SpecimenFile, number: int | None) -> Sizes:
    entry = None if number is None else given.specimen[number]
    try:
        return sizes_of(given, entry)
    except InputError as error:
        where = "" if entry is None else f"specimen {entry.name}, "
        raise error.at(toml, f"{where}{error.field}") from None


def tissue_asked_for(folder: SpecimenFolder) -> SpecimenTissue:
    """Return the tissue whose stiffness a diagnosis asks for: the one that isn't stated.

    Raises
    ------
    InputError
        If there are several, or none.
    """
    open_ones = [one for one in folder.tissues if "C10" not in one.stated]
    if len(open_ones) == 1:
        return open_ones[0]
    names = ", ".join(one.name for one in open_ones) or "none"
    remedy = "state C10_kPa of all layers but one, such as legfem.identify found, for a diagnosis"
    raise InputError(folder.directory / FILE, "layers", f"stiffness is open of {names}", remedy)


def unread_files(directory: Path, given: SpecimenFile, read: Sequence[Path]) -> Iterator[Doubt]:
    """Yield a doubt about files beside the recordings that nothing reads, if there are any."""
    folder = directory / "recordings"
    there = {file_of(path) for path in read}
    others = [f for f in recording_files(folder) if f not in there and not is_channel_file(f, given.channels)]
    yield from unread_doubts(folder, others, "name every file under [[specimen]], remove the others")


def named_recordings(directory: Path, toml: Path, given: SpecimenFile) -> list[tuple[str, int | None, Path]]:
    """Return name, number of the specimen (None where there is but one) and file of recordings."""
    # A piece may be tested with its fibres one way and another.
    for way in {entry.fibres for entry in given.specimen}:
        names = (entry.name for entry in given.specimen if entry.fibres == way)
        check_distinct(toml, "specimen.name", names, "give every specimen a name of its own")
    own = given.recordings.channels() is None and given.recordings.table is None
    readable = recording_files(directory / "recordings")
    found: list[tuple[int | None, Path]] = []
    asked: list[tuple[int | None, str]] = [
        (k, pattern) for k, entry in enumerate(given.specimen) for pattern in entry.recordings
    ]
    for number, pattern in asked or [(None, "recordings/*")]:
        files = _matching(toml, directory, pattern, given.recordings.channels())
        if number is None:
            files = [path for path in files if path in readable and not is_channel_file(path, given.channels)]
            files = [path for path in files if own and path.suffix.lower() == ".csv"] or files
        if not files:
            where = "recordings" if number is None else f"specimen {given.specimen[number].name}"
            remedy = f"put CSV files of time_s,displacement_mm,force_N there, or an instrument's files: {GIVE_COLUMNS}"
            raise InputError(toml, where, f"there is no file {pattern!r}", remedy)
        found += [(number, path) for path in trials_in(files, given.recordings.channels())]
    named = (path.relative_to(directory).as_posix() for _, path in found)
    check_distinct(toml, "specimen.recordings", named, "name every recording once")
    check_printable(*(path for _, path in found))
    trials = [trial_of(path) for _, path in found]
    return [
        (one if trials.count(one) == 1 else (path.parent / one).relative_to(directory).as_posix(), number, path)
        for one, (number, path) in zip(trials, found, strict=True)
    ]


def _matching(toml: Path, directory: Path, pattern: str, channels: SourceColumns | None) -> list[Path]:
    """Return the files of a pattern, or tables in one (``book.xlsx/Trial *``), but what systems leave (``._x.csv``)."""
    if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
        raise InputError(toml, "specimen.recordings", f"{pattern!r} leaves the folder", "name files within it")
    try:
        found = sorted(path for path in directory.glob(pattern) if path.is_file())
        if not found and file_of(directory / pattern).is_file():
            found = [path for path in trials_in([file_of(directory / pattern)], channels) if path.match(pattern)]
    except ValueError:
        problem, remedy = f"{pattern!r} is not a pattern of files", "give one such as recordings/a*.csv"
        raise InputError(toml, "specimen.recordings", problem, remedy) from None
    return [path for path in found if not is_litter(path)]
