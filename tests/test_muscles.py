"""Muscles by name within the deep tissue: their mesh, their parameters, and what tells them apart."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from making import circle
from making_limbs import MUSCLES, pressed, two_muscles, write_limb

import legfem as lf
from legfem.channels import Sight
from legfem.channels.kinds.section_image import INSIDE
from legfem.common.errors import InputError
from legfem.common.progress import Silent
from legfem.data import Recording
from legfem.data.recording import RecordedChannel
from legfem.experiments.leg_3d import LegIndentation3D
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.geometry.indenter import Site
from legfem.geometry.leg_shape import shape_of_contours
from legfem.geometry.section import across
from legfem.legs.diagnosis import Diagnoser
from legfem.legs.finite_element_models import plane_strain_test, spatial_test
from legfem.legs.loading import load_subject
from legfem.legs.model_3d import LegModels
from legfem.legs.placement import SpatialLeg
from legfem.legs.plan import Expected, plan_before
from legfem.legs.subject import Subject
from legfem.mechanics.terms import Excess
from legfem.mechanisms import mechanisms, mechanisms_of
from legfem.mechanisms.muscle import NamedMuscle
from legfem.meshing.section import SectionMeshSettings, mesh_section, section_regions
from studies.making.plane_leg import OtherCase, OtherCode


def grouped(**groups: list[str]) -> str:
    """Return muscles in groups, as subject.toml says it."""
    return MUSCLES + "\n[groups]\n" + "".join(f"{name} = {json.dumps(own)}\n" for name, own in groups.items())


BOTH = ("gastrocnemius.C10", "soleus.C10")
COARSE = PlaneStrainSettings(mesh=SectionMeshSettings().refined(0.6))
AS_ONE = {"deep.C10": 8e-4, "deep.D2": np.inf, "soleus.D2": np.inf, "gastrocnemius.D2": np.inf}
APART = {**AS_ONE, "gastrocnemius.C10": 6e-4, "soleus.C10": 1.2e-3}


@pytest.fixture(scope="module")
def calf(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    folder = write_limb(tmp_path_factory.mktemp("calf") / "leg", two_muscles(), MUSCLES)
    return load_subject(folder, need_recordings=False)


@pytest.fixture(scope="module")
def apart(calf: Subject) -> PlaneStrainIndentation:
    return plane_strain_test(calf.with_muscles(BOTH), COARSE)


def triangles(test: PlaneStrainIndentation, tag: int) -> shapely.MultiPolygon:
    mesh, tags = test.section_mesh.mesh, test.section_mesh.cell_tags
    corners = mesh.geometry.x[mesh.geometry.dofmap[tags.find(tag)]][:, :3, :2]
    return shapely.union_all(shapely.polygons(corners))


@pytest.mark.parametrize("muscle", ["gastrocnemius", "soleus"])
def test_elements_end_at_a_muscles_border(apart: PlaneStrainIndentation, muscle: str):
    section = apart.section
    meshed, drawn = triangles(apart, section_regions(section)[muscle]), section.polygon(muscle)
    # Elements are up to 7 mm long: did they cross the border, they would miss a tenth of it.
    assert meshed.symmetric_difference(drawn).area < 0.03 * drawn.area
    border = section.polygon("gastrocnemius").intersection(section.polygon("soleus").buffer(0.1)).centroid
    assert meshed.boundary.distance(border) < 0.2


def test_what_lies_between_a_muscle_and_the_fascia_is_muscle_where_it_is_a_sliver(apart: PlaneStrainIndentation):
    inner = apart.section.polygon("fascia").buffer(-apart.section.fascia_thickness)
    named = shapely.union_all([apart.section.polygon(name) for name in apart.section.muscles])
    behind = shapely.box(-30, -60, 30, -40)
    assert (inner - named).intersection(behind).area > 5.0
    assert triangles(apart, section_regions(apart.section)["deep"]).intersection(behind).area < 0.5


def test_muscles_that_nobody_asks_for_leave_the_mesh_as_it_is(calf: Subject):
    plain = replace(calf, section=replace(calf.section, muscles={}))
    one, other = (plane_strain_test(leg, COARSE).section_mesh for leg in (calf, plain))
    assert np.array_equal(one.mesh.geometry.x, other.mesh.geometry.x)
    assert np.array_equal(one.cell_tags.values, other.cell_tags.values)
    assert plane_strain_test(calf, COARSE).model.parameters == plane_strain_test(plain, COARSE).model.parameters


def test_muscles_as_stiff_as_the_rest_meet_the_force_of_one_tissue(apart: PlaneStrainIndentation, calf: Subject):
    one = plane_strain_test(calf, COARSE).solve({"deep.C10": 8e-4, "deep.D2": np.inf}, depth=4.0)
    alike = {**AS_ONE, "gastrocnemius.C10": 8e-4, "soleus.C10": 8e-4}
    assert apart.solve(alike, depth=4.0).curve(4.0) == pytest.approx(one.curve(4.0), rel=0.005)


@pytest.fixture(scope="module")
def together(tmp_path_factory: pytest.TempPathFactory) -> Subject:
    folder = write_limb(
        tmp_path_factory.mktemp("group") / "leg", two_muscles(), grouped(triceps=["soleus", "gastrocnemius"])
    )
    return load_subject(folder, need_recordings=False)


def test_a_group_has_one_stiffness_for_all_its_muscles(apart: PlaneStrainIndentation, together: Subject):
    one = plane_strain_test(together.with_muscles(["triceps.C10"]), COARSE)
    values = {"deep.C10": 8e-4, "deep.D2": np.inf}
    of_group = one.solve(
        {**values, "triceps.C10": 6e-4, "triceps.D2": np.inf}, depth=3.0, sensitivities=["triceps.C10"]
    )
    each = apart.solve({**APART, "soleus.C10": 6e-4}, depth=3.0, sensitivities=BOTH).curve
    assert of_group.curve(3.0) == pytest.approx(each(3.0), rel=1e-3)
    at = np.array([3.0])
    by_both = sum(each.sensitivity(name, at)[0] for name in BOTH)
    assert of_group.curve.sensitivity("triceps.C10", at)[0] == pytest.approx(by_both, rel=5e-3)


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (["triceps.C10", "soleus.C10"], "so is triceps, a group that it is in"),
        (["Solleus.C10"], "did you mean soleus?"),
    ],
    ids=["a muscle beside its group", "misspelt"],
)
def test_muscles_that_cannot_be_identified_get_one_line(together: Subject, asked: list[str], words: str):
    with pytest.raises(InputError) as caught:
        together.with_muscles(asked)
    assert words in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", BOTH)
def test_a_force_is_differentiated_by_each_muscles_stiffness(apart: PlaneStrainIndentation, name: str):
    exact = apart.solve(APART, depth=3.0, sensitivities=[name]).curve.sensitivity(name, np.array([3.0]))[0]
    step = 0.02 * APART[name]
    ends = [float(apart.solve({**APART, name: APART[name] + way * step}, depth=3.0).curve(3.0)) for way in (-1, 1)]
    assert exact == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=0.01)


@pytest.mark.parametrize(
    ("change", "more", "field", "words"),
    [
        ({"soleus": circle(0, -25, 14)}, MUSCLES, "soleus", "overlaps the gastrocnemius: "),
        ({"soleus": circle(30, -42, 14)}, MUSCLES, "soleus", "leaves the fascia: "),
        ({"soleus": circle(12, 25, 8)}, MUSCLES, "soleus", "overlaps the fibula: "),
        ({}, MUSCLES + '\n[regions.plantaris]\nkind = "muscle"\n', "plantaris", "the part is missing"),
        ({}, MUSCLES + '\n[regions.deep]\nkind = "muscle"\n', "regions.deep", "is what every leg has"),
        ({}, grouped(deep=["soleus"]), "groups.deep", "is what every leg has"),
        ({}, grouped(Soleus=["gastrocnemius"]), "groups.Soleus", "is the name of a muscle"),
        ({}, grouped(tibia=["gastrocnemius"]), "groups.tibia", "is the name of a bone"),
        (
            {},
            grouped(calf=["soleu"]),
            "groups.calf",
            "'soleu' is no muscle under [regions], or is in a group already; left are gastrocnemius",
        ),
        ({}, grouped(calf=["soleus"], other=["Soleus"]), "groups.other", "is in a group already"),
        ({}, grouped(calf=["soleus", "soleus"]), "groups.calf", "is in a group already"),
        ({}, grouped(calf=[]), "groups.calf", "has no muscle"),
    ],
    ids=[
        "two overlap",
        "outside the fascia",
        "over half of a bone",
        "not drawn",
        "a tissue's name",
        "a group of a tissue's name",
        "a group of a muscle's name",
        "a group of a bone's name",
        "a group of no muscle",
        "a muscle in two groups",
        "a muscle twice in a group",
        "a group of none",
    ],
)
def test_a_wrong_muscle_gets_one_line(tmp_path: Path, change, more: str, field: str, words: str):
    with pytest.raises(InputError) as caught:
        load_subject(write_limb(tmp_path / "leg", {**two_muscles(), **change}, more), need_recordings=False)
    assert caught.value.field == field
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_border_drawn_twice_is_meshed_once(calf: Subject):
    rng = np.random.default_rng(58)
    shaken = {name: xy + 0.1 * rng.standard_normal(xy.shape) for name, xy in calf.section.muscles.items()}
    section = replace(calf.section, muscles=shaken)
    mesh = mesh_section(section, 15.0, calf.indenter.aim, calf.indenter.direction)
    assert min(mesh.quality.minimum.values()) > 0.2
    assert {*np.unique(mesh.cell_tags.values)} == {1, 2, 3, 21, 22}


def test_a_muscle_s_excess_is_that_of_a_law_of_its_own(apart: PlaneStrainIndentation, calf: Subject):
    """But for the contact, whose penalty follows the deep tissue's C10."""
    plain = replace(plane_strain_test(calf, COARSE), section=calf.section)
    name, one = "gastrocnemius.stiffness.excess", Excess("gastrocnemius", "deep", plain.tissues.deep)
    given, at = {"deep.C10": 8e-4, "deep.D2": np.inf}, np.array([3.0])
    within = replace(plain, mechanisms=[one])

    def force(excess: float) -> float:
        return float(within.solve({**given, name: excess}, depth=3.0).curve(3.0))

    assert force(0.0) == pytest.approx(float(plain.solve(given, depth=3.0).curve(3.0)), rel=1e-9)
    own = {**AS_ONE, "soleus.C10": 8e-4, "gastrocnemius.C10": 1.5 * 8e-4}
    assert force(0.5) == pytest.approx(float(apart.solve(own, depth=3.0).curve(3.0)), rel=2e-3)
    exact = within.solve({**given, name: 0.5}, depth=3.0, sensitivities=[name]).curve.sensitivity(name, at)[0]
    assert exact == pytest.approx((force(0.51) - force(0.49)) / 0.02, rel=0.01)


