"""Which files of a specimen folder are recordings, and of which specimen."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from legfem.common.errors import Doubt, InputError
from legfem.common.input_files import check_distinct, check_printable
from legfem.data.channel_reader import is_channel_file
from legfem.data.formats import READERS, is_litter, recording_files
from legfem.data.plausibility import unread_doubts
from legfem.specimens.schema import SpecimenFile


def unread_files(directory: Path, given: SpecimenFile, read: Sequence[Path]) -> Iterator[Doubt]:
    """Yield a doubt about files beside the recordings that nothing reads, if there are any."""
    folder = directory / "recordings"
    others = [f for f in recording_files(folder) if f not in read and not is_channel_file(f, given.channels)]
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
        files = _matching(toml, directory, pattern)
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
        found += [(number, path) for path in files]
    named = (path.relative_to(directory).as_posix() for _, path in found)
    check_distinct(toml, "specimen.recordings", named, "name every recording once")
    check_printable(*(path for _, path in found))
    stems = Counter(path.stem for _, path in found)
    return [
        (path.stem if stems[path.stem] == 1 else path.relative_to(directory).with_suffix("").as_posix(), number, path)
        for number, path in found
    ]


def _matching(toml: Path, directory: Path, pattern: str) -> list[Path]:
    """Return the files of a pattern but what systems leave beside them (``._x.csv``, ``~$x.xlsx``)."""
    if Path(pattern).is_absolute() or ".." in Path(pattern).parts:
        raise InputError(toml, "specimen.recordings", f"{pattern!r} leaves the folder", "name files within it")
    try:
        found = sorted(path for path in directory.glob(pattern) if path.is_file())
    except ValueError:
        raise InputError(
            toml, "specimen.recordings", f"{pattern!r} is not a pattern of files", "give one such as recordings/a*.csv"
        ) from None
    return [path for path in found if not is_litter(path)]
