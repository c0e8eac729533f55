"""What in a subject can't be (an error) or is unlikely (a doubt): units, sizes, aim, tissues, stiffness.

The recordings are looked at in `legfem.legs.plausible_recordings`.

People differ: muscle of one calf in twenty is 2.7 times as stiff as the median's, or as soft. So a
factor of 2 in the force, as of a wrong gain, can't be told from them, and one of 4 often not; nor
can a radius for a diameter, which changes the force of a long cylinder little.
"""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from scipy.special import ndtri
from shapely import Point

from legfem.common.errors import Doubt, InputError
from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.data.ranges import MISTAKEN_UNITS, RANGES, c10_of, doubts_about_size, width_of
from legfem.geometry.section import CALF, LIMBS, MUSCLE, first_crossing, girth, way_to_bone
from legfem.inverse.catalogue import key_of
from legfem.inverse.elastography import doubts_about_elastography
from legfem.inverse.estimates import Estimate
from legfem.inverse.parameter import Prior
from legfem.inverse.population import ANYWHERE, SHIN, TISSUES, population, population_prior
from legfem.legs.plausible_recordings import doubts_about_recordings
from legfem.legs.subject import Subject, TissueParameters

_GRAZING_DEG = 30.0
"""Between travel and the skin's inward normal, beyond which a cylinder slides off."""
_MISSING_DEG = 60.0
_SHARP_DEG = 60.0
_FAR_OUT, _FAR_OUT_MM = 3.0, 1.0
"""Times the points' distance, or mm, that a spike is long."""
_LANDMARKS_MM = 2.0
"""Of error in the aim, which a diagnosis assumes without a word."""
_LONGEST, _LONGEST_CALF = 2.0, 1.5
"""Of a section over its width: calves have 1.0 to 1.3, ankles up to 1.4, a forearm above the wrist 1.6."""
_MOST_OF_LEG = 0.8
"""Of the leg's thickness along the line of travel: no deeper without a bone either."""


def doubts_about(subject: Subject) -> tuple[Doubt, ...]:
    """Return what is unlikely in a subject, but for what its folder says was confirmed.

    Raises
    ------
    InputError
        For what can't be; names file, field and remedy.
    """
    toml, thickness = subject.directory / "subject.toml", subject.section.fascia_thickness
    found = [
        *_bones(toml, subject),
        *(RANGES["fascia_thickness"].doubts(toml, "section.fascia_thickness_mm", thickness) if thickness else ()),
        *_stretched(toml, subject),
        *(d for part in subject.section.parts for d in _spike(toml, part, subject.section.contour(part))),
        *_landmarks(toml, subject),
        *_indenter(toml, subject),
        *(d for name, t in subject.tissues.items() for d in _tissue(toml, f"tissues.{name}", t)),
        *doubts_about_elastography(toml, subject.elastography),
        *doubts_about_recordings(subject, toml, room_before(subject)),
    ]
    return tuple(doubt for doubt in found if doubt.field not in subject.confirmed)


def poisson_ratio(tissue: TissueParameters) -> float | None:
    """Return Poisson's ratio at small strain; None for a tissue without a stiffness."""
    if tissue.C10 is None:
        return None
    bulk, shear = 2 / tissue.D1, 2 * tissue.C10
    return (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)


def room_before(subject: Subject) -> float:
    """Return how far the cylinder can go from first touch until it meets a bone, mm.

    At most 0.8 of the leg's thickness there.
    """
    section, indenter = subject.section, subject.indenter
    skin, travel = section.polygon("skin"), (indenter.aim, indenter.direction)
    touch = first_crossing(skin.buffer(indenter.radius).exterior, *travel)
    near = first_crossing(skin.exterior, *travel)
    far = -first_crossing(skin.exterior, indenter.aim, -indenter.direction)
    return min(_MOST_OF_LEG * (far - near), way_to_bone(section, *travel, indenter.radius) - touch)


def _bones(toml: Path, subject: Subject) -> Iterator[Doubt]:
    """Yield a doubt about a calf's size, or about a section that lacks a bone which runs beside another."""
    section, field = subject.section, "section.contours"
    if section.limb == CALF:
        yield from doubts_about_size(toml, field, girth(section), section.bones[LIMBS[CALF][0]])
    for bone, outline in section.bones.items():
        yield from RANGES["bone"].doubts(toml, f"{field}, {bone}", width_of(outline))
    for limb, bones in LIMBS.items():
        missing = [bone for bone in bones if bone not in section.bones]
        if len(bones) == 2 and len(missing) == 1:
            problem = f"there is no {missing[0]}, which a {limb} has"
            yield Doubt(str(toml), field, problem, "add its outline, unless the section passes it by")


