r"""The 3D correction of a leg's force in plane strain: by its girth and depth to the bone, or none.

**Sizes.** From a table over legs of several sizes:

.. math:: P(d; m, g) = P(d; m, g_0) + \Delta P(d; m, g)

with the calibrated `TabulatedCorrection` of the reference leg :math:`g_0` and the change tabulated
over the leg's radius, the depth to its bone relative to that radius, and the stiffness. A leg's
radius is its girth over :math:`2 \pi`; the depth to its bone is the distance of the bones from the
point of first contact. A leg beyond the table takes its nearest entry, and its name says so.

"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from legfem.common.errors import Argument, Command, InputError, Remedy
from legfem.common.resources import RESOURCES
from legfem.common.units import FloatArray, kpa_to_mpa, mpa_to_kpa
from legfem.geometry.section import depth_to_bone, girth
from legfem.inverse.correction import (
    TabulatedCorrection,
    read_correction,
    read_fibres,
    read_table,
    with_fibres,
    write_table,
)
from legfem.legs.subject import Subject

LEGS_KIND = "3d-correction-of-legs"


@dataclass(frozen=True, eq=False)
class LegCorrections:
    """The change of P from the reference leg to others.

    Parameters
    ----------
    radius
        Of the legs (mm), (a,).
    depth
        From the skin to the bone, over the radius, (b,).
    displacement, c10, stiffening
        As those of `TabulatedCorrection`: (n,), (m,), (k,).
    change
        (a, b, m, k, n).
    errors
        Modes of its error, (n,) each, by what causes them.
    given
        How it was made, for the file.
    """

    radius: FloatArray
    depth: FloatArray
    displacement: FloatArray
    c10: FloatArray
    stiffening: FloatArray
    change: FloatArray
    errors: Mapping[str, FloatArray] = field(default_factory=dict)
    given: Mapping[str, Any] = field(default_factory=dict)

    def change_of(self, radius: float, depth_to_bone: float) -> TabulatedCorrection:
        """Return the change for a leg's radius and depth to bone (mm), as a table of its own."""
        at = self._inside(radius, depth_to_bone)
        change = RegularGridInterpolator((self.radius, self.depth), self.change)(at)
        return TabulatedCorrection("change", self.displacement, self.c10, self.stiffening, change, self.errors)

    def covers(self, radius: float, depth_to_bone: float) -> bool:
        """Tell whether the table holds a leg of these sizes (mm)."""
        return self._inside(radius, depth_to_bone) == (radius, depth_to_bone / radius)

    def of_leg(self, base: TabulatedCorrection, radius: float, depth_to_bone: float) -> TabulatedCorrection:
        """Return the correction of a leg, given that of the reference leg.

        Parameters
        ----------
        base
            Of the reference leg.
        radius, depth_to_bone
            mm.
        """
        change = self.change_of(radius, depth_to_bone)
        c10, q = base.c10[:, None], base.stiffening[None, :]
        at = np.minimum(base.displacement, self.displacement[-1])
        values = base.values + change.correction(at, c10 + 0 * q, c10 * q / (1 - q))
        modes = {name: np.interp(base.displacement, self.displacement, mode) for name, mode in self.errors.items()}
        sizes = {"girth": 2 * np.pi * radius, "depth": depth_to_bone}
        beyond = {} if self.covers(radius, depth_to_bone) else sizes
        name = f"{base.name}, radius {radius:.1f} mm, {depth_to_bone:.1f} mm of tissue before the bone"
        name += ", beyond the table: its nearest leg" if beyond else ""
        return replace(base, name=name, values=values, errors={**base.errors, **modes}, beyond=beyond)

    def write(self, path: Path) -> Path:
        """Write the table as JSON."""
        axes = (self.radius, self.depth, self.displacement, np.round(mpa_to_kpa(self.c10), 7), self.stiffening)
        columns = dict(zip(_COLUMNS, (*axes, np.round(self.change, 6)), strict=True))
        errors = {name: np.round(mode, 6) for name, mode in self.errors.items()}
        return write_table(path, LEGS_KIND, self.given, columns, errors)

    def _inside(self, radius: float, depth_to_bone: float) -> tuple[float, float]:
        sizes = zip((radius, depth_to_bone / radius), (self.radius, self.depth), strict=True)
        radius, depth = (float(np.clip(size, axis[0], axis[-1])) for size, axis in sizes)
        return radius, depth


_COLUMNS = (
    "radius_mm",
    "depth_to_bone_over_radius",
    "displacement_mm",
    "c10_kPa",
    "c20_over_c10_plus_c20",
    "change_of_P",
)


def read_leg_corrections(path: Path) -> LegCorrections:
    """Read a table of legs.

    Raises
    ------
    InputError
        If there is none, or it is not a whole table.
    """
    command = Command("study correction", (Argument("legs"),))
    (*axes, change), errors, given = read_table(path, LEGS_KIND, _COLUMNS, command)
    radius, depth, displacement, c10, stiffening = axes
    if change.shape != tuple(map(len, (radius, depth, c10, stiffening, displacement))):
        remedy = Remedy("give a file that ", command, " wrote")
        raise InputError(path, _COLUMNS[-1], f"has shape {change.shape}", remedy)
    return LegCorrections(radius, depth, displacement, kpa_to_mpa(c10), stiffening, change, errors, given)


STUDY = RESOURCES / "frauziols"
REFERENCE, LEGS = STUDY / "correction.json", STUDY / "correction-legs.json"
AUTO, OWN, NONE = "auto", "own", "none"


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
    return None if name in (AUTO, NONE) else _of_muscle(subject, read_correction(Path(name)))


def correction_of(subject: Subject) -> TabulatedCorrection:
    """Return legfem's correction at a subject's girth and depth to the bone, with known fibres."""
    own = read_leg_corrections(LEGS).of_leg(read_correction(REFERENCE), *size_of(subject))
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
    given = read_correction(REFERENCE).given["cylinder"]
    if other := _another_cylinder(subject, given):
        if np.isclose(subject.indenter.radius, given["radius"], rtol=0.01):
            remedy = (
                f"calibrate one with `legfem study correction --cylinder-length {subject.indenter.length:g} --out "
                "correction`, and give it with `--correction correction/correction.json`"
            )
        else:
            remedy = "`--model 3d` solves the leg with its own cylinder"
        return f"legfem's own is for {other}; {remedy}"
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
