"""Where a leg is pressed: its section, drawn or a typical limb's, the line of travel in it, and its shape in 3D."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from legfem.common.errors import InputError
from legfem.common.input_files import read_table
from legfem.common.units import FloatArray
from legfem.geometry.contours import read_contours
from legfem.geometry.leg_shape import HULL, SKIN, LegShape, shape_of_contours
from legfem.geometry.motion import CuttingPlane, RigidTransform, rigidly_moved, turn_about_travel
from legfem.geometry.section import LegSection
from legfem.imaging.registration import register_points
from legfem.imaging.shape_schema import existing
from legfem.legs.schema import SUBJECTS, IndenterEntry, SectionEntry, SubjectFile, subject_entry
from legfem.legs.subject import Subject
from legfem.legs.typical import typical_section

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
    source: "LegSource | None" = None
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
        assert indenter.aim_mm is not None and indenter.direction_deg is not None
        if entry.contours is not None:
            path = existing(directory, entry.contours, toml, "section.contours")
            section = read_contours(path, thickness, {name: one.kind for name, one in given.regions.items()})
            groups = {name.lower(): tuple(map(str.lower, muscles)) for name, muscles in given.groups.items()}
            support = None if entry.support_mm is None else np.array(entry.support_mm)
            section = replace(section, groups=groups, support=support)
            if section.held.is_empty:
                problem = "there is no bone, and nothing says what else holds the limb"
                remedy = "add the outline of a bone, or the face of a plate that it lies on: support_mm under [section]"
                raise InputError(path, "part", problem, remedy)
        else:
            section = _typical(toml, entry)
        aim = np.array(indenter.aim_mm)
        return Placement(section, aim, indenter.direction_deg, axis_deg=indenter.axis_deg or 0.0)
    # Readers of scans are slow to import, and most folders have none.
    from legfem.imaging.leg_source import LegSource

    muscles = [name for name, region in given.regions.items() if region.kind == "muscle"]
    source = LegSource.opened(directory, toml, "section", entry, given.labels, map(str.lower, muscles))
    source = replace(source, muscle=thickness > 0)
    turn, residual = indenter.axis_deg or 0.0, None
    if indenter.position_mm is None:
        assert entry.level_mm is not None and indenter.aim_mm is not None and indenter.direction_deg is not None
        plane, aim, angle = CuttingPlane.at_level(entry.level_mm), np.array(indenter.aim_mm), indenter.direction_deg
    else:
        plane, aim, angle, turn, residual = _posed(directory, toml, indenter, source)
    section = source.section(plane, thickness)
    return Placement(section, aim, angle, f"{Path(source.name).name}, {plane}", residual, source, plane, turn)


def _posed(
    directory: Path, toml: Path, indenter: IndenterEntry, source: "LegSource"
) -> tuple[CuttingPlane, FloatArray, float, float, float | None]:
    """Return the plane in which an indenter travels in a scan, its line there, turn and landmarks' residual."""
    if source.volume is not None and not source.volume.transform:
        remedy = "save it with its transform, or give the DICOM series it was labelled on as series"
        raise InputError(source.name, "header", "does not state where the volume lies, which a pose needs", remedy)
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
    along = plane.flat(direction)
    angle = float(np.degrees(np.arctan2(along[1], along[0]))) % 360.0
    return plane, plane.flat(position), angle, turn, residual


def _typical(toml: Path, entry: SectionEntry) -> LegSection:
    """Section of a typical limb of the stated girth and fat."""
    assert entry.girth_mm is not None and entry.fat_mm is not None
    try:
        return typical_section(entry.limb, entry.girth_mm, entry.fat_mm, entry.fascia_thickness_mm)
    except InputError as error:
        sizes = f"{entry.fat_mm:g} mm of fat and a girth of {entry.girth_mm:g} mm"
        problem = f"{sizes} make no {entry.limb} ({error.problem})"
        raise InputError(toml, "section.fat_mm", problem, "measure both again, or give contours") from None


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
        problem = f"lies {apart.max():.1f} mm off once registered ({found.residual:.1f} mm in the mean)"
        remedy = "are points exchanged, or x and y of another sign (RAS)? give both in mm"
        raise InputError(path, str(worst["name"]), problem, remedy)
    return found.transform, found.residual


