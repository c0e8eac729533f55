"""A section's identification corrected by the leg's own solves in 3D, on legs in closed form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making_identification import DEPTH, AnalyticLeg, Killed, pressed_leg
from making_legs_3d import cone_folder
from making_results import law_document
from mpi4py import MPI

from legfem.common.errors import InputError
from legfem.data import Instrument, Recording
from legfem.inverse.correction import TabulatedCorrection, confirmed_correction
from legfem.inverse.elastography import FibreRatio
from legfem.inverse.outcome import JointForward, Outcome
from legfem.inverse.search import SearchError
from legfem.inverse.settings import SearchRequest
from legfem.legs.details import CLOSE
from legfem.legs.identification import MOST_SOLVES, fit_leg
from legfem.legs.loading import load_subject
from legfem.legs.model_3d import LegModels, SpatialForward, check_has_ends
from legfem.legs.placement import spatial_leg
from legfem.legs.subject import Subject
from legfem.report.answers import sentences_of
from legfem.report.kinds import page_of
from legfem.report.render import plain_page

GRID = np.linspace(0.0, DEPTH, 41)


def P_of(c10: float, displacement: np.ndarray, level: float = 0.0) -> np.ndarray:
    """Return an invented leg's P: it grows with the depth and depends on C10 (kPa)."""
    return -0.15 - 0.006 * displacement + 0.05 * np.log(c10) + level


@dataclass
class AnalyticSolid(AnalyticLeg):
    """The analytic leg with ends; ``level`` is added to its P."""

    level: float = 0.0

    def fingerprint(self) -> Mapping[str, Any]:
        return {"model": "analytic solid", "level": self.level}

    def solve(self, values: Mapping[str, float], sensitivities: Sequence[str]) -> Outcome:
        flat = super().solve(values, sensitivities)
        d = flat.curve.displacement
        factor = 1 - P_of(1e3 * values["deep.C10"], d, self.level)
        return replace(flat, curves=(replace(flat.curve, force=factor * flat.curve.force),))


def recorded(folder: Path, c10: float, seed: int = 0) -> Subject:
    """Return a subject whose recordings are the solid leg's, with errors."""
    flat = pressed_leg(folder, c10, 0.0, seed)
    curve = AnalyticSolid().solve({"deep.C10": 1e-3 * c10, "deep.C20": 0.0}, ()).curve
    rng = np.random.default_rng(seed)
    trials = tuple(
        Recording(
            one.time,
            one.displacement,
            curve(0.4 * one.time.clip(max=DEPTH / 0.4)) + 0.03 * rng.standard_normal(len(one.time)),
            one.trial,
        )
        for one in flat.recordings
    )
    return replace(flat, recordings=trials, plane_strain=False)


def table(level: float, trend: float = 0.05) -> TabulatedCorrection:
    """Return a table of other legs: off by a level, and it errs by as much."""
    c10 = 1e-3 * np.array([0.05, 0.5, 1.0, 3.0, 30.0])
    values = P_of(1.0, GRID) + level + trend * np.log(1e3 * c10)[:, None, None]
    errors = {"leg length": np.full(len(GRID), abs(level) + 0.1)}
    return TabulatedCorrection("other legs", GRID, c10, np.array([0.0]), values, errors)


def identified(
    subject: Subject,
    start: TabulatedCorrection | None,
    kept: Path | None = None,
    solid: AnalyticSolid | None = None,
    laws: tuple[Any, ...] = ("neo-hookean",),
    models: LegModels | None = None,
):
    section = AnalyticLeg()
    models = models or LegModels(
        solid or AnalyticSolid(),
        AnalyticSolid(level=0.01),
        AnalyticSolid(level=0.014),
        spatial_leg(subject),
        DEPTH,
        kept,
    )
    request = SearchRequest()
    return fit_leg(subject, laws, request, [start], JointForward((section,)), models)


