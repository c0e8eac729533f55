"""What two tissues' relaxation does comes from one path in time."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from making_diagnosis import GRID, observations, ramps

from legfem.common.progress import Silent
from legfem.inverse.library_tasks import ONE, Task, outcomes_of
from legfem.inverse.responses import Columns, NotKeptError, PathRequest, SolvedResponses
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.mechanisms import mechanism_named
from legfem.mechanisms.time_dependence import TIMES_S

NAMES = ("viscoelasticity", "superficial-viscoelasticity")
SECTION = load_subject(SUBJECTS.find("3"), need_recordings=False).section
SOFT = (0.001, 0.0008)


class Solved(SolvedResponses):
    """A path whose derivatives are numbered in the order in which they are asked for."""

    def _solved(self, asked: PathRequest) -> Columns:
        if self.only_kept:
            raise NotKeptError
        self._made.append(asked)
        ones = np.ones(len(asked.at))
        return {"force": 2.0 * ones, **{name: k * ones for k, name in enumerate(asked.derivatives)}}


BODY = SimpleNamespace(described=str)


def test_relaxation_of_muscle_and_of_fat_take_one_solution() -> None:
    stations = observations(ramps())[0].protocols[0]
    solved = Solved(BODY, GRID[-1], None, {})
    tasks = [Task(SOFT, mechanism_named(name, SECTION), 0.0, stations) for name in NAMES]
    found = outcomes_of(solved, tasks, 1, Silent())
    assert solved.solutions == 1
    muscle, fat = (found[place][ONE]["force"][:, 0] for place in (0, 1))
    assert np.array_equal(muscle, 0.5 * np.arange(len(TIMES_S)))
    assert np.array_equal(fat, 0.5 * np.arange(len(TIMES_S), 2 * len(TIMES_S)))


def test_a_body_of_one_tissue_is_differentiated_by_that_alone() -> None:
    stations = observations(ramps())[0].protocols[0]
    solved, relaxation = Solved(BODY, GRID[-1], None, {}), mechanism_named(NAMES[0])
    outcomes_of(solved, [Task(SOFT, relaxation, 0.0, stations)], 1, Silent())
    assert [one.derivatives for one in solved._made] == [relaxation.derivatives]
