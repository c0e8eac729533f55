"""A leg's sites in 3D: its C10 and its fibres' ratio together, on legs in closed form."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from making import write_subject
from making_identification import DEPTH, AnalyticLeg, Killed, pressed_leg
from making_sites import SITES, write_sites
from typer.testing import CliRunner

from legfem.commands.identify import app as identify_app
from legfem.identify.catalogue import DEEP_C10, DEEP_RATIO, parameter_of
from legfem.identify.fibre_ratio import at_ratios, moduli_needed
from legfem.identify.forward import ForwardOutcome
from legfem.identify.request import SearchRequest
from legfem.identify.spatial import SOLVES, LegModels
from legfem.recording import Recording
from legfem.report.sites_numbers import sites_document
from legfem.report.web.page import rendered
from legfem.report.web.sites import sites_web_page
from legfem.sites import spatial
from legfem.sites.spatial import identify_in_3d, ways_of_pressing
from legfem.subjects.elastography import FibreRatio
from legfem.subjects.spatial import spatial_leg
from legfem.subjects.subject import SitedLeg

RISES = {"along": 0.06, "across": 0.12}
"""Of the force a unit of the fibres' ratio, by how the cylinder lies."""
IN_TENSION = 0.3
"""Share of that which is fibres' in tension."""
TRUE_C10, TRUE_RATIO = 1.3e-3, 2.2
NEO_HOOKEAN = ("neo-hookean",)


@dataclass
class FibrousLeg(AnalyticLeg):
    """The closed form, stiffened by fibres: shear and tension each by a share of C10."""

    rise: float = 0.06
    level: float = 0.0
    """Share by which its force is off."""
    start: float | None = 2.0
    """Ratio at which a search begins; None without fibres."""

    @property
    def nominal(self) -> Mapping[str, float]:
        own = {} if self.start is None else {DEEP_RATIO: self.start}
        return {**super().nominal, **own}

    def fingerprint(self) -> Mapping[str, Any]:
        return {"model": "fibrous", "rise": self.rise, "level": self.level}

    def solve(self, values: Mapping[str, float], sensitivities: Sequence[str]) -> ForwardOutcome:
        every = {DEEP_RATIO: 1.0, **self.nominal, **values}
        ratio, c10 = every[DEEP_RATIO], every[DEEP_C10]
        plain = (*dict.fromkeys([n for n in sensitivities if "fibre" not in n] + [DEEP_C10]),)
        found = super().solve(values, plain)
        force, by = found.curve.force, dict(found.curve.sensitivities)
        # Per MPa of shear and of extension, which is four times that.
        shear = self.rise * (1 - IN_TENSION) / (2 * c10) * force
        extension = self.rise * IN_TENSION / (8 * c10) * force
        factor = 1 + self.rise * (ratio - 1)
        by = {name: factor * each for name, each in by.items()}
        # Fibres' moduli stay: their share of the force doesn't grow with C10.
        by[DEEP_C10] = by[DEEP_C10] - self.rise * (ratio - 1) / c10 * force
        by |= {"deep.fibres.shear": shear, "deep.fibres.extension": extension}
        wanted = {*sensitivities, *moduli_needed(["deep"], sensitivities)}
        curve = replace(
            found.curve, force=(1 + self.level) * factor * force,
            sensitivities={n: (1 + self.level) * v for n, v in by.items() if n in wanted},
        )  # fmt: skip
        return replace(found, curves=(at_ratios(curve, every, ["deep"], sensitivities),))