@pytest.mark.parametrize(
    "start", [pytest.param(one, marks=pytest.mark.slow) for one in (table(0.3), table(0.0, trend=0.0))] + [None]
)
def test_c10_is_recovered_from_any_start_by_few_solves(start, tmp_path):
    solid = AnalyticSolid()
    (result,) = identified(recorded(tmp_path, 1.3), start, solid=solid)
    found = result.estimates["deep.C10"]
    low, high = found.ci95
    assert low < 1.3e-3 < high
    assert abs(found.value / 1.3e-3 - 1) < 0.02
    assert result.details.spatial.converged and result.log.converged
    assert result.details.spatial.full_solves == solid.calls <= 4
    last = result.details.spatial.confirmations[-1]
    assert last.error < CLOSE and last.moved < CLOSE


def test_what_is_left_of_the_correction_s_error_is_in_the_interval_and_the_table_s_is_not(tmp_path):
    (result,) = identified(recorded(tmp_path, 1.3), table(0.3))
    assert set(result.details.spatial.errors) == {"prediction", "first contact", "mesh", "leg's length"}
    np.testing.assert_allclose(result.details.spatial.errors["leg's length"], 0.004, rtol=0.02)
    assert 0.01 < result.details.corrections[0].sd[-1] < 0.04
    width = result.estimates["deep.C10"].relative_half_width
    assert 2 * 0.01 / 1.3 < width < 0.1


@dataclass
class FibrousSolid(AnalyticSolid):
    """The solid leg with derivatives by its fibres: each MPa adds a share of the force."""

    BY_SHEAR, BY_EXTENSION = 30.0, 5.0

    def solve(self, values: Mapping[str, float], sensitivities: Sequence[str]) -> Outcome:
        found = super().solve(values, ())
        force = found.curve.force
        shares = {"deep.fibres.shear": self.BY_SHEAR, "deep.fibres.extension": self.BY_EXTENSION}
        by = {name: shares[name] * force for name in sensitivities}
        return replace(found, curves=(replace(found.curve, sensitivities=by),))


def test_the_error_of_the_fibres_ratio_is_that_of_the_leg_s_own_derivatives(tmp_path):
    subject = replace(recorded(tmp_path, 1.3), fibres=FibreRatio(2.0, 0.25, "measured", "waves"))
    models = LegModels(
        AnalyticSolid(),
        FibrousSolid(level=0.01),
        AnalyticSolid(level=0.014),
        spatial_leg(subject),
        DEPTH,
        fibres=subject.fibres,
    )
    (result,) = identified(subject, table(0.0), models=models)
    expected = 0.25 * 2 * 1.3e-3 * (FibrousSolid.BY_SHEAR + 4 * FibrousSolid.BY_EXTENSION)
    assert result.details.spatial.errors["fibres: ratio"] == pytest.approx(1.27 * expected, rel=0.1)
    assert result.estimates["deep.C10"].error_shares["fibres"] > 0.8
    assert result.details.corrections[0].with_fibres
    (said,) = [text for text in sentences_of([result]) if "times as stiff in shear" in text]
    assert "C10's interval has the error" in said


class Values:
    """Passes for an experiment, and keeps the values that it is asked to solve."""

    comm, muscles = MPI.COMM_SELF, ()

    def solve(self, values, depth, sensitivities, on_step, keep_in):
        self.values = values
        raise Killed

    def fingerprint(self):
        return {}


def test_fibres_of_the_leg_in_3d_stiffen_with_c10():
    given = Values()
    forward = SpatialForward(given, {"fascia.C10": 0.1, "fascia.D1": 22.5, "deep.C10": 1e-3}, 0.6, 20.0, 2.5)
    with pytest.raises(Killed):
        forward.solve({"deep.C10": 3e-3})
    assert given.values["deep.fibres.shear"] == pytest.approx(2 * 3e-3 * 1.5)
    assert given.values["deep.fibres.extension"] == pytest.approx(8 * 3e-3 * 1.5)
    assert forward.fingerprint()["fibre_ratio"] == 2.5


