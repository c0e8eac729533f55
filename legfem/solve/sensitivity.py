r"""Forward sensitivities of the force to the model's parameters.

A step solves :math:`R(u, u_o, q_o; m) = 0` from the last displacement :math:`u_o` and history
:math:`q_o`, then sets :math:`q = Q(u, u_o, q_o; m)`. Differentiated by a parameter :math:`m`,

.. math:: K\, u' = -(R_{u_o} u_o' + R_{q_o} q_o' + R_m), \qquad
          q' = Q_u u' + Q_{u_o} u_o' + Q_{q_o} q_o' + Q_m,

so one back-substitution a parameter and step gives exact derivatives of the discrete problem,
history included. All partial derivatives are UFL's. Histories that the residual multiplies by a
number which is zero, such as a branch's overstress at the ratio 0, aren't carried along. A shape, or the
indenter's way, is such a parameter, too (`legfem.fem.system.Shift`); its :math:`R_m` and :math:`Q_m` are differences of
what is assembled.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import mpi4py.MPI  # noqa: F401  # first, see legfem.fem
import numpy as np
import ufl
from dolfinx import fem, la
from ufl.algorithms import expand_derivatives, extract_coefficients, replace
from ufl.constantvalue import Zero
from ufl.corealg.traversal import unique_pre_traversal

from legfem.common.units import FloatArray
from legfem.fem.compiled import compiled
from legfem.fem.forms import DomainForms
from legfem.fem.spaces import sum_over
from legfem.fem.system import Shift, System
from legfem.solve.newton import NewtonSolver

type ByShift = Callable[[Callable[[float], FloatArray]], FloatArray]
"""Returns a shift's derivative of what is computed."""


class SensitivityTracker:
    """Carries the derivatives of state and history along a loading path.

    Parameters
    ----------
    system
        The model.
    parameters
        Full names, for example ``deep.C10``, or those of the system's shifts.
    """

    def __init__(self, system: System, parameters: Sequence[str]) -> None:
        self._system = system
        self.parameters = tuple(parameters)
        self.shifts: dict[int, Shift] = {}
        """By the place of their parameters."""
        for name in self.parameters:
            numbers: Iterable[Any] = (system.body_symbols, system.skin_symbols, *(f.values for f in system.faces))
            if not any(name in known for known in numbers) and (system.faces or system.shift_named(name) is None):
                raise KeyError(name)
        self._body = _PlaceSensitivity(system.body, self.parameters)
        self._skin = _PlaceSensitivity(system.skin, self.parameters)
        self._rate, self._right = (fem.Function(system.spaces.space) for _ in range(2))
        self.contact_force_rates = np.zeros((len(self.parameters), system.spaces.dimension))
        """Derivatives of the indenter's force on the skin at the last step, (parameters, dimension)."""
        nodes = len(system.spaces.trace) // system.spaces.dimension
        self.nodal_force_rates = np.zeros((len(self.parameters), nodes, system.spaces.dimension))
        """Derivatives of the rank's forces on each of its skin's nodes, (parameters, nodes, dimension)."""

    @property
    def holds(self) -> bool:
        """Whether the numbers that were zero when the forms were made, and used so, still are."""
        return self._body.holds and self._skin.holds

    def reset(self) -> None:
        """Return all derivatives to zero, for a path from the undeformed state."""
        named = enumerate(map(self._system.shift_named, self.parameters))
        self.shifts = {place: shift for place, shift in named if shift is not None}
        self._body.reset()
        self._skin.reset()

    def step(self, solver: NewtonSolver) -> FloatArray:
        """Differentiate the step just solved, before the system advances.

        Returns
        -------
        ndarray
            Derivatives of the force along the travel, in the parameters' order.
        """
        solver.refactor()
        system, spaces = self._system, self._system.spaces
        right, forces = self._right, []
        pressing = system.contact_force() if self.shifts else np.zeros(spaces.dimension)
        for index, name in enumerate(self.parameters):
            right.x.array[:] = self._body.partial(index)
            for face in system.faces:
                if name in face.values:
                    right.x.array[:] += face.partial(system.unknown.x.array, name)
            skin = self._skin.partial(index)
            shift = self.shifts.get(index)
            if shift is not None:
                right.x.array[:] += system.by_shift(shift, self._body.residual)
                skin += system.by_shift(shift, self._skin.residual)
            np.add.at(right.x.array, spaces.trace, skin)
            right.x.scatter_reverse(la.InsertMode.add)
            right.x.array[spaces.pinned] = 0.0
            right.x.petsc_vec.scale(-1.0)
            solver.linear_solver.solve(right.x.petsc_vec, self._rate.x.petsc_vec)
            self._rate.x.scatter_forward()
            trace = self._rate.x.array[spaces.trace]
            force = -(skin + self._skin.tangent_action(trace)).reshape(-1, spaces.dimension)
            self.contact_force_rates[index] = sum_over(system.comm, force.sum(axis=0))
            forces.append(float(self.contact_force_rates[index] @ system.direction))
            if shift is not None:
                forces[-1] += float(pressing @ shift.direction)
            self.nodal_force_rates[index] = force
            for place, rate in ((self._body, self._rate.x.array), (self._skin, trace)):
                place.update(index, rate, None if shift is None else partial(system.by_shift, shift))
        return np.array(forces)

    def state_rates(self) -> dict[str, FloatArray]:
        """Return the derivatives of the system's unknown at the last step, ghosts included."""
        return {name: self._body.state(k).copy() for k, name in enumerate(self.parameters)}


