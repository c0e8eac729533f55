"""What a leg's shape is taken from: a label volume, contours, or surfaces."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from shapely import Polygon

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.geometry.contours import MUSCLE_HULL, read_loops
from legfem.geometry.leg_shape import HULL, LegShape
from legfem.geometry.motion import CuttingPlane
from legfem.geometry.part_names import muscle_named
from legfem.geometry.section import CALF, LIMBS, LegSection
from legfem.geometry.section_from_outlines import Clearances, hull_of_bones, polygons_of, section_from_outlines
from legfem.imaging.label_volume import LabelVolume, check_anatomy, cropped, unsaid_tissues, with_bones_between
from legfem.imaging.outlines import OutlineSettings, not_closed, read_shape, shape_of_outlines, shape_of_volume
from legfem.imaging.shape_schema import Labels, ShapeEntry, existing
from legfem.imaging.surfaces import ends_of, outlines_of_surfaces, read_surface, read_surfaces, shape_of_surfaces

_STEP = 0.25  # mm along the leg


def outlines_of_shape(shape: LegShape, plane: CuttingPlane, source: str) -> dict[str, Polygon]:
    """Return the outlines of skin, muscles' hull and bones where a plane cuts a shape.

    Raises
    ------
    InputError
        If a part ends before the plane has cut it.
    """
    cut = {part: Polygon(_contour(shape, part, plane, source)) for part in shape.parts}
    return {MUSCLE_HULL if part == HULL else part: polygon for part, polygon in cut.items()}


def _contour(shape: LegShape, part: str, plane: CuttingPlane, source: str) -> FloatArray:
    """Return where the lines along the leg through a part's points meet a plane, (n, 2), mm."""
    z = np.linspace(shape.levels[0], shape.levels[-1], 2 + int(shape.length / _STEP))
    points = shape.at_levels(z).points(part)
    above = plane.height(points)
    above[np.abs(above) < 1e-9] = 0.0
    passes = (above[:-1] <= 0) & (above[1:] >= 0)
    if not passes.any(axis=0).all():
        problem = f"{plane} leaves the scan, {z[0]:.4g} to {z[-1]:.4g} mm"
        raise InputError(source, part, problem, "choose a level or a position within it")
    at, along = np.argmax(passes, axis=0), np.arange(points.shape[1])
    low, high = above[at, along], above[at + 1, along]
    share = (-low / np.where(high > low, high - low, 1.0))[:, None]
    return plane.flat((1 - share) * points[at, along] + share * points[at + 1, along])


_BEYOND = 40.0
"""Length of a scan above and below a cut that is outlined (mm): smoothing along the leg reaches so far."""
_APART = 5.0
"""Distance between the cross-sections that are kept beside a section, mm."""
_FINE = OutlineSettings(n_points=360)


