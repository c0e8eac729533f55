"""The tests of specimens that ``specimen.toml`` describes, with the sizes of each specimen."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from legfem.common.input_files import FileTable
from legfem.experiments.axisymmetric import BallIndentation, BallOnLayer, CylinderBetweenPlates, CylinderCompression
from legfem.experiments.flat_punch import FlatPunchIndentation, PunchOnLayer
from legfem.experiments.lateral_cylinder import CylinderOnBlock, LateralCylinder
from legfem.experiments.suction import CupOnLayer, SuctionTest
from legfem.experiments.uniaxial import UniaxialSpecimen, UniaxialTest
from legfem.specimens.fibre_directions import WORDS, Direction
from legfem.specimens.schema import (
    SIZES,
    BallEntry,
    BarEntry,
    CylinderEntry,
    PlatesEntry,
    PunchEntry,
    SpecimenEntry,
    SpecimenFile,
    SuctionEntry,
    TestEntry,
)

OnLayers = BallOnLayer | PunchOnLayer | CylinderOnBlock | CupOnLayer


@dataclass(frozen=True)
class LayeredTest:
    """A test of layers on each other.

    Parameters
    ----------
    whole
        The test, on a layer as thick as all together.
    layers
        Names and thicknesses (mm), from the base up.
    """

    whole: OnLayers
    layers: tuple[tuple[str, float], ...]


OneTissue = OnLayers | CylinderBetweenPlates | UniaxialSpecimen


@dataclass(frozen=True)
class FibrousTest:
    """A test of a tissue that has fibres, or of layers of which one has.

    Parameters
    ----------
    whole
        The test.
    direction
        Of the fibres.
    """

    whole: OneTissue | LayeredTest
    direction: Direction

    @property
    def level(self) -> str:
        """What tells tests apart in which stiffness and the fibres' ratio trade off otherwise.

        In plane strain fibres along the travel and across resist small strain alike.
        """
        if isinstance(bare(self), CylinderOnBlock):
            return WORDS["cylinder"] if self.direction == "cylinder" else "in the cylinder's plane"
        return WORDS[self.direction]


Sizes = OneTissue | LayeredTest | FibrousTest
Pressed = BallIndentation | FlatPunchIndentation | CylinderCompression | LateralCylinder
Test = Pressed | UniaxialTest | SuctionTest


_WORDS: dict[type, str] = {
    BallOnLayer: "a ball on a layer",
    PunchOnLayer: "a flat punch on a layer",
    CylinderBetweenPlates: "between plates",
    CylinderOnBlock: "a cylinder across a block",
    UniaxialSpecimen: "a bar",
    CupOnLayer: "a suction cup on a layer",
}


_SYMMETRIC: dict[type, tuple[Direction, ...]] = {
    UniaxialSpecimen: ("load", "across"),
    CylinderOnBlock: ("load", "across", "cylinder"),
}
"""Directions of fibres that leave a test as symmetric as it is; else along the load alone."""


def bare(sizes: Sizes) -> OneTissue:
    """Return a test without what is in it."""
    return bare(sizes.whole) if isinstance(sizes, LayeredTest | FibrousTest) else sizes


def layered(sizes: Sizes) -> LayeredTest | None:
    """Return a test's layers; None of one tissue."""
    if isinstance(sizes, FibrousTest):
        return layered(sizes.whole)
    return sizes if isinstance(sizes, LayeredTest) else None


def level_of(sizes: Sizes) -> str:
    """Return a test's `FibrousTest.level`; "" without fibres."""
    return sizes.level if isinstance(sizes, FibrousTest) else ""


def fibres_text(sizes: Sizes) -> str:
    """Return how a test's fibres lie; "" without."""
    return f"fibres {WORDS[sizes.direction]}" if isinstance(sizes, FibrousTest) else ""


def lengths_of(sizes: Sizes) -> dict[str, float]:
    """Return a test's sizes by name: mm, and mm² of an area."""
    if isinstance(sizes, FibrousTest):
        return lengths_of(sizes.whole)
    if isinstance(sizes, LayeredTest):
        whole = lengths_of(sizes.whole)
        del whole["thickness"]
        return whole | {name + _OF_LAYER: thickness for name, thickness in sizes.layers}
    return {name: value for name, value in asdict(sizes).items() if isinstance(value, float)}


def resized(sizes: Sizes, name: str, value: float) -> Sizes:
    """Return a test with another of the sizes of `lengths_of`."""
    if isinstance(sizes, FibrousTest):
        whole = resized(sizes.whole, name, value)
        assert not isinstance(whole, FibrousTest)
        return replace(sizes, whole=whole)
    if isinstance(sizes, LayeredTest):
        layers = tuple((layer, value if layer + _OF_LAYER == name else thickness) for layer, thickness in sizes.layers)
        own: dict[str, Any] = {"thickness": sum(thickness for _, thickness in layers)}
        if layers == sizes.layers:
            own[name] = value
        return LayeredTest(replace(sizes.whole, **own), layers)
    changed: Any = replace(sizes, **{name: value})  # type: ignore[arg-type]
    return changed  # type: ignore[no-any-return]


_OF_LAYER = "_thickness"


