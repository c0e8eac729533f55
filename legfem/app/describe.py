"""Makes a folder for the commands of files that were dropped loosely."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import tomlkit

from legfem.app.settings import Setting, Value, settings_of, with_settings
from legfem.app.workspace import files_of, is_scan, may_be_recording
from legfem.common.documents import write_atomically
from legfem.common.input_files import checked
from legfem.geometry.indenter import IndenterShape
from legfem.legs.folder import plain_id, subject_text
from legfem.legs.schema import SubjectFile
from legfem.specimens.schema import SIZES, SpecimenFile


@dataclass(frozen=True)
class PressedLeg:
    """What a person has to say of a leg that was pressed; nothing else can be assumed."""

    title: str
    source: str
    """File in the folder: contours of the section, or a scan that it is cut from."""
    diameter: float
    """Of what pressed, mm."""
    length: float | None
    """Of a cylinder along its axis, mm."""
    aim: tuple[float, float]
    """A point on its line of travel, mm."""
    direction: float
    """Of travel, degrees from +x."""
    level: float | None = None
    """At which a scan is cut, mm."""
    shape: IndenterShape = "cylinder"
    axis_deg: float = 0.0
    """By which a cylinder is turned about its travel: 0 lies along the leg, 90 across it."""

    def describe(self, folder: Path) -> None:
        """Write ``subject.toml``, and move the recordings where it looks for them.

        The tissues are the first paper's until they are changed; errors of the instrument are left
        out: the commands ask for them.

        Raises
        ------
        InputError
            As the file does; nothing is written or moved then.
        """
        text = subject_text(plain_id(folder.name), self.title, "measured", 0.6, self.aim, self.direction)
        stated: dict[tuple[str, ...], Value] = {
            ("section", "contours"): None,
            ("section", "scan" if is_scan(folder / self.source) else "contours"): self.source,
            ("section", "level_mm"): self.level,
            ("indenter", "diameter_mm"): self.diameter,
            ("indenter", "length_mm"): self.length,
            ("indenter", "shape"): None if self.shape == "cylinder" else self.shape,
            ("indenter", "axis_deg"): self.axis_deg or None,
            ("instrument",): None,
        }
        path, described = folder / "subject.toml", with_settings(text, stated)
        checked(path, tomllib.loads(described), SubjectFile)
        _gather_recordings(folder, but=[self.source])
        write_atomically(path, described)


@dataclass(frozen=True)
class DressedLeg:
    """What a person has to say of a leg in a stocking."""

    title: str
    bare: str
    """Scan of the bare leg: a file in the folder."""
    compressed: str
    """Of the leg in its stocking; may be empty."""
    compression_class: str

    def describe(self, folder: Path) -> None:
        """Write ``leg.toml``."""
        text = tomlkit.document()
        text.update({"id": plain_id(folder.name), "title": self.title, "origin": "measured"})
        text["bare"] = {"scan": self.bare}
        if self.compressed:
            text["compressed"] = {"scan": self.compressed}
        text["stocking"] = {"compression_class": self.compression_class}
        write_atomically(folder / "leg.toml", tomlkit.dumps(text))


@dataclass(frozen=True)
class LabSpecimens:
    """What a person has to say of specimens of one size; others' sizes go into the file's text."""

    title: str
    test: str
    """A table of ``specimen.toml``: what was done to them."""
    stated: Mapping[str, Value]
    """Sizes of specimen and instrument and what sticks, by the table's keys; None is left out."""

    def describe(self, folder: Path) -> None:
        """Write ``specimen.toml``, and move the recordings where it looks for them."""
        text = tomlkit.document()
        text.update({"id": plain_id(folder.name), "title": self.title, "origin": "measured"})
        text[self.test] = {key: value for key, value in self.stated.items() if value is not None}
        _gather_recordings(folder)
        write_atomically(folder / "specimen.toml", tomlkit.dumps(text))


def _gather_recordings(folder: Path, but: Collection[str] = ()) -> None:
    """Move what may be recordings into the folder's folder of them."""
    recordings = folder / "recordings"
    for path in files_of(folder):
        inside = path.parent == folder and path.name not in but
        if inside and may_be_recording(path) and not is_contours(path):
            recordings.mkdir(exist_ok=True)
            path.rename(recordings / path.name)


def known_tests() -> dict[str, list[Setting]]:
    """Return the tests that ``specimen.toml`` can have, each with what is asked for.

    A size that several specimens could have of their own is needed: here there is one.
    """
    every: dict[str, list[Setting]] = {}
    for name in SpecimenFile.alternatives:
        found = settings_of(SpecimenFile, f"[{name}]\n")
        every[name] = [replace(one, needed=one.needed or one.key[-1] in SIZES) for one in found if one.key[0] == name]
    return every


def is_contours(path: Path) -> bool:
    """Tell whether a file holds contours of a section."""
    with path.open("rb") as file:
        return path.suffix.lower() == ".csv" and file.readline(200).startswith(b"part,")


def contours_in(folder: Path) -> list[str]:
    """Return the names of files with contours."""
    return [path.name for path in folder.glob("*.csv") if is_contours(path)]


def scans_in(folder: Path) -> list[str]:
    """Return the paths of scans within a folder."""
    return [path.relative_to(folder).as_posix() for path in files_of(folder) if is_scan(path)]
