"""Identification results with known numbers, for the tests of what is made of them."""

from __future__ import annotations

import math
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from making import press, write_subject

from legfem.data import Instrument, LoadingCurve, mean_loading_curve, segment_all
from legfem.inverse.answer import Notice
from legfem.inverse.catalogue import parameter_of
from legfem.inverse.document import fit_document
from legfem.inverse.estimates import Estimate
from legfem.inverse.fit import EXACT, ChannelFit, Cost, Fit, Goodness, Identity
from legfem.inverse.trial import FullSolve, SearchLog
from legfem.legs.details import AppliedCorrection, LegDetails, SpatialEvidence
from legfem.legs.identification import as_leg
from legfem.legs.loading import load_subject
from legfem.legs.notices import LegNotice
from legfem.legs.site import SiteFit, mean_force
from legfem.legs.subject import Subject

INSTRUMENT = Instrument(force_sd=0.04, displacement_sd=0.02)
NAMES = ("deep.C10", "deep.C20")
ASSUMED = {"deep.D1": 28.0, "superficial.C10": 2e-3, "superficial.D1": 22.5, "fascia.C10": 0.1, "fascia.D1": 22.5}
STAGES = ("design", "design", "design", "proposal", "proposal", "bound", "genetic")


def measured_curve(trials: int = 3, depth: float = 20.0) -> LoadingCurve:
    noise = {"force_sd": 0.03, "displacement_sd": 0.02}
    return mean_loading_curve(
        segment_all(
            [press(air=1.0, depth=depth, seed=k, trial=f"trial{k + 1}", **noise) for k in range(trials)], INSTRUMENT
        )
    )


def sensitivities(depth: np.ndarray) -> dict[str, np.ndarray]:
    """N/MPa: with C10 = 0.7 and C20 = 0.8 kPa they nearly give `making.tissue_force`."""
    by_kpa = {
        "deep.C10": 0.3 * depth + 0.008 * depth**2,
        "deep.C20": 0.0005 * depth**3 + 0.009 * depth**2,
        "superficial.C10": 0.02 * depth,
        "fascia.C10": 1e-4 * depth,
    }
    return {name: 1e3 * rate for name, rate in by_kpa.items()}


def result(
    law: str,
    measured: LoadingCurve | None = None,
    subject: Subject | None = None,
    spatial: SpatialEvidence | None = None,
    correction: AppliedCorrection | None = None,
    **changes: object,
) -> Fit[LegDetails]:
    measured = measured or measured_curve()
    depth = measured.displacement
    rates = sensitivities(depth)
    columns = [rates["deep.C10"], rates["deep.C20"]][: 2 if law == "reduced-polynomial" else 1]
    matrix = np.column_stack(columns)
    optimum = np.linalg.lstsq(matrix, measured.force, rcond=None)[0]
    covariance = np.linalg.inv((matrix.T / measured.force_sd**2) @ matrix)
    error = np.sqrt(np.diag(covariance))

    def cost(c10, c20):
        force = np.asarray(c10)[..., None] * rates["deep.C10"] + np.asarray(c20)[..., None] * rates["deep.C20"]
        return np.sum((force - measured.force) ** 2, axis=-1)

    parameters = {
        name: Estimate(
            parameter=parameter_of(name, {}),
            value=float(value),
            standard_error=float(sd),
            ci95=(float(value - 1.9 * sd), float(value + 2.1 * sd)),
            identifiability="identifiable",
            moves={"superficial.C10": -0.012, "fascia.C10": -0.034, "force_N": 0.14, "displacement_mm": -0.19},
        )
        for name, value, sd in zip(NAMES, optimum, error, strict=False)
    }
    parameters = {name: replace(one, identifiability=one.verdict(True)) for name, one in parameters.items()}
    rng = np.random.default_rng(1)
    two = law == "reduced-polynomial"
    best = optimum if two else np.array([optimum[0], 0.0])
    apart = 1e-3 * np.array([0.6, 1.0 if two else 0.0])
    starts = best + apart * np.abs(rng.standard_normal((7, 2)))
    starts[4:] = best + np.abs(starts[4:] - best) * [[0.1], [0.02], [0.0]]
    squares = float(cost(*best))
    n = len(depth)
    leg = as_leg(subject or made_subject())
    name, channel = leg.sites[0].site or "leg", mean_force(measured)
    goodness = Goodness(1.05 * n if two else 40.0 * n, n - len(columns), 0.3 if two else 1e-12)
    given = {
        "kind": "leg",
        "subject": Identity(leg.id, leg.title, leg.origin),
        "law": law,
        "estimates": parameters,
        "correlations": covariance / np.outer(error, error),
        "values": {"deep.C20": 0.0, "deep.D2": math.inf, **dict(zip(NAMES, optimum, strict=False))},
        "assumed": ASSUMED,
        "goodness": goodness,
        "cost": Cost(squares, n, squares / 50.0**2, 0.9999, "the cost E", squares, "N2"),
        "agreement": EXACT,
        "tests": (SiteFit(name, (ChannelFit(channel, matrix @ optimum, rates),), goodness, curve=measured),),
        "log": SearchLog(
            names=NAMES[: 2 if two else 1],
            solves=tuple(
                FullSolve({NAMES[0]: a, NAMES[1]: b}, float(cost(a, b)), stage, True, "", 60, 1.5)
                for (a, b), stage in zip(starts, STAGES, strict=True)
            ),
            converged=True,
            seed=5,
            wall_s=12.3,
            emulator_error=0.003,
            forward_solves=7,
            reused_solves=2,
            factorisations=420,
        ),
        "weighting": "paper",
        "neo_hookean_limit": False,
        "notices": (Notice.of(LegNotice.NEGATIVE_POISSON_RATIO, tissue="fascia", ratio=-0.14),),
        "settings": {"grid_step_mm": 0.25},
        "versions": {"legfem": "0.1.0"},
        "details": LegDetails(leg, {}, (correction,), spatial=spatial),
    }
    return Fit(**{**given, **changes})


@cache
def made_subject() -> Subject:
    """A subject that no test changes."""
    return load_subject(write_subject(Path(tempfile.mkdtemp()) / "made"), need_recordings=False)


def law_document(fit: Fit[LegDetails]) -> dict[str, Any]:
    """What ``result.json`` holds of one law."""
    return fit_document([fit])["laws"][fit.law]
