"""The section of a leg and how the cylinder travels in it, as ``subject.toml`` says."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from legfem.common.errors import InputError
from legfem.common.tables import read_table
from legfem.common.units import FloatArray
from legfem.geometry.contours import read_contours
from legfem.geometry.cross_sections import section_from_outlines
from legfem.geometry.plane import CuttingPlane, turn_about_travel
from legfem.geometry.rigid import RigidTransform
from legfem.geometry.section import LegSection
from legfem.imaging.registration import register_points
from legfem.imaging.shape_entry import existing
from legfem.subjects.indenter_entry import IndenterEntry
from legfem.subjects.schema import SubjectFile

if TYPE_CHECKING:
    from legfem.imaging.leg_source import LegSource

_LANDMARKS = ("name", "x_mm", "y_mm", "z_mm", "scan_x_mm", "scan_y_mm", "scan_z_mm")
_MOST_APART = 6.0
"""Root mean square (mm) of registered landmarks' distances beyond which they aren't the same."""
_RATHER_ACROSS_DEG = 45.0


@dataclass(frozen=True, eq=False)
class Placement:
    """A section, and a line of travel in its plane."""

    section: LegSection
    aim: FloatArray
    """(2,), mm."""
    direction_deg: float
    cut_from: str = ""
    """File and plane, where the section was cut."""
    landmark_residual: float | None = None
    """Root mean square of the distances of registered landmarks, mm; None without any."""
    source: LegSource | None = None
    """What the section was cut from; None where its contours alone are given."""
    plane: CuttingPlane | None = None
    """In which it was cut."""
    axis_deg: float = 0.0
    """By which a cylinder is turned about its travel, from lying square to the plane."""


def placed(directory: Path, toml: Path, given: SubjectFile) -> Placement:
    """Read or cut the section, and bring the line of travel into its plane.

    Raises
    ------
    InputError
        If a file is missing or wrong, or the plane doesn't cut a leg; names file, field and remedy.
    """
    entry, indenter = given.section, given.indenter
    thickness = entry.fascia_thickness_mm
    if not given.is_cut:
        assert entry.contours is not None and indenter.aim_mm is not None
        assert indenter.direction_deg is not None
        path = existing(directory, entry.contours, toml, "section.contours")
        section = read_contours(path, thickness)
        aim = np.array(indenter.aim_mm)
        return Placement(section, aim, indenter.direction_deg, axis_deg=indenter.axis_deg or 0.0)
    # Readers of scans are slow to import, and most folders have none.
    from legfem.imaging.leg_source import LegSource

    source = LegSource.opened(directory, toml, "section", entry, given.labels)
    if indenter.position_mm is None:
        assert entry.level_mm is not None and indenter.aim_mm is not None
        assert indenter.direction_deg is not None
        plane = CuttingPlane.at_level(entry.level_mm)
        section = section_from_outlines(source.outlines(plane), thickness, source.name)
        cut = f"{Path(source.name).name}, {plane}"
        aim = np.array(indenter.aim_mm)
        return Placement(
            section, aim, indenter.direction_deg, cut, source=source, plane=plane, axis_deg=indenter.axis_deg or 0.0
        )
    if source.volume is not None and not source.volume.transform:
        raise InputError(
            source.name,
            "header",
            "says not where the volume lies, which a pose needs",
            "save it with its transform, or give the DICOM series it was labelled on as series",
        )
    motion, residual = _to_scan(directory, toml, indenter)
    position = motion(np.array(indenter.position_mm))
    direction = motion.rotation @ np.array(indenter.direction)
    axis = None if indenter.axis is None else motion.rotation @ np.array(indenter.axis)
    turn = indenter.axis_deg or 0.0
    if axis is not None:
        found = turn_about_travel(direction, axis, str(toml))
        # Of a cylinder that lies rather across the leg, the section still is one of the leg.
        axis, turn = (None, found) if abs(found) > _RATHER_ACROSS_DEG else (axis, 0.0)
    plane = CuttingPlane.of_cylinder(position, direction, axis, str(toml))
    section = section_from_outlines(source.outlines(plane), thickness, source.name)
    along = plane.flat(direction)
    angle = float(np.degrees(np.arctan2(along[1], along[0]))) % 360.0
    cut = f"{Path(source.name).name}, {plane}"
    return Placement(section, plane.flat(position), angle, cut, residual, source, plane, turn)


def _to_scan(directory: Path, toml: Path, indenter: IndenterEntry) -> tuple[RigidTransform, float | None]:
    """Return the motion from where the pose was measured to the scan, and what it leaves (mm)."""
    if indenter.landmarks is None:
        return RigidTransform(), None
    path = existing(directory, indenter.landmarks, toml, "indenter.landmarks")
    table = read_table(path, _LANDMARKS, text=("name",))
    here, there = (table[list(columns)].to_numpy(np.float64) for columns in (_LANDMARKS[1:4], _LANDMARKS[4:]))
    if len(table) < 3:
        raise InputError(path, "rows", f"{len(table)} landmarks are too few", "give three or more")
    found = register_points(here, there)
    apart = np.linalg.norm(found.transform(here) - there, axis=1)
    if found.residual > _MOST_APART:
        worst = table.iloc[int(np.argmax(apart))]
        raise InputError(
            path,
            str(worst["name"]),
            f"lies {apart.max():.1f} mm off once registered ({found.residual:.1f} mm in the mean)",
            "are points exchanged, or x and y of another sign (RAS)? give both in mm",
        )
    return found.transform, found.residual
