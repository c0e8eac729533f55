r"""Model discrepancy: where the contours of model and scan differ, and which physics would explain it.

The best fit leaves whitened distances :math:`w`. The part that stiffnesses and nuisances within
their priors can explain is projected off. A mechanism has a signature :math:`S`, the derivatives of
the distances by its parameters at the mechanism's null, projected likewise, and the score

.. math:: T = w^T S (S^T S)^{-1} S^T w \sim \chi^2_k

where nothing is wrong. Places on the contours are tested in the same way, with a unit distance over
the place as signature. All p-values are family-wise over the mechanisms, or over the places (Holm).
The mechanism with the least p-value is put into the model, and the leg is solved anew.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import chi2
from statsmodels.stats.multitest import multipletests

from legfem.common.units import FloatArray, kpa_to_mpa
from legfem.geometry.slices import CONTOURS
from legfem.stockings.equilibrium import Worn, WornLeg
from legfem.stockings.leg_model import PARAMETERS
from legfem.stockings.misfit import ContourMisfit
from legfem.stockings.nuisances import RIGID, SECTORS, NuisanceSlopes, from_sector, sectors
from legfem.stockings.scan_fit import BOUNDS, LinearisedContours
from legfem.stockings.search import Identified

SIGNIFICANT = 0.025
"""Of each of two families of tests, the mechanisms' and the places': 5 % where nothing is wrong."""
PLAUSIBLE = kpa_to_mpa(np.array([[1.3, 3.3], [8.1, 20.4]]))
"""C10 of muscle and fat (MPa) at which mechanisms are tested, at the least and at most: the second
paper's means over and times 2.5. Where one is left out, the best fit may lie far off."""
REPAIRS = 5
"""Solutions with the named mechanism in the model."""
TERMS = {
    "volume-loss": "deep.volume_loss.share",
    "stiffness-gradient": "deep.stiffness_gradient.gradient",
    "fascia": "fascia.membrane.stiffness",
}
"""Parameters of the mechanisms that are terms of the model, zero at their null."""


@dataclass(frozen=True, eq=False)
class MisfitMechanism:
    """What may be wrong, with the distances' slopes by its parameters, (n, k)."""

    name: str
    statement: str
    labels: tuple[str, ...]
    slopes: FloatArray


@dataclass(frozen=True)
class MechanismScore:
    """A mechanism's test; ``strengths`` by label, with their standard errors."""

    name: str
    statement: str
    statistic: float
    degrees: int
    p_value: float
    """Family-wise."""
    strengths: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class MisfitPlace:
    """A part of a contour that differs more than errors allow."""

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
class Mismatch:
    """What the contours say of the model."""

    verdict: Literal["consistent", "named", "ambiguous", "unexplained"]
    named: tuple[str, ...]
    """One mechanism, or those that the contours can't tell apart."""
    scores: tuple[MechanismScore, ...]
    """The strongest first."""
    places: tuple[MisfitPlace, ...]
    rms_before: float
    """mm."""
    rms_after: float | None
    """With the named mechanism in the model, solved anew (mm)."""
    parameters_after: FloatArray | None
    """C10 of muscle and fat then, MPa."""


def mismatch_of(leg: WornLeg, misfit: ContourMisfit, nuisances: NuisanceSlopes, best: Identified) -> Mismatch:
    """Locate and name what the best fit leaves.

    Parameters
    ----------
    leg, misfit, nuisances
        Of the identification.
    best
        Its best weighted result, of a state that was found.
    """
    tested_at = np.clip(best.parameters, *PLAUSIBLE)
    worn = _solve(leg, tested_at, best.worn)
    contours = LinearisedContours(leg, misfit, worn)
    distances = contours.distances
    prior = np.concatenate([np.zeros(2), 1 / nuisances.sd])
    base, mechanisms = _slopes(contours, nuisances.at(tested_at), tested_at)
    basis = np.vstack([misfit.whitened(base), np.diag(prior)])
    orthonormal = np.linalg.qr(basis)[0]
    white = _projected(np.concatenate([misfit.whitened(distances), np.zeros(len(prior))]), orthonormal)
    scores = _scores(mechanisms, misfit, white, orthonormal)
    places = _places(misfit, white, orthonormal, distances)
    strongest = scores[0]
    if min([strongest.p_value, *(p.p_value for p in places)]) > SIGNIFICANT:
        return Mismatch("consistent", (), scores, places, best.rms, None, None)
    if strongest.p_value > SIGNIFICANT:
        return Mismatch("unexplained", (), scores, places, best.rms, None, None)
    penalty = float(np.log(len(white) - len(prior)))
    alike = tuple(s.name for s in scores if s.p_value < SIGNIFICANT and _as_good(s, strongest, penalty))
    chosen = next(m for m in mechanisms if m.name == strongest.name)
    after, parameters = _repaired(leg, misfit, tested_at, worn, base, prior, chosen, distances)
    verdict: Literal["named", "ambiguous"] = "named" if len(alike) == 1 else "ambiguous"
    return Mismatch(verdict, alike, scores, places, best.rms, after, parameters)


