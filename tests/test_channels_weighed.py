"""Channels beside the force in a diagnosis: their readings, predictions, errors, and what they name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from making_diagnosed import BASE, diagnosed_of
from making_diagnosis import GRID, INSTRUMENT, NOISE, ClosedForm, force_at, mechanisms_in, ramps, two_rates
from making_limbs import MUSCLES, two_muscles, write_limb

from legfem.channels.kinds import CHANNELS, FILE_OF
from legfem.common.units import FloatArray
from legfem.data import Recording, segment_all
from legfem.data.recording import RecordedChannel
from legfem.geometry.indenter import Site
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.channel_readings import PlannedChannel
from legfem.inverse.emulator import At
from legfem.inverse.errors import error_model
from legfem.inverse.evidence import possible_discrepancies
from legfem.inverse.linearised import LinearisedProblem
from legfem.inverse.map_fit import fit
from legfem.inverse.observations import Observations, blank_observations, observe
from legfem.inverse.predictor import Predictor
from legfem.inverse.responses import Acting
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.mechanisms import Stiffness, mechanism_named
from legfem.mechanisms.muscle import NamedMuscle
from legfem.report.curves import Curves
from legfem.report.further_channels import (
    channel_arrows,
    channel_chapter,
    channel_misfits,
    channel_sentences,
    misfit_in_section,
)
from legfem.solve.protocol import Protocol

FAT_MM, MUSCLE_MM = 10.0, 30.0
RAMP = Protocol.ramp(20.0, 0.4)
BOTH = ("fat_thickness", "lateral_force")


def course_of(name: str, c10: float, c20: float, pressed: FloatArray) -> FloatArray:
    """Return channels in closed form: softer muscle leaves the fat thicker, and a twentieth of the force is lateral."""
    x = np.maximum(pressed, 0.0) / 20
    squeezed = 6.0 * x * c10 / (c10 + 0.5e-3)
    if name == "lateral_force":
        return np.asarray(0.05 * force_at(c10, c20, pressed))
    return np.asarray(FAT_MM - squeezed if name == "fat_thickness" else MUSCLE_MM - 16.0 * x + squeezed)


@dataclass(frozen=True, eq=False)
class Seen(ClosedForm):
    """The closed form, whose channels are seen, too."""

    def relative_change(self, acting: Acting, at: Stiffness, observed: Observations) -> FloatArray:
        """Return what shows in the force: of a stiffer fat hardly anything."""
        share = 0.1 if acting[0].name == "superficial-stiffness" else 1.0
        return share * super().relative_change(acting, at, observed)

    def channel_curves(self, names: Sequence[str], c10: float, c20: float) -> FloatArray:
        """Return courses at zero and at the grid."""
        at = np.concatenate([[0.0], GRID])
        return np.column_stack([course_of(name, c10, c20, at) for name in names])

    def channel_changes(
        self, names: Sequence[str], acting: Acting, stiffness: Stiffness, observed: Observations, at: At
    ) -> FloatArray:
        """Return a stiffer fat's thickness: it keeps more of it; of a tilted indenter, a lateral force."""
        mechanism, values = acting
        x = at(np.concatenate([[0.0], self.grid])[:, None])[:, 0] / 20
        changes = {
            ("superficial-stiffness", "fat_thickness"): 2.0 * np.log(values.get("factor", 1.0)) * x,
            ("superficial-stiffness", "muscle_thickness"): -2.0 * np.log(values.get("factor", 1.0)) * x,
            ("indenter-tilt", "lateral_force"): 0.15 * values.get("angle", 0.0) * x,
        }
        return np.column_stack([changes.get((mechanism.name, name), 0.0 * x) for name in names])


def seen(recordings: Sequence[Recording], names: Sequence[str] = BOTH, frames: Sequence[float] = ()) -> Observations:
    """Return observations of nothing with channels: dense records, or frames at times (s)."""
    given = []
    for one in recordings:
        time = np.array(frames) if len(frames) else one.time[::5]
        read = [RecordedChannel(name, time, np.zeros(len(time)), CHANNELS[name].usual) for name in names]
        given.append(replace(one, channels=tuple(read)))
    observed = observe(segment_all(given, INSTRUMENT, True))
    white = np.full(len(observed.force), NOISE.white_sd**2 / 8)
    return replace(observed, white_sd=NOISE.white_sd, white_variance=white)


