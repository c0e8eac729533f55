"""gmsh's model, and a DOLFINx mesh of what gmsh has meshed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import gmsh
from dolfinx import io as dolfinx_io
from mpi4py import MPI

# Its name since DOLFINx 0.10, and before.
_gmsh_io = dolfinx_io.gmsh if hasattr(dolfinx_io, "gmsh") else dolfinx_io.gmshio


def mesh_from_gmsh(model: Any, comm: MPI.Intracomm, gdim: int) -> tuple[Any, Any, Any]:
    """Return mesh, cell tags and facet tags of a meshed gmsh model that rank 0 holds."""
    mesh, cell_tags, facet_tags = _gmsh_io.model_to_mesh(model, comm, 0, gdim=gdim)[:3]
    return mesh, cell_tags, facet_tags


@contextmanager
def gmsh_model(name: str) -> Iterator[Any]:
    """Open gmsh with an empty model, and close it."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
        gmsh.model.add(name)
        yield gmsh.model
    finally:
        gmsh.finalize()
