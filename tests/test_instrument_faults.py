"""Faults of an instrument are told by what they do to C10, and sound recordings are not doubted."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from making import CROSSCHECK
from scipy.optimize import least_squares
from scipy.signal import lfilter

import legfem as lf
from legfem.common.resources import RESOURCES
from legfem.data import Instrument, Recording, mean_loading_curve, segment
from legfem.data.instrument_faults import instrument_doubts, presses_of, steps_of
from legfem.data.loading_curve import segment_all
from legfem.data.segmentation import Segmentation
from legfem.inverse.accuracy import Accuracy
from legfem.inverse.linearised import of_recording
from legfem.inverse.observations import observe
from legfem.legs.loading import load_subject
from legfem.legs.plausibility import doubts_about

DEPTH, SPEED, RATE = 22.0, 0.5, 10.0
type Trials = list[tuple[np.ndarray, np.ndarray, np.ndarray]]


def shown(depth: np.ndarray, C10: float = 1.0, C20: float = 1.0) -> np.ndarray:
    """A leg's force (N) of a closed form that isn't the one by which effects on C10 are told."""
    x = np.maximum(depth, 0.0)
    fat = 0.05 * x
    return fat + C10 * 0.17 * x**1.15 + C20 * 0.035 * x * (np.exp((x / 12.0) ** 1.3) - 1.0)


def red(rng: np.random.Generator, count: int, length: float) -> np.ndarray:
    """Noise of one standard deviation that is correlated over a number of samples."""
    kept = np.exp(-1.0 / length)
    return lfilter([np.sqrt(1 - kept**2)], [1, -kept], rng.standard_normal(count + int(5 * length)))[-count:]


def relaxing(force: np.ndarray, share: float, over: float) -> np.ndarray:
    """The force of a tissue of which a share relaxes over some time, s."""
    kept = np.exp(-1.0 / (RATE * over))
    return (1 - share) * force + share * lfilter([1.0], [1, -kept], np.diff(force, prepend=force[0]))


@cache
def closed_form(hold: float) -> Trials:
    """Three presses with holds and unloading, whose tissue relaxes."""
    trials = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        ends = np.cumsum([0.0, DEPTH / SPEED, hold, DEPTH / SPEED])
        time = np.arange(0.0, ends[-1], 1 / RATE)
        d = np.interp(time, ends, [0.0, DEPTH, DEPTH, 0.0])
        force = np.maximum(relaxing(shown(d), 0.25 if hold else 0.0, 4.0), 0.0)
        force = (1 + 0.01 * rng.standard_normal()) * force + 0.04 * rng.standard_normal(len(d))
        trials.append((time, d + 0.03 * rng.standard_normal(len(d)), force + 0.03 * red(rng, len(d), 60.0)))
    return trials


@cache
def subject_of(folder: Path) -> tuple[Trials, Instrument, bool]:
    """A leg's own recordings, its instrument, and whether they are stated to begin at first contact."""
    subject = load_subject(folder)
    trials = [(one.time, one.displacement, one.force) for one in subject.recordings]
    return trials, subject.instrument, subject.starts_at_contact


LEGS: dict[str, Callable[[], tuple[Trials, Instrument, bool]]] = {
    "shipped": lambda: subject_of(RESOURCES / "frauziols" / "subjects" / "1"),
    "closed form, held": lambda: (closed_form(30.0), Instrument(0.05, 0.03), True),
    "another code, loaded alone": lambda: subject_of(CROSSCHECK / "neo-hookean"),
}


def told(trials: Trials, instrument: Instrument, known: bool) -> list[str]:
    """Kinds of the faults that are told, the worst first."""
    read = segment_all([Recording(*one, f"trial{k + 1}") for k, one in enumerate(trials)], instrument, known)
    return [one.kind for one in instrument_doubts(read)]


def of_force(change: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]) -> Callable[[Trials], Trials]:
    return lambda trials: [(t, d, change(t, d, f)) for t, d, f in trials]


