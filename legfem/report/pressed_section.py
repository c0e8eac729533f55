"""A section solved once more for the report, its states kept for a reader to press."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import mpi4py.MPI  # noqa: F401  # first, see legfem.fem
import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from legfem.common.units import FloatArray
from legfem.experiments.experiment import Solved
from legfem.experiments.indentation import is_due
from legfem.experiments.plane_strain import PlaneStrainIndentation
from legfem.fem.fields import FieldReader, LegFields
from legfem.geometry.indenter import first_touch
from legfem.geometry.section import LAYERS, LegSection
from legfem.legs.subject import Subject
from legfem.meshing.section import REGIONS
from legfem.report.curves import packed
from legfem.report.page import PressedSection, StillSection
from legfem.report.style import BONE_COLOUR, part_colour, regions
from legfem.report.words import TOLD

# Corners of a second-order cell in the order of its outline, among DOLFINx' nodes.
_CORNERS = {6: [0, 1, 2], 9: [0, 1, 3, 2]}


_MOVE, _SHARE = 1 / 200, 1 / 50_000
"""mm, and share of a measure's range, a count: what whole numbers of 16 bits hold of them."""
_MARGIN = 12.0


@dataclass(frozen=True, eq=False)
class State:
    """The section at one displacement of the indenter, cell by cell; of one rank, so use it on one rank."""

    displacement: float
    """mm."""
    centre: FloatArray
    """(2,), mm: of the indenter."""
    vertices: NDArray[np.int_]
    """(cells, 3 or 4): numbers of the corners."""
    corners: FloatArray
    """(cells, 3 or 4, 2), mm, undeformed."""
    moved: FloatArray
    """(cells, 3 or 4, 2), mm: the corners' displacement."""
    region: FloatArray
    """(cells,)."""
    measures: FloatArray
    """(3, cells), means over a cell: pressure (kPa), movement (mm), greatest principal stretch."""

    @classmethod
    def of(cls, at: float, fields: LegFields) -> "State":
        """Return the state of some fields in a plane, at a displacement (mm)."""
        space = fields.displacement.function_space
        nodes = space.dofmap.list
        vertices = nodes[:, _CORNERS[nodes.shape[1]]]
        moved = fields.displacement.x.array.reshape(-1, 2)
        quadratic = fem.functionspace(space.mesh, ("DG", 2))

        def mean(linear: Any) -> FloatArray:
            values = fem.Function(quadratic)
            values.interpolate(linear)
            return np.asarray(values.x.array[quadratic.dofmap.list].mean(axis=1))

        movement = np.linalg.norm(moved[nodes], axis=2).mean(axis=1)
        return cls(
            at,
            np.array(fields.indenter_centre),
            vertices,
            space.tabulate_dof_coordinates()[vertices, :2],
            moved[vertices],
            fields.region.x.array[: len(nodes)],
            np.stack([mean(fields.pressure), movement, mean(fields.stretch)]),
        )


@dataclass(eq=False)
class Film:
    """Takes states of a section while it is being pressed, for `PlaneStrainIndentation.solve`."""

    experiment: PlaneStrainIndentation
    depth: float
    """mm, to which it is pressed."""
    states: list[State] = field(default_factory=list)

    @cached_property
    def reader(self) -> FieldReader:
        """Reader of the experiment's fields."""
        return FieldReader(self.experiment.system)

    def take(self, at: float) -> None:
        """Keep the state at a displacement (mm), unless the last one is near."""
        if self.states and at < self.states[-1].displacement:
            self.states.clear()  # the solution began anew
        last = self.states[-1].displacement if self.states else 0.0
        if not is_due(at, last, self.depth):
            return
        self.states.append(State.of(at, self.reader.read()))


def pressed_section(film: Film, displacement: FloatArray, force: FloatArray, what: str) -> PressedSection | None:
    """Return the states of a film with their forces (N); None where there are too few."""
    if len(film.states) < 2:
        return None
    first, touch = film.states[0], film.experiment.section_mesh.touch
    numbers, cells = np.unique(first.vertices, return_inverse=True)
    cells = cells.reshape(first.vertices.shape)
    at, moves = np.zeros((len(numbers), 2)), np.zeros((len(film.states) + 1, len(numbers), 2))
    at[cells] = first.corners
    for move, state in zip(moves[1:], film.states, strict=True):
        move[cells] = state.moved
    unpressed = np.broadcast_to([[0.0], [0.0], [1.0]], first.measures.shape)
    measured = np.stack([unpressed, *(state.measures for state in film.states)], axis=1)
    tissue = first.region != REGIONS["fascia"]
    depths = [0.0, *(state.displacement for state in film.states)]
    forces = [0.0, *(float(np.interp(depth, displacement, force)) for depth in depths[1:])]
    centres = [touch.tolist(), *(state.centre.tolist() for state in film.states)]
    rows = [
        [f"{d:.1f}", f"{f:.2f}", f"{p[tissue].max():.1f}", f"{moved.max():.1f}", f"{stretch[tissue].max():.2f}"]
        for d, f, p, moved, stretch in zip(depths, forces, *measured, strict=True)
    ]
    measures = [_measure(*named, values, tissue) for named, values in zip(_MEASURES, measured, strict=True)]
    section, radius = film.experiment.section, film.experiment.indenter.radius
    names = regions(section)
    colours = {REGIONS[name]: colour for name, (_, colour) in names.items()}
    content = {
        "displacement": depths,
        "force": forces,
        "centres": centres,
        "radius": radius,
        "vertices": np.round(at, 3).ravel().tolist(),
        "corners": cells.shape[1],
        "cells": packed(cells, "<u2"),
        "moves": packed(moves / _MOVE, "<i2"),
        "mm_a_count": _MOVE,
        "measures": measures,
        "share_a_count": _SHARE,
        "tissue": [colours.get(int(tag), names["deep"][1]) for tag in first.region],
        "bones": [outline.round(2).tolist() for outline in section.bones.values()],
        "skin": section.skin.round(2).tolist(),
        "bone": BONE_COLOUR,
        "frame": _frame(section, radius, *centres),
    }
    tissues = [*names.values(), ("bone (fixed)", BONE_COLOUR)]
    return PressedSection(what, content, depths[-1], [name for name, *_ in _MEASURES], rows, tissues)


