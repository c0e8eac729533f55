"""Rows of what is known of a leg's fibres, and of what shear waves said."""

from __future__ import annotations

from legfem.common.units import mpa_to_kpa
from legfem.report.web.page import Known
from legfem.subjects.subject import Subject


def wave_rows(subject: Subject) -> list[Known]:
    """Return moduli and the fibres' ratio, each with where it comes from."""
    rows = [
        Known(
            f"shear modulus of the {one.tissue} tissue, {one.plane} the leg",
            f"{mpa_to_kpa(one.value):.3g} ± {mpa_to_kpa(one.sd):.2g} kPa (sd)",
            subject.origin,
            one.source,
        )
        for one in subject.elastography
    ]
    if (fibres := subject.fibres) is not None:
        measured = fibres.provenance == "measured"
        rows.append(
            Known(
                "muscle's shear moduli along the leg over across", str(fibres),
                subject.origin if measured else fibres.provenance, fibres.source,
            )
        )  # fmt: skip
    return rows
