"""What is seen in a folder before anything is solved: of a leg, of specimens, of recordings."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path

from legfem.common.documents import write_document
from legfem.common.errors import Command, InputError, doubt_lines
from legfem.common.input_files import check_printable
from legfem.common.progress import Progress
from legfem.data import Scales, Segmentation, seen_instrument, segment
from legfem.data.columns import Proposal, propose
from legfem.data.contact import LEG
from legfem.data.formats import Sheet, read_sheets, recording_files
from legfem.data.quality import quality_of
from legfem.data.reader import trials_in
from legfem.data.recording import PLAIN_COLUMNS, SourceColumns, recording_of
from legfem.geometry.leg_shape import perimeter
from legfem.geometry.section import fat_thickness, girth
from legfem.legs.loading import load_sites, load_subject, trial_files
from legfem.legs.plausibility import doubts_about, room_before
from legfem.legs.schema import RECORDINGS, SUBJECTS, site_names, subject_entry
from legfem.legs.subject import Subject
from legfem.report.instrument_file import draw_look, look_text
from legfem.report.leg_figure import SECTION_SHOWS, placement_figure, slices_figure
from legfem.report.style import save
from legfem.specimens.folder import FILE, load_specimen
from legfem.specimens.schema import SeveralTests, parse_specimen_file
from legfem.stockings.loading import LEGS, load_leg

PREVIEW = "preview.json"


@dataclass(frozen=True)
class SeenColumn:
    """A column of numbers in an instrument's file."""

    sheet: str
    name: str
    unit: str
    """Empty where none is stated."""


@dataclass(frozen=True)
class SeenRecording:
    """One file of recordings."""

    file: str
    grade: str = ""
    reasons: tuple[str, ...] = ()
    """For the grade; the best has none."""
    text: str = ""
    """What `legfem.data look` prints of it."""
    picture: str = ""
    trouble: str = ""
    """The line that says why it can't be read; empty where it can."""
    channels: SourceColumns | None = None
    """By which it was read."""
    columns: tuple[SeenColumn, ...] = ()
    noise: tuple[float, float] | None = None
    """Errors of force (N) and displacement (mm) from sample to sample."""
    sizes: Mapping[str, float] = field(default_factory=dict)
    """The specimen's, as the file's heading states them (`legfem.data.Recording`)."""


