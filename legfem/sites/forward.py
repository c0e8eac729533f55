"""All sites of a leg, as one forward model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from legfem.inverse.catalogue import Values
from legfem.inverse.outcome import Forward, Outcome
from legfem.jobs.pool import Workers

type SiteTask = tuple[int, Values, Sequence[str]]
"""A site's number, the tissues' values, and what its solve is differentiated by."""


@dataclass(eq=False)
class SitesForward[Model: Forward]:
    """Sites of the same tissues, a `legfem.inverse.outcome.ForwardModel`.

    Parameters
    ----------
    models : tuple of PreparedModel
        One a site, each pressed as deep as its recordings go.
    workers : Workers, optional
        Of `solve_site` and the same models: processes that solve sites side by side. One site
        after another without them.
    """

    models: tuple[Model, ...]
    workers: Workers[tuple[Model, ...], SiteTask, Outcome] | None = None

    @property
    def nominal(self) -> Values:
        """The tissues' values, which are the same at all sites (MPa, 1/MPa)."""
        return self.models[0].nominal

    def prepare(self) -> None:
        """Compile and mesh now."""
        for model in self.models:
            model.prepare()

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Solve every site in full."""
        tasks = [(number, values, sensitivities) for number in range(len(self.models))]
        if self.workers is None:
            every = [solve_site(self.models, task) for task in tasks]
        else:
            every = list(self.workers.in_order(tasks))
        return Outcome.joined(values, every)

    def fingerprint(self) -> Mapping[str, Any]:
        """Return what the sites' solves depend on."""
        return {"model": "sites", "sites": [model.fingerprint() for model in self.models]}


def solve_site[Model: Forward](models: Sequence[Model], task: SiteTask) -> Outcome:
    """Solve one of several sites in full."""
    number, values, sensitivities = task
    return models[number].solve(values, sensitivities)
