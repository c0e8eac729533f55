"""The public recordings as folders of specimens, which ``legfem identify --specimen-dir`` reads."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from legfem.common.documents import write_atomically
from legfem.data import Recording, write_recording
from studies.recordings.data import MeatTest, Phantom, phantom_kinds, read_meat, read_phantoms


@dataclass(frozen=True)
class Assumed:
    """What the recordings' sheets don't state, mm."""

    ball_radius: float = 5.0
    layer_radius: float = 40.0


_HEAD = """\
id = {id}
title = {title}
origin = "measured"

{test}
"""


_SPECIMEN = """\
[[specimen]]
name = {name}
recordings = {recordings}
{sizes}
"""


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
    ball = f"[ball]\nball_diameter_mm = {2 * assumed.ball_radius}\ndiameter_mm = {2 * assumed.layer_radius}"
    blocks = [_HEAD.format(id=json.dumps(out.name), title=json.dumps(out.name), test=ball)]
    for test in tests:
        name = test.name.replace("|", "-").replace("/", "-")
        file = _written(test.recording, out, name)
        sizes = f"thickness_mm = {test.thickness}"
        blocks.append(_SPECIMEN.format(name=json.dumps(name), recordings=json.dumps([file]), sizes=sizes))
    return _finished(out, blocks)


def _written(recording: Recording, out: Path, name: str) -> str:
    file = f"recordings/{name}.csv"
    (out / "recordings").mkdir(parents=True, exist_ok=True)
    write_recording(recording, out / file)
    return file


def write_phantom(phantoms: Sequence[Phantom], out: Path, ends: str) -> Path:
    """Write a folder of phantoms of one kind; return it."""
    first = phantoms[0]
    plates = f'[plates]\ndiameter_mm = {2 * first.radius}\nheight_mm = {first.height}\nends = "{ends}"'
    for phantom in phantoms:
        _written(phantom.recording, out, phantom.recording.trial)
    return _finished(out, [_HEAD.format(id=json.dumps(out.name), title=json.dumps(out.name), test=plates)])


def _finished(out: Path, blocks: Sequence[str]) -> Path:
    write_atomically(out / "specimen.toml", "\n".join(blocks))
    return out
