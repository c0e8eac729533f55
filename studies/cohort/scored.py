"""``python -m studies.cohort.scored``: what `legfem cohort` says of the simulated people, beside the truth."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer

from legfem.cohort.anomalies import drifts
from legfem.cohort.members import Member
from legfem.cohort.rows import Judged, Measure, ModelResult, Row
from legfem.cohort.statistics import statistics
from legfem.common.command_line import study_context
from legfem.common.documents import json_types, markdown_table
from legfem.common.units import FloatArray
from studies.cohort.simulated import BROKEN, EXCHANGED, LUMPY, Spread, Tested, drawn_people, table_of
from studies.command_line import DONE_IS_KEPT, Out, Seed, new_app, write_results

app = new_app()
KEY, LAW = "c10_deep", "neo-hookean"
SOURCES = ("people", "legs_of_a_person", "tests_of_a_leg")
_COLUMN = "neo_hookean_c10_deep"


def errors_found(table: pd.DataFrame, tests: Sequence[Tested]) -> FloatArray:
    """Return the error of ln C10, its standard error and whether its interval holds the truth, (n, 3).

    Of tests that nothing was done to (no drift, no exchanged sides, nothing hidden or broken) and whose model fits.
    """
    person, session = EXCHANGED
    touched = {LUMPY, *BROKEN, *(f"{person}/{side}-{session}" for side in ("left", "right"))}
    rows = table.set_index("member")
    found = []
    for one in tests:
        if one.drifted or one.folder in touched or one.folder not in rows.index:
            continue
        if rows.loc[one.folder, "judgement"] == "wrong":
            continue
        value, low, high, sd = (
            float(rows.loc[one.folder, f"{_COLUMN}{part}_kPa"]) for part in ("", "_low", "_high", "_standard_error")
        )
        found.append((np.log(value / one.c10), sd / value, low <= one.c10 <= high))
    return np.array(found, dtype=np.float64)


def redrawn(tests: Sequence[Tested], errors: FloatArray, drift: float, seed: int) -> tuple[list[Member], list[Row]]:
    """Return members and rows whose C10 err as those that were fitted did; nothing is fitted."""
    generator = np.random.default_rng([seed, 7])
    given = table_of(tests).set_index("folder").to_dict("index")
    members, rows = [], []
    for one, (error, sd, _) in zip(tests, errors[generator.integers(len(errors), size=len(tests))], strict=True):
        value = one.c10 * float(np.exp(error)) * (drift if one.drifted else 1.0)
        known = {name: str(said) for name, said in given[one.folder].items()}
        members.append(Member(one.folder, Path("/nowhere"), known["subject"], known))
        half = 1.96 * sd
        measure = Measure(value, value * np.exp(-half), value * np.exp(half), sd * value, "kPa", "identifiable")
        models = {LAW: ModelResult({KEY: measure})}
        rows.append(Row(one.folder, judged=Judged("sound", "", (), LAW), models=models))
    return members, rows


def truths(spread: Spread, errors: FloatArray) -> dict[str, float]:
    """Return what statistics should find of C10's logarithm, groups apart and together."""
    groups = np.log(spread.patients)
    between = spread.people**2 + spread.legs**2 + 0.25 * groups**2
    within = spread.tests**2 + float(np.var(errors[:, 0]))
    sds = dict(zip(SOURCES, (spread.people, spread.legs, spread.tests), strict=True))
    return {**sds, "group": float(groups), "icc": between / (between + within)}


def intervals_of(document: Mapping[str, Any]) -> dict[str, tuple[float, float, float]]:
    """Return value and 95 % interval by the names of `truths`, from a cohort's statistics."""
    (one,) = (one for one in document["parameters"] if one["name"] == KEY)
    fitted, (repeated,) = one["fitted"], (each for each in one["repeated"] if each["by"] == "session")
    found = {name: (sd, *ends) for name, sd, ends in zip(SOURCES, fitted["sd"], fitted["sd95"], strict=True)}
    (group,) = (effect for effect in one["effects"] if effect["of_group"])
    found["group"] = (group["value"], group["low"], group["high"])
    return {**found, "icc": (repeated["agreement"]["icc"], *repeated["agreement"]["icc95"])}


@app.command()
def scored(
    found: Annotated[Path, typer.Argument(help="Results of legfem cohort on the simulated study.")],
    people: Annotated[int, typer.Option(min=34, help="As of the study.")] = 60,
    draws: Annotated[int, typer.Option(min=1, help="Cohorts drawn anew.")] = 20,
    seed: Seed = 1,
    out: Out = None,
) -> None:
    """Compare a simulated cohort's results with the truth, and draw its people anew.

    Example: python -m studies.cohort.scored results/sixty-found
    """
    with study_context("cohort-scored", out, 1, DONE_IS_KEPT) as (folder, _):
        spread = Spread()
        tests = drawn_people(people, spread, seed)
        document = json.loads((found / "cohort.json").read_text(encoding="utf-8"))
        table = pd.read_csv(found / "cohort.csv")
        errors = errors_found(table, tests)
        true = truths(spread, errors)
        own = intervals_of(document["statistics"])
        inside = dict.fromkeys(true, 0)
        noticed = alarms = 0
        for k in range(draws):
            anew = drawn_people(people, spread, 1000 + seed + k)
            members, rows = redrawn(anew, errors, 1.0, k)
            said = intervals_of(json_types(statistics(members, rows)))
            for name, (_, low, high) in said.items():
                inside[name] += low <= true[name] <= high
            alarms += any(True for _ in drifts(members, rows))
            members, rows = redrawn(anew, errors, spread.drift, k)
            noticed += any(True for _ in drifts(members, rows))
        header = ["of ln C10", "truth", "found (95 %)", f"interval holds the truth, {draws} draws"]
        lines = [
            [name, f"{true[name]:.3g}", f"{at:.3g} ({low:.3g} to {high:.3g})", f"{inside[name]}"]
            for name, (at, low, high) in own.items()
        ]
        off, sd, held = errors.T
        text = markdown_table(header, lines) + (
            f"\n{len(off)} tests that nothing was done to and that fit: ln C10 is {off.mean():+.3f} off in the mean, "
            f"with a standard deviation of {off.std():.3f}; own standard errors are {np.sqrt(np.mean(sd**2)):.3f}, "
            f"errors over them {np.sqrt(np.mean((off / sd) ** 2)):.2f} (root mean square); {held.sum():.0f} of the "
            "intervals hold the truth.\n"
            f"A drift of {100 * (spread.drift - 1):.0f} % is pointed out in {noticed} of {draws} draws, and "
            f"one that isn't there in {alarms}.\n"
            "The cohort itself says:\n" + "".join(f"- {one['sentence']}\n" for one in document["suspicions"])
        )
        write_results(
            folder, {"truth": true, "found": own, "inside": inside, "drifts": noticed, "alarms": alarms}, text
        )


if __name__ == "__main__":
    app(prog_name="python -m studies.cohort.scored")