def calm(values: np.ndarray, count: int = 15) -> np.ndarray:
    return np.convolve(np.pad(values, count // 2, "edge"), np.ones(count) / count, "valid")


def zero(size: float) -> Callable[[Trials], Trials]:
    return of_force(lambda t, d, f: f + size)


def drift(size: float) -> Callable[[Trials], Trials]:
    return of_force(lambda t, d, f: f + size * t / t[-1])


def dead_band(size: float) -> Callable[[Trials], Trials]:
    return of_force(lambda t, d, f: np.sign(f) * np.maximum(np.abs(f) - size, 0.0))


def begun(way: float) -> Callable[[Trials], Trials]:
    """The recording begins and ends when the leg is already pressed."""

    def change(trials: Trials) -> Trials:
        kept = [np.flatnonzero(calm(d) >= way) for _, d, _ in trials]
        parts = [slice(k[0], k[-1] + 1) for k in kept]
        return [(t[p] - t[p][0], d[p] - way, f[p]) for (t, d, f), p in zip(trials, parts, strict=True)]

    return change


def lag(seconds: float) -> Callable[[Trials], Trials]:
    return of_force(lambda t, d, f: np.interp(t - seconds, t, f) + (t < seconds) * (f - f[0]))


def low_pass(seconds: float) -> Callable[[Trials], Trials]:
    def change(t: np.ndarray, d: np.ndarray, f: np.ndarray) -> np.ndarray:
        share = (t[1] - t[0]) / seconds
        smooth = calm(f)
        return f - smooth + smooth[0] + lfilter([share], [1, share - 1], smooth - smooth[0])

    return of_force(change)


def play(way: float) -> Callable[[Trials], Trials]:
    """The drive goes some way before the cylinder does, at the start and after each turn."""

    def change(t: np.ndarray, d: np.ndarray, f: np.ndarray) -> np.ndarray:
        drive, force = calm(d), calm(f)
        cylinder = np.empty_like(drive)
        cylinder[0] = drive[0] - way
        for k in range(1, len(drive)):
            cylinder[k] = min(max(cylinder[k - 1], drive[k] - way), drive[k])
        top = int(np.argmax(drive))
        fell = force / np.maximum(np.interp(drive, drive[: top + 1], force[: top + 1]), 1e-2)
        there = np.interp(cylinder, np.maximum.accumulate(drive[: top + 1]), force[: top + 1])
        return f - force + there * np.where(np.arange(len(d)) > top, np.minimum(fell, 1.0), 1.0)

    return of_force(change)


def step(size: float) -> Callable[[Trials], Trials]:
    return of_force(lambda t, d, f: f + size * (t >= t[int(np.argmax(calm(d) > 0.4 * d.max()))]))


def steps(*sizes: float) -> Callable[[Trials], Trials]:
    """Each trial's zero jumps by another size."""
    return lambda trials: [step(size)([one])[0] for one, size in zip(trials, sizes, strict=True)]


def jump(way: float) -> Callable[[Trials], Trials]:
    """A counter loses its way half way down, and the force goes on."""
    return lambda trials: [(t, d + way * (t >= t[int(np.argmax(calm(d) > 0.55 * d.max()))]), f) for t, d, f in trials]


def air(way: float) -> Callable[[Trials], Trials]:
    """The drive goes some way before it touches, though first contact is stated to be where it starts."""

    def change(trials: Trials) -> Trials:
        begun = []
        for seed, (t, d, f) in enumerate(trials):
            rng, step = np.random.default_rng(seed), float(np.median(np.diff(t)))
            n = int(way / float(np.polyfit(t[: len(t) // 4], d[: len(t) // 4], 1)[0]) / step)
            there = np.linspace(0.0, way, n, endpoint=False) + 0.05 * rng.standard_normal(n)
            nothing = f[0] * 0.0 + float(np.std(f[:20] - calm(f)[:20])) * rng.standard_normal(n)
            time = np.concatenate([step * np.arange(n), step * n + t])
            begun.append((time, np.concatenate([there, d + way]), np.concatenate([nothing, f])))
        return begun

    return change


def slip(way: float) -> Callable[[Trials], Trials]:
    """Half way down the tissue loses some of the way that is pressed."""

    def change(t: np.ndarray, d: np.ndarray, f: np.ndarray) -> np.ndarray:
        drive, force = np.maximum.accumulate(calm(d)), calm(f)
        top, first = int(np.argmax(drive)), int(np.argmax(drive > 0.5 * d.max()))
        lost = np.interp(drive[: top + 1] - way, drive[: top + 1], force[: top + 1]) / force[: top + 1]
        share = np.where(np.arange(len(d)) < first, 1.0, np.append(lost, np.full(len(d) - top - 1, lost[-1])))
        return f - force + share * force

    return of_force(change)


def gains(*factors: float) -> Callable[[Trials], Trials]:
    return lambda trials: [(t, d, f * factor) for (t, d, f), factor in zip(trials, factors, strict=True)]


LOOSE = ("shipped", "closed form, held")
"""Legs whose drive turns, and whose displacement is stated to count from first contact."""
SPOILT = {
    "a zero too low": ([zero(-0.6), zero(-1.4)], "a zero or preload", LEGS),
    "a zero too high": ([zero(0.6), zero(1.4)], "a zero or preload", LEGS),
    "a drift downwards": ([drift(-1.4), drift(-3.0)], "a drift", LOOSE),
    "a drift upwards": ([drift(1.4), drift(3.0)], "a drift", LOOSE),
    "a dead band": ([dead_band(0.5), dead_band(1.1)], "a dead band", LEGS),
    "a press that had begun": ([begun(3.0), begun(5.5)], "a zero or preload", LEGS),
    "a lag": ([lag(1.3), lag(3.0)], "a lag or play", LOOSE),
    "a filter": ([low_pass(2.0), low_pass(4.0)], "a lag or play", LOOSE),
    "play": ([play(1.0), play(2.2)], "a lag or play", LOOSE),
    "a zero that jumps": ([step(-0.7), step(1.6)], "a step", LEGS),
    "zeros that jump by other signs": ([steps(-1.2, 1.3, 0.0), steps(0.0, 0.0, -2.5)], "a step", LEGS),
    "a counter that jumps": ([jump(-1.5), jump(2.0)], "a jump", LEGS),
    "air before a stated touch": ([air(3.5), air(6.0)], "a late touch", ("closed form, held",)),
    "a slip": ([slip(1.5), slip(3.0)], "a step", LEGS),
    "a trial of another gain": ([gains(1, 1.3, 1), gains(0.6, 1, 1)], "trials that differ", LEGS),
    "trials that soften": ([gains(1, 0.9, 0.82), gains(1, 0.75, 0.6)], "trials that soften", LEGS),
}


@pytest.mark.parametrize("leg", LEGS)
def test_a_sound_leg_is_not_doubted(leg: str) -> None:
    assert told(*LEGS[leg]()) == []


@pytest.mark.parametrize(("spoilt", "leg"), [(name, leg) for name, one in SPOILT.items() for leg in one[2]])
def test_what_spoils_a_recording_is_told_first(spoilt: str, leg: str) -> None:
    trials, instrument, known = LEGS[leg]()
    changes, kind, _ = SPOILT[spoilt]
    for change in changes:
        assert told(change(trials), instrument, known)[:1] == [kind]


def read(leg: str, change: Callable[[Trials], Trials]) -> list[Segmentation]:
    trials, instrument, known = LEGS[leg]()
    recordings = [Recording(*one, f"trial{k + 1}") for k, one in enumerate(change(trials))]
    return segment_all(recordings, instrument, known)


@pytest.mark.parametrize("leg", LEGS)
def test_a_step_has_a_place_and_a_size_and_what_is_sound_has_none(leg: str) -> None:
    assert steps_of(read(leg, lambda trials: trials)) == {}
    assert steps_of(read(leg, zero(-1.4))) == {}
    spoilt = read(leg, step(-0.9))
    found = steps_of(spoilt)
    assert list(found) == [one.name for one in spoilt]
    for one in spoilt:
        place, size = found[one.name]
        at = 0.4 * float(one.smooth.max()) - one.contact.displacement
        assert place == pytest.approx(at, abs=0.03 * one.depth) and size == pytest.approx(-0.9, abs=0.3)
    (name,) = steps_of(read(leg, steps(0.0, 0.0, -2.5)))
    assert name == spoilt[2].name


def test_a_step_that_is_doubted_is_an_error_of_what_follows_it() -> None:
    trials = read("closed form, held", step(-0.9))
    observed = observe(trials)
    places = [observed.steps[name][0] for name in observed.trials]
    found = {one.name: one.effect for one in of_recording(observed, Accuracy(contact_sd=0.0))}
    assert len(found) == 3 * len(trials)
    for k, (name, place) in enumerate(zip(observed.trials, places, strict=True)):
        effect, mine = found[f"step of the force in {name}"], observed.trial == k
        before = mine & (observed.phase == "loading") & (observed.displacement <= place)
        assert not effect[~mine].any() and not effect[before].any()
        # In the hold and on the way back, too.
        assert (effect[mine & ~before] == observed.steps[name][1]).all()
        for beside in ("reading before the step", "reading after the step"):
            assert np.count_nonzero(found[f"{beside} in {name}"]) == 1
    assert not [*of_recording(observe(read("closed form, held", lambda t: t)), Accuracy(contact_sd=0.0))]
    deeper = replace(observed, steps={observed.trials[1]: (2.0 * DEPTH, -0.9)})
    assert not any(one.effect.any() for one in of_recording(deeper, Accuracy(contact_sd=0.0)))


@pytest.mark.slow
def test_a_step_is_taken_for_no_effect_of_the_leg_and_c10_stays(tmp_path: Path) -> None:
    spoilt_folder(tmp_path, step(-0.9))
    found = lf.diagnose(tmp_path)
    sound = lf.identify("1", law="reduced-polynomial", mesh="coarse")["reduced-polynomial"].estimates["deep.C10"]
    low, high = found.diagnosis.shown_interval("deep.C10")
    assert found.diagnosis.verdict == "consistent" and low < 1e3 * sound.value < high
    assert 1e3 * found.diagnosis.base.estimates["deep.C10"].value == pytest.approx(1e3 * sound.value, rel=0.1)


@pytest.mark.parametrize("leg", LEGS)
def test_what_moves_c10_by_a_few_per_cent_is_not_told(leg: str) -> None:
    trials, instrument, known = LEGS[leg]()
    small = (zero(-0.03), drift(0.1), begun(0.3), step(0.05), gains(1, 1.05, 0.96), gains(1.04, 1.02, 0.98))
    assert [told(change(trials), instrument, known) for change in small] == [[]] * len(small)


def sound(seed: int) -> tuple[Trials, Instrument, bool]:
    """Trials of a drawn leg, whose instrument errs in other ways than is assumed, and isn't always stated."""
    rng = np.random.default_rng(seed)
    depth, speed, rate = rng.uniform(9, 30), np.exp(rng.uniform(-1, 2)), float(rng.choice([20, 50]))
    hold, unloads, air = rng.choice([0.0, 10.0, 40.0]), rng.random() < 0.6, float(rng.choice([0.0, 0.0, 2.0]))
    power, stiffening, top = rng.uniform(1.0, 1.3), rng.uniform(0.0, 4.0), rng.uniform(4.0, 40.0)
    force_sd, way_sd = top * np.exp(rng.uniform(-7, -5)), float(rng.choice([0.01, 0.1]))
    heavy, share = rng.random() < 0.5, float(rng.choice([0.0, 0.2, 0.5]))
    trials = []
    for _ in range(int(rng.integers(1, 5))):
        before = max(air + 0.3 * rng.standard_normal(), 0.0) if air else 0.0
        taken = np.cumsum([0.0, (depth + before) / speed, hold, (depth + before) / speed * unloads])
        time = np.arange(0.0, taken[-1], 1 / max(rate, 150 / taken[1]))
        d = np.interp(time, taken, [-before, depth, depth, -before])
        n = max(1, int(0.1 * rng.random() / time[1]))
        d = np.convolve(np.pad(d, n, "edge"), np.ones(2 * n + 1) / (2 * n + 1), "valid")
        x = np.maximum(d, 0.0) / depth
        force = np.maximum(relaxing(top * x**power * (1 + stiffening * x**2) / (1 + stiffening), share, 3.0), 0.0)
        white = rng.standard_t(3, len(d)) / np.sqrt(3) if heavy else rng.standard_normal(len(d))
        slow = red(rng, len(d), 0.05 * len(d))
        force = (1 + 0.015 * rng.standard_normal()) * force + force_sd * (0.6 * white + 0.8 * slow)
        force += (0.5 * force_sd + 0.001 * top) * rng.standard_normal()
        trials.append((time, d + before + way_sd * rng.standard_normal(len(d)), force))
    return trials, Instrument(force_sd, way_sd, stated=rng.random() < 0.8), not air and rng.random() < 0.5


def test_at_most_one_sound_recording_in_twenty_is_doubted() -> None:
    doubted = [seed for seed in range(80) if told(*sound(seed))]
    assert len(doubted) <= 4, doubted


def refitted(error: np.ndarray, x: np.ndarray) -> float:
    """Relative change of C10 in a weighted fit of the closed form to its force and an error, N."""
    sd = np.hypot(0.05, 0.02 * shown(x))
    found = least_squares(lambda ln: (shown(x, *np.exp(ln)) - shown(x) - error) / sd, [0.0, 0.0])
    return float(np.expm1(found.x[0]))


@pytest.mark.parametrize(
    "error",
    [
        lambda x: np.full_like(x, -0.25),
        lambda x: 0.5 * x / x[-1],
        lambda x: 0.08 * shown(x),
        lambda x: shown(x - 0.4) - shown(x),
        lambda x: -0.3 * (x > 9.0),
    ],
    ids=["zero", "drift", "gain", "late", "step"],
)
def test_the_effect_on_c10_is_that_of_a_fit_of_another_form(error) -> None:
    time = np.arange(0.0, DEPTH / SPEED, 1 / RATE)
    force = shown(SPEED * time)
    noisy = force + 0.02 * np.random.default_rng(0).standard_normal(len(time))
    trial = segment(Recording(time, SPEED * time, noisy, "trial"), Instrument(0.05, 0.02), starts_at_contact=True)
    (press,) = presses_of([trial])
    assert press.effect(error(press.at)) == pytest.approx(refitted(error(press.at), press.at), rel=0.4, abs=0.01)


def spoilt_folder(folder: Path, change: Callable[[Trials], Trials]) -> None:
    """Write a shipped subject's folder with its recordings spoilt."""
    subject = load_subject(RESOURCES / "frauziols" / "subjects" / "1")
    for one in (subject.directory / "contours.csv", subject.directory / "subject.toml"):
        (folder / one.name).write_bytes(one.read_bytes())
    (folder / "recordings").mkdir()
    trials = change([(one.time, one.displacement, one.force) for one in subject.recordings])
    for k, (time, way, force) in enumerate(trials):
        rows = "".join(f"{t},{d},{f}\n" for t, d, f in zip(time, way, force, strict=True))
        text = f"time_s,displacement_mm,force_N\n{rows}"
        (folder / "recordings" / f"trial{k + 1}.csv").write_text(text)


@pytest.mark.slow
@pytest.mark.parametrize("change", [jump(-1.5), dead_band(1.1), gains(1, 1.4, 1)], ids=["jump", "dead band", "gain"])
def test_what_a_person_would_see_leads_the_page_of_a_fit(change: Callable[[Trials], Trials], tmp_path: Path) -> None:
    spoilt_folder(tmp_path, change)
    fit = lf.identify(tmp_path, law="reduced-polynomial", mesh="coarse")["reduced-polynomial"]
    assert fit.answer.doubts > 0


def test_the_folder_of_a_spoilt_leg_says_what_c10_is_off_by(tmp_path: Path) -> None:
    subject = load_subject(RESOURCES / "frauziols" / "subjects" / "1")
    assert [one for one in doubts_about(subject) if one.effect_on_C10] == []
    spoilt_folder(tmp_path, zero(-0.7))
    (found,) = doubts_about(load_subject(tmp_path))
    assert found.effect_on_C10 is not None and -0.4 < found.effect_on_C10 < -0.1
    assert (
        "tissue doesn't pull, so the zero wasn't taken (so in all 3 trials); C10 is too low by up to" in found.problem
    )


@pytest.mark.parametrize(("known", "softer"), [(True, True), (False, False)], ids=["stated", "looked for"])
def test_a_dead_band_is_said_to_stiffen_where_it_is_taken_for_air(known: bool, softer: bool) -> None:
    """Where contact is stated the force is too low; where it is looked for it begins deeper in the tissue."""
    trials, instrument, _ = LEGS["closed form, held"]()
    read = [Recording(*one, f"trial{k + 1}") for k, one in enumerate(dead_band(0.6)(trials))]
    first, *_ = instrument_doubts(segment_all(read, instrument, known))
    assert first.kind == "a dead band" and first.effect_on_C10 is not None
    assert (first.effect_on_C10 < -0.05) == softer and abs(first.effect_on_C10) > 0.05


def test_a_trial_that_stops_early_does_not_cut_the_mean_of_the_others() -> None:
    trials, instrument, known = LEGS["shipped"]()
    time, d, force = trials[1]
    short = slice(0, int(np.argmax(calm(d) > 5.5)))
    every = [trials[0], (time[short], d[short], force[short]), trials[2]]
    read = segment_all([Recording(*one, f"trial{k + 1}") for k, one in enumerate(every)], instrument, known)
    curve = mean_loading_curve(read)
    assert curve.displacement[-1] > 24.0 and curve.n_trials == 2
