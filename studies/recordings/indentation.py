"""One indentation of meat or silicone: what the elastic model leaves out, and a held-out test."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from legfem.common.units import FloatArray, kpa_to_mpa, mpa_to_kpa
from legfem.data import Instrument, Recording, segment, segment_all
from legfem.data.smoothing import sample_noise
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.errors import error_model
from legfem.inverse.evidence import possible_discrepancies, with_discrepancy
from legfem.inverse.explain import explain
from legfem.inverse.explanation import Explained, Explanation
from legfem.inverse.linearised import LinearisedFit, LinearisedProblem
from legfem.inverse.map_fit import fit, fit_base
from legfem.inverse.observations import Observations, observe
from legfem.inverse.predictor import Predictor
from legfem.inverse.trial_noise import estimate_noise
from legfem.mechanisms import Mechanism
from legfem.mechanisms.muscle import StrainStiffening
from legfem.mechanisms.rig import ContactOnset, ForceDrift
from legfem.mechanisms.time_dependence import TissueRelaxation
from legfem.specimens.mechanisms import RigCompliance
from studies.recordings.curves import DEEPEST, LayerCurves
from studies.recordings.data import MeatTest
from studies.recordings.motion import (
    Drop,
    ForceDrop,
    Motion,
    SpecimenResponses,
    find_drops,
    loaded_and_held,
    motion_of,
    without_end_of_hold,
)

SHAPE_SD, SHAPE_NODES = 0.25, 6
"""Of the elastic force at so many depths, relative to that at the greatest: the indenter's shape
isn't stated, and in beef the force grows linearly at first, not as under a ball."""
FORCE_SD_N, DISPLACEMENT_SD_MM = 2e-3, 0.01
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
    seen: Observations
    """What was fitted: all but the end of the hold."""
    whole: Observations
    drops: tuple[Drop, ...]
    explained: Explained
    before: FloatArray
    """(n,): forces at all stations as the base model predicts them."""
    alone: FloatArray
    """(n,): the same of the most probable explanation."""
    after: FloatArray
    """(n,): the same, with what the trial's errors are expected to be by what was seen of them."""
    held_out_rmse: tuple[float, float, float]
    """Of the held-out samples: by these three."""
    line_rmse: float
    """Of the held-out samples, by a straight line in ln t through the earlier hold."""
    relaxed: float
    """Force at the end of the hold over the peak force, as recorded."""
    samples: tuple[FloatArray, FloatArray]
    """Times (s, after first contact) and forces of the recording, as they are."""
    motion: Motion

    @property
    def first_contact(self) -> float:
        """Displacement (mm) at first contact as fitted, after the first motion."""
        return self.whole.contacts[0].displacement + self.best.fit.values["trial1.onset"]

    @property
    def relaxation(self) -> tuple[float, ...]:
        """Ratio, middle (s) and spread of the spectrum; empty where nothing relaxes."""
        values = self.best.fit.values
        names = [f"viscoelasticity.{p.name}" for p in TissueRelaxation.parameters]
        return tuple(values[name] for name in names if name in values)

    @property
    def best(self) -> Explanation:
        """The most probable explanation."""
        return self.explained.every[0]

    @property
    def named_first(self) -> str:
        """The mechanism that alone explains most, if anything is named."""
        singles = [e for e in self.explained.every if len(e.names) == 1]
        first = max(singles, key=lambda e: e.log_weight)
        return first.names[0] if self.best.names else ""


def study_indentation(test: MeatTest, layers: LayerCurves) -> Indented:
    """Explain one test without the end of its hold, and predict that end."""
    recording = loaded_and_held(test.recording)
    instrument = Instrument(max(sample_noise(recording.force), FORCE_SD_N), DISPLACEMENT_SD_MM)
    whole = observe(segment_all([recording], instrument))
    seen = observe(segment_all([without_end_of_hold(recording, HELD_OUT_S)], instrument))
    drops = find_drops(recording)
    motion = motion_of(recording, whole)
    thickness = test.thickness - whole.contacts[0].displacement
    depth = max(whole.depth, min(whole.depth + _BEYOND_MM, DEEPEST * thickness))
    responses = SpecimenResponses(layers.of(thickness, depth), motion)
    problem, base = fitted_base(Predictor(seen, responses, "neo-hookean"), instrument)
    able = [m for m in candidates(seen, drops) if m.untestable(seen) is None]
    explained = explain(problem, base, able)
    best = explained.every[0]
    before, _ = predicted(explained.base, whole, motion)
    alone, after = predicted(best, whole, motion)
    samples = _samples(recording, whole, motion)
    return Indented(
        test,
        seen,
        whole,
        drops,
        explained,
        before,
        alone,
        after,
        (
            _rmse(samples, whole, motion, before),
            _rmse(samples, whole, motion, alone),
            _rmse(samples, whole, motion, after),
        ),
        line_rmse(samples, motion),
        float(np.median(recording.force[-10:]) / recording.force.max()),
        samples,
        motion,
    )


