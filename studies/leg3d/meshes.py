"""``python -m studies.leg3d.meshes``: the force on a leg in 3D by meshes of several sizes."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from legfem.common.command_line import command_context
from legfem.common.documents import markdown_table
from legfem.common.units import kpa_to_mpa
from legfem.experiments import leg_3d
from legfem.experiments.indentation import IndentationTest
from legfem.experiments.indenter_pose import Pose
from legfem.legs.finite_element_models import spatial_test
from legfem.legs.loading import load_subject
from legfem.legs.placement import spatial_leg
from legfem.mechanics.materials import Hyperelastic, NeoHookean, ReducedPolynomial
from legfem.mechanics.terms import Fascia, Fibres
from legfem.meshing.structured import LegMeshSettings
from studies.command_line import new_app
from studies.leg3d.planted import CYLINDER, LEG, Planted, round_shape

app = new_app()
SHOWN = np.array([1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0, 15.0, 20.0, 25.0, 30.0])
"""mm."""


def round_leg() -> leg_3d.LegIndentation3D:
    """Return the study's small leg, round, without its fascia and fibula."""
    pose = Pose((0.0, 0.0), 0.0, 90.0)
    return leg_3d.LegIndentation3D(round_shape(96, 9), CYLINDER, pose, _tissues(), Fascia())


def hexahedra(deep: Hyperelastic) -> leg_3d.IdealisedLegIndentation:
    """Return the same leg by hexahedra, so fine around the leg that flat facets don't matter."""
    leg = replace(LEG, fascia=0.0)
    mesh = LegMeshSettings(contact_size=1, depth_size=5, edge_size=2, growth=0.4, far_size=15)
    settings = replace(leg_3d.IdealisedLegSettings(), mesh=mesh)
    return leg_3d.IdealisedLegIndentation(leg, CYLINDER, {**_tissues(), "deep": deep}, 3, settings)


def _tissues() -> dict[str, Hyperelastic]:
    return {region: law for region, law in Planted().tissues.items() if region in ("deep", "superficial")}


def refined(test: leg_3d.LegIndentation3D, finer: float, contact: float) -> leg_3d.LegIndentation3D:
    """Return a test with all edges shorter by a factor, but those under the cylinder as given."""
    mesh = test.settings.mesh.refined(finer)
    return replace(test, settings=replace(test.settings, mesh=mesh, contact_size=contact))


def stiffened(test: leg_3d.LegIndentation3D, c10: float, c20: float, fibres: float) -> leg_3d.LegIndentation3D:
    """Return a test with muscle of C10 and C20 (kPa), its fibres' ratio given."""
    c10, deep = kpa_to_mpa(c10), test.tissues["deep"]
    law: Hyperelastic = NeoHookean(c10, deep.D1)
    if c20:
        law = ReducedPolynomial(c10, deep.D1, kpa_to_mpa(c20))
    own = () if fibres == 1 else (Fibres.of_ratio("deep", c10, fibres),)
    return replace(test, tissues={**test.tissues, "deep": law}, mechanisms=own)


def row(name: str, test: IndentationTest, depth: float) -> list[str]:
    """Return what a solution of a test took, how it balances, and its forces."""
    _ = test.pressing
    started = time.process_time()
    solved = test.solve(depth=depth)
    seconds = time.process_time() - started
    report, balance = solved.report, test.system.balance()
    # The planes that the ends stay in, and mirror planes, take forces too.
    whole = isinstance(test, leg_3d.LegIndentation3D)
    across = np.abs(balance.contact_force + balance.bone_reaction)[:2].max()
    off = across / np.abs(balance.contact_force).max()
    forces = [f"{solved.curve(d):.4f}" if d <= report.reached else "" for d in _shown(depth)]
    return [
        name,
        f"{report.unknowns:,}",
        f"{report.reached:.4g}",
        f"{len(report.steps)}",
        f"{report.factorisations}",
        f"{seconds:.0f}",
        f"{off:.0e}" if whole else "",
        *forces,
    ]


def _shown(depth: float) -> list[float]:
    return [float(d) for d in SHOWN if d <= depth]


@app.command()
def meshes(
    subject: Annotated[Path | None, typer.Option(help="Folder of a subject; a small round leg by default.")] = None,
    finer: Annotated[
        list[float] | None, typer.Option(min=0.1, help="Divides default sizes; may be given again.")
    ] = None,
    contact: Annotated[
        list[float] | None, typer.Option(min=0.1, help="Of elements under the cylinder (mm); may be given again.")
    ] = None,
    c10: Annotated[float, typer.Option(min=0.01, help="Of the deep tissue, kPa.")] = 1.0,
    c20: Annotated[float, typer.Option(min=0.0, help="Likewise.")] = 0.0,
    fibres: Annotated[float, typer.Option(min=1.0, help="Ratio of its shear moduli along the leg and across.")] = 1.0,
    depth: Annotated[float, typer.Option(min=1.0, help="mm.")] = 6.0,
) -> None:
    """Press a leg in 3D by meshes of several sizes; the round one by hexahedra, too. Simulated.

    Example: python -m studies.leg3d.meshes --subject DIR --contact 8 --contact 6 --depth 10
    """
    with command_context():
        factors, sizes = finer or [1.0], contact or [leg_3d.SolidLegSettings().contact_size]
        test = round_leg()
        if subject is not None:
            given = load_subject(subject, need_recordings=False, need_instrument=False)
            test = spatial_test(given, spatial_leg(given))
        test = stiffened(test, c10, c20, fibres)
        rows = [
            row(f"{size:g} mm, finer by {factor:g}", refined(test, factor, size), depth)
            for factor in factors
            for size in sizes
        ]
        if subject is None and fibres == 1:
            rows.append(row("hexahedra", hexahedra(test.tissues["deep"]), depth))
        header = ["elements", "unknowns", "mm reached", "steps", "factorisations", "processor s"]
        header += ["imbalance", *(f"N at {d:g} mm" for d in _shown(depth))]
        typer.echo(markdown_table(header, rows))


if __name__ == "__main__":
    app(prog_name="python -m studies.leg3d.meshes")
