"""Which files of a specimen folder are recordings, and of which specimen."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from legfem.common.errors import Doubt, InputError
from legfem.common.input_files import check_distinct, check_printable
from legfem.data.channel_reader import is_channel_file
from legfem.data.formats import READERS, is_litter, recording_files
from legfem.data.formats.sheet import file_of, trial_of
from legfem.data.plausibility import unread_doubts
from legfem.data.reader import trials_in
from legfem.data.recording import SourceColumns
from legfem.specimens.schema import SpecimenFile


def unread_files(directory: Path, given: SpecimenFile, read: Sequence[Path]) -> Iterator[Doubt]:
    """Yield a doubt about files beside the recordings that nothing reads, if there are any."""
    folder = directory / "recordings"
    there = {file_of(path) for path in read}
    others = [f for f in recording_files(folder) if f not in there and not is_channel_file(f, given.channels)]
    name_them = "name every file under [[specimen]], remove the others, or give [recordings]"
    yield from unread_doubts(folder, others, f"{name_them} from `legfem data look --specimens`")


def named_recordings(directory: Path, toml: Path, given: SpecimenFile) -> list[tuple[str, int | None, Path]]:
    """Return name, number of the specimen (None where there is but one) and file of recordings."""
    # A piece may be tested with its fibres one way and another.
    for way in {entry.fibres for entry in given.specimen}:
        names = (entry.name for entry in given.specimen if entry.fibres == way)
        check_distinct(toml, "specimen.name", names, "give every specimen a name of its own")
    own = given.recordings.channels() is None and given.recordings.table is None
    suffixes = {".csv"} if own else set(READERS)
    found: list[tuple[int | None, Path]] = []
    asked: list[tuple[int | None, str]] = [
        (k, pattern) for k, entry in enumerate(given.specimen) for pattern in entry.recordings
    ]
    for number, pattern in asked or [(None, "recordings/*")]:
        files = _matching(toml, directory, pattern, given.recordings.channels())
        if number is None:
            files = [path for path in files if path.suffix.lower() in suffixes]
            files = [path for path in files if not is_channel_file(path, given.channels)]
        if not files:
            where = "recordings" if number is None else f"specimen {given.specimen[number].name}"
            raise InputError(
                toml,
                where,
                f"there is no file {pattern!r}",
                "put one CSV file for each recording there: time_s,displacement_mm,force_N; or give "
                "the channels of your instrument's files, from `legfem data look`",
            )
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
        raise InputError(
            toml, "specimen.recordings", f"{pattern!r} is not a pattern of files", "give one such as recordings/a*.csv"
        ) from None
    return [path for path in found if not is_litter(path)]
