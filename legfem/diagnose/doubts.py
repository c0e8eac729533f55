"""What is unlikely of a diagnosed leg."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from legfem.common.doubts import Doubt
from legfem.common.units import kpa_to_mpa
from legfem.diagnose.diagnosis import Diagnosis
from legfem.identify.usual_stiffness import doubts_about_stiffness
from legfem.subjects.plausibility import doubts_about
from legfem.subjects.subject import Subject

_OF_FORCE, _OF_WAY = 2.5, 4.0
"""Of what is stated, from which slow differences between repeats are doubted: the stated figure of
a load cell's slow error is known to a factor of 1.3, a displacement sensor's to one of 2.7."""


def doubts_of(found: Diagnosis, subject: object) -> tuple[Doubt, ...]:
    """Return what is unlikely in a leg's folder, and in the stiffness that came out of it."""
    if not isinstance(subject, Subject):
        return ()
    return (
        *doubts_about(subject),
        *_doubts_about_repeats(found, subject),
        *doubts_about_stiffness(subject, _found(found)),
    )


def _doubts_about_repeats(found: Diagnosis, subject: Subject) -> Iterator[Doubt]:
    """Yield a doubt where repeats differ by more than the stated instruments do.

    Whatever differs from trial to trial passes for noise, since its size comes from the repeats: a
    ripple over the drive, a leg that moves.
    """
    observed, instrument, noise = found.observed, subject.instrument, found.errors.noise
    if not instrument.stated or observed.repeats < 2:
        return
    told = (
        (noise.slow_sd, instrument.slow_force_sd(noise.white_sd), _OF_FORCE, "force_N", "N"),
        (
            noise.wander_sd, instrument.wander_sd(observed.jitter_sd), _OF_WAY,
            "displacement_mm", "mm",
        ),
    )  # fmt: skip
    for size, stated, most, column, unit in told:
        if size > most * stated:
            yield Doubt(
                str(subject.directory / "recordings"), column,
                f"trials differ slowly by {size:.2g} {unit}, gain, zero and first contact allowed "
                f"for, which is {size / stated:.1f} times what the stated accuracy leaves for it",
                "lay the trials over each other and look for what differs: a leg or a rig that "
                "moved, a ripple of the drive; or state the accuracy that the rig has",
            )  # fmt: skip


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
