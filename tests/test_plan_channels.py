"""Channels that a plan proposes: what shows in them, how images lie and what a film doesn't reach."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from making_diagnosed import BASE
from making_diagnosis import GRID, NOISE, ClosedForm
from test_channels_weighed import RAMP, Seen

from legfem.common.units import FloatArray
from legfem.geometry.indenter import Site
from legfem.inverse.channel_readings import PlannedChannel
from legfem.inverse.emulator import At
from legfem.inverse.errors import error_model
from legfem.inverse.linearised import LinearisedProblem
from legfem.inverse.map_fit import fit
from legfem.inverse.observations import Observations, blank_observations
from legfem.inverse.plan import Design, evaluate_design, prior_candidates
from legfem.inverse.predictor import Predictor
from legfem.inverse.responses import Acting
from legfem.legs.loading import load_subject
from legfem.legs.plan import with_channels
from legfem.legs.schema import SUBJECTS
from legfem.mechanisms import Stiffness, mechanism_named
from legfem.solve.protocol import Protocol


def planned_on_subject_3(what: str) -> Design:
    """The test that a plan proposes on that leg, by words of its name."""
    subject = load_subject(SUBJECTS.find("3"), need_recordings=False)
    (found,) = (t for t in with_channels(RAMP, Site(subject.section, subject.indenter)) if what in t.name)
    return found


AGAIN = Design("again", (RAMP,) * 3)


def chance_of_stiff_fat(test: Design, responses: ClosedForm) -> float:
    """The chance that a test shows a fat of another stiffness."""
    blank = blank_observations([RAMP] * 3)
    predictor = Predictor(blank, responses, "reduced-polynomial")
    readings = predictor(BASE)
    problem = LinearisedProblem(predictor, error_model(blank.with_force(readings), NOISE, readings))
    base = fit(LinearisedProblem(replace(predictor, observed=blank.with_force(readings)), problem.errors), (), BASE)
    candidates = prior_candidates(base, [mechanism_named("superficial-stiffness")])
    found = evaluate_design(test, candidates, predictor, lambda *_: [], NOISE, 0.01)
    assert found is not None
    return found.chances["superficial-stiffness", "nothing"]


@dataclass(frozen=True, eq=False)
class SeenAtPlaces(Seen):
    """Cells that move less the deeper they lie, and sensels; a stiffer fat changes each course by a share of its own.

    Parameters
    ----------
    change
        By the stiffness' logarithm, at 20 mm.
    level
        Of the courses there.
    lies
        What an image does that lies elsewhere, over that change.
    """

    change: float = 1.0
    level: float = 4.0
    lies: float = 0.0

    def channel_curves(self, names: Sequence[str], c10: float, c20: float) -> FloatArray:
        """Return courses in proportion to the displacement."""
        x = np.concatenate([[0.0], GRID]) / 20
        return np.column_stack([self._of(name) * x for name in names])

    def channel_changes(
        self, names: Sequence[str], acting: Acting, stiffness: Stiffness, observed: Observations, at: At
    ) -> FloatArray:
        """Return what a stiffer fat does."""
        x = at(np.concatenate([[0.0], self.grid])[:, None])[:, 0] / 20
        size = self.change * np.log(acting[1].get("factor", 1.0))
        return np.column_stack([0.0 * x if _lies(name) else _sign(name) * size * x for name in names])

    def _of(self, name: str) -> float:
        return self.lies * self.change * _sign(name) if _lies(name) else self.level


def _sign(course: str) -> float:
    return (-1.0) ** int(course.split(":")[1])


def _lies(course: str) -> bool:
    """Whether it is what an image does that lies elsewhere."""
    return course.count(":") == 2


def test_a_plan_weighs_images_of_the_section_with_how_they_lie() -> None:
    """What moves by a millimetre shows in two frames; where a step aside does much the same, it doesn't."""
    images = planned_on_subject_3("track how the tissue moves")
    (planned,) = images.channels
    assert planned.at == (10.0, 20.0) and images.effort and len(planned.places) >= 16
    seen, lying = (chance_of_stiff_fat(images, SeenAtPlaces(lies=lies)) for lies in (0.0, 1.0))
    again = chance_of_stiff_fat(AGAIN, SeenAtPlaces())
    print(seen, lying, again)
    assert seen > again + 0.2 and lying < again + 0.5 * (seen - again)


def test_what_a_film_would_not_reach_its_threshold_with_tells_nothing() -> None:
    film = planned_on_subject_3("pressure film")
    unseen, seen = (chance_of_stiff_fat(film, SeenAtPlaces(change=0.6, level=level)) for level in (0.2, 4.0))
    again = chance_of_stiff_fat(AGAIN, SeenAtPlaces())
    print(unseen, seen, again)
    assert unseen == pytest.approx(again, abs=1e-6) and seen > again + 0.2


def test_a_plan_ranks_the_channel_that_shows_the_effect() -> None:
    """Of a fat that hardly shows in the force, frames of its thickness distinguish; a lateral force doesn't."""

    def chance(test: Design) -> float:
        return chance_of_stiff_fat(test, Seen())

    lateral, frames = planned_on_subject_3("lateral force too"), planned_on_subject_3("ultrasound frame")
    assert lateral.effort and frames.effort
    assert {one.at for one in frames.channels} == {(10.0, 20.0)}
    assert chance(frames) > chance(AGAIN) + 0.2
    assert chance(lateral) == pytest.approx(chance(AGAIN), abs=0.1)


def test_planned_frames_are_read_at_their_displacement() -> None:
    """Frames of a planned test stand where they are taken, in every trial; a record all along has all phases."""
    cycle = Protocol.cycle(20.0, 0.4, 60.0)
    frames = blank_observations([cycle] * 2, [PlannedChannel("fat_thickness", (10.0, 20.0))])
    (one,) = frames.channels
    np.testing.assert_allclose(one.weights @ frames.displacement, [10.0, 20.0] * 2, atol=1e-9)
    assert set(frames.phase[one.nearest]) == {"loading"} and list(frames.trial[one.nearest]) == [0, 0, 1, 1]
    (whole,) = blank_observations([cycle], [PlannedChannel("fat_thickness")]).channels
    assert len(whole.values) == 12 + 4 + 6
    np.testing.assert_allclose(whole.weights.sum(axis=1), 1.0)
