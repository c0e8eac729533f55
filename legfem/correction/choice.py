"""The 3D correction of the plane-strain force: where it enters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from legfem.common.units import FloatArray
from legfem.correction.fibres import read_fibres, with_fibres
from legfem.correction.leg_sizes import read_leg_corrections
from legfem.correction.tabulated import TabulatedCorrection, read_correction
from legfem.data.folder import RESOURCES
from legfem.geometry.section import depth_to_bone, girth
from legfem.legs.subject import Subject

STUDY = RESOURCES / "frauziols"
REFERENCE, LEGS = STUDY / "correction.json", STUDY / "correction-legs.json"
AUTO, OWN, NONE = "auto", "own", "none"


class Correction(Protocol):
    """A factor on the plane-strain force, with its uncertainty (``1 - P(d)``, Eq. 3).

    Stiffnesses are those of the deep tissue in kPa, of any shape ``(...)``; displacements are
    ``(n,)`` in mm.
    """

    @property
    def name(self) -> str:
        """What reports call it."""
        ...

    def factor(self, displacement: FloatArray, c10: FloatArray, c20: FloatArray) -> FloatArray:
        """Return the factor (..., n)."""
        ...

    def covariance(self, displacement: FloatArray, c10: float, c20: float) -> FloatArray:
        """Return the covariance (n, n) of the factor's relative error, for the intervals."""
        ...

    def relative_errors(self, displacement: FloatArray, c10: float, c20: float) -> Mapping[str, FloatArray]:
        """Return the modes (n,) that the covariance is made of, by what causes them."""
        ...


def choose_correction(name: str, subject: Subject) -> TabulatedCorrection | None:
    """Return the correction that ``--correction`` names, with the leg's fibres if they are known.

    Parameters
    ----------
    name
        ``own`` for the leg's own from legfem's table, ``auto`` for that where it is due (see
        `why_uncorrected`), ``none``, or a file.
    subject
        Whose leg it is for.

    Raises
    ------
    InputError
        If the file isn't a correction's.
    """
    if name == OWN or (name == AUTO and not why_uncorrected(subject)):
        return correction_of(subject)
    found = None if name == AUTO else find_correction(name)
    return None if found is None else _of_muscle(subject, found)


def find_correction(name: str) -> TabulatedCorrection | None:
    """Return the correction in a file; None for ``none``.

    Raises
    ------
    InputError
        If the file isn't a correction's.
    """
    return None if name == NONE else read_correction(Path(name))


def correction_of(subject: Subject) -> TabulatedCorrection:
    """Return legfem's correction at a subject's girth and depth to the bone, with known fibres.

    Without a table of legs that of the reference leg, which its name says.
    """
    base = read_correction(REFERENCE)
    if not LEGS.exists():
        own = replace(base, name=f"{base.name}, of the reference leg's girth and bone")
    else:
        own = read_leg_corrections(LEGS).of_leg(base, *size_of(subject))
    return _of_muscle(subject, own)


def _of_muscle(subject: Subject, correction: TabulatedCorrection) -> TabulatedCorrection:
    """Return a correction with what the subject's fibres do to the force, if that can be told."""
    if subject.fibres is None or why_without_fibres(subject):
        return correction
    return with_fibres(correction, read_fibres(), subject.fibres)


def size_of(subject: Subject) -> tuple[float, float]:
    """Return a leg's girth over 2 pi, and how deep its bones lie under the cylinder (mm)."""
    section, indenter = subject.section, subject.indenter
    return (girth(section) / (2 * np.pi), depth_to_bone(section, indenter.aim, indenter.direction))


def why_uncorrected(subject: Subject) -> str | None:
    """Return why there is no correction by default; None where there is one."""
    if subject.plane_strain:
        return "the recordings are simulated in plane strain, which has no ends"
    if other := _another_cylinder(subject, read_correction(REFERENCE).given["cylinder"]):
        return (
            f"legfem's own is for {other}; calibrate one with "
            "python -m legfem.study correction --cylinder-length, and give it with --correction"
        )
    return None


def why_without_fibres(subject: Subject) -> str | None:
    """Return why legfem can't tell what fibres do to a force; None where it can."""
    if other := _another_cylinder(subject, read_fibres().given["cylinder"]):
        return f"legfem's table of fibres is for {other}"
    return None


def _another_cylinder(subject: Subject, tabulated: Mapping[str, float]) -> str:
    """Return of which cylinder a table is, and of which it isn't; empty if it is the subject's."""
    size = (2 * subject.indenter.radius, subject.indenter.length)
    own = (2 * tabulated["radius"], tabulated["length"])
    if np.allclose(size, own, rtol=0.01):
        return ""
    return f"a cylinder of {own[0]:g} x {own[1]:g} mm, not {size[0]:g} x {size[1]:g} mm"


def correction_factor(
    correction: Correction | None, displacement: FloatArray, c10: FloatArray, c20: FloatArray
) -> FloatArray:
    """Return the factor (..., n); 1 without a correction."""
    if correction is None:
        return np.ones((*np.shape(c10), len(displacement)))
    return correction.factor(displacement, c10, c20)
