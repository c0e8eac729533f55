"""Files of a report: there together, the page last, or not at all; fields for ParaView, VTX and XDMF."""

import json
import shlex
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from dolfinx import fem
from dolfinx.io import XDMFFile
from mpi4py import MPI

from legfem.common.documents import write_document
from legfem.common.errors import naming
from legfem.fem.compat import vtx_writer
from legfem.fem.fields import LegFields

REPORT = "report.txt"
_UNFINISHED = ".report-unfinished"


@contextmanager
def made_in_place(out: Path, comm: MPI.Intracomm = MPI.COMM_SELF) -> Iterator[Path]:
    """Yield a hidden folder, from which files are moved into place at the end, the report last.

    Whoever stops the run in between finds no half-written file.

    Parameters
    ----------
    out
        Where the files are to be; made if missing.
    comm
        Of the ranks that write to the folder; all of them call.
    """
    hidden = out / _UNFINISHED
    if comm.rank == 0:
        shutil.rmtree(hidden, ignore_errors=True)
        hidden.mkdir(parents=True)
    comm.barrier()
    try:
        with naming(out):
            yield hidden
            if comm.rank == 0:
                made = sorted(hidden.iterdir(), key=lambda path: path.name == REPORT)
                if before := _made_by(out):
                    names = {*before["files"], *(path.name for path in made)}
                    write_document(out / _MADE_BY, before | {"files": sorted(names)})
                for path in made:
                    target = out / path.name
                    if target.is_dir():
                        shutil.rmtree(target)
                    path.replace(target)
    finally:
        if comm.rank == 0:
            shutil.rmtree(hidden, ignore_errors=True)
    comm.barrier()


_WITHOUT_EFFECT = {"--quiet": 1, "--json": 1, "--jobs": 2, "--out": 2}
"""Options that change no result, and how many words each takes."""


_MADE_BY = ".made-by.json"
"""In a folder of results: the command that made them, and the files that it wrote."""


def keep_another(out: Path, command: str, *documents: str) -> None:
    """Move the files that another command (of another law or depth) wrote aside, and keep what this one is.

    They go to a folder ``earlier-1`` within, and a line says so. To be called before anything of the new one is
    written.

    Parameters
    ----------
    out
        Folder of results; made if missing.
    command
        That was given now; empty where there was none, and nothing is moved.
    documents
        Names of files that will be written beside those of `made_in_place`.
    """
    before, now = _made_by(out), _words(command)
    earlier = before.get("command", [])
    if earlier and now and earlier != now:
        number = 1
        while (aside := out / f"earlier-{number}").exists():
            number += 1
        aside.mkdir()
        for name in before["files"]:
            if (out / name).exists():
                (out / name).replace(aside / name)
        print(f"{out} held the results of another command ({' '.join(earlier)}): they are in {aside}", file=sys.stderr)
    (out / _MADE_BY).unlink(missing_ok=True)
    if now:
        write_document(out / _MADE_BY, {"command": now, "files": list(documents)})


def _made_by(out: Path) -> dict[str, list[str]]:
    """Return the command and the names of files that a folder's results are of; nothing where that isn't known."""
    try:
        found = json.loads((out / _MADE_BY).read_text(encoding="utf-8"))
        return {"command": [str(word) for word in found["command"]], "files": [Path(n).name for n in found["files"]]}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def _words(command: str) -> list[str]:
    """Return a command's words without those that change no result; none of what is no command of legfem's."""
    words = shlex.split(command) if command.startswith(("legfem ", "python -m legfem")) else []
    kept: list[str] = []
    while words:
        taken = _WITHOUT_EFFECT.get(words[0], 0)
        kept += [] if taken else words[:1]
        words = words[taken or 1 :]
    return kept


NUMBERS = "all numbers with their units"


@dataclass(frozen=True)
class ReportFile:
    """A file of a report, or several of one kind, and what it shows."""

    paths: Sequence[Path]
    shows: str


RESULT = ReportFile([Path("result.json")], NUMBERS)


def write_fields(fields: LegFields, out: Path, displacement: float = 0.0) -> list[Path]:
    """Write fields for ParaView: VTX where ADIOS2 is there, and XDMF.

    ``fields.bp`` and ``skin.bp`` hold all at full accuracy; ``fields.xdmf`` the displacement at the
    vertices and averages over cells.

    Parameters
    ----------
    fields
        Of `fields_of`.
    out
        Existing folder.
    displacement
        The indenter's (mm), if there is one; stands as the time.

    Returns
    -------
    list of Path
        What was written; collective over the mesh's ranks.
    """
    written = []
    scalars = (fields.pressure, fields.von_mises, fields.stretch, fields.volume_ratio)
    mesh = fields.displacement.function_space.mesh
    # A VTX file holds functions of one element: all go to a discontinuous one, without loss.
    element = ("DG", fields.displacement.function_space.element.basix_element.degree)
    inside = [_interpolated(f, element) for f in (fields.displacement, *scalars, fields.region)]
    skin = [_interpolated(f, element) for f in (fields.skin_displacement, fields.skin_pressure)]
    for path, functions in ((out / "fields.bp", inside), (out / "skin.bp", skin)):
        writer = vtx_writer(mesh.comm, path, functions)
        if writer is None:
            continue
        with writer:
            writer.write(displacement)
        written.append(path)
    path = out / "fields.xdmf"
    with XDMFFile(mesh.comm, str(path), "w") as file:
        file.write_mesh(mesh)
        file.write_function(_interpolated(fields.displacement, ("Lagrange", 1)), displacement)
        for scalar in (*scalars, fields.region):
            file.write_function(_interpolated(scalar, ("DG", 0)), displacement)
    if mesh.comm.rank == 0:
        _join_grids(path)
    return [*written, path, path.with_suffix(".h5")]


def _interpolated(function: Any, element: tuple[Any, ...]) -> Any:
    """Return a function on another element; onto constants this takes the cells' averages."""
    shape = function.function_space.value_shape
    space = fem.functionspace(function.function_space.mesh, (*element, shape) if len(shape) else element)
    other = fem.Function(space, name=function.name)
    other.interpolate(function)
    return other


def _join_grids(path: Path) -> None:
    """Put all fields of an XDMF file on one grid: DOLFINx gives each its own.

    Otherwise ParaView can't colour by one what it deforms by another.
    """
    tree = ElementTree.parse(path)
    domain = tree.find("Domain")
    assert domain is not None
    mesh, *others = domain.findall("Grid")
    for collection in others:
        time, attribute = (collection.find(f"Grid/{tag}") for tag in ("Time", "Attribute"))
        assert time is not None and attribute is not None
        if mesh.find("Time") is None:
            mesh.append(time)
        mesh.append(attribute)
        domain.remove(collection)
    tree.write(path, xml_declaration=True)
