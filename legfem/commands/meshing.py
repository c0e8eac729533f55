"""``legfem meshing``: a leg's mesh as a file for other programs."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from legfem.common.command_line import AsJson, CheckedCommand, Quiet, command_context, leave_to_first_rank
from legfem.common.errors import InputError

if TYPE_CHECKING:
    from legfem.inverse.stored import StoredModel
    from legfem.meshing.exchange import NamedMesh
    from legfem.meshing.materials import TissueCard

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None)


@app.command(cls=CheckedCommand)
def export(
    out: Annotated[Path, typer.Option()],
    subject: str | None = None,
    subject_dir: Path | None = None,
    stocking: str | None = None,
    idealised: Annotated[bool, typer.Option("--idealised")] = False,
    finer: Annotated[float, typer.Option(min=0.2, max=5.0)] = 1.0,
    extrude: Annotated[float, typer.Option(min=0.0, max=1000.0)] = 0.0,
    results: Path | None = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Write the mesh of a leg for gmsh, DOLFINx, ParaView, Abaqus, CalculiX or FEBio Studio.

    Regions are deep, superficial and fascia; surfaces skin, bone, hull (between deep and
    superficial tissue), end and the mirrors. Elements are of first order; lengths in mm.

    Example: legfem meshing --subject 3 --results results/identify-3 --extrude 1 --out leg.feb

    Parameters
    ----------
    out
        File: .msh, .xdmf, .vtu, .inp or .feb.
    subject
        Mesh the section of one of legfem's subjects.
    subject_dir
        Folder of your own leg, with subject.toml or leg.toml.
    stocking
        Mesh one of legfem's legs for stockings, bare and in 3D.
    idealised
        A quarter of the 3D correction's reference leg.
    finer
        Factor by which elements are smaller.
    extrude
        Extrude the section to a slab of this thickness (mm).
    results
        Folder of results, whose materials go into an .inp or .feb.
    """
    leave_to_first_rank()
    with command_context(quiet=quiet):
        from legfem.meshing.exchange import extruded, format_of, write_mesh

        format_of(out)
        mesh = _asked(subject, subject_dir, stocking, idealised, finer)
        if extrude and mesh.dimension == 3:
            raise InputError("--extrude", f"{extrude:g}", "the leg is in 3D already", "leave it out")
        mesh = extruded(mesh, extrude) if extrude else mesh
        mesh = replace(mesh, materials=cards_of(results, mesh.regions) if results else {})
        written = write_mesh(mesh, out)
        if as_json:
            print(json.dumps(mesh_document(mesh, written), indent=1))
            return
        print("\n".join(map(str, written)))
        for line in () if quiet else summary(mesh):
            print(line)


def cards_of(folder: Path, regions: Iterable[str]) -> dict[str, "TissueCard"]:
    """Return tissues' laws as a folder of results has them: of several that which the recordings ask for.

    With the relaxation that a diagnosis found.

    Raises
    ------
    InputError
        If there are no results, or a region's C10 or D1 isn't among them.
    """
    from legfem.inverse.stored import read_result

    found = read_result(folder)
    model = found.laws.get(found.chosen or next(iter(found.laws), ""))
    if model is None:
        raise InputError(folder, "laws", f"contains no model by the law chosen, '{found.chosen}'", "identify again")
    assumed = {**(found.base_model.assumed if found.base_model else {}), **model.assumed}
    return {region: _card(replace(model, assumed=assumed), region, folder) for region in regions}


def _card(model: "StoredModel", region: str, folder: Path) -> "TissueCard":
    from legfem.inverse.catalogue import UNITS, key_of, with_units
    from legfem.mechanisms.time_dependence import TIMES_S, SuperficialViscoelasticity, TissueRelaxation
    from legfem.meshing.materials import TissueCard

    values = {}
    for name in UNITS:
        ((written, factor),) = with_units({f"{region}.{name}": 1.0}).items()
        estimate = model.parameters.get(key_of(f"{region}.{name}"))
        values[name] = (model.assumed.get(written, 0.0) if estimate is None else estimate.value) / factor
    if not values["C10"] * values["D1"] or values["stiffening"]:
        problem = f"has no {region} tissue of C10, C20, C30, D1 and D2"
        raise InputError(folder, region, problem, "give the results of such a leg")
    branches: list[tuple[float, float]] = []
    for effect in (TissueRelaxation(), SuperficialViscoelasticity()):
        known = {one.name: model.parameters.get(f"{effect.name}.{one.name}") for one in effect.parameters}
        if effect.region == region and all(known.values()):
            shares = effect.shares({name: one.value for name, one in known.items() if one})
            branches = [*zip(map(float, shares), TIMES_S, strict=True)]
    return TissueCard((values["C10"], values["C20"], values["C30"]), (values["D1"], values["D2"]), branches)


