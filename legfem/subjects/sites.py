"""Sites of one leg: ``[[site]]`` of ``subject.toml``, each read as a subject of its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Annotated, Any, ClassVar

from pydantic import BaseModel, ConfigDict, Field

from legfem.common.errors import InputError
from legfem.common.toml_file import FileTable, PlainName, Text, checked, read_toml
from legfem.subjects.schema import HOLDER, SubjectFile

RECORDINGS = "recordings"
"""Folder of a leg's recordings; of a site, in it the folder of its name."""
_OWN = ("section", "indenter")


class SiteEntry(FileTable):
    """One of ``[[site]]``: what it has in place of what the file gives for all."""

    name: PlainName
    recordings: Text | None = None
    """Folder within the leg's; ``recordings/NAME`` without it."""
    section: dict[str, Any] = Field(default_factory=dict)
    indenter: dict[str, Any] = Field(default_factory=dict)
    instrument: dict[str, Any] = Field(default_factory=dict)
    starts_at_contact: bool | None = None

    @property
    def folder(self) -> str:
        """Of its recordings, within the leg's."""
        return self.recordings or f"{RECORDINGS}/{self.name}"


class _SitesFile(BaseModel):
    """The sites of a file; the rest is checked with each of them."""

    model_config: ClassVar[ConfigDict] = ConfigDict(extra="ignore", strict=True, frozen=True)
    site: Annotated[list[SiteEntry], Field(min_length=1)]


@dataclass(frozen=True, eq=False)
class SubjectEntry:
    """What ``subject.toml`` gives of one section, pressed at one place."""

    given: SubjectFile
    recordings: str
    """Folder within the subject's."""
    site: str = ""
    """Name; empty of a leg that was pressed at one place alone."""


def site_names(toml: Path) -> tuple[str, ...]:
    """Return the names of a leg's sites; none of a leg that was pressed at one place alone.

    Raises
    ------
    InputError
        If the file can't be read, or its sites are wrong.
    """
    return tuple(site.name for site in _sites(toml, read_toml(toml, HOLDER)))


def subject_entry(toml: Path, site: str = "") -> SubjectEntry:
    """Read and check ``subject.toml``, of a leg with several sites for one of them.

    Raises
    ------
    InputError
        For what `legfem.common.toml_file.parse_toml` raises one; if the leg has sites and none is
        named, or none of that name.
    """
    content = read_toml(toml, HOLDER)
    sites = {entry.name: entry for entry in _sites(toml, content)}
    if not sites:
        if site:
            raise InputError("--site", site, f"{toml} has no [[site]]", "leave it out")
        return SubjectEntry(checked(toml, content, SubjectFile), RECORDINGS)
    names = ", ".join(sites)
    if not site:
        raise InputError(
            toml,
            "site",
            f"the leg has {len(sites)} ({names}), and here one is taken by itself",
            f"give --site {next(iter(sites))}; python -m legfem.identify fits them together",
        )
    if site not in sites:
        raise InputError("--site", site, "is no site of the leg", f"give one of {names}")
    return _entry(toml, content, sites[site])


def _sites(toml: Path, content: Mapping[str, Any]) -> Sequence[SiteEntry]:
    if "site" not in content:
        return ()
    if not isinstance(content["site"], list):
        raise InputError(toml, "site", "is one table", "write [[site]] above each of the sites")
    sites = checked(toml, content, _SitesFile).site
    for what, values in (
        ("name", [site.name for site in sites]),
        ("recordings", [PurePath(site.folder).as_posix() for site in sites]),
    ):
        value, times = Counter(values).most_common(1)[0]
        if times > 1:
            raise InputError(
                toml,
                f"site.{what}",
                f"{times} sites have {value!r}",
                "give every site its own" if what == "name" else "keep its recordings apart",
            )
    for site in sites:
        path = PurePath(site.folder)
        if path.is_absolute() or ".." in path.parts:
            raise InputError(toml, "site.recordings", f"{site.folder!r} leaves the folder", "name one within it")
    return sites


def _entry(toml: Path, content: Mapping[str, Any], site: SiteEntry) -> SubjectEntry:
    """Return the file as it would be for one site alone."""
    own = {key: value for key, value in content.items() if key != "site"}
    for key in _OWN:
        shared = content.get(key, {})
        # What isn't a table is wrong, and told as such.
        own[key] = {**shared, **getattr(site, key)} if isinstance(shared, dict) else shared
    if site.instrument:
        own["instrument"] = site.instrument
    if site.starts_at_contact is not None:
        own["recordings"] = {**content.get("recordings", {}), "starts_at_contact": site.starts_at_contact}
    for key, joint in (("id", "-"), ("title", ", ")):
        if isinstance(content.get(key), str):
            own[key] = f"{content[key]}{joint}{site.name}"
    try:
        given = checked(toml, own, SubjectFile)
    except InputError as error:
        field = f"site {site.name}, {error.field}"
        raise InputError(error.source, field, error.problem, error.remedy) from None
    return SubjectEntry(given, site.folder, site.name)
