"""A diagnosis' stiffness is over the laws that may be right, whichever of them was asked for."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace

import numpy as np
import pytest
from making_diagnosed import diagnosed as made_up
from making_diagnosed import diagnosed_of
from making_diagnosis import observations, ramps
from making_specimens import BAR, compressed, record, relaxing

import legfem as lf
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.library_tasks import nearest_stiffening, stiffness_at
from legfem.inverse.verdict import IMPROBABLE, Diagnosis
from legfem.mechanics.materials import ExponentialStiffening
from legfem.report.answers import sentence_of
from legfem.specimens.diagnosis import _STIFFENINGS, laws_told

ASKED = ("force-drift", "leg-movement")
"""Neither stiffens: a law without C20 has to do without."""


@cache
def by_two_laws() -> tuple[Diagnosis, Diagnosis]:
    """The same recordings of a tissue that stiffens, by a law without stiffening and by one with it."""
    right = made_up({}, asked=ASKED)
    return diagnosed_of(right.observed, ASKED, "neo-hookean"), right


def test_an_improbable_law_gives_way_to_the_probable_one_and_counts_no_more() -> None:
    wrong, right = by_two_laws()
    for asked, other in ((wrong, right), (right, wrong)):
        found = asked.over_laws([other])
        assert found.law == "reduced-polynomial"
        assert [one.law for one, _ in found.by_law] == ["reduced-polynomial", "neo-hookean"]
        assert sum(chance for _, chance in found.by_law) == pytest.approx(1.0) and found.by_law[1][1] < 0.01
        assert found.intervals == right.intervals


def test_laws_that_both_may_be_right_share_the_range_and_the_asked_one_is_shown() -> None:
    plain = made_up({}, asked=ASKED, law="neo-hookean")
    stiffening = diagnosed_of(plain.observed, ASKED, "reduced-polynomial")
    (low, high), (other_low, other_high) = (one.own_intervals[DEEP_C10] for one in (plain, stiffening))
    assert other_low < low
    for asked, other in ((plain, stiffening), (stiffening, plain)):
        found = asked.over_laws([other])
        assert found.law == asked.law and min(chance for _, chance in found.by_law) > IMPROBABLE
        assert found.intervals[DEEP_C10] == (other_low, max(high, other_high))
        assert not list(laws_told(found))


def test_a_law_that_explains_in_part_alone_gives_way_to_a_more_probable_one() -> None:
    plain = made_up({}, asked=ASKED, law="neo-hookean")
    stiffening = diagnosed_of(plain.observed, ASKED, "reduced-polynomial")
    assert stiffening.over_laws([plain]).law == "reduced-polynomial"
    for one, other in ((stiffening, plain), (plain, stiffening)):
        in_part = replace(one, verdict="named", models=(SimpleNamespace(in_part=True),))
        assert in_part.over_laws([other]).law == "neo-hookean"


@pytest.mark.parametrize(("stiffening", "expected"), [(0.024, 0.03), (0.7, 0.8), (5.0, 1.6)])
def test_the_stiffening_is_that_whose_course_the_loading_has(stiffening: float, expected: float) -> None:
    observed = observations(ramps(3))[0]
    grid = np.linspace(0.5, 25.0, 50)
    solved = SimpleNamespace(grid=grid, curve=lambda c10, c20: c10 * grid + 0.01 * c20 * grid**3)
    c10, c20 = stiffness_at(2e-3, stiffening)
    d = observed.displacement
    recorded = replace(observed, force=c10 * d + 0.01 * c20 * d**3)
    assert nearest_stiffening(recorded, solved, 1e-3, _STIFFENINGS) == expected


def test_ranges_of_laws_that_differ_are_told_with_their_probabilities() -> None:
    ranges = {"neo-hookean": (0.5e-3, 1.0e-3), "reduced-polynomial": (0.04e-3, 0.9e-3)}
    each = [SimpleNamespace(law=law, withheld=False, own_intervals={DEEP_C10: own}) for law, own in ranges.items()]
    (told,) = laws_told(SimpleNamespace(by_law=[(each[0], 0.25), (each[1], 0.75)]))
    said = sentence_of(told)
    assert "0.5 to 1 kPa by the neo hookean law (25% probable)" in said
    assert "0.04 to 0.9 kPa by the reduced polynomial law (75% probable)" in said
    withheld = SimpleNamespace(**{**vars(each[1]), "withheld": True})
    assert not list(laws_told(SimpleNamespace(by_law=[(each[0], 0.25), (withheld, 0.75)])))


TISSUE = ExponentialStiffening(1.0e-3, 1.0, C20=0.0, stiffening=3e-3, exponent=6.0)
"""That stiffens as neither law does."""
FAST = ((1.2, 0.3), (0.8, 4.0), (0.5, 60.0))


def _diagnosed(law: str) -> Diagnosis:
    """A bar of it that relaxes, pressed twice and held, after a little air."""
    with TemporaryDirectory() as place:
        folder = Path(place) / "bar"
        time = np.concatenate([np.linspace(0, 3.5, 211), np.arange(3.75, 90, 0.5)])
        d = np.minimum(time, 3.5)
        force = relaxing(compressed(TISSUE, np.maximum(d - 0.3, 0.0)), time, FAST)
        for name in ("a", "b"):
            record(folder, name, time, d, force)
        toml = BAR.replace("[recordings]\nstarts_at_contact = true\n", f'[tissue]\nlaw = "{law}"\n')
        (folder / "specimen.toml").write_text(toml)
        found = lf.diagnose(lf.load_specimen(folder), library=Path(place) / "kept").specimens[0].diagnosis
    assert found is not None
    return found


@pytest.mark.slow
def test_a_specimen_s_c10_is_the_same_whichever_law_was_asked_for() -> None:
    ends = [_diagnosed(law).intervals[DEEP_C10] for law in ("neo-hookean", "reduced-polynomial")]
    print(ends)
    assert ends[0] == pytest.approx(ends[1], rel=0.02)
    assert ends[0][0] < 1.0e-3 < ends[0][1]
