"""What is unlikely of a diagnosed leg."""

from __future__ import annotations

from typing import NamedTuple

from legfem.common.doubts import Doubt
from legfem.common.units import kpa_to_mpa
from legfem.diagnose.diagnosis import Diagnosis
from legfem.identify.usual_stiffness import doubts_about_stiffness
from legfem.subjects.plausibility import doubts_about
from legfem.subjects.subject import Subject


def doubts_of(found: Diagnosis, subject: object) -> tuple[Doubt, ...]:
    """Return what is unlikely in a leg's folder, and in the stiffness that came out of it."""
    if not isinstance(subject, Subject):
        return ()
    return (*doubts_about(subject), *doubts_about_stiffness(subject, _found(found)))


class _Found(NamedTuple):
    value: float
    standard_error: float


def _found(found: Diagnosis) -> dict[str, _Found]:
    """Return the deep tissue's stiffness (MPa), as far as all explanations leave it open."""
    return {
        f"deep.{name}": _Found(
            kpa_to_mpa(found.best.value(name)), kpa_to_mpa(high - low) / (2 * 1.96)
        )
        for name, (low, high) in found.intervals.items()
        if name in found.best.fit.free
    }
