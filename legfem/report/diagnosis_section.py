"""Where in the section the misfit lies: at the channels that depart, and where another stiffness could explain it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from legfem.channels.kind import Site
from legfem.channels.registry import FILE_OF
from legfem.inverse.verdict import Diagnosis
from legfem.legs.mechanisms.uneven_muscle import RADIUS_MM, UnevenMuscle, place_in_section
from legfem.legs.subject import Subject
from legfem.report.diagnosis_curves import BASE_COLOUR, REPAIRED_COLOUR
from legfem.report.diagnosis_figures import matched
from legfem.report.page import Mark, StillSection
from legfem.report.section import still_section

_SHARE = 0.3
"""Of the misfit: a place that would explain less isn't marked."""
_CHANNEL_MM = 3.0


def misfit_in_section(found: Diagnosis, subject: Subject) -> list[StillSection]:
    """Return the section with marks where the misfit lies; nothing without channels, or where none stands out."""
    marks = [*_channel_marks(found, subject), *_stiffness_marks(found, subject)]
    if not found.observed.channels or not marks:
        return []
    caption = (
        "Where the misfit lies. Small circles: where a channel departs from the base model. Large circles: where a "
        "stiffer or softer region of the muscle would match the misfit, and how much of it; other causes may match it, "
        "too."
    )
    return [replace(still_section(subject), caption=caption, marks=marks)]


def _channel_marks(found: Diagnosis, subject: Subject) -> Iterator[Mark]:
    departs = {window.channel for window in found.assessment.windows}
    for one in found.observed.channels:
        if one.name in departs:
            x, y = FILE_OF[one.name].place(one.kind, Site(subject.section, subject.indenter))
            yield Mark(f"departs: {one.kind.title}", x, -y, _CHANNEL_MM, BASE_COLOUR)


def _stiffness_marks(found: Diagnosis, subject: Subject) -> Iterator[Mark]:
    fitted = found.weighted_base.fit
    for one in found.assessment.signatures:
        if one.mechanism.name != UnevenMuscle.name:
            continue
        share = matched(found, one)[1]
        if share is None or share < _SHARE:
            continue
        x, y = place_in_section(subject, one.shape["depth"], one.shape["side"])
        how = "stiffer" if float(one.direction @ fitted.augmented_residual) > 0 else "softer"
        yield Mark(f"a {how} region here matches {100 * share:.0f} %", x, -y, RADIUS_MM, REPAIRED_COLOUR)
