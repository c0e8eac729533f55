"""Displacements inside a leg by another code, in an image that lies elsewhere: what they name, and what is left."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pytest
from making_diagnosis import INSTRUMENT, MADE
from numpy.typing import NDArray
from scipy.stats import binomtest

from legfem.channels import Sight
from legfem.channels.kind import Frames
from legfem.channels.kinds.section_image import INSIDE, SectionDisplacements
from legfem.channels.laid import STEP_DEG, STEP_MM, WAYS, laid_course
from legfem.common.progress import Silent
from legfem.common.units import FloatArray
from legfem.data import Recording, segment_all
from legfem.data.recording import RecordedChannel
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.geometry.indenter import Site
from legfem.geometry.section import CALF, LIMBS, across
from legfem.inverse.diagnose import DiagnosisInput, diagnose
from legfem.inverse.errors import IMAGE_LEFT
from legfem.inverse.library import Detail, Library
from legfem.inverse.library_build import build_library
from legfem.inverse.library_tasks import STIFFENING, middle_of
from legfem.inverse.linearised import nuisance_effects
from legfem.inverse.mechanism import prior_of, shown_mechanisms
from legfem.inverse.observations import Observations, observe
from legfem.inverse.plan import Design, evaluate_design, prior_candidates
from legfem.inverse.responses import SolvedResponses
from legfem.inverse.verdict import Diagnosis
from legfem.legs.diagnosis import WITHOUT_ENDS
from legfem.legs.finite_element_models import LegVariants, plane_strain_test
from legfem.legs.loading import load_subject
from legfem.legs.nuisances import ShapeAccuracy
from legfem.legs.plan import with_channels
from legfem.legs.schema import SUBJECTS
from legfem.mechanisms import TissueMechanism, mechanism_named, mechanisms
from legfem.solve.protocol import Protocol
from studies.making.plane_leg import OtherCase, OtherCode
from studies.making.recording import flicker

pytestmark = pytest.mark.slow
DEPTH, RATE, LATE_S, C10_KPA = 9.0, 0.5, 0.1, 0.75
ASKED = ("superficial-stiffness", "fascia-stiffness", "indenter-tilt", "strain-stiffening")
SUBJECT = load_subject(SUBJECTS.find("3"), need_recordings=False)
SITE = Site(SUBJECT.section, SUBJECT.indenter)
LAW = SUBJECT.tissues["deep"].law
SETTINGS = PlaneStrainSettings()
SETTINGS = replace(SETTINGS, mesh=SETTINGS.mesh.refined(0.45))


def grid(deep: FloatArray, left: FloatArray) -> FloatArray:
    """Points at depths below the cylinder's axis at first touch, and to the left of the travel."""
    at = np.array([(x, y) for y in deep for x in left])
    return np.asarray(SITE.touch + at[:, :1] * across(SITE.direction) + at[:, 1:] * SITE.direction)


POINTS = grid(np.arange(18.0, 46.0, 3.0), np.arange(-18.0, 19.0, 3.0))


def sight(points: FloatArray) -> Sight:
    return Sight(INSIDE.name, tuple((float(x), float(y), float(way)) for x, y in points for way in (0, 1)))


def turn_of(degrees: float) -> FloatArray:
    angle = np.deg2rad(degrees)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@dataclass(frozen=True, eq=False)
class Pressed:
    """felupe's leg as it is pressed."""

    displacement: FloatArray
    force: FloatArray
    moves: FloatArray
    """(steps, points, 2)."""

    @classmethod
    def of(cls, points: FloatArray, factors: Mapping[str, float]) -> Pressed:
        found = OtherCode(SUBJECT, OtherCase(C10_KPA, factors=factors), sights=[sight(points)]).solve(DEPTH, 0.75)
        assert found.reached
        rows = np.array([found.channels[name] for name in INSIDE.courses(2 * len(points))])
        return cls(found.displacement, found.force, rows.T.reshape(len(found.displacement), -1, 2))

    def at(self, depth: float) -> FloatArray:
        """Return displacements (points, 2), mm."""
        rows = self.moves.reshape(len(self.moves), -1).T
        return np.array([np.interp(depth, self.displacement, row) for row in rows]).reshape(-1, 2)


