"""``python -m studies.people``."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from legfem.common.command_line import end_without_a_solution, study_context
from legfem.common.documents import markdown_table, write_atomically, write_document
from legfem.common.progress import progress_on
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.inverse.population import TABLE, Population
from legfem.report.style import DATA_COLOUR, FAINT, REGION_COLOURS, panel, save, styled, titled
from studies.command_line import DONE_IS_KEPT, Jobs, Out, new_app, write_results
from studies.people import prediction
from studies.people.data import SITES, Indentations, read_indentations
from studies.people.population import BOUNDARY_SD_MM, Drawn, draw_population
from studies.people.probe import Losses, ProbeModel, ProbeResponse, points, solve_points, solved_for

TISSUES = {"superficial": "skin and fat", "deep": "muscle"}


@styled
def draw_stiffness(rows: Indentations, log_C10: FloatArray, site: str) -> Figure:
    """Draw C10 of both tissues of everyone at a site, of draws (k, n, 2) of its logarithm."""
    own = rows.site == rows.sites.index(site)
    figure = titled(
        9,
        3.8,
        f"Stiffness at the {SITES[site]}, each person with a 95 % interval",
        f"{len(rows.people)} people",
        "measured",
    )
    for k, (axes, (region, name)) in enumerate(zip(figure.subplots(1, 2), TISSUES.items(), strict=True)):
        low, middle, high = mpa_to_kpa(np.exp(np.quantile(log_C10[:, own, k], (0.025, 0.5, 0.975), axis=0)))
        order = np.argsort(middle)
        at = np.arange(len(order))
        axes.vlines(at, low[order], high[order], color=REGION_COLOURS[region], lw=2.5)
        axes.plot(at, middle[order], ".", color=DATA_COLOUR, ms=4)
        axes.set(yscale="log", xlabel="people, by their median", ylabel="C10 (kPa)")
        panel(axes, "AB"[k], name)
    return figure


@styled
def draw_predicted(rows: Indentations, compliance: FloatArray, predicted: prediction.Predicted) -> Figure:
    """Draw compliance as measured against that of mechanics and of springs, all left out."""
    what = "Compliance of people left out of the fit, by thickness alone"
    figure = titled(9, 4.6, what, f"{len(rows.people)} people", "measured")
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    _against(left, rows, compliance, predicted.best)
    panel(left, "A", "mechanics")
    _against(right, rows, compliance, prediction.left_out(rows, compliance, prediction.least_squares))
    panel(right, "B", "two linear springs by site")
    right.legend(fontsize=8, markerscale=1.5)
    return figure


def _against(axes: Axes, rows: Indentations, compliance: FloatArray, predicted: FloatArray) -> None:
    ends = np.quantile(compliance, (0.0, 1.0))
    axes.plot(ends, ends, color=FAINT, lw=0.8)
    for k, site in enumerate(rows.sites):
        own = rows.site == k
        axes.plot(predicted[own], compliance[own], "osv^Dp*X"[k], ms=3, alpha=0.7, label=SITES[site])
    axes.set(xscale="log", yscale="log", xlabel="predicted (mm/MPa)", ylabel="measured (mm/MPa)")


POINTS, CHECKED = 200, 30
SWEEPS, KEPT, THIN = 500, 300, 3
CALF = "LL_P"


@dataclass(frozen=True, eq=False)
class Found:
    """All that the study found."""

    model: ProbeModel
    rows: Indentations
    outside: int
    """Rows left out, for their thicknesses weren't solved for."""
    failed: int
    """Points that weren't solved."""
    emulator_error: tuple[float, float]
    """Root mean square at points it hasn't seen: of the force, relative; of the superficial
    strain over that of both."""
    drawn: Drawn
    predicted: prediction.Predicted
    errors: dict[str, FloatArray]
    """Mean absolute relative error of the compliance by site, of people left out, by method."""


