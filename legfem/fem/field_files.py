"""Files of fields for ParaView: VTX and XDMF."""

import logging
import os
import tempfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from dolfinx import fem, io

from legfem.fem.fields import LegFields

_log = logging.getLogger(__name__)


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
        What was written, nothing where there is no room for it, which is said; collective over the mesh's ranks.
    """
    scalars = (fields.pressure, fields.von_mises, fields.stretch, fields.volume_ratio)
    mesh = fields.displacement.function_space.mesh
    # A VTX file holds functions of one element: all go to a discontinuous one, without loss.
    element = ("DG", fields.displacement.function_space.element.basix_element.degree)
    inside = [_interpolated(f, element) for f in (fields.displacement, *scalars, fields.region)]
    skin = [_interpolated(f, element) for f in (fields.skin_displacement, fields.skin_pressure)]
    size = mesh.comm.allreduce(sum(one.x.array.nbytes for one in (*inside, *skin)))
    if lack := mesh.comm.bcast(_lack_of_room(out, size) if mesh.comm.rank == 0 else ""):
        if mesh.comm.rank == 0:
            _log.warning("%s: no room for fields for ParaView (%s): they are left out", out, lack)
        return []
    written = []
    if hasattr(io, "VTXWriter"):  # built with ADIOS2
        for path, functions in ((out / "fields.bp", inside), (out / "skin.bp", skin)):
            with io.VTXWriter(mesh.comm, path, functions, engine="BP4") as writer:
                writer.write(displacement)
            written.append(path)
    path = out / "fields.xdmf"
    with io.XDMFFile(mesh.comm, str(path), "w") as file:
        file.write_mesh(mesh)
        file.write_function(_interpolated(fields.displacement, ("Lagrange", 1)), displacement)
        for scalar in (*scalars, fields.region):
            file.write_function(_interpolated(scalar, ("DG", 0)), displacement)
    if mesh.comm.rank == 0:
        _join_grids(path)
    return [*written, path, path.with_suffix(".h5")]


def _lack_of_room(folder: Path, size: int) -> str:
    """Return why files of numbers of some bytes can't be written: the libraries would end the program.

    With points and cells they are some 2.5 times as large.
    """
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            os.posix_fallocate(file.fileno(), 0, 3 * size + 1_000_000)
    except OSError as error:
        return str(error.strerror)
    return ""


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
