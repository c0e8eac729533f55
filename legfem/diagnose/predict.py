"""The predicted forces at the stations, for any stiffness and any mechanisms, in milliseconds.

The tissue's response comes from `Responses`, solved once for a section; everything else is exact
arithmetic on it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np
from scipy.interpolate import CubicSpline

from legfem.diagnose.mechanisms import Mechanism, TissueMechanism, Values
from legfem.diagnose.observations import Observations
from legfem.units import FloatArray

LawName = Literal["neo-hookean", "reduced-polynomial"]
_FACTOR_NODES = 4


class Responses(Protocol):
    """What the finite-element model said beforehand."""

    @property
    def grid(self) -> FloatArray:
        """Displacements (m,) of the curves, mm, rising from above zero."""
        ...

    @property
    def c10_bounds(self) -> tuple[float, float]:
        """Stiffness C10 that it holds for, kPa."""
        ...

    @property
    def c20_bounds(self) -> tuple[float, float]:
        """Stiffness C20 that it holds for, kPa."""
        ...

    def curve(self, c10: float, c20: float) -> FloatArray:
        """Return the elastic force (m,) at the grid, N."""
        ...

    def relative_change(
        self,
        mechanism: TissueMechanism,
        values: Values,
        c10: float,
        c20: float,
        observed: Observations,
    ) -> FloatArray:
        """Return what a mechanism adds to the elastic force, over that force; (n,)."""
        ...


@dataclass(frozen=True, eq=False)
class Predictor:
    """Predicts observations; parameters are C10, C20 (kPa) and ``mechanism.parameter``."""

    observed: Observations
    responses: Responses
    law: LawName
    offset: FloatArray | float = 0.0
    """(n,), N: what a full solution was above the emulated one, where one was made."""

    def corrected(self, offset: FloatArray) -> Predictor:
        """Return the predictor shifted to agree with a full solution."""
        return replace(self, offset=offset)

    @property
    def base_parameters(self) -> tuple[str, ...]:
        """Parameters of the base model."""
        return ("C10",) if self.law == "neo-hookean" else ("C10", "C20")

    def __call__(
        self, values: Mapping[str, float], mechanisms: Sequence[Mechanism] = ()
    ) -> FloatArray:
        """Return the forces (n,), N; NaN where a full solution stopped."""
        observed = self.observed
        own = {m.name: values_of(values, m) for m in mechanisms}
        c10, c20 = values["C10"], values.get("C20", 0.0)
        stiffening = own.get("strain-stiffening")
        if stiffening is not None and self.law == "neo-hookean":
            c20 = stiffening["coefficient"]
        factor: FloatArray = np.ones(len(observed.force))
        for mechanism in mechanisms:
            factor = factor * mechanism.deep_factor(own[mechanism.name], observed)
        elastic = self._elastic(c10, c20, factor)

        def loss(force: FloatArray) -> FloatArray:
            return sum(
                (m.displacement_loss(own[m.name], observed, force) for m in mechanisms),
                np.zeros(len(force)),
            )

        force = _pressed(elastic, observed.displacement, loss)
        for mechanism in mechanisms:
            mine = own[mechanism.name]
            if isinstance(mechanism, TissueMechanism) and not (
                mechanism.name == "strain-stiffening" and self.law == "neo-hookean"
            ):
                force = force * (
                    1 + self.responses.relative_change(mechanism, mine, c10, c20, observed)
                )
            force = force * mechanism.force_factor(mine, observed)
        for mechanism in mechanisms:
            force = force + mechanism.added_force(own[mechanism.name], observed)
        return force + self.offset

    def _elastic(self, c10: float, c20: float, factor: FloatArray) -> _Elastic:
        low, high = float(factor.min()), float(factor.max())
        nodes = np.array([1.0]) if high - low < 1e-12 else np.linspace(low, high, _FACTOR_NODES)
        at_null = high - low < 1e-12
        scale = factor[0] if at_null else 1.0
        grid = np.concatenate([[0.0], self.responses.grid])
        curves = [self.responses.curve(c10 * scale * n, c20 * scale * n) for n in nodes]
        if np.isnan(curves).any():
            return _Elastic([_unknown], np.array([1.0]), None)
        splines = [CubicSpline(grid, np.concatenate([[0.0], curve])) for curve in curves]
        return _Elastic(splines, nodes, None if at_null else _lagrange(nodes, factor))


@dataclass(frozen=True, eq=False)
class _Elastic:
    """Curves at several factors on the deep stiffness, interpolated to every station's."""

    splines: Sequence[Callable[[FloatArray, int], FloatArray]]
    nodes: FloatArray
    weights: FloatArray | None

    def __call__(self, displacement: FloatArray, derivative: int = 0) -> FloatArray:
        at = np.maximum(displacement, 0.0)
        values = [spline(at, derivative) for spline in self.splines]
        total = values[0]
        if self.weights is not None:
            total = np.einsum("ij,ij->j", self.weights, np.array(values))
        return np.where(displacement > 0, total, 0.0)


def _unknown(displacement: FloatArray, derivative: int) -> FloatArray:
    """Return the force of a solution that stopped."""
    return np.full(len(displacement), np.nan)


def _lagrange(nodes: FloatArray, at: FloatArray) -> FloatArray:
    weights = np.ones((len(nodes), len(at)))
    for i, node in enumerate(nodes):
        for j, other in enumerate(nodes):
            if i != j:
                weights[i] *= (at - other) / (node - other)
    return weights


def _pressed(elastic: _Elastic, displacement: FloatArray, loss) -> FloatArray:  # type: ignore[no-untyped-def]
    """Solve F = elastic(d - loss(F)) by Newton's method."""
    force = elastic(displacement - loss(np.zeros_like(displacement)))
    if not np.any(loss(np.ones_like(force)) - loss(np.zeros_like(force))):
        return force
    for _ in range(12):
        lost = loss(force)
        by_force = loss(force + 1.0) - lost
        at = displacement - lost
        step = (force - elastic(at)) / (1.0 + elastic(at, 1) * by_force)
        force = force - step
        if np.abs(step).max() < 1e-9:
            break
    return force


def values_of(values: Mapping[str, float], mechanism: Mechanism) -> dict[str, float]:
    """Return a mechanism's own values by their short names."""
    return {p.name: values.get(f"{mechanism.name}.{p.name}", p.null) for p in mechanism.parameters}