def recorded(observed: Observations, effects: Mapping[str, float], seed: int = 2) -> Observations:
    """Return observations with effects and drawn errors."""
    predictor = Predictor(observed, Seen(), "reduced-polynomial")
    readings = predictor({**BASE, **effects}, mechanisms_in(effects))
    errors = error_model(observed.with_values(readings), NOISE, readings)
    return observed.with_values(readings + errors.draw(1, np.random.default_rng(seed))[0])


def test_channels_show_what_drains_in_one_loading_and_not_what_relaxes() -> None:
    """Fluid that leaves takes its volume along, which the skin's shape and thicknesses show at one rate, too."""
    alone, beside = seen(ramps(), ()), seen(ramps())
    drains, relaxes = mechanism_named("poroelastic-drainage"), mechanism_named("viscoelasticity")
    assert "one loading ramp" in (drains.untestable(alone) or "") and drains.untestable(beside) is None
    assert relaxes.untestable(alone) == relaxes.untestable(beside) == drains.untestable(alone)


def test_readings_take_means_of_the_course_at_stations() -> None:
    """A channel that is linear in displacement is read exactly: dense, and as frames of an image."""
    for frames, count in (((), 36), ((12.5, 37.5), 6)):
        blank = seen(ramps(), ["fat_thickness"], frames)
        (one,) = blank.channels
        assert len(one.values) == count
        np.testing.assert_allclose(one.weights.sum(axis=1), 1.0)
        assert one.accuracy.reading == CHANNELS["fat_thickness"].usual.reading
        at = blank.data.channels[1].station
        if frames:
            np.testing.assert_allclose(at, np.tile([5.0, 15.0], 3), atol=0.02)
        np.testing.assert_allclose(one.weights @ (10 - 0.3 * blank.displacement), 10 - 0.3 * at)
    few, many = seen(ramps(), ["fat_thickness"], (25.0,)), seen(ramps(), ["fat_thickness"])
    assert few.channels[0].white_variance[0] > 5 * many.channels[0].white_variance[0], "a mean of samples is no better"


def test_readings_follow_holds_and_unloading() -> None:
    """Readings of every phase stand at stations of that phase, of their own trial."""
    blank = seen(two_rates(1), ["muscle_thickness"])
    (one,) = blank.channels
    assert set(blank.phase[one.nearest]) == {"loading", "hold", "unloading"}
    for row, nearest in zip(one.weights, one.nearest, strict=True):
        taken = np.flatnonzero(row)
        assert set(blank.trial[taken]) == {blank.trial[nearest]} and set(blank.segment[taken]) == {
            blank.segment[nearest]
        }


def test_channels_are_read_where_the_tissue_is_pressed_to() -> None:
    """Beside a support that gives way and a late contact, thickness and lateral force are those at what is left."""
    blank = seen(ramps(1))
    predict = Predictor(blank, Seen(), "reduced-polynomial")
    values = {**BASE, "support-compliance.compliance": 0.15, "trial1.onset": 0.4}
    found = predict(values, [mechanism_named("support-compliance")])
    force = found[blank.data.spans[0]]
    pressed = blank.displacement - 0.4 - 0.15 * force
    clear = pressed > blank.half_width
    assert (~clear).sum() <= 2, "lines across first touch: tests/test_touch.py"
    np.testing.assert_allclose(force[clear], force_at(1e-3, 0.6e-3, pressed)[clear], atol=1e-5)
    for one, span in zip(blank.channels, blank.data.spans[1:], strict=True):
        exact = one.weights @ course_of(one.name, 1e-3, 0.6e-3, pressed)
        np.testing.assert_allclose(found[span], exact, atol=1e-3)


def test_a_stiffer_muscle_squeezes_the_fat_more() -> None:
    """What tenses the muscle acts on all channels through their elastic courses."""
    blank = seen(ramps(1))
    predict = Predictor(blank, Seen(), "reduced-polynomial")
    effect = {"muscle-contraction.stiffening": 0.5, "muscle-contraction.onset": 0.3, "muscle-contraction.rise": 0.3}
    effect["muscle-contraction.away"] = 2.0
    tense = mechanism_named("muscle-contraction")
    found = predict({**BASE, **effect}, [tense])
    factor = tense.deep_factor({name.split(".")[1]: value for name, value in effect.items()}, blank)
    for one, span in zip(blank.channels, blank.data.spans[1:], strict=True):
        courses = [
            course_of(one.name, 1e-3 * f, 0.6e-3 * f, np.array([d]))
            for f, d in zip(factor, blank.displacement, strict=True)
        ]
        np.testing.assert_allclose(found[span], one.weights @ np.concatenate(courses), rtol=2e-3)


