r"""Model discrepancy: where the contours of model and scan differ, and which physics would explain it.

The best fit leaves whitened distances :math:`w`. The part that stiffnesses and nuisances within
their priors can explain is projected off. A mechanism has a signature :math:`S`, the derivatives of
the distances by its parameters at the mechanism's null, projected likewise, and the score

.. math:: T = w^T S (S^T S)^{-1} S^T w \sim \chi^2_k

where nothing is wrong. Places on the contours are tested in the same way, with a unit distance over
the place as signature. All p-values are family-wise over the mechanisms, or over the places (Holm).
The mechanism with the least p-value is put into the model, and the leg is solved anew.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import chi2

from legfem.common.p_values import holm
from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.geometry.slices import CONTOURS
from legfem.stockings.contour_distances import ContourMisfit
from legfem.stockings.equilibrium import PARAMETERS, Equilibrium, EquilibriumSolver
from legfem.stockings.forward import StockingForward
from legfem.stockings.nuisances import RIGID, SECTORS, angle_from_sector, sectors
from legfem.stockings.scan_fit import BOUNDS, NuisanceFit, ScanComparison, ScanFit, by_name, distances_of

SIGNIFICANT = 0.025
"""Family-wise level of the mechanisms, and of the places: 5 % together where nothing is wrong."""
PLAUSIBLE = kpa_to_mpa(np.array([[1.3, 3.3], [8.1, 20.4]]))
"""C10 of muscle and fat (MPa) at which mechanisms are tested, at the least and at most: the second
paper's means over and times 2.5. Where one is left out, the best fit may lie far off."""
type Verdict = Literal["consistent", "named", "ambiguous", "unexplained"]
REPAIRS = 5
"""Equilibria with the named mechanism in the model."""


_MOTION = slice(2, 2 + RIGID)
_PRESSURE = slice(2 + RIGID, 2 + RIGID + SECTORS)
"""Places of nuisances among the derivatives of the fit."""


@dataclass(frozen=True)
class _Mechanism:
    """A mechanism: a term of the model, zero at its null, or nuisances with their priors lifted."""

    name: str
    statement: str
    labels: tuple[str, ...]
    parameter: str = ""
    """Full name of the term's strength."""
    lifted: slice = slice(0)
    """Places of the nuisances."""

    def slopes(self, fit: FloatArray, by: Mapping[str, FloatArray]) -> FloatArray:
        """Return the distances' derivatives (n, k) by its numbers, of those of the fit and by parameters."""
        return by[self.parameter][:, None] if self.parameter else fit[:, self.lifted]


_MECHANISMS = (
    _Mechanism(
        "local-pressure",
        "the pressure on the skin is wrong on one side of the leg",
        tuple(f"at {360 * k / SECTORS:.0f} degrees" for k in range(SECTORS)),
        lifted=_PRESSURE,
    ),
    _Mechanism(
        "volume-loss",
        "the deep tissue has lost volume: blood has drained from it",
        ("share",),
        "deep.volume_loss.share",
    ),
    _Mechanism(
        "stiffness-gradient",
        "the muscle's stiffness changes along the leg",
        ("gradient a 100 mm",),
        "deep.stiffness_gradient.gradient",
    ),
    _Mechanism(
        "fascia",
        "a sheet round the muscle, its fascia, holds it together",
        ("stiffness (N/mm)",),
        "fascia.membrane.stiffness",
    ),
    _Mechanism(
        "misregistration",
        "the two scans lie farther apart than the bones' registration says",
        ("x (mm)", "y (mm)", "z (mm)", "about x (rad)", "about y (rad)", "about z (rad)"),
        lifted=_MOTION,
    ),
)
_NULLS = {one.parameter: 0.0 for one in _MECHANISMS if one.parameter}


@dataclass(frozen=True)
class MechanismScore:
    """Score test of one mechanism; ``strengths`` by label, with their standard errors."""

    name: str
    statement: str
    statistic: float
    degrees: int
    p_value: float
    """Family-wise."""
    strengths: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class DiscrepantPlace:
    """A part of a contour whose distance from the scan is beyond the errors."""

    contour: Literal["outer", "inner"]
    levels: tuple[float, float]
    """mm."""
    angle_deg: float
    """Middle of the sector, counter-clockwise from +x about the contour's middle."""
    distance: float
    """Mean, of the model outside the scan (mm)."""
    p_value: float
    """Family-wise."""