def leg_of(folder: Path, ways: Sequence[str], seed: int = 0, ratio: float = TRUE_RATIO) -> SitedLeg:
    """Return a leg pressed in several ways, with a lab's simplest errors."""
    sites = []
    for number, way in enumerate(ways):
        truth = FibrousLeg(rise=RISES[way]).solve({DEEP_C10: TRUE_C10, DEEP_RATIO: ratio}, ())
        rng = np.random.default_rng([seed, number])
        subject = pressed_leg(folder, 1.3, 0.0, seed)
        trials = tuple(
            Recording(
                one.time, one.displacement,
                truth.curve(0.4 * one.time.clip(max=DEPTH / 0.4))
                + 0.03 * rng.standard_normal(len(one.time)),
                one.trial,
            )
            for one in subject.recordings
        )  # fmt: skip
        turn = 90.0 if way == "across" else 0.0
        sites.append(
            replace(
                subject, recordings=trials, plane_strain=False, site=way,
                indenter=replace(subject.indenter, axis_deg=turn),
            )
        )  # fmt: skip
    return SitedLeg("leg", "Closed form", tuple(sites), folder)


def models_of(leg: SitedLeg, kept: Path | None = None, **more: Any) -> list[LegModels]:
    shape = spatial_leg(replace(leg.sites[0], site=""))
    found = []
    for site in leg.sites:
        rise = RISES[site.site]
        full, rough, shorter = (
            FibrousLeg(rise=rise, level=level, **more) for level in (0.0, 4e-3, 5e-3)
        )
        found.append(LegModels(full, rough, shorter, shape, DEPTH, kept))
    return found


def identified(leg: SitedLeg, names: Sequence[str] = (DEEP_C10, DEEP_RATIO), **options: Any):
    models = options.pop("models", None) or models_of(leg)
    asked = tuple(parameter_of(name, models[0].full.nominal) for name in names)
    request = SearchRequest(asked, **options)
    (found,) = identify_in_3d(leg, NEO_HOOKEAN, request, models=models)
    return found


def test_two_ways_of_pressing_tell_the_fibres_ratio_from_c10(tmp_path):
    found = identified(leg_of(tmp_path, ("along", "across")))
    for name, truth in ((DEEP_C10, TRUE_C10), (DEEP_RATIO, TRUE_RATIO)):
        one = found.parameters[name]
        low, high = one.ci95
        assert low < truth < high and one.identifiability != "not identifiable"
        assert one.value == pytest.approx(truth, rel=0.1)
    assert found.converged and found.spatial.untold == ""
    assert not any("can't be told" in text for text in found.warnings)
    errors = found.spatial.errors
    assert errors["in 3D: leg's length"] == pytest.approx(1e-3, rel=0.02)
    assert errors["in 3D: mesh at along"] == pytest.approx(4e-3 / (1.3**2 - 1), rel=0.02)
    tension = RISES["across"] * IN_TENSION * (TRUE_RATIO - 1) * np.log(2)
    tension /= 1 + RISES["across"] * (TRUE_RATIO - 1)
    assert errors["fibres: stiffness in tension"] == pytest.approx(tension, rel=0.1)
    assert found.spatial.full_solves == 2 * found.forward_solves <= 16


def test_one_way_of_pressing_is_said_not_to_tell_it_and_c10_has_the_room_for_that(tmp_path):
    leg = leg_of(tmp_path, ("along",))
    found = identified(leg)
    ratio, c10 = found.parameters[DEEP_RATIO], found.parameters[DEEP_C10]
    assert ratio.identifiability == "not identifiable"
    assert ratio.ci95[0] < TRUE_RATIO < ratio.ci95[1] and c10.ci95[0] < TRUE_C10 < c10.ci95[1]
    (said,) = [text for text in found.warnings if "can't be told" in text]
    assert "axis_deg = 90" in said
    held = identified(leg, (DEEP_C10,), models=models_of(leg, start=None))
    assert np.ptp(c10.ci95) > 1.5 * np.ptp(held.parameters[DEEP_C10].ci95)


