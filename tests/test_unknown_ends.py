"""Ends between plates that nobody knows, sizes that are known to some per cent, and laws that miss."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from making_specimens import AREA, BAR, LENGTH, PLANTED, write_bars

import legfem as lf
from legfem.channels.kinds import CHANNELS
from legfem.data import Recording, write_recording
from legfem.data.recording import RecordedChannel
from legfem.experiments.axisymmetric import CylinderCompression, HalfwayTest, settings_to
from legfem.experiments.bodies import CylinderBetweenPlates
from legfem.inverse.estimates import Estimate
from legfem.inverse.parameter import Parameter
from legfem.mechanics.materials import NeoHookean
from legfem.solve.path import ForceCurve
from legfem.specimens.details import Weighed, alternatives_text
from legfem.specimens.kinds.plates import PartlyHeld, PlatesEntry, PlatesKind
from legfem.specimens.laws import bulk_ratio

C10 = 4e-3
PLATES = """\
id = "disc"
title = "Made for a test"
origin = "simulated"

[plates]
diameter_mm = 24.0
height_mm = 12.0

[instrument]
force_sd_N = 0.01
displacement_sd_mm = 0.005

[recordings]
starts_at_contact = true
"""


@cache
def solved(ends: str, bulk: float) -> ForceCurve:
    """The curve of a cylinder, solved on a finer mesh with half the steps."""
    usual = settings_to(3.6)
    steps = replace(usual.steps, largest=usual.steps.largest / 2)
    body = CylinderBetweenPlates(12.0, 12.0, "bonded" if ends == "bonded" else "sliding")
    law = NeoHookean(C10, 1 / (bulk * C10))
    return CylinderCompression(body, law, replace(usual, steps=steps)).solve(depth=3.7).curve


@cache
def identified_without_a_video(ends: str) -> lf.Identification:
    """What the force alone says."""
    with TemporaryDirectory() as folder:
        return lf.identify(lf.load_specimen(pressed(Path(folder) / "disc", ends)), "neo-hookean")


def pressed(folder: Path, ends: str, seed: int = 1, side: bool = False, bulk: float = 1000.0) -> Path:
    """Write a folder whose cylinder was read with noise."""
    curve = solved(ends, bulk)
    d = np.linspace(0.0, 3.6, 150)
    noise = np.random.default_rng(seed).normal(0.0, 0.01, 150)
    (folder / "recordings").mkdir(parents=True)
    seen = np.arange(0.0, 3.61, 0.3)
    # A picture that is 2 % off, in steps of a pixel of 400.
    stretch = np.round(400 * (1 + 1.02 * (curve.channel("lateral_stretch", seen) - 1))) / 400
    video = RecordedChannel("lateral_stretch", seen / 0.1, stretch, CHANNELS["lateral_stretch"].usual)
    recording = Recording(d / 0.1, d, curve(d) + noise, "a", None, (video,) if side else ())
    write_recording(recording, folder / "recordings" / "a.csv")
    (folder / "specimen.toml").write_text(PLATES)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("ends", ["bonded", "sliding"])
def test_a_video_of_the_side_says_what_the_ends_do(tmp_path: Path, ends: str) -> None:
    """The middle is wider than volume asks for where ends stick: force leaves that open, a video hardly."""
    chances = []
    with_video = lf.identify(lf.load_specimen(pressed(tmp_path / "disc", ends, side=True)), "neo-hookean")
    for side, found in enumerate((identified_without_a_video(ends), with_video)):
        details = found["neo-hookean"].details
        chances.append({one.name: one.probability for one in details.alternatives})
        assert (details.lateral is not None) == side
    print(chances)
    assert chances[1][ends] > 0.95 and 1 - chances[1][ends] < 0.5 * (1 - chances[0][ends]) + 1e-3
    assert "Lateral stretch" in found.summary()


def test_a_video_of_the_side_says_how_compressible_the_tissue_is(tmp_path: Path) -> None:
    """Ends that are known to slide, and a Poisson's ratio of 0.4 where 0.4999 is assumed."""
    folder = pressed(tmp_path / "disc", "sliding", side=True, bulk=bulk_ratio(0.4))
    (folder / "specimen.toml").write_text(PLATES.replace("height_mm = 12.0", 'height_mm = 12.0\nends = "sliding"'))
    found = lf.identify(lf.load_specimen(folder), "neo-hookean")
    seen = found["neo-hookean"].details.lateral
    assert seen is not None and seen.poisson_ratio is not None
    best, low, high = seen.poisson_ratio
    assert low <= 0.4 <= high < 0.47 and best == pytest.approx(0.4, abs=0.04)
    assert "more compressible than assumed" in " ".join(found.summary().split())