def test_factors_on_the_force_leave_thickness_alone() -> None:
    """Fibres that bend at the cylinder's ends multiply every force on it, and no length."""
    blank = seen(ramps(1))
    predict = Predictor(blank, Seen(), "reduced-polynomial")
    fibres = mechanism_named("muscle-fibres")
    values = {**BASE, "muscle-fibres.ratio": 3.0, "muscle-fibres.size": 0.0, "muscle-fibres.course": 0.0}
    before, after = predict(BASE), predict(values, [fibres])
    force, fat, lateral = blank.data.spans
    ratio = after[force] / before[force]
    assert ratio.min() > 1.01
    np.testing.assert_allclose(after[fat], before[fat])
    weights = blank.channels[1].weights
    np.testing.assert_allclose(
        after[lateral], weights @ (ratio * course_of("lateral_force", 1e-3, 0.6e-3, blank.displacement)), rtol=1e-5
    )


def test_errors_are_of_each_channel_by_itself() -> None:
    """The load cell's gain and zero aren't the image's; a boundary is off in all frames, a lag by the rate."""
    blank = seen(two_rates(1), ["fat_thickness"])
    readings = Predictor(blank, Seen(), "reduced-polynomial")(BASE)
    errors = error_model(blank.with_values(readings), NOISE, readings)
    force, fat = blank.data.spans
    (one,) = blank.channels
    assert not errors.gains[fat].any() and not errors.zeros[fat].any()
    assert not errors.dense[force, fat].any()
    shared = dict(zip(errors.names, errors.known.T, strict=True))
    np.testing.assert_allclose(shared["fat thickness: boundary"][fat], one.accuracy.bias)
    assert not shared["fat thickness: boundary"][force].any() and not shared["load cell's gain"][fat].any()
    # Of the slow and the fast ramp, the lag shows in proportion to the rate.
    exact = replace(one, accuracy=replace(one.accuracy, slow=0.0), white_variance=np.zeros(len(one.values)))
    without = replace(exact, accuracy=replace(exact.accuracy, lag=0.0))
    lag = [np.diag(error_model(replace(blank, channels=(c,)), NOISE, readings).dense)[fat] for c in (exact, without)]
    more, loading = lag[0] - lag[1], blank.phase[one.nearest] == "loading"
    trial = blank.trial[one.nearest]
    slow, fast = (np.sqrt(more[loading & (trial == k)]).mean() for k in (0, 1))
    assert fast / slow == pytest.approx(5.0, rel=0.05)
    assert slow == pytest.approx(one.accuracy.lag * 0.4 * 0.2, rel=0.05)
    assert not more[blank.phase[one.nearest] == "hold"].any()


def test_an_unknown_error_is_in_all_channels_or_in_some() -> None:
    """Discrepancies are independent between channels, and a third of them leaves the force as it is."""
    blank = seen(ramps(1))
    readings = Predictor(blank, Seen(), "reduced-polynomial")(BASE)
    found = possible_discrepancies(blank, readings)
    force, fat, lateral = blank.data.spans
    assert sum(np.exp(u.log_prior) for u in found[1:]) == pytest.approx(1.0)
    for unknown in found[1:]:
        assert unknown.covariance is not None
        sizes = [float(np.abs(unknown.covariance[span, span]).max()) > 0 for span in (force, fat, lateral)]
        assert sizes == [size > 0 for size in unknown.by_channel]
        assert not unknown.covariance[force, fat].any() and not unknown.covariance[fat, lateral].any()
    assert {tuple(size > 0 for size in u.by_channel) for u in found[1:]} == {
        (True, True, True),
        (True, False, False),
        (False, True, True),
    }
    with_force_alone = possible_discrepancies(replace(blank, channels=()), readings[force])
    assert len(found) - 1 == 3 * (len(with_force_alone) - 1)


def test_derivatives_are_differences_of_predictions() -> None:
    """About a fit the sensitivities of every channel are those by central differences."""
    observed = recorded(seen(ramps()), {})
    predict = Predictor(observed, Seen(), "reduced-polynomial")
    problem = LinearisedProblem(predict, error_model(observed, NOISE, observed.values))
    found = fit(problem, (), {DEEP_C10: 0.0008, DEEP_C20: 0.0004})
    k, step = found.free.index(DEEP_C10), 1e-4
    ends = [found.moved(found.prior_z + side * step * np.eye(len(found.free))[k]) for side in (1, -1)]
    exact = (predict(ends[0]) - predict(ends[1])) / (2 * step)
    np.testing.assert_allclose(found.sensitivities[:, k], exact, rtol=0.01, atol=0.01 * np.abs(exact).max())
    for span in observed.data.spans:
        assert np.abs(exact[span]).max() > 0.1