def _stretched(toml: Path, subject: Subject) -> Iterator[Doubt]:
    """Yield a doubt about a section that is longer one way than any leg is."""
    corners = np.array(subject.section.polygon("skin").minimum_rotated_rectangle.exterior.coords)
    narrow, wide = sorted(np.linalg.norm(np.diff(corners[:3], axis=0), axis=1))
    limb = subject.section.limb
    if wide > (_LONGEST_CALF if limb == CALF else _LONGEST) * narrow:
        size = f"{wide:.0f} mm one way and {narrow:.0f} mm the other, {wide / narrow:.2g} times"
        problem = f"the leg is {size}: longer than any {limb or 'limb'} is wide"
        yield Doubt(str(toml), "section.contours", problem, "check the image's spacing along both axes")


def _spike(toml: Path, part: str, outline: FloatArray) -> Iterator[Doubt]:
    """Yield a doubt about a point of an outline (n, 2) that stands out alone, by how far it does.

    The line to it goes out and back much farther than points lie apart.
    """
    before, after = np.roll(outline, 1, axis=0) - outline, np.roll(outline, -1, axis=0) - outline
    ways = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    shorter = np.minimum(*ways)
    cosine = np.sum(before * after, axis=1) / np.maximum(ways[0] * ways[1], 1e-12)
    out = np.where(cosine > math.cos(math.radians(_SHARP_DEG)), shorter, 0.0)
    worst = int(np.argmax(out))
    if out[worst] > _FAR_OUT * max(float(np.median(ways[1])), _FAR_OUT_MM):
        x, y = outline[worst]
        problem = f"the {part} has a spike of {out[worst]:.2g} mm at ({x:.1f}, {y:.1f})"
        yield Doubt(str(toml), "section.contours", problem, "remove the point")


def _landmarks(toml: Path, subject: Subject) -> Iterator[Doubt]:
    apart = subject.landmark_residual
    if apart is not None and apart > _LANDMARKS_MM:
        problem = f"registered landmarks lie {apart:.1f} mm apart in the mean"
        remedy = f"measure them again, or give accuracy.aim_sd_mm = {apart:.1f}"
        yield Doubt(str(toml), "indenter.landmarks", problem, remedy)


def _indenter(toml: Path, subject: Subject) -> Iterator[Doubt]:
    indenter = subject.indenter
    diameter = 2 * indenter.radius
    yield from RANGES["cylinder_diameter"].doubts(toml, "indenter.diameter_mm", diameter)
    if diameter > girth(subject.section) / math.pi:
        problem, remedy = f"{diameter:g} mm are more than the leg's own", "give the cylinder's diameter in mm"
        raise InputError(toml, "indenter.diameter_mm", problem, remedy)
    yield from RANGES["cylinder_length"].doubts(toml, "indenter.length_mm", indenter.length)
    angle = indenter.direction_deg
    if abs(angle) < 2 * math.pi + 0.01 and angle != round(angle):
        remedy = f"if it is, give {math.degrees(angle):.4g} degrees"
        yield Doubt(str(toml), "indenter.direction_deg", f"{angle:g} looks like radians", remedy)
    slant = _slant_deg(subject)
    if slant > _GRAZING_DEG:
        problem = f"the cylinder meets the skin at {slant:.0f} degrees from its normal, at the leg's edge"
        remedy = "check aim_mm and direction_deg (degrees from +x, counter-clockwise) with a picture"
        yield from Doubt(str(toml), "indenter.aim_mm", problem, remedy).refused_if(slant > _MISSING_DEG)


def _slant_deg(subject: Subject) -> float:
    """Return the angle between the line of travel and the skin's inward normal at first touch."""
    skin, indenter = subject.section.polygon("skin"), subject.indenter
    way = first_crossing(skin.buffer(indenter.radius).exterior, indenter.aim, indenter.direction)
    centre: FloatArray = indenter.aim + way * indenter.direction
    place = skin.exterior.interpolate(skin.exterior.project(Point(centre)))
    inward = np.array([place.x, place.y]) - centre
    cosine = float(inward @ indenter.direction) / float(np.linalg.norm(inward))
    return math.degrees(math.acos(np.clip(cosine, -1.0, 1.0)))


