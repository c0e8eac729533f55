"""A leg's sites in 3D: its C10 and its fibres' ratio together, on legs in closed form."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from making import write_subject
from making_identification import DEPTH, Killed
from making_results import law_document
from making_sites import SITES, write_sites
from making_sites_in_3d import (
    IN_TENSION,
    RISES,
    TRUE_C10,
    TRUE_RATIO,
    FibrousLeg,
    leg_of,
    models_as_deep_as_asked,
    models_of,
)
from typer.testing import CliRunner

from legfem.channels.kinds import CHANNELS
from legfem.commands.identify import app as identify_app
from legfem.data.recording import RecordedChannel
from legfem.inverse.catalogue import DEEP_C10, DEEP_RATIO, parameter_of
from legfem.inverse.elastography import FibreRatio
from legfem.inverse.outcome import Outcome
from legfem.inverse.settings import SearchRequest
from legfem.legs import identification
from legfem.legs.identification import fit_in_3d
from legfem.legs.model_3d import SOLVES
from legfem.legs.solver_3d import ways_of_pressing
from legfem.legs.subject import SitedLeg
from legfem.report.answers import sentences_of
from legfem.report.kinds import page_of
from legfem.report.render import rendered

NEO_HOOKEAN = ("neo-hookean",)


def identified(leg: SitedLeg, names: Sequence[str] = (DEEP_C10, DEEP_RATIO), **options: Any):
    models = options.pop("models", None) or models_of(leg)
    asked = tuple(parameter_of(name, models[0].full.nominal) for name in names)
    request = SearchRequest(asked, **options)
    (found,) = fit_in_3d(leg, NEO_HOOKEAN, request, models=models)
    return found


def test_two_ways_of_pressing_tell_the_fibres_ratio_from_c10(tmp_path):
    found = identified(leg_of(tmp_path, ("along", "across")))
    for name, truth in ((DEEP_C10, TRUE_C10), (DEEP_RATIO, TRUE_RATIO)):
        one = found.estimates[name]
        low, high = one.ci95
        assert low < truth < high and one.identifiability != "not identifiable"
        assert one.value == pytest.approx(truth, rel=0.1)
    assert found.log.converged and found.details.spatial.untold == ""
    assert not any("cannot be distinguished" in text for text in sentences_of([found]))
    errors = found.details.spatial.errors
    assert errors["in 3D: leg's length"] == pytest.approx(1e-3, rel=0.02)
    assert errors["in 3D: mesh at along"] == pytest.approx(4e-3 / (1.3**2 - 1), rel=0.02)
    tension = RISES["across"] * IN_TENSION * (TRUE_RATIO - 1) * np.log(2)
    tension /= 1 + RISES["across"] * (TRUE_RATIO - 1)
    assert errors["fibres: stiffness in tension"] == pytest.approx(tension, rel=0.1)
    assert found.details.spatial.full_solves == 2 * found.log.forward_solves <= 16


def test_one_way_of_pressing_is_said_not_to_tell_it_and_c10_has_the_room_for_that(tmp_path):
    leg = leg_of(tmp_path, ("along",))
    found = identified(leg)
    ratio, c10 = found.estimates[DEEP_RATIO], found.estimates[DEEP_C10]
    assert ratio.identifiability == "not identifiable"
    assert ratio.ci95[0] < TRUE_RATIO < ratio.ci95[1] and c10.ci95[0] < TRUE_C10 < c10.ci95[1]
    (said,) = [text for text in sentences_of([found]) if "cannot be distinguished" in text]
    assert "axis_deg = 90" in said
    held = identified(leg, (DEEP_C10,), models=models_of(leg, start=None))
    assert np.ptp(c10.ci95) > 1.5 * np.ptp(held.estimates[DEEP_C10].ci95)


@dataclass
class SidewaysLeg(FibrousLeg):
    """The same, which isn't alike to both sides: fibres draw the cylinder aside by 0.2 of the force a unit."""

    def solve(self, values: Mapping[str, float], sensitivities: Sequence[str]) -> Outcome:
        outcome = super().solve(values, sensitivities)
        every = {**self.nominal, **values}
        plain = super().solve({**values, DEEP_RATIO: 1.0}, (DEEP_C10,)).curve
        ratio, share = every[DEEP_RATIO], 0.2
        by = {DEEP_C10: share * (ratio - 1) * plain.sensitivities[DEEP_C10], DEEP_RATIO: share * plain.force}
        curve = replace(
            outcome.curve,
            channels={"lateral_force": share * (ratio - 1) * plain.force},
            channel_sensitivities={"lateral_force": {n: by.get(n, 0.0 * plain.force) for n in sensitivities}},
        )
        return replace(outcome, curves=(curve,))


