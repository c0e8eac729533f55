"""Diagnoses of closed-form legs with each verdict, for tests of the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from making_diagnosis import INSTRUMENT, ClosedForm, noisy, observations, ramps

from legfem.diagnose.diagnosis import Diagnosis, diagnose, mechanism_named
from legfem.diagnose.library import shown_mechanisms
from legfem.progress import Silent
from legfem.recording import Recording

BASE = {"C10": 1.0, "C20": 0.6}
UNANSWERED = ("poroelastic-drainage", "contact-slip", "prestress", "superficial-viscoelasticity")


@dataclass(frozen=True, eq=False)
class ClosedLibrary(ClosedForm):
    """Closed-form responses that pass for a library of solved ones."""

    correction: None = None
    missing: Mapping[str, str] = field(default_factory=dict)


def diagnosed(
    effects: Mapping[str, float],
    recordings: Sequence[Recording] | None = None,
    bump: float = 0.0,
    asked: Sequence[str] | None = None,
    seed: int = 1,
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
    """
    observed, predictor = observations(list(recordings or ramps()))
    names = dict.fromkeys(name.split(".")[0] for name in effects)
    force = predictor({**BASE, **effects}, tuple(mechanism_named(name) for name in names))
    place = (observed.displacement - 12.0) / 0.9
    force = force + bump * (1 - place**2) * np.exp(-0.5 * place**2)
    observed, _ = noisy(observed, force, seed)
    observed = replace(
        observed, remarks=("trial1: 3.70 mm of air before first contact; displacement and force "
                           "are counted from there.",)
    )  # fmt: skip
    able, _ = shown_mechanisms(observed, None)
    left = [
        m.name for m in able if m.name in UNANSWERED or (asked is not None and m.name not in asked)
    ]
    library = ClosedLibrary(
        np.arange(0.5, 20.6, 0.5),
        missing=dict.fromkeys(left, "its solutions did not follow the protocol to the end"),
    )
    return diagnose(observed, INSTRUMENT, "reduced-polynomial", library, None, Silent())  # type: ignore[arg-type]
