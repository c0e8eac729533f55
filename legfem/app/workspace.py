"""A folder that holds all that the app knows: what was given, what was seen in it, and the runs.

``inputs/NAME/`` is a folder for the commands as a user gave it, ``previews/NAME/KEY/`` what was
seen in it before anything was solved, ``runs/NAME/`` a run (`legfem.app.runs`), ``deleted/`` what
can be put back.
"""

import json
import os
import re
import secrets
import shutil
import tomllib
from collections.abc import AsyncIterable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from hashlib import sha256
from itertools import count
from pathlib import Path

from legfem.common.documents import legfem_version
from legfem.common.errors import InputError
from legfem.common.input_files import LAB, FileTable, read_text
from legfem.legs.schema import SubjectFile
from legfem.specimens.schema import SpecimenFile
from legfem.stockings.schema import LegFile

DESCRIPTIONS: dict[str, type[FileTable]] = {
    "subject.toml": SubjectFile,
    "leg.toml": LegFile,
    "specimen.toml": SpecimenFile,
}
"""Files that say what a folder is, and their schemas. No schema stands on the finite elements: they
bring MPI, which this process must not start."""
SCANS = (".nii", ".nii.gz", ".nrrd", ".seg.nrrd", ".dcm")
_MOST_PARTS, _LONGEST = 4, 200
_FEWEST_FREE, _MOST_BYTES = 200e6, 1_000_000_000
"""Bytes that uploads leave free on the disk, and that a file may have: a scan of a leg has a fifth."""


def plain_name(name: str) -> str:
    """Return a name of a file or folder if it can't lead out of its folder.

    Raises
    ------
    InputError
        For a name with separators or control characters, one that begins with a dot or a dash,
        and one that is too long.
    """
    bad = re.search(r"[/\\:\x00-\x1f\x7f]", name) or name[:1] in ("", ".", "-", " ", "~")
    if bad or len(name.encode()) > _LONGEST:
        remedy = "name files and folders without separators, and begin with a letter or a digit"
        raise InputError("upload", "name", f"{name[:80]!r} is not a plain name", remedy)
    return name


@dataclass(frozen=True)
class Workspace:
    """The folder.

    Parameters
    ----------
    folder : Path
        Made if it is missing.
    """

    folder: Path

    @classmethod
    def opened(cls, folder: Path) -> "Workspace":
        """Return a workspace, its folders made; nobody else on the machine may look in.

        Raises
        ------
        InputError
            If it can't be made or written to.
        """
        folder = folder.absolute()
        try:
            for part in ("inputs", "previews", "runs"):
                (folder / part).mkdir(parents=True, exist_ok=True)
            folder.chmod(0o700)
        except OSError as error:
            problem = f"can't be made or written to ({error.strerror})"
            raise InputError("--workspace", str(folder), problem, "give a folder of your own") from None
        return cls(folder)

    @property
    def lab(self) -> Path:
        """The file of what all inputs have alike; it may be missing."""
        return self.folder / LAB

    @property
    def inputs(self) -> list[str]:
        """Names of what was given, the latest first."""
        return _latest_first(self.folder / "inputs")

    @property
    def runs(self) -> list[str]:
        """Names of the runs, the latest first."""
        return _latest_first(self.folder / "runs")

    def input(self, name: str) -> Path:
        """Return the folder of what was given.

        Raises
        ------
        InputError
            If there is none of that name.
        """
        return _existing(self.folder / "inputs", name)

    def run(self, name: str) -> Path:
        """Return the folder of a run; raises as `input` does."""
        return _existing(self.folder / "runs", name)

    def free_run(self, wish: str) -> str:
        """Return the name that a new run would get."""
        return _free(self.folder / "runs", wish)

    def new_input(self, wish: str) -> str:
        """Make an empty input of the wished name, or with a number behind it; return the name."""
        return _new(self.folder / "inputs", wish)

    def new_run(self, wish: str) -> str:
        """Make the empty folder of a run as `new_input` does."""
        return _new(self.folder / "runs", wish)

    def copied(self, folder: Path, wish: str) -> str:
        """Copy a folder that comes with legfem to a new input; return its name."""
        name = self.new_input(wish)
        shutil.copytree(folder, self.input(name), dirs_exist_ok=True)
        return name

    def rename_input(self, name: str, wish: str) -> str:
        """Move an input to the wished name, or one with a number behind it; return the name."""
        given, now = self.input(name), self.new_input(wish)
        given.replace(self.folder / "inputs" / now)
        shutil.rmtree(self.folder / "previews" / name, ignore_errors=True)
        return now

    @property
    def deleted(self) -> list[tuple[str, str]]:
        """What can be put back, as kind (``inputs`` or ``runs``) and name, the latest first."""
        return [(kind, name) for kind in ("inputs", "runs") for name in _latest_first(self.folder / "deleted" / kind)]

    def delete(self, kind: str, name: str) -> str:
        """Put an input or a run aside, from where `put_back` takes it; return its name there."""
        deleted = self.folder / "deleted" / kind
        deleted.mkdir(parents=True, exist_ok=True)
        now = deleted / _free(deleted, name)
        _existing(self.folder / kind, name).replace(now)
        os.utime(now)  # what was deleted last stands first
        return now.name

    def put_back(self, kind: str, name: str) -> str:
        """Undo a deletion; return the name, which has a number behind it where it was given anew meanwhile."""
        given = _existing(self.folder / "deleted" / kind, name)
        now = _free(self.folder / kind, name)
        given.replace(self.folder / kind / now)
        return now

    def place(self, name: str, path: str) -> Path:
        """Return where a file of an input is, or is to be.

        Raises
        ------
        InputError
            If a part of the path is not a plain name, or it lies in too many folders.
        """
        parts = path.split("/")
        if len(parts) > _MOST_PARTS:
            raise InputError(
                "upload", path, "lies in too many folders", f"use at most {_MOST_PARTS - 1} folders inside each other"
            )
        return self.input(name).joinpath(*(plain_name(part) for part in parts))

    async def receive(self, name: str, path: str, content: AsyncIterable[bytes]) -> Path:
        """Write a file as it comes in: there whole, or not at all.

        Raises
        ------
        InputError
            As `place` does, and where the disk is full, the file too large or a folder in the way.
        """
        target = self.place(name, path)
        part = target.with_name(f".part-{secrets.token_hex(4)}")
        refused = partial(InputError, "upload", path)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            with part.open("xb") as file:
                async for piece in content:
                    if shutil.disk_usage(target.parent).free < len(piece) + _FEWEST_FREE:
                        raise refused("the disk is full", "free some of it")
                    if file.tell() + len(piece) > _MOST_BYTES:
                        most = f"has more than {_MOST_BYTES / 1e6:,.0f} MB"
                        raise refused(most, "cut the scan to the leg, or use the command line")
                    file.write(piece)
            part.replace(target)
        except OSError as error:
            raise refused(f"can't be written ({error.strerror})", "free the disk, or give it another name") from None
        finally:
            part.unlink(missing_ok=True)
        return target

    def preview(self, name: str) -> Path:
        """Return the folder for what is seen in an input as it is now; made if it is missing.

        Its name is a key of the input's files (names, sizes and times) and of legfem's version: a
        changed input is looked at anew.
        """
        given = self.input(name)
        shared = [self.lab] if self.lab.is_file() else []
        stats = [(os.path.relpath(path, given), path.stat()) for path in [*files_of(given), *shared]]
        seen = sorted((path, stat.st_size, stat.st_mtime_ns) for path, stat in stats)
        folder = self.folder / "previews" / name / sha256(repr((legfem_version(), seen)).encode()).hexdigest()[:16]
        folder.mkdir(parents=True, exist_ok=True)
        return folder


