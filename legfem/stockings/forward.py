"""The leg in its stocking as a forward model: stiffnesses in; skin, hull and pressure in equilibrium out."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from legfem.inverse.catalogue import Values
from legfem.inverse.outcome import Key, Outcome, StateField, key_of_values
from legfem.jobs.store import key_of
from legfem.stockings.equilibrium import SURFACES, Equilibrium, EquilibriumSolver, LinearisedCoupling

PRESSURE = "pressure"
"""Name of the field of the stocking's pressure (MPa), (n_levels, n_points)."""


@dataclass(eq=False)
class StockingForward:
    """A leg and its stocking, a `legfem.inverse.outcome.Forward`.

    An outcome's fields are the displacements (mm) of the points of skin and hull, (n_levels, n_points, 3), and the
    stocking's pressure, with their derivatives in equilibrium.

    Parameters
    ----------
    solver
        Of the leg; one process and its ranks have it.
    """

    solver: EquilibriumSolver
    equilibria: dict[Key, Equilibrium] = field(default_factory=dict, init=False)
    """Those that were found, by the values asked for."""

    @property
    def nominal(self) -> Values:
        """Stiffness and compressibility of both tissues as assumed (MPa, 1/MPa)."""
        tissues = self.solver.model.tissues
        return {f"{name}.{of}": value for name, law in tissues.items() for of, value in law.parameters.items()}

    def prepare(self) -> None:
        """Mesh and compile now."""
        _ = self.solver.model.compression

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Find the equilibrium, from the nearest one that is known; the model is left in it."""
        started = time.perf_counter()
        found = self.solver.solve(values, sensitivities, self._nearest(values))
        model, report = self.solver.model, found.state.report
        fields = {}
        if report.complete:
            self.equilibria[key_of_values(values)] = found
            coupling = LinearisedCoupling(self.solver, found)
            rates = {name: coupling.rate(found.state.sensitivities[name]) for name in sensitivities}
            for part in SURFACES:
                by = {name: model.displacement(part, rate) for name, rate in rates.items()}
                fields[part] = StateField(model.displacement(part, found.state.unknown), by)
            by = {name: coupling.pressure_rate(rate) for name, rate in rates.items()}
            fields[PRESSURE] = StateField(found.load.pressure, by)
        seconds = time.perf_counter() - started
        return Outcome(values, (), bool(report.complete), report.reason, 0, seconds, fields=fields)

    def at(self, values: Values) -> Equilibrium:
        """Return the equilibrium that was found at values."""
        return self.equilibria[key_of_values(values)]

    def _nearest(self, values: Values) -> Equilibrium | None:
        """Return the known equilibrium whose stiffnesses differ least, by their logarithms."""

        def apart(key: Key) -> float:
            return sum(abs(np.log(values[name] / value)) for name, value in key if value > 0 and values.get(name))

        return self.equilibria[min(self.equilibria, key=apart)] if self.equilibria else None

    def fingerprint(self) -> Mapping[str, Any]:
        """Return what a solve depends on."""
        model = self.solver.model
        given = key_of(model.shape, model.tissues, model.mesh, model.settings, self.solver.stocking)
        return {"model": "leg in a stocking", "given": given}