def test_both_laws_share_the_budget(tmp_path):
    solid = AnalyticSolid()
    laws = ("neo-hookean", "reduced-polynomial")
    results = identified(recorded(tmp_path, 0.7), table(0.2), solid=solid, laws=laws)
    assert results[-1].details.spatial.full_solves == solid.calls
    assert solid.calls + results[-1].details.spatial.rough_solves <= MOST_SOLVES


def test_solves_are_kept_and_a_killed_run_goes_on(tmp_path):
    subject, kept = recorded(tmp_path, 1.3), tmp_path / "solves-3d"
    with pytest.raises(Killed):
        identified(subject, table(0.3), kept, AnalyticSolid(killed_after=1))
    again = AnalyticSolid()
    (result,) = identified(subject, table(0.3), kept, again)
    assert again.calls == result.details.spatial.full_solves - 1
    once_more = AnalyticSolid()
    (same,) = identified(subject, table(0.3), kept, once_more)
    assert once_more.calls == 0
    assert same.estimates["deep.C10"].value == result.estimates["deep.C10"].value


def test_a_leg_that_stops_short_is_a_search_error(tmp_path):
    with pytest.raises(SearchError, match="use less of the recordings' depth"):
        identified(recorded(tmp_path, 1.3), None, solid=AnalyticSolid(softest=100.0))


def test_report_and_document_say_what_the_leg_itself_said(tmp_path):
    subject = recorded(tmp_path, 1.3)
    (result,) = identified(subject, table(0.3))
    text = " ".join(plain_page(page_of([result]), []).split())
    assert "extruded over 120 mm" in text and "the table of idealised legs" in text
    document = law_document(result)
    assert document["model"] == "3d"
    assert len(document["spatial"]["confirmations"]) == result.details.spatial.full_solves
    assert document["spatial"]["extruded"] and any(one["code"] == "section_extruded" for one in document["notices"])
    assert len(document["spatial"]["correction_P_of_table"]) == len(result.tests[0].force.channel)


def test_recordings_in_plane_strain_are_refused(tmp_path):
    subject = load_subject(cone_folder(tmp_path, level=100.0), need_recordings=False)
    with pytest.raises(InputError, match="plane strain"):
        check_has_ends(replace(subject, plane_strain=True))
    check_has_ends(subject)
    models = LegModels.of_subject(replace(subject, instrument=Instrument(0.1, 0.1)), DEPTH)
    assert models.rough.fingerprint() != models.full.fingerprint() != models.shorter.fingerprint()


def test_a_leg_that_was_solved_itself_is_not_beyond_a_table():
    far = replace(table(0.3), beyond={"girth": 377.0, "depth": 78.0})
    assert not confirmed_correction("own", far, (1e-3, 0.0), GRID, P_of(1.0, GRID), {}, {}).beyond


def test_a_confirmed_correction_is_what_was_solved_and_follows_the_table_from_there():
    P = P_of(1.0, GRID) + 0.02
    for trend in (None, table(0.3)):
        made = confirmed_correction("own", trend, (1e-3, 0.0), GRID, P, {}, {})
        np.testing.assert_allclose(made.correction(GRID, 1e-3, 0.0), P, atol=1e-12)
        change = made.correction(GRID, 3e-3, 0.0) - P
        np.testing.assert_allclose(change, 0.0 if trend is None else 0.05 * np.log(3), atol=1e-12)


def test_the_last_full_solve_is_there_to_be_looked_at(monkeypatch, tmp_path):
    monkeypatch.setattr(LegModels, "pressed", lambda models, outcome: outcome)
    (result,) = identified(recorded(tmp_path, 1.3), table(0.3))
    last = result.details.spatial.confirmations[-1]
    assert result.details.spatial.pressed.values["deep.C10"] == pytest.approx(last.c10)
    monkeypatch.undo()
    (bare,) = identified(recorded(tmp_path, 1.3), table(0.3))
    assert bare.details.spatial.pressed is None, "a model without states has nothing to show"
