r"""The 3D correction of one's own leg, from a table over legs of several sizes.

.. math:: P(d; m, g) = P(d; m, g_0) + \Delta P(d; m, g)

with the calibrated `TabulatedCorrection` of the reference leg :math:`g_0` and the change tabulated
over the leg's radius, the depth to its bone relative to that radius, and the stiffness. A leg's
radius is its girth over :math:`2 \pi`; the depth to its bone is the distance of the bones from the
point of first contact. A leg beyond the table takes its nearest entry, and its name says so.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from legfem.common.documents import write_document
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.correction.tabulated import TabulatedCorrection

SCHEMA = 1
KIND = "3d-correction-of-legs"


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
        beyond = "" if self.covers(radius, depth_to_bone) else ", beyond the table: its nearest leg"
        name = f"{base.name}, radius {radius:.1f} mm, {depth_to_bone:.1f} mm of tissue before the bone"
        return replace(base, name=name + beyond, values=values, errors={**base.errors, **modes})

    def write(self, path: Path) -> Path:
        """Write the table as JSON."""
        return write_document(
            path,
            {
                "schema": SCHEMA,
                "kind": KIND,
                **self.given,
                "radius_mm": self.radius.tolist(),
                "depth_to_bone_over_radius": self.depth.tolist(),
                "displacement_mm": self.displacement.tolist(),
                "c10_kPa": self.c10.tolist(),
                "c20_over_c10_plus_c20": self.stiffening.tolist(),
                "change_of_P": np.round(self.change, 6).tolist(),
                "errors": {name: np.round(mode, 6).tolist() for name, mode in self.errors.items()},
            },
        )

    def _inside(self, radius: float, depth_to_bone: float) -> tuple[float, float]:
        depth = depth_to_bone / radius
        return (
            min(max(radius, float(self.radius[0])), float(self.radius[-1])),
            min(max(depth, float(self.depth[0])), float(self.depth[-1])),
        )


_KNOWN = (
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
    remedy = "give a file that python -m legfem.study correction --legs wrote"
    try:
        content = json.loads(path.read_text())
        if content.get("kind") != KIND or content.get("schema") != SCHEMA:
            raise InputError(path, "kind", f"is not {KIND} of schema {SCHEMA}", remedy)
        *axes, change = (np.array(content[name], dtype=float) for name in _KNOWN)
        errors = {name: np.array(mode, dtype=float) for name, mode in content["errors"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(path, "table", f"can't be read ({error!r})", remedy) from None
    radius, depth, displacement, c10, stiffening = axes
    if change.shape != tuple(map(len, (radius, depth, c10, stiffening, displacement))):
        raise InputError(path, "change_of_P", f"has shape {change.shape}", remedy)
    given = {name: value for name, value in content.items() if name not in (*_KNOWN, "schema", "kind", "errors")}
    return LegCorrections(radius, depth, displacement, c10, stiffening, change, errors, given)
