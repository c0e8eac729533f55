"""``python -m studies.leg3d.fibres``: whether one test or two tell a leg's fibres."""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import typer

from legfem.common.command_line import command_context
from legfem.common.documents import markdown_table
from legfem.common.progress import Progress, progress_on
from legfem.experiments.leg_3d import SolidLegSettings
from legfem.inverse.catalogue import DEEP_C10, DEEP_RATIO, parameter_of
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import Goodness
from legfem.inverse.settings import SearchRequest
from legfem.jobs.store import Store
from legfem.legs.details import SpatialSites
from legfem.legs.identification import fit_in_3d
from legfem.legs.loading import load_sites
from legfem.legs.model_3d import leg_models, start_of_ratio
from legfem.legs.problem import pressed_depth
from legfem.meshing.leg_sizes import SolidMeshSettings
from studies.cases.outcomes import Interval
from studies.command_line import new_app
from studies.leg3d.orientations import FINE, WAYS, sited_folder
from studies.leg3d.planted import Planted

ROUGH = SolidLegSettings(
    mesh=SolidMeshSettings(
        skin_size=30.0,
        inside_size=40.0,
        bone_size=20.0,
        layer_elements=0.2,
        turn_elements=4.0,
        growth=0.5,
        enclosing=True,
    ),
    contact_size=5.0,
)
"""Of the identification's tetrahedra: a third of the default's unknowns."""
ELEMENTS = {"rough": ROUGH, "default": SolidLegSettings()}
"""Of the identification."""
type Tests = Literal["along", "along and across"]
TESTS: dict[Tests, tuple[str, ...]] = {"along": ("along",), "along and across": tuple(WAYS)}

app = new_app()


@dataclass(frozen=True)
class Told:
    """What is said of a parameter, C10 in kPa."""

    interval: Interval
    word: str

    def row(self, truth: float) -> list[str]:
        """Return the estimate with its interval, and whether that holds the truth."""
        one = self.interval
        covers = "yes" if one.covers(truth) else "no"
        return [f"{one.value:.3g} ({one.low:.3g} to {one.high:.3g})", covers, self.word]


@dataclass(frozen=True)
class FibreResult:
    """What was found of one leg."""

    c10: Told
    ratio: Told
    untold: bool
    misfit: Goodness
    """Of all forces, over as many degrees of freedom."""
    converged: bool
    full_solves: int
    processor_s: float


def found_of(planted: Planted, tests: Tests, elements: str, seed: int, out: Path, progress: Progress) -> FibreResult:
    """Return what is found of a planted leg; it is kept, and so is every solve."""

    def made() -> FibreResult:
        started = time.process_time()
        place = out / "legs" / f"{planted.name}-{len(TESTS[tests])}-{elements}-{seed}"
        place.parent.mkdir(parents=True, exist_ok=True)
        leg = load_sites(sited_folder(planted, TESTS[tests], place, seed, out / "planted"))
        assert leg is not None
        nominal = {DEEP_C10: 1e-3, DEEP_RATIO: start_of_ratio(leg.sites[0])}
        asked = tuple(parameter_of(name, nominal) for name in nominal)
        # Solves in 3D are shared by all that press alike.
        request = SearchRequest(asked, out=out, progress=progress)
        depths = [pressed_depth(site, request, with_offset=False) for site in leg.sites]
        models = leg_models(leg, depths, request, ELEMENTS[elements])
        request = replace(request, out=out / "solves" / place.name)
        (result,) = fit_in_3d(leg, ["neo-hookean"], request, models=models)
        spatial = result.details.spatial
        assert isinstance(spatial, SpatialSites)
        found = FibreResult(
            _told(result.estimates[DEEP_C10]),
            _told(result.estimates[DEEP_RATIO]),
            bool(spatial.untold),
            result.goodness,
            result.log.converged,
            spatial.full_solves,
            time.process_time() - started,
        )
        del models, result
        gc.collect()
        return found

    store = Store(out / "found", FibreResult, modules=(__name__,))
    return store.get_or_make((planted, tests, elements, seed), made)


def _told(one: Estimate) -> Told:
    return Told(Interval.of(one), one.identifiability)


HEADER = [
    "ratio",
    "tests",
    "C10 (kPa)",
    "covers",
    "word",
    "ratio found",
    "covers",
    "word",
    "said that it can't be told",
    "chi-square (degrees)",
    "full 3D solves",
    "processor s",
]


@app.command()
def fibres(
    ratio: Annotated[
        list[float] | None, typer.Option(help="Planted; 1, 2 and 3 by default; as often as wanted.")
    ] = None,
    c10: Annotated[float, typer.Option(min=0.05, help="Planted, kPa.")] = 1.2,
    tests: Annotated[list[Tests] | None, typer.Option(help="along, or 'along and across'; both by default.")] = None,
    elements: Annotated[
        Literal["rough", "default"], typer.Option(help="Of the identification; default: some four times the work.")
    ] = "rough",
    draws: Annotated[int, typer.Option(min=1, help="Of the lab's errors, for every leg.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Of the lab's errors.")] = 1,
    out: Annotated[Path, typer.Option(help="Folder; goes on from what is there.")] = Path("results/leg3d-fibres"),
) -> None:
    """Press a small round leg along and across, and look for its fibres. Simulated.

    Example: python -m studies.leg3d.fibres --ratio 2 --tests "along and across"
    """
    with command_context("run the same command again to go on"), progress_on() as progress:
        rows, held = [], []
        for one in ratio or [1.0, 2.0, 3.0]:
            planted = Planted(c10, 0.0, one, mesh=FINE)
            for name in tests or TESTS:
                for draw in range(draws):
                    found = found_of(planted, name, elements, seed + draw, out, progress)
                    cells = [*found.c10.row(c10), *found.ratio.row(one)]
                    rows.append(
                        [
                            f"{one:g}",
                            name,
                            *cells,
                            "yes" if found.untold else "no",
                            f"{found.misfit.chi_square:.0f} ({found.misfit.degrees_of_freedom})",
                            f"{found.full_solves}{'' if found.converged else ', not converged'}",
                            f"{found.processor_s:.0f}",
                        ]
                    )
                    held += [cells[1] == "yes", cells[4] == "yes"]
        typer.echo(markdown_table(HEADER, rows))
        typer.echo(f"{sum(held)} of {len(held)} intervals hold what was planted.")


if __name__ == "__main__":
    app(prog_name="python -m studies.leg3d.fibres")
