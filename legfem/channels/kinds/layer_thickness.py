"""Thicknesses of the layers under the cylinder, along the line of travel, by ultrasound."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.polynomial import Polynomial

from legfem.channels import Sight
from legfem.channels import kind as base
from legfem.common.units import FloatArray
from legfem.geometry.indenter import Site
from legfem.geometry.section import first_crossing, layer_thicknesses

if TYPE_CHECKING:
    from legfem.channels.seen import Seen

_ULTRASOUND = base.ChannelAccuracy(reading=0.3, bias=0.3, gain=0.02, slow=0.1, lag=0.1)
"""Wall-to-wall distances in B-mode images: a pixel or two, the boundary's choice and the speed of sound."""
FAT = base.ChannelKind(
    "fat_thickness",
    "mm",
    "thickness of the fat under the cylinder",
    _ULTRASOUND,
    0.002,
    models=frozenset({"2d", "specimen"}),
    detail="along the line of travel",
)
MUSCLE = replace(
    FAT,
    name="muscle_thickness",
    quantity="thickness of the deep tissue",
    detail="from fascia to bone along the line of travel",
)
TISSUE = replace(
    FAT,
    name="tissue_thickness",
    quantity="thickness of all soft tissue",
    detail="from skin to bone along the line of travel",
)
_BETWEEN = {FAT.name: ("skin", "fascia"), MUSCLE.name: ("deep", "bone"), TISSUE.name: ("skin", "bone")}
"""Outlines that a layer lies between."""
_LAYERS = {FAT.name: ("superficial", "fat"), MUSCLE.name: ("deep", "muscle")}
"""Names of a specimen's layers."""
_APART_MM, _APART = 3.0, 0.35
"""Largest departure of a thickness from what is stated: in mm, or as a share of it where that is more."""
_MOST = 2.0
"""Greatest reading over the stated thickness."""
_TURNS = 0.02
"""Share of the way within which a press turns."""
_IN_MUSCLE_MM = 8.0
"""Under the fascia: where a figure marks the muscle."""