def fitted_base(predictor: Predictor, instrument: Instrument) -> tuple[LinearisedProblem, LinearisedFit]:
    """Fit the elastic model, with the errors granted to instrument and indenter."""
    observed = predictor.observed
    noise = estimate_noise(observed, instrument, observed.slowest)
    shapes = shape_errors(observed)
    problem = LinearisedProblem(predictor, error_model(observed, noise, observed.force, shapes))
    base = fit_base(problem, [{DEEP_C10: kpa_to_mpa(c10)} for c10 in (1.0, 5.0, 25.0)])
    problem = problem.with_errors(error_model(observed, noise, base.prediction, shapes))
    return problem, fit(problem, (), base.values)


def shape_errors(observed: Observations) -> list[tuple[str, FloatArray]]:
    """Return the effects (n,), N, of what isn't known of the indenter, by name.

    At the greatest depth there is none, since C10 is in proportion to the force. They are shares
    of the recorded force, for no model is known yet; that they end there keeps a model from being
    drawn below the data (Peelle's puzzle).
    """
    nodes = np.linspace(0.0, observed.depth, SHAPE_NODES)
    return [
        (f"indenter at {node:.1f} mm", SHAPE_SD * observed.force * np.interp(observed.displacement, nodes, row))
        for node, row in zip(nodes[:-1], np.eye(SHAPE_NODES), strict=False)
    ]


