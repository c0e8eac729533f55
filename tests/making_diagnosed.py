"""Diagnoses of closed-form legs with each verdict, for tests of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from making_diagnosis import INSTRUMENT, MADE, ClosedForm, mechanisms_in, noisy, observations, ramps

from legfem.common.progress import Silent
from legfem.data import Recording
from legfem.geometry.section import CALF, LIMBS
from legfem.inverse.accuracy import Accuracy
from legfem.inverse.answer import FitNotice, Notice
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, LawName
from legfem.inverse.diagnose import DiagnosisInput, Identified, diagnose
from legfem.inverse.mechanism import shown_mechanisms
from legfem.inverse.observations import Observations
from legfem.inverse.verdict import Diagnosis
from legfem.legs.diagnosis import WITHOUT_ENDS
from legfem.legs.nuisances import ShapeAccuracy
from legfem.mechanisms import mechanisms

BASE = {DEEP_C10: 0.001, DEEP_C20: 0.0006}
UNANSWERED = (
    "poroelastic-drainage",
    "contact-slip",
    "fat-sliding",
    "prestress",
    "superficial-viscoelasticity",
    "superficial-stiffening",
)
"""Mechanisms that the closed form has no response for, or no other than for others."""


def diagnosed(
    effects: Mapping[str, float],
    recordings: Sequence[Recording] | None = None,
    bump: float = 0.0,
    asked: Sequence[str] | None = None,
    seed: int = 1,
    law: LawName = "reduced-polynomial",
) -> Diagnosis:
    """Return the diagnosis of recordings with effects in them.

    Parameters
    ----------
    effects
        Values of mechanisms' parameters by full name.
    recordings
        Protocols; three slow loadings by default.
    bump
        N of an effect that no mechanism makes.
    asked
        Names of the mechanisms that are tested; all that have a response by default.
    seed
        Of the noise.
    law
        Of the base model; without C20 the recordings have none either.
    """
    if recordings is None:
        return _of_ramps(tuple(effects.items()), bump, None if asked is None else tuple(asked), seed, law)
    return diagnosed_anew(effects, recordings, bump, asked, seed, law)


@cache
def _of_ramps(
    effects: tuple[tuple[str, float], ...], bump: float, asked: tuple[str, ...] | None, seed: int, law: LawName
) -> Diagnosis:
    """Several files look at the same ones."""
    return diagnosed_anew(dict(effects), ramps(), bump, asked, seed, law)


def diagnosed_anew(
    effects: Mapping[str, float],
    recordings: Sequence[Recording],
    bump: float,
    asked: Sequence[str] | None,
    seed: int,
    law: LawName = "reduced-polynomial",
) -> Diagnosis:
    """Return the same, computed again if it is asked for again."""
    observed, predictor = observations(list(recordings))
    base = BASE if law == "reduced-polynomial" else {DEEP_C10: BASE[DEEP_C10], DEEP_C20: 0.0}
    force = predictor({**base, **effects}, mechanisms_in(effects))
    place = (observed.displacement - 12.0) / 0.9
    force = force + bump * (1 - place**2) * np.exp(-0.5 * place**2)
    observed = replace(
        noisy(observed, force, seed), notices=(Notice.of(FitNotice.BEGUN_IN_AIR, trial="trial1", air=3.7),)
    )
    return diagnosed_of(observed, asked, law)


def diagnosed_of(
    observed: Observations,
    asked: Sequence[str] | None = None,
    law: LawName = "reduced-polynomial",
    accuracy: Accuracy | None = None,
    library: ClosedForm | None = None,
    identified: Identified | None = None,
) -> Diagnosis:
    """Return the diagnosis of observations, by closed-form responses.

    Parameters
    ----------
    observed
        The recordings.
    asked
        Names of the mechanisms that are tested; all that have a response by default.
    law
        Of the base model.
    accuracy
        How well the leg is known.
    library
        Of its responses.
    identified
        Fit of the base model before the diagnosis.
    """
    able, _ = shown_mechanisms(mechanisms(), observed, WITHOUT_ENDS)
    left = [m.name for m in able if (m.name in UNANSWERED if asked is None else m.name not in asked)]
    missing = dict.fromkeys(left, "simulations did not reach the end of the protocol")
    library = replace(library or ClosedForm(), missing=missing)
    # What is made in closed form begins at first contact.
    known = accuracy or ShapeAccuracy(bones=LIMBS[CALF], contact_sd=0.0)
    given = DiagnosisInput(
        observed, INSTRUMENT, law, library, mechanisms(), MADE, "leg", identified, known, ruled_out=WITHOUT_ENDS
    )  # type: ignore[arg-type]
    return diagnose(given, None, Silent())