def test_named_muscles_are_together_as_likely_uneven_as_a_muscle_without_names(calf: Subject, together: Subject):
    every = {one.name: one.expected for one in mechanisms_of(calf.section)}
    named = {"gastrocnemius-stiffness", "soleus-stiffness"}
    assert every.keys() - {one.name for one in mechanisms()} == named
    assert sum(every.values()) == pytest.approx(sum(one.expected for one in mechanisms()))
    of_group = {one.name for one in mechanisms_of(together.section)}
    assert "triceps-stiffness" in of_group and not of_group & named
    without = mechanisms_of(replace(calf.section, muscles={}))
    assert [(one.name, one.expected) for one in without] == [(one.name, one.expected) for one in mechanisms()]


SITES = {"medial": 55.0, "lateral": 130.0, "behind": 90.0}
"""Directions of travel through the middle."""


@pytest.fixture(scope="module")
def sited(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three sites of a leg whose muscles another code pressed: 0.6 and 1.2 kPa, and 0.8 kPa of the rest."""
    sites = "".join(
        f'\n[[site]]\nname = "{name}"\nindenter = {{aim_mm = [{8 * (name == "behind")}, 0], direction_deg = {way}}}\n'
        for name, way in SITES.items()
    )
    folder = write_limb(tmp_path_factory.mktemp("sited") / "leg", two_muscles(), MUSCLES + sites)
    text = (folder / "subject.toml").read_text()
    law = '[tissues.deep]\nlaw = "reduced-polynomial"\nD1_per_MPa = 28.0\nD2_per_MPa = 28.0'
    known = '[tissues.deep]\nlaw = "neo-hookean"\nC10_kPa = 0.8\nD1_per_MPa = 28.0'
    assert law in text
    (folder / "subject.toml").write_text(text.replace(law, known))
    for name in SITES:
        pressed(folder, OtherCase(0.8, muscles={"gastrocnemius": 0.6, "soleus": 1.2}), 10.0, finer=0.7, site=name)
    return folder


@pytest.mark.slow
def test_three_sites_tell_two_muscles_apart(sited: Path):
    fit = lf.identify(sited, identify=BOTH, progress=False)["neo-hookean"]
    for name, planted in zip(BOTH, (6e-4, 1.2e-3), strict=True):
        one = fit.estimates[name]
        assert one.value == pytest.approx(planted, rel=0.1)
        assert one.ci95[0] < planted < one.ci95[1]


@pytest.mark.slow
def test_a_plan_says_which_muscles_sites_tell(sited: Path, tmp_path: Path):
    """Three sites identify 0.58 ± 0.06 and 1.18 ± 0.11 kPa, all three stiffnesses free."""
    legs = [load_subject(sited, need_recordings=False, site=name) for name in SITES]
    diagnoser, expected = Diagnoser(tmp_path, None), Expected(8e-4, 0.0, 10.0, 0.5)
    muscles = [one for one in diagnoser.mechanisms_of(legs[0]) if isinstance(one, NamedMuscle)]
    _, told = plan_before(legs[0], legs[1:], diagnoser, expected, Silent(), muscles)
    assert ("gastrocnemius", "soleus") in told[0].alike
    assert told[-1].test.endswith("at lateral, behind, too") and told[-1].alike == []
    assert 0.05 < told[-1].sd["gastrocnemius"] < 0.15 and 0.05 < told[-1].sd["soleus"] < 0.15


@pytest.mark.slow
def test_one_site_does_not_tell_two_muscles_apart(sited: Path):
    found = lf.identify(sited, site="behind", identify=BOTH, progress=False)
    told = " ".join(found.summary().split())
    assert "gastrocnemius not determined" in told and "press at other places too" in told
    assert "C10 was given as" in told
    judged = {one.identifiability for one in found["neo-hookean"].estimates.values()}
    assert judged == {"not identifiable"}


LENGTH = 30.0
"""Of a leg whose cylinder goes from end to end, so that it is in plane strain: its end faces stay in their planes."""


def whole(leg: Subject) -> LegIndentation3D:
    """Return a leg in 3D under a cylinder as long as itself."""
    shape = shape_of_contours(
        np.linspace(-LENGTH / 2, LENGTH / 2, 3), {part: [leg.section.contour(name)] * 3 for part, name in PARTS.items()}
    )
    return spatial_test(replace(leg, indenter=replace(leg.indenter, length=LENGTH)), SpatialLeg(shape, "drawn", True))


PARTS = {"skin": "skin", "hull": "fascia", "tibia": "tibia", "fibula": "fibula"}


def test_a_leg_in_3d_has_its_muscles_as_regions(calf: Subject):
    test = whole(calf.with_muscles(BOTH))
    mesh, tags = test.leg_mesh.mesh, test.leg_mesh.cell_tags
    corners = mesh.geometry.x[mesh.geometry.dofmap[tags.indices]]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    for muscle in ("gastrocnemius", "soleus"):
        area = volumes[tags.values == test.leg_mesh.regions[muscle]].sum() / LENGTH
        assert area == pytest.approx(calf.section.polygon(muscle).area, rel=0.05)
    assert {f"{muscle}.C10" for muscle in ("gastrocnemius", "soleus")} < set(test.parameters)


def test_it_is_said_that_muscles_are_extruded(calf: Subject):
    plain, apart = (LegModels.of_subject(leg, 10.0).leg.source for leg in (calf, calf.with_muscles(BOTH)))
    assert "muscles" not in plain and apart == f"{plain}, muscles as in the section all along"


@pytest.mark.slow
def test_muscles_in_3d_press_back_as_in_plane_strain(calf: Subject):
    """The fascia, which is a membrane, and the mesh make a leg of one muscle 2 to 3 % softer than its section."""
    leg, at = calf.with_muscles(BOTH), np.array([2.0, 3.0, 4.0])
    leg = replace(leg, indenter=replace(leg.indenter, length=LENGTH))
    solid, flat = (test.solve(APART, 4.0, BOTH).curve for test in (whole(leg), plane_strain_test(leg)))
    softer = solid(at) / flat(at)
    assert softer == pytest.approx(0.976, abs=0.01)
    for name in BOTH:
        assert solid.sensitivity(name, at) / flat.sensitivity(name, at) == pytest.approx(softer, rel=0.04)


@pytest.mark.slow
def test_displacements_inside_name_the_muscle_that_is_stiffer(tmp_path: Path):
    """Another code's gastrocnemius of twice the rest's stiffness, in images whose errors are alike over 4 mm."""
    leg = load_subject(write_limb(tmp_path / "leg", two_muscles(), MUSCLES), need_recordings=False)
    deep = replace(leg.tissues["deep"], law="neo-hookean", C20=None, D2=None)
    leg, site = replace(leg, tissues={**leg.tissues, "deep": deep}), Site(leg.section, leg.indenter)
    down, left = np.meshgrid(np.arange(20.0, 50.0, 4.0), np.arange(-20.0, 21.0, 5.0))
    points = site.touch + np.outer(left, across(site.direction)) + np.outer(down, site.direction)
    sight = Sight(INSIDE.name, tuple((float(x), float(y), way) for x, y in points for way in (0, 1)))
    case = OtherCase(0.8, muscles={"gastrocnemius": 1.6})
    pressed_leg = OtherCode(leg, case, 0.7, sights=[sight]).solve(12.0, 0.75)
    rng, time, frames = np.random.default_rng(58), np.arange(0.0, 24.0, 0.1), np.arange(0.0, 24.0, 2.0)
    courses = [pressed_leg.channels[f"{INSIDE.name}:{k}"] for k in range(len(sight.places))]
    moves = np.array([np.interp(0.5 * frames, pressed_leg.displacement, course) for course in courses]).T
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    alike = np.linalg.cholesky(np.exp(-apart / 4.0) + 1e-9 * np.eye(len(points)))
    errors = alike @ rng.laplace(0.0, np.sqrt(0.5), (len(frames), len(points), 2))
    values, course = (moves + 0.3 * errors.reshape(moves.shape)).ravel(), np.tile(range(len(courses)), len(frames))
    inside = RecordedChannel(
        INSIDE.name, np.repeat(frames, len(courses)), values, INSIDE.usual, None, course, sight.places
    )
    recordings = []
    for k in range(3):
        force = (1 + 0.005 * rng.standard_normal()) * np.interp(0.5 * time, pressed_leg.displacement, pressed_leg.force)
        force, at = (one + sd * rng.standard_normal(len(time)) for one, sd in ((force, 0.02), (0.5 * time, 0.01)))
        recordings.append(Recording(time, at, force, f"trial{k + 1}", channels=() if k else (inside,)))
    found = lf.diagnose(replace(leg, recordings=tuple(recordings)), library=tmp_path / "kept", progress=False)
    assert found.verdict == "named"
    assert found.diagnosis.best.names == ("gastrocnemius-stiffness",)
    assert 1.4 < found.diagnosis.best.fit.values["gastrocnemius-stiffness.factor"] < 2.4
    assert "the gastrocnemius is stiffer or softer than the rest of the muscle" in " ".join(found.summary().split())
