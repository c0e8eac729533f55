r"""Model discrepancy: where the contours of model and scan differ, and which physics would explain it.

The best fit leaves readings :math:`w` (`legfem.stockings.scan_fit`). The part that stiffnesses and nuisances within
their priors can explain is projected off. A mechanism has a signature :math:`S`, the derivatives of
the readings by its parameters at the mechanism's null, projected likewise, and the score

.. math:: T = w^T S (S^T S)^{-1} S^T w \sim \chi^2_k

where nothing is wrong. Places on the contours are tested in the same way, with a unit distance over
the place as signature. All p-values are family-wise over the mechanisms, or over the places (Holm).
The mechanism with the least p-value is put into the model, and the search is done again with it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import chi2

from legfem.common.p_values import holm
from legfem.common.progress import Silent
from legfem.common.units import FloatArray, kpa_to_mpa, mpa_to_kpa
from legfem.geometry.slices import CONTOURS
from legfem.inverse.catalogue import IdentifiedLaw, Values
from legfem.inverse.outcome import FullSolver
from legfem.inverse.parameter import Parameter
from legfem.inverse.search import Search
from legfem.inverse.searches import run_together
from legfem.inverse.settings import IdentificationSettings
from legfem.stockings.contour_distances import ContourMisfit
from legfem.stockings.equilibrium import PARAMETERS
from legfem.stockings.nuisances import RIGID, SECTORS, angle_from_sector
from legfem.stockings.scan_fit import ScanComparison, ScanFit, StockingForward, by_name, shape_of, stiffness_priors

SIGNIFICANT = 0.025
"""Family-wise level of the mechanisms, and of the places: 5 % together where nothing is wrong."""
PLAUSIBLE = kpa_to_mpa(np.array([[1.3, 3.3], [8.1, 20.4]]))
"""C10 of muscle and fat (MPa) at which mechanisms are tested, at the least and at most: the second
paper's means over and times 2.5. Where one is left out, the best fit may lie far off."""
type Verdict = Literal["consistent", "named", "ambiguous", "unexplained"]
REPAIRS = 6
"""Equilibria with the named mechanism in the model, at most."""


@dataclass(frozen=True)
class _Mechanism:
    """A mechanism: a term of the model, zero at its null, or nuisances that are larger than is known."""

    name: str
    statement: str
    labels: tuple[str, ...]
    strengths: tuple[Parameter, ...] = ()
    """The term's only one."""
    nuisances: slice = slice(0)
    """Places of these."""
    sd: float = np.inf
    """Standard deviation of the nuisances where the mechanism is there, in their units."""


_VOLUME_LOSS = Parameter("deep.volume_loss.share", "-", (-0.2, 0.2))
_GRADIENT = Parameter("deep.stiffness_gradient.gradient", "-", (-1.0, 1.0))
_FASCIA = Parameter("fascia.membrane.stiffness", "N/mm", (0.0, 5.0))
_MECHANISMS = (
    _Mechanism(
        "local-pressure",
        "the pressure on the skin is wrong on one side of the leg",
        tuple(f"at {360 * k / SECTORS:.0f} degrees" for k in range(SECTORS)),
        nuisances=slice(RIGID, RIGID + SECTORS),
        sd=0.3,
    ),
    _Mechanism(
        "volume-loss", "the deep tissue has lost volume: blood has drained from it", ("share",), (_VOLUME_LOSS,)
    ),
    _Mechanism(
        "stiffness-gradient", "the muscle's stiffness changes along the leg", ("gradient a 100 mm",), (_GRADIENT,)
    ),
    _Mechanism("fascia", "a sheet round the muscle, its fascia, holds it together", ("stiffness (N/mm)",), (_FASCIA,)),
    _Mechanism(
        "misregistration",
        "the two scans lie farther apart than the bones' registration says",
        ("x (mm)", "y (mm)", "z (mm)", "about x (rad)", "about y (rad)", "about z (rad)"),
        nuisances=slice(RIGID),
    ),
)
_NULLS = {strength.name: 0.0 for one in _MECHANISMS for strength in one.strengths}


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
    """Verdict on the model, with the tests that it rests on, by the names of ``result.json``."""

    verdict: Verdict
    named: tuple[str, ...]
    """One mechanism, or those that the contours can't tell apart."""
    scores: tuple[MechanismScore, ...]
    """Every mechanism's test, the most significant first."""
    places: tuple[DiscrepantPlace, ...]
    """Significant places, the most significant first."""
    rms_before_mm: float
    """Root-mean-square distance of the fit."""
    rms_after_mm: float | None
    """The same with the named mechanism in the model, solved anew."""
    c10_after_kPa: FloatArray | None
    """Of muscle and fat with that mechanism."""


type _Unexplained = Callable[[FloatArray], FloatArray]
"""Projects differences or their derivatives (m + s, ...) off all that stiffnesses and nuisances explain."""


