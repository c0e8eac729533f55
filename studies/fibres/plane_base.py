"""The idealised leg in plane strain as a diagnosis' base model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar

from legfem.common.progress import Progress
from legfem.experiments.experiment import Solved
from legfem.experiments.leg_3d import IdealisedLegIndentation
from legfem.inverse.accuracy import MATERIAL_LOG_SD
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.library import Library
from legfem.inverse.library_build import build_library
from legfem.inverse.library_tasks import middle_of
from legfem.inverse.mechanism import Solution, shown_mechanisms
from legfem.inverse.observations import Observations
from legfem.inverse.responses import SolvedResponses
from legfem.jobs.store import code_fingerprint
from legfem.legs.diagnosis import WITHOUT_ENDS, with_correction
from legfem.mechanisms import Mechanism, TissueMechanism
from legfem.mechanisms.muscle import Compressibility, StrainStiffening
from legfem.solve.protocol import Protocol
from legfem.specimens.mechanisms import mechanisms_on_a_rig
from legfem.study.correction.cases import CorrectionCase

NOT_OFFERED: Mapping[str, str] = {
    "contact-slip": "the idealised leg's contact is rough: its skin never slips",
    "fascia-stiffness": "the idealised leg has no fascia",
    "superficial-stiffness": "the idealised leg has no fat",
    "fat-sliding": "the idealised leg has no fat",
    "superficial-stiffening": "the idealised leg has no fat",
    "prestress": "the idealised leg has no fascia",
    "dermis": "the idealised leg has no skin apart from its one tissue",
    "uneven-muscle": "the idealised leg is half a leg, mirrored: regions come in pairs",
    "indenter-tilt": "the idealised leg is half a leg, mirrored: it can't be pressed askew",
}
"""Mechanisms that this base model can't be given, and why."""
MECHANISMS = mechanisms_on_a_rig()
"""All that the diagnosis knows; one bone gives way as a rig does."""


@dataclass(eq=False)
class PlaneLegVariants:
    """The idealised leg's model in plane strain, elastic only, as `Variants` is for a section.

    Parameters
    ----------
    case
        Leg, cylinder, tissues and mesh.
    """

    case: CorrectionCase
    geometric: ClassVar[tuple[str, ...]] = ()
    assumed: ClassVar[tuple[str, ...]] = ()

    def follow(
        self, protocol: Protocol, deep: Mapping[str, float], solution: Solution, sensitivities: Sequence[str] = ()
    ) -> Solved:
        """Solve one loading at 1 mm/s; arguments are those of `Variants.follow`.

        It says why where it is asked about what this leg doesn't have or is known of it exactly.

        Raises
        ------
        ValueError
            For a mechanism or protocol that this model doesn't have.
        """
        if set(sensitivities) & set(MATERIAL_LOG_SD):
            return Solved.nothing("the idealised leg has one tissue, whose compressibility is known")
        depth = protocol.displacement[-1]
        if protocol != Protocol.ramp(depth, 1.0) or solution.variant not in ("elastic", "plain"):
            raise ValueError("the idealised leg in plane strain is elastic and is loaded once")
        if solution.parameters or solution.tilt_deg:
            raise ValueError(f"the idealised leg has no {solution}")
        return self.model.solve(solution.values(deep, self.model.parameters), depth, sensitivities)

    def parameters(self, variant: str) -> dict[str, float]:
        """Return the model's parameters by full name; none of tissues that it lacks."""
        return {**dict.fromkeys(MATERIAL_LOG_SD, 0.0), **self.model.parameters}

    def described(self, variant: str) -> str:
        """Return what tells a model from others."""
        return variant

    @cached_property
    def model(self) -> IdealisedLegIndentation:
        """The experiment; meshed and compiled when first needed."""
        case = self.case
        return IdealisedLegIndentation(case.leg, case.cylinder, case.material.laws, 2, case.settings)


def plane_responses(case: CorrectionCase, folder: Path | None) -> SolvedResponses:
    """Return the base model's responses; solutions are kept in a folder."""
    fingerprint = {
        "model": "idealised leg in plane strain",
        "case": asdict(case),
        "code": code_fingerprint("legfem.experiments.leg_3d"),
    }
    return SolvedResponses(PlaneLegVariants(case), case.depth, folder, fingerprint)


def offered(observed: Observations, correction: TabulatedCorrection) -> tuple[list[Mechanism], dict[str, str]]:
    """Return the mechanisms that are tabulated, and those that this model can't be given.

    A neo-Hookean base model's strain stiffening is its C20, which the elastic table has.
    """
    able, _ = shown_mechanisms(with_correction(MECHANISMS, correction), observed, WITHOUT_ENDS)
    missing = {m.name: NOT_OFFERED[m.name] for m in able if m.name in NOT_OFFERED}
    tabulated = [m for m in able if isinstance(m, Compressibility)]
    unknown = [
        m.name
        for m in able
        if isinstance(m, TissueMechanism)
        and not isinstance(m, Compressibility | StrainStiffening)
        and m.name not in missing
    ]
    return list(tabulated), missing | dict.fromkeys(unknown, "this base model knows no time")


def plane_library(
    solved: SolvedResponses, observed: Observations, correction: TabulatedCorrection, jobs: int, progress: Progress
) -> Library:
    """Return the base model's library for recordings."""
    tabulated, missing = offered(observed, correction)
    middle = middle_of(observed, solved, 0.0)
    library = build_library(solved, observed, tabulated, jobs, progress, middle)
    return replace(library, missing={**library.missing, **missing})


DEPTH_MM, RATE_MM_PER_S, TRIALS = 19.0, 0.4, 3
PLANE = CorrectionCase(depth=20.0)
"""The base model: the correction's reference leg on the default mesh."""