def section_mesh(folder: Path, finer: float = 1.0) -> "NamedMesh":
    """Mesh the section of a subject's folder, as `legfem.identify` does."""
    from legfem.legs.loading import load_subject
    from legfem.meshing.exchange import named_mesh
    from legfem.meshing.section import SectionMeshSettings, mesh_section, section_regions

    subject = load_subject(folder, need_recordings=False, need_instrument=False)
    section, indenter = subject.section, subject.indenter
    sizes = SectionMeshSettings().refined(finer)
    made = mesh_section(section, indenter.radius, indenter.aim, indenter.direction, sizes)
    return named_mesh(made.mesh, made.cell_tags, made.facet_tags, section_regions(section))


def stocking_mesh(folder: Path, finer: float = 1.0) -> "NamedMesh":
    """Mesh the bare leg of a folder, as `legfem.stocking` does."""
    from legfem.meshing.exchange import named_mesh
    from legfem.meshing.leg_sizes import settings_for_cells
    from legfem.meshing.solid_leg import mesh_solid_leg
    from legfem.stockings.identification import CELLS
    from legfem.stockings.loading import load_leg

    leg = load_leg(folder)
    made = mesh_solid_leg(leg.bare, settings_for_cells(leg.bare, round(CELLS * finer**3)))
    return named_mesh(made.mesh, made.cell_tags, made.facet_tags, made.regions)


def idealised_mesh(finer: float = 1.0) -> "NamedMesh":
    """Mesh a quarter of the reference leg of the 3D correction."""
    from legfem.experiments.indenter_pose import Cylinder
    from legfem.meshing.exchange import named_mesh
    from legfem.meshing.structured import IdealisedLeg, LegMeshSettings, mesh_leg

    cylinder, sizes = Cylinder(), LegMeshSettings().refined(finer)
    made = mesh_leg(IdealisedLeg(), cylinder.radius, cylinder.length, sizes)
    return named_mesh(made.mesh, made.cell_tags, made.facet_tags, made.regions)


def mesh_document(mesh: "NamedMesh", files: Sequence[Path]) -> dict[str, Any]:
    """Return what a mesh holds as JSON types."""
    unit = "area_mm2" if mesh.dimension == 2 else "volume_mm3"
    return {
        "schema": 1,
        "files": [str(path) for path in files],
        "nodes": len(mesh.points),
        "surfaces": list(mesh.surfaces),
        "regions": {
            name: {
                "elements": int((mesh.cells.tags == mesh.regions[name]).sum()),
                "kind": mesh.cells.kind,
                unit: float(size),
            }
            for name, size in mesh.measures().items()
        },
    }


def summary(mesh: "NamedMesh") -> list[str]:
    """Return what a mesh holds, a line for the whole and for each region."""
    lines = [f"{len(mesh.points)} nodes; surfaces: {', '.join(mesh.surfaces)}"]
    for name, held in mesh_document(mesh, ())["regions"].items():
        (measured, size) = list(held.items())[-1]
        lines.append(f"{name}: {held['elements']} {held['kind']} elements, {size:.6g} {measured.partition('_')[2]}")
    return lines


def _asked(
    subject: str | None, folder: Path | None, stocking: str | None, idealised: bool, finer: float
) -> "NamedMesh":
    given = [subject is not None, folder is not None, stocking is not None, idealised]
    if sum(given) != 1:
        remedy = "give one of --subject, --subject-dir, --stocking and --idealised"
        raise InputError("--subject", "leg", f"{'none' if not any(given) else 'more than one'} is given", remedy)
    from legfem.legs.schema import SUBJECTS
    from legfem.stockings.loading import LEGS

    if idealised:
        return idealised_mesh(finer)
    if stocking is not None:
        return stocking_mesh(LEGS.find(stocking), finer)
    if folder is not None and (folder / LEGS.file).is_file():
        return stocking_mesh(folder, finer)
    return section_mesh(SUBJECTS.named(subject, folder), finer)