def test_the_middle_bulges_where_ends_stick() -> None:
    """Volume alone makes a sliding, incompressible cylinder wider by its shortening's root; a compressible one less."""
    body = CylinderBetweenPlates(12.0, 12.0, "sliding")
    stretches = {}
    for name, ends, bulk in (("sliding", "sliding", 1000), ("bonded", "bonded", 1000), ("soft", "sliding", 2)):
        test = CylinderCompression(replace(body, ends=ends), NeoHookean(C10, 1 / (bulk * C10)), settings_to(1.2))
        curve = test.solve(depth=1.2, sensitivities=["deep.D1"]).curve
        stretches[name] = float(curve.channel("lateral_stretch", 1.2))
    print(stretches)
    assert stretches["sliding"] == pytest.approx(0.9**-0.5, rel=1e-3)
    assert stretches["bonded"] > stretches["sliding"] + 0.01 > stretches["soft"] + 0.02


@pytest.mark.parametrize("ends", ["bonded", pytest.param("sliding", marks=pytest.mark.slow)])
def test_ends_that_are_unknown_are_weighed_and_the_truth_is_within(ends: str) -> None:
    found = identified_without_a_video(ends)
    fit = found["neo-hookean"]
    best, *_ = fit.details.alternatives
    estimate = fit.estimates["deep.C10"]
    print({one.name: one.probability for one in fit.details.alternatives}, estimate.value, estimate.ci95)
    assert best.name == ends and best.probability > 0.5
    assert sum(one.probability for one in fit.details.alternatives) == pytest.approx(1.0)
    assert estimate.ci95[0] < C10 < estimate.ci95[1]
    own = best.estimates["deep.C10"].ci95
    assert estimate.ci95[0] <= own[0] * 1.001 or estimate.ci95[1] >= own[1] * 0.999
    assert "State ends in [plates]" in " ".join(found.summary().split())
    assert {one["name"] for one in found.document()["laws"]["neo-hookean"]["alternatives"]} == set(PlatesKind.weighed)


def test_stated_ends_aren_t_weighed() -> None:
    kind = PlatesKind()
    for ends in ("bonded", "sliding"):
        given = PlatesEntry(diameter_mm=10.0, height_mm=10.0, ends=ends)
        assert kind.alternatives(given) == () and kind.body_of(given).ends == ends
    unknown = PlatesEntry(diameter_mm=10.0, height_mm=10.0)
    assert kind.alternatives(unknown) == ("bonded", "partly held", "sliding")
    assert isinstance(kind.under(kind.body_of(unknown), "partly held"), PartlyHeld)


def test_partly_held_ends_resist_by_the_mean_of_both() -> None:
    plain = CylinderBetweenPlates(12.0, 12.0, "bonded")
    law = NeoHookean(C10, 1 / (1000 * C10))
    tests = [CylinderCompression(one, law, settings_to(1.2)) for one in (plain, replace(plain, ends="sliding"))]
    curves = [test.solve(None, 1.2, ["deep.C10"]).curve for test in tests]
    between = HalfwayTest(*tests).solve(None, 1.2, ["deep.C10"]).curve
    d = np.array([0.4, 0.8, 1.2])
    mean = np.mean([curve(d) for curve in curves], axis=0)
    assert between(d) == pytest.approx(mean, rel=1e-4)
    # The law is linear in C10 but for its compressibility, which is held.
    by = np.mean([curve.sensitivity("deep.C10", d) for curve in curves], axis=0)
    assert between.sensitivity("deep.C10", d) == pytest.approx(by, rel=1e-3)


def test_what_is_unknown_is_said_with_its_cost_and_its_remedy() -> None:
    def weighed(name: str, probability: float, value: float) -> Weighed:
        parameter = Parameter("deep.C10", "MPa", (1e-4, 1.0), scale="log")
        known = Estimate(parameter, value, 0.02 * value, (0.96 * value, 1.04 * value), "identifiable")
        return Weighed(name, f"ends of kind {name}", probability, {"deep.C10": known})

    text = alternatives_text([weighed("a", 0.9, 1e-3), weighed("b", 0.1, 1.3e-3)], "Film it")
    assert "ends of kind a (90 %: C10 1.00 kPa), ends of kind b (10 %: C10 1.30 kPa)" in text
    assert text.endswith("The interval weighs them by these chances. Film it.")


@pytest.mark.parametrize(
    ("accuracy", "share"), [("area_mm2 = 5.0", 0.05), ("sizes_percent = 0.0\narea_mm2 = 2.0", 0.02)]
)
def test_a_size_s_error_is_in_the_interval(tmp_path: Path, accuracy: str, share: float) -> None:
    toml = BAR.replace("[recordings]", f"[accuracy]\n{accuracy}\n[recordings]")
    folder = lf.load_specimen(write_bars(tmp_path, PLANTED, toml))
    estimate = lf.identify(folder, "reduced-polynomial")["reduced-polynomial"].estimates["deep.C10"]
    own = estimate.standard_error * np.sqrt(estimate.error_shares["sizes"]) / estimate.value
    # The force is in proportion to the area: C10 errs by as much; the length's usual 0.1 % adds nothing.
    assert own == pytest.approx(share, rel=0.02)