def test_what_force_alone_calls_consistent_thickness_names() -> None:
    """Fat that is 1.6 times as stiff changes the force by less than its errors, and its own thickness by 0.9 mm."""
    asked = ("superficial-stiffness", "compressibility", "force-drift")
    both = recorded(seen(ramps()), {"superficial-stiffness.factor": 1.6})
    alone = diagnosed_of(replace(both, channels=()), asked, library=Seen())
    weighed = diagnosed_of(both, asked, library=Seen())
    assert alone.verdict == "consistent"
    assert weighed.verdict == "named" and weighed.models[0].names == ("superficial-stiffness",)
    low, high = weighed.models[0].interval("superficial-stiffness.factor")
    assert low < 1.6 < high
    assert {window.channel for window in weighed.assessment.windows} == {"fat_thickness"}


def test_what_no_mechanism_does_to_a_thickness_stays_unexplained() -> None:
    """A fat that thins by a step that no mechanism knows is something unknown, though the force fits."""
    both = recorded(seen(ramps()), {})
    fat = both.data.spans[1]
    values = both.values.copy()
    values[fat] -= 2.0 * (both.data.channels[1].station > 12)
    found = diagnosed_of(both.with_values(values), ("indenter-tilt", "compressibility", "force-drift"), library=Seen())
    assert found.verdict == "unexplained"
    alone = diagnosed_of(
        replace(both, channels=()), ("indenter-tilt", "compressibility", "force-drift"), library=Seen()
    )
    assert alone.verdict == "consistent"


def test_a_clean_leg_is_consistent_in_every_channel() -> None:
    """Errors as assumed name nothing and are located nowhere; C10 isn't less well known than by force alone."""
    both = recorded(seen(ramps()), {}, seed=4)
    asked = ("superficial-stiffness", "indenter-tilt", "force-drift")
    found, alone = (diagnosed_of(one, asked, library=Seen()) for one in (both, replace(both, channels=())))
    assert found.verdict == "consistent" and not found.assessment.windows
    low, high = found.intervals[DEEP_C10]
    assert low < BASE[DEEP_C10] < high
    assert found.base_model.fit.sd(DEEP_C10) < alone.base_model.fit.sd(DEEP_C10)


def test_the_page_says_which_channel_departs_and_where() -> None:
    """A chapter on what stands beside the force, with its sentence, table and curves; none with force alone."""
    asked = ("superficial-stiffness", "compressibility", "force-drift")
    both = recorded(seen(ramps()), {"superficial-stiffness.factor": 1.6})
    found = diagnosed_of(both, asked, library=Seen())
    assert any(line.startswith("The thickness of the fat under the cylinder") for line in channel_sentences(found))
    misfits = {one.name: one for one in channel_misfits(found)}
    assert list(misfits) == ["force", "fat_thickness", "lateral_force"]
    fat = misfits["fat_thickness"]
    assert fat.rms_after is not None and fat.rms_after < fat.rms_before
    (chapter,) = channel_chapter(found)
    curves = [block for block in chapter.blocks if isinstance(block, Curves)]
    assert [one.name for one in curves] == ["channel0-fat_thickness", "channel0-lateral_force"]
    assert len(curves[0].x) == 12 and (np.diff(curves[0].x) > 0).all()
    assert not channel_chapter(diagnosed_of(replace(both, channels=()), asked, library=Seen()))


def test_the_section_is_marked_where_channels_depart() -> None:
    """A fat that is stiffer is marked within the fat, and the skin's points on the skin."""
    subject = load_subject(SUBJECTS.find("3"), need_recordings=False)
    both = recorded(seen(ramps()), {"superficial-stiffness.factor": 1.6})
    found = diagnosed_of(both, ("superficial-stiffness", "force-drift"), library=Seen())
    (drawn,) = misfit_in_section(found, subject)
    (mark,) = drawn.marks
    at = shapely.Point(mark.x, -mark.y)
    section = subject.section

    def seen_at(name: str) -> shapely.Point:
        return shapely.Point(FILE_OF[name].place(CHANNELS[name], Site(section, subject.indenter)))

    assert mark.name == "departs: fat thickness"
    assert section.polygon("skin").contains(at) and not section.polygon("fascia").contains(at)
    assert section.polygon("fascia").contains(seen_at("muscle_thickness"))
    for side in ("left", "right"):
        skin = seen_at(f"skin_rise_{side}_25")
        assert section.polygon("skin").exterior.distance(skin) < 1e-6
        away = skin.distance(seen_at("lateral_force"))
        assert away > 24.9
    assert not misfit_in_section(diagnosed_of(replace(both, channels=()), ("force-drift",), library=Seen()), subject)


