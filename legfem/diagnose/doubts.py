"""What is unlikely of a diagnosed leg."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from legfem.common.doubts import Doubt
from legfem.common.units import kpa_to_mpa
from legfem.diagnose.diagnosis import Diagnosis
from legfem.legs.plausibility import doubts_about
from legfem.legs.subject import Subject
from legfem.legs.usual_stiffness import doubts_about_stiffness


def doubts_of(found: Diagnosis, subject: object) -> tuple[Doubt, ...]:
    """Return what is unlikely in recordings, in a leg's folder and in the stiffness of a leg."""
    of_repeats = tuple(_doubts_about_repeats(found))
    if not isinstance(subject, Subject):
        return of_repeats
    of_stiffness = doubts_about_stiffness(subject, _found(found))
    return (*doubts_about(subject), *of_repeats, *of_stiffness)


def _doubts_about_repeats(found: Diagnosis) -> Iterator[Doubt]:
    """Yield a doubt where repeats differ by more than the stated instruments make.

    A ripple over the drive and a leg that moves would pass for noise, whose size comes from the
    repeats.
    """
    noise = found.errors.noise
    told = (
        (noise.beyond_force, noise.slow_sd, "force_N", "N"),
        (noise.beyond_way, noise.wander_sd, "displacement_mm", "mm"),
    )
    for size, most, column, unit in told:
        if size > 0:
            yield Doubt(
                ", ".join(found.observed.trials),
                column,
                f"trials differ slowly by {size:.2g} {unit}, gain, zero and first contact allowed "
                f"for, where noise of the stated accuracy makes {most:.2g} {unit} at most",
                "lay the trials over each other and look for what differs: a leg or a rig that "
                "moved, a ripple of the drive; or state the accuracy that the rig has",
            )


class _Found(NamedTuple):
    value: float
    standard_error: float


def _found(found: Diagnosis) -> dict[str, _Found]:
    """Return the deep tissue's stiffness (MPa), as far as all explanations leave it open."""
    return {
        f"deep.{name}": _Found(kpa_to_mpa(found.best.value(name)), kpa_to_mpa(high - low) / (2 * 1.96))
        for name, (low, high) in found.intervals.items()
        if name in found.best.fit.free
    }