class Trackers:
    """Trackers of one system by what they differentiate by, since each compiles its forms.

    Parameters
    ----------
    system
        The model.
    """

    def __init__(self, system: System) -> None:
        self._system = system
        self._known: dict[tuple[str, ...], SensitivityTracker] = {}

    def fresh(self, parameters: Sequence[str]) -> SensitivityTracker | None:
        """Return a tracker that has seen no step; None for no parameters."""
        names = tuple(parameters)
        if not names:
            return None
        if names not in self._known or not self._known[names].holds:
            self._known[names] = SensitivityTracker(self._system, names)
        self._known[names].reset()
        return self._known[names]


class _PlaceSensitivity:
    """Directional derivatives of one domain's residual and history."""

    def __init__(self, forms: DomainForms[Any], parameters: Sequence[str]) -> None:
        domain, space = forms.domain, forms.domain.unknown.function_space
        self._forms, self._history = forms, forms.history
        self._rate, self._before = fem.Function(space), fem.Function(space)
        self._vector = fem.Function(space)
        residual = expand_derivatives(forms.residual_form)
        old, self._zeros = _felt(forms, residual)
        self._symbols = domain.symbols
        self._old = {name: fem.Function(value.function_space) for name, value in old.items()}
        past = [ufl.derivative(residual, forms.before, self._before)]
        past += [ufl.derivative(residual, old[name], self._old[name]) for name in old]
        self._past = _compiled_if_any(sum(past[1:], past[0]))
        self._action = compiled(ufl.derivative(residual, domain.unknown, self._rate))
        known = [name if name in domain.symbols else None for name in parameters]
        self._partials = [
            _compiled_if_any(_by_symbol(residual, domain.symbols[name])) if name else None for name in known
        ]
        updates = {
            name: {
                key: forms.history.expression(total)
                for key in old
                if not isinstance(total := self._total(forms.updated[key], forms, domain, name), Zero)
            }
            for name in dict.fromkeys(known)
        }
        self._updates = [updates[name] for name in known]
        self._states = [
            (np.zeros_like(self._before.x.array), {k: v.x.array.copy() for k, v in old.items()}) for _ in parameters
        ]
        self.reset()

    @property
    def holds(self) -> bool:
        return self._zeros <= self._symbols.zeros

    def reset(self) -> None:
        for before, history in self._states:
            before[:] = 0.0
            for values in history.values():
                values[:] = 0.0

    def state(self, index: int) -> FloatArray:
        """Return the derivative of the state that the next step starts from."""
        return self._states[index][0]

    def partial(self, index: int) -> FloatArray:
        """Return the residual's derivative at a fixed present state."""
        self._load(index)
        vector = self._vector.x.array
        vector[:] = 0.0
        for form in (self._past, self._partials[index]):
            if form is not None:
                fem.assemble_vector(vector, form)
        return vector.copy()

    def residual(self, _: float) -> FloatArray:
        """Return the residual at the present state."""
        vector = self._vector.x.array
        vector[:] = 0.0
        fem.assemble_vector(vector, self._forms.residual)
        return vector.copy()

    def tangent_action(self, rate: FloatArray) -> FloatArray:
        """Return the tangent times the rate of the unknown."""
        self._rate.x.array[:] = rate
        vector = self._vector.x.array
        vector[:] = 0.0
        fem.assemble_vector(vector, self._action)
        return vector.copy()

    def update(self, index: int, rate: FloatArray, by_shift: ByShift | None) -> None:
        """Move the derivatives, of which some are by a shift, to the end of the step."""
        self._load(index)
        self._rate.x.array[:] = rate
        before, history = self._states[index]
        for name, update in self._updates[index].items():
            history[name][:] = self._history.values(update)
        if by_shift is not None:
            for name, values in history.items():
                values += by_shift(partial(self._at_end, name))
        before[:] = rate

    def _at_end(self, name: str, _: float) -> FloatArray:
        return self._history.updated(name)

    def _load(self, index: int) -> None:
        before, history = self._states[index]
        self._before.x.array[:] = before
        for name, values in history.items():
            self._old[name].x.array[:] = values

    def _total(self, value: Any, forms: DomainForms[Any], domain: Any, name: str | None) -> Any:
        old = forms.history.variables
        total = ufl.derivative(value, domain.unknown, self._rate)
        total += ufl.derivative(value, forms.before, self._before)
        total += sum(ufl.derivative(value, old[key], felt) for key, felt in self._old.items())
        if name:
            total += ufl.diff(value, domain.symbols[name])
        return expand_derivatives(total)