def predicted(explanation: Explanation, whole: Observations, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return an explanation's forces (n,), N, all but the end of the hold seen.

    By the model alone, and with the conditional expectation of the errors: a trial's gain, its zero
    and what is unknown beside the explanation don't change when the fit's data end (C. E.
    Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning (2006), section 2.2).
    """
    predictor = replace(explanation.problem.predictor, observed=whole)
    known = predictor(explanation.fit.values, explanation.fit.mechanisms)
    noise = explanation.problem.errors.noise
    errors = error_model(whole, noise, known, shape_errors(whole))
    unknown = possible_discrepancies(whole, known)[int(np.argmax(explanation.posterior.discrepancy_weights))]
    errors = with_discrepancy(errors, unknown)
    kept = motion.at_stations(whole) <= motion.time[-1] - HELD_OUT_S
    problem = LinearisedProblem(predictor, errors).without(~kept)
    fitted = fit(problem, explanation.fit.mechanisms, explanation.fit.values)
    total = errors.covariance
    weights = np.linalg.solve(total[np.ix_(kept, kept)], fitted.residual[kept])
    after = fitted.prediction + np.where(kept, 0.0, total[:, kept] @ weights)
    return fitted.prediction, np.asarray(after)


def candidates(observed: Observations, drops: Sequence[Drop] = ()) -> list[Mechanism]:
    """Return the mechanisms that such tests may show."""
    contact = observed.contacts[0].displacement
    return [
        TissueRelaxation(),
        StrainStiffening(),
        ContactOnset(),
        RigCompliance(),
        ForceDrift(),
        *(ForceDrop(0.5 * (drop.start_mm + drop.end_mm) - contact) for drop in drops[:1]),
    ]


def _samples(recording: Recording, observed: Observations, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return times since contact (s) and forces (N) of all samples."""
    shift = recording.time[-1] - motion.time[-1]
    return recording.time - shift, recording.force - observed.contacts[0].baseline


def _late(time: FloatArray, motion: Motion) -> NDArray[np.bool_]:
    return (time > motion.time[-1] - HELD_OUT_S) & (time <= motion.time[-1])


def _rmse(
    samples: tuple[FloatArray, FloatArray], observed: Observations, motion: Motion, prediction: FloatArray
) -> float:
    """Return the error of predicting the held-out samples (N)."""
    time, force = samples
    held = observed.phase == "hold"
    since = motion.at_stations(observed)[held] - motion.hold_starts
    late = _late(time, motion)
    course = PchipInterpolator(np.log(since), prediction[held])
    predicted = course(np.log(time[late] - motion.hold_starts))
    return float(np.sqrt(np.mean((force[late] - predicted) ** 2)))


def line_rmse(samples: tuple[FloatArray, FloatArray], motion: Motion) -> float:
    """Return the held-out samples' error by a straight line in ln t through the earlier hold."""
    time, force = samples
    late, since = _late(time, motion), time - motion.hold_starts
    early = (since > 1e-6) & ~late & (time <= motion.time[-1])
    line = np.polyfit(np.log(since[early]), force[early], 1)
    return float(np.sqrt(np.mean((force[late] - np.polyval(line, np.log(since[late]))) ** 2)))


@dataclass(frozen=True)
class Row:
    """What is told of one test; forces in N, lengths in mm."""

    test: str
    material: str
    problem: str
    """Why there is nothing else, or nothing."""
    first_contact: float = 0.0
    relaxed: float = 0.0
    c10_elastic: float = 0.0
    """kPa."""
    c10: float = 0.0
    """kPa, of the most probable explanation."""
    named_first: str = ""
    explanations: tuple[tuple[tuple[str, ...], float], ...] = ()
    """Mechanisms and probability of the leading ones."""
    in_part: bool = False
    relaxation: tuple[float, ...] = ()
    elastic_rmse: float = 0.0
    alone_rmse: float = 0.0
    after_rmse: float = 0.0
    line_rmse: float = 0.0
    air_error: float | None = None
    """How much too deep 1.5 mm of air are found; None where there is air already."""

    @property
    def is_beef(self) -> bool:
        """Whether it is meat and not silicone."""
        return self.material.startswith("beef")


def row_of(found: Indented) -> Row:
    """Return what is told of a test."""
    leading = tuple((e.names, e.probability) for e in found.explained.every[:4])
    return Row(
        found.test.name,
        found.test.material,
        "",
        found.first_contact,
        found.relaxed,
        mpa_to_kpa(found.explained.base.fit.values[DEEP_C10]),
        mpa_to_kpa(found.best.fit.values[DEEP_C10]),
        found.named_first,
        leading,
        found.best.in_part,
        found.relaxation,
        *found.held_out_rmse,
        found.line_rmse,
        air_found(found.test),
    )


def try_indentation(test: MeatTest, layers: LayerCurves, draw: Callable[[Indented], None] = lambda _: None) -> Row:
    """Study a test; one that can't be read or solved costs itself only."""
    try:
        found = study_indentation(test, layers)
    except (ValueError, RuntimeError, np.linalg.LinAlgError) as error:
        return Row(test.name, test.material, str(error))
    draw(found)
    return row_of(found)


def air_found(test: MeatTest, air: float = 1.5) -> float | None:
    """Return how much too deep (mm) first contact is detected with air put in before the test.

    The recording begins earlier by as much travel at the first speed, with the first reading's
    force and the noise of the readings. None for tests that begin in air of their own.
    """
    recording = loaded_and_held(test.recording)
    own = segment(recording, Instrument(FORCE_SD_N, DISPLACEMENT_SD_MM)).contact
    if own.in_air:
        return None
    moved = with_air(recording, air)
    return segment(moved, Instrument(FORCE_SD_N, DISPLACEMENT_SD_MM)).contact.displacement - air


def with_air(recording: Recording, air: float) -> Recording:
    """Return a recording with so much air (mm) put in before it."""
    step = float(np.median(np.diff(recording.time)))
    speed = float(np.polyfit(recording.time[2:12], recording.displacement[2:12], 1)[0])
    count = max(8, round(air / (speed * step)))
    before = np.arange(count) * air / count
    noise = sample_noise(recording.force)
    force = recording.force[0] + np.random.default_rng(0).normal(0.0, noise, count)
    return replace(
        recording,
        time=np.concatenate([np.arange(count) * step, recording.time + count * step]),
        displacement=np.concatenate([before, recording.displacement + air]),
        force=np.concatenate([force, recording.force]),
    )
