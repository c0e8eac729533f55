"""What an identification found: parameters with intervals, the fit, and how it was searched for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from legfem.common.doubts import Doubt
from legfem.common.units import FloatArray
from legfem.data import LoadingCurve
from legfem.inverse.catalogue import Values, key_of
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import Fit
from legfem.inverse.intervals import VERDICTS, Identifiability
from legfem.inverse.laws import LawName, model_values
from legfem.inverse.search_log import SearchLog
from legfem.legs.details import AppliedCorrection, LegDetails, SpatialEvidence, SpatialSites
from legfem.legs.elastography import FibreRatio
from legfem.legs.notices import curve_of


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
    """(n,), N per unit of the parameter, by its full name (``deep.C10``, ..., ``fascia.C10``)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentifiedParameters:
    """What every identification of one law found, and how it was searched for."""

    law: LawName
    parameters: Mapping[str, Estimate]
    """What was free, by full name: ``deep.C10`` and what else was identified."""
    correlations: FloatArray
    """(p, p), of the parameters' errors, in their order."""
    values: Values
    """All that the optimum was solved with, free and held, in the model's units."""
    assumed: Values
    """What of model and instrument was held, finite numbers in the model's units."""
    forward_solves: int
    """Full solves the result rests on, failed ones included."""
    reused_solves: int
    """Of these, found on disk from an earlier run."""
    wall_s: float
    """s."""
    seed: int
    emulator_error: float
    """N: greatest difference between the emulator before the last solve, and that solve, at the
    optimum; NaN without an emulator."""
    converged: bool
    warnings: tuple[str, ...]
    versions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, kw_only=True)
class IdentificationResult(IdentifiedParameters):
    """One law identified from one subject's recordings."""

    subject_id: str
    subject_title: str
    subject_origin: str
    """``measured``, ``reconstructed`` or ``simulated``."""
    cost: Cost
    measured: LoadingCurve
    predicted: PredictedCurve
    search: SearchLog
    factorisations: int
    correction: AppliedCorrection | None
    weighting: Literal["paper", "covariance"]
    neo_hookean_limit: bool
    """Whether the reduced polynomial's optimum is its neo-Hookean limit."""
    settings: Mapping[str, Any]
    """Numbers that the result depends on, their units in the names."""
    doubts: tuple[Doubt, ...] = ()
    """What is unlikely in the input, or in what came out of it."""
    fibres: FibreRatio | None = None
    """Of the muscle, where it is known; `AppliedCorrection.with_fibres` says whether it counts."""
    spatial: SpatialEvidence | None = None
    """Of the leg solved in 3D; None of the model in plane strain with a tabulated correction."""

    @property
    def failed_solves(self) -> int:
        """Of the full solves, those that stopped short."""
        return sum(not solve.complete for solve in self.search.solves)

    @property
    def identifiability(self) -> tuple[Identifiability, str]:
        """The worst of the parameters' verdicts, and why."""
        worst = max(self.parameters.values(), key=lambda found: VERDICTS.index(found.identifiability))
        return worst.identifiability, "; ".join(
            f"{key_of(name)}: {found.identifiability}: {found.why}" for name, found in self.parameters.items()
        )

    @property
    def model_values(self) -> dict[str, float]:
        """What to solve the model with to see the optimum; MPa, 1/MPa."""
        return model_values(self.values)

    def correlation(self, one: str, other: str) -> float:
        """Return that of two parameters' errors; NaN where one wasn't free."""
        names = list(self.parameters)
        if one not in names or other not in names:
            return float(np.nan)
        return float(self.correlations[names.index(one), names.index(other)])

    @property
    def residual(self) -> FloatArray:
        """Predicted less measured force (N); (n,)."""
        return self.predicted.force - self.measured.force


def identification_result(fit: Fit[LegDetails]) -> IdentificationResult:
    """Result of one leg's fit as pages and documents read it."""
    (test,) = fit.tests
    log, details, cost = fit.log, fit.details, fit.cost
    settings = dict(fit.settings)
    for name in ("depth_mm", "fascia_thickness_mm"):
        (settings[name],) = settings[name]
    spatial = details.spatial
    assert not isinstance(spatial, SpatialSites)
    return IdentificationResult(
        law=fit.law,
        parameters=fit.estimates,
        correlations=fit.correlations,
        values=fit.values,
        assumed=fit.assumed,
        forward_solves=log.forward_solves,
        reused_solves=log.reused_solves,
        wall_s=log.wall_s,
        seed=log.seed,
        emulator_error=log.emulator_error,
        converged=log.converged,
        warnings=fit.warnings,
        versions=fit.versions,
        subject_id=fit.subject.id,
        subject_title=fit.subject.title,
        subject_origin=fit.subject.origin,
        cost=Cost(
            cost.value,
            cost.points,
            cost.mean_square,
            cost.per_length,
            cost.rms,
            cost.r_squared,
            fit.goodness.chi_square,
            fit.goodness.degrees_of_freedom,
            fit.goodness.p_value,
            cost.minimised,
            cost.minimised_value,
            cost.minimised_unit,
        ),
        measured=curve_of(test),
        predicted=PredictedCurve(test.force.channel.station, test.force.predicted, test.force.sensitivities),
        search=log,
        factorisations=log.factorisations,
        correction=details.corrections[0],
        weighting=fit.weighting,
        neo_hookean_limit=fit.neo_hookean_limit,
        settings=settings,
        doubts=fit.doubts,
        fibres=details.subject.fibres,
        spatial=spatial,
    )
