"""``python -m studies.meshes``: the reference meshes, their definitions, quality and checksums."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import gmsh
import typer

from legfem.commands.meshing import idealised_mesh, section_mesh, stocking_mesh
from legfem.common.command_line import check_out_folder, command_context, leave_to_first_rank
from legfem.common.documents import markdown_table, versions_of, write_atomically, write_document
from legfem.common.progress import progress_on
from legfem.legs.schema import SUBJECTS
from legfem.meshing.exchange import NamedMesh, write_mesh
from legfem.meshing.gmsh_mesh import MeshQuality, element_quality, gmsh_model
from legfem.stockings.loading import LEGS
from studies.command_line import new_app

MANIFEST = "meshes.json"
PAGE = "README.md"
INTRODUCTION = """# Reference meshes

Written by `python -m studies.meshes` ({versions}). Lengths in mm, elements of first order.
Regions and surfaces are physical groups with names; geometrical entities, by which FEBio Studio
parts a mesh, are numbered alike. `meshes.json` holds the command that makes every mesh,
and its checksum. Any leg goes to .msh, .xdmf, .vtu, .inp or .feb by
`legfem meshing` (`--help`). The sections are reconstructed and the leg of the stockings
is simulated: nobody's anatomy.

Quality is gmsh's signed inverse condition number over a region, 1 for an ideal element; long ones,
as along the fascia and the idealised leg, score low by their shape alone."""


def quality_of_file(path: Path) -> MeshQuality:
    """Measure the regions of a mesh that gmsh can read: its physical groups of full dimension."""
    with gmsh_model("file") as model:
        gmsh.open(str(path))
        dimension = model.getDimension()
        groups = model.getPhysicalGroups(dimension)
        regions = {model.getPhysicalName(dimension, tag): tag for _, tag in groups}
        return element_quality(model, regions, dimension)


@dataclass(frozen=True)
class Reference:
    """One of the reference meshes.

    Parameters
    ----------
    name : str
        Of the file, without its ending.
    title : str
        What it shows.
    leg : str
        Option of ``legfem meshing`` that makes it: idealised, subject or stocking.
    id : str
        Of the leg; empty for the idealised one.
    finer : float
        Divides the sizes of the elements.
    """

    name: str
    title: str
    leg: str
    id: str = ""
    finer: float = 1.0

    @property
    def command(self) -> str:
        """What makes the same mesh, whose file may differ with gmsh's version."""
        which = f"--{self.leg} {self.id}".strip()
        finer = "" if self.finer == 1.0 else f" --finer {self.finer:g}"
        return f"legfem meshing {which}{finer} --out {self.name}.msh"

    def make(self) -> NamedMesh:
        """Make the mesh."""
        makers: dict[str, Callable[..., NamedMesh]] = {
            "idealised": idealised_mesh,
            "subject": partial(section_mesh, SUBJECTS.folder / self.id),
            "stocking": partial(stocking_mesh, LEGS.folder / self.id),
        }
        return makers[self.leg](finer=self.finer)


REFERENCES = (
    Reference("idealised-coarse", "idealised leg, a quarter", "idealised", finer=0.7),
    Reference("idealised", "the same, default size", "idealised"),
    Reference("idealised-fine", "the same, finer", "idealised", finer=1.5),
    *(Reference(f"section-{name}", f"section of subject {name}", "subject", name) for name in ("1", "2", "3", "4")),
    Reference("stocking-1", "leg 1 of the stockings, bare", "stocking", "1"),
)

app = new_app()


def make(reference: Reference, folder: Path) -> dict[str, Any]:
    """Write one mesh into a folder; return its entry in the manifest."""
    mesh = reference.make()
    (path,) = write_mesh(mesh, folder / f"{reference.name}.msh")
    quality = quality_of_file(path)
    unit = "mm2" if mesh.dimension == 2 else "mm3"
    measures = mesh.measures()
    return {
        "file": path.name,
        "title": reference.title,
        "sha256": checksum(path),
        "command": reference.command,
        "nodes": len(mesh.points),
        "elements": mesh.cells.kind,
        "surfaces": sorted(mesh.surfaces),
        "regions": {
            name: {
                "elements": quality.elements[name],
                "size": round(measures[name], 3),
                "unit": unit,
                "quality": {"worst": round(quality.minimum[name], 3), "mean": round(quality.mean[name], 3)},
            }
            for name in mesh.regions
        },
    }


def checksum(path: Path) -> str:
    """Return a file's SHA-256."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def page(manifest: Mapping[str, Any]) -> str:
    """Return the page on the meshes, Markdown."""
    versions = ", ".join(f"{name} {version}" for name, version in manifest["versions"].items())
    rows = []
    for mesh in manifest["meshes"]:
        first = [f"[{mesh['file']}]({mesh['file']})", mesh["title"], f"{mesh['nodes']:,}"]
        last = ", ".join(mesh["surfaces"])
        for region, held in mesh["regions"].items():
            sizes = f"{held['elements']:,} {mesh['elements']}", f"{held['size']:,.0f} {held['unit']}"
            quality = (f"{held['quality'][name]:.2f}" for name in ("worst", "mean"))
            rows.append([*first, region, *sizes, *quality, last])
            first, last = [""] * 3, ""
    header = ["file", "what", "nodes", "region", "elements", "size", "worst quality", "mean", "surfaces"]
    return f"{INTRODUCTION.format(versions=versions)}\n\n{markdown_table(header, rows)}"


@app.command()
def meshes(out: Annotated[Path, typer.Option(help="Folder for the meshes.")] = Path("meshes")) -> None:
    """Make the reference meshes: the idealised leg, the four sections, a leg in 3D.

    Example: python -m studies.meshes --out meshes
    """
    leave_to_first_rank()
    with command_context(), progress_on() as progress:
        check_out_folder(out)
        out.mkdir(parents=True, exist_ok=True)
        progress.stage("meshing", len(REFERENCES))
        entries = []
        for reference in REFERENCES:
            entries.append(make(reference, out))
            progress.advance(reference.name)
        versions = versions_of("legfem", "gmsh")
        manifest = {"schema": 1, "versions": versions, "unit": "mm", "meshes": entries}
        write_document(out / MANIFEST, manifest)
        write_atomically(out / PAGE, page(manifest))


if __name__ == "__main__":
    app(prog_name="python -m studies.meshes")