def test_the_section_is_marked_where_the_muscle_lies_that_is_named(tmp_path: Path):
    folder = write_limb(tmp_path / "leg", two_muscles(), MUSCLES)
    subject = load_subject(folder, need_recordings=False)
    found = diagnosed_of(recorded(seen(ramps()), {}), ("force-drift",), library=Seen())
    fitted = SimpleNamespace(mechanisms=[NamedMuscle.called("soleus")], values={"soleus-stiffness.factor": 2.0})
    found = replace(found, models=(SimpleNamespace(fit=fitted),))
    (mark,) = misfit_in_section(found, subject)[0].marks
    assert mark.name == "named: soleus stiffness"
    muscle = subject.section.polygon("soleus")
    assert muscle.contains(shapely.Point(mark.x, -mark.y))
    assert np.pi * mark.radius**2 == pytest.approx(muscle.area)


def test_what_is_left_at_places_is_drawn_as_arrows() -> None:
    """Both parts of a displacement make one arrow at its point, of deep readings alone; a pressure presses inwards."""
    subject = load_subject(SUBJECTS.find("3"), need_recordings=False)
    site = Site(subject.section, subject.indenter)
    at = [tuple(site.deepest + depth * site.direction) for depth in (6.0, 12.0)]
    places = tuple((float(x), float(y), way) for x, y in at for way in (0.0, 1.0))
    planned = (
        PlannedChannel("section_displacement", places=places),
        PlannedChannel("contact_pressure", places=((0, 6),)),
    )
    moves, pressure = blank_observations([Protocol.ramp(20.0, 0.4)], planned).channels
    deep = moves.displacement > 0.7 * moves.displacement.max()
    near, far = channel_arrows(moves, np.where(deep, np.choose(moves.course, (0.3, -0.4, 0.0, 0.1)), 9.0), site)
    assert (near.x, -near.y) == pytest.approx(at[0]) and (far.x, -far.y) == pytest.approx(at[1])
    assert near.name.endswith("0.5 mm at most")
    assert np.array([near.dx, near.dy]) == pytest.approx(14.0 * np.array([0.6, 0.8]))
    assert np.hypot(far.dx, far.dy) == pytest.approx(0.2 * 14.0) and far.dx == 0.0
    (pressed,) = channel_arrows(pressure, np.ones(len(pressure.values)), site)
    away = np.array([pressed.x, -pressed.y]) - site.touch
    assert np.linalg.norm(away) == pytest.approx(site.indenter.radius)
    assert np.array([pressed.dx, -pressed.dy]) == pytest.approx(14.0 * away / np.linalg.norm(away))


def test_repeats_that_differ_by_more_than_stated_widen_their_channels_errors() -> None:
    """Thrice the stated errors are found from three trials; as stated they stay, and so do other channels'."""
    blank = seen(ramps())
    readings = Predictor(blank, Seen(), "reduced-polynomial")(BASE)
    stated = error_model(blank.with_values(readings), NOISE, readings)
    generator = np.random.default_rng(5)
    drawn = [stated.draw(1, generator)[0] for _ in range(20)]
    _, fat, lateral = blank.data.spans
    factors: dict[float, list[float]] = {1.0: [], 3.0: []}
    for times, found in factors.items():
        for one in drawn:
            values = readings + one
            # Errors that all trials share are in no difference between them.
            values[fat] = readings[fat] + times * (one - stated.known @ np.linalg.lstsq(stated.known, one)[0])[fat]
            errors = error_model(blank.with_values(values), NOISE, readings)
            found.append(float(errors.trial_sd[fat].mean() / stated.trial_sd[fat].mean()))
            np.testing.assert_array_less(errors.trial_sd[lateral], 1.8 * stated.trial_sd[lateral])
    assert np.mean(factors[1.0]) < 1.15
    assert np.mean(factors[3.0]) == pytest.approx(3.0, rel=0.15)
