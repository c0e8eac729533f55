"""Pictures of a leg as it was given: its section with the cylinder, and its outlines bare and in a stocking."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch
from matplotlib.patches import Polygon as Outline
from shapely import Polygon

from legfem.common.units import FloatArray
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import fat_thickness, first_crossing, girth
from legfem.geometry.slices import CONTOURS, SliceSet
from legfem.legs.plausibility import room_before
from legfem.legs.subject import Subject
from legfem.report import style

if TYPE_CHECKING:
    from legfem.stockings.leg import StockingLeg

SECTION_SHOWS = "the section that was given or cut, with the cylinder at first touch and its travel"


@style.styled
def placement_figure(subject: Subject, scanned: Mapping[str, Polygon] | None = None) -> Figure:
    """Return the section with the cylinder where it first touches, and its line of travel.

    Parameters
    ----------
    subject
        The leg.
    scanned
        Outlines by part as the scan has them (mm), before they were given room.
    """
    section, indenter = subject.section, subject.indenter
    figure = style.titled(6.4, 6.9, "Section and cylinder at first touch", subject.title, subject.origin)
    axes = figure.subplots()
    inner = np.asarray(section.polygon("fascia").buffer(-section.fascia_thickness).exterior.coords)
    rings = {"superficial": section.skin, "fascia": section.fascia, "deep": inner}
    for name, (words, colour) in style.regions(section).items():
        axes.fill(*rings[name].T, facecolor=colour, edgecolor="black", linewidth=0.6, label=words)
    for muscle, contour in section.muscles.items():
        axes.plot(*np.vstack([contour, contour[:1]]).T, color="black", linewidth=0.6)
        axes.annotate(muscle, contour.mean(axis=0), ha="center", va="center", fontsize=7)
    for bone, contour in section.bones.items():
        axes.fill(*contour.T, facecolor=style.BONE_COLOUR, edgecolor="black", linewidth=0.8)
        axes.annotate(bone, contour.mean(axis=0), ha="center", va="center", fontsize=8)
    for number, scan in enumerate((scanned or {}).values()):
        label = "as scanned" if number == 0 else None
        axes.plot(*np.asarray(scan.exterior.coords).T, color=style.FAINT, linestyle="--", linewidth=1.0, label=label)
    aim, direction = indenter.aim, indenter.direction
    way = first_crossing(section.polygon("skin").buffer(indenter.radius).exterior, aim, direction)
    room = room_before(subject)
    start, end = aim + way * direction, aim + (way + room) * direction
    axes.add_patch(_tool(indenter, start))
    axes.annotate("", tuple(end), tuple(start), arrowprops={"arrowstyle": "->", "linewidth": 1.5})
    axes.update_datalim(np.stack([start - indenter.radius, start + indenter.radius]))
    axes.autoscale_view()
    axes.set_aspect("equal")
    axes.set(xlabel="x (mm)", ylabel="y (mm)")
    fat = fat_thickness(section, aim, direction)
    cut = f"cut from {subject.cut_from}\n" if subject.cut_from else ""
    axes.set_title(
        f"{cut}girth {girth(section):.0f} mm, fat on the line of travel {fat:.1f} mm,\n"
        f"room for {room:.0f} mm of travel (arrow, at {indenter.direction_deg:.4g}° from +x)",
        fontsize=10,
    )
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2)
    return figure


def _tool(indenter: Indenter, middle: FloatArray) -> Patch:
    """Return what of an indenter is seen in the section, its face a radius ahead of its middle."""
    colours = {"facecolor": style.TOOL_COLOUR, "edgecolor": "black"}
    if indenter.lies_along or indenter.shape == "ball":
        return Circle(tuple(middle), indenter.radius, **colours)
    ahead, beside = indenter.direction, np.array([-1.0, 1.0]) * indenter.direction[::-1]
    long = indenter.length * abs(np.sin(np.radians(indenter.axis_deg))) if indenter.shape == "cylinder" else 0.0
    half = max(indenter.radius, 0.5 * long)
    corners = [(-1, -half), (1, -half), (1, half), (-1, half)]
    outline = [middle + along * indenter.radius * ahead + side * beside for along, side in corners]
    return Outline(outline, closed=True, **colours)


@style.styled
def slices_figure(leg: "StockingLeg") -> Figure:
    """Return outlines at three of the heights that are compared, bare and in the stocking."""
    levels = leg.slices[:: len(leg.slices) // 2]
    figure = style.new_figure(7.4, 4.0)
    figure.suptitle(f"Bare and in its stocking: {leg.origin} data", x=0.01, ha="left")
    every = figure.subplots(1, len(levels), sharex=True, sharey=True)
    shapes = [("bare", leg.bare, style.FAINT)]
    if leg.compressed is not None:
        shapes.append(("in the stocking", leg.compressed, "#0072B2"))
    for name, shape, colour in shapes:
        low, high = shape.levels[0], shape.levels[-1]
        slices = SliceSet.of(shape, np.clip(levels, low, high))
        for number, axes in enumerate(every):
            for part in CONTOURS:
                points = slices.contours(part)[number]
                label = name if part == CONTOURS[0] else None
                axes.plot(*np.vstack([points, points[:1]]).T, color=colour, lw=1.2, label=label)
    for axes, level in zip(every, levels, strict=True):
        axes.set_title(f"z = {level:.0f} mm", loc="center")
        axes.set_aspect("equal")
        axes.set_xlabel("x (mm)")
    every[0].set_ylabel("y (mm)")
    every[0].invert_yaxis()
    figure.legend(*every[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