@dataclass(frozen=True, eq=False)
class LegSource:
    """What a leg's shape is taken from, read; one of its kinds is there."""

    name: str
    """Name of the file in errors."""
    volume: LabelVolume | None = None
    contours: Path | None = None
    surfaces: Mapping[str, list[Any]] | None = None
    """Surfaces by part, as `legfem.imaging.surfaces.read_surfaces` returns them."""
    levels: tuple[float, float] = (-np.inf, np.inf)
    """Levels between which it is read and checked, mm."""
    muscle: bool = True
    """Whether a volume has to show any."""
    muscles: Mapping[str, "LegSource"] = field(default_factory=dict)
    """Those that are regions of their own, each as the only bone would be read."""

    @classmethod
    def of_scan(
        cls, file: Path, meaning: Mapping[str, Labels] | None, series: Path | None = None, muscles: Iterable[str] = ()
    ) -> "LegSource":
        """Read a label volume; see `legfem.imaging.volume_file.read_volumes`."""
        from legfem.imaging.volume_file import read_volumes

        volume, alone = read_volumes(file, meaning, series, muscles)
        own = {muscle: cls(str(file), one, muscle=False) for muscle, one in alone.items()}
        return cls(str(file), volume, muscles=own)

    @classmethod
    def of_surfaces(cls, name: str, files: Mapping[str, Sequence[Path]], muscles: Iterable[str] = ()) -> "LegSource":
        """Read the surfaces of a leg's parts; see `legfem.imaging.surfaces.read_surfaces`."""
        of_muscles = {muscle: files[muscle_named(muscle, files, name)] for muscle in muscles}
        own = {n: cls(name, surfaces={n: list(map(read_surface, those))}) for n, those in of_muscles.items()}
        return cls(name, surfaces=read_surfaces(files), muscles=own)

    @classmethod
    def opened(
        cls,
        directory: Path,
        toml: Path,
        table: str,
        entry: ShapeEntry,
        labels: Mapping[str, Labels],
        muscles: Iterable[str] = (),
    ) -> "LegSource":
        """Read what a table of a folder's file names.

        Raises
        ------
        InputError
            If a file is missing or can't be read.
        """

        def path(name: str) -> Path:
            return existing(directory, name, toml, table)

        if entry.scan is not None:
            series = None if entry.series is None else path(entry.series)
            meaning = {**unsaid_tissues(labels, str(toml)), **labels} if labels else None
            return cls.of_scan(path(entry.scan), meaning, series, muscles)
        if entry.contours is not None:
            file = path(entry.contours)
            return cls(str(file), contours=file)
        assert entry.surfaces is not None
        files = {
            part: [path(name) for name in ([names] if isinstance(names, str) else names)]
            for part, names in entry.surfaces.items()
        }
        return cls.of_surfaces(f"{toml.parent / 'surfaces'}", files, muscles)

    def between(self, low: float, high: float) -> "LegSource":
        """Return the source between two levels (mm): what lies beyond may be anything."""
        volume = None if self.volume is None else cropped(self.volume, low, high)
        return replace(self, volume=volume, levels=(low, high))

    def shape_between(self, low: float, high: float) -> LegShape:
        """Return the leg's shape between two levels (mm), or as much of it as was scanned.

        Its parts have room between them, so that it can be meshed.

        Raises
        ------
        InputError
            If there are fewer than two levels, or the parts can't be told.
        """
        within, levels = self.between(low, high), None
        if self.surfaces is not None:
            lowest, highest = np.array([ends_of(every) for every in self.surfaces.values()]).T
            # A plane through a surface's very end cuts nothing.
            first, last = max(low, float(lowest.max()) + 1.0), min(high, float(highest.min()) - 1.0)
            levels = np.linspace(first, last, max(2, 1 + round((last - first) / _APART)))
        return within.shape(OutlineSettings(), levels, Clearances())

    def shape(self, settings: OutlineSettings, levels: FloatArray | None, room: Clearances | None = None) -> LegShape:
        """Return the leg's shape, its parts moved apart where they lack room.

        Parameters
        ----------
        settings : OutlineSettings
            How a volume is outlined.
        levels : (n,) array, optional
            At which to cut surfaces, which need them (mm).
        room : Clearances, optional
            Between the parts.
        """
        if self.volume is not None:
            check_anatomy(self.volume, self.muscle)
            return shape_of_volume(self.volume, settings, room)
        if self.contours is not None:
            return read_shape(self.contours, self.levels)
        assert self.surfaces is not None and levels is not None
        return shape_of_surfaces(self.surfaces, levels, self.name, room)

    def outlines(self, plane: CuttingPlane) -> dict[str, Polygon]:
        """Return the outlines of skin, muscles' hull and bones on a plane, as scanned.

        Raises
        ------
        InputError
            If one of them is missing there, or the scan ends before.
        """
        if self.surfaces is not None:
            return outlines_of_surfaces(self.surfaces, plane, self.name)
        if self.contours is not None:
            return _outlines_of_contours(self.contours, plane)
        return outlines_of_shape(self._near(plane), plane, self.name)

    def section(self, plane: CuttingPlane, fascia_thickness: float) -> LegSection:
        """Return the section on a plane.

        Raises
        ------
        InputError
            If an outline is missing there, or they don't allow one (see `section_from_outlines`).
        """
        muscles = {name: alone.outlines(plane)[name] for name, alone in self.muscles.items()}
        return section_from_outlines(self.outlines(plane), fascia_thickness, self.name, muscles)

    def _near(self, plane: CuttingPlane) -> LegShape:
        """Return the shape of a volume about a plane."""
        assert self.volume is not None
        ends = self.volume.origin[:2] + self.volume.spacing[:2] * self.volume.labels.shape[:2]
        low, high = plane.levels(self.volume.origin[:2], ends)
        volume = with_bones_between(self.volume, low, high)
        shape = replace(self, volume=volume).between(low - _BEYOND, high + _BEYOND).shape(_FINE, None)
        if not self.volume.bones and len(shape.bones) < len(LIMBS[CALF]):
            remedy = f"label {' and '.join(LIMBS[CALF])} apart from each other, or say which bone it is (femur = 3)"
            raise InputError(self.name, "bone", f"is in one piece at {plane}, where a calf has two", remedy)
        return shape

    def outlines_about(self, level: float) -> dict[float, dict[str, Polygon]]:
        """Return the outlines at a level (mm), and above and below it as far as there are any."""
        middle = CuttingPlane.at_level(level)
        cut = self.outlines
        if self.volume is not None:
            cut = partial(outlines_of_shape, self._near(middle), source=self.name)
        found = {level: cut(middle)}
        for way in (-_APART, _APART):
            for at in level + way * np.arange(1, 1 + round(_BEYOND / _APART)):
                try:
                    found[float(at)] = cut(CuttingPlane.at_level(float(at)))
                except InputError:
                    break
        return dict(sorted(found.items()))


def _outlines_of_contours(path: Path, plane: CuttingPlane) -> dict[str, Polygon]:
    levels, loops = read_loops(path)
    level = float(plane.point[2])
    nearest, parts = int(np.argmin(np.abs(levels - level))), list(chain(*loops))
    if plane.is_level and np.isclose(levels[nearest], level):
        return polygons_of(loops[nearest], path, f"level {level:g} mm", parts)
    if len(levels) < 2:
        problem = f"there is no level {level:g} mm, only {levels[0]:g} mm"
        raise InputError(path, "level", problem, "choose that level, or give contours at several")
    outlines = [polygons_of(here, path, f"level {at:g} mm", parts) for at, here in zip(levels, loops, strict=True)]
    has_muscle = MUSCLE_HULL in outlines[0]
    try:
        with_hull = [{MUSCLE_HULL: hull_of_bones(here), **here} for here in outlines]
        shape = shape_of_outlines(levels, with_hull, _FINE.n_points)
    except ValueError as error:
        raise not_closed(path, error) from None
    found = outlines_of_shape(shape, plane, str(path))
    return {part: one for part, one in found.items() if has_muscle or part != MUSCLE_HULL}