@dataclass(frozen=True)
class Preview:
    """What is seen in a folder."""

    title: str
    origin: str
    trouble: str = ""
    """The line with which the commands would refuse the folder; empty where they don't."""
    unsaid: bool = False
    """Whether that says that something is missing, and nothing is wrong."""
    doubts: tuple[str, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    pictures: tuple[tuple[str, str], ...] = ()
    """Files, and what they show in words."""
    recordings: tuple[SeenRecording, ...] = ()

    @classmethod
    def refused(cls, folder: Path, error: InputError, recordings: tuple[SeenRecording, ...] = ()) -> "Preview":
        """Return what is seen in a folder that can't be read."""
        return cls(folder.name, "", told(error), error.unsaid, recordings=recordings)

    def write(self, out: Path) -> Path:
        """Write ``preview.json``; return its path."""
        return write_document(out / PREVIEW, asdict(self))

    @property
    def text(self) -> str:
        """The same to print."""
        facts = [f"{what}: {value}" for what, value in self.facts]
        seen = [one.text or one.trouble for one in self.recordings]
        return "\n".join([self.title, *self.doubts, *facts, "", *seen])


def told(error: InputError) -> str:
    """Return an error's line, which says what to click in the app before it names a command."""
    in_app = "choose it under Columns in the app, or run"
    return str(error.worded(lambda one: f"{in_app} {one}" if isinstance(one, Command) else str(one)))


def preview_of(folder: Path, out: Path, progress: Progress | None = None) -> Preview:
    """Look at a folder, and draw what is seen into another; nothing is solved."""
    kinds: dict[str, Callable[[Path, Path], Preview]] = {
        SUBJECTS.file: _leg,
        LEGS.file: partial(_stocking, progress=progress),
        FILE: _specimen,
    }
    kind = next((look for file, look in kinds.items() if (folder / file).is_file()), None)
    if kind is not None:
        return kind(folder, out)
    folders = [folder, *sorted(path for path in folder.rglob("*") if path.is_dir())]
    recordings = []
    for path in (path for one in folders for path in recording_files(one)):
        with path.open("rb") as file:
            # Contours are tables of numbers, too.
            recordings += [] if file.readline(200).startswith((b"part,", b"level_mm,")) else [path]
    seen = _recordings(recordings, out, None, of_specimen=True)
    problem = f"contains no {SUBJECTS.file}, {LEGS.file} or {FILE}"
    if not any(one.columns or not one.trouble for one in seen):
        problem += ", nor a recording that can be read"
    remedy = "add one of them: it describes the leg, the test and the instruments"
    return Preview.refused(folder, InputError(folder, "folder", problem, remedy), seen)


def _leg(folder: Path, out: Path) -> Preview:
    try:
        names = site_names(folder / SUBJECTS.file)
    except InputError as error:
        return Preview.refused(folder, error, _recordings(recording_files(folder / RECORDINGS), out, None))
    if not names:
        return _site(folder, out)
    sites = {name: _site(folder, out, name) for name in names}
    trouble, unsaid = next(((site.trouble, site.unsaid) for site in sites.values() if site.trouble), ("", False))
    if not trouble:
        try:
            load_sites(folder)
        except InputError as error:  # between sites, as copies
            trouble, unsaid = told(error), error.unsaid
    return Preview(
        f"{len(sites)} sites of one leg: {', '.join(site.title for site in sites.values())}",
        next(iter(sites.values())).origin,
        trouble,
        unsaid,
        tuple(f"{name}: {line}" for name, site in sites.items() for line in site.doubts),
        tuple((f"{name}: {what}", fact) for name, site in sites.items() for what, fact in site.facts),
        tuple(picture for site in sites.values() for picture in site.pictures),
        tuple(recording for site in sites.values() for recording in site.recordings),
    )


def _site(folder: Path, out: Path, name: str = "") -> Preview:
    channels, recordings = None, folder / RECORDINGS
    try:
        entry = subject_entry(folder / SUBJECTS.file, name)
        channels, recordings = entry.given.recordings.channels(), folder / entry.recordings
    except InputError as error:
        return Preview.refused(folder, error, _recordings(recording_files(recordings), out, None))
    trouble, unsaid, files = "", False, trial_files(folder, entry)
    try:
        subject = load_subject(folder, site=name)
    except InputError as error:
        trouble, unsaid = told(error), error.unsaid
        try:
            subject = load_subject(folder, need_recordings=False, need_instrument=False, site=name)
        except InputError:
            return Preview.refused(folder, error, _recordings(files, out, channels, site=name))
    seen = _recordings(files, out, channels, site=name, trials=subject.trials)
    picture = f"section-{name}" if name else "section"
    drawn = save(placement_figure(subject), out, picture)[0].name
    doubts, facts = tuple(doubt_lines(doubts_about(subject))), tuple(_leg_facts(subject))
    pictures = ((drawn, SECTION_SHOWS),)
    return Preview(subject.title, subject.origin, trouble, unsaid, doubts, facts, pictures, seen)


def _leg_facts(subject: Subject) -> list[tuple[str, str]]:
    section, indenter, known = subject.section, subject.indenter, subject.accuracy
    fat = fat_thickness(section, indenter.aim, indenter.direction)
    stated = {
        "outlines": (known.contour_sd, "mm"),
        "aim": (known.aim_sd, "mm"),
        "direction": (known.direction_sd, "degrees"),
        "first contact": (known.contact_sd, "mm"),
        "what the rig yields": (known.rig_sd, "mm/N"),
        "fat, fascia, compressibility": (None if known.assumed_sd is None else 100 * known.assumed_sd, "%"),
    }
    accuracy = "; ".join(f"{what} ± {value:g} {unit}" for what, (value, unit) in stated.items() if value is not None)
    read, trials = subject.instrument, len(subject.recordings)
    given = [("trials", f"{trials}"), ("errors of a reading", f"{read.force_sd:.2g} N, {read.displacement_sd:.2g} mm")]
    return [
        *((("section", f"cut from {subject.cut_from}"),) if subject.cut_from else ()),
        ("girth", f"{girth(section):.0f} mm"),
        ("fat under the indenter", f"{fat:.1f} mm"),
        ("room before a bone", f"{room_before(subject):.0f} mm"),
        ("indenter", f"{indenter}"),
        *(given if trials else ()),
        ("how well the leg is known", accuracy or "not stated: what is usual is assumed"),
    ]


def _stocking(folder: Path, out: Path, progress: Progress | None) -> Preview:
    try:
        leg = load_leg(folder, progress)
    except InputError as error:
        return Preview.refused(folder, error)
    picture = save(slices_figure(leg), out, "slices")[0].name
    facts = [
        ("modelled", f"{leg.bare.length:.0f} mm of the leg"),
        ("girths", f"{perimeter(leg.bare).min():.0f} to {perimeter(leg.bare).max():.0f} mm"),
        ("stiffness", "not needed" if leg.girth_sd else "given" if leg.known else "to be found from both scans"),
    ]
    if leg.registration is not None:
        facts.append(("scans' bones agree within", f"{leg.registration.residual:.2f} mm"))
    shown = "Outlines of skin and muscle at three heights, bare and in the stocking; by tape, rings of its girths."
    doubts = tuple(doubt_lines(leg.doubts))
    return Preview(leg.title, leg.origin, doubts=doubts, facts=tuple(facts), pictures=((picture, shown),))


def _specimen(folder: Path, out: Path) -> Preview:
    places: dict[str, SourceColumns | None] = {"": None}
    with suppress(InputError):  # load_specimen says what is wrong
        given = parse_specimen_file(folder / FILE)
        places = dict.fromkeys(given.tests) if isinstance(given, SeveralTests) else {"": given.recordings.channels()}

    def seen(trials: Sequence[Segmentation] = ()) -> tuple[SeenRecording, ...]:
        files = {test: recording_files(folder / test / "recordings") for test in places}
        return tuple(one for test in places for one in _recordings(files[test], out, places[test], True, test, trials))

    try:
        found = load_specimen(folder)
    except InputError as error:
        return Preview.refused(folder, error, seen())
    facts = []
    for one in found.recordings:
        course, axes = one.course, one.axes
        speed = f" at {course.rate:.3g} mm/s" if one.recording.timed else ""
        way = f"{axes.way} to {axes.ways * course.depth:.3g} {axes.way_unit}{speed}"
        facts.append((one.name, f"{way}, {axes.load} to {axes.load_text(course.peak)}"))
    left = tuple(f"NOT USED: {one.name}: {one.reason}" for one in found.left_out)
    doubts = (*doubt_lines(found.doubts), *left)
    trials = [one.trial for one in found.recordings]
    return Preview(found.title, found.origin, doubts=doubts, facts=tuple(facts), recordings=seen(trials))


def _recordings(
    files: Sequence[Path],
    out: Path,
    channels: SourceColumns | None,
    of_specimen: bool = False,
    site: str = "",
    trials: Sequence[Segmentation] = (),
) -> tuple[SeenRecording, ...]:
    """Return what is seen in files, as ``trials`` have read those that a folder uses."""
    read = {trial.recording.source: trial for trial in trials}
    files = trials_in(files, channels)
    return tuple(_recording(path, out, channels, of_specimen, site, read.get(path)) for path in files)


_OF_PLAIN_COLUMNS = Proposal(PLAIN_COLUMNS, ("legfem's own columns",))


def _proposal(path: Path, sheets: Sequence[Sheet], channels: SourceColumns | None, used: bool) -> Proposal:
    """Return by which columns a file is read; of one that a folder uses those that the folder reads."""
    if channels is not None:
        return Proposal(channels, ("as the folder's [recordings] say",))
    try:
        return propose(path, sheets)
    except InputError:
        if not used:
            raise
        return Proposal(PLAIN_COLUMNS, ("as the folder's test says: pressure times area, or angle and torque",))


def _recording(
    path: Path, out: Path, channels: SourceColumns | None, of_specimen: bool, site: str, trial: Segmentation | None
) -> SeenRecording:
    columns: tuple[SeenColumn, ...] = ()
    own = None if channels is not None or trial is None or not trial.recording.channels else trial.recording
    try:
        check_printable(path)
        sheets = [] if own else read_sheets(path)
        columns = tuple(SeenColumn(sheet.name or "", c.name, c.unit or "") for sheet in sheets for c in sheet.columns)
        proposal = _OF_PLAIN_COLUMNS if own else _proposal(path, sheets, channels, trial is not None)
        recording = trial.recording if trial else recording_of(path, sheets, proposal.channels)
        scales = Scales.of_specimen(recording) if of_specimen else LEG
        quality = quality_of(trial or segment(recording, scales=scales))
    except InputError as error:
        shown = "".join(c if c.isprintable() else "?" for c in path.name)
        return SeenRecording(shown, trouble=told(error), columns=columns)
    # Trials of two sites may have one name.
    drawn = replace(recording, trial=f"{site}-{recording.trial}" if site else recording.trial)
    picture = draw_look(drawn, quality, out).name
    text, instrument = look_text(recording, proposal, quality), seen_instrument([recording])
    return SeenRecording(
        f"{site}/{path.name}" if site else path.name,
        quality.grade,
        tuple(why for _, why in quality.judged),
        text,
        picture,
        channels=proposal.channels,
        columns=columns,
        noise=(instrument.force_sd, instrument.displacement_sd),
        sizes=recording.sizes,
    )
