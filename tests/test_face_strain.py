"""Points tracked on a specimen's face: strains of its sides, what they say of the test, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from making_faces import C10, DEPTHS, HEIGHT, RADIUS, film, of_disc, on_round, round_side, sticking_disc
from making_specimens import BAR, LENGTH, compressed
from scipy.interpolate import CubicSpline
from typer.testing import CliRunner

import legfem as lf
from legfem.channels.kind import Face, Frames
from legfem.channels.kinds.face_strain import PLACES, FaceStrains
from legfem.commands.data import app as data
from legfem.commands.identify import app as identify
from legfem.common.progress import Silent
from legfem.data import Recording, write_recording
from legfem.experiments.axisymmetric import CylinderCompression, settings_to
from legfem.experiments.bodies import CylinderBetweenPlates
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.fit import Fit
from legfem.mechanics.materials import NeoHookean
from legfem.specimens.details import SpecimenDetails
from legfem.specimens.diagnosis import SpecimenDiagnoser

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
[accuracy]
sizes_percent = 1.0
[recordings]
starts_at_contact = true
"""
FACE = '[channels.face_strain]\nfile = "face-{trial}.csv"\n'
STATED = "[instrument]\nforce_sd_N = 0.005\ndisplacement_sd_mm = 0.002\n"


def pressed(folder: Path, filmed: bool) -> Path:
    """Write felupe's sticking disc, at 0.1 mm/s, with noise and a load cell that reads 0.4 % more."""
    d = np.linspace(0.0, DEPTHS[-1], 150)
    force = 1.004 * CubicSpline(DEPTHS, sticking_disc()[0])(d) + np.random.default_rng(1).normal(0.0, 0.01, len(d))
    (folder / "recordings").mkdir(parents=True)
    write_recording(Recording(d / 0.1, d, force, "a"), folder / "recordings" / "a.csv")
    (folder / "specimen.toml").write_text(PLATES + FACE * filmed)
    if filmed:
        angle, height = round_side(HEIGHT / 2)
        time = np.arange(0.0, 24.1, 1.0)
        film(folder / "face-a.csv", time + 0.05, *on_round(angle, height, *of_disc(0.1 * time, height)))
    return folder


@cache
def identified(filmed: bool) -> Fit[SpecimenDetails]:
    with TemporaryDirectory() as folder:
        return lf.identify(lf.load_specimen(pressed(Path(folder) / "disc", filmed)), "neo-hookean")["neo-hookean"]


def test_a_side_s_strains_are_another_code_s() -> None:
    """As a camera reads felupe's side, beside what the model's side gives."""
    test = CylinderCompression(
        CylinderBetweenPlates(RADIUS, HEIGHT, "bonded"), NeoHookean(C10, 1 / (1000 * C10)), settings_to(2.4)
    )
    curve = test.solve(depth=2.4).curve
    angle, height = round_side(HEIGHT / 2)
    place, moved = on_round(angle, height, *of_disc(DEPTHS[-1:], height))
    columns = np.hstack([place[:, :2], moved[0][:, :2]])
    (((read,),)) = FaceStrains().of_frames(
        [Frames(np.zeros(len(columns)), columns, *np.zeros((2, 2)))], [Face(6.0, 12.0)]
    )
    model = [float(curve.channel(f"face_strain:{k}", 2.4)) for k in range(len(PLACES))]
    print(np.round(read.values, 4), np.round(model, 4))
    assert read.values == pytest.approx(model, abs=0.01)


@pytest.mark.parametrize("ends", ["bonded", "sliding"])
def test_derivatives_are_differences(ends: str) -> None:
    body, law = CylinderBetweenPlates(RADIUS, HEIGHT, ends), NeoHookean(C10, 1 / (5 * C10))
    test = CylinderCompression(body, law, settings_to(1.2))
    curve = test.solve(None, 1.2, ["deep.D1"]).curve
    less, more = (test.solve({"deep.D1": factor * law.D1}, 1.2).curve for factor in (0.99, 1.01))
    for k in range(len(PLACES)):
        name = f"face_strain:{k}"
        difference = (more.channel(name, 1.2) - less.channel(name, 1.2)) / (0.02 * law.D1)
        assert curve.interpolated(curve.channel_sensitivities[name]["deep.D1"], 1.2) == pytest.approx(
            difference, rel=2e-3, abs=1e-7
        )


