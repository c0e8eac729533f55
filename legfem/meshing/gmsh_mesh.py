"""Meshing by gmsh within a time, the quality of its elements, and the DOLFINx mesh of them."""

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import gmsh
import numpy as np
from dolfinx import io as dolfinx_io
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.common.units import FloatArray

# Its name since DOLFINx 0.10, and before.
_gmsh_io = dolfinx_io.gmsh if hasattr(dolfinx_io, "gmsh") else dolfinx_io.gmshio

_MOST_SECONDS = {2: 120.0, 3: 1200.0}
"""Time limit by dimension, s: usual sections take a second, the finest leg in 3D some minutes."""
_THREAD = "gmsh"


def mesh_from_gmsh(model: Any, comm: MPI.Intracomm, gdim: int) -> tuple[Any, Any, Any]:
    """Return mesh, cell tags and facet tags of a meshed gmsh model that rank 0 holds."""
    mesh, cell_tags, facet_tags = _gmsh_io.model_to_mesh(model, comm, 0, gdim=gdim)[:3]
    return mesh, cell_tags, facet_tags


def drawn(geometry: Any, corners: FloatArray, closed: bool = True) -> tuple[list[int], list[int]]:
    """Return gmsh's points and lines through corners (n, 2) or (n, 3), each line one element's edge."""
    points = [geometry.addPoint(*corner, *[0.0] * (3 - len(corner))) for corner in corners]
    lines = [geometry.addLine(a, b) for a, b in pairwise([*points, *points[:closed]])]
    for line in lines:
        geometry.mesh.setTransfiniteCurve(line, 2)
    return points, lines


@contextmanager
def gmsh_model(name: str) -> Iterator[Any]:
    """Open gmsh with an empty model, and close it.

    Raises
    ------
    InputError
        If it is still at work on a mesh that was given up.
    """
    if _at_work():
        raise InputError("mesh", "gmsh", "is still working on a mesh that was given up", "start the program again")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        gmsh.model.add(name)
        yield gmsh.model
    finally:
        if not _at_work():
            gmsh.finalize()


def generate(model: Any, dimension: int, seconds: float | None = None) -> None:
    """Mesh a model.

    Parameters
    ----------
    model
        The model of `gmsh_model`.
    dimension : int
        2 or 3.
    seconds : float, optional
        Time after which it is given up, s.

    Raises
    ------
    InputError
        If it takes longer.
    Exception
        What gmsh raises; nothing more specific.
    """
    failed: list[Exception] = []

    def work() -> None:
        try:
            model.mesh.generate(dimension)
        except Exception as error:
            failed.append(error)

    most = _MOST_SECONDS[dimension] if seconds is None else seconds
    thread = threading.Thread(target=work, name=_THREAD, daemon=True)
    thread.start()
    thread.join(most)
    if thread.is_alive():
        remedy = "check the contours for kinks and near contacts, or ask for a coarser mesh"
        raise InputError("contours", "mesh", f"gmsh was given up after {most:g} s", remedy)
    if failed:
        raise failed[0]


def on_first_rank[Made](comm: MPI.Intracomm, make: Callable[[], Made]) -> Made:
    """Return on all ranks what rank 0 makes; raise on all an InputError that it raises."""
    made: Made | InputError | None = None
    if comm.rank == 0:
        try:
            made = make()
        except InputError as error:
            made = error
    found: Made | InputError = comm.bcast(made, root=0)
    if isinstance(found, InputError):
        raise found
    return found


def _at_work() -> bool:
    return any(thread.name == _THREAD for thread in threading.enumerate())


@dataclass(frozen=True)
class MeshQuality:
    """Signed inverse condition number (1 ideal, 0 degenerate, below 0 inverted) by region."""

    minimum: Mapping[str, float]
    mean: Mapping[str, float]
    elements: Mapping[str, int]

    @property
    def worst(self) -> float:
        """The worst element's quality."""
        return min(self.minimum.values())


WORST_QUALITY = 0.02
"""Quality of an element below which a mesh isn't sound."""


def sound(quality: MeshQuality, source: str, remedy: str) -> MeshQuality:
    """Return a mesh's quality.

    Raises
    ------
    InputError
        If an element isn't sound.
    """
    if quality.worst <= WORST_QUALITY:
        problem = f"cannot be meshed soundly (worst element quality {quality.worst:.2g})"
        raise InputError(source, min(quality.minimum, key=quality.minimum.__getitem__), problem, remedy)
    return quality


def element_quality(model: Any, regions: Mapping[str, int], dimension: int = 2) -> MeshQuality:
    """Measure every region (name to physical tag) of a meshed gmsh model."""
    minimum, mean, count = {}, {}, {}
    for name, tag in regions.items():
        elements = [
            tags
            for entity in model.getEntitiesForPhysicalGroup(dimension, tag)
            for tags in model.mesh.getElements(dimension, entity)[1]
        ]
        quality = np.asarray(model.mesh.getElementQualities(np.concatenate(elements), "minSICN"))
        minimum[name], mean[name] = float(quality.min()), float(quality.mean())
        count[name] = quality.size
    return MeshQuality(minimum, mean, count)