def _tissue(toml: Path, field: str, tissue: TissueParameters) -> Iterator[Doubt]:
    name = field.rpartition(".")[2]
    yield from RANGES["D1"].doubts(toml, f"{field}.D1_per_MPa", tissue.D1)
    if tissue.C10 is None:
        return
    yield from c10_of(name).doubts(toml, f"{field}.C10_kPa", mpa_to_kpa(tissue.C10))
    if tissue.C20 is not None:
        yield from RANGES["stiffening"].doubts(toml, f"{field}.C20_kPa", tissue.C20 / tissue.C10)
    ratio = poisson_ratio(tissue)
    # A thin sheet's change of volume moves nothing: the published fascia's ratio is below zero.
    if name != "fascia" and ratio is not None and ratio < 0:
        problem = f"Poisson's ratio is {ratio:.2f} with the C10 and D1 given"
        yield Doubt(str(toml), f"{field}.D1_per_MPa", problem, "soft tissues' is near 0.5: check the units of both")


_OUTSIDE = float(ndtri(0.995))
"""Standard deviations of the logarithm beyond which one in a hundred people is."""
_USUAL = 2.0
"""Within which a unit explains it."""
_AT_SMALL_STRAIN = 0.5
"""Of C20, that a neo-Hookean C10 of the same force has more: 0.46 to 1.3 of it between Tables 4 and
5 of Frauziols et al. (2015)."""
_IN_FRONT = 0.5
"""Cosine of the angle between first bone and cylinder, above which a leg is pressed at its shin."""
_PLACES = {SHIN: "the shin", ANYWHERE: "arms and legs"}
_MOST_TOLD = 3


def doubts_about_stiffness(subject: Subject, parameters: Mapping[str, Estimate]) -> tuple[Doubt, ...]:
    """Return stiffnesses that nobody has found so, and those that few people have.

    Left out are those that the folder says were confirmed.
    """
    toml = subject.directory / "subject.toml"
    of_people = tuple(_doubts_beside_people(subject, parameters))
    said = {doubt.field for doubt in of_people}
    published = (
        doubt
        for name, one in parameters.items()
        if name.endswith(".C10") and key_of(name) not in (*said, *subject.confirmed)
        for doubt in c10_of(name.partition(".")[0]).likely(
            toml,
            key_of(name),
            mpa_to_kpa(one.value),
            "doubt the units of force_N, displacement_mm, length_mm and the other tissues' C10_kPa",
        )
    )
    return (*of_people, *published)


def _doubts_beside_people(subject: Subject, parameters: Mapping[str, Estimate]) -> Iterator[Doubt]:
    """Yield a doubt about each C10 that fewer than one in a hundred people have.

    What the recordings leave open of it counts as people's spread does.
    """
    site = SHIN if subject.section.limb == CALF and _at_shin(subject) else subject.people
    for name in () if MUSCLE in subject.section.lacks else TISSUES:
        if name not in parameters or key_of(name) in subject.confirmed:
            continue
        one = parameters[name]
        stiffening = parameters.get(name.replace("C10", "C20"))
        found = one.value + (_AT_SMALL_STRAIN * stiffening.value if stiffening else 0.0)
        if found <= 0:
            continue
        usual = population_prior(name, site)
        sd = math.hypot(usual.sd, one.standard_error / found)
        away = math.log(found / usual.centre)
        if not abs(away) > _OUTSIDE * sd:
            continue
        low, high = (usual.centre * math.exp(k * _OUTSIDE * usual.sd) for k in (-1, 1))
        problem = f"{mpa_to_kpa(found):.3g} kPa is {'stiffer' if away > 0 else 'softer'} than in 99 of "
        problem += f"100 people, {mpa_to_kpa(low):.2g} to {mpa_to_kpa(high):.2g} kPa at "
        problem += f"{_PLACES.get(site, 'the calf')} ({population().source})"
        remedy = "; ".join([*_explained(found, usual), "check units, gain and sizes"])
        yield Doubt(str(subject.directory / "subject.toml"), key_of(name), problem, remedy)


def _explained(found: float, usual: Prior) -> list[str]:
    """Return which units would make a stiffness (MPa) usual, the likeliest first."""
    told = []
    for column in ("force_N", "displacement_mm", "length_mm"):
        for unit, factor in MISTAKEN_UNITS[column].items():
            away, then = abs(usual.departure(factor * found)), mpa_to_kpa(factor * found)
            if away < _USUAL:
                told.append((away, f"{column} in {unit}, it would be some {then:.2g} kPa"))
    likeliest = [text for _, text in sorted(told)[:_MOST_TOLD]]
    return [f"were {', or '.join(likeliest)}"] if likeliest else []


def _at_shin(subject: Subject) -> bool:
    """Return whether a calf is pressed from where its first bone is."""
    shin, skin = (subject.section.polygon(part).centroid for part in (LIMBS[CALF][0], "skin"))
    front = np.array([shin.x - skin.x, shin.y - skin.y])
    return float(-subject.indenter.direction @ front) > _IN_FRONT * float(np.linalg.norm(front))
