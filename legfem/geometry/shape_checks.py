"""Checks that a leg's shape is one: its parts nest and its size is a leg's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import shapely
from shapely import Polygon

from legfem.common.errors import InputError
from legfem.geometry.contour_table import check_levels
from legfem.geometry.contours import check_girth
from legfem.geometry.leg_shape import HULL, SKIN, LegShape


def check_shape(shape: LegShape, source: str | Path, clearance: float = 0.0, leg_sized: bool = True) -> None:
    """Check that the parts of a shape nest at every level.

    Parameters
    ----------
    shape : LegShape
        The shape.
    source : str or Path
        What errors name as the file.
    clearance : float
        Least distance that is wanted between the parts (mm).
    leg_sized : bool
        Whether the girth has to be a leg's.

    Raises
    ------
    InputError
        If a contour crosses itself, a part is not inside the one around it with the clearance, or
        the girth is not a leg's in mm.
    """
    if leg_sized:
        check_levels(shape.levels, source)
    pairs = [(HULL, SKIN), *((bone, HULL) for bone in shape.bones)]
    for k, level in enumerate(shape.levels):
        here = {part: Polygon(xy[k]) for part, xy in shape.contours.items()}
        where = f"level {level:g} mm"
        for part, polygon in here.items():
            if not polygon.is_valid:
                raise InputError(
                    source, f"{part}, {where}", "the contour crosses itself", "give its points in order, or smooth it"
                )
        if leg_sized:
            check_girth(float(here[SKIN].length), source)
        for inner, outer in pairs:
            _check_room(source, here, inner, outer, where, clearance)
        for i, bone in enumerate(shape.bones):
            for other in shape.bones[:i]:
                if here[bone].distance(here[other]) < max(clearance, 1e-9):
                    raise InputError(source, f"{bone}, {where}", f"touches or crosses the {other}", "separate the two")


def _check_room(
    source: str | Path, here: Mapping[str, Polygon], inner: str, outer: str, where: str, clearance: float
) -> None:
    if not here[outer].contains_properly(here[inner]):
        at = shapely.get_coordinates(here[inner].difference(here[outer]).representative_point())
        near = f" near ({at[0, 0]:.1f}, {at[0, 1]:.1f})" if len(at) else ""
        raise InputError(
            source, f"{inner}, {where}", f"is not inside the {outer}{near}", f"bring the {inner} inside the {outer}"
        )
    gap = here[outer].exterior.distance(here[inner].exterior)
    if gap < clearance:
        raise InputError(
            source,
            f"{inner}, {where}",
            f"{gap:.2f} mm left to the {outer} where {clearance:.2f} are needed",
            "correct the contours or ask for less room",
        )