def opening_of(sizes: Sizes) -> float | None:
    """Return the area of a suction cup's opening (mm2): a suction on it is its force."""
    whole = bare(sizes)
    return whole.opening if isinstance(whole, CupOnLayer) else None


class SizeError(Exception):
    """A size, what is wrong with it and how to mend that."""


def sizes_of(given: SpecimenFile, specimen: SpecimenEntry | None) -> Sizes:
    """Return a specimen's test, with the sizes of its own.

    Raises
    ------
    SizeError
        For a size that the test hasn't, or that isn't given; for fibres of no direction, or of one
        that breaks the test's symmetry.
    """
    whole = _without_fibres(given, specimen)
    if given.fibres is None:
        return whole
    own = None if specimen is None else specimen.fibres
    direction, kind = own or given.fibres.direction, type(bare(whole))
    known = _SYMMETRIC.get(kind, ("load",))
    key = "fibres.direction" if own is None else "fibres"
    if direction is None:
        raise SizeError(key, "missing", "give it in [fibres], or as fibres with every [[specimen]]")
    if direction not in known:
        names = " or ".join(f'"{one}"' for one in known)
        raise SizeError(
            key,
            f'"{direction}" breaks the symmetry of {_WORDS[kind]}',
            f"give {names}; other directions take a cylinder across a block, or bars",
        )
    return FibrousTest(whole, direction)


def _without_fibres(given: SpecimenFile, specimen: SpecimenEntry | None) -> OneTissue | LayeredTest:
    own = {key: getattr(specimen, key) for key in SIZES if getattr(specimen, key, None)}
    for key in own:
        if key not in type(given.test).model_fields:
            raise SizeError(key, "is no size of this test", "remove it")
    layers = _layers(given, specimen)
    if not layers:
        return _sizes(given.test.model_copy(update=own))
    if "thickness_mm" in own or getattr(given.test, "thickness_mm", None) is not None:
        raise SizeError("thickness_mm", "is that of the layers together", "remove it")
    own["thickness_mm"] = sum(thickness for _, thickness in layers)
    whole = _sizes(given.test.model_copy(update=own))
    assert isinstance(whole, OnLayers)
    return LayeredTest(whole, layers)


def _layers(given: SpecimenFile, specimen: SpecimenEntry | None) -> tuple[tuple[str, float], ...]:
    """Return names and thicknesses of a specimen's layers, from the base up."""
    own = None if specimen is None else specimen.layers_mm
    if own is None:
        own = [_given(layer, "thickness_mm", "give it, or layers_mm with every [[specimen]]") for layer in given.layers]
    elif len(own) != len(given.layers):
        raise SizeError("layers_mm", f"{len(own)} thicknesses of {len(given.layers)} [[layers]]", "give one a layer")
    names = [layer.name for layer in given.layers]
    return tuple(zip(reversed(names), reversed(own), strict=True))


def sizes_text(sizes: Sizes) -> str:
    """Return a specimen's test with its sizes, as people read them."""
    if isinstance(sizes, FibrousTest):
        return f"{sizes_text(sizes.whole)}; {fibres_text(sizes)}"
    if isinstance(sizes, LayeredTest):
        layers = " on ".join(f"{name} {thickness:g} mm" for name, thickness in sizes.layers[::-1])
        return f"{sizes_text(sizes.whole)}; {layers}"
    told = (
        f"{name.replace('_', ' ')} "
        + (value if isinstance(value, str) else f"{value:g} {'mm²' if name == 'area' else 'mm'}")
        for name, value in asdict(sizes).items()
    )
    return f"{_WORDS[type(sizes)]}: {', '.join(told)}"


def _sizes(test: TestEntry) -> OneTissue:
    match test:
        case BallEntry():
            return BallOnLayer(
                _given(test, "thickness_mm"),
                test.ball_diameter_mm / 2,
                _given(test, "diameter_mm") / 2,
                test.ball,
                test.base,
            )
        case PunchEntry():
            radius = test.punch_diameter_mm / 2
            return PunchOnLayer(
                _given(test, "thickness_mm"),
                radius,
                test.edge_mm or 0.05 * radius,
                _given(test, "diameter_mm") / 2,
                test.punch,
                test.base,
            )
        case PlatesEntry():
            diameter, height = _given(test, "diameter_mm"), _given(test, "height_mm")
            return CylinderBetweenPlates(diameter / 2, height, test.ends)
        case CylinderEntry():
            thickness, width, length = (_given(test, key) for key in ("thickness_mm", "width_mm", "length_mm"))
            radius = test.cylinder_diameter_mm / 2
            return CylinderOnBlock(thickness, width, length, radius, test.cylinder, test.base)
        case BarEntry():
            return UniaxialSpecimen(_given(test, "length_mm"), _given(test, "area_mm2"), test.direction)
        case SuctionEntry():
            return CupOnLayer(
                _given(test, "thickness_mm"),
                test.opening_mm / 2,
                test.rim_mm,
                _given(test, "diameter_mm") / 2,
                test.rim,
                test.base,
            )


def _given(entry: FileTable, key: str, remedy: str = "give it with the test, or with every [[specimen]]") -> float:
    value: float | None = getattr(entry, key)
    if value is None:
        raise SizeError(key, "missing", remedy)
    return value
