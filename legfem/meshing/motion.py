r"""A section's mesh moved with its outlines, its elements staying what they are.

Skin and fascia are moved along their normals by hat functions of the arc from first touch; what is
between follows in proportion to the distances from both,

.. math:: V(x) = n(x)\, h(s(x))\, w(x), \quad
          w = \frac{r_\text{other}}{r_\text{own} + r_\text{other}}.

A force's change by an outline is then free of the noise that another mesh would bring.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import shapely

from legfem.common.units import FloatArray
from legfem.geometry.section import BONES, LegSection

Outline = Literal["skin", "fascia", "bones"]


@dataclass(frozen=True)
class MeshMotion:
    """Motion of an outline of a section.

    Parameters
    ----------
    outline : {"skin", "fascia", "bones"}
        Which. The bones move together, along the travel.
    arc : float
        Of the hat function's top from first touch, along the skin, counter-clockwise (mm).
    width : float
        Half of the hat's foot (mm).
    size : float
        Outwards at the top; of the bones along the travel (mm).
    """

    outline: Outline
    arc: float = 0.0
    width: float = 20.0
    size: float = 0.5

    def displacement(
        self, points: FloatArray, section: LegSection, touch: FloatArray, travel: FloatArray
    ) -> FloatArray:
        """Return how points (n, 2) of the section's mesh move (mm).

        Parameters
        ----------
        points
            mm.
        section
            Before the motion.
        touch
            Centre of the indenter at first touch (mm).
        travel
            Unit vector of its travel.
        """
        at = shapely.points(points)
        skin, fascia = (section.polygon(part).exterior for part in ("skin", "fascia"))
        bones = shapely.union_all([section.polygon(part).exterior for part in BONES])
        to_skin, to_fascia, to_bones = (shapely.distance(at, line) for line in (skin, fascia, bones))
        inside = shapely.contains_properly(section.polygon("fascia"), at)
        if self.outline == "bones":
            share = np.where(inside, _share(to_fascia, to_bones), 0.0)
            return share[:, None] * self.size * travel[None, :]
        if self.outline == "skin":
            share = np.where(inside, 0.0, _share(to_fascia, to_skin))
        else:
            share = np.where(inside, _share(to_bones, _beyond(to_fascia, section)), _share(to_skin, to_fascia))
        arc, normal = _arc_and_normal(skin, points, touch)
        hat = np.maximum(0.0, 1.0 - np.abs(arc - self.arc) / self.width)
        return (self.size * share * hat)[:, None] * normal


def _share(other: FloatArray, own: FloatArray) -> FloatArray:
    return np.asarray(other / np.maximum(own + other, 1e-12))


def _beyond(to_fascia: FloatArray, section: LegSection) -> FloatArray:
    """Return the distance from the fascia's inner face: the layer moves as one."""
    return np.maximum(to_fascia - section.fascia_thickness, 0.0)


def _arc_and_normal(skin: shapely.LinearRing, points: FloatArray, touch: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the arc from first touch of the skin's nearest points, and outward normals there."""
    length = skin.length
    at = shapely.line_locate_point(skin, shapely.points(points))
    first = shapely.line_locate_point(skin, shapely.Point(*touch))
    arc = (at - first + 0.5 * length) % length - 0.5 * length
    ahead, behind = (
        shapely.get_coordinates(shapely.line_interpolate_point(skin, (at + step) % length)) for step in (2.0, -2.0)
    )
    tangent = ahead - behind
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    # Contours are counter-clockwise.
    return arc, np.column_stack([tangent[:, 1], -tangent[:, 0]])
