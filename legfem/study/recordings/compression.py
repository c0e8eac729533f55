"""A kind of phantom compressed between plates: its ends, slid or stuck, and its law.

The recordings are of loading alone, at one speed: nothing about time can be told from them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from legfem.diagnose.fit import Fit, Problem
from legfem.diagnose.mechanisms import Mechanism
from legfem.diagnose.mechanisms.instrument import ContactOnset, SupportCompliance
from legfem.diagnose.mechanisms.tissue import StrainStiffening
from legfem.diagnose.noise import estimate_errors
from legfem.diagnose.observations import Observations, observe
from legfem.diagnose.predict import Predictor
from legfem.experiments.axisymmetric import CylinderBetweenPlates
from legfem.recording import Instrument, Recording
from legfem.study.recordings.data import Phantom
from legfem.study.recordings.repair import Repair, repair
from legfem.study.recordings.responses import SpecimenResponses, cylinder_responses
from legfem.units import FloatArray

Ends = Literal["sliding", "bonded"]
ENDS: tuple[Ends, ...] = ("sliding", "bonded")
GREATEST_STRAIN = 0.4
FITTED_STRAIN = 0.3
"""What is beyond is held out."""
FORCE_SHARE, DISPLACEMENT_SD_MM = 0.001, 0.01
MODEL_SCATTER = 0.01
"""As that of the indentations: a share of the peak force, of each value apart."""
_BEYOND_MM = 0.6


@dataclass(frozen=True, eq=False)
class WithEnds:
    """One sample's fits with one kind of ends; forces in N."""

    ends: Ends
    repair: Repair
    held_out_rmse: tuple[float, float]
    """Beyond the strain fitted: neo-Hookean, repaired."""
    next_rmse: tuple[float, float]
    """Of the next sample of the kind, by this one's parameters: the same two."""


@dataclass(frozen=True, eq=False)
class Compressed:
    """What was found in one sample."""

    phantom: Phantom
    observed: Observations
    fits: tuple[WithEnds, ...]

    @property
    def better(self) -> WithEnds:
        """The ends that explain the recording better, by Schwarz' criterion."""
        return min(self.fits, key=lambda f: f.repair.best.bic)

    @property
    def better_base(self) -> WithEnds:
        """The same for the neo-Hookean models."""
        return min(self.fits, key=lambda f: f.repair.base.bic)


def study_kind(phantoms: Sequence[Phantom]) -> tuple[Compressed, ...]:
    """Fit every sample of a kind with both kinds of ends."""
    first = phantoms[0]
    depth = GREATEST_STRAIN * first.height + _BEYOND_MM
    responses = {
        ends: cylinder_responses(CylinderBetweenPlates(first.radius, first.height, ends), depth)
        for ends in ENDS
    }
    seen = [_observe(p.recording, GREATEST_STRAIN * p.height) for p in phantoms]
    following = [*range(1, len(phantoms)), 0]
    return tuple(
        Compressed(
            phantom,
            observed,
            tuple(
                _with_ends(ends, responses[ends], phantom.height, observed, seen[after])
                for ends in ENDS
            ),
        )
        for phantom, observed, after in zip(phantoms, seen, following, strict=True)
    )


def _observe(recording: Recording, depth: float) -> Observations:
    end = int(np.argmax(recording.displacement > depth)) or len(recording)
    part = slice(0, end)
    cut = replace(
        recording,
        time=recording.time[part],
        displacement=recording.displacement[part],
        force=recording.force[part],
    )
    return observe([cut], Instrument(0.0, DISPLACEMENT_SD_MM), starts_at_contact=True)


def _with_ends(
    ends: Ends,
    responses: SpecimenResponses,
    height: float,
    observed: Observations,
    after: Observations,
) -> WithEnds:
    problem = _problem(observed, responses)
    beyond = observed.displacement > FITTED_STRAIN * height
    mended = repair(problem, _candidates(), beyond, {"C10": 10.0, "C20": 0.0})
    following = _problem(after, responses).predictor

    def rmse(fitted: Fit) -> tuple[float, float]:
        error = after.force - following(fitted.values, fitted.mechanisms)
        return _rms(fitted.residual[beyond]), _rms(error)

    before, repaired = rmse(mended.base), rmse(mended.best)
    return WithEnds(ends, mended, (before[0], repaired[0]), (before[1], repaired[1]))


def _candidates() -> list[Mechanism]:
    return [StrainStiffening(), ContactOnset(), SupportCompliance()]


def _problem(observed: Observations, responses: SpecimenResponses) -> Problem:
    """Return what fits need, with the errors granted to instrument and model."""
    peak = float(np.abs(observed.force).max())
    stated = Instrument(FORCE_SHARE * peak, DISPLACEMENT_SD_MM)
    errors = estimate_errors(observed, stated, numerical=0.0)
    scatter = (MODEL_SCATTER * peak) ** 2 * np.eye(len(observed.force))
    errors = replace(errors, covariance=errors.covariance + scatter, possible=())
    return Problem(Predictor(observed, responses, "neo-hookean"), errors)


def fitted_c10(compressed: Sequence[Compressed], ends: Ends) -> FloatArray:
    """Return the neo-Hookean C10 (kPa) of every sample with given ends."""
    return np.array(
        [f.repair.base.values["C10"] for c in compressed for f in c.fits if f.ends == ends]
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