def _slopes(
    contours: LinearisedContours, nuisances: FloatArray, parameters: FloatArray
) -> tuple[FloatArray, tuple[MisfitMechanism, ...]]:
    """Return the slopes by log stiffness and nuisances, (n, 2 + k), and the mechanisms."""
    stiffness = [v * contours.by_parameter(n) for n, v in zip(PARAMETERS, parameters, strict=True)]
    rigid, local = nuisances[:, :RIGID], nuisances[:, RIGID : RIGID + SECTORS]
    return np.column_stack([*stiffness, nuisances]), (
        MisfitMechanism(
            "local-pressure",
            "the pressure on the skin is wrong on one side of the leg",
            tuple(f"at {360 * k / SECTORS:.0f} degrees" for k in range(SECTORS)),
            local,
        ),
        MisfitMechanism(
            "volume-loss",
            "the deep tissue has lost volume: blood has drained from it",
            ("share",),
            contours.by_parameter(TERMS["volume-loss"])[:, None],
        ),
        MisfitMechanism(
            "stiffness-gradient",
            "the muscle's stiffness changes along the leg",
            ("gradient a 100 mm",),
            contours.by_parameter(TERMS["stiffness-gradient"])[:, None],
        ),
        MisfitMechanism(
            "fascia",
            "a sheet round the muscle, its fascia, holds it together",
            ("stiffness (N/mm)",),
            contours.by_parameter(TERMS["fascia"])[:, None],
        ),
        MisfitMechanism(
            "misregistration",
            "the two scans lie farther apart than the bones' registration says",
            ("x (mm)", "y (mm)", "z (mm)", "about x (rad)", "about y (rad)", "about z (rad)"),
            rigid,
        ),
    )


def _scores(
    mechanisms: Sequence[MisfitMechanism], misfit: ContourMisfit, white: FloatArray, orthonormal: FloatArray
) -> tuple[MechanismScore, ...]:
    found = []
    for mechanism in mechanisms:
        signature = _signature(mechanism.slopes, misfit, orthonormal)
        strengths, _, rank, _ = np.linalg.lstsq(signature, -white, rcond=1e-4)
        statistic = float(np.sum((signature @ strengths) ** 2))
        errors = np.sqrt(np.diag(np.linalg.pinv(signature.T @ signature, rcond=1e-8)))
        found.append((mechanism, statistic, int(rank), strengths, errors))
    raw = [float(chi2.sf(statistic, rank)) for _, statistic, rank, _, _ in found]
    corrected = multipletests(raw, method="holm")[1]
    scores = [
        MechanismScore(
            mechanism.name,
            mechanism.statement,
            statistic,
            rank,
            float(p),
            {label: (float(s), float(e)) for label, s, e in zip(mechanism.labels, strengths, errors, strict=True)},
        )
        for (mechanism, statistic, rank, strengths, errors), p in zip(found, corrected, strict=True)
    ]
    return tuple(sorted(scores, key=lambda s: (s.p_value, s.degrees - s.statistic)))


