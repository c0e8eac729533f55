"""A folder of results as an RO-Crate: from which files, by which command, seed and versions, on which machine.

RO-Crate 1.1 (https://w3id.org/ro/crate/1.1); the run is a CreateAction. What was given stays where it is: the crate
names it by its content's hash, so that it tells nobody's folders.
"""

import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from legfem.common.contents import Contents
from legfem.common.documents import write_document
from legfem.common.input_files import lab_of
from legfem.report.folder import ReportFile
from legfem.report.page import WebPage

CRATE = "ro-crate-metadata.json"
_RO = "https://w3id.org/ro/crate/1.1"
_LICENSE = "that of the files which were given"


def write_crate(page: WebPage, folder: Path, files: Sequence[ReportFile]) -> ReportFile:
    """Write ``ro-crate-metadata.json``.

    Parameters
    ----------
    page
        What the results say, and how they were made.
    folder
        Where they are made; in the end they lie in the one above.
    files
        What they are.
    """
    graph: list[dict[str, Any]] = []

    def added(kind: str, entities: Mapping[str, Mapping[str, str]]) -> list[dict[str, str]]:
        kinds = {key: "Dataset" if key.endswith("/") else kind for key in entities}
        graph.extend({"@id": key, "@type": kinds[key], **more} for key, more in entities.items())
        return [{"@id": key} for key in entities]

    def named(kind: str, what: str, values: Mapping[str, str]) -> list[dict[str, str]]:
        return added(kind, {f"#{name}": {"name": name, what: value} for name, value in values.items()})

    repeat, shown = page.repeat, {path.name: one.shows for one in files for path in one.paths}
    numbers = {**repeat.numbers, "machine": f"{platform.platform()}, {os.cpu_count()} processors"}
    inputs = _inputs(repeat.inputs, folder.parent) if repeat.inputs else ()
    given = added("File", {f"urn:sha256:{digest}": {"name": name, "sha256": digest} for name, digest in inputs})
    slashes = {name: "/" * (folder / name).is_dir() for name in shown}
    made = added("File", {quote(k) + slashes[k]: {"name": k, "description": v} for k, v in shown.items()})
    action: dict[str, Any] = {"@id": "#run", "@type": "CreateAction", "name": repeat.command or "a call from Python"}
    action["instrument"] = named("SoftwareApplication", "version", repeat.versions)
    action["object"], action["result"] = given + named("PropertyValue", "value", numbers), made
    about = {"name": page.title, "description": page.headline.said, "datePublished": page.made.isoformat()}
    parts: dict[str, Any] = {"license": _LICENSE, "hasPart": made + given, "mentions": {"@id": "#run"}}
    root = {"@id": "./", "@type": "Dataset", **about, **parts}
    itself = {"@id": CRATE, "@type": "CreativeWork", "about": {"@id": "./"}, "conformsTo": {"@id": _RO}}
    context = [f"{_RO}/context", {"sha256": "https://schema.org/sha256"}]
    path = write_document(folder / CRATE, {"@context": context, "@graph": [itself, root, action, *graph]})
    return ReportFile([path], "what was given, by its hash, and by what all this was made (an RO-Crate)")


def _inputs(folder: Path, out: Path) -> Iterator[tuple[str, str]]:
    """Yield names and hashes of the files in a folder that was given, without results, and of its lab's file."""
    results = {out, *(crate.parent for crate in folder.rglob(CRATE))} - {folder}
    for name, digest in Contents(folder).digest():
        if "/." not in f"/{name}" and results.isdisjoint((folder / name).parents):
            yield name, digest
    if (lab := lab_of(folder)) is not None:
        yield lab.name, Contents(lab).digest()[0][1]
