"""Pictures of a leg's section: the mesh by tissue, and the deformed state with its pressure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib.patheffects as outline
import numpy as np
from dolfinx import fem
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from matplotlib.patches import Polygon as Outline
from matplotlib.tri import Triangulation
from shapely import Polygon

from legfem.common.units import FloatArray
from legfem.fem.fields import LegFields
from legfem.geometry.indenter import Indenter
from legfem.geometry.section import LegSection, fat_thickness, first_crossing, girth
from legfem.geometry.slices import CONTOURS, SliceSet
from legfem.legs.plausibility import room_before
from legfem.legs.subject import Subject
from legfem.meshing.section import REGIONS
from legfem.report import style
from legfem.stockings.leg import StockingLeg

# A second-order cell as linear triangles, and its edges, in the order of DOLFINx' nodes.
_TRIANGLES = {
    6: ((0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5)),
    9: ((0, 4, 8), (0, 8, 5), (4, 1, 6), (4, 6, 8), (5, 8, 7), (5, 7, 2), (8, 6, 3), (8, 3, 7)),
}
_EDGES = {6: ((0, 5, 1), (1, 3, 2), (2, 4, 0)), 9: ((0, 4, 1), (1, 6, 3), (3, 7, 2), (2, 5, 0))}


@dataclass(frozen=True, eq=False)
class DrawnSection:
    """A section's second-order cells as arrays; one rank's, so use it on one rank."""

    nodes: FloatArray
    """(cells, 6 or 9, 2), mm, undeformed."""
    displacement: FloatArray
    """(cells, 6 or 9, 2), mm."""
    numbers: FloatArray
    """(cells, 6 or 9): of the nodes."""
    region: FloatArray
    """(cells,)."""
    pressure: FloatArray
    """(cells, 6 or 9), kPa."""
    stretch: FloatArray
    """(cells, 6 or 9), the greatest principal one."""

    @classmethod
    def of(cls, fields: LegFields) -> "DrawnSection":
        """Return the arrays of some fields in a plane."""
        space = fields.displacement.function_space
        numbers = space.dofmap.list
        there = space.tabulate_dof_coordinates()[:, :2]
        moved = fields.displacement.x.array.reshape(-1, 2)
        quadratic = fem.functionspace(space.mesh, ("DG", 2))

        def at_nodes(linear: Any) -> FloatArray:
            values = fem.Function(quadratic)
            values.interpolate(linear)
            return np.asarray(values.x.array[quadratic.dofmap.list])

        return cls(
            there[numbers],
            moved[numbers],
            numbers,
            fields.region.x.array[: len(numbers)],
            at_nodes(fields.pressure),
            at_nodes(fields.stretch),
        )

    @property
    def cell_outlines(self) -> FloatArray:
        """Nodes of a cell in the order of its outline."""
        return np.array([k for edge in _EDGES[self.numbers.shape[1]] for k in edge[:2]])

    def interfaces(self, deformed: bool) -> FloatArray:
        """Return the edges (n, 3, 2) between tissues and on the boundary, mm."""
        sides: dict[tuple[int, ...], list[tuple[int, tuple[int, int, int]]]] = {}
        for cell, numbers in enumerate(self.numbers):
            for edge in _EDGES[len(numbers)]:
                key = tuple(sorted(int(numbers[k]) for k in edge))
                sides.setdefault(key, []).append((cell, edge))
        drawn = [both[0] for both in sides.values() if len({self.region[cell] for cell, _ in both}) > 1] + [
            both[0] for both in sides.values() if len(both) == 1
        ]
        at = self.nodes + self.displacement if deformed else self.nodes
        return np.array([at[cell, list(edge)] for cell, edge in drawn])


@style.styled
def leg_figure(
    fields: LegFields, section: LegSection, radius: float, depth: float, force: float, subject: str, origin: str
) -> Figure:
    """Return the undeformed section with its mesh beside the deformed one with the pressure.

    Parameters
    ----------
    fields
        In a plane, on one rank.
    section
        Contours (mm).
    radius, depth
        Of the indenter, and its displacement (mm).
    force
        Of the indenter (N).
    subject, origin
        Named in the title.
    """
    drawn = DrawnSection.of(fields)
    figure = style.new_figure(13.5, 4.9)
    style.title(figure, "Section of the leg before and after indentation (model)", subject, origin)
    before, after, near = figure.subplots(1, 3)
    _draw_mesh(before, drawn, section)
    style.panel(before, "A", f"undeformed, with its mesh ({len(drawn.region)} cells)")
    style.panel(after, "B", f"pressed in by {depth:g} mm: {force:.2f} N")
    style.panel(near, "C", "the same near the indenter")
    x, y = fields.indenter_centre
    for axes in (after, near):
        image = _draw_pressure(axes, drawn, section)
        axes.add_patch(Circle((x, y), radius, facecolor=style.TOOL_COLOUR, edgecolor="black", zorder=4))
        axes.annotate("indenter", (x, y), ha="center", va="center", zorder=5)
    bar = figure.colorbar(image, ax=near, extend="both", shrink=0.8, pad=0.02)
    bar.set_label("hydrostatic pressure (kPa),\npositive in compression")
    _frame(drawn, before, after)
    inwards = section.skin.mean(axis=0) - (x, y)
    x, y = (x, y) + 0.9 * radius * inwards / np.linalg.norm(inwards)
    reach = 1.9 * radius
    near.set(xlim=(x - reach, x + reach), ylim=(y - reach, y + reach))
    for axes in (before, after, near):
        axes.set_aspect("equal")
        axes.set_xlabel("x (mm)")
    before.set_ylabel("y (mm)")
    return figure


def _frame(drawn: DrawnSection, *panels: Axes) -> None:
    """Give panels the same limits, with the section and most of the indenter in them."""
    both = np.concatenate([drawn.nodes, drawn.nodes + drawn.displacement]).reshape(-1, 2)
    low, high = both.min(axis=0) - 12.0, both.max(axis=0) + 12.0
    for axes in panels:
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))


def _draw_mesh(axes: Axes, drawn: DrawnSection, section: LegSection) -> None:
    cells = drawn.nodes[:, drawn.cell_outlines]
    for name, tag in REGIONS.items():
        axes.add_collection(
            PolyCollection(
                cells[drawn.region == tag], facecolor=style.REGION_COLOURS[name], edgecolor="#00000055", linewidth=0.25
            )
        )
    _draw_bones(axes, section)
    axes.add_collection(LineCollection(list(drawn.interfaces(False)), colors="black", linewidths=0.6))
    handles: list[Any] = [
        Patch(facecolor=style.REGION_COLOURS[name], edgecolor="#555555", label=style.REGION_NAMES[name])
        for name in REGIONS
    ]
    handles.append(Patch(facecolor=style.BONE_COLOUR, edgecolor="black", label="bone (fixed)"))
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.11), ncols=2)


def _draw_pressure(axes: Axes, drawn: DrawnSection, section: LegSection) -> Any:
    at = drawn.nodes + drawn.displacement
    cells, nodes = drawn.numbers.shape
    pieces = np.arange(cells)[:, None, None] * nodes + np.array(_TRIANGLES[nodes])
    triangles = Triangulation(*at.reshape(-1, 2).T, pieces.reshape(-1, 3))
    tissue = drawn.region != REGIONS["fascia"]
    low, high = np.percentile(drawn.pressure[tissue], [0.5, 99.5])
    image = axes.tripcolor(
        triangles,
        drawn.pressure.ravel(),
        shading="gouraud",
        cmap="YlGnBu",
        vmin=min(low, 0.0),
        vmax=high,
        rasterized=True,
    )
    edges = LineCollection(list(at[:, drawn.cell_outlines]), colors="#00000040", linewidths=0.2)
    axes.add_collection(edges)
    axes.add_collection(LineCollection(list(drawn.interfaces(True)), colors="black", linewidths=0.6))
    _draw_bones(axes, section)
    outer = np.vstack([section.skin, section.skin[:1]])
    axes.plot(*outer.T, color="#666666", linewidth=0.8, linestyle="--", zorder=3.5)
    handles = [Line2D([], [], color="#666666", linestyle="--", label="skin before")]
    axes.legend(handles=handles, loc="upper center", bbox_to_anchor=(0.5, -0.11))
    return image


def _draw_bones(axes: Axes, section: LegSection) -> None:
    for name in ("tibia", "fibula"):
        contour = section.contour(name)
        axes.fill(*contour.T, facecolor=style.BONE_COLOUR, edgecolor="black", linewidth=0.8, zorder=3)
        label = axes.annotate(name, contour.mean(axis=0), ha="center", va="center", fontsize=8)
        label.set_path_effects([outline.withStroke(linewidth=2, foreground=style.BONE_COLOUR)])
        label.set_zorder(4)


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
    figure = style.new_figure(6.4, 6.9)
    style.title(figure, "Section of the leg and the cylinder at first touch", subject.title, subject.origin)
    axes = figure.subplots()
    fascia = section.polygon("fascia")
    inner = np.asarray(fascia.buffer(-section.fascia_thickness).exterior.coords)
    for name, ring in (("superficial", section.skin), ("fascia", section.fascia), ("deep", inner)):
        axes.fill(
            *ring.T,
            facecolor=style.REGION_COLOURS[name],
            edgecolor="black",
            linewidth=0.6,
            label=style.REGION_NAMES[name],
        )
    for bone in ("tibia", "fibula"):
        contour = section.contour(bone)
        axes.fill(*contour.T, facecolor=style.BONE_COLOUR, edgecolor="black", linewidth=0.8)
        axes.annotate(bone, contour.mean(axis=0), ha="center", va="center", fontsize=8)
    for number, scan in enumerate((scanned or {}).values()):
        axes.plot(
            *np.asarray(scan.exterior.coords).T,
            color=style.FAINT,
            linestyle="--",
            linewidth=1.0,
            label="as scanned" if number == 0 else None,
        )
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
    turn = np.radians(indenter.axis_deg)
    half = indenter.radius
    if indenter.shape == "cylinder":
        half = max(half, 0.5 * indenter.length * abs(np.sin(turn)))
    corners = [(-1, -half), (1, -half), (1, half), (-1, half)]
    outline = [middle + along * indenter.radius * ahead + side * beside for along, side in corners]
    return Outline(outline, closed=True, **colours)


@style.styled
def slices_figure(leg: StockingLeg) -> Figure:
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
            outlines = [slices.contours(part)[number] for part in CONTOURS]
            _outlines(axes, outlines, name, colour)
    for axes, level in zip(every, levels, strict=True):
        axes.set_title(f"z = {level:.0f} mm", loc="center")
        axes.set_aspect("equal")
        axes.set_xlabel("x (mm)")
    every[0].set_ylabel("y (mm)")
    every[0].invert_yaxis()
    figure.legend(*every[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _outlines(axes: Axes, outlines: Sequence[FloatArray], name: str, colour: str) -> None:
    for number, points in enumerate(outlines):
        closed = np.vstack([points, points[:1]])
        axes.plot(*closed.T, color=colour, lw=1.2, label=name if number == 0 else None)
