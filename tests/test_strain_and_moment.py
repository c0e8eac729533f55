"""Strain inside the section and the moment about the cylinder's axis: derivatives, closed forms, balance, and files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making import TOML, press, write_subject
from making_derivatives import PRECISE
from making_mechanics import COARSE, fixed_steps, subject_3

from legfem.channels import Sight
from legfem.channels.kinds.section_image import STRAIN, SectionStrains
from legfem.channels.laid import STEP_DEG, WAYS
from legfem.channels.log import ChannelReader
from legfem.channels.seen import ReadState
from legfem.common.errors import InputError
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.geometry.section import across
from legfem.inverse.observations import observe
from legfem.legs.loading import load_subject
from legfem.mechanics.contact import ContactSettings

NAMES = ("deep.C10", "superficial.C10")
SETTINGS = PlaneStrainSettings(mesh=COARSE, contact=ContactSettings(onset=0.02), newton=PRECISE, steps=fixed_steps(0.5))
DEPTH = 5.0
ENTRY = '[channels.section_strain]\nfile = "strain-{trial}.csv"\n'


@pytest.fixture(scope="module")
def test() -> PlaneStrainIndentation:
    bare = PlaneStrainIndentation(*subject_3(), SETTINGS)
    travel = bare.section_mesh.direction
    at = [
        bare.section_mesh.touch + y * travel + x * np.array([-travel[1], travel[0]]) for y in (22, 30) for x in (-8, 6)
    ]
    return replace(bare, sights=(Sight(STRAIN.name, tuple((float(x), float(y)) for x, y in at)),))


@pytest.fixture(scope="module")
def solved(test):
    return test.solve(depth=DEPTH, sensitivities=NAMES)


def named(path) -> list[str]:
    return [name for name in path.channels if name.startswith((STRAIN.name, "axis_moment"))]


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_differences(test, solved, name):
    value, change = test.parameters[name], 1e-4
    ahead, behind = (test.solve({name: value * (1 + by)}, DEPTH).path for by in (change, -change))
    assert len(named(solved.path)) == 1 + 4 * (1 + len(WAYS))
    for channel in named(solved.path):
        difference = (ahead.channels[channel] - behind.channels[channel]) / (2 * change * value)
        exact = solved.path.channel_sensitivities[channel][name]
        assert np.abs(exact - difference)[1:].max() < 5e-4 * np.abs(difference).max() + 1e-9, channel


def test_the_tissue_is_shortened_under_the_cylinder(solved):
    strains = np.array([solved.path.channels[name][-1] for name in STRAIN.courses(4)])
    assert (strains < -0.003).all() and (strains > -0.3).all()


def test_an_affine_field_has_its_own_strain(test):
    """e.A e of u = A X, wherever it is read."""
    system, gradient = test.system, np.array([[0.02, -0.05], [0.01, -0.08]])
    dofs = system.spaces.displacement_dofs
    unknown = np.zeros_like(system.unknown.x.array)
    places = system.spaces.displacement_space.tabulate_dof_coordinates()[:, :2]
    unknown[dofs] = (places @ gradient.T).ravel()
    none = np.zeros((0, 2))
    state = ReadState(unknown, np.zeros((0, len(unknown))), np.zeros(2), none, none, np.zeros((0, 0, 2)))
    read = ChannelReader(system, [SectionStrains()], test.sights).read(state)
    e, n = system.direction, across(system.direction)
    strains = {way: [value for name, (value, _) in read.items() if name.endswith(way)] for way in WAYS}
    stated = [value for name, (value, _) in read.items() if name.count(":") == 1]
    np.testing.assert_allclose(stated, e @ gradient @ e, rtol=1e-9)
    # An affine field has the same strain everywhere, and a turned beam sees some of the shear.
    np.testing.assert_allclose([strains["shift in x"], strains["shift in y"]], 0.0, atol=1e-12)
    sheared = np.sin(np.deg2rad(STEP_DEG)) * np.cos(np.deg2rad(STEP_DEG)) * (e @ gradient @ n + n @ gradient @ e)
    np.testing.assert_allclose(strains["turn"], sheared, rtol=1e-9)


def test_the_moment_balances_that_of_the_bones(test):
    """About the cylinder's axis: the tissue at rest hands on to the bones what the cylinder turns it by."""
    found = test.solve(depth=DEPTH)
    system, spaces = test.system, test.system.spaces
    from dolfinx import fem, la

    internal = fem.Function(spaces.space)
    fem.assemble_vector(internal.x.array, system.body.residual)
    internal.x.scatter_reverse(la.InsertMode.add)
    pinned = np.zeros_like(internal.x.array)
    pinned[spaces.bone] = internal.x.array[spaces.bone]
    reaction = pinned[spaces.displacement_dofs].reshape(-1, 2)
    arm = spaces.displacement_space.tabulate_dof_coordinates()[:, :2] - (system.start + DEPTH * system.direction)
    of_bones = float(np.sum(arm[:, 0] * reaction[:, 1] - arm[:, 1] * reaction[:, 0])) * test.indenter.length
    moment = found.path.channels["axis_moment"][-1]
    assert abs(moment) > 0.5
    assert moment == pytest.approx(-of_bones, rel=1e-5)


def test_without_friction_there_is_no_moment():
    contact = ContactSettings(onset=0.02, tangential="frictionless")
    path = PlaneStrainIndentation(*subject_3(), replace(SETTINGS, contact=contact)).solve(depth=DEPTH).path
    assert np.abs(path.channels["axis_moment"]).max() < 1e-3 * path.force[-1] * 15.0


def folder(place: Path, factor: float = 1.0, shift: float = 0.0) -> Path:
    leg = load_subject(write_subject(place))
    recording, middle = press(), leg.section.skin.mean(axis=0)
    away = leg.indenter.aim - middle
    start = middle + 0.3 * away
    rows = ["time_s,x_mm,y_mm,strain"]
    for time in np.arange(0.0, recording.time[-1], 10.0):
        depth = np.interp(time, recording.time, recording.displacement)
        for x in (-8.0, 0.0, 8.0):
            for y in (-8.0, 0.0, 8.0):
                strain = factor * -0.01 * depth * (1 + 0.02 * x) + shift
                rows.append(f"{time:g},{start[0] + x:.3f},{start[1] + y:.3f},{strain:.4f}")
    (place / "strain-trial1.csv").write_text("\n".join(rows) + "\n")
    (place / "subject.toml").write_text(TOML + ENTRY)
    return place


def test_frames_are_read_in_cells(tmp_path):
    leg = load_subject(folder(tmp_path / "leg"))
    (channel,) = leg.recordings[0].channels
    assert channel.kind == STRAIN and 4 <= len(channel.places) <= 9
    (one,) = observe(leg.trials).channels
    assert set(one.laid_courses) == set(WAYS)
    assert one.laid_courses["turn"][1] in one.needed


@pytest.mark.parametrize(
    ("change", "words"),
    [({"factor": 100.0}, "not in per cent"), ({"factor": -1.0}, "below zero"), ({"shift": -0.3}, "before it presses")],
)
def test_strains_that_cannot_be_are_refused(tmp_path, change, words):
    with pytest.raises(InputError, match=words):
        load_subject(folder(tmp_path / "leg", **change))