LENGTH = 120.0
"""Length of the leg that is modelled, mm: that of the tabulated correction's idealised legs."""
_LEVELS = 5
_BEYOND = 10.0
"""Past the ends (mm) a scan is read, so that they are smooth, and square to a tilted cylinder."""
_SHORT = 1.0
"""mm that a scan may lack before it is said."""


@dataclass(frozen=True, eq=False)
class SpatialLeg:
    """A segment of a leg, the middle of the cylinder's axis at z = 0, its axis along z.

    Parameters
    ----------
    shape
        In the coordinates of the subject's section.
    source
        What the shape was taken from, in words.
    extruded
        Whether one section stands for the whole length, which is an assumption.
    """

    shape: LegShape
    source: str
    extruded: bool

    def trimmed(self, held: float, share: float) -> "SpatialLeg":
        """Return the leg with a share of what lies beyond the middle ``held`` (mm) cut away."""
        half = 0.5 * held
        low, high = self.shape.levels[0], self.shape.levels[-1]
        z = np.linspace(low + share * (-half - low), high - share * (high - half), len(self.shape.levels))
        return replace(self, shape=self.shape.at_levels(z))


def spatial_leg(subject: Subject) -> SpatialLeg:
    """Return the leg in 3D about a subject's cylinder.

    It is taken from the scan, the stacked contours or the surfaces that the section was cut from.
    Where contours of one level are all there is, they are extruded.

    Raises
    ------
    InputError
        If what it is taken from doesn't hold the cylinder's whole length, or can't be read.
    """
    toml = SUBJECTS.opened(subject.directory)
    given = subject_entry(toml, subject.site).given
    length = given.section.length_mm or LENGTH
    held = subject.indenter.extent
    if length <= held:
        problem = f"{length:g} mm is no longer than the cylinder"
        raise InputError(toml, "section.length_mm", problem, f"give more than {held:g} mm, twice that or more")
    place = placed(subject.directory, toml, given)
    if place.source is None:
        what = f"a typical {subject.typical_shape}'s section" if subject.typical_shape else "the section"
        words = f"{what}, extruded over {length:g} mm"
        return SpatialLeg(_extruded(subject.section, length), words, True)
    shape = _about(place, 0.5 * length)
    low, high = (float(shape.levels[k]) for k in (0, -1))
    half = 0.5 * held
    if low > -half or high < half:
        problem = f"reach from {low:.4g} to {high:.4g} mm about the cylinder's middle, which takes {held:g} mm"
        raise InputError(place.source.name, "levels", problem, "scan a longer part of the leg, or press elsewhere")
    words = f"{Path(place.source.name).name}, {low:.4g} to {high:+.4g} mm about the cylinder"
    if high - low < length - _SHORT:
        words += f" (all there is of {length:g} mm)"
    return SpatialLeg(shape, words, False)


def _extruded(section: LegSection, length: float) -> LegShape:
    names = {SKIN: "skin", HULL: "fascia", **{bone: bone for bone in section.bones}}
    contours = {part: [section.contour(name)] * _LEVELS for part, name in names.items()}
    return shape_of_contours(np.linspace(-length / 2, length / 2, _LEVELS), contours)


def _about(place: Placement, half: float) -> LegShape:
    """Return the shape in the coordinates of the plane, up to ``half`` (mm) on either side."""
    plane, source = place.plane, place.source
    assert plane is not None and source is not None
    normal, tilt = plane.normal, float(np.hypot(plane.normal[0], plane.normal[1]))
    # How far the plane itself goes up and down over the leg.
    reach = (half + _BEYOND) * float(normal[2])
    outline = place.section.skin
    corners = outline[:, :1] * plane.axes[0] + outline[:, 1:] * plane.axes[1]
    above = (corners + (normal @ plane.point) * normal)[:, 2]
    shape = source.shape_between(float(above.min()) - reach, float(above.max()) + reach)
    shift = -float(normal @ plane.point)
    if tilt < 1e-9:
        moved = LegShape(shape.levels + shift, shape.contours)
    else:
        moved = rigidly_moved(shape, np.vstack([plane.axes, normal]), np.array([0.0, 0.0, shift]))
    low, high = max(-half, moved.levels[0]), min(half, moved.levels[-1])
    if low >= high:
        return moved
    inside = moved.levels[(moved.levels > low + 0.1) & (moved.levels < high - 0.1)]
    return moved.at_levels(np.concatenate([[low], inside, [high]]))