@dataclass(frozen=True, eq=False)
class ModelDiscrepancy:
    """Verdict on the model, with the tests that it rests on."""

    verdict: Verdict
    named: tuple[str, ...]
    """One mechanism, or those that the contours can't tell apart."""
    scores: tuple[MechanismScore, ...]
    """Every mechanism's test, the most significant first."""
    places: tuple[DiscrepantPlace, ...]
    """Significant places, the most significant first."""
    rms_before: float
    """Root-mean-square distance of the fit, mm."""
    rms_after: float | None
    """The same with the named mechanism in the model, solved anew (mm)."""
    parameters_after: FloatArray | None
    """C10 of muscle and fat with that mechanism, MPa."""


@dataclass(frozen=True, eq=False)
class _Tested:
    """The leg at the stiffness at which mechanisms are tested, linearised."""

    parameters: FloatArray
    """C10 of muscle and fat, MPa."""
    equilibrium: Equilibrium
    distances: FloatArray
    """(n,), mm."""
    slopes: FloatArray
    """Derivatives of these by both log stiffnesses and k nuisances, (n, 2 + k)."""
    weights: FloatArray
    """Reciprocal standard deviations of the priors, 0 of the stiffnesses, (2 + k,)."""


def model_discrepancy(forward: StockingForward, comparison: ScanComparison, best: ScanFit) -> ModelDiscrepancy:
    """Test where and why the best fit differs from the scan.

    Parameters
    ----------
    forward, comparison
        Those of the search.
    best
        Its best fit.
    """
    at = np.clip([best.stiffness[name] for name in PARAMETERS], *PLAUSIBLE)
    values = {**by_name(at), **_NULLS}
    outcome = forward.solve(values, (*PARAMETERS, *_NULLS))
    misfit, nuisances = comparison.misfit, comparison.nuisances
    distances, by = distances_of(outcome, comparison.bare, misfit)
    stiffness = [value * by[name] for name, value in by_name(at).items()]
    slopes = np.column_stack([*stiffness, nuisances.at(at)])
    weights = np.concatenate([np.zeros(2), 1 / nuisances.sd])
    tested = _Tested(at, forward.at(values), distances, slopes, weights)
    fitted = NuisanceFit(misfit.whitened(distances), np.vstack([misfit.whitened(slopes), np.diag(weights)]))
    signatures = {one: one.slopes(slopes, by) for one in _MECHANISMS}
    scores = _scores(signatures, misfit, fitted)
    places = _places(misfit, distances, fitted)
    strongest = scores[0]
    if strongest.p_value > SIGNIFICANT:
        verdict: Verdict = "unexplained" if places else "consistent"
        return ModelDiscrepancy(verdict, (), scores, places, best.rms, None, None)
    # Within 6 by BIC's measure, parameters counted, a mechanism explains the distances as well.
    penalty = float(np.log(len(fitted.differences)))
    gains = {score.name: score.statistic - penalty * score.degrees for score in scores}
    alike = tuple(s.name for s in scores if s.p_value < SIGNIFICANT and gains[s.name] > gains[strongest.name] - 6.0)
    chosen = next(one for one in _MECHANISMS if one.name == strongest.name)
    after, parameters = _refit(forward.solver, misfit, tested, chosen, signatures[chosen])
    verdict = "named" if len(alike) == 1 else "ambiguous"
    return ModelDiscrepancy(verdict, alike, scores, places, best.rms, after, parameters)


