"""Laws in other programs' words: an .inp and a .feb hold the stress that was identified, in their own definitions."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import felupe
import numpy as np
import pytest
from making_results import result
from test_exchange import quarter, section
from typer.testing import CliRunner

from legfem.commands.meshing import app, cards_of
from legfem.common.documents import write_document
from legfem.common.errors import InputError
from legfem.inverse.document import fit_document
from legfem.mechanics.materials import NeoHookean, Yeoh
from legfem.meshing.exchange import extruded, named_mesh, write_mesh
from legfem.meshing.materials import TissueCard

BRANCHES = [(0.05 * k, 0.3 * 3.0**k) for k in range(1, 9)]
CARD = TissueCard((0.0007, 0.0008, 0.0001), (280.0, 1.4), BRANCHES)
LAW = Yeoh(0.0007, 280.0, 0.0008, 1.4, 0.0001)
PULL = np.array([[1.2, 0.1, 0.0], [-0.05, 0.85, 0.1], [0.0, 0.02, 0.97]])


def numbers_after(lines: list[str], keyword: str) -> list[float]:
    (at,) = (k for k, line in enumerate(lines) if line.startswith(keyword))
    return [float(word) for word in lines[at + 1].split(",")]


def volumetric_and_distortion(F: np.ndarray) -> tuple[float, float]:
    J = float(np.linalg.det(F))
    return J - 1.0, float(np.trace(F.T @ F)) * J ** (-2 / 3) - 3.0


def slope(energy, at: float) -> float:
    return (energy(at + 1e-6) - energy(at - 1e-6)) / 2e-6


def test_the_reduced_polynomial_of_abaqus_has_the_stress_of_the_law() -> None:
    """By the energy of its manual: U = sum C_i0 (I1 - 3)^i + sum (J - 1)^2i / D_i, D_i = 0 leaving a term out."""
    lines = list(CARD.abaqus("deep"))
    (order,) = map(int, re.findall(r"REDUCED POLYNOMIAL, N=(\d)", "\n".join(lines)))
    numbers = numbers_after(lines, "*HYPERELASTIC")
    stiffness, compressibility = numbers[:order], numbers[order:]
    assert len(compressibility) == order == 3
    volume, stretch = volumetric_and_distortion(PULL)
    distorting = slope(lambda x: sum(c * x**i for i, c in enumerate(stiffness, start=1)), stretch)
    swelling = slope(lambda x: sum(x ** (2 * i) / d for i, d in enumerate(compressibility, start=1) if d), volume)
    assert distorting == pytest.approx(LAW.distortion_slope(stretch), rel=1e-7)
    assert swelling == pytest.approx(LAW.volumetric_slope(1.0 + volume), rel=1e-7)


@pytest.mark.parametrize(
    ("stiffness", "volume", "order"), [((1, 0, 0), (9, 0), 1), ((1, 0, 0), (9, 8), 2), ((1, 2, 0), (9, 0), 2)]
)
def test_a_law_has_no_more_terms_than_it_needs(stiffness, volume, order) -> None:
    lines = list(TissueCard(stiffness, volume).abaqus("fat"))
    assert f"*HYPERELASTIC, REDUCED POLYNOMIAL, N={order}" in lines
    assert numbers_after(lines, "*HYPERELASTIC") == [*stiffness[:order], *volume[:order]]


def test_relaxation_of_both_programs_is_that_of_the_branches() -> None:
    """After a sudden strain, over what lasts: 1 + sum of beta exp(-t / tau), whatever each counts from."""
    time = np.geomspace(0.01, 1e4, 40)
    lines = list(CARD.abaqus("deep"))
    assert any("MODULI=LONG TERM" in line for line in lines)
    series = np.array(
        [list(map(float, line.split(","))) for line in lines[lines.index("*VISCOELASTIC, TIME=PRONY") + 1 : -2]]
    )
    faded = 1.0 - np.exp(-time[:, None] / series[:, 2])
    at_once = 1.0 / (1.0 - series[:, 0].sum())
    expected = 1.0 + sum(ratio * np.exp(-time / tau) for ratio, tau in BRANCHES)
    np.testing.assert_allclose(at_once * (1.0 - faded @ series[:, 0]), expected, rtol=1e-8)
    assert not series[:, 1].any(), "volume doesn't relax"

    material = ElementTree.fromstring(CARD.febio("deep", 1))
    assert material.get("type") == "uncoupled viscoelastic" and material.findtext("g0") == "1"
    assert material.find("g7") is None, "FEBio has six branches at most"
    found = [[float(material.findtext(f"{letter}{k}", "nan")) for letter in "gt"] for k in range(1, 7)]
    relaxed = 1.0 + sum(ratio * np.exp(-time / tau) for ratio, tau in found)
    assert sum(ratio for ratio, _ in found) == pytest.approx(sum(ratio for ratio, _ in BRANCHES))
    slow = time > 10.0
    np.testing.assert_allclose(relaxed[slow], expected[slow], rtol=2e-2)
    assert [element.tag for element in material.find("elastic")] == ["c1", "c2", "c3"], "its volume is the whole's"


def test_felupe_has_the_same_stress_by_the_numbers_of_a_feb() -> None:
    """With a mesh that felupe reads, too: W = mu / 2 (I1 - 3) + K / 2 (J - 1)^2, as FEBio's Yeoh of one term."""
    law = NeoHookean(0.002, 22.5)
    material = ElementTree.fromstring(TissueCard((0.002, 0.0, 0.0), (22.5, 0.0)).febio("fat", 1))
    assert material.get("type") == "Yeoh" and material.findtext("pressure_model") == "Abaqus"
    c1, bulk = float(material.findtext("c1")), float(material.findtext("k"))
    other = felupe.NeoHooke(mu=2 * c1, bulk=bulk)
    nominal = other.gradient([PULL[:, :, None, None], None])[0][:, :, 0, 0]
    volume, stretch = volumetric_and_distortion(PULL)
    J = 1.0 + volume
    left = PULL @ PULL.T * J ** (-2 / 3)
    deviator = left - np.trace(left) / 3 * np.eye(3)
    cauchy = 2 / J * law.distortion_slope(stretch) * deviator + law.volumetric_slope(J) * np.eye(3)
    np.testing.assert_allclose(nominal @ PULL.T / J, cauchy, rtol=1e-8, atol=1e-12)


