"""How an identification was done and how well its laws fit, for who checks it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from legfem.common.units import mpa_to_kpa
from legfem.identify.result import IdentificationResult
from legfem.legs.details import SpatialEvidence
from legfem.legs.subject import Subject
from legfem.mechanics.materials import Hyperelastic
from legfem.report.style import LAW_NAMES
from legfem.report.web.estimates import how_found
from legfem.report.web.page import Block, Prose, WebTable
from legfem.report.words import fit_probability

_AT = (5.0, 15.0, 25.0)
"""mm."""
_TISSUES = ("deep", "superficial", "fascia")
_WEIGHTINGS = {
    "paper": "every point counts alike, as in the paper",
    "covariance": "points count by the inverse of the curve's covariance",
}


def how_done(results: Sequence[IdentificationResult], subject: Subject) -> list[Block]:
    """Return what was done: each law's search and fit, the tissues, what corrected the force."""
    first = results[0]
    blocks: list[Block] = [
        Prose(f"{_procedure(first, subject)} {_compared(first)}"),
        *how_found(results),
        WebTable(
            f"How well each law fits; E is the {first.cost.definition}",
            ["", *(LAW_NAMES[result.law] for result in results)],
            [[name, *(_statistics(r)[name] for r in results)] for name in _statistics(first)],
        ),
        WebTable("Tissues at the optimum", *_tissues(results, subject)),
    ]
    every = [_tissue(name, result) for name in _TISSUES for result in results]
    if any(found is not None and found[0].poisson_ratio < 0 for found in every):
        blocks.append(
            Prose(
                "A Poisson's ratio below zero follows from the C10 and D1 given: the published "
                "values of the fascia are such."
            )
        )
    blocks += [block for result in results for block in _corrected(result)]
    return blocks


def _procedure(result: IdentificationResult, subject: Subject) -> str:
    measured, indenter = result.measured, subject.indenter
    correction = (
        f"with the 3D correction {result.correction.name}"
        if result.correction
        else "without a correction for 3D effects"
    )
    searched = (
        "an emulator of the model, which full solves refined and confirmed"
        if result.settings.get("emulator", True)
        else "the full model itself"
    )
    return (
        f"The recordings ({measured.n_trials} trial{'s' * (measured.n_trials > 1)}) are of a "
        f"rigid {indenter}, "
        "pressed into the calf. Their loading was brought to one mean curve with its errors, "
        f"{len(measured.displacement)} points to {measured.displacement[-1]:g} mm after first "
        "contact. A plane-strain finite-element model of the section gives the force per length, "
        f"taken times the cylinder's length, {correction}. {_searcher(result)} searched for "
        f"{_sought(result)} on {searched}. What was recorded in unloading or at rest was not used."
    )


def _compared(result: IdentificationResult) -> str:
    grid = result.measured.displacement
    return (
        f"Model and mean curve were compared at {result.cost.points} points, every "
        f"{grid[1] - grid[0]:.3g} mm to {grid[-1]:.4g} mm; {_WEIGHTINGS[result.weighting]}."
    )


def _sought(result: IdentificationResult) -> str:
    if all(name.startswith("deep.") for name in result.parameters):
        return "the deep tissue's parameters"
    return ", ".join(result.parameters)


def _searcher(result: IdentificationResult) -> str:
    own = result.settings.get("genetic", {}).get("minimiser")
    return "A genetic algorithm (pygad)" if own is None else f"A search of the user's ({own})"


def _statistics(result: IdentificationResult) -> dict[str, str]:
    cost = result.cost
    degrees, chance = cost.degrees_of_freedom, fit_probability(cost.p_value)
    error = result.emulator_error
    return {
        "E (N2)": f"{cost.value:.6g}",
        "E per length ((N/mm)2)": f"{cost.per_length:.6g}",
        "mean of squares (N2)": f"{cost.mean_square:.6g}",
        "minimised": f"{cost.minimised}; {cost.minimised_value:.6g} at the optimum",
        "rms difference (N)": f"{cost.rms:.4g}",
        "R2": f"{cost.r_squared:.6f}",
        "chi-square": f"{cost.chi_square:.5g} on {degrees} degrees of freedom; {chance}",
        "factorisations": f"{result.factorisations}",
        "emulator's error, against the last full solve (N)": "no emulator" if math.isnan(error) else f"{error:.3g}",
    }


def _tissues(results: Sequence[IdentificationResult], subject: Subject) -> tuple[list[str], list[list[str]]]:
    header = ["tissue", "law", "C10 (kPa)", "C10 is", "D1 (1/MPa)", "K/mu", "Poisson's ratio"]
    rows = []
    for name in _TISSUES:
        for result in results:
            found = _tissue(name, result)
            if found is None:
                continue
            tissue, known = found
            law = result.law if name == "deep" else subject.tissues[name].law
            row = [
                name,
                LAW_NAMES[law],
                f"{mpa_to_kpa(tissue.C10):.4g}",
                known,
                f"{tissue.D1:.4g}",
                f"{tissue.bulk_modulus / tissue.shear_modulus:.3g}",
                f"{tissue.poisson_ratio:.3f}",
            ]
            if row not in rows:
                rows.append(row)
    return header, rows


def _tissue(name: str, result: IdentificationResult) -> tuple[Hyperelastic, str] | None:
    """Return a tissue's compressible part at the optimum, and how its C10 is known.

    None where the model that was searched with hasn't the tissue.
    """
    every = {**result.assumed, **result.values}
    if not {f"{name}.C10", f"{name}.D1"} <= every.keys():
        return None
    found = result.parameters.get(f"{name}.C10")
    known = "assumed" if found is None else found.parameter.role
    return Hyperelastic(C10=every[f"{name}.C10"], D1=every[f"{name}.D1"]), known


def _corrected(result: IdentificationResult) -> list[Block]:
    """Return what corrected a law's force, how well that is known, and what confirmed it."""
    applied, spatial = result.correction, result.spatial
    if applied is None:
        return []
    grid = result.measured.displacement
    depths = [d for d in _AT if grid[0] <= d <= grid[-1]] or [float(grid[-1])]
    header = ["at (mm)", "P, with the sd that the intervals carry"]
    rows = [
        [f"{d:.3g}", f"{np.interp(d, grid, applied.P):+.2f} ± {np.interp(d, grid, applied.sd):.2f}"] for d in depths
    ]
    if spatial is not None and spatial.table_P is not None:
        header.append("P of the table of idealised legs")
        for row, d in zip(rows, depths, strict=True):
            row.append(f"{np.interp(d, grid, spatial.table_P):+.2f}")
    caption = f"3D correction {applied.name}, {LAW_NAMES[result.law]} law: force = (1 - P) x plane"
    blocks: list[Block] = [WebTable(f"{caption} strain", header, rows)]
    return blocks if spatial is None else [*blocks, *_confirmed(spatial)]


def _confirmed(found: SpatialEvidence) -> list[Block]:
    """Return what the leg's own solves in 3D say."""
    errors = ", ".join(f"{name} {value:.3f}" for name, value in found.errors.items())
    return [
        WebTable(
            f"Full solves of the leg in 3D ({found.shape})",
            ["C10 (kPa)", "C20 (kPa)", "force off the predicted (%)", "C10 then moved (%)", "s"],
            [
                [
                    f"{one.c10:.3g}",
                    f"{one.c20:.3g}",
                    f"{100 * one.error:.2g}",
                    f"{100 * one.moved:.2g}",
                    f"{one.seconds:.0f}",
                ]
                for one in found.confirmations
            ],
        ),
        Prose(f"Greatest error of P by cause: {errors}."),
    ]
