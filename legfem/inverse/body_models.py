"""The models of a body, what is asked of them, and what they answer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from legfem.channels.kinds import CHANNELS
from legfem.common.units import FloatArray
from legfem.inverse.mechanism import Solution, Stiffness
from legfem.solve.protocol import Protocol as Motion

if TYPE_CHECKING:
    from legfem.experiments.experiment import Solved


class BodyModels(Protocol):
    """The models of one body that show mechanisms, one for every variant."""

    @property
    def assumed(self) -> tuple[str, ...]:
        """Full names of the numbers that are assumed, and may be somewhat off."""

    @property
    def geometric(self) -> tuple[str, ...]:
        """Names of errors of the stated geometry, by which solutions are differentiated, too."""

    def follow(
        self, protocol: Motion, deep: Mapping[str, float], solution: Solution, sensitivities: Sequence[str] = ()
    ) -> "Solved":
        """Solve a protocol for a stiffness; see `legfem.legs.finite_element_models.LegVariants.follow`."""

    def parameters(self, variant: str) -> Mapping[str, float]:
        """Return a variant's parameters by full name (MPa, 1/MPa)."""

    def described(self, variant: str) -> str:
        """Return what tells a variant from others."""


type Columns = dict[str, FloatArray]
"""Arrays by channel: ``force`` along (m,) points, and every further channel at zero time and there, (m + 1,). Of
derivatives by a parameter (`derivative_of`) likewise. Changes are relative of the force, and absolute of channels."""


def derivative_of(channel: str, parameter: str) -> str:
    """Return the name of a channel's derivative by a parameter; the parameter's own of the force."""
    return parameter if channel == "force" else f"{channel} by {parameter}"


def channels_of(columns: Mapping[str, FloatArray]) -> tuple[str, ...]:
    """Return the names of the channels that a solution has beside the force."""
    return tuple(name for name in columns if " by " not in name and name.partition(":")[0] in CHANNELS)


@dataclass(frozen=True, eq=False)
class PathRequest:
    """A solution, and where on its path it is asked for.

    Parameters
    ----------
    protocol
        Of the indenter.
    at
        Times of it, s.
    stiffness
        Of the deep tissue.
    solution
        Which model, and its parameters.
    derivatives
        Full names of parameters by which the force is differentiated.
    """

    protocol: Motion
    at: FloatArray
    stiffness: Stiffness
    solution: Solution
    derivatives: tuple[str, ...] = ()

    def entry(self, terms: str) -> dict[str, Any]:
        """Return what its outcome is kept under; ``terms`` are those of its model."""
        return {
            "protocol": [list(self.protocol.time), list(self.protocol.displacement)],
            "at": np.round(self.at, 9).tolist(),
            "deep_MPa": [float(value) for value in self.stiffness],
            "variant": self.solution.variant,
            "terms": terms,
            "parameters": {k: float(v) for k, v in self.solution.parameters.items()},
            "scaled": {k: float(v) for k, v in self.solution.scaled.items()},
            "tilt_deg": float(self.solution.tilt_deg),
            "derivatives": list(self.derivatives),
        }
