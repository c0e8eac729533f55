"""The public recordings as folders of specimens, which ``legfem identify --specimen-dir`` reads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tomlkit

from legfem.common.documents import write_atomically
from legfem.data import Recording, write_recording
from studies.recordings.data import MeatTest, Phantom, phantom_kinds, read_meat, read_phantoms


@dataclass(frozen=True)
class Assumed:
    """What the recordings' sheets don't state, mm."""

    ball_radius: float = 5.0
    layer_radius: float = 40.0


def write_specimen_folders(data: Path, out: Path, assumed: Assumed) -> list[Path]:
    """Write a folder a material and kind of phantom; return them.

    Indentations stand in a folder a material, phantoms in a folder a kind; see
    `studies.recordings.data` for what is read.
    """
    made = []
    meat = list(read_meat(data).values())
    for material in dict.fromkeys(test.material for test in meat):
        own = [test for test in meat if test.material == material]
        made.append(_meat_folder(own, out / material, assumed))
    for kind in phantom_kinds(data):
        made.append(write_phantom(read_phantoms(data, kind), out / kind, "bonded"))
    return made


def _meat_folder(tests: Sequence[MeatTest], out: Path, assumed: Assumed) -> Path:
    ball = {"ball_diameter_mm": 2 * assumed.ball_radius, "diameter_mm": 2 * assumed.layer_radius}
    specimens = []
    for test in tests:
        name = test.name.replace("|", "-").replace("/", "-")
        file = _written(test.recording, out, name)
        specimens.append({"name": name, "recordings": [file], "thickness_mm": test.thickness})
    return _finished(out, {"ball": ball, "specimen": specimens})


def _written(recording: Recording, out: Path, name: str) -> str:
    file = f"recordings/{name}.csv"
    (out / "recordings").mkdir(parents=True, exist_ok=True)
    write_recording(recording, out / file)
    return file


def write_phantom(phantoms: Sequence[Phantom], out: Path, ends: str) -> Path:
    """Write a folder of phantoms of one kind; return it."""
    first = phantoms[0]
    for phantom in phantoms:
        _written(phantom.recording, out, phantom.recording.trial)
    plates = {"diameter_mm": 2 * first.radius, "height_mm": first.height, "ends": ends}
    return _finished(out, {"plates": plates})


def _finished(out: Path, test: Mapping[str, Any]) -> Path:
    document = {"id": out.name, "title": out.name, "origin": "measured", **test}
    write_atomically(out / "specimen.toml", tomlkit.dumps(document))
    return out