def model_discrepancy(forward: StockingForward, comparison: ScanComparison, best: ScanFit) -> ModelDiscrepancy:
    """Test where and why the best fit differs from the scan.

    Parameters
    ----------
    forward, comparison
        Those of the search, whose sensors have no part in this.
    best
        Its best fit.
    """
    comparison = comparison.of_contours
    at = np.clip([best.stiffness[name] for name in PARAMETERS], *PLAUSIBLE)
    values = {**by_name(at), **_NULLS}
    outcome = forward.solve(values, (*PARAMETERS, *_NULLS))
    differences, by = comparison.differences(outcome)
    fitted = comparison.fit_nuisances(differences, at)
    stiffness = comparison.with_nuisances({name: by[name] for name in PARAMETERS}, fitted, values)
    basis = np.linalg.qr(fitted.projected(stiffness))[0]

    def unexplained(given: FloatArray) -> FloatArray:
        left = fitted.projected(given)
        return np.asarray(left - basis @ (basis.T @ left))

    signatures = {
        one: np.column_stack([*(by[strength.name] for strength in one.strengths), fitted.slopes[:, one.nuisances]])
        for one in _MECHANISMS
    }
    scores = _scores(signatures, differences, unexplained)
    distances = comparison.misfit.distances(shape_of(outcome, comparison.bare))
    places = _places(comparison.misfit, distances, unexplained(differences), unexplained)
    strongest = scores[0]
    if strongest.p_value > SIGNIFICANT:
        verdict: Verdict = "unexplained" if places else "consistent"
        return ModelDiscrepancy(verdict, (), scores, places, best.rms, None, None)
    # Within 6 by BIC's measure, parameters counted, a mechanism explains the distances as well.
    penalty = float(np.log(len(differences)))
    gains = {score.name: score.statistic - penalty * score.degrees for score in scores}
    alike = tuple(s.name for s in scores if s.p_value < SIGNIFICANT and gains[s.name] > gains[strongest.name] - 6.0)
    chosen = next(one for one in _MECHANISMS if one.name == strongest.name)
    after, parameters = _searched_again(forward, comparison, chosen, values)
    verdict = "named" if len(alike) == 1 else "ambiguous"
    return ModelDiscrepancy(verdict, alike, scores, places, best.rms, after, mpa_to_kpa(parameters))


def _scores(
    signatures: Mapping[_Mechanism, FloatArray], differences: FloatArray, unexplained: _Unexplained
) -> tuple[MechanismScore, ...]:
    found, left = [], unexplained(differences)
    for mechanism, slopes in signatures.items():
        signature = unexplained(slopes)
        strengths, _, rank, _ = np.linalg.lstsq(signature, -left, rcond=1e-4)
        statistic = float(np.sum((signature @ strengths) ** 2))
        errors = np.sqrt(np.diag(np.linalg.pinv(signature.T @ signature, rcond=1e-8)))
        named = zip(mechanism.labels, zip(map(float, strengths), map(float, errors), strict=True), strict=True)
        alone = float(chi2.sf(statistic, rank))
        found.append(MechanismScore(mechanism.name, mechanism.statement, statistic, int(rank), alone, dict(named)))
    corrected = holm([one.p_value for one in found])
    scores = [replace(one, p_value=float(p)) for one, p in zip(found, corrected, strict=True)]
    return tuple(sorted(scores, key=lambda s: (s.p_value, s.degrees - s.statistic)))


def _places(
    misfit: ContourMisfit, distances: FloatArray, left: FloatArray, unexplained: _Unexplained
) -> tuple[DiscrepantPlace, ...]:
    """Test sectors of both contours, in the lower slices, the upper ones, and all."""
    levels = misfit.target.levels
    half = len(levels) // 2
    tests: list[tuple[Literal["outer", "inner"], tuple[float, float], int, FloatArray]] = []
    for number, name in enumerate(CONTOURS):
        for span in (slice(0, half), slice(half + 1, None), slice(None)):
            ends = float(levels[span][0]), float(levels[span][-1])
            for sector in range(SECTORS):
                within = angle_from_sector(misfit.target.contours(name), sector) < np.pi / SECTORS
                box = np.zeros((2, *within.shape))
                box[number, span] = within[span]
                tests.append(("outer" if name == "outer" else "inner", ends, sector, box.ravel()))
    boxes = unexplained(misfit.whitened(np.stack([box for *_, box in tests], axis=1)))
    scores = (left @ boxes) ** 2 / np.sum(boxes**2, axis=0)
    corrected = holm(chi2.sf(scores, 1))
    found = [
        DiscrepantPlace(name, ends, 360.0 * sector / SECTORS, float(distances[box > 0].mean()), float(p))
        for (name, ends, sector, box), p in zip(tests, corrected, strict=True)
        if p <= SIGNIFICANT
    ]
    return tuple(sorted(found, key=lambda place: place.p_value))


def _searched_again(
    forward: StockingForward, comparison: ScanComparison, mechanism: _Mechanism, start: Values
) -> tuple[float, FloatArray]:
    """Search for stiffnesses and a mechanism's strength about a start, beside its nuisances' wider priors.

    Returns the root-mean-square distance (mm), and C10 (MPa).
    """
    parameters = (*stiffness_priors().parameters, *mechanism.strengths)
    names = tuple(one.name for one in parameters)
    held = {name: null for name, null in _NULLS.items() if name not in names}
    law, sd = IdentifiedLaw("neo-hookean", parameters, held, {}), comparison.nuisances.sd
    sd[mechanism.nuisances] = mechanism.sd
    wider = replace(comparison, nuisances_sd=sd)
    with FullSolver(forward, None, 1, Silent(), names) as solver:
        search = Search(law, wider, IdentificationSettings(most_solves=REPAIRS), solver, begun=True)
        search.solve(law.point(start)[None], "design")
        run_together([search])
    rms = float(np.sqrt(np.mean(wider.left(search.best) ** 2)))
    return rms, search.best.point[: len(PARAMETERS)]