def with_cards(mesh):
    return replace(mesh, materials=dict.fromkeys(mesh.regions, CARD))


def test_meshio_and_felupe_read_a_mesh_with_its_materials(tmp_path: Path) -> None:
    made, regions = quarter("hexahedra")
    mesh = with_cards(named_mesh(made.mesh, made.cell_tags, made.facet_tags, regions))
    (path,) = write_mesh(mesh, tmp_path / "leg.inp")
    assert path.read_text().count("*MATERIAL, NAME=") == len(regions)
    with pytest.raises(InputError, match=r"leg.msh: has no place for materials; give an .inp or .feb"):
        write_mesh(mesh, tmp_path / "leg.msh")
    parts = felupe.mesh.read(path).meshes
    volumes = [float(felupe.RegionHexahedron(part).dV.sum()) for part in parts]
    np.testing.assert_allclose(sorted(volumes), sorted(mesh.measures().values()), rtol=1e-3)


@pytest.mark.parametrize("solid", [True, False], ids=["hexahedra", "slab"])
def test_a_feb_has_the_parts_of_a_model_of_febio_and_its_normals_point_outwards(tmp_path: Path, solid: bool) -> None:
    """Names of elements as in the User Manual of FEBio 4, "Free format input": Module, Material, Mesh, MeshDomains."""
    made, regions = quarter("hexahedra") if solid else section()
    mesh = named_mesh(made.mesh, made.cell_tags, made.facet_tags, regions)
    mesh = with_cards(mesh if solid else extruded(mesh, 2.0))
    (path,) = write_mesh(mesh, tmp_path / "leg.feb")
    root = ElementTree.parse(path).getroot()
    assert (root.tag, root.get("version")) == ("febio_spec", "4.0")
    assert [part.tag for part in root] == ["Module", "Material", "Mesh", "MeshDomains"]
    materials = {one.get("name") for one in root.iter("material")}
    domains = {one.get("name"): one.get("mat") for one in root.iter("SolidDomain")}
    assert materials == set(domains) == set(domains.values()) == set(regions)
    points = np.array([list(map(float, node.text.split(","))) for node in root.iter("node")])
    np.testing.assert_allclose(points, mesh.points, rtol=1e-8, atol=1e-8)
    cells = {}
    for block in root.iter("Elements"):
        assert block.get("type") == ("hex8" if solid else "penta6")
        for element in block:
            cells[int(element.get("id"))] = block.get("name"), np.array(list(map(int, element.text.split(",")))) - 1
    assert set(cells) == set(range(1, len(mesh.cells.nodes) + 1))
    assert {name for name, _ in cells.values()} == set(regions)
    bodies = [(set(nodes), points[nodes].mean(axis=0)) for _, nodes in cells.values()]
    assert {surface.get("name") for surface in root.iter("Surface")} == set(mesh.surfaces)
    for surface in root.iter("Surface"):
        for facet in list(surface)[::7]:
            corners = np.array(list(map(int, facet.text.split(",")))) - 1
            assert facet.tag == {3: "tri3", 4: "quad4"}[len(corners)]
            (middle,) = (centre for nodes, centre in bodies if nodes.issuperset(corners))
            one, two, three = points[corners[:3]]
            assert np.cross(two - one, three - one) @ (one - middle) > 0