def _places(
    misfit: ContourMisfit, white: FloatArray, orthonormal: FloatArray, distances: FloatArray
) -> tuple[MisfitPlace, ...]:
    """Test sectors of both contours, in the lower slices, the upper ones, and all."""
    levels = misfit.target.levels
    half = len(levels) // 2
    spans = (slice(0, half), slice(half + 1, None), slice(None))
    tests: list[tuple[Literal["outer", "inner"], slice, int, FloatArray]] = []
    for number, name in enumerate(CONTOURS):
        contours = misfit.target.contours(name)
        for span in spans:
            for sector in range(SECTORS):
                within = from_sector(contours, sector) < np.pi / SECTORS
                box = np.zeros((2, *within.shape))
                box[number, span] = within[span]
                which: Literal["outer", "inner"] = "outer" if name == "outer" else "inner"
                tests.append((which, span, sector, box.ravel()))
    boxes = _signature(np.stack([box for *_, box in tests], axis=1), misfit, orthonormal)
    scores = (white @ boxes) ** 2 / np.sum(boxes**2, axis=0)
    corrected = multipletests(chi2.sf(scores, 1), method="holm")[1]
    found = [
        MisfitPlace(
            name,
            (float(levels[span][0]), float(levels[span][-1])),
            360.0 * sector / SECTORS,
            float(distances[box > 0].mean()),
            float(p),
        )
        for (name, span, sector, box), p in zip(tests, corrected, strict=True)
        if p < SIGNIFICANT
    ]
    return tuple(sorted(found, key=lambda place: place.p_value))


def _repaired(
    leg: WornLeg,
    misfit: ContourMisfit,
    tested_at: FloatArray,
    worn: Worn,
    base: FloatArray,
    prior: FloatArray,
    mechanism: MisfitMechanism,
    distances: FloatArray,
) -> tuple[float | None, FloatArray]:
    """Fit stiffnesses, nuisances and mechanism together; the slopes stay those of the best fit."""
    motion = slice(2, 2 + RIGID)
    pressure = slice(2 + RIGID, 2 + RIGID + SECTORS)
    outlines = slice(2 + RIGID + SECTORS, base.shape[1])
    released = {"misregistration": motion, "local-pressure": pressure}
    weights = prior.copy()
    slopes = base
    if mechanism.name in released:
        weights[released[mechanism.name]] = 0.0
    else:
        slopes = np.column_stack([base, mechanism.slopes])
        weights = np.append(weights, 0.0)
    rows = np.vstack([misfit.whitened(slopes), np.diag(weights)])
    bumps = sectors(leg.model.shape)
    total = np.zeros(len(weights))
    parameters, left = tested_at, distances
    for _ in range(REPAIRS):
        right = np.concatenate([misfit.whitened(left), weights * total])
        total -= np.linalg.lstsq(rows, right, rcond=1e-8)[0]
        total[:2] = np.clip(total[:2], -1.5, 1.5)
        parameters = np.clip(tested_at * np.exp(total[:2]), *BOUNDS)
        error = np.maximum(sum(c * b for c, b in zip(total[pressure], bumps, strict=True)), -1.0)
        extra = {TERMS[mechanism.name]: float(total[-1])} if mechanism.name in TERMS else {}
        worn = _solve(leg, parameters, worn, extra, error)
        if not worn.state.report.complete:
            return None, parameters
        moved = misfit.distances(worn.shape) + base[:, motion] @ total[motion]
        left = moved + base[:, outlines] @ total[outlines]
    return float(np.sqrt(np.mean(moved**2))), parameters


def _solve(
    leg: WornLeg,
    parameters: FloatArray,
    start: Worn,
    extra: Mapping[str, float] | None = None,
    error: FloatArray | float = 0.0,
) -> Worn:
    values = dict(zip(PARAMETERS, map(float, parameters), strict=True))
    nulls = dict.fromkeys(TERMS.values(), 0.0)
    names = () if extra is not None else (*PARAMETERS, *nulls)
    return leg.find({**values, **nulls, **(extra or {})}, names, start, error)


def _signature(slopes: FloatArray, misfit: ContourMisfit, orthonormal: FloatArray) -> FloatArray:
    white = misfit.whitened(slopes)
    padding = np.zeros((len(orthonormal) - len(white), slopes.shape[1]))
    return _projected(np.vstack([white, padding]), orthonormal)


def _projected(values: FloatArray, orthonormal: FloatArray) -> FloatArray:
    return np.asarray(values - orthonormal @ (orthonormal.T @ values))


def _as_good(score: MechanismScore, strongest: MechanismScore, penalty: float) -> bool:
    """Tell whether a score is as good by BIC's measure: within 6, parameters counted."""
    gain, best = (s.statistic - penalty * s.degrees for s in (score, strongest))
    return bool(gain > best - 6.0)
