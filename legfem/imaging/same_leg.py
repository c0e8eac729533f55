"""What tells that two scans aren't of one leg, bare and in its stocking.

Bones keep their shape, muscle and fat nearly their volume, and a stocking takes some per cent off the girth. So a
second scan that is another person's, mirrored, upside down or of another scale has a shinbone of another thickness or
course, or bones that don't come to lie on the first's, or fits better as its mirror image.
"""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from legfem.common.errors import Doubt, InputError
from legfem.common.units import FloatArray
from legfem.geometry.leg_shape import HULL, LegShape, perimeter
from legfem.geometry.section import area_and_centroid
from legfem.imaging.registration import Registration, register_shapes

# Mean perimeter in the stocking over that without: a stocking makes a leg thinner, by 1 to 4 %.
_THICKER = 1.001
"""Ratio of perimeters from which on the scans may be exchanged."""
_THICKER_BY_FAR = 1.005
"""Ratio of perimeters from which on they are."""
_THINNER = 0.94
"""Ratio of perimeters below which the scans may be two legs'."""
_MUSCLE = 0.08
"""Relative change of the muscle compartment's area: it is squeezed along the leg, and loses blood, by less."""
_BONE = 0.12
"""Relative change of the shinbone's area, root mean square over the levels: a boundary that is 0.5 mm off makes 8 %;
a leg upside down has 15 to 20 %, another person's as much as their bones differ."""
_REGISTERED_WITHIN = 0.2
"""mm: farther apart, mirror images are tried. The mirror image of 60 mm of round bones is 0.3 mm off the leg."""
_NOT_ONE_LEG = 1.0
"""Distance of registered bones, mm, that one leg's aren't apart."""
_IN_STATED = 4.0
"""The same over the stated error of an outline."""
_DOUBTED = 1.6
"""Times the stated error of an outline: one leg's bones, drawn twice with it, come to lie within 1.41 of it, and within
0.85 where the error is a wave of some centimetres."""
_FITS_BETTER = 0.6
"""Share of the distance that a mirror image leaves where that is the leg."""
_ONE_LEG = "give two scans of one leg, the same way up and to one scale"


def check_scans_differ(bare: LegShape, compressed: LegShape, toml: Path) -> None:
    """Check that a leg's two scans, as they were read, aren't one scan given twice.

    Raises
    ------
    InputError
        If all their outlines agree to a micrometre, which no second scan does.
    """
    same = bare.levels.shape == compressed.levels.shape and all(
        part in compressed.contours
        and compressed.contours[part].shape == xy.shape
        and np.allclose(compressed.contours[part], xy, rtol=0.0, atol=1e-3)
        for part, xy in bare.contours.items()
    )
    if same:
        remedy = "give the scan of the leg in its stocking, or leave [compressed] out"
        raise InputError(toml, "compressed", "is the same scan as [bare]", remedy)


def registered(bare: LegShape, compressed: LegShape, sd: float, toml: Path) -> Registration:
    """Register a leg's second scan on the bones of its first, as they were read, and check that they are one leg's.

    Parameters
    ----------
    bare, compressed : LegShape
        At a level a millimetre.
    sd : float
        Stated standard deviation of an outline, mm.
    toml : Path
        What errors name as the file.

    Returns
    -------
    Registration
        Of the second on the first.

    Raises
    ------
    InputError
        If the second fits as a mirror image, or its bones stay too far from the first's.
    """
    refused = partial(InputError, toml, "compressed")
    try:
        found = register_shapes(compressed, bare)
    except InputError as error:
        raise error.at(toml, "compressed", f"its bones don't fit those of [bare]: {error.problem}") from None
    if found.residual <= _REGISTERED_WITHIN:
        return found
    apart = f"after registration the two scans' bones are {found.residual:.2f} mm apart"
    for cause, change, remedy in _OTHERWISE:
        left = _residual(change(_thinned(compressed)), _thinned(bare))
        if left < _FITS_BETTER * found.residual:
            raise refused(f"is {cause}: {apart}, and {left:.2f} mm once that is undone", remedy)
    if found.residual > max(_NOT_ONE_LEG, _IN_STATED * sd):
        raise refused(f"is not the leg of [bare]: {apart}", f"{_ONE_LEG}, or state accuracy.contour_sd_mm")
    return found