_MEASURES = (("pressure", "kPa", 0), ("movement", "mm", 1), ("stretch", "", 2))
"""By which a section is coloured, their units, and the least decimals."""


def _measure(name: str, unit: str, least_digits: int, values: FloatArray, tissue: NDArray[np.bool_]) -> dict[str, Any]:
    """Return a measure's values (states, cells), and between which of a leg's it is coloured."""
    first = float(values[0, 0])
    low, high = np.percentile(values[-1][tissue], [0.5, 99.5])
    low, high = min(float(low), first), max(float(high), first + 1e-9)
    digits = int(np.clip(1 - np.floor(np.log10(high - low)), least_digits, 3))
    shares = np.clip((values - low) / (high - low), 0.0, 1.0)
    return {
        "name": name,
        "unit": unit,
        "digits": digits,
        "range": [low, high],
        "values": packed(shares / _SHARE, "<u2"),
    }


def _frame(section: LegSection, radius: float, *centres: Any) -> list[float]:
    """Return left, bottom, width and height (mm) of what is seen."""
    points = np.vstack([section.skin, np.asarray(centres) - radius, np.asarray(centres) + radius])
    low, high = points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN
    return [float(v) for v in (*low, *(high - low))]


def still_section(subject: Subject) -> StillSection:
    """Return a subject's section with its indenter."""
    section, indenter = subject.section, subject.indenter
    centre = first_touch(section.skin, indenter.radius, indenter.aim, indenter.direction)
    end = centre + indenter.direction * indenter.radius
    left, bottom, width, height = _frame(section, indenter.radius, centre)
    outlines = [
        (part, part_colour(section, part), " ".join(f"{x:.1f},{-y:.1f}" for x, y in section.contour(part)))
        for part in section.parts
    ]
    layers = " Fat is light, muscle dark, the fascia the line between them." if section.layers == LAYERS else ""
    return StillSection(
        "Section of the leg as it was given, with the cylinder where it first touches the skin and "
        f"the way it is pressed.{layers}",
        f"{left:.1f} {-bottom - height:.1f} {width:.1f} {height:.1f}",
        outlines,
        (float(centre[0]), float(-centre[1]), float(indenter.radius)),
        (float(centre[0]), float(-centre[1]), float(end[0]), float(-end[1])),
    )


@dataclass(frozen=True, eq=False)
class Filmed:
    """A solution, and the states on its way; none of those where ranks share a section."""

    experiment: PlaneStrainIndentation
    film: Film | None
    solved: Solved

    @property
    def is_final(self) -> bool:
        """Whether the system is in the solution's last state: a finer mesh has another."""
        mesh, system = self.experiment.section_mesh, self.experiment.system
        here = float((system.skin.domain.centre.value - mesh.touch) @ mesh.direction)
        own_mesh = self.solved.report.unknowns == system.spaces.unknowns
        return own_mesh and bool(np.isclose(here, self.solved.report.reached))

    @property
    def fields(self) -> LegFields:
        """Fields of the system's present state, by the film's expressions where it has some."""
        reader = FieldReader(self.experiment.system) if self.film is None else self.film.reader
        return reader.read()

    def section(self, what: str) -> PressedSection | None:
        """Return the section to press, of ``what`` in words; None where there is none to show."""
        if self.film is None or not self.is_final:
            return None
        return pressed_section(
            self.film,
            self.solved.curve.displacement,
            self.solved.curve.force,
            f"Section of the leg with {what} while the cylinder is pressed in (model): {TOLD['pressed_in']}",
        )


def filmed(experiment: PlaneStrainIndentation, values: Mapping[str, float], depth: float) -> Filmed:
    """Solve for values (MPa, 1/MPa) to a depth (mm), unless that was done in this process."""
    film = Film(experiment, depth) if experiment.comm.size == 1 else None
    replay = experiment.replays.find(values, depth)
    if film is not None and replay is not None and replay.solved is not None:
        for at in replay.show():
            film.take(at)
        return Filmed(experiment, film, replay.solved)
    on_step = None if film is None else film.take
    return Filmed(experiment, film, experiment.solve(values, depth, on_step=on_step))
