"""What an identification found: parameters with intervals, the fit, and how it was searched for."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from legfem.recording import LoadingCurve
from legfem.units import FloatArray

LawName = Literal["neo-hookean", "reduced-polynomial"]
Identifiability = Literal["identifiable", "weakly identifiable", "not identifiable"]
Bound = Literal["", "lower", "upper"]
VERDICTS: tuple[Identifiability, ...] = (
    "identifiable",
    "weakly identifiable",
    "not identifiable",
)
"""From best to worst."""


@dataclass(frozen=True)
class Estimate:
    """One identified parameter."""

    value: float
    """In ``unit``."""
    standard_error: float
    """In ``unit``; from the errors of the recordings and of the model (see `ci95`)."""
    ci95: tuple[float, float]
    """95 % confidence interval, in ``unit``; from a profile, so not always symmetric."""
    identifiability: Identifiability
    why: str
    """Why the parameter is called that."""
    per_fat: float
    """Relative change of the value if the assumed C10 of the fat were 10 % higher."""
    per_fascia: float
    """Relative change of the value if the assumed C10 of the fascia were 10 % higher."""
    at_bound: Bound = ""
    """Whether the value stands at a bound of the search."""
    unit: str = "kPa"

    @property
    def relative_half_width(self) -> float:
        """Half the interval over the value; infinite for a value of 0."""
        half = 0.5 * (self.ci95[1] - self.ci95[0])
        return half / self.value if self.value > 0 else math.inf


@dataclass(frozen=True)
class Cost:
    """The misfit at the optimum, in the ways people state it."""

    value: float
    """N2: sum of squared differences over the grid of displacement (Eq. 12)."""
    points: int
    """Number of differences in the sum."""
    mean_square: float
    """N2."""
    per_length: float
    """(N/mm)2: the sum with forces per unit length of the cylinder."""
    rms: float
    """N."""
    r_squared: float
    chi_square: float
    """Of the residual with its covariance, numerical error included."""
    degrees_of_freedom: int
    p_value: float
    """Of a chi-square as large, were the law right; small means that it doesn't fit."""
    minimised: str
    """What the search minimised."""
    minimised_value: float
    """In ``minimised_unit``."""
    minimised_unit: str = "N2"
    definition: str = "sum over the displacement grid of (F_simulated - F_measured)^2, Eq. 12"


@dataclass(frozen=True, eq=False)
class PredictedCurve:
    """The law's force at the optimum, solved in full, on the measured curve's grid."""

    displacement: FloatArray
    """(n,), mm."""
    force: FloatArray
    """(n,), N, correction included."""
    sensitivities: Mapping[str, FloatArray]
    """(n,), N/kPa, by the parameter's full name (``deep.C10``, ..., ``fascia.C10``)."""


@dataclass(frozen=True)
class FullSolve:
    """One full forward solve of the search."""

    c10: float
    """kPa."""
    c20: float
    """kPa; 0 for a neo-Hookean law."""
    cost: float
    """N2 (Eq. 12); NaN where the solve stopped short."""
    stage: Literal["design", "proposal", "bound", "genetic"]
    complete: bool
    reason: str
    """Why it stopped, if short of its depth."""
    factorisations: int
    seconds: float


@dataclass(frozen=True)
class Generation:
    """The best of one generation of the genetic algorithm."""

    round: int
    """Refinement of the emulator that it searched on, from 0."""
    number: int
    c10: float
    """kPa."""
    c20: float
    """kPa."""
    cost: float
    """N2 on the emulator (of the full model without one)."""


@dataclass(frozen=True, eq=False)
class CostMap:
    """The cost on a grid, from the emulator."""

    c10: FloatArray
    """(m,), kPa, increasing."""
    c20: FloatArray
    """(k,), kPa, increasing; a single 0 for a neo-Hookean law."""
    cost: FloatArray
    """(k, m), N2."""


@dataclass(frozen=True, eq=False)
class SearchPath:
    """How the optimum was found."""

    solves: tuple[FullSolve, ...]
    """In the order in which they were asked for."""
    generations: tuple[Generation, ...]
    cost_map: CostMap | None
    """None without an emulator."""


@dataclass(frozen=True, eq=False)
class AppliedCorrection:
    """The 3D correction that the force was multiplied with, at the identified stiffness."""

    name: str
    P: FloatArray
    """On the curve's grid, (n,); the factor is ``1 - P``."""
    sd: FloatArray
    """Of P's error, (n,), which the intervals carry."""


@dataclass(frozen=True, eq=False)
class IdentificationResult:
    """One law identified from one subject's recordings."""

    subject_id: str
    subject_title: str
    subject_origin: str
    """``measured``, ``reconstructed`` or ``simulated``."""
    law: LawName
    parameters: Mapping[str, Estimate]
    """``c10_deep`` and, for the reduced polynomial, ``c20_deep``."""
    correlation: float
    """Between the two parameters' errors; NaN for one parameter."""
    cost: Cost
    measured: LoadingCurve
    predicted: PredictedCurve
    search: SearchPath
    forward_solves: int
    """Full solves the result rests on, failed ones included."""
    reused_solves: int
    """Of these, found on disk from an earlier run."""
    factorisations: int
    wall_s: float
    """s."""
    seed: int
    emulator_error: float
    """N: greatest difference between the emulator before the last solve, and that solve, at the
    optimum; NaN without an emulator."""
    correction: AppliedCorrection | None
    weighting: Literal["paper", "covariance"]
    converged: bool
    neo_hookean_limit: bool
    """Whether the reduced polynomial's optimum is its neo-Hookean limit."""
    warnings: tuple[str, ...]
    settings: Mapping[str, Any]
    """Numbers that the result depends on, their units in the names."""
    versions: Mapping[str, str] = field(default_factory=dict)

    @property
    def identifiability(self) -> tuple[Identifiability, str]:
        """The worst of the parameters' verdicts, and why."""
        worst = max(
            self.parameters.values(), key=lambda found: VERDICTS.index(found.identifiability)
        )
        return worst.identifiability, "; ".join(
            f"{name}: {found.identifiability}: {found.why}"
            for name, found in self.parameters.items()
        )

    @property
    def residual(self) -> FloatArray:
        """Predicted less measured force (N); (n,)."""
        return self.predicted.force - self.measured.force

    def to_json(self) -> dict[str, Any]:
        """Return the result as plain types for ``result.json``; every number has its unit."""
        from legfem.identify.document import result_document

        return result_document(self)
