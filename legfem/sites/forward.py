"""All sites of a leg, as one forward model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from legfem.identify.catalogue import Values
from legfem.identify.forward import ForwardOutcome, PreparedModel


@dataclass(eq=False)
class SitesForward[Model: PreparedModel]:
    """Sites of the same tissues, a `legfem.identify.forward.ForwardModel`.

    Parameters
    ----------
    models : tuple of PreparedModel
        One a site, each pressed as deep as its recordings go.
    """

    models: tuple[Model, ...]

    @property
    def nominal(self) -> Values:
        """The tissues' values, which are the same at all sites (MPa, 1/MPa)."""
        return self.models[0].nominal

    def prepare(self) -> None:
        """Compile and mesh now."""
        for model in self.models:
            model.prepare()

    def solve(self, values: Values, sensitivities: Sequence[str]) -> ForwardOutcome:
        """Solve every site in full."""
        every = [model.solve(values, sensitivities) for model in self.models]
        return ForwardOutcome.joined(values, every)

    def fingerprint(self) -> Mapping[str, Any]:
        """Return what the sites' solves depend on."""
        return {"model": "sites", "sites": [model.fingerprint() for model in self.models]}
