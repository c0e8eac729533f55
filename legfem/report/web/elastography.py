"""Rows of what is known of a leg's fibres, and of what shear waves said."""

from __future__ import annotations

from collections.abc import Iterable

from legfem.common.units import mpa_to_kpa
from legfem.data.recording import Origin
from legfem.legs.elastography import ShearModulus
from legfem.legs.subject import Subject
from legfem.report.web.page import Known


def wave_rows(subject: Subject) -> list[Known]:
    """Return moduli and the fibres' ratio, each with where it comes from."""
    rows = modulus_rows(subject.elastography, subject.origin)
    if (fibres := subject.fibres) is not None:
        measured = fibres.provenance == "measured"
        rows.append(
            Known(
                "muscle's shear moduli along the leg over across",
                str(fibres),
                subject.origin if measured else fibres.provenance,
                fibres.source,
            )
        )
    return rows


def modulus_rows(moduli: Iterable[ShearModulus], origin: Origin) -> list[Known]:
    """Return shear moduli, each with where it comes from."""
    return [
        Known(
            f"shear modulus of the {one.tissue} tissue, {one.plane} the leg",
            f"{mpa_to_kpa(one.value):.3g} ± {mpa_to_kpa(one.sd):.2g} kPa (sd)",
            origin,
            one.source,
        )
        for one in moduli
    ]
