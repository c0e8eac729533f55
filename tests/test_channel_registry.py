"""A kind of channel is one file: readers, looks and pages have it from the registry."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from making import TOML, press, write_subject

import legfem
from legfem.channels.kind import ChannelFile, ChannelPlan
from legfem.channels.kinds import (
    CHANNELS,
    FILE_OF,
    IN_COLUMNS,
    OF_FRAMES,
    OF_LEGS,
    UNITS,
    files_of,
    planned_sights,
    plans,
)
from legfem.channels.kinds.contact import PRESSURE
from legfem.channels.kinds.section_image import INSIDE, STRAIN
from legfem.data.recording import RecordedChannel, Recording, write_recording
from legfem.geometry.indenter import Site
from legfem.geometry.section import layer_thicknesses
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.report.instrument_file import channels_toml

_LEG = load_subject(SUBJECTS.find("3"), need_recordings=False)
SITE = Site(_LEG.section, _LEG.indenter)
GENERIC = ("experiments", "data", "inverse", "legs", "report", "api", "commands", "app")


def test_every_kind_has_a_file_a_usual_accuracy_and_a_model():
    for name, kind in CHANNELS.items():
        assert name == kind.name and kind in FILE_OF[name].kinds
        assert isinstance(FILE_OF[name], ChannelFile)
        assert kind.usual.reading > 0 and kind.models <= {"2d", "3d", "specimen"} and kind.models
        assert all(FILE_OF[name] in files_of(model) for model in kind.models)
    assert set(UNITS) >= {"N", "mm"}


def test_plans_record_known_kinds_and_frames_have_columns():
    for plan in plans(SITE):
        assert isinstance(plan, ChannelPlan) and {one.name for one in plan.channels} <= set(CHANNELS)
        assert ("{at}" in plan.asks) == plan.frames
    assert all(file.columns for file in OF_FRAMES.values())


def test_plans_look_at_every_kind_of_frames_within_the_tissue_or_on_the_face():
    """But at those that are recorded: at their own places."""
    sights = {one.name: np.array(one.places) for one in planned_sights(SITE, ())}
    assert set(sights) == {name for name in OF_FRAMES if CHANNELS.get(name) in OF_LEGS}
    assert [one.name for one in planned_sights(SITE, [STRAIN.name])] == [name for name in sights if name != STRAIN.name]
    soft = SITE.section.polygon("skin")
    for bone in SITE.section.bones:
        soft = soft.difference(SITE.section.polygon(bone))
    inside, strain, film = (sights[kind.name] for kind in (INSIDE, STRAIN, PRESSURE))
    for points in (inside[:, :2], strain):
        depth = (points - SITE.deepest) @ SITE.direction
        assert len(points) >= 8 and depth.min() > 2.0 and np.ptp(depth) > 10.0
        assert min(soft.boundary.distance(point) for point in shapely.points(points)) > 2.9
    ends = np.unique(film.ravel())
    assert len(film) == len(ends) - 1 and np.abs(ends).max() < 0.5 * np.pi * SITE.indenter.radius


def test_no_other_room_names_a_kind():
    """Words of cohorts' tables and of geometry aside: quoted names of kinds stand in the kinds' files."""
    root = Path(legfem.__file__).parent
    named = [
        f"{path.relative_to(root)}: {name}"
        for room in GENERIC
        for path in (root / room).rglob("*.py")
        for name in (*CHANNELS, *OF_FRAMES)
        if f'"{name}"' in path.read_text()
    ]
    assert not named


@pytest.mark.parametrize(
    "name",
    [kind.name for kind in IN_COLUMNS if kind in OF_LEGS and kind.name not in ("muscle_thickness", "tissue_thickness")],
)
def test_a_column_of_any_kind_is_read_and_its_errors_are_proposed(tmp_path, name):
    """But for what reaches to the bone: in this leg the line of travel meets no bone."""
    kind = CHANNELS[name]
    pressed = press()
    leg = load_subject(write_subject(tmp_path / "bare"))
    own = layer_thicknesses(leg.section, leg.indenter.aim, leg.indenter.direction)
    values = own.get(name, 0.1) * (1 - 0.005 * pressed.displacement)
    channel = RecordedChannel(name, pressed.time, values, kind.usual)
    place = write_subject(tmp_path / "leg")
    recording = Recording(pressed.time, pressed.displacement, pressed.force, "trial1", None, (channel,))
    write_recording(recording, place / "recordings" / "trial1.csv")
    stated = channels_toml([channel]).replace(f"sd_{kind.unit} = {kind.usual.reading:g}", f"sd_{kind.unit} = 0.1")
    (place / "subject.toml").write_text(TOML + stated)
    (read,) = load_subject(place).recordings
    (one,) = read.channels
    assert one.kind == kind and one.accuracy.reading == 0.1 and one.accuracy.lag == kind.usual.lag
    np.testing.assert_allclose(np.interp(pressed.time, one.time, one.values), values, atol=1e-3)