def test_a_lateral_force_tells_in_3d_what_one_way_of_pressing_doesn_t(tmp_path):
    """The fibres' ratio, which the force along the travel leaves open; a thickness is said not to be used."""
    leg = leg_of(tmp_path, ("along",))
    curve = SidewaysLeg(rise=RISES["along"]).solve({DEEP_C10: TRUE_C10, DEEP_RATIO: TRUE_RATIO}, ()).curve
    (site,) = leg.sites
    trials = []
    for one in site.recordings:
        time = one.time[::20]
        read = curve.channel("lateral_force", np.minimum(0.4 * time, DEPTH))
        fat = RecordedChannel("fat_thickness", time, np.full(len(time), 6.0), CHANNELS["fat_thickness"].usual)
        lateral = RecordedChannel("lateral_force", time, read, CHANNELS["lateral_force"].usual)
        trials.append(replace(one, channels=(lateral, fat)))
    beside = replace(leg, sites=(replace(site, recordings=tuple(trials)),))
    alone, found = identified(leg), identified(beside, models=models_of(beside, kind=SidewaysLeg))
    low, high = found.estimates[DEEP_RATIO].ci95
    assert low < TRUE_RATIO < high
    assert high - low < 0.3 * np.subtract(*alone.estimates[DEEP_RATIO].ci95[::-1])
    assert found.estimates[DEEP_RATIO].information_shares["lateral_force"] > 0.5
    assert [one.channel.name for one in found.tests[0].channels] == ["force", "lateral_force"]
    (said,) = (text for text in sentences_of([found]) if "is not used" in text)
    assert "fat thickness" in said and "lateral" not in said
    assert alone.details.spatial.untold and not found.details.spatial.untold


def test_a_stated_ratio_is_a_prior_and_its_error_is_c10_s(tmp_path):
    leg = leg_of(tmp_path, ("along",))
    known = FibreRatio(TRUE_RATIO, 0.5, "prior", "subject.toml")
    leg = replace(leg, sites=tuple(replace(site, fibres=known) for site in leg.sites))
    found = identified(leg, (DEEP_C10,))
    ratio, c10 = found.estimates[DEEP_RATIO], found.estimates[DEEP_C10]
    assert ratio.parameter.role == "nuisance" and ratio.parameter.prior.sd == 0.5
    assert ratio.standard_error == pytest.approx(0.5, rel=0.15), "one way adds nothing to it"
    assert c10.ci95[0] < TRUE_C10 < c10.ci95[1]
    # C10 in series with fat follows the force by 1 + C10 / 3 fat.
    of_ratio = 0.5 * RISES["along"] / (1 + RISES["along"] * 1.2) * (1 + 1.3 / 6)
    assert c10.standard_error / TRUE_C10 > 0.8 * of_ratio


def test_a_killed_run_loses_one_site_s_solve_at_most(tmp_path):
    leg, out = leg_of(tmp_path, ("along", "across")), tmp_path / "out"
    models = models_of(leg, out / SOLVES)
    models[1].full.killed_after = 1
    with pytest.raises(Killed):
        identified(leg, models=models, out=out)
    done = models[0].full.calls
    assert done == 2, "the second point's first site was solved before"
    again = models_of(leg, out / SOLVES)
    found = identified(leg, models=again, out=out)
    assert again[0].full.calls == again[1].full.calls - 1 == found.log.forward_solves - done
    once_more = models_of(leg, out / SOLVES)
    same = identified(leg, models=once_more, out=out)
    assert once_more[0].full.calls == once_more[1].full.calls == 0
    assert same.estimates[DEEP_C10].value == found.estimates[DEEP_C10].value


