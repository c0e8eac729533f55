"""The 33 points of the paper's Table 2: every corner must reach full depth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

from legfem.common.units import kpa_to_mpa
from legfem.experiments.plane_strain import PlaneStrainIndentation, Tissues
from legfem.experiments.pressing import solved_once
from legfem.geometry.section import LegSection
from legfem.jobs.pool import Workers
from legfem.mechanics.materials import NeoHookean, ReducedPolynomial
from legfem.solve.report import SolveReport
from legfem.subjects.subject import Indenter


@dataclass(frozen=True)
class Point:
    """One point of the design; stiffnesses in kPa, thickness in mm."""

    c10_deep: float
    c20_deep: float
    c10_superficial: float
    c10_fascia: float
    fascia_thickness: float


@dataclass(frozen=True)
class CornerOutcome:
    """How far a point came."""

    point: Point
    report: SolveReport
    force_N: float
    """At the depth reached."""


TABLE_2 = Point(30.0, 30.0, 30.0, 10e3, 1.0)
TABLE_2_LOW = Point(0.5, 0.5, 1.0, 0.1e3, 0.2)


def table_2_points() -> list[Point]:
    """Return the 32 corners, then the centre."""
    low, high = vars(TABLE_2_LOW).values(), vars(TABLE_2).values()
    corners = [Point(*values) for values in product(*zip(low, high, strict=True))]
    centre = Point(*((a + b) / 2 for a, b in zip(low, high, strict=True)))
    return [*corners, centre]


def study_corners(
    section: LegSection, indenter: Indenter, depth: float = 30.0, jobs: int = 1
) -> Iterator[CornerOutcome]:
    """Simulate all points of Table 2 on a section; yields them in the design's order."""
    tasks = [(_test(point, section, indenter), depth) for point in table_2_points()]
    with Workers(solved_once, None, jobs) as workers:
        for solved, point in zip(workers.in_order(tasks), table_2_points(), strict=True):
            yield CornerOutcome(point, solved.report, float(solved.curve.force[-1]))


def _test(point: Point, section: LegSection, indenter: Indenter) -> PlaneStrainIndentation:
    deep = ReducedPolynomial(kpa_to_mpa(point.c10_deep), 28.0, kpa_to_mpa(point.c20_deep), 28.0)
    tissues = Tissues(
        deep,
        NeoHookean(kpa_to_mpa(point.c10_superficial), 22.5),
        NeoHookean(kpa_to_mpa(point.c10_fascia), 22.5),
    )
    layered = replace(section, fascia_thickness=point.fascia_thickness)
    return PlaneStrainIndentation(layered, indenter, tissues)
