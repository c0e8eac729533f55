"""What is said of specimens in sentences."""

from __future__ import annotations

from collections.abc import Sequence

from legfem.experiments.axisymmetric import BallOnLayer, CylinderBetweenPlates
from legfem.experiments.flat_punch import PunchOnLayer
from legfem.experiments.lateral_cylinder import CylinderOnBlock
from legfem.experiments.suction import CupOnLayer
from legfem.experiments.uniaxial import UniaxialSpecimen
from legfem.inverse.catalogue import is_ratio
from legfem.report.words import ORIGINS
from legfem.specimens.comparison import SHAPE_SD_OF_LAYERS
from legfem.specimens.result import ComparedRecording, SpecimenResult
from legfem.specimens.sizes import Sizes, bare, opening_of

_SIMULATED = "simulated data (forces computed by a model; no specimen was measured)"


def origin_text(result: SpecimenResult) -> str:
    """Return what kind of data they are, in words."""
    origin = result.folder.origin
    return _SIMULATED if origin == "simulated" else ORIGINS[origin]


def procedure(result: SpecimenResult) -> str:
    """Return what was done with the recordings, as a paragraph."""
    tests = list(dict.fromkeys(one.sizes for one in result.folder.recordings))
    relaxing = (
        "Its stress relaxes by one log-normal spectrum of times, the faster the more it is "
        "strained where two rates say so, and else quasi-linear: exact where all of the specimen "
        "is strained alike, and at small strain elsewhere. "
        if result.folder.relaxes
        else ""
    )
    own = (
        "Each specimen has a stiffness of its own, a factor on all of the law's; the law's is that "
        "of a typical specimen, their geometric mean, and its interval carries how they differ. "
        if result.stiffness
        else ""
    )
    until = (
        "to where hardly any force was left, returns as they were driven. "
        if result.folder.returns
        else "to the first return; what was recorded after that was not used. "
    )
    return (
        f"{len(result.fitted)} recordings were fitted together by one law, each counting alike "
        f"and relative to its greatest force, from first contact {until}{relaxing}"
        f"{own}{_of_layers(result)}{_of_fibres(result)}{_of_a_cup(tests)}"
        "A genetic algorithm (pygad) searched on an emulator of the tests, which full solves "
        "refined and confirmed. Intervals carry the instrument's errors, the model's, and how "
        "recordings differ by a factor "
        f"({100 * result.gain_sd:.2g} %)."
    )


def _of_layers(result: SpecimenResult) -> str:
    tissues = result.folder.tissues
    if len(tissues) == 1:
        return ""
    stated = [one.name for one in tissues if "C10" in one.stated]
    held = f"the stiffness of {', '.join(stated)} is as stated, and " if stated else ""
    return (
        f"The layers are bonded to each other; {held}the shape of a curve counts as known to "
        f"{100 * SHAPE_SD_OF_LAYERS:.0f} %, since what the law leaves out bends it as layers of "
        "unlike stiffness do. "
    )


def _of_fibres(result: SpecimenResult) -> str:
    (ratio,) = [name for name in result.values if is_ratio(name)] or [""]
    if not ratio:
        return ""
    sought = ratio in result.parameters
    shape = (
        "the bend of a curve counts for nothing, since fibres that are slack at first bend it by "
        "tens of percent otherwise"
        if result.untold
        else f"the shape of a curve counts as known to {100 * SHAPE_SD_OF_LAYERS:.0f} %"
    )
    typical = (
        "Typical specimens of each direction count as of one stiffness, one that was turned as the same. "
        if sought and result.stiffness and not result.untold
        else ""
    )
    return (
        "The tissue is stiffer along its fibres: the ratio of its shear moduli is "
        f"{'looked for' if sought else f'taken to be {result.values[ratio]:.3g}'}, Young's modulus "
        f"along them four times the one along less the one across; {shape}. {typical}"
    )


def _of_a_cup(tests: Sequence[Sizes]) -> str:
    if opening_of(tests[0]) is None:
        return ""
    return (
        "Displacement is the dome's height at its middle, force the suction times the area of the "
        "cup's opening; the cup is held where it touches. "
    )


_FOLLOWED: dict[type, str] = {
    BallOnLayer: "a ball_diameter_mm of half the true one makes it about 1.4 times, or twice on a thin layer",
    PunchOnLayer: "a punch_diameter_mm of half the true one makes it at least twice",
    CylinderBetweenPlates: "a diameter_mm of half the true one makes it at least four times",
    CylinderOnBlock: "a length_mm of half the true one makes it twice",
    UniaxialSpecimen: "an area_mm2 of half the true one makes it twice",
    CupOnLayer: "an opening_mm of half the true one makes it about half",
}
"""At small strain: Hertz; Boussinesq; a stress on an area; a dome as wide as its opening."""


def followed(result: SpecimenResult) -> str:
    """Return how stiffness follows the size of what presses or is pressed, as a clause."""
    return _FOLLOWED[type(bare(result.folder.recordings[0].sizes))]


def differing(result: SpecimenResult) -> list[str]:
    """Return how the specimens' stiffness differs, where each has its own."""
    own = result.stiffness
    if not own:
        return []
    low, high = min(own.values()), max(own.values())
    return [
        f"of a typical specimen: {len(own)} specimens are {low:.2f} to {high:.2f} times as stiff "
        f"(standard deviation of the logarithm {result.stiffness_spread:.2f})"
    ]


def _of_its_own(result: SpecimenResult, one: ComparedRecording) -> str:
    if not result.stiffness:
        return ""
    if one.specimen in result.stiffness:
        return ", by the stiffness that its specimen has in others"
    return f"; were it {one.scale:.2f} times as stiff as a typical one, {one.shape_r_squared:.3f}"


def predictions(result: SpecimenResult) -> list[str]:
    """Return how well what was left out is predicted."""
    return [
        f"left out, {one.name}: predicted with R2 {one.r_squared:.3f}, rmse {one.rmse:.3g} N "
        f"({100 * one.rmse / one.course.peak:.2g} % of {one.course.peak:.3g} N)"
        f"{_of_its_own(result, one)}"
        for one in result.held_out
    ]