def _felt(forms: DomainForms[Any], residual: Any) -> tuple[dict[str, Any], frozenset[str]]:
    """Return the history variables that the residual feels, and the zeros that silence others."""
    old, symbols = forms.history.variables, forms.domain.symbols
    # What differs is seen without derivatives, of which a law with many branches has long ones.
    left = replace(residual, {symbols[name]: ufl.as_ufl(0.0) for name in symbols.zeros})
    there, staying = set(extract_coefficients(residual)), set(extract_coefficients(left))

    def feels(form: Any, name: str) -> bool:
        return bool(expand_derivatives(ufl.derivative(form, old[name])).integrals())

    felt = {name for name, value in old.items() if value in staying and feels(left, name)}
    silenced = [name for name, value in old.items() if value in there and name not in felt]
    silent = any(old[name] not in staying or feels(residual, name) for name in silenced)
    while True:
        needed = {c for name in felt for c in extract_coefficients(forms.updated[name])}
        more = {name for name, value in old.items() if value in needed} - felt
        if not more:
            break
        felt |= more
    zeros: frozenset[str] = symbols.zeros if silent else frozenset()
    return {name: value for name, value in old.items() if name in felt}, zeros


def _by_symbol(form: Any, variable: Any) -> Any:
    having = (one for one in form.integrals() if variable in set(unique_pre_traversal(one.integrand())))
    return ufl.Form([one.reconstruct(integrand=ufl.diff(one.integrand(), variable)) for one in having])


def _compiled_if_any(form: Any) -> Any:
    """Return the compiled form, or None for one that vanishes identically."""
    expanded = expand_derivatives(form)
    return compiled(expanded) if expanded.integrals() else None