def between_of(layers: Mapping[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
    """Return by channel the heights (mm) between which the thickness of a specimen's layers is read.

    Parameters
    ----------
    layers
        By name the heights between which each lies.
    """
    found = {kind: layers[name] for kind, names in _LAYERS.items() for name in names if name in layers}
    ends = [end for one in layers.values() for end in one]
    return {**found, TISSUE.name: (min(ends), max(ends))} if ends else found


def refused(
    kind: base.ChannelKind,
    stated: float,
    depths: FloatArray,
    values: FloatArray,
    accuracy: base.ChannelAccuracy,
    stated_sd: float,
) -> base.Impossible | None:
    """Return why readings can't be the thickness of a layer; None where they can.

    Parameters
    ----------
    kind
        Kind of the channel.
    stated, stated_sd
        The layer's thickness before it is pressed, as stated, and the standard deviation of its ends, mm.
    depths, values
        (k,), mm: how deep it was pressed at each reading, NaN out of the loading; and the readings.
    accuracy
        Accuracy of the instrument.
    """
    name, kept = kind.title, np.isfinite(depths)
    depth, values = depths[kept], values[kept]
    if not len(values):
        return None
    # What lost the boundary writes 0.
    worst = int(np.argmax(np.where(values == 0, np.inf, np.abs(values - 0.5 * stated))))
    if values[worst] == 0 or not -3 * accuracy.reading <= values[worst] <= _MOST * stated + _APART_MM:
        return base.Impossible(
            f"it is {values[worst]:.3g} mm at {depth[worst]:.2g} mm of depth, and {stated:.3g} mm by what is stated",
            "check its unit and the outlines or sizes; leave a cell empty where nothing could be read",
        )
    # A single frame says little of how it changes.
    several = len(values) > 2 and np.ptp(depth) > 0
    ends = Polynomial.fit(depth, values, 1)(np.array([0.0, depth.max()])) if several else values[[0, 0]]
    start, end = map(float, ends)
    # Of a line through n readings.
    error = accuracy.reading * np.sqrt(12 / len(values))
    # Where the press turns, a frame may be of what follows.
    before = depth < depth.max() - _TURNS * np.ptp(depth)
    rises = len(np.unique(depth[before])) < 2 or np.polyfit(depth[before], values[before], 1)[0] > 0
    if several and rises and end - start > max(3 * error, 0.05 * stated):
        remedy = "check that the columns aren't exchanged, and that the frames are in order"
        return base.Impossible(f"the {name} grows from {start:.3g} to {end:.3g} mm as it is pressed", remedy)
    if several and start - end > depth.max() + 3 * error:
        problem = f"the {name} falls from {start:.3g} to {end:.3g} mm where what presses moves by {depth.max():.3g} mm"
        return base.Impossible(problem, "check its unit, and that its times are in s")
    first = float(np.mean(values[depth <= depth.min() + 0.1 * np.ptp(depth)]))
    tolerance = max(_APART_MM, _APART * stated, 3 * accuracy.bias, 3 * stated_sd) + float(depth.min())
    if abs(first - stated) > tolerance:
        return base.Impossible(
            f"the {name} is {first:.3g} mm at {depth.min():.2g} mm of depth, and {stated:.3g} mm by what is stated",
            "check its unit, the outlines or sizes, and that both are along the line of travel",
        )
    return None


class LayerThicknesses(base.ChannelFile):
    """Skin to fascia, fascia to the nearest bone, and both together; none where the line meets no bone."""

    kinds: ClassVar = (FAT, MUSCLE, TISSUE)

    def read(self, seen: "Seen") -> base.Channels:
        """Return the layers' thicknesses, of those whose outlines the line of travel meets."""
        found: dict[str, tuple[float, FloatArray]] = {}
        if seen.model.specimen is not None:
            for name, heights in between_of(seen.model.specimen.layers).items():
                (low, low_rates), (high, high_rates) = (seen.move((0.0, height), 1) for height in heights)
                found[name] = heights[1] - heights[0] + high - low, high_rates - low_rates
            return found
        for name, between in ((n, b) for n, b in _BETWEEN.items() if {*b} <= {*seen.lines}):
            (above, rising), (below, sinking) = (seen.lines[outline].place for outline in between)
            if np.isfinite(below - above):
                found[name] = below - above, sinking - rising
        return found

    def plans(self, site: Site) -> Sequence[base.ChannelPlan]:
        """Return both thicknesses in single frames, and all along beside the lateral force."""
        both, frame = (Sight(FAT.name), Sight(MUSCLE.name)), "take an ultrasound frame under the cylinder at {at}"
        frame, probe = f"{frame}, and read the thickness of fat and muscle", "an ultrasound probe in the indenter"
        single = base.ChannelPlan(frame, both, f"{probe}, and a minute to read each frame", frames=True)
        asks, every = "record the lateral force, and ultrasound all along", (Sight("lateral_force"), *both)
        return [single, base.ChannelPlan(asks, every, "both instruments, and software that follows the boundaries")]

    def check(self, kind: base.ChannelKind, recorded: base.ReadingsAtSite) -> base.Impossible | None:
        """Refuse a layer that grows as the cylinder presses, or isn't the section's."""
        site = recorded.site
        stated = layer_thicknesses(site.section, site.indenter.aim, site.direction).get(kind.name)
        if stated is None:
            problem = "the line of travel meets no bone in the section: so there is no such thickness"
            return base.Impossible(problem, "leave the column out, or correct aim_mm and direction_deg")
        return refused(kind, stated, recorded.depth, recorded.values, recorded.accuracy, recorded.outline_sd)

    def place(self, kind: base.ChannelKind, site: Site) -> FloatArray:
        """Return the middle of the fat, or a point within the muscle, under the cylinder."""
        skin, fascia = (
            first_crossing(site.section.polygon(part).exterior, site.touch, site.direction)
            for part in ("skin", "fascia")
        )
        along = 0.5 * (skin + fascia) if kind == FAT else fascia + _IN_MUSCLE_MM
        return np.asarray(site.touch + along * site.direction)