def test_an_interval_carries_what_its_law_misses(tmp_path: Path) -> None:
    bars = write_bars(tmp_path, PLANTED)
    found = lf.identify(lf.load_specimen(bars), "both")
    right, wrong = (found[law].estimates["deep.C10"] for law in ("reduced-polynomial", "neo-hookean"))
    assert found["neo-hookean"].details.misfit.rms > 5 * found["reduced-polynomial"].details.misfit.rms
    assert wrong.error_shares["misfit"] > 0.5 > right.error_shares["misfit"]
    assert right.ci95[0] < PLANTED.C10 < right.ci95[1]
    # By how much the neo-Hookean value depends on the depth used: at half of it the law hardly stiffens.
    shallow = 0.5 * (wrong.value + PLANTED.C10)
    assert wrong.ci95[0] < shallow


def filmed(folder: Path, stretch: float, toml: str = PLATES) -> Path:
    """Write a folder whose recording has a column of a video, the same throughout."""
    (folder / "recordings").mkdir(parents=True)
    (folder / "specimen.toml").write_text(toml)
    at = np.linspace(0.0, 3.0, 60)
    rows = "\n".join(f"{10 * d},{d},{d + 0.01 * np.sin(40 * d)},{stretch}" for d in at)
    (folder / "recordings" / "a.csv").write_text(f"time_s,displacement_mm,force_N,lateral_stretch\n{rows}\n")
    return folder


@pytest.mark.parametrize("stretch", [24.0, 0.0, 101.0])
def test_a_video_in_mm_as_a_strain_or_in_per_cent_is_refused(tmp_path, stretch) -> None:
    with pytest.raises(lf.InputError, match=r"lateral_stretch: begins with .* 1 to begin with"):
        lf.load_specimen(filmed(tmp_path / "disc", stretch))


def test_a_video_that_a_test_has_no_use_for_is_told(tmp_path) -> None:
    sheared = PLATES.replace("[plates]\ndiameter_mm = 24.0", "[simple_shear]\narea_mm2 = 450.0")
    (doubt,) = lf.load_specimen(filmed(tmp_path / "block", 1.0, sheared)).doubts
    assert doubt.field == "lateral_stretch" and "no model of [simple_shear] of one tissue gives it" in doubt.problem


def test_a_poisson_ratio_of_a_half_is_told_in_words(tmp_path) -> None:
    with pytest.raises(lf.InputError, match=r"poisson_ratio: 0\.5 is out of range; give a value below 0\.5$"):
        lf.load_specimen(filmed(tmp_path / "disc", 1.0, PLATES + "[tissue]\npoisson_ratio = 0.5\n"))


def test_an_error_of_a_size_that_a_test_has_not_is_refused(tmp_path) -> None:
    with pytest.raises(
        lf.InputError, match=r"accuracy\.length_mm: is not a size of \[plates\]; give diameter_mm, height"
    ):
        lf.load_specimen(filmed(tmp_path / "disc", 1.0, PLATES + "[accuracy]\nlength_mm = 0.2\n"))


def test_a_pulled_bar_s_width_says_how_compressible_it_is(tmp_path: Path) -> None:
    """Of Hencky's law, E ln(stretch) with sides that go by a Poisson's ratio of it, in closed form."""
    poisson, d = 0.35, np.linspace(0.0, 2.0, 150)
    stretch = 1 + d / LENGTH
    width, force = stretch**-poisson, AREA * 0.03 * np.log(stretch) / stretch
    read = np.round(500 * (1 + 1.02 * (width[::10] - 1))) / 500
    video = RecordedChannel("lateral_stretch", d[::10] / 0.1, read, CHANNELS["lateral_stretch"].usual)
    noise = np.random.default_rng(2).normal(0.0, 0.005, len(d))
    (tmp_path / "recordings").mkdir()
    write_recording(Recording(d / 0.1, d, force + noise, "a", None, (video,)), tmp_path / "recordings" / "a.csv")
    (tmp_path / "specimen.toml").write_text(BAR.replace('"compression"', '"tension"'))
    found = lf.identify(lf.load_specimen(tmp_path), "neo-hookean")
    seen = found["neo-hookean"].details.lateral
    assert seen is not None and seen.poisson_ratio is not None
    best, low, high = seen.poisson_ratio
    print(seen.text)
    assert low <= poisson <= high and best == pytest.approx(poisson, abs=0.06)
    assert "more compressible than assumed" in seen.text