def stored(folder: Path, content) -> Path:
    write_document(folder / "result.json", content)
    return folder


def test_the_law_that_the_recordings_ask_for_goes_into_the_cards(tmp_path: Path) -> None:
    fits = [result("neo-hookean"), result("reduced-polynomial")]
    document = fit_document(fits)
    card = cards_of(stored(tmp_path / "both", document), ["deep", "superficial"])["deep"]
    chosen = next(fit for fit in fits if fit.law == document["chosen"])
    assert card.stiffness[0] == pytest.approx(chosen.values["deep.C10"])
    assert card.stiffness[1] == pytest.approx(chosen.values.get("deep.C20", 0.0))
    assert card.compressibility[0] == pytest.approx(chosen.assumed["deep.D1"])
    alone = fit_document(fits[1:])
    card = cards_of(stored(tmp_path / "alone", alone), ["deep"])["deep"]
    assert card.stiffness[1] == pytest.approx(fits[1].values["deep.C20"]) and card.stiffness[1] > 0


def test_relaxation_that_a_diagnosis_found_goes_into_the_cards(tmp_path: Path) -> None:
    document = fit_document([result("reduced-polynomial")])
    (law,) = document["laws"].values()
    mine = {"ratio": 0.4, "relaxation_time": 8.0, "spread": 0.5, "slow": 0.1}
    law["parameters"] |= {f"viscoelasticity.{name}": {"value": value, "unit": "-"} for name, value in mine.items()}
    cards = cards_of(stored(tmp_path, document), ["deep", "superficial"])
    assert sum(ratio for ratio, _ in cards["deep"].branches) == pytest.approx(0.4)
    assert max(cards["deep"].branches)[1] in (4.2, 14.0), "around the middle of the spectrum"
    assert not cards["superficial"].branches


def test_what_a_feb_needs_is_said_in_a_line(tmp_path: Path) -> None:
    out = ["--out", str(tmp_path / "new" / "leg.feb")]
    for words in (["--subject", "3", *out], ["--idealised", *out]):
        done = CliRunner().invoke(app, words)
        assert done.exit_code == 2 and "give --results, and --extrude for a section" in done.output
        assert done.output.count("\n") == 1 and not (tmp_path / "new").exists()
    document = fit_document([result("neo-hookean")])
    with pytest.raises(InputError, match=r"tibia: has no tibia tissue.*give the results of such a leg"):
        cards_of(stored(tmp_path, document), ["tibia"])
    for changed in ({"chosen": "x"}, {"laws": {}}):
        with pytest.raises(InputError, match=r"laws: contains no model by the law chosen.*identify again"):
            cards_of(stored(tmp_path, {**document, **changed}), ["deep"])
