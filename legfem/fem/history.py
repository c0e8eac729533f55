"""History variables at quadrature points: what a term remembers from step to step."""

from __future__ import annotations

from typing import Any

import basix.ufl
import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from legfem.fem.compat import evaluate
from legfem.fem.compiled import expression


class History:
    """History variables of one domain, with their update at the end of a step.

    Parameters
    ----------
    mesh
        Of the domain.
    degree
        Of the quadrature of the domain's forms.
    shapes
        Shape of every variable by its name.
    """

    def __init__(self, mesh: Any, degree: int, shapes: dict[str, tuple[int, ...]]) -> None:
        self._mesh = mesh
        cell = mesh.basix_cell()
        cells = mesh.topology.index_map(mesh.topology.dim)
        self._cells = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
        scalar = basix.ufl.quadrature_element(cell, degree=degree)
        self._points = scalar.custom_quadrature()[0]
        self.variables = {
            name: fem.Function(
                fem.functionspace(mesh, basix.ufl.quadrature_element(cell, value_shape=shape, degree=degree))
            )
            for name, shape in shapes.items()
        }
        self._updates: dict[str, Any] = {}

    def compile_update(self, updated: dict[str, Any]) -> None:
        """Prepare the expressions that give the variables at the end of a step."""
        self._updates = {name: self.expression(value) for name, value in updated.items()}

    def expression(self, value: Any) -> Any:
        """Return a compiled expression at the quadrature points."""
        return expression(value, self._points)

    def values(self, expression: Any) -> NDArray[np.float64]:
        """Return an expression at all quadrature points, flat."""
        return evaluate(expression, self._mesh, self._cells)

    def advance(self) -> None:
        """Move all variables to the end of the step."""
        fresh = {name: self.values(update) for name, update in self._updates.items()}
        for name, value in fresh.items():
            self.variables[name].x.array[:] = value

    def reset(self) -> None:
        """Set all variables to zero."""
        for variable in self.variables.values():
            variable.x.array[:] = 0.0