def test_points_on_the_side_say_that_ends_stick_and_narrow_the_interval() -> None:
    """Sizes are known to 1 %; felupe's ends are glued, and its force is 3 % above the model's, whose rim slips."""
    width, chance = {}, {}
    for filmed in (False, True):
        fit = identified(filmed)
        one = fit.estimates["deep.C10"]
        chance[filmed] = {a.name: a.probability for a in fit.details.alternatives}["bonded"]
        width[filmed] = one.relative_half_width
        print(filmed, chance[filmed], one.value, one.ci95, one.relative_half_width, fit.goodness)
    face = identified(True).details.face
    print(face.text)
    assert one.ci95[0] < C10 < one.ci95[1] and width[True] < 0.4 * width[False]
    assert chance[True] > 0.99 > 0.6 > chance[False]
    assert abs(face.along[0] - 1) < 2 * face.along[1]
    heights, seen, model = face.profile
    assert (np.diff(seen) < 0).all() and model == pytest.approx(seen, abs=0.02) and heights[-1] == 0.75


COLUMNS = "time_s,x_mm,y_mm,ux_mm,uy_mm"
BAR_C10, TRAVEL = 5e-3, np.linspace(0.0, 2.0, 150)
SLIPS = 0.15 * np.clip(TRAVEL - 0.6, 0.0, None)
"""mm that grips have let go by: a seventh of the way, from 0.6 mm on."""


YIELDS = 0.4 * compressed(NeoHookean(BAR_C10, 1.0), 0.92 * TRAVEL, 1.0)
"""mm that a rig yields by."""


def bar(
    folder: Path, lost: np.ndarray | float = 0.0, poisson: float = 0.5, repeats: int = 1, filmed: bool = True
) -> Path:
    """Write pulls of a neo-Hookean bar whose sides have a Poisson's ratio of its logarithm; grips lost some mm."""
    d = TRAVEL
    stretch = 1 + (d - lost) / LENGTH
    force = compressed(NeoHookean(BAR_C10, 1.0), d - lost, 1.0)
    (folder / "recordings").mkdir(parents=True)
    (folder / "specimen.toml").write_text(BAR.replace('"compression"', '"tension"') + STATED + FACE * filmed)
    x, y = (one.ravel() for one in np.meshgrid(np.linspace(-4.5, 4.5, 9), np.linspace(-4.6, 4.6, 15)))
    place = np.column_stack([x, y, np.full(len(x), 5.0)])
    strain = np.column_stack([stretch**-poisson - 1, stretch - 1, stretch**-poisson - 1])[::6]
    moved = strain[:, None] * place + np.outer(0.5 * d[::6], [0.0, 1.0, 0.0])[:, None]
    for k, name in enumerate("abc"[:repeats]):
        noise = np.random.default_rng([2, k]).normal(0.0, 0.005, len(d))
        write_recording(Recording(d / 0.1, d, force + noise, name), folder / "recordings" / f"{name}.csv")
        film(folder / f"face-{name}.csv", d[::6] / 0.1, place, moved, k)
    return folder


def test_grips_that_slip_are_said_by_identify(tmp_path: Path) -> None:
    held, slips = (
        lf.identify(lf.load_specimen(bar(tmp_path / name, lost)), "neo-hookean")["neo-hookean"].details.face
        for name, lost in (("held", 0.0), ("slips", SLIPS))
    )
    print(held.text, slips.text, sep="\n")
    assert abs(held.along[0] - 1) < 2 * held.along[1] and "slip" not in held.text
    assert slips.along[0] == pytest.approx(0.9, abs=0.03) and "the grips slip or the rig yields" in slips.text