def doubts_about_registration(found: Registration, sd: float, toml: Path) -> Iterator[Doubt]:
    """Yield a doubt where registered bones lie farther apart than two outlines of one leg, of error ``sd`` (mm)."""
    if found.residual > max(_REGISTERED_WITHIN, _DOUBTED * sd):
        yield Doubt(
            str(toml),
            "compressed",
            f"the two scans' bones are {found.residual:.2f} mm apart after registration, {found.residual / sd:.1f} "
            f"times the stated error of an outline, {sd:g} mm: they may be two people's",
            "check that both scans are of one leg, or state accuracy.contour_sd_mm",
        )


def doubts_about_second_scan(bare: LegShape, compressed: LegShape, toml: Path) -> Iterator[Doubt]:
    """Yield what is unlikely in a leg's shape in its stocking, on the bare one's levels.

    Raises
    ------
    InputError
        For what can't be one leg.
    """
    refused, doubt = partial(InputError, toml, "compressed"), partial(Doubt, str(toml), "compressed")
    bones = np.log(_areas(compressed, "tibia") / _areas(bare, "tibia"))
    if np.sqrt(np.mean(bones**2)) > _BONE:
        low, high = (100 * float(np.exp(f(bones))) for f in (np.min, np.max))
        spread = f"{low:.0f} to {high:.0f} %" if high - low > 1 else f"{high:.0f} %"
        problem = f"is not the leg of [bare]: its shinbone's section is {spread} of that in the bare scan"
        raise refused(problem, _ONE_LEG)
    ratio = float(np.mean(perimeter(compressed) / perimeter(bare)))
    if ratio > _THICKER:
        thicker = doubt(
            f"the leg is {100 * (ratio - 1):.2g} % thicker in its stocking than without",
            "are the scans of [bare] and [compressed] exchanged?",
        )
        yield from thicker.refused_if(ratio > _THICKER_BY_FAR)
    muscle = float(np.mean(_areas(compressed, HULL) / _areas(bare, HULL))) - 1
    if ratio < _THINNER or abs(muscle) > _MUSCLE:
        yield doubt(
            f"the leg is {100 * (1 - ratio):.2g} % thinner in its stocking than without, and its muscle's section "
            f"{100 * muscle:+.2g} %: stockings take 1 to 4 % off the girth, and muscle keeps its volume",
            "check that both scans are of one leg, at one scale",
        )


def _areas(shape: LegShape, part: str) -> FloatArray:
    """Return the areas that a part's outlines enclose, (n_levels,), mm2."""
    return np.array([abs(area_and_centroid(ring)[0]) for ring in shape.contours[part]])


def _thinned(shape: LegShape) -> LegShape:
    """Return a shape at every second level: enough to see which of several fits."""
    return shape.at_levels(shape.levels[::2])


def _residual(moving: LegShape, fixed: LegShape) -> float:
    try:
        return register_shapes(moving, fixed).residual
    except InputError:
        return np.inf


def _mirrored(shape: LegShape) -> LegShape:
    """Return a shape with x turned round, its outlines still counter-clockwise."""
    return LegShape(shape.levels, {part: (xy * (-1.0, 1.0))[:, ::-1] for part, xy in shape.contours.items()})


def _upended(shape: LegShape) -> LegShape:
    """Return a shape with its levels the other way round, as it is mirrored along the leg."""
    return LegShape(shape.levels, {part: xy[::-1] for part, xy in shape.contours.items()})


_OTHERWISE = (
    ("mirrored", _mirrored, "check the axes of both exports, and that both are the same leg, left or right"),
    ("upside down", lambda shape: _upended(_mirrored(shape)), "give both scans the same way up"),
    ("mirrored along the leg", _upended, "check the order and the axis of both scans' slices"),
)
"""What a scan may be, what undoes it, and how to mend it; a turn about the leg is found by the registration."""
