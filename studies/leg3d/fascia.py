"""``python -m studies.leg3d.fascia``: a fascia as a layer of hexahedra and as a membrane.

Both press the study's leg; what the membrane leaves out is put back step by step. Simulated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated

import typer

from legfem.common.command_line import command_context
from legfem.common.documents import markdown_table
from legfem.experiments import leg_3d
from legfem.experiments.indentation import IndentationTest
from legfem.experiments.indenter_pose import Pose
from legfem.geometry.motion import without_layer
from legfem.mechanics.materials import Hyperelastic, NeoHookean
from legfem.mechanics.terms import Fascia
from studies.command_line import new_app
from studies.leg3d.planted import CYLINDER, LEG, MESH, Planted, round_shape

app = new_app()
SHOWN = (2.0, 3.0, 4.0, 5.0, 6.0, 7.0)
"""mm."""
CONTACT = 4.5
"""Of the tetrahedra under the cylinder, mm."""


def layer(thinner: float = 1.0, finer: float = 1.0, c10: float = 1.2) -> leg_3d.IdealisedLegIndentation:
    """Return the leg by hexahedra; a thinner fascia is as much stiffer, about the same middle."""
    own = Planted(c10).tissues
    fascia = own["fascia"]
    tissues = {**own, "fascia": NeoHookean(fascia.C10 * thinner, fascia.D1 / thinner)}
    less = LEG.fascia * (1 - 1 / thinner)
    leg = replace(LEG, fascia=LEG.fascia - less, fat=LEG.fat + less / 2)
    settings = replace(leg_3d.IdealisedLegSettings(), mesh=MESH.refined(finer))
    return leg_3d.IdealisedLegIndentation(leg, CYLINDER, tissues, 3, settings)


def membrane(
    own_law: bool = True, taken_out: bool = True, finer: float = 1.0, fibula: bool = False
) -> leg_3d.LegIndentation3D:
    """Return the leg by tetrahedra: by its fascia's own law, or incompressible, and so on."""
    shape = round_shape(120, 5, fibula)
    tissues = Planted().tissues
    sheet = leg_3d.membrane_of(tissues["fascia"], LEG.fascia)
    default = leg_3d.SolidLegSettings()
    settings = replace(default, mesh=default.mesh.refined(finer), contact_size=CONTACT)
    laws: dict[str, Hyperelastic] = {part: tissues[part] for part in ("deep", "superficial")}
    return leg_3d.LegIndentation3D(
        without_layer(shape, LEG.fascia) if taken_out else shape,
        CYLINDER,
        Pose((0.0, 0.0), 0.0, 90.0),
        laws,
        sheet if own_law else Fascia(sheet.stiffness),
        settings,
    )


ROWS: dict[str, Callable[[], IndentationTest]] = {
    "layer of 0.6 mm": layer,
    "the same, finer by 1.5": lambda: layer(finer=1.5),
    "0.3 mm, twice as stiff": lambda: layer(2.0),
    "0.15 mm, four times": lambda: layer(4.0),
    "0.6 mm, muscle's C10 1.32": lambda: layer(c10=1.32),
    "membrane, incompressible": lambda: membrane(own_law=False, taken_out=False),
    "membrane, its own law": lambda: membrane(taken_out=False),
    "its own law, layer taken out": membrane,
    "the same, finer by 1.5 elsewhere": lambda: membrane(finer=1.5),
    "with a fibula": lambda: membrane(fibula=True),
}


@app.command()
def fascia(
    number: Annotated[
        list[int] | None,
        typer.Option(min=1, max=len(ROWS), help="Of a row, from 1; may be given again. All by default."),
    ] = None,
) -> None:
    """Press a small round leg by a layer and by membranes. Simulated.

    Example: python -m studies.leg3d.fascia --number 1 --number 8
    """
    with command_context():
        chosen = number or range(1, len(ROWS) + 1)
        rows = []
        for k in chosen:
            name, made = list(ROWS.items())[k - 1]
            solved = made().solve(depth=SHOWN[-1])
            rows.append([name, *(f"{solved.curve(d):.4f}" for d in SHOWN)])
        typer.echo(markdown_table(["fascia", *(f"N at {d:g} mm" for d in SHOWN)], rows))


if __name__ == "__main__":
    app(prog_name="python -m studies.leg3d.fascia")