def _scores(
    signatures: Mapping[_Mechanism, FloatArray], misfit: ContourMisfit, fitted: NuisanceFit
) -> tuple[MechanismScore, ...]:
    found = []
    for mechanism, slopes in signatures.items():
        signature = fitted.projected(misfit.whitened(slopes))
        strengths, _, rank, _ = np.linalg.lstsq(signature, -fitted.left, rcond=1e-4)
        statistic = float(np.sum((signature @ strengths) ** 2))
        errors = np.sqrt(np.diag(np.linalg.pinv(signature.T @ signature, rcond=1e-8)))
        named = zip(mechanism.labels, zip(map(float, strengths), map(float, errors), strict=True), strict=True)
        alone = float(chi2.sf(statistic, rank))
        found.append(MechanismScore(mechanism.name, mechanism.statement, statistic, int(rank), alone, dict(named)))
    corrected = holm([one.p_value for one in found])
    scores = [replace(one, p_value=float(p)) for one, p in zip(found, corrected, strict=True)]
    return tuple(sorted(scores, key=lambda s: (s.p_value, s.degrees - s.statistic)))


def _places(misfit: ContourMisfit, distances: FloatArray, fitted: NuisanceFit) -> tuple[DiscrepantPlace, ...]:
    """Test sectors of both contours, in the lower slices, the upper ones, and all."""
    levels = misfit.target.levels
    half = len(levels) // 2
    tests: list[tuple[Literal["outer", "inner"], slice, int, FloatArray]] = []
    for number, name in enumerate(CONTOURS):
        for span in (slice(0, half), slice(half + 1, None), slice(None)):
            for sector in range(SECTORS):
                within = angle_from_sector(misfit.target.contours(name), sector) < np.pi / SECTORS
                box = np.zeros((2, *within.shape))
                box[number, span] = within[span]
                tests.append(("outer" if name == "outer" else "inner", span, sector, box.ravel()))
    boxes = fitted.projected(misfit.whitened(np.stack([box for *_, box in tests], axis=1)))
    scores = (fitted.left @ boxes) ** 2 / np.sum(boxes**2, axis=0)
    corrected = holm(chi2.sf(scores, 1))
    found = [
        DiscrepantPlace(
            name,
            (float(levels[span][0]), float(levels[span][-1])),
            360.0 * sector / SECTORS,
            float(distances[box > 0].mean()),
            float(p),
        )
        for (name, span, sector, box), p in zip(tests, corrected, strict=True)
        if p <= SIGNIFICANT
    ]
    return tuple(sorted(found, key=lambda place: place.p_value))


def _refit(
    solver: EquilibriumSolver, misfit: ContourMisfit, tested: _Tested, mechanism: _Mechanism, signature: FloatArray
) -> tuple[float | None, FloatArray]:
    """Fit stiffnesses, nuisances and mechanism with new equilibria, and derivatives of the tested state.

    Returns the root-mean-square distance (mm), None where no equilibrium was found, and C10 (MPa).
    """
    base, weights = tested.slopes, tested.weights.copy()
    slopes, outlines = base, slice(_PRESSURE.stop, base.shape[1])
    if mechanism.parameter:
        slopes, weights = np.column_stack([base, signature]), np.append(weights, 0.0)
    else:
        weights[mechanism.lifted] = 0.0
    rows = np.vstack([misfit.whitened(slopes), np.diag(weights)])
    bumps = sectors(solver.model.shape)
    total = np.zeros(len(weights))
    parameters, left, here = tested.parameters, tested.distances, tested.equilibrium
    for _ in range(REPAIRS):
        right = np.concatenate([misfit.whitened(left), weights * total])
        total -= np.linalg.lstsq(rows, right, rcond=1e-8)[0]
        total[:2] = np.clip(total[:2], -1.5, 1.5)
        parameters = np.clip(tested.parameters * np.exp(total[:2]), *BOUNDS)
        error = np.maximum(sum(c * b for c, b in zip(total[_PRESSURE], bumps, strict=True)), -1.0)
        strength = {mechanism.parameter: float(total[-1])} if mechanism.parameter else {}
        here = solver.solve({**by_name(parameters), **_NULLS, **strength}, (), here, error)
        if not here.state.report.complete:
            return None, parameters
        moved = misfit.distances(here.shape) + base[:, _MOTION] @ total[_MOTION]
        left = moved + base[:, outlines] @ total[outlines]
    return float(np.sqrt(np.mean(moved**2))), parameters
