"""The idealised leg in plane strain as a base model of the diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from legfem.correction import TabulatedCorrection
from legfem.diagnose.library import Library, build_library, shown_mechanisms
from legfem.diagnose.mechanisms import EndEffects, Mechanism, TissueMechanism
from legfem.diagnose.mechanisms.base import Solution
from legfem.diagnose.mechanisms.tissue import Compressibility, StrainStiffening
from legfem.diagnose.observations import Observations
from legfem.diagnose.solved import SolvedResponses
from legfem.diagnose.variants import Stopped
from legfem.identify.forward import code_fingerprint
from legfem.progress import Progress
from legfem.protocol import Protocol
from legfem.study.correction_cases import Case

if TYPE_CHECKING:
    from legfem.experiments.indentation_3d import IdealisedLegIndentation
    from legfem.path import Path as SolvedPath

NOT_OFFERED: Mapping[str, str] = {
    "contact-slip": "the idealised leg's contact is rough: its skin never slips",
    "fascia-stiffness": "the idealised leg has no fascia",
    "superficial-stiffness": "the idealised leg has no fat",
    "prestress": "the idealised leg has no fascia",
    "indenter-tilt": "the idealised leg is half a leg, mirrored: it can't be pressed askew",
}
"""Mechanisms that this base model can't be given, and why."""


@dataclass(eq=False)
class PlaneLegVariants:
    """The idealised leg's model in plane strain, elastic only, as `Variants` is for a section.

    Parameters
    ----------
    case
        Leg, cylinder, tissues and mesh.
    """

    case: Case
    _model: IdealisedLegIndentation | None = field(default=None, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave the finite-element model out: it can't leave its process."""
        return {**self.__dict__, "_model": None}

    def follow(
        self,
        protocol: Protocol,
        deep: Mapping[str, float],
        solution: Solution,
        sensitivities: Sequence[str] = (),
    ) -> SolvedPath | Stopped:
        """Solve one loading at 1 mm/s; arguments are those of `Variants.follow`.

        Raises
        ------
        ValueError
            For a mechanism or protocol that this model doesn't have.
        """
        depth = protocol.displacement[-1]
        if protocol != Protocol.ramp(depth, 1.0) or solution.variant != "elastic":
            raise ValueError("the idealised leg in plane strain is elastic and is loaded once")
        if solution.parameters or solution.tilt_deg:
            raise ValueError(f"the idealised leg has no {solution}")
        values = dict(deep)
        for name, factor in solution.scaled.items():
            values[name] = factor * values.get(name, self.model.system.model.parameters[name])
        solved = self.model.solve(values, depth, sensitivities)
        return solved.path if solved.report.complete else Stopped(str(solved.report))

    @property
    def model(self) -> IdealisedLegIndentation:
        """The finite-element model; meshed and compiled when first asked for."""
        if self._model is None:
            from legfem.experiments.indentation_3d import IdealisedLegIndentation

            case = self.case
            self._model = IdealisedLegIndentation(
                case.leg, case.cylinder, case.material.laws, 2, case.settings
            )
        return self._model


def plane_responses(
    case: Case, folder: Path | None, correction: TabulatedCorrection
) -> SolvedResponses:
    """Return the base model's responses; solutions are kept in a folder."""
    fingerprint = {
        "model": "idealised leg in plane strain",
        "case": asdict(case),
        "code": code_fingerprint(),
    }
    variants = PlaneLegVariants(case)
    return SolvedResponses(variants, case.depth, folder, fingerprint, correction)  # type: ignore[arg-type]


def offered(
    observed: Observations, correction: TabulatedCorrection
) -> tuple[list[Mechanism], dict[str, str]]:
    """Return the mechanisms that are tabulated, and those that this model can't be given.

    A neo-Hookean base model's strain stiffening is its C20, which the elastic table has.
    """
    able, _ = shown_mechanisms(observed, correction)
    missing = {m.name: NOT_OFFERED[m.name] for m in able if m.name in NOT_OFFERED}
    tabulated = [m for m in able if isinstance(m, Compressibility)]
    unknown = [
        m.name
        for m in able
        if isinstance(m, TissueMechanism)
        and not isinstance(m, Compressibility | EndEffects | StrainStiffening)
        and m.name not in missing
    ]
    return list(tabulated), missing | dict.fromkeys(unknown, "this base model knows no time")


def plane_library(
    solved: SolvedResponses,
    observed: Observations,
    correction: TabulatedCorrection,
    jobs: int,
    progress: Progress,
) -> Library:
    """Return the base model's library for recordings."""
    tabulated, missing = offered(observed, correction)
    library = build_library(solved, solved, observed, tabulated, correction, jobs, progress)
    return replace(library, missing={**library.missing, **missing})
