"""The finite-element models that show mechanisms: the base model with a few more terms each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from legfem.diagnose.mechanisms import Solution
from legfem.protocol import Protocol

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import (
        PlaneStrainIndentation,
        PlaneStrainSettings,
        Tissues,
    )
    from legfem.geometry.section import LegSection
    from legfem.path import Path
    from legfem.subject import Indenter


@dataclass(frozen=True)
class Stopped:
    """A solution that didn't follow its protocol to the end."""

    why: str


@dataclass(eq=False)
class Variants:
    """A leg's finite-element models, meshed and compiled when first asked for.

    Parameters
    ----------
    section, indenter, tissues
        The leg and how it is pressed.
    settings
        Numerical.
    branches
        Prony branches of each tissue in the viscoelastic model.
    """

    section: LegSection
    indenter: Indenter
    tissues: Tissues
    settings: PlaneStrainSettings
    branches: int = 3
    _models: dict[str, PlaneStrainIndentation] = field(default_factory=dict, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave the finite-element models out: they can't leave their process."""
        return {**self.__dict__, "_models": {}}

    def follow(
        self,
        protocol: Protocol,
        deep: Mapping[str, float],
        solution: Solution,
        sensitivities: Sequence[str] = (),
    ) -> Path | Stopped:
        """Solve a protocol; say why where it isn't followed to its end.

        Parameters
        ----------
        protocol
            The indenter's path.
        deep
            ``deep.C10`` and so on, MPa.
        solution
            The mechanism.
        sensitivities
            Parameters to differentiate by.
        """
        from legfem.experiments.placement import Placement

        model = self.model(solution.variant)
        values = dict(deep)
        for name, factor in solution.scaled.items():
            values[name] = factor * values.get(name, model.model.parameters[name])
        values |= solution.parameters
        solved = model.follow(
            protocol, values, sensitivities, placement=Placement(tilt_deg=solution.tilt_deg)
        )
        return solved.path if solved.report.complete else Stopped(str(solved.report))

    def model(self, variant: str) -> PlaneStrainIndentation:
        """Return a model by its name."""
        if variant not in self._models:
            from legfem.experiments.plane_strain import PlaneStrainIndentation

            self._models[variant] = PlaneStrainIndentation(
                self.section,
                self.indenter,
                self.tissues,
                self._settings(variant),
                mechanisms=self._terms(variant),
            )
        return self._models[variant]

    def _settings(self, variant: str) -> PlaneStrainSettings:
        if variant == "porous":
            return replace(self.settings, formulation="porous")
        if variant == "slipping":
            return replace(self.settings, contact=replace(self.settings.contact, tangential="tape"))
        return self.settings

    def _terms(self, variant: str) -> list[Any]:
        from legfem import terms
        from legfem.materials import Yeoh

        tissues = self.tissues
        if variant == "elastic":
            return [
                terms.Tissue("deep", Yeoh.of(tissues.deep)),
                terms.Prestress(self.section.fascia),
            ]
        if variant == "viscoelastic":
            return [
                terms.Viscoelasticity(region, law, branch=str(k + 1))
                for region, law in (("deep", tissues.deep), ("superficial", tissues.superficial))
                for k in range(self.branches)
            ]
        if variant == "porous":
            return [terms.Drainage("deep", tissues.deep)]
        return []