def pressed_thrice(leg: Pressed, rng: np.random.Generator) -> list[Recording]:
    """Recordings of three trials."""
    recordings = []
    for k in range(3):
        time = np.arange(0.0, DEPTH / RATE, 0.05)
        force = np.interp(RATE * time, leg.displacement, leg.force)
        force = (1 + 0.005 * rng.standard_normal()) * force + 0.02 * rng.standard_normal()
        force += 0.02 * rng.standard_normal(len(time))
        at = RATE * time + 0.01 * rng.standard_normal(len(time))
        recordings.append(Recording(time, at, force, f"trial{k + 1}"))
    return recordings


def tracked(
    points: FloatArray, moved: Callable[[float], FloatArray], turn: float, rng: np.random.Generator, slow: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """Times of a frame a second, and what an image that is turned (degrees) shows points (m, 2) to move by, (n, m, 2).

    Speckle errors by 0.3 mm (Laplace's distribution, alike over 4 mm), 1 % of gain, 0.1 s late; tracking drifts slowly
    (mm, flicker noise).
    """
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    alike = np.linalg.cholesky(np.exp(-apart / 4.0) + 1e-9 * np.eye(len(points)))
    times = np.arange(0.0, DEPTH / RATE, 1.0)
    read = np.array([1.01 * moved(RATE * max(time - LATE_S, 0.0)) @ turn_of(turn) for time in times])
    read += 0.3 * alike @ rng.laplace(0.0, 1 / np.sqrt(2), read.shape)
    drift = [flicker(len(times), rng) for _ in range(points.size)]
    return times, read + slow * np.array(drift).T.reshape(read.shape)


def library_of(observed: Observations) -> Library:
    """Tables at the places of an image."""
    places = (Sight(INSIDE.name, observed.channels[0].places),)
    variants = LegVariants(replace(plane_strain_test(SUBJECT, SETTINGS), sights=places))
    solved = SolvedResponses(variants, DEPTH + 1.0, None, {})
    asked = [one for one in map(mechanism_named, ASKED) if isinstance(one, TissueMechanism)]
    middle = middle_of(observed, solved, STIFFENING[LAW])
    library = build_library(
        solved, observed, asked, 1, Silent(), middle, STIFFENING[LAW], Detail.of_all(asked, pairs=False)
    )
    able, _ = shown_mechanisms(mechanisms(), observed, WITHOUT_ENDS)
    others = [one.name for one in able if isinstance(one, TissueMechanism) and one not in asked]
    return replace(library, missing={**library.missing, **dict.fromkeys(others, "isn't tabulated")})


def diagnosed(observed: Observations, library: Library) -> Diagnosis:
    known = ShapeAccuracy(bones=LIMBS[CALF])
    given = DiagnosisInput(
        observed, INSTRUMENT, LAW, library, mechanisms(), MADE, "leg", accuracy=known, ruled_out=WITHOUT_ENDS
    )
    return diagnose(given, None, Silent())


SHIFT_MM, TURN_DEG = np.array([1.5, -1.0]), 2.0
"""Of the image, which the lab doesn't know of."""


@pytest.fixture(scope="module")
def stiff_fat() -> Observations:
    """Recordings of a fat that is 2.5 times as stiff, with frames of many points where the lab takes them to be."""
    leg, rng = Pressed.of(POINTS, {"superficial": 2.5}), np.random.default_rng(5)
    recordings, middle = pressed_thrice(leg, rng), POINTS.mean(axis=0)
    stated = middle + (POINTS - middle - SHIFT_MM) @ turn_of(TURN_DEG)
    times, moves = tracked(POINTS, leg.at, TURN_DEG, rng)
    table = np.concatenate(
        [np.column_stack([np.full(len(POINTS), t), stated, u]) for t, u in zip(times, moves, strict=True)]
    )
    frames = Frames(table[:, 0], table[:, 1:], recordings[0].time, recordings[0].force)
    ((read,),) = SectionDisplacements().of_frames([frames], SITE)
    return observed_with(recordings, read.time, read.values, read.course, read.places)


def observed_with(
    recordings: list[Recording],
    time: FloatArray,
    values: FloatArray,
    course: NDArray[np.int_],
    places: tuple[tuple[float, ...], ...],
) -> Observations:
    """Observations whose first trial has displacements inside."""
    inside = RecordedChannel(INSIDE.name, time, values, INSIDE.usual, None, course, places)
    return observe(segment_all([replace(recordings[0], channels=(inside,)), *recordings[1:]], INSTRUMENT, True))


@pytest.fixture(scope="module")
def library(stiff_fat) -> Library:
    return library_of(stiff_fat)


def test_a_stiff_fat_is_named_by_displacements_inside(stiff_fat, library):
    """felupe's leg with 2.5 times the fat's stiffness: force alone is consistent and hides it in C10."""
    alone, both = diagnosed(replace(stiff_fat, channels=()), library), diagnosed(stiff_fat, library)
    print(alone.verdict, both.verdict, [one.name for one in both.best.fit.mechanisms])
    assert alone.verdict == "consistent"
    assert both.verdict == "named" and [one.name for one in both.best.fit.mechanisms] == ["superficial-stiffness"]


def test_a_leg_without_an_effect_leaves_what_its_errors_make(library, stiff_fat):
    """Six images laid evenly within 2 mm and 3 degrees: chi-square over the readings about 1, and nothing is named."""
    places, rng = stiff_fat.channels[0].places, np.random.default_rng(2)
    points = np.array(places)[::2, :2]
    draws = [(rng.uniform(-2, 2, 2), float(rng.uniform(-3, 3))) for _ in range(6)]
    middle, count, found = points.mean(axis=0), len(points), []
    leg = Pressed.of(np.concatenate([middle + s + (points - middle) @ turn_of(t).T for s, t in draws]), {})
    for k, (_, turn) in enumerate(draws):

        def moved(depth: float, own: slice = slice(k * count, (k + 1) * count)) -> FloatArray:
            return leg.at(depth)[own]

        times, moves = tracked(points, moved, turn, rng, INSIDE.usual.slow)
        course = np.tile(np.arange(len(places)), len(times))
        observed = observed_with(pressed_thrice(leg, rng), np.repeat(times, len(places)), moves.ravel(), course, places)
        one = diagnosed(observed, library)
        rows = observed.data.spans[1]
        left, errors = one.base_model.fit.residual[rows], one.errors.covariance[rows, rows]
        found.append(float(left @ np.linalg.solve(errors, left)) / len(left))
        assert one.verdict == "consistent"
    print(found)
    assert 0.7 < np.mean(found) < 1.3


FRAMES_S = 9, 17
"""Times of the frames that are taken, at half the way and near its end."""


def test_a_plan_s_chance_of_images_is_how_often_they_show_the_effect():
    """Two frames at a plan's places of felupe's leg, in six images that lie elsewhere, and force alone."""
    fat = mechanism_named("superficial-stiffness")
    factor = prior_of(fat.parameters[0]).value_at(0.7)  # the usual strength that plans take
    ramp = Protocol.ramp(DEPTH, RATE)
    (images,) = (one for one in with_channels(ramp, SITE) if INSIDE.name in {kind.name for kind in one.channels})
    places, rng = images.channels[0].places, np.random.default_rng(3)
    points = np.array(places)[::2, :2]
    middle, count = points.mean(axis=0), len(points)
    draws = [(rng.uniform(-2, 2, 2), float(rng.uniform(-3, 3))) for _ in range(6)]
    lying = [middle + shift + (points - middle) @ turn_of(turn).T for shift, turn in draws]
    leg, told, alone, library = Pressed.of(np.concatenate(lying), {"superficial": factor}), [0, 0], None, None
    for k, (_, turn) in enumerate(draws):

        def moved(depth: float, own: slice = slice(k * count, (k + 1) * count)) -> FloatArray:
            return leg.at(depth)[own]

        trials = []
        for one in pressed_thrice(leg, rng):
            times, moves = tracked(points, moved, turn, rng, INSIDE.usual.slow)
            taken = moves[list(FRAMES_S)]
            course = np.tile(np.arange(len(places)), len(taken))
            at = np.repeat(times[list(FRAMES_S)], len(places))
            inside = RecordedChannel(INSIDE.name, at, taken.ravel(), INSIDE.usual, None, course, places)
            trials.append(replace(one, channels=(inside,)))
        observed = observe(segment_all(trials, INSTRUMENT, True))
        library = library or library_of(observed)
        for way, recorded in enumerate((replace(observed, channels=()), observed)):
            found = diagnosed(recorded, library)
            alone = alone or found
            told[way] += found.verdict == "named" and [m.name for m in found.best.fit.mechanisms] == [fat.name]
    assert alone is not None and library is not None
    base, changes = alone.weighted_base, library.nuisances
    candidates, chances = prior_candidates(base.fit, [fat]), []
    for way, test in enumerate((Design("again", (ramp,) * 3), images)):
        worth = evaluate_design(
            test,
            candidates,
            base.problem.predictor,
            lambda _, blank, readings: nuisance_effects(changes, blank, readings, ShapeAccuracy(bones=LIMBS[CALF])),
            alone.errors.noise,
            0.01,
        )
        assert worth is not None
        chance = worth.chances[fat.name, "nothing"]
        print(test.name, chance, told[way])
        # The effect's own strength and form are other than any plan's, by another code.
        assert binomtest(told[way], len(draws), float(np.clip(chance, 0.1, 0.9))).pvalue > 0.01
        chances.append(chance)
    assert chances[1] > chances[0]


def test_what_is_left_beside_an_image_s_steps_is_as_stated():
    """legfem's steps at nine points, against felupe's leg read where twenty images truly lie."""
    points = grid(np.array([20.0, 28.0, 36.0]), np.array([-12.0, 0.0, 12.0]))
    middle, rng = points.mean(axis=0), np.random.default_rng(4)
    draws = [(rng.uniform(-2, 2, 2), float(rng.uniform(-3, 3))) for _ in range(20)]
    truly = [middle + shift + (points - middle) @ turn_of(turn).T for shift, turn in draws]
    leg = Pressed.of(np.concatenate([points, *truly]), {})
    pressed = replace(plane_strain_test(SUBJECT, SETTINGS), sights=(sight(points),))
    own = pressed.solve({"deep.C10": 1e-3 * C10_KPA, "deep.C20": 0.0}, DEPTH)
    depths = np.arange(1.5, DEPTH + 0.1, 1.5)
    steps = np.array(
        [
            [own.curve.channel(laid_course(name, way), depths) for name in INSIDE.courses(2 * len(points))]
            for way in WAYS
        ]
    )
    sds = np.array([INSIDE.usual.shift / STEP_MM, INSIDE.usual.shift / STEP_MM, INSIDE.usual.turn / STEP_DEG])
    modes = sds[:, None] * steps.reshape(len(WAYS), -1)
    every = np.array([leg.at(depth) for depth in depths]).reshape(len(depths), len(draws) + 1, len(points), 2)
    squares = np.zeros(2)
    for k, (_, turn) in enumerate(draws):
        effect = (every[:, k + 1] @ turn_of(turn) - every[:, 0]).reshape(len(depths), -1).T.ravel()
        # Readings of 0.1 mm, and what is known of an image's place.
        information = modes @ modes.T / 0.1**2 + np.eye(len(modes))
        left = effect - np.linalg.solve(information, modes @ effect / 0.1**2) @ modes
        squares += np.sum(left**2), np.sum(effect**2)
    share = np.sqrt(squares[0] / squares[1])
    print(share)
    assert 0.5 * IMAGE_LEFT < share < 1.5 * IMAGE_LEFT
