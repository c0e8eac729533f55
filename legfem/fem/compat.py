"""What differs between DOLFINx 0.9, 0.10 and 0.11, detected by feature."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

_reasons = PETSc.SNES.ConvergedReason
RESIDUAL_NOT_FINITE: int = (
    _reasons.DIVERGED_FNORM_NAN
    if hasattr(_reasons, "DIVERGED_FNORM_NAN")  # its name in older PETSc
    else _reasons.DIVERGED_FUNCTION_NANORINF
)
"""SNES' reason for a residual that is not a number, or infinite."""


def cell_nodes(mesh: Any) -> NDArray[np.int32]:
    """Return the nodes of every cell of a mesh of one cell type: of a list of maps since 0.11."""
    maps = getattr(mesh.geometry, "dofmaps", None)
    return np.asarray(mesh.geometry.dofmap if maps is None else maps[0])


def collapse(subspace: Any) -> tuple[Any, NDArray[np.int32]]:
    """Return a subspace as a space of its own, and the parent's dof of each of its dofs."""
    space, parent = subspace.collapse()
    # A flat list once; now a list of one array a type of cell.
    return space, np.asarray(parent, dtype=np.int32).ravel()


def evaluate(expression: Any, mesh: Any, cells: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return a `dolfinx.fem.Expression` at its points in some cells, flat by cell and point."""
    return np.asarray(expression.eval(mesh, cells)).reshape(-1)