def test_a_stated_ratio_is_a_prior_and_its_error_is_c10_s(tmp_path):
    leg = leg_of(tmp_path, ("along",))
    known = FibreRatio(TRUE_RATIO, 0.5, "prior", "subject.toml")
    leg = replace(leg, sites=tuple(replace(site, fibres=known) for site in leg.sites))
    found = identified(leg, (DEEP_C10,))
    ratio, c10 = found.parameters[DEEP_RATIO], found.parameters[DEEP_C10]
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
    assert again[0].full.calls == again[1].full.calls - 1 == found.forward_solves - done
    once_more = models_of(leg, out / SOLVES)
    same = identified(leg, models=once_more, out=out)
    assert once_more[0].full.calls == once_more[1].full.calls == 0
    assert same.parameters[DEEP_C10].value == found.parameters[DEEP_C10].value


def test_cylinders_that_lie_unlike_and_other_shapes_are_ways_of_pressing(tmp_path):
    (site,) = leg_of(tmp_path, ("along",)).sites

    def ways(*poses: tuple[str, float]) -> int:
        sites = [
            replace(site, indenter=replace(site.indenter, shape=shape, axis_deg=turn))
            for shape, turn in poses
        ]
        return ways_of_pressing(SitedLeg("leg", "", tuple(sites), tmp_path))

    assert ways(("cylinder", 0.0), ("cylinder", 180.0), ("cylinder", -10.0)) == 1
    assert ways(("cylinder", 0.0), ("cylinder", 90.0)) == 2
    assert ways(("cylinder", 45.0), ("cylinder", -45.0)) == 1, "fibres see them alike"
    assert ways(("cylinder", 0.0), ("punch", 0.0)) == ways(("ball", 0.0), ("punch", 0.0)) == 2


def test_report_and_document_say_that_the_leg_was_solved_in_3d(tmp_path):
    found = identified(leg_of(tmp_path, ("along",)))
    page = rendered(sites_web_page([found]))
    for text in ("How stiff is leg leg?", "in 3D", "larger elements", "across the leg: axis_deg"):
        assert text in page
    document = sites_document(found)
    assert document["model"] == "3d" and "can't be told" in document["spatial"]["untold"]
    assert document["spatial"]["full_solves"] == found.spatial.full_solves


def test_a_section_in_plane_strain_knows_no_fibres(tmp_path):
    write_sites(tmp_path)
    asked = ["--identify", "deep.C10", "--identify", "deep.fibre_ratio"]
    ran = CliRunner().invoke(identify_app, ["--subject-dir", str(tmp_path), *asked])
    assert ran.exit_code == 2 and "--model 3d" in ran.stderr


@pytest.mark.parametrize(("sited", "names"), [(True, SITES[:2]), (False, ("leg",))])
def test_the_command_identifies_fibres_of_a_leg_with_sites_and_of_one_without(
    tmp_path, monkeypatch, sited, names
):
    folder = write_sites(tmp_path / "leg") if sited else write_subject(tmp_path / "leg")
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text() + "\n[recordings]\nplane_strain = false\n")

    def models(leg, curves, *_: Any) -> list[LegModels]:
        depth = float(min(curve.displacement[-1] for curve in curves))
        shape = spatial_leg(leg.sites[0])
        return [
            LegModels(*(FibrousLeg(rise=rise, depth=depth) for _ in range(3)), shape, depth)
            for rise in (0.06, 0.12)[: len(leg.sites)]
        ]

    monkeypatch.setattr(spatial, "leg_models", models)
    asked = ["--subject-dir", str(folder), "--model", "3d", "--out", str(tmp_path / "out")]
    asked += ["--identify", "deep.C10", "--identify", "deep.fibre_ratio", "--quiet"]
    ran = CliRunner().invoke(identify_app, asked)
    assert ran.exit_code == 0, ran.output
    found = json.loads((tmp_path / "out" / "result.json").read_text())
    assert set(found["sites"]) == set(names) and found["model"] == "3d"
    assert "can't be told" in found["spatial"]["untold"]
    assert "can't be told" in (tmp_path / "out" / "report.txt").read_text()
    refused = CliRunner().invoke(identify_app, [*asked, "--correction", "own"])
    assert refused.exit_code == 2 and "--correction" in refused.stderr