def files_of(folder: Path) -> list[Path]:
    """Return the files of an input in the order of their names, without hidden ones."""
    return sorted(
        path
        for path in folder.rglob("*")
        if path.is_file() and not any(p.startswith(".") for p in path.relative_to(folder).parts)
    )


def description_of(folder: Path) -> str | None:
    """Return the name of the TOML file that says what a folder is; None where there is none."""
    return next((name for name in DESCRIPTIONS if (folder / name).is_file()), None)


def text_of(path: Path) -> str:
    """Return the text of a description; of one that can't be read, as Windows would show it, to be mended."""
    try:
        return read_text(path, "", "")
    except InputError:
        return path.read_text("cp1252", errors="replace")


def check_within(folder: Path) -> None:
    """Check that what a folder's description names lies within it: whoever wrote that may be anybody.

    Raises
    ------
    InputError
        If it names another folder or a file there.
    """
    described = description_of(folder)
    with suppress(OSError, ValueError):  # no TOML at all, or no path
        content = json.dumps(tomllib.loads(text_of(folder / described)) if described else {}, default=str)
        for text in map(json.loads, re.findall(r'"(?:[^"\\]|\\.)*"', content)):
            with suppress(OSError, ValueError):  # no path
                path = (folder / text).resolve()
                if path.exists() and not path.is_relative_to(folder.resolve()):
                    raise InputError(described or "", text, "lies in another folder", "add the file here, and name it")


def is_scan(path: Path) -> bool:
    """Tell whether a file may be a label volume."""
    return path.name.lower().endswith(SCANS)


def _existing(parent: Path, name: str) -> Path:
    folder = parent / plain_name(name)
    if not folder.is_dir():
        raise InputError("workspace", name, f"there is none in {parent}", "choose one that is there")
    return folder


def _free(parent: Path, wish: str) -> str:
    plain = re.sub(r"[^\w. -]", "-", wish).strip(". -")[:60] or "leg"
    names = (plain if number == 1 else f"{plain}-{number}" for number in count(1))
    return next(name for name in names if not (parent / name).exists())


def _new(parent: Path, wish: str) -> str:
    while True:
        name = _free(parent, wish)
        try:
            (parent / name).mkdir()
        except FileExistsError:
            continue  # another tab was faster
        return name


def _latest_first(parent: Path) -> list[str]:
    if not parent.is_dir():
        return []
    there = [path for path in parent.iterdir() if path.is_dir() and path.name[:1] != "."]
    return [path.name for path in sorted(there, key=lambda p: (-p.stat().st_mtime, p.name))]
