"""Channels that some of a library's solutions lack: weighed by what the others have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from legfem.experiments.plane_strain import LateralPlacement
from legfem.inverse.library_build import Task, _filled, _known_channels
from legfem.inverse.responses import Displaced, PathRequest, SolvedResponses
from legfem.legs.mechanisms import TissueMechanism, mechanism_named
from legfem.meshing.section import MeshMotion

GRID = 5.0 * np.arange(1, 5)
FAT, MUSCLE = "fat_thickness", "muscle_thickness"
POINT = (0.8, 0.0)


def columns(force: float, **channels: float) -> dict[str, np.ndarray]:
    since = np.concatenate([[0.0], GRID])
    return {"force": force * GRID, **{name: size * since for name, size in channels.items()}}


def tasks_of(name: str, *strengths: float) -> list[Task]:
    mechanism = mechanism_named(name)
    assert isinstance(mechanism, TissueMechanism)
    return [Task(POINT, mechanism, strength) for strength in strengths]


def test_a_tilt_that_misses_the_bone_moves_it_as_the_other_tilt_does() -> None:
    """In proportion to the strength, either sign; what is there stays."""
    tasks = [Task(POINT), *tasks_of("indenter-tilt", -8.0, 4.0)]
    outcomes = [
        {"": columns(1.0, **{FAT: -0.05, MUSCLE: -0.4})},
        {"": columns(0.1, **{FAT: 0.02})},
        {"": columns(-0.1, **{FAT: -0.01, MUSCLE: 0.3})},
    ]
    names = _known_channels(list(zip(tasks, outcomes, strict=True)))
    assert set(names) == {FAT, MUSCLE}
    elastic, there, here = _filled(tasks, outcomes, names)
    assert elastic is outcomes[0] and here is outcomes[2] and there is not None
    np.testing.assert_allclose(there[""][MUSCLE], -2.0 * outcomes[2][""][MUSCLE])
    np.testing.assert_allclose(there[""][FAT], outcomes[1][""][FAT])


def test_what_the_base_model_or_a_mechanism_never_sees_is_not_weighed() -> None:
    """Without a bone under the line at rest, or beside all strengths of a mechanism, there is no muscle's thickness."""
    both, fat = columns(1.0, **{FAT: -0.05, MUSCLE: -0.4}), columns(1.0, **{FAT: -0.05})
    tilts = tasks_of("indenter-tilt", -8.0, 8.0)
    for elastic, first, second in ((fat, both, both), (both, fat, fat)):
        done = list(zip([Task(POINT), *tilts], [{"": one} for one in (elastic, first, second)], strict=True))
        assert _known_channels(done) == (FAT,)


@dataclass(eq=False)
class Tilted:
    """A leg whose bone is seen on one side alone."""

    @property
    def assumed(self) -> tuple[str, ...]:
        return ()

    def described(self, variant: str) -> str:
        return variant


class SeenOneSided(SolvedResponses):
    """Solutions in closed form: force falls and muscle thins with the offset, seen where it isn't negative."""

    def _solve(self, asked: PathRequest) -> dict[str, np.ndarray]:
        at = 0.0 if asked.placement is None else asked.placement.offset_mm
        muscle = {MUSCLE: -0.4 - 0.02 * at} if at >= 0 else {}
        return columns(1.0 - 0.01 * at, **{FAT: -0.05 + 0.001 * at}, **muscle)

    @property
    def grid(self) -> np.ndarray:
        return GRID


def test_a_nuisance_that_hides_the_bone_is_solved_for_the_other_way() -> None:
    """The channel's change is minus the other side's; those of the force and of what is seen are its own."""
    solved = SeenOneSided(Tilted(), 20.0, None, {})  # type: ignore[arg-type]
    left = Displaced("aim", placement=LateralPlacement(offset_mm=2.0))
    found, mirrored = (solved.displaced(one, POINT) for one in (left, left.opposite))
    np.testing.assert_allclose(mirrored[MUSCLE], -found[MUSCLE])
    np.testing.assert_allclose(mirrored["force"], -found["force"])
    assert mirrored["force"].min() > 0 > found["force"].max()
    np.testing.assert_allclose(mirrored[FAT], -found[FAT])


@pytest.mark.parametrize(
    "one", [Displaced("skin", MeshMotion("skin", 20.0)), Displaced("turned", placement=LateralPlacement(3.0, 1.0))]
)
def test_twice_the_other_way_is_the_first_way(one: Displaced) -> None:
    """And once isn't."""
    assert one.opposite.opposite == one != one.opposite