def find(rows: Indentations, model: ProbeModel, folder: Path, jobs: int, seed: int) -> Found:
    """Solve the probe, fit the population, and predict everyone from the others."""
    with progress_on() as progress:
        asked = np.vstack([points(POINTS, 1), points(CHECKED, 2)])
        solved = solve_points(model, asked, folder / "solves", jobs, progress)
        if all(one.problem for one in solved):
            write_atomically(folder / "report.md", f"No point was solved: {solved[0].problem}\n")
            end_without_a_solution("people")
        response = ProbeResponse.through(asked[:POINTS], solved[:POINTS])
        force_error, share_error = response.error(asked[POINTS:], solved[POINTS:])
        inside = solved_for(rows)
        losses = Losses.of(rows.where(inside), response)
        used = losses.rows
        fits = []
        for with_thickness in (True, False):
            progress.stage("the population, and people left out", -(-len(used.people) // prediction.GROUP))
            drawn = draw_population(
                losses, KEPT, SWEEPS, np.random.default_rng(seed), thin=THIN, with_thickness=with_thickness
            )
            more = drawn.states[-1], seed, progress.advance, with_thickness
            fits.append((drawn, prediction.predict_left_out(losses, used.compliance, *more)))
    (drawn, predicted), (_, alike) = fits
    compliance = used.compliance
    by_method = {
        "mechanics": predicted.best,
        "mechanics, stiffness alike at any thickness": alike.best,
        "mechanics, no site told either": alike.without_site,
        "two springs": prediction.left_out(used, compliance, prediction.least_squares),
        "two springs, least relative error": prediction.left_out(used, compliance, prediction.least_share),
        "one number, no thickness": prediction.constant_left_out(used, compliance),
    }
    return Found(
        model,
        used,
        int((~inside).sum()),
        sum(bool(one.problem) for one in solved),
        (float(np.sqrt(np.mean(force_error**2))), float(np.sqrt(np.mean(share_error**2)))),
        drawn,
        predicted,
        {name: prediction.mean_error(used, compliance, made) for name, made in by_method.items()},
    )


def population_of(found: Found) -> dict[str, Any]:
    """Return medians (kPa), spreads and correlation of people, at each site and over all."""
    drawn, sites = found.drawn, found.rows.sites
    spread = drawn["spread"].mean(axis=0)

    def entry(centre: FloatArray, covariance: FloatArray) -> dict[str, Any]:
        # What a new person is: how people differ, and how well their middle is known.
        whole = covariance + np.cov(centre.T)
        sd = np.sqrt(np.diag(whole))
        return {
            **{
                name: {
                    "C10_median_kPa": float(mpa_to_kpa(np.exp(centre[:, k].mean()))),
                    "log_sd": float(sd[k]),
                    "log_sd_of_the_median": float(centre[:, k].std()),
                }
                for k, name in enumerate(TISSUES)
            },
            "correlation": float(whole[0, 1] / (sd[0] * sd[1])),
        }

    return {
        "all sites": entry(drawn["mean"], spread + drawn["between_sites"].mean(axis=0)),
        **{site: entry(drawn["site"][:, k], spread) for k, site in enumerate(sites)},
    }


def table_of(found: Found) -> Population:
    """Return the population as `legfem.inverse.population` ships it."""
    return Population(
        schema_version=1,
        source=f"{len(found.rows.people)} people of MULTIS (doi 10.18735/S5R97F), by python -m studies.people",
        people=len(found.rows.people),
        poisson_ratio=found.model.poisson_ratio,
        sites=population_of(found),
    )


def spreads_of(found: Found) -> dict[str, dict[str, float]]:
    """Return standard deviations of ln C10 between sites, people, and within a person."""
    return {
        name: dict(zip(TISSUES, np.sqrt(np.diag(found.drawn[field].mean(axis=0))).tolist(), strict=True))
        for name, field in (
            ("sites", "between_sites"),
            ("people, at all sites alike", "between_people"),
            ("a person's sites", "within"),
        )
    }


def people_table(found: Found) -> pd.DataFrame:
    """Return everyone's stiffness (kPa) with its 95 % interval, a row a person and site."""
    rows = found.rows
    low, middle, high = mpa_to_kpa(np.exp(np.quantile(found.drawn["theta"], (0.025, 0.5, 0.975), axis=0)))
    table = {
        "person": [rows.people[k] for k in rows.person],
        "site": [rows.sites[k] for k in rows.site],
        "superficial_mm": rows.superficial,
        "deep_mm": rows.deep,
    }
    for k, name in enumerate(TISSUES):
        table |= {f"{name}_C10_kPa": middle[:, k], f"{name}_C10_low_kPa": low[:, k], f"{name}_C10_high_kPa": high[:, k]}
    return pd.DataFrame(table).sort_values(["site", "person"])


def errors_table(found: Found) -> str:
    """Return the table of prediction errors, in Markdown."""
    names = [*(SITES[site] for site in found.rows.sites), "mean of sites"]
    columns = [[*errors, errors.mean()] for errors in found.errors.values()]
    lines = [[name, *(f"{100 * column[k]:.1f}" for column in columns)] for k, name in enumerate(names)]
    return markdown_table(["error, %", *found.errors], lines)


def population_table(found: Found) -> str:
    """Return the population's table, in Markdown."""
    lines = []
    for site, entry in population_of(found).items():
        line = [SITES.get(site, site)]
        for name in TISSUES:
            median, sd, own = (entry[name][key] for key in ("C10_median_kPa", "log_sd", "log_sd_of_the_median"))
            line += [
                f"{median:.2f} ({median * np.exp(-1.96 * own):.2f} to {median * np.exp(1.96 * own):.2f})",
                f"{sd:.2f}",
                f"{median * np.exp(-1.96 * sd):.2g} to {median * np.exp(1.96 * sd):.2g}",
            ]
        lines.append(line)
    header = ["site"]
    for name in ("fat", "muscle"):
        header += [f"{name}: median C10 (kPa)", "sd of ln C10", "95 % of people (kPa)"]
    return markdown_table(header, lines)


def unpredictable(found: Found) -> dict[str, float]:
    """Return how well thickness predicts at all."""
    rows, predicted = found.rows, found.predicted
    compliance = rows.compliance
    off, own = np.log(compliance / predicted.best), np.log(compliance)
    left = [np.var(off[rows.site == k]) for k in range(len(rows.sites))]
    all_of = [np.var(own[rows.site == k]) for k in range(len(rows.sites))]
    read = (BOUNDARY_SD_MM / (rows.superficial_loss + rows.deep_loss)) ** 2
    within = (compliance > predicted.low) & (compliance < predicted.high)
    return {
        "expected_of_the_population_percent": 100 * float(predicted.expected_error.mean()),
        "share_of_variance_not_of_thickness": float(np.mean(left) / np.mean(all_of)),
        "share_of_variance_of_reading_images": float(np.median(read) / np.mean(all_of)),
        "share_within_90_percent_intervals": float(within.mean()),
    }


def run(data: Path, model: ProbeModel, out: Path, jobs: int, seed: int) -> None:
    """Study the people; print tables, and write result, table and figures."""
    started = time.process_time()
    rows = read_indentations(data)
    out.mkdir(parents=True, exist_ok=True)
    found = find(rows, model, out, jobs, seed)
    used, told = found.rows, unpredictable(found)
    text = "\n".join(
        [
            f"{len(used)} rows of {len(used.people)} people; {found.outside} lie outside of what was "
            f"solved, {found.failed} of {POINTS + CHECKED} points weren't solved; emulator's error "
            f"{100 * found.emulator_error[0]:.2f} % of the force, {found.emulator_error[1]:.3f} of "
            "the superficial strain's ratio",
            "",
            errors_table(found),
            "; ".join(f"{name.replace('_', ' ')} {value:.3g}" for name, value in told.items()),
            "",
            population_table(found),
            "\n".join(
                f"sd of ln C10 between {name}: fat {sd['superficial']:.2f}, muscle {sd['deep']:.2f}"
                for name, sd in spreads_of(found).items()
            ),
            "",
            "C10 goes with the power of thickness (mean of sites; rows by thickness, columns by C10): "
            + np.array2string(found.drawn["mean_slope"].mean(axis=0), precision=2)
            + " +- "
            + np.array2string(found.drawn["mean_slope"].std(axis=0), precision=2),
        ]
    )
    write_atomically(out / "people.csv", people_table(found).to_csv(index=False, float_format="%.4g"))
    if CALF in used.sites:
        save(draw_stiffness(used, found.drawn["theta"], CALF), out, "stiffness")
    save(draw_predicted(used, used.compliance, found.predicted), out, "predicted")
    write_document(out / TABLE.name, table_of(found).model_dump())
    write_results(
        out,
        {
            "origin": "measured",
            "model": {"poisson_ratio": model.poisson_ratio, "face": model.face},
            "rows": len(used),
            "people": len(used.people),
            "emulator_error": {"force": found.emulator_error[0], "share": found.emulator_error[1]},
            "error_percent": {
                name: dict(zip((*used.sites, "mean"), 100 * np.append(errors, errors.mean()), strict=True))
                for name, errors in found.errors.items()
            },
            "unpredictable": told,
            "population": population_of(found),
            "log_sd": spreads_of(found),
            "cpu_s": time.process_time() - started,
        },
        text + "\n",
    )


app = new_app()


@app.command()
def people(
    data: Annotated[Path, typer.Option(help="Folder with indentation.csv, the table of MULTIS.")] = Path(
        "../shared/data/multis_in_vivo"
    ),
    poisson_ratio: Annotated[
        float, typer.Option(min=0.3, max=0.4999, help="Of both tissues, which isn't known.")
    ] = 0.49,
    sliding: Annotated[bool, typer.Option("--sliding", help="Let the skin slide and stretch under the probe.")] = False,
    seed: Annotated[int, typer.Option(help="Of the draws.")] = 0,
    out: Out = None,
    jobs: Jobs = None,
) -> None:
    """Fit fat and muscle of living people, and predict each person from the others.

    Solutions are kept as they are done: the same command goes on where it was stopped.

    Example: python -m studies.people --data ../shared/data/multis_in_vivo
    """
    with study_context("people", out, jobs, DONE_IS_KEPT) as (folder, processes):
        model = ProbeModel(poisson_ratio, "frictionless" if sliding else "rough")
        run(data, model, folder, processes, seed)


if __name__ == "__main__":
    app(prog_name="python -m studies.people")
