"""What the diagnosis asks of a body that is pressed: a leg, or a specimen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from legfem.diagnose.mechanisms.base import Solution
from legfem.solve.protocol import Protocol as Motion

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import Placement
    from legfem.meshing.section import MeshMotion
    from legfem.solve.path import Path


@dataclass(frozen=True)
class Displaced:
    """A geometry other than the stated one, to be solved for."""

    name: str
    moved: MeshMotion | None = None
    placement: Placement | None = None


class Models(Protocol):
    """The models of one body that show mechanisms, one for every variant."""

    @property
    def assumed(self) -> tuple[str, ...]:
        """Full names of the numbers that are assumed, and may be somewhat off."""
        ...

    @property
    def displaced(self) -> tuple[Displaced, ...]:
        """Geometries other than the stated one, whose forces tell of what isn't known of it."""
        ...

    def moved_to(self, moved: MeshMotion) -> Models:
        """Return the body with its mesh moved."""
        ...

    def follow(
        self,
        protocol: Motion,
        deep: Mapping[str, float],
        solution: Solution,
        sensitivities: Sequence[str] = (),
        placement: Placement | None = None,
    ) -> Path | Stopped:
        """Solve a protocol for a stiffness; see `legfem.diagnose.variants.Variants.follow`."""
        ...

    def parameters(self, variant: str) -> Mapping[str, float]:
        """Return a variant's parameters by full name (MPa, 1/MPa)."""
        ...

    def described(self, variant: str) -> str:
        """Return what tells a variant from others."""
        ...


@dataclass(frozen=True)
class Stopped:
    """A solution that didn't follow its protocol to the end."""

    why: str
