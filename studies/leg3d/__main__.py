"""``python -m studies.leg3d``: a leg recorded in 3D, identified by both models."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from legfem.common.command_line import study_context
from legfem.common.documents import markdown_table, write_atomically
from legfem.common.errors import InputError
from legfem.common.progress import Progress, progress_on
from legfem.common.units import mpa_to_kpa
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.elastography import HIGHEST_RATIO
from legfem.legs.details import SpatialEvidence
from studies.cases.outcomes import Interval
from studies.command_line import Out, new_app, write_results
from studies.leg3d.other_code import PlantedByFelupe
from studies.leg3d.planted import Planted
from studies.leg3d.plants import HEADER, counted, drawn, identified, plant_result, plant_row

app = new_app()


Code = Literal["legfem", "felupe"]
_BY: dict[Code, type[Planted]] = {"legfem": Planted, "felupe": PlantedByFelupe}
"""Whose hexahedra record the small leg."""


def _many(numbers: range, seed: int, folder: Path, progress: Progress, code: Code) -> list[str]:
    of = _BY[code]
    legs = [of(one.c10, one.c20) for one in (drawn(number, seed) for number in numbers)]
    found = [plant_result(leg, seed + k, folder, progress) for k, leg in zip(numbers, legs, strict=True)]
    rows = [plant_row(k + 1, leg, one) for k, leg, one in zip(numbers, legs, found, strict=True)]
    return [markdown_table(HEADER, rows), counted(legs, found)]


@app.command()
def leg3d(
    c10: Annotated[float, typer.Option(min=0.1, help="Planted, kPa.")] = Planted.c10,
    c20: Annotated[float, typer.Option(min=0.0, help="Planted, kPa.")] = Planted.c20,
    fibres: Annotated[
        float, typer.Option(min=1.0, max=HIGHEST_RATIO, help="Muscle's shear modulus along over across.")
    ] = Planted.fibres,
    seed: Annotated[int, typer.Option(min=0, help="Of the lab's errors.")] = 1,
    plants: Annotated[int, typer.Option(min=0, help="So many legs of random C10 and C20 in its place.")] = 0,
    code: Annotated[Code, typer.Option(help="Whose hexahedra record the small leg.")] = "legfem",
    out: Out = None,
) -> None:
    """Identify a leg, pressed in 3D by other elements, with `--model 3d` and `--model 2d`.

    Solutions are kept as they are done: the same command goes on where it was stopped.

    Example: python -m studies.leg3d --c10 1.2
    """
    with study_context("leg3d", out) as (folder, _), progress_on() as progress:
        if plants:
            if (c10, c20, fibres) != (Planted.c10, Planted.c20, Planted.fibres):
                remedy = "leave --c10, --c20 and --fibres, or it, out"
                raise InputError("leg3d", "--plants", "draws the small leg's C10 and C20", remedy)
            lines = _many(range(plants), seed, folder, progress, code)
            write_atomically(folder / "plants.md", "\n".join(lines) + "\n")
            typer.echo("\n".join(lines))
            return
        planted = _BY[code](c10, c20, fibres)
        results = identified(planted, seed, folder, progress)
        rows = []
        for name, result in results.items():
            one = Interval.of(result.estimates[DEEP_C10])
            off, held = f"{100 * (one.value / c10 - 1):+.1f} %", "yes" if one.covers(c10) else "no"
            rows.append([name, f"{one.value:.3f}", f"{one.low:.3f} to {one.high:.3f}", off, held])
        table = markdown_table(["model", "C10 (kPa)", "95 %", "off by", "covers"], rows)
        evidence = results["3d"].details.spatial
        assert isinstance(evidence, SpatialEvidence)
        steps = [
            f"C10 {mpa_to_kpa(one.c10):.3f} kPa: force {100 * one.error:.2f} % off what was predicted, C10 "
            f"then moved by {100 * one.moved:.2f} %; {one.factorisations} factorisations, "
            f"{one.seconds:.0f} s"
            for one in evidence.confirmations
        ]
        errors = [f"{name}: {value:.4f}" for name, value in evidence.errors.items()]
        lines = [
            table,
            f"Planted: C10 {c10:g}, C20 {c20:g} kPa, fibres' ratio {fibres:g}; simulated by {code}'s hexahedra.",
            *steps,
            f"Full solves in 3D: {evidence.full_solves}, rougher ones: {evidence.rough_solves}.",
            "Greatest error of P by cause: " + ", ".join(errors) + ".",
        ]
        document = {
            "c10_kPa": c10,
            "c20_kPa": c20,
            "fibre_ratio": fibres,
            "code": code,
            "seed": seed,
            "rows": rows,
            "confirmations": steps,
            "errors": errors,
        }
        write_results(folder, document, "\n".join(lines) + "\n")


if __name__ == "__main__":
    app(prog_name="python -m studies.leg3d")