def test_sites_are_solved_side_by_side_with_the_same_result(tmp_path):
    leg = leg_of(tmp_path, ("along", "across"))
    alone = identified(leg)
    models = models_of(leg)
    together = identified(leg, models=models, jobs=2)
    here = sum(one.full.calls for one in models)
    assert here < 2 * together.log.forward_solves, "another process took some of both sites' solves"
    for name in (DEEP_C10, DEEP_RATIO):
        one, other = together.estimates[name], alone.estimates[name]
        assert one.value == pytest.approx(other.value, rel=1e-9)
        assert one.ci95 == pytest.approx(other.ci95, rel=1e-9)
    assert together.details.spatial.errors == pytest.approx(alone.details.spatial.errors, rel=1e-9)
    assert together.details.spatial.rough_solves == alone.details.spatial.rough_solves


def test_cylinders_that_lie_unlike_and_other_shapes_are_ways_of_pressing(tmp_path):
    (site,) = leg_of(tmp_path, ("along",)).sites

    def ways(*poses: tuple[str, float]) -> int:
        sites = [replace(site, indenter=replace(site.indenter, shape=shape, axis_deg=turn)) for shape, turn in poses]
        return ways_of_pressing(SitedLeg("leg", "", tuple(sites), tmp_path))

    assert ways(("cylinder", 0.0), ("cylinder", 180.0), ("cylinder", -10.0)) == 1
    assert ways(("cylinder", 0.0), ("cylinder", 90.0)) == 2
    assert ways(("cylinder", 45.0), ("cylinder", -45.0)) == 1, "fibres see them alike"
    assert ways(("cylinder", 0.0), ("punch", 0.0)) == ways(("ball", 0.0), ("punch", 0.0)) == 2


def test_report_and_document_say_that_the_leg_was_solved_in_3d(tmp_path):
    found = identified(leg_of(tmp_path, ("along",)))
    page = rendered(page_of([found]))
    for text in ("of subject leg?", "in 3D", "larger elements", "across the leg: axis_deg"):
        assert text in page
    for text in ("All sites", "These sites", "by themselves", "departs most", "site by site"):
        assert text not in page, "there is one"
    document = law_document(found)
    assert document["model"] == "3d" and "cannot be distinguished" in document["spatial"]["untold"]
    assert document["spatial"]["full_solves"] == found.details.spatial.full_solves


def test_what_a_diagnosis_cant_take_is_not_sent_to_one(tmp_path):
    along, across = (identified(leg_of(tmp_path, (way,)), (DEEP_C10,)) for way in RISES)
    assert "legfem diagnose" in rendered(page_of([along]))
    assert "legfem diagnose" not in rendered(page_of([across]))


def test_a_section_in_plane_strain_knows_no_fibres(tmp_path):
    write_sites(tmp_path)
    asked = ["--identify", "deep.C10", "--identify", "deep.fibre_ratio"]
    ran = CliRunner().invoke(identify_app, ["--subject-dir", str(tmp_path), *asked])
    assert ran.exit_code == 2 and "--model 3d" in ran.stderr


@pytest.mark.parametrize(("sited", "names"), [(True, SITES[:2]), (False, ("leg",))])
def test_the_command_identifies_fibres_of_a_leg_with_sites_and_of_one_without(tmp_path, monkeypatch, sited, names):
    folder = write_sites(tmp_path / "leg") if sited else write_subject(tmp_path / "leg")
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text() + "\n[recordings]\nplane_strain = false\n")

    monkeypatch.setattr(identification, "leg_models", models_as_deep_as_asked())
    asked = ["--subject-dir", str(folder), "--model", "3d", "--out", str(tmp_path / "out")]
    asked += ["--identify", "deep.C10", "--identify", "deep.fibre_ratio", "--quiet", "--jobs", "1"]
    ran = CliRunner().invoke(identify_app, asked)
    assert ran.exit_code == 0, ran.output
    found = json.loads((tmp_path / "out" / "result.json").read_text())
    (law,) = found["laws"].values()
    assert [one["name"] for one in law["tests"]] == list(names) and law["model"] == "3d"
    assert "cannot be distinguished" in law["spatial"]["untold"]
    assert "cannot be distinguished" in (tmp_path / "out" / "report.txt").read_text()
    refused = CliRunner().invoke(identify_app, [*asked, "--correction", "own"])
    assert refused.exit_code == 2 and "--correction" in refused.stderr
