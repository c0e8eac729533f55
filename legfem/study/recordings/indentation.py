"""One indentation of meat or silicone: contact, elastic fit, what it leaves out, held-out test."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from legfem.diagnose.fit import Fit, Problem, fit
from legfem.diagnose.mechanisms import Mechanism
from legfem.diagnose.mechanisms.instrument import ContactOnset, ForceDrift, SupportCompliance
from legfem.diagnose.mechanisms.tissue import StrainStiffening
from legfem.diagnose.noise import estimate_errors
from legfem.diagnose.observations import Observations, observe
from legfem.diagnose.predict import Predictor
from legfem.recording import Instrument, Recording
from legfem.recording.smoothing import sample_noise
from legfem.study.recordings.data import MeatTest
from legfem.study.recordings.drop import Drop, ForceDrop, find_drops
from legfem.study.recordings.repair import Repair, repair
from legfem.study.recordings.responses import (
    Relaxation,
    SpecimenResponses,
    TwoRelaxations,
    ball_responses,
)
from legfem.units import FloatArray

MODEL_SCATTER = 0.02
"""Error of each value over the peak force that is granted to the model: a flat, even, wide layer
under a ball whose size is likely but not stated."""
DISPLACEMENT_SD_MM = 0.01
HELD_OUT_S = 5.0
"""The end of the hold that no fit sees."""
_BEYOND_MM = 1.5


@dataclass(frozen=True)
class Assumed:
    """What the recordings' sheets don't state."""

    ball_radius: float = 5.0
    """mm."""
    layer_radius: float = 40.0
    """mm."""


@dataclass(frozen=True, eq=False)
class Indented:
    """What was found in one test; forces in N."""

    test: MeatTest
    observed: Observations
    drops: tuple[Drop, ...]
    ramp: Fit
    """Elastic, fitted to the loading alone."""
    repair: Repair
    held_out: NDArray[np.bool_]
    """(n,)."""
    ramp_hold_rmse: float
    """Of the hold as the ramp's elastic fit predicts it."""
    held_out_rmse: tuple[float, float, float]
    """Of the held-out samples: the ramp's elastic fit, the elastic fit to all but them, the
    repaired model."""
    relaxed: float
    """Force at the end of the hold over the peak force, as recorded."""
    samples: tuple[FloatArray, FloatArray]
    """Times since contact (s) and forces of the recording, as they are."""
    predictor: Predictor
    solutions: int

    @property
    def air(self) -> float:
        """Displacement before first contact (mm), zero without air."""
        contact = self.observed.contacts[0]
        return contact.displacement if contact.in_air else 0.0


def loaded_and_held(recording: Recording) -> Recording:
    """Return the recording from the first motion to the end of the hold."""
    d = recording.displacement
    start = max(0, int(np.argmax(d > d[0] + 0.01 * np.ptp(d))) - 2)
    peak = int(np.argmax(d > 0.99 * d.max()))
    back = np.flatnonzero(d[peak:] < 0.98 * d.max())
    end = peak + int(back[0]) - 2 if len(back) else len(d)
    part = slice(start, end)
    return replace(
        recording,
        time=recording.time[part] - recording.time[start],
        displacement=d[part],
        force=recording.force[part],
    )


def study_indentation(test: MeatTest, assumed: Assumed) -> Indented:
    """Fit, name, refit and predict one test."""
    recording = loaded_and_held(test.recording)
    instrument = Instrument(max(sample_noise(recording.force), 2e-3), DISPLACEMENT_SD_MM)
    observed = observe([recording], instrument, starts_at_contact=False)
    drops = find_drops(recording)
    depth = observed.depth + _BEYOND_MM
    responses = ball_responses(
        test.thickness - observed.contacts[0].displacement,
        depth,
        assumed.ball_radius,
        assumed.layer_radius,
    )
    problem = problem_of(observed, instrument, responses)
    holding = observed.phase == "hold"
    held_out = holding & (observed.time > observed.time.max() - HELD_OUT_S)
    start = {"C10": 10.0, "C20": 0.0}
    ramp = fit(problem.without(holding), (), start)
    mended = repair(problem, _candidates(observed, drops), held_out, start)
    samples = _samples(recording, observed)
    return Indented(
        test, observed, drops, ramp, mended, held_out,
        float(np.sqrt(np.mean((ramp.residual[holding]) ** 2))),
        (
            _rmse(samples, observed, ramp),
            _rmse(samples, observed, mended.base),
            _rmse(samples, observed, mended.best),
        ),
        float(np.median(recording.force[-10:]) / recording.force.max()),
        samples,
        problem.predictor,
        responses.solutions,
    )  # fmt: skip


def problem_of(
    observed: Observations, instrument: Instrument, responses: SpecimenResponses
) -> Problem:
    """Return what fits need, with the error granted to the model.

    Granted as correlated and in proportion to the force, that error would draw a wrong model below
    all of the data (Peelle's puzzle): the elastic one has to be fitted fairly.
    """
    measured = estimate_errors(observed, instrument, numerical=0.0)
    scatter = (MODEL_SCATTER * np.abs(observed.force).max()) ** 2
    covariance = measured.covariance + scatter * np.eye(len(observed.force))
    errors = replace(measured, covariance=covariance, possible=())
    return Problem(Predictor(observed, responses, "neo-hookean"), errors)


def _candidates(observed: Observations, drops: Sequence[Drop]) -> list[Mechanism]:
    contact = observed.contacts[0].displacement
    return [
        Relaxation(),
        TwoRelaxations(),
        StrainStiffening(),
        ContactOnset(),
        SupportCompliance(),
        ForceDrift(),
        *(ForceDrop(0.5 * (drop.start_mm + drop.end_mm) - contact) for drop in drops[:1]),
    ]


def _samples(recording: Recording, observed: Observations) -> tuple[FloatArray, FloatArray]:
    """Return times since contact (s) and forces (N) of all samples; the hold's start is common."""
    contact = observed.contacts[0]
    hold = float(observed.protocols[0].protocol.time[-2])
    still = recording.displacement > recording.displacement.max() - 0.01
    since = recording.time - recording.time[np.argmax(still)] + hold
    return since, recording.force - contact.baseline


def _rmse(samples: tuple[FloatArray, FloatArray], observed: Observations, fitted: Fit) -> float:
    """Return the error of predicting the held-out samples (N)."""
    time, force = samples
    here = observed.phase == "hold"
    end = float(observed.protocols[0].protocol.time[-1])
    late = (time > end - HELD_OUT_S) & (time <= observed.time[here][-1])
    course = PchipInterpolator(observed.time[here], fitted.prediction[here])
    return float(np.sqrt(np.mean((force[late] - course(time[late])) ** 2)))


def predict_next(first: Indented, second: Indented) -> tuple[float, float]:
    """Return the error (N) of predicting a test by another's elastic and repaired models."""

    def error(fitted: Fit) -> float:
        predicted = second.predictor(fitted.values, fitted.mechanisms)
        return float(np.sqrt(np.mean((second.observed.force - predicted) ** 2)))

    return error(first.repair.base), error(first.repair.best)