@pytest.mark.parametrize(
    ("lost", "cause"), [(SLIPS, "grip-slip"), pytest.param(YIELDS, "support-compliance", marks=pytest.mark.slow)]
)
def test_what_grips_and_rig_lose_is_named_with_the_face_and_not_by_the_force_alone(
    tmp_path: Path, lost: np.ndarray, cause: str
) -> None:
    """Grips that let go little by little, and a rig that yields in proportion to the force."""
    verdicts = {}
    for filmed in (False, True):
        folder = lf.load_specimen(bar(tmp_path / str(filmed), lost, repeats=3, filmed=filmed))
        (found,) = (one.diagnosis for one in SpecimenDiagnoser(None, 1, Silent()).diagnosed(folder))
        assert found is not None
        verdicts[filmed] = found.verdict
        print(filmed, found.verdict, [(one.names, one.fit.values) for one in found.models], found.intervals[DEEP_C10])
    assert verdicts[True] == "named" != verdicts[False] and found.models[0].names == (cause,)
    low, high = found.intervals[DEEP_C10]
    assert low < BAR_C10 < high
    assert [one.name for one in found.observed.channels] == ["face_strain"]


def test_a_face_says_how_compressible_it_is(tmp_path: Path) -> None:
    fit = lf.identify(lf.load_specimen(bar(tmp_path / "bar", 0.0, 0.35)), "neo-hookean")["neo-hookean"]
    print(fit.details.face.text)
    assert "more compressible than assumed (a Poisson's ratio near 0.3" in fit.details.face.text


def changed(folder: Path, change: Callable[[np.ndarray], np.ndarray], names: str = COLUMNS) -> Path:
    """Write a bar whose table of points is changed."""
    path = bar(folder) / "face-a.csv"
    np.savetxt(path, change(np.loadtxt(path, delimiter=",", skiprows=1)), "%.6f", ",", header=names, comments="")
    return folder


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda rows: rows * [1, 1, 1, 1e-3, 1e-3], "check the unit of ux_mm and uy_mm"),
        (lambda rows: rows * [1, 1, 1, 40, 40], "check the unit of ux_mm and uy_mm"),
        (lambda rows: rows * [1, 10, 10, 1, 1], "points lie outside the specimen's face; count x from the axis"),
        (
            lambda rows: rows + np.array([0, 0, 5, 0, 0]),
            "points lie outside the specimen's face; count x from the axis",
        ),
        (lambda rows: rows * [1, 1, 1, 1, -1], "uy_mm counts the way it does"),
        (lambda rows: rows * [60, 1, 1, 1, 1] + [600, 0, 0, 0, 0], "count time_s on the recording's clock"),
        (lambda rows: rows[rows[:, 2] > 0], "no frame has 8 points that reach from the middle"),
        (lambda rows: rows[::400], "no frame has 8 points that reach from the middle"),
        (lambda rows: rows + 0.2 * rows[:, [2]] * [0, 0, 0, 0, 1], "count displacements from a frame before the test"),
    ],
)
def test_points_that_can_t_be_the_face_s_are_refused_in_a_line(tmp_path: Path, change, said: str) -> None:
    with pytest.raises(lf.InputError, match=re.escape(said)) as refused:
        lf.load_specimen(changed(tmp_path / "bar", change))
    print(refused.value)
    assert "\n" not in str(refused.value)


def test_the_command_ends_with_2(tmp_path: Path) -> None:
    folder = changed(tmp_path / "bar", lambda rows: rows[:, :4], "time_s,x_mm,y_mm,ux_mm")
    ended = CliRunner().invoke(identify, ["--specimen-dir", str(folder)])
    print(ended.output)
    assert ended.exit_code == 2


def test_a_test_of_which_no_model_has_a_face_refuses_it(tmp_path: Path) -> None:
    toml = bar(tmp_path / "bar") / "specimen.toml"
    toml.write_text(
        toml.read_text()
        .replace("[uniaxial]", "[simple_shear]")
        .replace('direction = "tension"', "")
        .replace("length", "height")
    )
    with pytest.raises(
        lf.InputError, match=r"channels\.face_strain: no model of \[simple_shear\] gives it; leave it out"
    ):
        lf.load_specimen(toml.parent)


def test_look_proposes_the_entry(tmp_path: Path) -> None:
    folder = bar(tmp_path / "bar")
    given = ["look", str(folder / "recordings/a.csv"), str(folder / "face-a.csv"), "--out", str(tmp_path / "out")]
    ended = CliRunner().invoke(data, given)
    assert ended.exit_code == 0 and FACE in (tmp_path / "out/recordings.toml").read_text()
    ended = CliRunner().invoke(data, ["look", str(folder / "face-a.csv")])
    assert ended.exit_code == 2
